#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A hostile owner: a dirty page, ioctls of all sorts.
. tests/vm/tap
with_stepper "fuzz"
rounds=40
[ "$INCISE_VM_PROFILE" = deterministic ] || rounds=4
"$INCISE_BUILD/tests/vm/stepper_fuzz" $rounds "${INCISE_VM_SEED:-1}"
without_stepper
