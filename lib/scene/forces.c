// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The forces of a scene's tissue; ../tissue/tick.proto.c has their physics.
 */
#include "forces.h"

#define CUTTING (1U << INCISE_PHASE_CUTTING)
#define INSERTION (1U << INCISE_PHASE_INSERTION)

const struct incise_tissue_force incise_tissue_forces[] = {
	[INCISE_FORCE_REACTION] =
		{
			.name = "reaction",
			.phases = CUTTING,
			.kind = INCISE_SPRING_NORMAL,
			.number =
				{{"reaction_N_mm", "N/mm", 1000, "0", 0.14,
				  "Kn: force per depth along the normal; replaces a model"},
				 {"unloading_N_mm", "N/mm", 1000, "0", 0,
				  "stiffness with which the tissue of a model "
				  "unloads; 0: automatic"},
				 {"friction", "", 1, "0.1", 0.1,
				  "share of the model's force that resists the "
				  "blade in its open cut, in both directions"}},
			.zero = "no model, and tissue.reaction_N_mm is 0",
			.model = true,
			.stage = INCISE_STAGE(reaction),
		},
	[INCISE_FORCE_PLANE] =
		{
			.name = "plane",
			.phases = CUTTING,
			.kind = INCISE_SPRING_SIDE,
			.number = {{"plane_N_mm", "N/mm", 1000, "0", 0.17,
				    "Kx: holds the blade in the plane that it had "
				    "when the cut began"}},
			.zero = "tissue.plane_N_mm is 0",
			.stage = INCISE_STAGE(plane),
		},
	[INCISE_FORCE_DAMPING] =
		{
			.name = "damping",
			.phases = CUTTING | INSERTION,
			.kind = INCISE_DAMPER,
			.number =
				{{"damping_N_s_mm", "N s/mm", 1, "0", 0.0005,
				  "Kd: opposes the velocity of the tool in the tissue"}},
			.zero = "tissue.damping_N_s_mm is 0",
			.stage = INCISE_STAGE(damping),
		},
	[INCISE_FORCE_INSERTION] =
		{
			.name = "insertion",
			.phases = INSERTION,
			.kind = INCISE_SPRING_NORMAL,
			.number = {{"insertion_N_mm", "N/mm", 1000, "0", 0.28,
				    "Ky: force per depth against the handle or a "
				    "tube, across a cut or outside of it"},
				   {"aligned", "", 1, "0.2", 0.2,
				    "share of insertion_N_mm for a handle with its "
				    "flat side along the cut, or a tube in a wide "
				    "enough cut"}},
			.zero = "tissue.insertion_N_mm is 0",
			.stage = INCISE_STAGE(insertion),
		},
	[INCISE_FORCE_SPREAD] =
		{
			.name = "spread",
			.phases = INSERTION,
			.kind = INCISE_SPRING_ACROSS,
			.number = {{"spread_N_mm", "N/mm", 1000, "0", 0.22,
				    "Kxz: pulls a handle or tube back to its point "
				    "of entry, perpendicular to the normal"}},
			.zero = "tissue.spread_N_mm is 0",
			.stage = INCISE_STAGE(spread),
		},
};
const int incise_n_tissue_forces =
	sizeof(incise_tissue_forces) / sizeof(*incise_tissue_forces);
_Static_assert(sizeof(incise_tissue_forces) / sizeof(*incise_tissue_forces) <=
		       INCISE_FORCES_MAX,
	       "raise INCISE_FORCES_MAX, and INCISE_PLAN_STAGES_MAX with it");
