#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Plans that are refused, and all that takes the force of one away.
. tests/vm/tap
with_stepper "a plan stops"
"$INCISE_BUILD/tests/vm/stepper_plan_stops"
without_stepper
