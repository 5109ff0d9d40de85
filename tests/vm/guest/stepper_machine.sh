#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The load of ticks, idle states, sleep, and pages that somebody holds on to; and what a
# person is told of a tick that is too short.
. tests/vm/tap
with_stepper "the machine"
"$INCISE_BUILD/tests/vm/stepper_machine"

PATH=$INCISE_BUILD/bin:$PATH
config=/sys/kernel/config/incise-stepper/bench
for motor in 0 1 2 3 4 5 6 7; do
	mkdir -p $config/motor$motor
	echo incise-sim:$((2 * motor)) >$config/motor$motor/step
	echo incise-sim:$((2 * motor + 1)) >$config/motor$motor/dir
done
echo 1 >$config/live
cat >/tmp/machine.conf <<END
stepper = "kernel:/dev/$(cat $config/cdev)";
actuator = { spring_N_mm = 2.0; travel_mm = 3.0; lead_mm = 2.0; velocity_mm_s = 0.1;
	acceleration_mm_s2 = 10.0; tick_us = 50.0; };
END
check "a tick that is too short for eight motors is named, with the shortest" \
	says 1 "tick_us is 50, but this machine needs at least" \
	stepper move --rig /tmp/machine.conf --unhomed 0.1mm
echo 0 >$config/live
rmdir $config/motor? $config
without_stepper
