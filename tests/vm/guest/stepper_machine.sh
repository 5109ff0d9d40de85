#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# The load of ticks, idle states, sleep, and pages that somebody holds on to.
. tests/vm/tap
with_stepper "the machine"
"$INCISE_BUILD/tests/vm/stepper_machine"
without_stepper
