#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A controller goes live and down while its folders come and go.
. tests/vm/tap
with_stepper "folders"
config=/sys/kernel/config/incise-stepper
mkdir -p $config/bench/motor0
# reads_back TEXT [OTHER]: limit_min says it as it was written, or in another order.
reads_back()
{
	echo "$1" >$config/bench/motor0/limit_min
	[ "$(cat $config/bench/motor0/limit_min)" = "${2:-$1}" ]
}
for words in "" :active-low :pull-up :active-low:pull-up :active-low:pull-down; do
	check "a line with the words \"$words\"" reads_back "a:label:3$words"
done
check "words in another order" reads_back label:3:pull-up:active-low label:3:active-low:pull-up
check "both resistors are refused" eval "! reads_back label:3:pull-up:pull-down 2>/dev/null"
check "the line is left as it was" [ "$(cat $config/bench/motor0/limit_min)" = label:3:active-low:pull-up ]
echo >$config/bench/motor0/limit_min
echo incise-sim:0 >$config/bench/motor0/step
echo incise-sim:1 >$config/bench/motor0/dir
"$INCISE_BUILD/tests/vm/stepper_folders" $config/bench 40
rmdir $config/bench/motor1 2>/dev/null
check "folders go" rmdir $config/bench/motor0 $config/bench
without_stepper
