#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The fuzzy evaluator and the plane constraint in the kernel, bit for bit as in a program.
. tests/vm/tap
with_modules "the integer model in the kernel" incise_stepper

modprobe configfs 2>/dev/null
check "the module loads" insmod "$module" || exit 0
"$INCISE_BUILD/tests/vm/fixed_bits" scenes/liver.fis 100000
check "the module goes" rmmod incise_stepper
