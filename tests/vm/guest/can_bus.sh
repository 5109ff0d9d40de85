#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# CAN buses of the kernel, as the library opens them, over vcan.
. tests/vm/tap

modprobe -a vcan can_raw 2>/dev/null || skip "vcan" "this kernel has no vcan"
[ -x "$INCISE_BUILD/tests/vm/can_bus" ] || skip "CAN buses" "libmnl was not there to build with"
ip link add vcan0 type vcan
ip link set vcan0 up
ip link add vcan9 type vcan
"$INCISE_BUILD/tests/vm/can_bus" vcan0 2>/run/stderr
# who asked the kernel by libsocketcan had lines of that here
check "nothing is printed beside" [ ! -s /run/stderr ]
sed 's/^/# /' /run/stderr
ip link del vcan9

# A controller with a driver, whose settings ip tells as well: the kernel's own slcan on a pty.
if modprobe slcan 2>/dev/null; then
	"$INCISE_BUILD/tests/vm/can_netlink"
else
	echo "ok a controller # skip this kernel has no slcan"
fi
