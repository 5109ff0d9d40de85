#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# All that stops a motor, while it moves.
. tests/vm/tap
with_stepper "stops"
rounds=40
[ "$INCISE_VM_PROFILE" = deterministic ] || rounds=4
"$INCISE_BUILD/tests/vm/stepper_stops" $rounds "${INCISE_VM_SEED:-1}"
without_stepper
