#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A motor wired as doc/kernel-module.md says: the limit switch is the home, and there is no other
# input but the e-stop. Every session ends without a fault, and homed.
. tests/vm/tap
export XDG_RUNTIME_DIR=/tmp/run
mkdir -p $XDG_RUNTIME_DIR
with_carriage "limit as home" 400 "limit_min=3" "min=3"
PATH=$INCISE_BUILD/bin:$PATH
scene=scenes/wall.scene

# rig KEYS
rig()
{
	cat >/tmp/rig.conf <<-END
		tracker = "sim:";
		stepper = "kernel:/dev/$(cat $config/bench/cdev)";
		actuator = { spring_N_mm = 2.0; travel_mm = 30.0; lead_mm = 4.0; microsteps = 8;
			velocity_mm_s = 30.0; acceleration_mm_s2 = 2000.0; home_mm_s = 5.0;
			deadman_ms = 200; origin_mm = -22.0; $1 };
		sim = { depth_mm = [10]; times = [1000]; cut_s = 1.0; pause_s = 0.5; };
	END
}

session() { incise haptic $scene "$@" --home --recover --rig /tmp/rig.conf --duration 2s --json; }
homed() { says 0 ": disabled at 0.0000 mm (step 0), homed" stepper status --rig /tmp/rig.conf; }
# sessions WHICH ARGUMENT…: three in a row
sessions()
{
	which=$1
	shift
	for n in 1 2 3; do
		check "$which, session $n: exit 0" session "$@"
		check "$which, session $n: no fault, homed" homed
	done
}
moves()
{
	check "$1: home" says 0 homed stepper home --rig /tmp/rig.conf
	check "$1: away" says 0 "now at 5.0000 mm" stepper move 5mm --rig /tmp/rig.conf
	check "$1: back to 0" says 0 "now at 0.0000 mm" stepper move 0mm --rig /tmp/rig.conf
	check "$1: no fault, homed" homed
}

rig ""
moves "as wired"
sessions "in the kernel" --in-kernel
sessions "in user space"
check "at 0 it is clear of the switch" grep -q " position=-200 " $sim/carriage

# The last step arrives at the switch.
rig "home_mm = 0.0;"
moves "0 at the switch"
check "at 0 it touches the switch" grep -q " position=-400 " $sim/carriage
check "0 at the switch: exit 0" session --in-kernel
check "0 at the switch: no fault, homed" homed

# The e-stop takes the supply, and with it the rotor's place.
echo "7 1" >$sim/inputs
echo "7 0" >$sim/inputs
check "the e-stop takes the home away" says 0 ", not homed" stepper status --rig /tmp/rig.conf
rig "volatile_home = true;"
check "homed with volatile_home" says 0 homed stepper home --rig /tmp/rig.conf
check "the end of power takes the home away" says 0 ", not homed" stepper status --rig /tmp/rig.conf

echo 0 >$config/bench/live
rmdir $config/bench/motor0 $config/bench
check "the modules go" rmmod incise_stepper incise_sim
