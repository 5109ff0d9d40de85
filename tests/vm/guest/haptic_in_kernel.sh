#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# incise haptic --in-kernel and incise feed: the kernel module renders a scene, the feeder hands it
# poses, and whoever watches may be killed and started again while one cuts.
. tests/vm/tap
with_carriage "kernel loop" 400
export XDG_RUNTIME_DIR=/tmp/run
mkdir -p $XDG_RUNTIME_DIR

# The virtual surgeon's blade goes 10 mm below the surface, for 2 s each time.
cat >/tmp/rig.conf <<END
tracker = "sim:";
stepper = "kernel:/dev/$(cat $config/bench/cdev)";
actuator = { spring_N_mm = 2.0; travel_mm = 30.0; lead_mm = 4.0; microsteps = 8;
	velocity_mm_s = 30.0; acceleration_mm_s2 = 2000.0; home_mm_s = 5.0;
	deadman_ms = 200; retract = true; origin_mm = -22.0; };
sim = { depth_mm = [10]; times = [1000]; cut_s = 2.0; pause_s = 1.0; };
END
incise=$INCISE_BUILD/bin/incise
scene=scenes/wall.scene
unpowered() { grep -q '^2 out 0' $sim/inputs; }
said() { grep -q "$@" || { cat /tmp/out /tmp/err; return 1; }; }
key() { sed -n "s/.*\"$1\": \([-0-9.e]*\).*/\1/p" | head -n 1; }
# start NAME COMMAND: in the background; its exit code and what it printed are kept.
start() {
	started=$1
	shift
	rm -f "/tmp/$started.code"
	{ "$@" >"/tmp/$started.out" 2>"/tmp/$started.err"; echo $? >"/tmp/$started.code"; } &
}
ended() { until_true test -s "/tmp/$1.code" && [ "$(cat "/tmp/$1.code")" = "$2" ] || { cat "/tmp/$1.err"; return 1; }; }
powered() { ! unpowered; }
no_feeder() { [ -z "$(pgrep -x incise-feed)" ]; }
until_true() { n=0; until "$@" || [ $n -ge 500 ]; do sleep 0.05; n=$((n + 1)); done; "$@"; }

compiled() { $incise compile $scene --rig /tmp/rig.conf -o /tmp/wall.plan >/tmp/out 2>/tmp/err && said "^actuator along (0, 0, 1), spring 2 N/mm" </tmp/out; }
check "a plan is compiled for the rig" compiled
sed 's/^/# /' /tmp/out
not_homed() { ! $incise feed $scene --rig /tmp/rig.conf --duration 1s >/tmp/out 2>/tmp/err && said "is not homed" </tmp/err; }
check "the feeder refuses a motor without its 0" not_homed

whole() { $incise haptic $scene --in-kernel --home --rig /tmp/rig.conf --duration 5s --json >/tmp/out 2>/tmp/err || { cat /tmp/err; return 1; }; }
check "haptic --in-kernel homes, renders and ends" whole
felt() { awk -v force="$(key force_max_N </tmp/out)" -v contact="$(key contact </tmp/out)" 'BEGIN { print force " N, " contact " ticks in contact"; exit !(force > 0.1 && contact > 500) }'; }
check "a force was felt" felt
echo "# $output"
check "it ends without power" unpowered
check "and without a feeder" no_feeder

# The feeder alone, and those who watch.
start feed $incise feed $scene --rig /tmp/rig.conf
feeds() { $incise status wall.feed 2>/dev/null | grep -q running; }
check "a feeder starts" until_true feeds || cat /tmp/feed.err
start watch $incise haptic $scene --in-kernel --rig /tmp/rig.conf --json
watches() { $incise status wall 2>/dev/null | grep -q running; }
check "haptic --in-kernel watches it" until_true watches || cat /tmp/watch.err
known() { said "incise feed already runs" </tmp/watch.err; }
check "and says who feeds" known
both() { $incise status >/tmp/status 2>/dev/null; grep -q "^wall: running" /tmp/status && grep -q "^wall.feed: running" /tmp/status || { grep "^wall" /tmp/status; return 1; }; }
check "incise status shows both" both
kill -9 "$(pgrep -x incise-haptic)"
sleep 1
check "killed, it leaves the motor's power" powered
again() { $incise haptic $scene --in-kernel --rig /tmp/rig.conf --duration 4s --json >/tmp/out 2>/tmp/err && felt || { cat /tmp/err; return 1; }; }
check "started again it goes on, and the force is there" again
echo "# $output"
check "the feeder feeds on" powered
kill -TERM "$(pgrep -x incise-feed)"
check "asked to, it ends" ended feed 0
check "and the power with it" unpowered

# It dies: the force fades, the motor is stopped with the reason, and whoever watches says so.
start watch $incise haptic $scene --in-kernel --rig /tmp/rig.conf --json
check "haptic --in-kernel starts one of its own" until_true watches || cat /tmp/watch.err
sleep 1
kill -9 "$(pgrep -x incise-feed)"
dies() { ended watch 1 && said "the program that drove it ended while it was on" </tmp/watch.err; }
check "when that dies, it fails with the reason" dies
sed 's/^/# /' /tmp/watch.err
check "and there is no power" until_true unpowered
recovered() { $incise haptic $scene --in-kernel --recover --rig /tmp/rig.conf --duration 3s --json >/tmp/out 2>/tmp/err || { cat /tmp/err; return 1; }; }
check "--recover clears that, and starts again" recovered

# A tool, ordered from the one that watches.
cat >/tmp/tool.scene <<END
tissue = { reaction_N_mm = 0.1; insertion_N_mm = 0.1; };
END
start watch $incise haptic /tmp/tool.scene --in-kernel --rig /tmp/rig.conf --json
runs() { $incise status tool 2>/dev/null | grep -q running; }
check "a scene with tools runs" until_true runs || cat /tmp/watch.err
ordered() { $incise tool tool tube >/tmp/tool 2>&1 && grep -q "^tool: tube" /tmp/tool || { cat /tmp/tool; return 1; }; }
check "incise tool orders the tube" ordered
kill -INT "$(pgrep -x incise-haptic)"
check "SIGINT ends all" ended watch 0
check "without power" unpowered
check "and without a feeder" no_feeder

# Two motors of one plan: one that does not follow meets its deadman, and ends it with a fault.
echo 0 >"$config/bench/live"
mkdir "$config/bench/motor1"
for line in step=8 dir=9 enable=10 home=11; do
	echo "incise-sim:${line#*=}" >"$config/bench/motor1/${line%=*}"
done
echo 1 >"$config/bench/live"
echo "number=0 step=0 dir=1 enable=2 min=3 max=4 home=5 min_at=-400 max_at=1000000 home_at=-2000..0 position=400" >$sim/carriage
echo "number=1 step=8 dir=9 enable=10 home=11 max_at=1000000 home_at=-2000..0 position=400" >$sim/carriage
device=kernel:/dev/$(cat $config/bench/cdev)
limits="travel_mm = 30.0; lead_mm = 4.0; microsteps = 8; velocity_mm_s = 30.0; acceleration_mm_s2 = 2000.0;
	home_mm_s = 10.0; deadman_ms = 200;"
cat >/tmp/rig.conf <<END
tracker = "sim:";
stepper = [ "$device:0", "$device:1" ];
actuator = ( { spring_N_mm = 2.0; origin_mm = -22.0; $limits },
	{ spring_N_mm = 0.5; origin_mm = -15.0; rest_mm = 15.0; direction = [0.0, 1.0, 0.0]; $limits } );
sim = { depth_mm = [10]; times = [1]; cut_s = 2.0; pause_s = 1.5; tracker_noise_mm = 0.0; };
END
cat >/tmp/side.scene <<END
tissue = { reaction_N_mm = 0.1; plane_N_mm = 0.05; };
tool = { side = [0.6, 0.8, 0.0]; };
END
two() { $incise feed /tmp/side.scene --home --rig /tmp/rig.conf --duration 6s --json >/tmp/out 2>/tmp/err || { cat /tmp/err; return 1; }; }
check "two motors follow one plan" two
whole() { grep -q '"missed": 0,' /tmp/out && ! grep -q '"poses": 0,' /tmp/out || { cat /tmp/out; return 1; }; }
check "poses are taken, and no tick is missed" whole
both_off() { for line in 2 10; do grep -q "^$line out 0" $sim/inputs || { cat $sim/inputs; return 1; }; done; }
check "both end without power" both_off
echo 0 >"$config/bench/live"
rmdir $config/bench/motor1
rmdir $config/bench/motor0 $config/bench
check "the modules go" rmmod incise_stepper incise_sim
