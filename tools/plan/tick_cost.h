/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The cost of a tick of a plan: a stroke of the scalpel over the top of the surface is fed
 * to a plan without a rig, and every tick in contact is timed; with the blade, and where
 * the scene has insertion with a tube as well. The costlier of the two counts.
 *
 *        ╲                        5 mm above, down in 0.2 s
 *   ──────╲────────────────────── surface
 *          ╲__________________    1 mm deep, ±5 mm to and fro at up to 40 mm/s
 */
#ifndef INCISE_TICK_COST_H
#define INCISE_TICK_COST_H

#include <incise/plan.h>

struct tick_cost {
	int ticks;			      /* timed: those in contact */
	enum incise_tool tool;		      /* the costlier one */
	double median, p99, p999;	      /* ns, the clock's own cost taken off */
	double stage[INCISE_PLAN_STAGES_MAX]; /* means of the middle half, ns, the same */
};

/*
 * Measure over some seconds of the stroke's time, which go by as fast as they can. Where
 * the stroke does not meet the tissue, as over a sheet that is too small, ticks is 0 and all
 * times are NaN. Poses come as of the tracker, or with NULL of one of 120 Hz that is 4.2 ms late.
 *
 * @plan  NULL, or one of this scene without a rig, before its first tick: to check it once more takes time
 */
void tick_cost(const struct incise_scene *scene, struct incise_plan *plan,
	       const struct incise_tracker_info *tracker, double seconds,
	       struct tick_cost *cost);

/* The stroke by parts, for times that take turns with others. Fails the program. */
struct tick_stroke *tick_stroke_new(const struct incise_scene *scene,
				    struct incise_plan *plan,
				    const struct incise_tracker_info *tracker,
				    enum incise_tool tool);

/* Mean of the middle half of so many ticks more, ns, times in @ns, an array of @ticks; NaN without contact. */
double tick_stroke_ns(struct tick_stroke *timed, int ticks, double *ns);
void tick_stroke_free(struct tick_stroke *timed);

#endif
