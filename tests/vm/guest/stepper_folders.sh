#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A controller goes live and down while its folders come and go.
. tests/vm/tap
with_modules "folders" incise_stepper
stepper=$module
with_modules "folders" incise_sim

config=/sys/kernel/config/incise-stepper
modprobe -a industrialio kfifo_buf industrialio-triggered-buffer configfs 2>/dev/null
check "the simulated chip loads" insmod "$module" || exit 0
check "the module loads" insmod "$stepper" || exit 0
mkdir -p $config/bench/motor0
echo incise-sim:0 >$config/bench/motor0/step
echo incise-sim:1 >$config/bench/motor0/dir
"$INCISE_BUILD/tests/vm/stepper_folders" $config/bench 40
rmdir $config/bench/motor1 2>/dev/null
check "folders go" rmdir $config/bench/motor0 $config/bench
check "the module goes" rmmod incise_stepper
check "the chip goes" rmmod incise_sim
