#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The machine sleeps while a motor moves: each level of pm_test, with and without memory to spare.
. tests/vm/tap
with_modules "sleep" incise_stepper
grep -qs core /sys/power/pm_test && grep -qs deep /sys/power/mem_sleep || skip "sleep" "this kernel has no pm_test"
with_stepper "sleep"
# All files come through them.
for device in /sys/bus/pci/drivers/virtio-pci/0*; do
	echo "awake=${device##*/}" >/sys/kernel/debug/incise_sim/sleep
done
echo deep >/sys/power/mem_sleep
"$INCISE_BUILD/tests/vm/stepper_sleep"
echo none >/sys/power/pm_test
without_stepper
