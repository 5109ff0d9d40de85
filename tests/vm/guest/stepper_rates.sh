#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Steps given against steps asked, at the largest velocity that is accepted, and pulses that are waited for.
. tests/vm/tap
with_stepper "step rates" lines=256
in_virtual_time "step rates"
"$INCISE_BUILD/tests/vm/stepper_rates"
without_stepper
