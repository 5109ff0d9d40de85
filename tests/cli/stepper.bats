# SPDX-License-Identifier: GPL-2.0-or-later
# incise stepper on the virtual rig, and without a device; tests/vm/guest/stepper_tool.sh
# runs it on the kernel module. In simulated time it takes none.

load cli

setup() {
	work_folder
	quick=sim:clock=simulated
}

teardown() {
	[ -z "$pid" ] || kill -9 "$pid" 2>/dev/null || :
}

# Wait until a line that holds a text stands in a file.
until_it_says() {
	for ((i = 0; i < 9600; i++)); do
		grep -q "$1" "$2" && return
		sleep 0.05
	done
	complain "$2 does not say $1 within 8 min: $(cat "$2")"
}

# bats test_tags=check
@test "status says where it stands and what its limits are" {
	run -0 --separate-stderr incise stepper status --rig $quick,travel_mm=15
	[ -z "$stderr" ]
	[ "${lines[0]}" = "simulated haptic scalpel: ready at 0.0000 mm (step 0), homed" ]
	[[ "$output" == *"faults     none"* ]]
	[[ "$output" == *"limits     0 to 15 mm in steps of 0.625 um, up to 30 mm/s"* ]]
}

@test "status --follow prints what changes, as text or as a line of JSON" {
	run -0 --separate-stderr incise stepper status --follow --duration 1s --rig $quick
	[ "${#lines[@]}" -eq 1 ] # nothing does
	[[ "$output" == "0.000 s  ready at 0.0000 mm, 0.000 mm/s, homed; inputs none" ]]
	incise stepper status -f --duration 1s --json --rig $quick >s.json
	[ "$(wc -l <s.json)" -eq 1 ]
	[ "$(key s.json state)" = ready ]
}

# bats test_tags=check
@test "move goes there and says so; its time is that of the limits" {
	run -0 --separate-stderr incise stepper move 10 --rig $quick
	[ -z "$stderr" ]
	[[ "$output" == "moved 10.0000 mm in "*" s, now at 10.0000 mm (step 16000)" ]]
	for there in 10mm 10000um 10.0; do
		incise stepper move $there --rig $quick --json >m.json
		[ "$(key m.json position_steps)" = 16000 ]
		[ "$(key m.json from_mm)" = 0.0 ]
		[ "$(key m.json state)" = ready ]
		# 10 mm at 30 mm/s, and 30 mm/s at 3000 mm/s^2; a look each 5 ms
		holds "$(key m.json seconds) >= 10 / 30 + 30 / 3000 - 1e-9"
		holds "$(key m.json seconds) <= 10 / 30 + 30 / 3000 + 0.01"
	done
	incise stepper move 1mm --by --rig $quick --json >m.json
	[ "$(key m.json position_mm)" = 1.0 ]
}

@test "move to where it stands, and to the end of a travel that is not of whole steps" {
	incise stepper move 0 --rig $quick --json >m.json
	[ "$(key m.json position_mm)" = 0.0 ]
	incise stepper move 10.0004 --rig $quick,travel_mm=10.0004 --json >m.json
	[ "$(key m.json position_steps)" = 16000 ]
	# to the nearest step otherwise
	incise stepper move 0.0009 --rig $quick --json >m.json
	[ "$(key m.json position_steps)" = 1 ]
}

# bats test_tags=check
@test "move outside the travel is refused" {
	for way in 20.1 -1 -0.1mm "-1 --by" "20001um --by"; do
		# shellcheck disable=SC2086
		fails incise stepper move $way --rig $quick -- "out of the travel" "0 to 20 mm"
		[ -z "$output" ]
	done
}

@test "move --hold stays there" {
	run -0 --separate-stderr incise stepper move 2 --hold --duration 3s --rig $quick
	[[ "$output" == "moved 2.0000 mm "* ]]
	[ "${#lines[@]}" -eq 1 ]
}

# bats test_tags=check
@test "enable holds it and says how long" {
	run -0 --separate-stderr incise stepper enable --duration 2s --rig $quick
	[ -z "$stderr" ]
	[[ "$output" == "powered, held at 0.0000 mm; Ctrl-C disables it, "*"100 ms" ]]
	incise stepper enable --duration 2s --rig $quick --json >e.json
	# that time passed, and the deadman saw targets all the while
	holds "$(key e.json t_ns) >= 3e9 && $(key e.json t_ns) < 3.1e9"
	[ "$(key e.json faults)" = '[]' ]
}

@test "disable and clear" {
	run -0 --separate-stderr incise stepper disable --rig $quick
	[[ "$output" == "simulated haptic scalpel: ready at 0.0000 mm, as it is always powered" ]]
	run -0 --separate-stderr incise stepper clear --rig $quick
	[ "$output" = "simulated haptic scalpel: no fault to clear" ]
	incise stepper clear --rig $quick --json >c.json
	[ "$(key c.json faults)" = '[]' ]
}

@test "what makes no sense on the virtual rig is said in a line" {
	run --separate-stderr incise stepper jog -2 --rig $quick
	failed_with "simulated haptic scalpel cannot jog" "incise stepper move"
	run --separate-stderr incise stepper home --rig $quick
	failed_with "simulated haptic scalpel does not support being homed"
	fails incise stepper jog 31mm/s --rig $quick -- "31 mm/s" "30 mm/s"
}

# bats test_tags=check
@test "Ctrl-C stops a move, at rest, and says where" {
	# 20 mm at 0.5 mm/s
	incise stepper move 20 --rig sim:screw_mm_s=0.5 >out 2>err 3>&- &
	pid=$!
	until_it_catches $pid incise-stepper 2
	kill -INT $pid
	wait $pid && complain "exit 0" || [ $? -eq 1 ]
	pid=
	[ ! -s out ]
	[ "$(wc -l <err)" -eq 1 ]
	grep -q '^incise stepper: move: Interrupt: at rest at ' err
}

@test "Ctrl-C ends enable and --follow as asked" {
	for command in enable "status --follow"; do
		# shellcheck disable=SC2086
		incise stepper $command --rig sim: >out 2>err 3>&- &
		pid=$!
		until_it_says "0.0000 mm" out
		kill -INT $pid
		wait $pid # exit status 0
		pid=
		[ ! -s err ]
	done
}

@test "a reader that goes away ends it, without a word" {
	touch reader
	run -1 --separate-stderr bash -c "set -o pipefail
		{ while [ -e reader ]; do sleep 0.1; done
			incise stepper move 1 --hold --duration 9s --rig $quick; } | { exec <&-; rm reader; }"
	[ -z "$stderr" ]
}

# bats test_tags=check
@test "stepper: rigs that cannot be" {
	fails incise stepper status --rig none.conf -- none.conf "No such file"
	echo 'tracker = "sim:";' >rig.conf
	fails incise stepper status -- rig.conf stepper
	echo 'stepper = "sim:";' >>rig.conf
	incise stepper status # ./rig.conf is the default
	cat >rig.conf <<-'END'
		stepper = "kernel:/dev/incise-none";
		actuator = { spring_N_mm = 2.0; travel_mm = 10.0; lead_mm = 2.0; };
	END
	for command in status enable disable "move 1" "jog 1" home clear; do
		# shellcheck disable=SC2086
		fails incise stepper $command -- /dev/incise-none
	done
}

# bats test_tags=check
@test "stepper: a path that is no device is not waited for" {
	mkfifo pipe
	: >file
	for path in pipe file; do
		cat >kernel.conf <<-END
			stepper = "kernel:$PWD/$path";
			actuator = { spring_N_mm = 2.0; travel_mm = 20.0; lead_mm = 4.0; };
		END
		for command in status clear; do
			fails timeout 60 incise stepper $command --rig kernel.conf -- "not a device"
		done
	done
}

@test "info of a controller that is not there, or is none" {
	compgen -G '/dev/incise-stepper*' >/dev/null && skip "this machine has a controller"
	fails incise info stepper -- "systemctl start incise-stepper"
	fails incise info stepper --json -- "systemctl start incise-stepper"
	fails incise info /dev/incise-stepper0 -- /dev/incise-stepper0 "No such file"
	echo text >stepper
	fails incise info ./stepper -- ./stepper # a file of that name
}

@test "--axis chooses one of the rig's actuators" {
	run -0 --separate-stderr incise stepper status --rig $quick,axes=2 --axis 2
	# it pushes both ways, and rests half way
	[ "${lines[0]}" = "simulated haptic scalpel, across the blade: ready at 10.0000 mm (step 16000), homed" ]
	run --separate-stderr incise stepper status --rig $quick,axes=2 --axis 3
	failed_with "--axis 3: the rig has fewer actuators"
}
