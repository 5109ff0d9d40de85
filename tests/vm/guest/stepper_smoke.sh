#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# incise_stepper.ko on the simulated chip: bound by configfs, moved, stopped by each of its
# own means, unbound while open. The large test of edges is another one.
. tests/vm/tap

config=/sys/kernel/config/incise-stepper
with_stepper "the stepper module"

wire()
{
	mkdir -p "$config/$1/$2" && shift
	motor=$1
	shift
	for line in "$@"; do
		echo "incise-sim:${line#*=}" >"$config/bench/$motor/${line%=*}" || return
	done
}
live()
{
	echo "$1" >"$config/bench/live"
}
refused()
{
	! "$@" 2>/dev/null
}

check "wires are named" wire bench motor0 step=0 dir=1 enable=2 limit_min=3 limit_max=4 home=5 fault=6
check "e-stop and SYNC too" sh -c "echo incise-sim:7 >$config/bench/estop && echo incise-sim:8 >$config/bench/sync"
check "what is no line is refused" refused sh -c "echo incise-sim >$config/bench/estop"
# A label that no chip has: the write fails, and the log says which line and label.
echo incise-sin:1 >$config/bench/motor0/dir
check "a chip that is not there is refused" refused live 1
check "the log names the line and the label" \
	sh -c 'dmesg | grep -q "line motor0-dir: no chip labelled incise-sin"'
echo incise-sim:1 >$config/bench/motor0/dir
check "it goes live" live 1 || { dmesg | tail -n 20 | sed 's/^/# /'; exit 0; }
cdev=$(cat $config/bench/cdev)
check "/dev/$cdev is there" [ -c "/dev/$cdev" ]
check "no wire is changed while live" refused sh -c "echo incise-sim:9 >$config/bench/sync"
check "no folder is removed while live" refused rmdir $config/bench/motor0
check "the chip cannot go away" refused rmmod incise_sim

"$INCISE_BUILD/tests/vm/stepper_smoke" "/dev/$cdev" /sys/bus/platform/drivers/incise-stepper \
	"$(cat $config/bench/dev_name)"

check "it is taken down" live 0
check "folders go" rmdir $config/bench/motor0 $config/bench
check "the module goes" rmmod incise_stepper
check "the chip goes" rmmod incise_sim
