#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Steps given against steps asked, at the largest velocity that is accepted, and pulses that are waited for.
. tests/vm/tap
in_virtual_time "step rates"
with_stepper "step rates" lines=256
"$INCISE_BUILD/tests/vm/stepper_rates"
without_stepper
