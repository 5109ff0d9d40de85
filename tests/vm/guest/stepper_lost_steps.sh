#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A carriage that ignores some steps, behind a motor that passes its home edge: the edge is 0.5 mm up
# the travel, and a step is 2.5 um.
. tests/vm/tap
export XDG_RUNTIME_DIR=/tmp/run
mkdir -p $XDG_RUNTIME_DIR
with_carriage "lost steps" 400
PATH=$INCISE_BUILD/bin:$PATH
echo 0 >$config/bench/live
check "configfs takes lost_steps_max" sh -c "echo 77 >$config/bench/motor0/lost_steps_max"
check "no word" eval "! echo many >$config/bench/motor0/lost_steps_max" 2>/dev/null
check "it reads back" [ "$(cat $config/bench/motor0/lost_steps_max)" = 77 ]
echo 1 >$config/bench/live
check "not while live" eval "! echo 1 >$config/bench/motor0/lost_steps_max" 2>/dev/null

# rig [KEYS]
rig()
{
	cat >/tmp/rig.conf <<-END
		tracker = "sim:";
		stepper = "kernel:/dev/$(cat $config/bench/cdev)";
		actuator = { spring_N_mm = 2.0; travel_mm = 30.0; lead_mm = 4.0; microsteps = 8;
			velocity_mm_s = 12.0; acceleration_mm_s2 = 1000.0; home_mm_s = 5.0;
			deadman_ms = 200; origin_mm = -22.0; home_mm = 0.5; $1 };
		sim = { depth_mm = [10]; times = [1000]; cut_s = 0.5; pause_s = 0.5; };
	END
}
position() { sed 's/.* position=\([-0-9]*\) .*/\1/' $sim/carriage; }
# ignores N: it stands still for the next N steps
ignores()
{
	echo "number=0 step=0 dir=1 enable=2 min=3 max=4 home=5 min_at=-3000 max_at=100000" \
		"home_at=-2500..0 position=$(position) ignore=$1" >$sim/carriage
}
move() { says 0 "now at $1.0000 mm" stepper move "$1mm" --rig /tmp/rig.conf; }
status() { says 0 "$1" stepper status --rig /tmp/rig.conf; }
homed() { check "$1: homes" says 0 homed stepper home --rig /tmp/rig.conf; }

ignores 0
rig
homed "no step is lost"
for n in 1 2 3; do
	check "up, pass $n" move 8
	check "down, pass $n" move 0
done
check "no step is missing" status "home edge: 0"

ignores 60
check "60 are lost on the way up" move 8
check "60 may be" move 0
check "their number" status "home edge: 60"
ignores 30
check "30 more" move 8
check "more than 80 stop it" says 1 "90 steps are missing: check" stepper move 0mm --rig /tmp/rig.conf
check "the cause stays" status "cause      90 steps are missing"
check "not homed" status ", not homed"
check "in JSON" says 0 '"fault": "lost_steps"' stepper status --json --rig /tmp/rig.conf
check "clear" says 0 cleared stepper clear --rig /tmp/rig.conf

homed "the way down"
check "up" move 8
ignores 200
check "an edge that does not come stops it" \
	says 1 "steps are missing: check" stepper move 0mm --rig /tmp/rig.conf
check "clear" says 0 cleared stepper clear --rig /tmp/rig.conf

rig "lost_steps_max = 0;"
homed "any number may be"
ignores 300
check "300 on the way up" move 8
check "no fault" move 0
check "but the number" status "home edge: 300"

# session WHICH ARGUMENT…: steps are lost every 2 s
session()
{
	which=$1
	shift
	{ for n in 1 2 3; do sleep 2; ignores 150; done; } &
	check "$which: it ends with the reason" sh -c \
		"incise haptic scenes/wall.scene --home --recover --rig /tmp/rig.conf --duration 8s $* 2>&1 |
		 tee /tmp/said | grep -q 'steps are missing'"
	sed 's/^/# /' /tmp/said
	wait
}
rig
session "in the kernel" --in-kernel
check "not homed" status ", not homed"
check "clear" says 0 cleared stepper clear --rig /tmp/rig.conf
session "in user space"
check "not homed" status ", not homed"

# An encoder at the carriage: its count is written here, in place of a counter's driver.
count=/sys/bus/counter/devices/counter0/count0/count
check "a folder for it" mount -t tmpfs none /sys/bus
mkdir -p ${count%/*}
encodes()
{
	while read -r line <$sim/carriage; do
		line=${line#* position=}
		printf '%020d\n' $((100000 - ${line%% *})) 1<>$count
	done
}
check "clear" says 0 cleared stepper clear --rig /tmp/rig.conf
rig 'encoder = "counter0/count0"; encoder_counts_per_mm = -400.0;'
check "a count that is not there" says 1 "counter0/count0: No such file" stepper home --rig /tmp/rig.conf
encodes &
pid=$!
while [ ! -s $count ]; do :; done
homed "with the encoder"
check "up" move 8
check "down" move 2
ignores 200
check "200 steps are missing at no edge" \
	says 1 "encoder: " stepper move 8mm --rig /tmp/rig.conf
check "not homed" status ", not homed"
kill $pid
umount /sys/bus

echo 0 >$config/bench/live
rmdir $config/bench/motor0 $config/bench
check "the modules go" rmmod incise_stepper incise_sim
