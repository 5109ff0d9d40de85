#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Hostile plans, and poses of any numbers.
. tests/vm/tap
with_stepper "hostile plans"
rounds=60
[ "$INCISE_VM_PROFILE" = deterministic ] || rounds=12
"$INCISE_BUILD/tests/vm/stepper_plan_fuzz" "${INCISE_VM_ROUNDS:-$rounds}" "${INCISE_VM_SEED:-1}" \
	"$INCISE_BUILD/tests/vm/liver.fx"
without_stepper
