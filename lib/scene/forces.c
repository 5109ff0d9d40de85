// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The forces of a scene's tissue, row by row; see forces.h.
 */
#include "forces.h"

#define CUTTING (1U << INCISE_PHASE_CUTTING)
#define INSERTION (1U << INCISE_PHASE_INSERTION)

#define FORCE(row, stage_, phases_, kind_, acts_, zero_, formula_, does_)               \
	[INCISE_FORCE_##row].name = #stage_, [INCISE_FORCE_##row].phases = (phases_),   \
	[INCISE_FORCE_##row].kind = (kind_), [INCISE_FORCE_##row].acts = (acts_),       \
	[INCISE_FORCE_##row].zero = (zero_), [INCISE_FORCE_##row].formula = (formula_), \
	[INCISE_FORCE_##row].does = (does_),                                            \
	[INCISE_FORCE_##row].stage = INCISE_STAGE(stage_),
#define NUMBER(row, i, member, scale, most, key, unit, max, initial, skin, help) \
	[INCISE_FORCE_##row].number[i] = {                                       \
		key, unit, max, initial, skin, help, "tissue." key " is 0"},
#define MORE(member)

const struct incise_tissue_force incise_tissue_forces[] = {
#include "../tissue/forces.def"
};
const int incise_n_tissue_forces = INCISE_FORCES;
