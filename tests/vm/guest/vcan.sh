#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A virtual CAN bus carries a frame: modules of the guest's own kernel load.
. tests/vm/tap

modprobe vcan 2>/dev/null || skip "vcan" "this kernel has no vcan"
ip link add vcan0 type vcan
ip link set vcan0 up
# It gives up after ten minutes: virtual time runs ahead while the bed is idle.
candump -n 1 -T 600000 vcan0 >/run/candump &
dump=$!
# The socket of the reader is there when the kernel lists it, not "(vcan0: no entry)".
while ! grep -Eqs '^ *vcan0 ' /proc/net/can/rcvlist_all && kill -0 $dump; do sleep 0.05; done
cansend vcan0 123#DEADBEEF
wait $dump
check "a frame arrives as it was sent" grep -q '123   \[4\]  DE AD BE EF' /run/candump
ip link del vcan0
