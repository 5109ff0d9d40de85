#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# KUnit's tests of the stepper module, where the kernel has KUnit: the debug kernel.
. tests/vm/tap
with_modules "KUnit" incise_kunit

check "KUnit loads" modprobe kunit enable=1 || exit 0
check "the tests load" insmod "$module" || exit 0
results=/sys/kernel/debug/kunit/incise_stepper/results
[ -e "$results" ] && sed 's/^/# /' "$results"
check "KUnit's tests pass" grep -q '^ok 1 incise_stepper' "$results"
check "they go" rmmod incise_kunit
