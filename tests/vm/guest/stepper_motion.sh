#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Random motions, every edge judged: the large test of the stepper module.
. tests/vm/tap
with_stepper "random motions"
# A million once; 25 000 a second on an idle processor of the host.
case $INCISE_VM_KERNEL:$INCISE_VM_PROFILE in
main:deterministic) edges=1000000 ;;
second:deterministic) edges=200000 ;;
*) edges=2000 ;;
esac
"$INCISE_BUILD/tests/vm/stepper_motion" "${INCISE_VM_EDGES:-$edges}" "${INCISE_VM_SEED:-1}"
without_stepper
