#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A haptic device of moteus motors on a CAN FD interface, against the independent drives of
# tests/can/moteus_drive.py. 100 Hz: they are Python on an emulated processor.
. tests/vm/tap
. tests/can/peer.sh
in_virtual_time "moteus motors"

[ -x "$INCISE_BUILD/tests/can/moteus_drive" ] || skip "moteus motors" "python-can was not installed"
[ -x "$INCISE_BUILD/tests/vm/haptic_moteus" ] || skip "moteus motors" "libmnl was not there to build with"
modprobe vcan 2>/dev/null || skip "moteus motors" "this kernel has no vcan"
mkdir -p /run/moteus
cd /run/moteus || exit 1
drive_program=moteus_drive
out=

# device IDS TICKS FORCE: its line in $out.
device() { out=$("$INCISE_BUILD/tests/vm/haptic_moteus" "$1" 100 "$2" "$3" 7>&-); }
of() { printf '%s\n' "$out" | sed -n "s/.*\"$1\": \"\{0,1\}\([^,\"}]*\).*/\1/p"; }
# is KEY COMPARISON, of the device's line.
is()
{
	awk "BEGIN { exit !($(of "$1") $2) }" || {
		echo "$1 is not $2: $out"
		return 1
	}
}
has()
{
	case $out in
	*"$1"*) ;;
	*)
		echo "no \"$1\" in $out"
		return 1
		;;
	esac
}
# becomes COMMAND…: reads a state until COMMAND holds; in vain it prints the reason.
becomes()
{
	for _ in $(seq 1000); do
		"$@" >/dev/null && return
	done
	"$@"
}
pushes()
{
	drive_tell state 1
	[ "$(drive_value mode)" = 10 ] && [ "$(drive_value torque)" != 0.0 ] || {
		echo "the motor has no torque: $drive_line"
		return 1
	}
}
# In the background, until the motor has torque; $pid. ended: waits for it.
begin()
{
	"$INCISE_BUILD/tests/vm/haptic_moteus" "$1" 100 100000 "$2" >line 2>&1 7>&- &
	pid=$!
	becomes pushes
}
ended()
{
	wait "$pid"
	out=$(cat line)
}
free()
{
	drive_tell state 1
	[ "$(drive_value torque)" = 0.0 ] && [ "$(drive_value mode)" != 10 ] || {
		echo "the motor has torque: $drive_line"
		return 1
	}
}

ip link add vcan0 mtu 16 type vcan
ip link set vcan0 up
device vcan0:1 10 0
check "an interface without CAN FD is refused" has "takes no CAN FD frames"
ip link set vcan0 down
ip link set vcan0 mtu 72
ip link set vcan0 up
device vcan0:1 10 0
check "no motor" has "no answer of motor 1"

drive_start --can vcan0 --ids 1,2
check "the drives are there" [ "$drive" = moteus:vcan0:1,2 ] || exit 0
out=$("$INCISE_BUILD/bin/incise" info moteus:vcan0 2>&1 7>&-)
check "a search finds both" has "moteus:vcan0:2"
device vcan0:1,2 300 0.5
check "each cycle has a sample" is samples ">= 298"
check "none is lost" is lost "== 0"
check "the motors start within 100 ms" is ready ">= 288"
check "a sample is a cycle old" is age_ms "< 20.5"
check "no error" is error "== 0"
check "closed, a motor is stopped" free
device vcan0:1,3 10 0
check "one that is missing is named" has "no answer of motor 3"
drive_tell watchdog 2 0
device vcan0:1,2 10 0
check "one without a watchdog is refused" has "motor 2 does not start, and stop by its watchdog"
drive_tell watchdog 2 1

begin vcan0:1,2 0.2
drive_tell fault 2 38
check "a fault of one ends the torque of the other" becomes free
kill "$pid"
begin vcan0:1,2 0.2
drive_tell silent 2
check "so does silence" becomes free
ended
check "which is an error with its reason" has "motor 2 does not answer"
drive_end

drive_start --can vcan0 --ids 1
begin vcan0:1 0.2
kill -9 "$pid"
wait "$pid" 2>/dev/null
check "kill -9: the drive stops by itself" becomes free
begin vcan0:1 0.2
kill -STOP "$pid"
check "kill -STOP: so it does" becomes free
kill -CONT "$pid"
check "and starts again with the program" becomes pushes
kill "$pid"
wait "$pid" 2>/dev/null

# The commands of a user, by way of the owner of the device.
cat >rig.conf <<END
haptic = "$drive";
haptic_setup = {
	motor_direction = [1, 0, 0]; motor_mm_turn = [10.0]; motor_torque_N_mm = [100.0];
	rate_hz = 250.0; mass_kg = 0.6; lost_s = 0.5;
};
END
PATH=$INCISE_BUILD/bin:$PATH
incise calibrate torque --rig rig.conf --json >torque.json 2>torque.err 7>&-
sed 's/^/# /' torque.err
out=$(tr -d '\n' <torque.json)
echo "# $out"
# 0.002 N m by 10 mm a turn are 1.26 N; cogging of 4.7 N/mm, steeper than the spring, counts for less.
check "its friction is measured" is coulomb_N "> 1 && $(of coulomb_N) < 1.4"
check "and its cogging" is cogging_N "> 0.05 && $(of cogging_N) < 0.7"
check "the owner has stopped the motor" becomes free

begin vcan0:1 0.2
ip link set vcan0 down
ended
check "an interface that goes down is named" has "Network is down"
drive_end
ip link del vcan0
