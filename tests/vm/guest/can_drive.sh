#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The CAN backend on a CAN interface, against the independent drive of tests/can;
# tests/cli/can.bats has much more of it, over a serial adapter.
. tests/vm/tap
. tests/can/peer.sh

[ -x "$INCISE_BUILD/tests/can/drive" ] || skip "CAN drive" "python-canopen was not installed"
modprobe vcan 2>/dev/null || skip "CAN drive" "this kernel has no vcan"
ip link add vcan0 type vcan
ip link set vcan0 up
selftest() { "$INCISE_BUILD/tests/can/selftest" "$@"; }
time "$INCISE_BUILD/tests/can/selftest" --can vcan0
time "$INCISE_BUILD/tests/can/selftest" --can vcan0 --speed 5 100
time "$INCISE_BUILD/tests/can/selftest" --can vcan0 --speed 5 500
time "$INCISE_BUILD/tests/can/selftest" --can vcan0 --speed 5 1000
ip link del vcan0
