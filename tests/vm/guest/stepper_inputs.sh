#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Inputs that are seen twice, late, never, or cannot be read.
. tests/vm/tap
with_stepper "inputs"
"$INCISE_BUILD/tests/vm/stepper_inputs"
check "the log names the line whose interrupt failed" \
	sh -c 'dmesg | grep -q "line estop of incise-sim: its chip gives no interrupt"'
without_stepper
