#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A controller goes live and down while its folders come and go.
. tests/vm/tap
with_stepper "folders"
config=/sys/kernel/config/incise-stepper
mkdir -p $config/bench/motor0
echo incise-sim:0 >$config/bench/motor0/step
echo incise-sim:1 >$config/bench/motor0/dir
"$INCISE_BUILD/tests/vm/stepper_folders" $config/bench 40
rmdir $config/bench/motor1 2>/dev/null
check "folders go" rmdir $config/bench/motor0 $config/bench
without_stepper
