#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# All that stops a motor, while it moves.
. tests/vm/tap
with_modules "stops" incise_stepper
stepper=$module
with_modules "stops" incise_sim

modprobe -a industrialio kfifo_buf industrialio-triggered-buffer configfs 2>/dev/null
check "the simulated chip loads" insmod "$module" || exit 0
check "the module loads" insmod "$stepper" || exit 0
rounds=40
[ "$INCISE_VM_PROFILE" = deterministic ] || rounds=4
"$INCISE_BUILD/tests/vm/stepper_stops" $rounds "${INCISE_VM_SEED:-1}"
check "the module goes" rmmod incise_stepper
check "the chip goes" rmmod incise_sim
