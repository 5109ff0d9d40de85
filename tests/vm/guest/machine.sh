#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The guest is what the tests after this one build on.
. tests/vm/tap

check "the kernel is PREEMPT_RT" grep -q PREEMPT_RT /proc/version
cpus=$(grep -c ^processor /proc/cpuinfo)
case $INCISE_VM_PROFILE in
deterministic) check "one processor" [ "$cpus" = 1 ] ;;
smp) check "two processors" [ "$cpus" = 2 ] ;;
esac
check "high-resolution timers" grep -q 'hres_active *: 1' /proc/timer_list 2>/dev/null ||
	grep hres /proc/timer_list
for mount in debug tracing config; do
	check "/sys/kernel/$mount is mounted" grep -q " /sys/kernel/$mount " /proc/mounts
done
check "the project is at its path" [ -x tests/vm/boot ]
check "the root may be written to" touch /etc/incise-vm-was-here
echo "$INCISE_VM_KERNEL $INCISE_VM_PROFILE" >"$INCISE_VM_RESULTS/machine.txt"
check "results reach the host's directory" grep -q "^results $INCISE_VM_RESULTS 9p" /proc/mounts
