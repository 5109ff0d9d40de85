#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Random motions, every edge judged: the large test of the stepper module.
. tests/vm/tap
with_modules "random motions" incise_stepper
stepper=$module
with_modules "random motions" incise_sim

modprobe -a industrialio kfifo_buf industrialio-triggered-buffer configfs 2>/dev/null
check "the simulated chip loads" insmod "$module" || exit 0
check "the module loads" insmod "$stepper" || exit 0
# A million once; 25 000 a second on an idle processor of the host.
case $INCISE_VM_KERNEL:$INCISE_VM_PROFILE in
main:deterministic) edges=1000000 ;;
second:deterministic) edges=200000 ;;
debug:deterministic) edges=50000 ;;
*) edges=2000 ;;
esac
"$INCISE_BUILD/tests/vm/stepper_motion" "${INCISE_VM_EDGES:-$edges}" "${INCISE_VM_SEED:-1}"
sed 's/^/# /' /sys/kernel/debug/incise_stepper/*/lateness 2>/dev/null
check "the module goes" rmmod incise_stepper
check "the chip goes" rmmod incise_sim
