# SPDX-License-Identifier: GPL-2.0-or-later
# The tools on a drive on a bus: the devices found, the drive's own cause of a fault,
# its counters, homing by the drive. The backend and its answers are this test's own; can.bats
# tests the real ones.

load cli

setup_file() {
	mkdir "$BATS_FILE_TMPDIR/modules"
	cd "$BATS_FILE_TMPDIR"
	cat >bench.c <<-'END'
		#include <errno.h>
		#include <math.h>
		#include <stdio.h>
		#include <string.h>
		#include <incise/backend.h>
		/* Its arguments: "bus0" two drives, "empty" none, "dead" none can be asked. */
		static struct incise_stepper stepper;
		static char name[64];
		static double mm;
		static int sets, powered;
		static unsigned int faults;
		static int fails(void) { return !!strstr(name, "failing"); }
		static int set(struct incise_stepper *s, double to_mm)
		{
			(void)s;
			mm = to_mm;
			if (fails() && ++sets > 20)
				faults = INCISE_STEPPER_FAULT_ALARM | INCISE_STEPPER_FAULT_LOST;
			return faults ? -EIO : 0;
		}
		static int status(struct incise_stepper *s, struct incise_stepper_status *status)
		{
			(void)s;
			*status = (struct incise_stepper_status){.position_mm = mm, .handle_mm = NAN,
				.force_N = NAN, .homed = true, .faults = faults,
				.state = faults ? INCISE_STEPPER_STATE_FAULT :
					powered ? INCISE_STEPPER_STATE_READY : INCISE_STEPPER_STATE_DISABLED};
			return 0;
		}
		static int enable(struct incise_stepper *s, struct incise_error *err)
		{
			(void)s; (void)err;
			powered = 1;
			return 0;
		}
		static int disable(struct incise_stepper *s, struct incise_error *err)
		{
			(void)s; (void)err;
			powered = 0;
			return 0;
		}
		static int clear(struct incise_stepper *s, struct incise_error *err)
		{
			(void)s; (void)err;
			faults = 0;
			return 0;
		}
		static void info(const struct incise_stepper *s, struct incise_stepper_info *info)
		{
			(void)s;
			*info = (struct incise_stepper_info){.spring_N_mm = 2, .travel_mm = 20,
				.step_mm = 0.01, .velocity_mm_s = 10, .acceleration_mm_s2 = 100,
				.deadman_s = 1, .can_home = true};
			strcpy(info->name, name);
		}
		static int cause(struct incise_stepper *s, char *text, size_t size)
		{
			(void)s;
			return faults && !strstr(name, "mute") ?
				snprintf(text, size, "%sover-voltage (3210h): see the supply, then clear",
					strstr(name, "named") ? "drive named: " : "") : 0;
		}
		static int counter(struct incise_stepper *s, int i, struct incise_stepper_counter *counter)
		{
			const struct incise_stepper_counter counters[] = {
				{"setpoints", "setpoints sent", 1234, false},
				{"sync_late", "SYNCs sent late", strstr(name, "sound") ? 0 : 3, true},
				{"tpdo_missing", "answers missing", 0, true},
				{"emcy", "emergencies", strstr(name, "sound") ? 0 : 1, true}};
			(void)s;
			if (i > 3)
				return -ENOENT;
			*counter = counters[i];
			return 0;
		}
		static int home(struct incise_stepper *s, const volatile int *stop,
				struct incise_stepper_edge_found *edge, struct incise_error *err)
		{
			(void)s; (void)stop; (void)err;
			mm = 0;
			if (edge)
				*edge = (struct incise_stepper_edge_found){NAN, 0.5};
			return 0;
		}
		static void closed(struct incise_stepper *s) { (void)s; }
		static const struct incise_stepper_ops ops = {.set = set, .status = status,
			.enable = enable, .disable = disable, .clear = clear, .info = info,
			.close = closed, .cause = cause, .counter = counter, .home = home};
		static void *open_it(const struct incise_backend_request *asked, struct incise_error *err)
		{
			(void)err;
			stepper.ops = &ops;
			snprintf(name, sizeof(name), "drive %s", asked->arguments);
			if (strstr(name, "faulty"))
				faults = INCISE_STEPPER_FAULT_ALARM | INCISE_STEPPER_FAULT_LOST;
			return &stepper;
		}
		static int scan(const char *arguments, incise_scan_found *found, void *context,
				struct incise_error *err)
		{
			struct incise_scan_device one = {"bench:bus0:0x10", "PD42-1270, operation enabled", true, 3,
				{{"vendor_id", "0x00000286"}, {"mode", "CSP (8)"}, {"error_code", "none"}}};
			struct incise_scan_device other = {"bench:bus0:0x11", "odd \033[2J, fault", false, 1,
				{{"nmt_state", "pre-operational"}}};
			int rc;
			if (!strcmp(arguments, "dead"))
				return incise_error_set(err, ENETDOWN, "bench:dead: it is down; set it up");
			if (!strcmp(arguments, "empty"))
				return 0;
			rc = found(context, &one);
			if (!rc && strcmp(arguments, "bus0:0x10"))
				rc = found(context, &other);
			return rc;
		}
		const struct incise_backend incise_backend = {.abi = INCISE_BACKEND_ABI,
			.kind = "stepper", .name = "bench", .open = open_it, .scan = scan};
	END
	${CC:-cc} -shared -fPIC -Wall -Werror -I"$root/lib/include" -o modules/stepper_bench.so bench.c
}

setup() {
	work_folder
	export INCISE_MODULE_PATH=$BATS_FILE_TMPDIR/modules
	cp "$root"/scenes/liver.{scene,fis,fis.tex} .
}

rig() { # ARGUMENTS
	cat >rig.conf <<-END
		tracker = "sim:";
		stepper = "bench:$1";
		actuator = { spring_N_mm = 2.0; travel_mm = 20.0; lead_mm = 3.0; };
	END
}

# bats test_tags=check
@test "info of a bus lists its drives, and what rig.conf calls them" {
	run -0 --separate-stderr incise info bench:bus0
	[ -z "$stderr" ]
	diff - <(echo "$output") <<-'END'
		bench:bus0: 2 devices

		PD42-1270, operation enabled
		  stepper    = "bench:bus0:0x10";
		  vendor_id    0x00000286
		  mode         CSP (8)
		  error_code   none

		odd ?[2J, fault
		  nmt_state   pre-operational
	END
	run -0 incise info bench:bus0:0x10
	[ "${lines[0]}" = "bench:bus0:0x10: 1 device" ]
	[ "${#lines[@]}" -eq 6 ]
}

@test "info of a bus as JSON" {
	incise info bench:bus0 --json >r.json
	[ "$(key r.json kind)" = bus ]
	[ "$(key r.json bus)" = bench:bus0 ]
	[ "$(key r.json 'devices[0].device')" = bench:bus0:0x10 ]
	[ "$(key r.json 'devices[0].what')" = "PD42-1270, operation enabled" ]
	[ "$(key r.json 'devices[0].vendor_id')" = 0x00000286 ]
	[ "$(key r.json 'devices[0].mode')" = "CSP (8)" ]
	[ "$(key r.json 'devices[1].nmt_state')" = pre-operational ]
	[ "$(key r.json 'devices[0].usable')" = 1 ]
	[ "$(key r.json 'devices[1].usable')" = 0 ]
	[ "$(sqlite3 :memory: "SELECT json_array_length(readfile('r.json'), '\$.devices')")" = 2 ]
}

# bats test_tags=check
@test "info of a bus where nobody is, or that cannot be asked" {
	for json in "" --json; do
		# shellcheck disable=SC2086
		run --separate-stderr incise info bench:empty $json
		failed_with "bench:empty: no answer" power "node id" "120 ohm"
		[ -z "$output" ]
		# shellcheck disable=SC2086
		fails incise info bench:dead $json -- "bench:dead: it is down; set it up"
		[ -z "$output" ]
	done
}

@test "info of a bus whose backend is not there, or cannot look" {
	run --separate-stderr incise info nosuch:can0
	failed_with 'nosuch:can0: no such backend "nosuch"; there are: sim, bench'
	run --separate-stderr env -u INCISE_MODULE_PATH incise info kernel:/dev/incise-stepper0
	failed_with "kernel:/dev/incise-stepper0:"
}

@test "a file with a colon in its name is a file by its ending, or by its path" {
	cp liver.fis a:1.fis
	run -0 --separate-stderr incise info a:1.fis
	[[ "$output" == "model "* ]]
	cp liver.fis bench:bus0
	run -0 --separate-stderr incise info bench:bus0
	[[ "$output" == "bench:bus0: 2 devices"* ]]
	run -0 --separate-stderr incise info ./bench:bus0
	[[ "$output" == "model "* ]]
	for name in 12:30.rec a:b.fx; do
		fails incise info $name -- "$name: "
		[[ "$stderr" != *backend* ]]
	done
}

@test "status shows what is counted" {
	rig bus0
	run -0 --separate-stderr incise stepper status
	[[ "$output" == *$'\ncounted    setpoints sent: 1234\n           SYNCs sent late: 3\n           answers missing: 0\n           emergencies: 1' ]]
	[[ "$output" == *"faults     none"* ]]
	[[ "$output" != *cause* ]]
	incise stepper status --json >s.json
	[ "$(key s.json counters.setpoints)" = 1234 ]
	[ "$(key s.json counters.sync_late)" = 3 ]
	[ "$(key s.json counters.tpdo_missing)" = 0 ]
	[ -z "$(key s.json cause)" ]
	# a backend that counts nothing
	run -0 incise stepper status --rig sim:clock=simulated
	[[ "$output" == *"simulated  each command starts at 0"* ]]
	[[ "$output" != *counted* ]]
	incise stepper status --rig sim:clock=simulated --json >s.json
	[ "$(key s.json counters)" = '{}' ]
}

# bats test_tags=check
@test "a fault is told with the drive's own cause" {
	rig faulty
	run -0 --separate-stderr incise stepper status
	[ "$(grep -c '^fault ' <<<"$output")" -eq 2 ]
	[[ "$output" == *$'\ncause      over-voltage (3210h): see the supply, then clear\n'* ]]
	incise stepper status --json >s.json
	[ "$(key s.json cause)" = "over-voltage (3210h): see the supply, then clear" ]
	[ "$(key s.json 'faults[1].fault')" = lost ]
	run -0 --separate-stderr incise stepper status --follow --duration 0.1s
	[[ "$output" == *"; over-voltage (3210h): see the supply, then clear" ]]
	fails incise stepper move 1 -- "move:" ": over-voltage (3210h): see the supply, then clear"
	run -0 --separate-stderr incise stepper clear
	[ "$output" = "drive faulty: cleared; it was over-voltage (3210h): see the supply" ]
	# One that says who it is: it is said once. Its name says more than that.
	rig "named, faulty"
	fails incise stepper move 1 -- "move:"
	[[ "$stderr" != *"drive named: "* ]]
	incise stepper status --json >s.json
	[ "$(key s.json cause)" = "drive named: over-voltage (3210h): see the supply, then clear" ]
	# One that says nothing of it: what all the faults mean.
	rig "mute, faulty"
	run -0 --separate-stderr incise stepper status
	[[ "$output" != *cause* ]]
	incise stepper status --json >s.json
	[[ "$(key s.json cause)" == "alarm of the power stage: "* ]]
	run --separate-stderr incise stepper move 1
	failed_with "alarm of the power stage: " "; the drive does not answer any more"
}

@test "haptic ends with the drive's own cause, and reports what went wrong on the way" {
	rig failing
	run --separate-stderr incise haptic liver.scene --no-rt --duration 10s
	[ "$status" -eq 1 ]
	[[ "${stderr_lines[-1]}" == "incise haptic: liver.scene: a device failed at tick 21: over-voltage (3210h): see the supply, then clear; the force was removed" ]]
	[ "${lines[-1]}" = "actuator   SYNCs sent late: 3, emergencies: 1" ]
	rig "mute, failing"
	run --separate-stderr incise haptic liver.scene --no-rt --duration 10s
	[[ "${stderr_lines[-1]}" == *" tick 21: alarm of the power stage: see its display, "* ]]
}

@test "haptic says nothing of a bus that is sound, but in JSON" {
	rig sound
	run -0 --separate-stderr incise haptic liver.scene --no-rt --duration 0.1s
	[[ "$output" != *actuator\ \ * ]]
	incise haptic liver.scene --no-rt --duration 0.1s --json >r.json
	[ "$(key r.json actuator.setpoints)" = 1234 ]
	[ "$(key r.json actuator.sync_late)" = 0 ]
	sim=sim:clock=simulated,depth_mm=5,times=1
	incise haptic liver.scene --rig $sim --duration 0.1s --json >r.json
	[ "$(key r.json actuator)" = '{}' ]
}

@test "what moves it says what was amiss on the way" {
	rig bus0
	run -0 --separate-stderr incise stepper move 2
	[ "${#lines[@]}" -eq 2 ]
	[ "${lines[1]}" = "actuator   SYNCs sent late: 3, emergencies: 1" ]
	incise stepper move 2 --json >m.json
	[ "$(key m.json counters.sync_late)" = 3 ]
	rig sound
	run -0 --separate-stderr incise stepper move 2
	[ "${#lines[@]}" -eq 1 ]
}

@test "a drive that homes by itself does not tell where the edge was" {
	rig sound
	run -0 --separate-stderr incise stepper home
	diff - <(echo "$output") <<-'END'
		drive sound homes by itself and does not report where the edge was before
		homed, at 0.0000 mm
	END
	run -0 --separate-stderr incise stepper home --repeat 3
	diff - <(echo "$output") <<-'END'
		drive sound homes by itself and does not report where the edge was before, so the repeatability is unknown
		homed, at 0.0000 mm
	END
	incise stepper home --repeat 2 --json >h.json
	[ "$(key h.json edges_before_mm)" = '[null,null]' ]
	[ "$(key h.json edges_before_steps)" = '[null,null]' ]
	[ "$(key h.json edge_mm)" = 0.5 ]
	[ -z "$(key h.json spread_mm)" ]
	[ -z "$(key h.json spread_steps)" ]
}

@test "the examples of rig.conf are read, those in the manual too" {
	for example in "$root"/doc/rig.conf.example "$root"/doc/rig-can.conf.example; do
		sed 's|^stepper = "[^"]*"|stepper = "bench:bus0"|' "$example" >rig.conf
		incise stepper status
	done
	example_in "$INCISE_BUILD/man/rig.conf.5" can:can0 | sed 's|"can:can0:0x10"|"bench:bus0"|' >rig.conf
	grep -q 'can = {' rig.conf
	incise stepper status
	grep '^actuator = .*can = ' "$root/doc/can.md" >rig.conf
	grep -q homing_method rig.conf
	echo 'stepper = "bench:bus0";' >>rig.conf
	incise stepper status
}

@test "what rig.conf says of a drive on CAN is checked whatever the backend" {
	rig bus0
	sed -i 's/lead_mm = 3.0;/&\ncan = { mode = "torque"; };/' rig.conf
	run --separate-stderr incise stepper status
	failed_with 'rig.conf:4: actuator.can.mode: expected one of csp, csv, cst, found "torque"'
}

@test "info devices lists what is attached, of each kind that can look" {
	run -0 --separate-stderr incise info devices
	[ -z "$stderr" ]
	# The backend of these tests finds two without being told where.
	[[ "$output" == *"stepper    = \"bench:bus0:0x10\";"* ]]
	incise info devices --json >r.json
	[ "$(key r.json kind)" = devices ]
	[ "$(key r.json 'devices[0].kind')" != "" ]
}
