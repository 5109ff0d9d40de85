#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The simulated ADC loses no sample that it does not count.
. tests/vm/tap

with_modules "sim_adc" incise_sim
modprobe -a industrialio kfifo_buf industrialio-triggered-buffer
"$INCISE_BUILD/tests/vm/sim_adc" "$module"
