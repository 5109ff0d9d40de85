#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The simulated chip does what the tests of the stepper lean on.
. tests/vm/tap

with_modules "sim_chip" incise_sim
modprobe -a industrialio kfifo_buf industrialio-triggered-buffer
"$INCISE_BUILD/tests/vm/sim_chip" "$module"
