#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The library's steppers on the simulated chip: over the kernel module, and over GPIO from
# user space. Both run the table that the virtual rig passes too.
. tests/vm/tap
in_virtual_time "stepper backends"
export INCISE_MODULE_PATH="$INCISE_BUILD/lib/incise"

config=/sys/kernel/config/incise-stepper
with_stepper "stepper backends"

actuator="
	spring_N_mm = 2.0; travel_mm = 5.0; lead_mm = 4.0; velocity_mm_s = 4.0;
	acceleration_mm_s2 = 200.0; jerk_mm_s3 = 20000.0;
	setup_us = 20.0; hold_us = 10.0; home_mm_s = 2.0;"

mkdir -p "$config/bench/motor0"
for line in step=0 dir=1 enable=2 limit_min=3 limit_max=4 home=5 fault=6; do
	echo "incise-sim:${line#*=}" >"$config/bench/motor0/${line%=*}"
done
echo incise-sim:7 >"$config/bench/estop"
check "the controller goes live" sh -c "echo 1 >$config/bench/live" || exit 0
cat >/tmp/kernel.conf <<END
stepper = "kernel:/dev/$(cat $config/bench/cdev)";
actuator = {$actuator };
END
"$INCISE_BUILD/tests/vm/stepper_backends" kernel /tmp/kernel.conf $1
echo 0 >"$config/bench/live"

cat >/tmp/gpio.conf <<END
stepper = "gpio:incise-sim";
actuator = {$actuator
	lines = { step = 0; dir = 1; enable = 2; limit_min = 3; limit_max = 4; home = 5;
		alarm = 6; estop = 7; }; };
END
if [ -e "$INCISE_BUILD/lib/incise/stepper_gpio.so" ]; then
	"$INCISE_BUILD/tests/vm/stepper_backends" gpio /tmp/gpio.conf $1
else
	echo "ok gpio # skip libgpiod is not installed"
fi
rmdir $config/bench/motor0 $config/bench
check "the modules go" rmmod incise_stepper incise_sim
