#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A plan whose positions come from IIO, within the kernel.
. tests/vm/tap
with_modules "a source" incise_stepper
stepper=$module
with_modules "a source" incise_source
source=$module
with_modules "a source" incise_sim
modprobe -a industrialio kfifo_buf industrialio-triggered-buffer configfs libcrc32c \
	crc32c_generic 2>/dev/null
check "the simulated converter loads" insmod "$module" source=incise-stepper.0 || exit 0
check "the module loads" insmod "$stepper" || exit 0
check "the source loads" insmod "$source" || exit 0
"$INCISE_BUILD/tests/vm/stepper_plan_source" 4000 1000000
[ "$INCISE_VM_PROFILE" != deterministic ] ||
	"$INCISE_BUILD/tests/vm/stepper_plan_source" 10000 100000
check "the source goes" rmmod incise_source
without_stepper
