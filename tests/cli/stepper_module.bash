# SPDX-License-Identifier: GPL-2.0-or-later
# A stepper of one's own, as a module from outside the tree: `load stepper_module`.
# shellcheck shell=bash

CC=${CC:-cc}

# Modules are looked for in a folder of this test.
module_folder() {
	mkdir modules
	export INCISE_MODULE_PATH=$PWD/modules
}

# A stepper that stands where it was told to, and says when it is loaded. Words in its
# arguments make it another one: lost (its 0 is not known), switch, pressed (an e-stop after 20
# targets), left (a fault of a program that died), latched (an e-stop), hangs (at its
# 500th target, from then on there is a file hangs, until there is a file goes), slow (2.5 ms a target).
make_module() { # FILE NAME ABI
	cat >mine.c <<-END
		#include <errno.h>
		#include <math.h>
		#include <stdio.h>
		#include <string.h>
		#include <unistd.h>
		#include <incise/backend.h>
		static struct mine { struct incise_stepper stepper; double mm; char name[64]; } mine;
		__attribute__((constructor)) static void loaded(void) { fputs("loaded\n", stderr); }
		static int sets; static unsigned int faults;
		static int has(const char *word) { return strstr(mine.name, word) != NULL; }
		static int set(struct incise_stepper *s, double mm)
		{
			((struct mine *)s)->mm = mm;
			sets++;
			if (has("pressed") && sets > 20)
				faults = INCISE_STEPPER_FAULT_ESTOP;
			if (has("hangs") && sets == 500) {
				fclose(fopen("hangs", "w"));
				while (access("goes", F_OK))
					usleep(1000);
			}
			if (has("slow") && sets > 20)
				usleep(2500);
			return faults ? -EIO : 0;
		}
		static int status(struct incise_stepper *s, struct incise_stepper_status *status)
		{
			*status = (struct incise_stepper_status){.position_mm = ((struct mine *)s)->mm,
				.handle_mm = NAN, .force_N = NAN, .state = INCISE_STEPPER_STATE_READY,
				.homed = !strstr(((struct mine *)s)->name, "lost"), .faults = faults};
			return 0;
		}
		/* What can be cleared was left by a program that died. */
		static int clear(struct incise_stepper *s, struct incise_error *err)
		{
			(void)s; (void)err;
			if (faults == INCISE_STEPPER_FAULT_OWNER)
				faults = 0;
			fputs("cleared\n", stderr);
			return 0;
		}
		static int nothing(struct incise_stepper *s, struct incise_error *err) { (void)s; (void)err; return 0; }
		static void info(const struct incise_stepper *s, struct incise_stepper_info *info)
		{
			*info = (struct incise_stepper_info){.spring_N_mm = 2, .travel_mm = 20, .step_mm = 0.01,
				.velocity_mm_s = 10, .acceleration_mm_s2 = 100, .deadman_s = 1,
				.can_home = strstr(((const struct mine *)s)->name, "switch")};
			strcpy(info->name, ((const struct mine *)s)->name);
		}
		static void closed(struct incise_stepper *s) { (void)s; fputs("closed\n", stderr); }
		static const struct incise_stepper_ops ops = {.set = set, .status = status, .enable = nothing,
			.disable = nothing, .clear = clear, .info = info, .close = closed};
		static void *open_mine(const struct incise_backend_request *asked, struct incise_error *err)
		{
			(void)err;
			mine.stepper.ops = &ops;
			snprintf(mine.name, sizeof(mine.name), "mine at %s", asked->arguments);
			faults = has("left") ? INCISE_STEPPER_FAULT_OWNER : has("latched") ? INCISE_STEPPER_FAULT_ESTOP : 0;
			fprintf(stderr, "opened %s, lead %g\n", mine.name, asked->actuator->lead_mm);
			return &mine;
		}
		const struct incise_backend incise_backend = {$3, "stepper", "$2", open_mine};
	END
	$CC -shared -fPIC -Wall -Werror -I"$root/lib/include" -o "modules/$1.so" mine.c
}

rig() { # STEPPER
	cat >rig.conf <<-END
		tracker = "sim:";
		stepper = "$1";
		actuator = { spring_N_mm = 2.0; travel_mm = 20.0; lead_mm = 3.0; };
	END
}
