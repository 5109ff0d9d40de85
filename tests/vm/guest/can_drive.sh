#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The real programs on a CAN interface, against the independent drive of tests/can;
# tests/cli/can.bats has much more of it, over a serial adapter. 500 Hz: the drive is Python,
# which needs 1.5 ms a cycle on an emulated processor.
. tests/vm/tap
. tests/can/peer.sh
in_virtual_time "CAN drive"

[ -x "$INCISE_BUILD/tests/can/drive" ] || skip "CAN drive" "python-canopen was not installed"
[ -e "$INCISE_BUILD/lib/incise/stepper_can.so" ] || skip "CAN drive" "stepper_can.so was not built"
modprobe vcan 2>/dev/null || skip "CAN drive" "this kernel has no vcan"
root=$PWD
PATH=$INCISE_BUILD/bin:$PATH
deadman=200
mkdir -p /run/can_drive
cd /run/can_drive || exit 1

# In the background until the drive has power; $pid.
begin()
{
	incise "$@" --rig rig.conf >out 2>&1 </dev/null 7>&- &
	pid=$!
	drive_until "operation enabled" || cat out
}

# Waits for it, here: a check is a process of its own, and cannot. $code.
finish()
{
	wait "$pid" 2>/dev/null
	code=$?
}

# ended TEXT: with 1 and a line that says so; the drive has no power then.
ended()
{
	cat out
	[ $code = 1 ] && tail -n 1 out | grep -q "$1" && drive_stopped
}

# is KEY COMPARISON: of the drive's last answer.
is()
{
	value=$(drive_value "$1")
	awk "BEGIN { exit !($value $2) }" || {
		echo "$1 is $value, not $2: $drive_line" | cut -c1-900
		return 1
	}
}

# The drive's own count from the last heartbeat to its quick stop, ms.
by_itself()
{
	drive_until "switch-on disabled" && drive_tell report && is silence_ms ">= $deadman" || return
	[ "$INCISE_VM_PROFILE" != deterministic ] || is silence_ms "< $deadman + 20"
}

ip link add vcan0 type vcan
ip link set vcan0 up
drive_start --can vcan0
check "the drive is there" drive_is "switch-on disabled" || exit 0
cat >rig.conf <<END
tracker = "sim:";
stepper = "can:vcan0:0x10";
actuator = {
	spring_N_mm = 2.0; travel_mm = 30.0; lead_mm = 4.0; velocity_mm_s = 30.0;
	acceleration_mm_s2 = 2000.0; home_mm_s = 20.0; deadman_ms = $deadman;
	can = { cycle_us = 2000; homing_method = 17; };
};
sim = { depth_mm = [15]; times = [1000]; };
END

check "info lists it" says 0 "incise-test-drive: switch-on disabled" info can:vcan0
check "status looks" says 0 "not homed" stepper status --rig rig.conf
check "home" says 0 "" stepper home --rig rig.conf
drive_tell state
check "where the switch lets go" is shaft "== -19999"
check "move" says 0 "now at 2.0000 mm" stepper move 2 --rig rig.conf
drive_tell state
check "2 mm are 25600 counts" is position "== 25600"
check "it has no power" drive_stopped

drive_tell restart
# Compiled: an emulated processor takes ten seconds over the survey of a .fis file.
sed "s|model = .*|model = \"$INCISE_BUILD/tests/vm/liver.fx\";|" "$root/scenes/liver.scene" >liver.scene
haptic() { incise haptic liver.scene --rig rig.conf --duration 2s --json >report.json; }
check "haptic renders" haptic
# The report has the first actuator twice: by itself and in the list of all.
sent=$(sed -n 's/.*"setpoints_sent": \([0-9]*\).*/\1/p' report.json | head -n 1)
drive_tell report
echo "# start-up $(drive_value start_ms) ms, $sent set-points," \
	"between SYNCs $(drive_value median_ms) ms in the median, $(drive_value max_ms) ms at most"
check "each set-point arrives" is rpdos "== $sent"
check "none is missing at a SYNC" is missing "== 0"
check "none is doubled" is doubled "== 0"

begin stepper jog 5
drive_tell fault 0x3210
finish
check "a fault in motion ends it" ended 3210h
check "clear" says 0 "" stepper clear --rig rig.conf
begin stepper jog 5
drive_tell reboot
finish
check "so does a drive that begins anew" ended "it restarted"
check "home again" says 0 "" stepper home --rig rig.conf
begin stepper jog 5
kill -9 "$pid"
finish
check "kill -9: the drive stops by itself" by_itself
check "and has no power" drive_stopped

begin stepper jog 5
kill -STOP "$pid"
check "kill -STOP: so it does" by_itself
kill -CONT "$pid"
finish
check "who wakes up says why, and nothing moves" ended "drive 0x10"
says 0 "" stepper clear --rig rig.conf >/dev/null

begin stepper jog 2
ip link set vcan0 down
finish
check "an interface that goes down is named" ended "Network is down"
check "the drive stops by itself" by_itself
drive_end
ip link del vcan0
