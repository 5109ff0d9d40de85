#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Force samples of the simulated converter through libiio, as the module of the backend
# reads them.
. tests/vm/tap

[ -x "$INCISE_BUILD/tests/vm/force_iio" ] || skip "force over IIO" "libiio was not there to build with"
with_modules "force over IIO" incise_sim
modprobe -a industrialio kfifo_buf industrialio-triggered-buffer
# From 6.12 on; without them a converter runs on its own trigger. KASAN finds that industrialio-configfs uses a
# trigger that was removed after it freed it: not on that kernel.
hrtimer=
if [ "$INCISE_VM_KERNEL" != debug ] && modprobe -a configfs industrialio-configfs iio-trig-hrtimer 2>/dev/null; then
	hrtimer=hrtimer
	mountpoint -q /sys/kernel/config || mount -t configfs configfs /sys/kernel/config
fi
"$INCISE_BUILD/tests/vm/force_iio" "$module" $hrtimer 2>/run/stderr
check "nothing is printed beside" [ ! -s /run/stderr ]
sed 's/^/# /' /run/stderr
[ -z "$hrtimer" ] || rmmod iio-trig-hrtimer
