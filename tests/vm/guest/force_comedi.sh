#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Force samples of the kernel's own pretended DAQ card, comedi_test, whose sawtooth tells the
# time of each conversion.
. tests/vm/tap

[ -x "$INCISE_BUILD/tests/vm/force_comedi" ] || skip "force over comedi" "comedilib was not there to build with"
# 64 KiB hold 3.3 s, so that an overflow is soon made; the kernel's usual 2 MiB hold 105 s
modprobe comedi comedi_default_buf_size_kb=64 2>/dev/null
modprobe comedi_test amplitude=1000000 2>/dev/null || skip "force over comedi" "this kernel has no comedi_test"
for _ in 1 2 3 4 5 6 7 8 9 10; do
	[ ! -e /dev/comedi0 ] || break
	sleep 0.1
done
"$INCISE_BUILD/tests/vm/force_comedi" sawtooth
rmmod comedi_test
# 6 V on a range of 5: both ends are clipped
modprobe comedi_test amplitude=6000000
"$INCISE_BUILD/tests/vm/force_comedi" clipped
check "the card is free again" rmmod comedi_test
rmmod comedi
