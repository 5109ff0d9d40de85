#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A person's commands on incise_stepper.ko: a motor on the simulated chip drives a carriage
# with a home mark and two limit switches. Microsteps of 2.5 um; the carriage counts them
# from another place than the machine:
#
#   carriage  -300    100          400                      1000
#             limit   home's edge  stands here at first     limit
#   machine           0 mm                                  2.25 mm        travel 3 mm
. tests/vm/tap
with_modules "incise stepper on the module" incise_stepper
stepper=$module
with_modules "incise stepper on the module" incise_sim
# Two emulated processors hold, by the self-test, what the load of the host leaves them.
in_virtual_time "incise stepper on the module"
[ "$INCISE_VM_KERNEL" != debug ] || skip "incise stepper on the module" "the debug kernel holds no rig's step rate"

PATH=$INCISE_BUILD/bin:$PATH
config=/sys/kernel/config/incise-stepper/bench
sim=/sys/kernel/debug/incise_sim
work=/run/stepper_tool
mkdir -p $work

bind()
{
	modprobe -a industrialio kfifo_buf industrialio-triggered-buffer configfs libcrc32c crc32c_generic 2>/dev/null
	insmod "$module" && insmod "$stepper" || return
	mkdir -p $config/motor0
	for line in step=0 dir=1 enable=2 limit_min=3 limit_max=4 home=5; do
		echo "incise-sim:${line#*=}" >"$config/motor0/${line%=*}" || return
	done
	echo incise-sim:7 >$config/estop
	echo "number=0 step=0 dir=1 enable=2 min=3 max=4 home=5 min_at=-300 max_at=1000" \
		"home_at=-3000..100 position=400" >$sim/carriage
	echo 1 >$config/live
}

# rig NAME MM_S
rig()
{
	cat >"$work/$1" <<-END
		stepper = "kernel:/dev/$(cat $config/cdev)";
		actuator = {
			spring_N_mm = 2.0; travel_mm = 3.0; lead_mm = 2.0; microsteps = 4;
			velocity_mm_s = $2; acceleration_mm_s2 = 100.0;
			home_mm_s = $2; deadman_ms = 500.0;
		};
	END
}

# A number of the carriage: carriage position. No process: this is asked often.
carriage()
{
	read -r line <$sim/carriage
	for word in $line; do
		[ "${word%%=*}" != "$1" ] || echo "${word#*=}"
	done
}

# In the background, until it says so; $! is its number.
begin()
{
	text=$1
	shift
	incise stepper "$@" >$work/out 2>&1 </dev/null &
	while ! grep -q "$text" $work/out && kill -0 $! 2>/dev/null; do :; done
}

# A move that takes its time, until it is under way; $pid.
slowly()
{
	from=$(carriage position)
	incise stepper "$@" --rig slow.conf >$work/out 2>&1 </dev/null &
	pid=$!
	while [ "$(carriage position)" = "$from" ] && kill -0 $pid; do :; done
}

# ended CODE TEXT: what was begun.
ended()
{
	cat $work/out
	[ "$code" = "$1" ] && grep -q "$2" $work/out
}

check "the controller is bound" bind || {
	dmesg | tail -n 20 | sed 's/^/# /'
	exit 0
}
rig rig.conf 1.0
rig slow.conf 0.1
cd $work || exit 1

check "status: not powered, not homed" \
	says 0 "disabled at 0.0000 mm (step 0), not homed" stepper status
check "status names what is wired" \
	says 0 "wired: limit at 0, limit at the end, home, e-stop" stepper status
check "a place is refused before it is homed, with the command" \
	says 1 "run 'incise stepper home'" stepper move 1
check "a way is not" says 0 "now at 0.2500 mm (step 100), not homed" stepper move 250um --by
check "and it went that way" [ "$(carriage position)" = 500 ]

incise stepper home --repeat 3 --json >home.json 2>home.err
check "home" [ -s home.json ] || sed 's/^/# /' home.err
check "it stands at the edge" [ "$(carriage position)" = 100 ]
# 300 steps below its count's 0, and at 0 each time from then on
check "the edge was where it is, and is there again" \
	sh -c 'tr -d " \n" <home.json | grep -q "\"edges_before_steps\":\[-300,0,0\]"'
check "it repeats to the step" grep -q '"spread_steps": 0' home.json
check "it is homed" grep -q '"homed": true' home.json

check "a position" says 0 "now at 1.0000 mm (step 400)" stepper move 1mm
check "of the machine" [ "$(carriage position)" = 500 ]
check "jog, for a time" says 0 "moved -" stepper jog -0.5mm/s --duration 200ms
at=$(carriage position)
check "it went back, and rests" [ "$at" -lt 500 ] && [ "$at" -gt 100 ]
check "jog ends at the end of the travel" says 0 "end of the travel" stepper jog -1

begin powered enable
check "there is one owner" says 1 "another program drives it" stepper move 1
check "who only looks is welcome" says 0 ": ready at 0.0000 mm" stepper status
check "whoever looks may stop" says 0 ": disabled at 0.0000 mm" stepper disable
wait $!
code=$?
check "the owner says so" ended 1 "power was switched off"
begin powered enable
kill -INT $!
wait $!
code=$?
check "Ctrl-C ends enable" ended 0 powered
check "without power" says 0 ": disabled at 0.0000 mm (step 0), homed" stepper status

slowly move 2
kill -INT $pid
wait $pid
check "Ctrl-C stops a move" grep -q "Interrupt: at rest at 0" $work/out
check "homed still" says 0 ", homed" stepper status

check "the limit switch stops it, and it is said what to do" \
	says 1 "limit switch at the end of the travel: clear" stepper move 3
check "within a step" [ "$(carriage highest)" -le 1001 ]
check "status says so" says 0 "fault at 2.25" stepper status
check "nothing moves before it is cleared" says 1 "clear" stepper move --by -250um
check "clear" says 0 "cleared; it was limit switch" stepper clear
check "away from it" says 0 "moved -0.5000 mm" stepper move --by -500um

begin powered enable
echo "7 1" >$sim/inputs
wait $!
code=$?
check "the e-stop ends it" ended 1 "e-stop: release it, then clear"
check "status says so" says 0 "fault      e-stop: release it" stepper status
check "clear while it is pressed" says 1 "e-stop is active" stepper clear
echo "7 0" >$sim/inputs
check "clear after it" says 0 "cleared; it was e-stop" stepper clear

slowly move --by -750um
kill -9 $pid
wait $pid 2>/dev/null
check "kill -9: the module brought it to rest, and says why" \
	says 0 "the program that drove it ended while it was on" stepper status
at=$(carriage position)
check "it is latched" says 0 '"fault": "owner"' stepper status --json
check "it stands" [ "$(carriage position)" = "$at" ]
check "clear" says 0 "cleared; it was the program" stepper clear

slowly home
kill -INT $pid
wait $pid
code=$?
check "Ctrl-C stops homing" ended 1 "stopped; its position is unknown"
check "without power, not homed" says 0 ": disabled at" stepper status

# Homing counts down from the end of the travel.
slowly move --by -500um
kill -STOP $pid
until grep -q "faults=0x1$" /sys/kernel/debug/incise_stepper/*/counters || ! kill -0 $pid; do :; done
at=$(carriage position)
check "the deadman takes power from a program that sleeps" \
	says 0 "fault      deadman: no more targets arrived" stepper status
check "it stands" [ "$(carriage position)" = "$at" ]
kill -CONT $pid
wait $pid
code=$?
check "which says so when it wakes" ended 1 "deadman: no more targets arrived"
check "clear" says 0 "cleared; it was deadman" stepper clear

incise info stepper --json >info.json
incise info stepper >info
check "info: the self-test" grep -q "^self-test  99 % of timers" info
check "info: steps as the carriage has them" grep -q " $(carriage up) up, $(carriage down) down;" info
check "info: the timer's lateness and the callback's cost" grep -q "^  callback   [0-9.]* us on average" info
check "info: JSON" grep -q '"kind": "stepper"' info.json
check "info: histograms" sh -c 'tr -d " \n" <info.json | grep -q "\"callback\":{\"mean_ns\":[1-9][0-9]*,\"max_ns\":[1-9]"'
check "info: of one device" says 0 "bench, 1 motor" info "/dev/$(cat $config/cdev)"
sed 's/^/# /' info

echo 0 >$config/live
check "info without a controller" says 1 "systemctl start incise-stepper" info stepper
check "stepper without one" says 1 "/dev/incise-stepper" stepper status
rmdir $config/motor0 $config
check "the modules go" rmmod incise_stepper incise_sim
