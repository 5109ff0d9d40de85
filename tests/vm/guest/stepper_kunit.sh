#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The parts of the stepper module that need no hardware, and the integer model, bit for bit
# as in a program: under KUnit on the debug kernel, by driver/kunit/kunit.h on Debian's, which
# are built without KUnit. Both report in the kernel's log.
. tests/vm/tap
with_modules "parts of the stepper module" incise_kunit

modprobe kunit enable=1 2>/dev/null
modprobe -a libcrc32c crc32c_generic 2>/dev/null
[ ! -e /sys/module/kunit/parameters/enable ] || echo "# KUnit runs the tests"

# One load, with what it reports.
run()
{
	before=$(dmesg | wc -l)
	check "the tests load: $1" insmod "$module" $2 || return
	dmesg | tail -n +$((before + 1)) | sed 's/^\[[^]]*\] *//' |
		grep -E '^(incise_kunit: )? *(not ok|ok|#)' >/tmp/results
	grep -v '# SKIP' /tmp/results | sed -n 's/^\(incise_kunit: \)* */# /p'
	check "they pass: $1" grep -qE '^(incise_kunit: )?ok [0-9]+ incise_stepper' /tmp/results
	check "they go: $1" rmmod incise_kunit
}

run "parts"
"$INCISE_BUILD/tests/vm/fixed_bits" scenes/liver.fis 100000 /tmp >/tmp/models
check "a model in three arithmetics" [ "$(wc -l </tmp/models)" = 3 ]
while read -r parameters; do
	name=${parameters%%.fx*}
	run "${name##*/}" "$parameters"
	check "it was compared: ${name##*/}" \
		sh -c 'grep -v SKIP /tmp/results | grep -q "ok [0-9]* fixed_bits"'
done </tmp/models
