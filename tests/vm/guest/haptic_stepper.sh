#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# incise haptic drives a motor through the kernel module: it homes it, renders through it,
# ends with the fault's name when the e-stop is pressed, and leaves nothing powered.
. tests/vm/tap
with_modules "haptic loop" incise_stepper
stepper=$module
with_modules "haptic loop" incise_sim
in_virtual_time "haptic loop"
[ "$INCISE_VM_KERNEL" != debug ] || skip "haptic loop" "the debug kernel holds no rig's step rate"

config=/sys/kernel/config/incise-stepper
sim=/sys/kernel/debug/incise_sim
modprobe -a industrialio kfifo_buf industrialio-triggered-buffer configfs 2>/dev/null
check "the simulated chip loads" insmod "$module" || exit 0
check "the module loads" insmod "$stepper" || exit 0
mkdir -p "$config/bench/motor0"
for line in step=0 dir=1 enable=2 limit_min=3 limit_max=4 home=5; do
	echo "incise-sim:${line#*=}" >"$config/bench/motor0/${line%=*}"
done
echo incise-sim:7 >"$config/bench/estop"
echo 1 >"$config/bench/live"
echo "number=0 step=0 dir=1 enable=2 min=3 max=4 home=5 min_at=-400 max_at=1000000" \
	"home_at=-2000..0 position=3000" >$sim/carriage

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
sed "s|liver.fis|$INCISE_BUILD/tests/vm/liver.fx|" scenes/liver.scene >/tmp/liver.scene
haptic() { "$INCISE_BUILD/bin/incise" haptic ${scene:-scenes/wall.scene} --rig /tmp/rig.conf "$@" >/tmp/out 2>/tmp/err; }
said() { grep -q "$@" || { cat /tmp/out /tmp/err; return 1; }; }
position() { sed -n 's/.* position=\([-0-9]*\).*/\1/p' $sim/carriage; }
unpowered() { grep -q '^2 out 0' $sim/inputs || cat $sim/inputs; grep -q '^2 out 0' $sim/inputs; }

refused() { ! haptic --duration 1s && said "is not homed; run .incise stepper home --rig /tmp/rig.conf" </tmp/err; }
check "without its 0 it is refused, with what to do" refused
# Long enough for a pause in the air, without which no force begins; cuts are short.
homed() { scene=/tmp/liver.scene haptic --home --duration 5s && said actuate </tmp/out; }
check "with --home it runs" homed
felt() { said "^force *largest 0*[1-9.]*[1-9]" </tmp/out; }
check "and renders forces" felt
sed 's/^/# /' /tmp/out
check "it ends without power" unpowered
# Back at 0: the home edge, to what a poll of 1 ms at a tenth of 5 mm/s is.
at_zero() { [ "$(position)" -ge -1 ] && [ "$(position)" -le 1 ]; }
check "and at 0" at_zero || cat $sim/carriage
check "the 0 is known to the next run" haptic --duration 1s
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
	! wait $pid && said "deadman: targets stopped coming" </tmp/err
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
echo 0 >"$config/bench/live"
rmdir $config/bench/motor0 $config/bench
check "the modules go" rmmod incise_stepper incise_sim
