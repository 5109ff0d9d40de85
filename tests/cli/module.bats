# SPDX-License-Identifier: GPL-2.0-or-later
# Modules of devices: anyone can write one, and it is loaded just when rig.conf names it.

load cli

setup() {
	work_folder
	CC=${CC:-cc}
	cp "$root/scenes/liver.scene" "$root/scenes/liver.fis" .
	mkdir modules
	export INCISE_MODULE_PATH=$PWD/modules
}

# A stepper that stands where it was told to, and says when it is loaded.
make_module() { # FILE NAME ABI
	cat >mine.c <<-END
		#include <errno.h>
		#include <math.h>
		#include <stdio.h>
		#include <string.h>
		#include <incise/backend.h>
		static struct mine { struct incise_stepper stepper; double mm; char name[64]; } mine;
		__attribute__((constructor)) static void loaded(void) { fputs("loaded\n", stderr); }
		static int sets; static unsigned int faults;
		static int set(struct incise_stepper *s, double mm)
		{
			((struct mine *)s)->mm = mm;
			if (strstr(((struct mine *)s)->name, "pressed") && ++sets > 20)
				faults = INCISE_STEPPER_ESTOP;
			return faults ? -EIO : 0;
		}
		static int status(struct incise_stepper *s, struct incise_stepper_status *status)
		{
			*status = (struct incise_stepper_status){.position_mm = ((struct mine *)s)->mm,
				.handle_mm = NAN, .force_N = NAN, .state = INCISE_STEPPER_READY,
				.homed = !strstr(((struct mine *)s)->name, "lost"), .faults = faults};
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
			.disable = nothing, .clear = nothing, .info = info, .close = closed};
		static void *open_mine(const struct incise_backend_request *asked, struct incise_error *err)
		{
			(void)err;
			mine.stepper.ops = &ops;
			snprintf(mine.name, sizeof(mine.name), "mine at %s", asked->arguments);
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

@test "a module from outside the tree is loaded when it is named, and drives" {
	make_module stepper_mine mine INCISE_BACKEND_ABI
	rig mine:42
	run -0 --separate-stderr incise haptic liver.scene --rig rig.conf --duration 0.1s
	[ "${stderr_lines[0]}" = loaded ]
	[ "${stderr_lines[1]}" = "opened mine at 42, lead 3" ]
	[[ "$stderr" == *closed* ]]
	[[ "$output" == *" actuate"* ]]
}

@test "an actuator whose 0 is not known is refused, or taken as it stands" {
	make_module stepper_mine mine INCISE_BACKEND_ABI
	rig "mine:lost with switch"
	run --separate-stderr incise haptic liver.scene --rig rig.conf --duration 0.1s
	[ "$status" -eq 1 ]
	[[ "${stderr_lines[-1]}" == "incise haptic: mine at lost with switch is not homed; run \`incise stepper home --rig rig.conf\`, or give --home" ]]
	# It has a switch, but no way to go there.
	run --separate-stderr incise haptic liver.scene --rig rig.conf --duration 0.1s --home
	[ "$status" -eq 1 ]
	[[ "${stderr_lines[-1]}" == *"mine at lost with switch cannot be homed"* ]]
	rig "mine:lost"
	run -0 --separate-stderr incise haptic liver.scene --rig rig.conf --duration 0.1s
	[[ "$stderr" == *"warning: mine at lost cannot be homed: its 0 is where it stands"* ]]
}

@test "a fault of the actuator ends the loop with its name" {
	make_module stepper_mine mine INCISE_BACKEND_ABI
	rig "mine:pressed"
	run --separate-stderr incise haptic liver.scene --rig rig.conf --duration 10s
	[ "$status" -eq 1 ]
	[[ "${stderr_lines[-1]}" == "incise haptic: liver.scene: a device failed at tick 21: e-stop: release it, then clear; the force was taken away" ]]
	[[ "$output" == "21 ticks"* ]]
}

@test "a module that is not named is not loaded" {
	make_module stepper_mine mine INCISE_BACKEND_ABI
	rig sim:
	run -0 --separate-stderr incise haptic liver.scene --rig rig.conf --duration 0.1s
	[ -z "$stderr" ]
}

@test "the modules that there are stand in the message" {
	make_module stepper_mine mine INCISE_BACKEND_ABI
	touch modules/tracker_other.so modules/stepper_.so modules/stepper_x.txt
	rig other:1
	run --separate-stderr incise haptic liver.scene --rig rig.conf --duration 0.1s
	failed_with 'rig.conf:2: stepper: there is no backend "other"' 'those there are: sim, kernel, mine'
	[[ "$stderr" == *mine ]]
}

@test "a module that is none, or another's, is refused" {
	make_module stepper_mine mine 99
	rig mine:1
	run --separate-stderr incise haptic liver.scene --rig rig.conf --duration 0.1s
	[ "$status" -eq 1 ]
	[[ "${stderr_lines[-1]}" == *"stepper_mine.so: is made for interface 99, this is "*"; build it again" ]]
	make_module stepper_mine other INCISE_BACKEND_ABI
	run --separate-stderr incise haptic liver.scene --rig rig.conf --duration 0.1s
	[ "$status" -eq 1 ]
	[[ "${stderr_lines[-1]}" == *"holds another backend than its name says"* ]]
	echo 'int incise_nothing;' >empty.c
	$CC -shared -fPIC -o modules/stepper_mine.so empty.c
	run --separate-stderr incise haptic liver.scene --rig rig.conf --duration 0.1s
	failed_with "has no symbol incise_backend"
	echo nonsense >modules/stepper_mine.so
	run --separate-stderr incise haptic liver.scene --rig rig.conf --duration 0.1s
	failed_with "rig.conf:2: stepper: the module cannot be loaded"
}

@test "a module that is a pipe is none, and nobody waits for it" {
	mkdir -p modules && rm -f modules/stepper_mine.so && mkfifo modules/stepper_mine.so
	rig mine:1
	run --separate-stderr timeout 10 incise haptic liver.scene --rig rig.conf --duration 0.1s
	failed_with 'there is no backend "mine"'
}

@test "the modules that are built are found beside the library" {
	unset INCISE_MODULE_PATH
	[ -e "$INCISE_BUILD/lib/incise/stepper_gpio.so" ] || skip "libgpiod is not installed"
	rig gpio:no-such-chip
	sed -i 's/lead_mm/lines = { step = 1; dir = 2; }; &/' rig.conf
	run --separate-stderr incise haptic liver.scene --rig rig.conf --duration 0.1s
	failed_with "rig.conf:2: stepper: gpio chip no-such-chip: there is no such chip" gpiodetect
}
