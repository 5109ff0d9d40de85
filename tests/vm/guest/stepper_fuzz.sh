#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A hostile owner: a dirty page, ioctls of all sorts.
. tests/vm/tap
with_modules "fuzz" incise_stepper
stepper=$module
with_modules "fuzz" incise_sim

modprobe -a industrialio kfifo_buf industrialio-triggered-buffer configfs 2>/dev/null
check "the simulated chip loads" insmod "$module" || exit 0
check "the module loads" insmod "$stepper" || exit 0
rounds=40
[ "$INCISE_VM_PROFILE" = deterministic ] || rounds=4
"$INCISE_BUILD/tests/vm/stepper_fuzz" $rounds "${INCISE_VM_SEED:-1}"
check "the module goes" rmmod incise_stepper
check "the chip goes" rmmod incise_sim
