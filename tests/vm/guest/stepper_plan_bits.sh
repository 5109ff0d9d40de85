#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A plan in the kernel gives the same bits as in a program.
. tests/vm/tap
in_virtual_time "bits of a plan"
with_stepper "bits of a plan"
ticks=60000
[ "$INCISE_VM_KERNEL" = main ] || ticks=12000
"$INCISE_BUILD/tests/vm/stepper_plan_bits" "${INCISE_VM_TICKS:-$ticks}" \
	"$INCISE_BUILD/tests/vm/liver.fx" "${INCISE_VM_SEED:-1}"
without_stepper
