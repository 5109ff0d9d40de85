/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Whether a plan comes to rest: a search by closed loops in time, for swings that no linear view of a point of rest
 * shows. A model's force depends on |v|, which has a corner at rest; a tissue that unloads has memory; an averaged
 * normal is late: all can swing for ever where each slope alone is stable.
 *
 *   hand leans ─▶ device ─▶ tracker ─▶ the plan's own stages ─▶ late ticks, slew ─┐
 *                   ▲                                                             │
 *                   └────────────────── held for a tick ◀─────────────────────────┘
 *
 * The device is without dry friction, and bare, held across, or in a hand. It starts in the air and leans with a
 * constant force up to the scene's limit:
 *
 *   - of all scenes, free in three dimensions, on the surface as it is: at its top, above the membrane and, of a mesh,
 *     where it is the most concave, the most convex, and beside that, but not at a border; with blade and tube, upright and straight, tilted and askew;
 *   - of a model besides, guided along the normal of the top, on the plane that touches it there, while it goes
 *     along the skin.
 *
 * Where it comes to rest, the loop is judged as a linear one, too: by the forces that a small motion meets there, also
 * with a tube that entered beyond the sharpest edge; or it is pushed once, and must come to rest again.
 *
 * A swing goes to and fro: a hand that sinks or creeps does not swing. Where the tool slides away, or sinks where
 * the tissue does not carry the lean, a run decides nothing; a tool that sinks is followed until it rests deeper.
 */
#ifndef INCISE_REST_H
#define INCISE_REST_H

#include "../control/pose_loop.h"
#include "plan.h"

/* To and fro in a quarter of a run that counts as a swing. */
#define INCISE_REST_SWING_MM 0.01

/* Sd per axis of a magnetic tracker near its source, as predict.h assumes. */
#define INCISE_REST_NOISE_MM 0.02

/* Changes to the plan in a search. */
struct incise_rest_trial {
	double gain;	       /* in place of the plan's */
	double damping_N_s_mm; /* of the device */
	int way;	       /* of the search, the only one to try; -1: all */
};

struct incise_rest {
	bool rests;
	int runs;
	int64_t ticks; /* of all runs */
	/* The first run that swings, or the run that took longest to come to rest. */
	struct incise_plan_lean worst;
	double force_N[3]; /* its lean */
	double swing_N;
	int way;	/* of the search */
	int hold_ticks; /* its step, of a host */
	struct incise_plan_weakest weakest;
	/* Range of position and force, of a hand that leans with half of the scene's limit, by
	 * the noise of a tracker: INCISE_REST_NOISE_MM. Results for a plan that rests. */
	double noise_mm, noise_N;
};

/*
 * A haptic device in its loop: a later device fills it in and passes the same check.
 *
 *   mass, damping ──pose, so often, so old──▶ plan ──force, so late, held for a tick──▶ mass
 */
struct incise_device {
	double axis[3][3]; /* principal directions of its mass: unit, at right angles */
	double mass_kg[3]; /* along each, > 0 */
	double damping_N_s_mm; /* viscous, in all directions, ≥ 0 */
	double period_s;       /* of ticks; a force is held so long */
	double pose_s;	       /* from pose to pose … */
	double latency_s;      /* … and how old one is when it comes */
	int late_ticks;	       /* until a force acts … */
	double early_s;	       /* … less this part of the last of them */
	bool touched;	       /* a haptic device: fingers hold it */
	double slew_N_s;       /* the fastest that its force changes; infinite: at once */
	double force_N;	       /* the largest … */
	double continuous_N;   /* … and one that it keeps for ever */
};

/* Take the other margin where it is weaker, and count its states. */
void incise_rest_take_weakest(struct incise_plan_weakest *to,
			      const struct incise_plan_weakest *other);

/*
 * The forces about a state of contact, along three axes, by the plan's own tick in double: as places go along an axis, or
 * against it, as tissue that is cut loads and unloads with other slopes. The plan stays as it is.
 */
void incise_plan_force_map(struct incise_plan *plan, int64_t t_ns,
			   const double axis[3][3], bool against,
			   struct incise_force_map *map);

/*
 * @return 0 or -ENOMEM. Takes 0.2 s. The plan stays as it is; it must be ready to run.
 */
int incise_plan_rest(const struct incise_plan *plan,
		     const struct incise_tracker_info *tracker,
		     const struct incise_rest_trial *trial, struct incise_rest *rest);

#endif
