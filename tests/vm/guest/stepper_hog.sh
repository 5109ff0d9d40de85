#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A fault is heard while a program keeps the timer's processor for itself.
. tests/vm/tap
[ "$(nproc)" -ge 2 ] || skip "a hog" "it needs two processors"
with_stepper "a hog"
echo -1 >/proc/sys/kernel/sched_rt_runtime_us
"$INCISE_BUILD/tests/vm/stepper_hog"
without_stepper
