#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The motors of stepper.conf, as incise-stepper.service sets them up: bound as a whole, or nothing
# is left and the line of the file is named.
. tests/vm/tap
with_stepper "stepper.conf"
config=/sys/kernel/config/incise-stepper
file=/tmp/stepper.conf

setup_file() { udev/stepper-setup "$@"; }
# refused CODE TEXT: with nothing left
refused()
{
	said=$(setup_file start $file 2>&1)
	got=$?
	echo "exit code $got: $said"
	[ $got = "$1" ] && [ "$said" = "stepper-setup: $file$2" ] && [ -z "$(ls $config)" ]
}
# has LINE VALUE
has() { [ "$(cat "$config/$1")" = "$2" ]; }
bound() { has "$1/live" 1 && [ -c "/dev/$(cat "$config/$1/cdev")" ]; }

cat >$file <<END
# two controllers on the simulated chip
bench/motor0/step = incise-sim:0
bench/motor0/dir = incise-sim:1
bench/motor0/enable = incise-sim:2:active-low:pull-up
bench/estop = incise-sim:7:pull-up  # a breaking contact
more/motor0/step = incise-sim:8
more/motor0/dir = incise-sim:9
END
cp $file $file.whole
check "the file is set up" setup_file start $file
check "both controllers are bound" bound bench && check "and" bound more
check "with their lines" has bench/motor0/enable incise-sim:2:active-low:pull-up
check "it is set up once" sh -c "! udev/stepper-setup start $file"
check "stop takes them away" setup_file stop
check "and nothing is left" [ -z "$(ls $config)" ]

# with TEXT: in place of the last line
with() { sed "\$s|.*|$1|" $file.whole >$file; }
help="'gpioinfo' prints the chips' labels and their lines"
with "more/motor0/dir=pinctrl-rp1:9"
check "a chip that is missing" refused 1 ":7: more/motor0/dir: no chip labelled pinctrl-rp1; $help"
# A kernel without CONFIG_SYMBOLIC_ERRNAME prints numbers.
einval=-EINVAL ebusy=-EBUSY
[ "$INCISE_VM_KERNEL" != debug ] || einval=-22 ebusy=-16
with "more/motor0/dir=incise-sim:999"
check "a line that the chip has not" refused 1 \
	":7: more/motor0/dir: of incise-sim: it is not available: $einval; $help"
with "more/motor0/dir=incise-sim:0"
check "a line that another controller has" refused 1 \
	":7: more/motor0/dir: of incise-sim: it is not available: $ebusy; $help"
with "more/motor0/dir=incise-sim:70000"
check "an offset that no chip has" refused 2 ":7: more/motor0/dir: incise-sim:70000: Invalid argument"
with "more/motor0/dir=incise-sim:9:pull-up:pull-down"
check "both resistors" refused 2 ":7: more/motor0/dir: incise-sim:9:pull-up:pull-down: Invalid argument"
with "more/motor0/dir=9"
check "a number for a line" refused 2 ":7: more/motor0/dir: 9: Invalid argument"
with "more/motor0/stpe=incise-sim:9"
check "an unknown line" refused 2 \
	":7: more/motor0/stpe: no such line; there are: cpu debounce_ns dir enable fault home limit_max limit_min lost_steps_max step"
with "a_name_that_is_longer_than_31_letters/estop=incise-sim:9"
check "a long name" refused 2 ":7: a_name_that_is_longer_than_31_letters: File name too long"
with "more/motor2/step=incise-sim:9"
check "a gap in the numbers" refused 1 ": more: Invalid argument; motors are numbered from 0 without a gap"
with ""
check "a motor without dir" refused 1 ": more/motor0/dir: it must be wired; $help"
cp $file.whole $file
mkdir $config/more
check "a controller made by hand is left alone" sh -c "! udev/stepper-setup start $file && [ \"\$(ls $config)\" = more ]"
rmdir $config/more
check "the file is set up after all that" setup_file start $file
check "stop" setup_file stop
without_stepper
