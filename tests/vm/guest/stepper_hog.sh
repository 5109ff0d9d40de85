#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A fault is heard while a program keeps the timer's processor for itself.
. tests/vm/tap
with_modules "a hog" incise_stepper
stepper=$module
with_modules "a hog" incise_sim
[ "$(nproc)" -ge 2 ] || skip "a hog" "it needs two processors"
modprobe -a industrialio kfifo_buf industrialio-triggered-buffer configfs libcrc32c \
	crc32c_generic 2>/dev/null
check "the simulated chip loads" insmod "$module" || exit 0
check "the module loads" insmod "$stepper" || exit 0
echo -1 >/proc/sys/kernel/sched_rt_runtime_us
"$INCISE_BUILD/tests/vm/stepper_hog"
without_stepper
