#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# incise haptic drives a motor through the kernel module: it homes it, renders through it,
# ends with the fault's name when the e-stop is pressed, and leaves nothing powered.
. tests/vm/tap
with_carriage "haptic loop" 3000

# The virtual surgeon's blade goes 5 to 20 mm below the surface.
cat >/tmp/rig.conf <<END
tracker = "sim:";
stepper = "kernel:/dev/$(cat $config/bench/cdev)";
actuator = { spring_N_mm = 2.0; travel_mm = 30.0; lead_mm = 4.0; microsteps = 8;
	velocity_mm_s = 30.0; acceleration_mm_s2 = 2000.0; home_mm_s = 5.0;
	deadman_ms = 50; retract = true; origin_mm = -22.0; };
sim = { depth_mm = [15]; times = [1000]; cut_s = 2.0; pause_s = 1.0; };
END
# Compiled: an emulated processor takes ten seconds over the survey of a .fis file, and
# three over each plan of what is compiled: what is not about the learnt force is with the plain wall.
sed "s|model = .*|model = \"$INCISE_BUILD/tests/vm/liver.fx\";|" scenes/liver.scene >/tmp/liver.scene
haptic() { "$INCISE_BUILD/bin/incise" haptic ${scene:-scenes/wall.scene} --rig /tmp/rig.conf -c none "$@" >/tmp/out 2>/tmp/err; }
said() { grep -q "$@" || { cat /tmp/out /tmp/err; return 1; }; }
# A run that fails says why.
runs() { haptic "$@" || { cat /tmp/out /tmp/err; return 1; }; }
position() { sed -n 's/.* position=\([-0-9]*\).*/\1/p' $sim/carriage; }
unpowered() { grep -q '^2 out 0' $sim/inputs || cat $sim/inputs; grep -q '^2 out 0' $sim/inputs; }

refused() { ! haptic --duration 1s && said "is not homed; run .incise stepper home --rig /tmp/rig.conf" </tmp/err; }
check "without its 0 it is refused, with what to do" refused
# Long enough for a pause in the air, without which no force begins; cuts are short.
homed() { scene=/tmp/liver.scene runs --home --duration 5s && said actuate </tmp/out; }
check "with --home it runs" homed
felt() { said "^force *largest 0*[1-9.]*[1-9]" </tmp/out; }
check "and renders forces" felt
sed 's/^/# /' /tmp/out
check "it ends without power" unpowered
# Back at 0: the home edge, to what a poll of 1 ms at a tenth of 5 mm/s is.
at_zero() { [ "$(position)" -ge -1 ] && [ "$(position)" -le 1 ]; }
check "and at 0" at_zero || cat $sim/carriage
check "the 0 is known to the next run" runs --duration 1s
farthest() { sed -n 's/.* highest=\([-0-9]*\).*/\1/p' $sim/carriage; }
moved() { [ "$(farthest)" -gt 1600 ]; }
check "the nut went with the hand, by centimetres" moved

# Stopped beyond its end: the module takes the power, and no tick comes that would see it.
frozen() {
	"$INCISE_BUILD/bin/incise" haptic scenes/wall.scene --rig /tmp/rig.conf --duration 2s >/tmp/out 2>/tmp/err &
	pid=$!
	n=0; while unpowered >/dev/null && [ $n -lt 200 ]; do sleep 0.1; n=$((n + 1)); done
	kill -STOP $pid
	n=0; until unpowered >/dev/null || [ $n -ge 200 ]; do sleep 0.1; n=$((n + 1)); done
	sleep 3
	kill -CONT $pid
	! wait $pid && said "deadman: no more targets arrived" </tmp/err
}
check "stopped beyond its --duration it fails with the deadman" frozen
sed 's/^/# /' /tmp/err
check "which is cleared" "$INCISE_BUILD/bin/incise" stepper clear --rig /tmp/rig.conf
check "and its 0 is still known" haptic --duration 1s

estop() {
	(n=0; while unpowered >/dev/null && [ $n -lt 200 ]; do sleep 0.1; n=$((n + 1)); done; sleep 1; echo "7 1" >$sim/inputs) &
	! haptic --duration 8s && wait && said "e-stop: release it, then clear" </tmp/err
}
check "an e-stop ends it, and is named" estop
sed 's/^/# /' /tmp/err
check "it has no power then" unpowered
pressed() { ! haptic --duration 1s && said "is not homed\|e-stop" </tmp/err; }
check "it stays refused" pressed

# Two motors of the same controller from one plan: motor 0 pushes out of the surface, motor 1
# across the cut. The blade's side is turned towards its way, so that the plane constraint
# pulls it to -y, and more the longer the cut: motor 1's nut, whose handle rests at 15 mm, goes
# down as far as its softer spring needs.
echo 0 >"$config/bench/live"
mkdir "$config/bench/motor1"
for line in step=8 dir=9 enable=10 home=11 fault=12; do
	echo "incise-sim:${line#*=}" >"$config/bench/motor1/${line%=*}"
done
echo "7 0" >$sim/inputs
echo 1 >"$config/bench/live"
axes="0 step=0 dir=1 enable=2 min=3 max=4 home=5 min_at=-400;1 step=8 dir=9 enable=10 home=11"
# carriages WHERE WHERE: of motor 0 and 1; their highest and lowest places start there.
carriages() {
	for motor in 0 1; do
		echo "number=$(echo "$axes" | cut -d ';' -f $((motor + 1))) max_at=1000000 home_at=-2000..0 position=$1" >$sim/carriage
		shift
	done
}
carriage() { sed -n "s/^number=$1 .* $2=\([-0-9]*\).*/\1/p" $sim/carriage; }
carriages 400 400
device=kernel:/dev/$(cat $config/bench/cdev)
limits="travel_mm = 30.0; lead_mm = 4.0; microsteps = 8; velocity_mm_s = 30.0; acceleration_mm_s2 = 2000.0;
	home_mm_s = 10.0; deadman_ms = 50;"
cat >/tmp/rig.conf <<END
tracker = "sim:";
stepper = [ "$device:0", "$device:1" ];
actuator = ( { spring_N_mm = 2.0; origin_mm = -22.0; $limits },
	{ spring_N_mm = 0.5; origin_mm = -15.0; rest_mm = 15.0; direction = [0.0, 1.0, 0.0]; $limits } );
sim = { depth_mm = [10]; times = [9]; cut_s = 2.0; pause_s = 1.5; tracker_noise_mm = 0.0; withdrawal = "paper"; };
END
cat >/tmp/side.scene <<END
tissue = { reaction_N_mm = 0.1; plane_N_mm = 0.05; };
tool = { side = [0.6, 0.8, 0.0]; };
END
homes() { scene=/tmp/side.scene haptic --home --duration 0.5s; }
check "two motors are homed, and driven from one plan" homes
# Steps of a turn of 4 mm: 1600. One step by a reversal at the edge, and one by the count.
rests() { [ "$(carriage 0 position)" -ge -1 ] && [ "$(carriage 0 position)" -le 2 ] &&
	[ "$(carriage 1 position)" -ge 5998 ] && [ "$(carriage 1 position)" -le 6002 ] || { cat $sim/carriage; return 1; }; }
check "each goes back to where it rests" rests
carriages "$(carriage 0 position)" "$(carriage 1 position)"
# Cuts follow each other in one place: it meets a whole one whenever the motors are ready, and no nut
# has a way to go to it. Time skips while the guest waits for a file, by seconds on a busy host.
two() { scene=/tmp/side.scene haptic --duration 9s -o /tmp/log.csv; }
check "they run through a cut" two
sed 's/^/# /' /tmp/out
both() { said "^felt .*along (0, 0, 1), along (0, 1, 0); not felt: 0\.[0-9]*[1-9]" </tmp/out; }
check "both directions are named, and what is across them is counted" both
without() { for line in 2 10; do grep -q "^$line out 0" $sim/inputs || { cat $sim/inputs; return 1; }; done; }
check "both end without power" without
# By the chip's count of edges: the nuts turned round where the plan sent them, which the log
# has: within 0.1 mm, the way of a lag of 10 ms there. The lowest place of motor 1 is the largest
# force's, as its handle goes 0.05 mm to either side. And its spring gives what was asked, within 5 %.
follows() {
	awk -F, -v high="$(carriage 0 highest)" -v low="$(carriage 1 lowest)" '
		NR == 1 { for (i = 1; i <= NF; i++) column[$i] = i; next }
		{ z = $column["command_z_N"]; y = $column["command_y_N"]
		  if (y < most_y) most_y = y
		  if (cut && $column["phase"] == "cutting") { off += ($column["rendered_2_N"] - last) ^ 2; sum += last ^ 2; n++ }
		  last = y; cut = $column["phase"] == "cutting"
		  nut_z = ($column["z_mm"] + 22 + z / 2) * 400; nut_y = ($column["y_mm"] + 15 + y / 0.5) * 400
		  if (NR == 2 || nut_z > up) up = nut_z
		  if (NR == 2 || nut_y < down) down = nut_y }
		END { printf "motor 0 up to step %d, planned %d; motor 1 down to %d, planned %d, by %.3f N; its force in the cut is off by %.4f N rms of %.4f\n",
			high, up, low, down, -most_y, sqrt(off / n), sqrt(sum / n)
		  exit !(most_y < -0.4 && low < 6000 - 250 && high - up < 40 && up - high < 40 &&
			low - down < 40 && down - low < 40 && off < 0.0025 * sum) }' /tmp/log.csv
}
check "each nut follows its own part of the force" follows
echo "$output" | sed 's/^/# /'
# A fault of one motor alone.
alarm() {
	(n=0; while unpowered >/dev/null && [ $n -lt 200 ]; do sleep 0.1; n=$((n + 1)); done; sleep 1; echo "12 1" >$sim/inputs) &
	! scene=/tmp/side.scene haptic --duration 8s && wait && said "a device failed at tick .*: [^ ]* motor 1 at [^ ]*: alarm" </tmp/err
}
check "an alarm of the second motor ends it, and names the motor" alarm
sed 's/^/# /' /tmp/err
check "then neither has power" without
echo 0 >"$config/bench/live"
rmdir $config/bench/motor1 $config/bench/motor0 $config/bench
check "the modules go" rmmod incise_stepper incise_sim
