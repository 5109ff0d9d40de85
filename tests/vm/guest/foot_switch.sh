#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A foot switch on the kernel's own input layer: as the library reads it, and as a loop takes it,
# pulled out and plugged in again.
. tests/vm/tap
modprobe -a uinput evdev 2>/dev/null || skip "foot switch" "the kernel has no uinput"
program=$INCISE_BUILD/tests/vm/foot_switch

"$program" || exit 1

in_virtual_time "the loop's foot switch"
[ "$INCISE_VM_KERNEL" != debug ] || skip "the loop's foot switch" "the debug kernel is too slow for it"

plug_in() {
	rm -f /run/foot /run/node
	mkfifo /run/foot
	"$program" pedal </run/foot >/run/node 3>&- &
	exec 3>/run/foot
	for i in $(seq 400); do
		[ ! -s /run/node ] || break
		sleep 0.05
	done
	ln -sf "$(cat /run/node)" /run/pedal
}
pull_out() { exec 3>&-; }

# until_it TEXT: the loop says it, within 20 s.
until_it() {
	for i in $(seq 40); do
		! grep "$1" /run/err >/dev/null || return 0
		sleep 0.5
	done
	grep -v overruns /run/err
	return 1
}
holds() {
	for i in $(seq 20); do
		now=$("$INCISE_BUILD/bin/incise" tool /run/neck.state)
		[ "$now" != "neck: $1" ] || return 0
		sleep 0.5
	done
	echo "$now"
	grep -v overruns /run/err
	return 1
}
presses() { echo "${2:-b}" >&3 && holds "$1"; }

plug_in
cat >/run/rig.conf <<END
tracker = "sim:";
stepper = "sim:";
foot_switch = { device = "/run/pedal"; key = "b"; };
END
"$INCISE_BUILD/bin/incise" haptic scenes/neck.scene --rig /run/rig.conf --state /run/neck.state \
	--verbose --no-rt --overruns 0 >/run/out 2>/run/err 3>&- &
loop=$!
check "the loop finds it" until_it "foot switch: /run/pedal"
check "it starts with the blade" holds "blade (auto)"
check "a press: the tube" presses tube
check "another key: nothing" presses tube c
check "the next press: auto again" presses "blade (auto)"
pull_out
check "pulled out: one warning" until_it "foot switch disconnected"
sleep 3
once() { [ "$(grep -c "foot switch disconnected" /run/err)" = 1 ]; }
check "and only one" once
plug_in
check "plugged in: it is back" until_it "foot switch: /run/pedal is back"
check "and works" presses tube
kill -TERM $loop
wait $loop
ended=$?
check "the loop ends as asked" [ $ended = 0 ]
pull_out
wait
rmmod uinput evdev 2>/dev/null
exit 0
