#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A driver chip beside the kernel module: set up, homed with, tuned, shown, and its fault takes the home away.
. tests/vm/tap
with_carriage "driver chip" 400

PATH=$INCISE_BUILD/bin:$PATH
work=/run/stepper_driver
mkdir -p $work /dev/pts
cd $work || exit 1
mountpoint -q /dev/pts || mount -t devpts devpts /dev/pts
"$INCISE_BUILD/tests/vm/stepper_driver" >path &
chip=$!
until [ -s path ]; do :; done
cat >rig.conf <<-END
	stepper = "kernel:/dev/$(cat $config/bench/cdev)";
	actuator = {
		spring_N_mm = 2.0; travel_mm = 3.0; lead_mm = 2.0; microsteps = 4;
		velocity_mm_s = 4.0; acceleration_mm_s2 = 100.0; home_mm_s = 4.0; deadman_ms = 500.0;
		driver = "tmc2209:$(cat path):0"; tmc = { sense_ohm = 0.11; run_A = 0.6; };
	};
END

hot_while_powered()
{
	incise stepper enable >out 2>&1 </dev/null &
	pid=$!
	until grep -q powered out; do kill -0 $pid || return; done
	touch /run/hot
	wait $pid
	code=$?
	rm /run/hot
	cat out
	[ $code = 1 ] && grep -q "too hot, it switched the motor off" out
}

check "homed, with the chip's microsteps" says 0 "homed, at 0.0000 mm" stepper home
check "the chip is shown" says 0 "4 microsteps, StealthChop, temperature normal" stepper status
check "StallGuard's values by speed" says 0 "advised: stall_threshold = 75" stepper tune 2,4
check "it is homed" says 0 ", homed" stepper status
check "the chip's fault ends a command" hot_while_powered
check "and takes the home away" says 0 "not homed" stepper status
check "cleared" says 0 "" stepper clear
check "homed again" says 0 "homed, at 0.0000 mm" stepper home
kill $chip
wait $chip 2>/dev/null
check "without the chip the rig is not opened" says 1 "plug" stepper home
cd /
echo 0 >$config/bench/live
rmdir $config/bench/motor0 $config/bench
check "the modules go" rmmod incise_stepper incise_sim
