#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Allocations that fail: only the debug kernel has fault injection.
. tests/vm/tap
faults=/sys/kernel/debug/failslab
[ -e $faults ] || skip "no memory" "this kernel has no fault injection"
with_stepper "no memory"
# Where the kernel has no memory for the two links between a device and its properties, it later
# frees the properties twice (software_node_notify(), 6.12): links and the device's name do not fail.
echo Y >$faults/cache-filter
for cache in /sys/kernel/slab/*; do
	case ${cache##*/} in
	kernfs_node_cache | kmalloc-32) ;;
	*) echo 1 >"$cache/failslab" ;;
	esac
done
echo N >$faults/ignore-gfp-wait
echo 0 >$faults/verbose
"$INCISE_BUILD/tests/vm/stepper_no_memory"
without_stepper
