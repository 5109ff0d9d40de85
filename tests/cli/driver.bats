# SPDX-License-Identifier: GPL-2.0-or-later
# A driver chip of rig.conf as a user meets it: a stepper of a module that moves for 5 ms at each look, and a
# TMC2209 of tests/unit/tmc/chip.h on a pseudo terminal, whose load is 300, 200 from 3 mm/s on.

load cli

CC=${CC:-cc}

setup() {
	work_folder
	mkdir modules
	ln -s "$INCISE_BUILD/lib/incise/driver_tmc2209.so" modules/
	export INCISE_MODULE_PATH=$PWD/modules
	cat >chip.c <<-END
		#include <stdint.h>
		#include <stdio.h>
		#include "$root/tests/unit/tmc/chip.h"
		static struct chip_line line;
		static void look(struct chip_line *l)
		{
			l->reg[0][CHIP_SG_RESULT] = access("fast", F_OK) ? 300 : 200;
			l->reg[0][CHIP_DRV_STATUS] = !access("hot", F_OK) ? 3 :
				!access("warm", F_OK) ? 0x80000001 : 0xc0000000;
		}
		int main(void)
		{
			line.before_read = look;
			if (chip_begin(&line))
				return 1;
			puts(line.path);
			fclose(stdout);
			for (;;)
				pause();
		}
	END
	cat >stepper.c <<-END
		#include <errno.h>
		#include <math.h>
		#include <stdio.h>
		#include <string.h>
		#include <unistd.h>
		#include <incise/backend.h>
		static struct mine {
			struct incise_stepper stepper;
			struct incise_driver *driver;
			double mm, mm_s;
		} mine;
		static int sets;
		static unsigned int faults(void) { return mine.driver ? mine.driver->ops->faults(mine.driver) : 0; }
		static int set(struct incise_stepper *s, double mm)
		{
			(void)s;
			mine.mm = mm;
			mine.mm_s = 0;
			if (++sets == 500 && !access("heats", F_OK))
				fclose(fopen("hot", "w"));
			return faults() ? -EIO : 0;
		}
		static int jog(struct incise_stepper *s, double mm_s)
		{
			(void)s;
			mine.mm_s = mm_s;
			if (mm_s >= 3)
				fclose(fopen("fast", "w"));
			else
				unlink("fast");
			return faults() ? -EIO : 0;
		}
		static int status(struct incise_stepper *s, struct incise_stepper_status *to)
		{
			(void)s;
			mine.mm = fmin(4, mine.mm + mine.mm_s * 0.005);
			*to = (struct incise_stepper_status){.position_mm = mine.mm, .velocity_mm_s = mine.mm_s,
				.handle_mm = NAN, .force_N = NAN, .homed = access("lost", F_OK), .faults = faults(),
				.state = faults() ? INCISE_STEPPER_STATE_FAULT :
					mine.mm_s ? INCISE_STEPPER_STATE_MOVING : INCISE_STEPPER_STATE_READY};
			return 0;
		}
		static int nothing(struct incise_stepper *s, struct incise_error *err) { (void)s; (void)err; mine.mm_s = 0; return 0; }
		static void info(const struct incise_stepper *s, struct incise_stepper_info *to)
		{
			(void)s;
			*to = (struct incise_stepper_info){.name = "mine", .spring_N_mm = 2, .travel_mm = 4,
				.step_mm = 0.01, .velocity_mm_s = 10, .acceleration_mm_s2 = 100, .deadman_s = 1};
		}
		static void closed(struct incise_stepper *s) { (void)s; }
		static int attach(struct incise_stepper *s, struct incise_driver *d) { (void)s; mine.driver = d; return 0; }
		static int chip(struct incise_stepper *s, struct incise_stepper_chip *to)
		{
			(void)s;
			return mine.driver ? mine.driver->ops->read(mine.driver, to) : -EOPNOTSUPP;
		}
		static int counter(struct incise_stepper *s, int i, struct incise_stepper_counter *to)
		{
			(void)s;
			return mine.driver ? mine.driver->ops->counter(mine.driver, i, to) : -ENOENT;
		}
		static int cause(struct incise_stepper *s, char *text, size_t size)
		{
			(void)s;
			return mine.driver ? mine.driver->ops->cause(mine.driver, text, size) : 0;
		}
		static const struct incise_stepper_ops ops = {.set = set, .jog = jog, .status = status,
			.enable = nothing, .disable = nothing, .clear = nothing, .info = info, .close = closed,
			.counter = counter, .cause = cause, .attach = attach, .chip = chip};
		static void *open_mine(const struct incise_backend_request *asked, struct incise_error *err)
		{
			(void)asked;
			(void)err;
			mine.stepper.ops = &ops;
			return &mine;
		}
		const struct incise_backend incise_backend = {INCISE_BACKEND_ABI, "stepper", "mine", open_mine};
	END
	$CC -shared -fPIC -Wall -Werror -I"$root/lib/include" -o modules/stepper_mine.so stepper.c
	$CC -D_GNU_SOURCE -Wall -o chip chip.c -pthread
	./chip >path &
	pid=$!
	until [ -s path ]; do sleep 0.01; done
	rig "tmc2209:$(cat path):0"
}

teardown() {
	[ -z "$pid" ] || kill -9 "$pid" 2>/dev/null || :
}

rig() { # DRIVER, KEY...
	cat >rig.conf <<-END
		tracker = "sim:";
		stepper = "mine:";
		actuator = { spring_N_mm = 2.0; travel_mm = 4.0; lead_mm = 8.0;
			driver = "$1"; $2
			tmc = { sense_ohm = 0.11; run_A = 0.6; hold_A = 0.3; stall_mm_s = 2; stall_threshold = 60;
				answer_ms = 10000; }; };
	END
}

# bats test_tags=check
@test "status shows the chip, and changes nothing in it" {
	run -0 --separate-stderr incise stepper status
	# As after a reset: 256 microsteps.
	[[ "$output" == *"driver     tmc2209:$(cat path):0: 0.61 A, 0.31 A at rest, 256 microsteps, StealthChop, temperature normal, StallGuard 300 (threshold 60)"* ]]
	incise stepper status --json >s.json
	[ "$(key s.json driver.microsteps)" = 256 ]
	[ "$(key s.json driver.load)" = 300 ]
	run -0 --separate-stderr incise stepper move 1
	touch warm
	run -0 --separate-stderr incise stepper status
	[[ "$output" == *", 16 microsteps, "*"too warm: cool it"* ]]
}

# bats test_tags=check
@test "tune prints StallGuard's values by speed and advises a threshold" {
	run -0 --separate-stderr incise stepper tune 2,8mm/s
	[ "${lines[0]}" = "    mm/s  values  load min   mean   max  stall_threshold" ]
	[[ "${lines[1]}" == "       2 "*"      75" ]]
	[[ "${lines[2]}" == "       8 "*"      50" ]]
	[ "${lines[3]}" = "advised: stall_threshold = 50; now 60" ]
	incise stepper tune 2 --json >t.json
	[ "$(key t.json command)" = tune ]
	[ "$(key t.json speeds[0].load_min)" = 300 ]
	[ "$(key t.json stall_threshold)" = 75 ]
}

@test "a fault of the chip ends a motion with its reason" {
	touch hot
	run -1 --separate-stderr incise stepper tune 2
	[[ "$stderr" == *"driver tmc2209:$(cat path):0: too hot, it switched the motor off; cool it, or give a smaller run_A, then clear, enable and home" ]]
}

@test "a fault of the chip ends the haptic loop with its reason, and a warning is reported" {
	touch heats
	run --separate-stderr incise haptic "$root/scenes/wall.scene" -c none
	[ "$status" -eq 1 ]
	[[ "$stderr" == *": a device failed at tick "*": driver tmc2209:"*": too hot, it switched the motor off;"*"; the force was removed" ]]
	rm hot heats
	touch warm
	run -0 --separate-stderr incise haptic "$root/scenes/wall.scene" -c none --duration 1s
	[[ "$output" == *"actuator   temperature warnings of the chip: 1"* ]]
}

@test "refused: no chip, not homed, too fast, no line, settings" {
	touch lost
	fails incise stepper tune 2 -- "mine is not homed" --unhomed
	run -0 --separate-stderr incise stepper tune 2 --unhomed
	fails incise stepper tune 2,20 --unhomed -- "20 mm/s is faster than 10 mm/s" mine
	kill -9 "$pid"
	fails incise stepper tune 2 -- rig.conf:2 driver "$(cat path)"
	rig "tmc2209:/nowhere:1"
	fails incise stepper tune 2 -- rig.conf:2 driver /nowhere
	rig "tmc2209:/nowhere:1" "microsteps = 24;"
	fails incise stepper tune 2 -- actuator.microsteps "a power of two"
	sed 's/.attach = attach, //' stepper.c >other.c
	$CC -shared -fPIC -w -I"$root/lib/include" -o modules/stepper_mine.so other.c
	rig "tmc2209:/nowhere:1"
	fails incise stepper tune 2 -- rig.conf:2 "remove the key driver"
	sed -i '/driver/d' rig.conf
	fails incise stepper tune 2 --unhomed -- "names no driver chip"
}
