#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A plan in the kernel ticks on, whatever becomes of programs.
. tests/vm/tap
in_virtual_time "a plan survives"
# The shortage of memory takes 8 s of a processor.
[ "$INCISE_VM_KERNEL" = main ] || skip "a plan survives" "once is enough"
with_stepper "a plan survives"
"$INCISE_BUILD/tests/vm/stepper_plan_survival"
without_stepper
