/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A trajectory: the same work for several plans of a scene.
 *
 * Strokes over its surface (stroke.h), one after the other, with blade, handle and tube in turn,
 * and the poses of them all made before.
 *
 *     \                  \                  \
 *   ───\──────────────────\──────────────────\────────────── surface
 *       ╰◀── blade ──▶     ╰◀── handle ──▶    ╰◀── tube ──▶
 */
#ifndef INCISE_TRAJECTORY_H
#define INCISE_TRAJECTORY_H

#include <incise/plan.h>

struct trajectory {
	struct incise_tracker_info tracker;
	struct incise_tracker_sample *poses; /* times from 0 on */
	int n_poses, strokes, ticks;
	int64_t period_ns, stroke_ns;
};

/*
 * Plain strokes are 1 mm deep; varied ones are up to 30 mm deeper, the scalpel turns about, and at
 * times no poses come. With @inserts the plan has handle and tube; else it is always the blade.
 */
void trajectory_make(struct trajectory *trajectory, const struct incise_scene *scene,
		     const struct incise_plan *plan, int strokes, bool inserts,
		     bool varied);

/* A plan on its way along it. */
struct walk {
	const struct trajectory *trajectory;
	struct incise_plan *plan;
	int64_t begin_ns; /* when this time along it began */
	int tick, pose;	  /* the next ones */
};

/*
 * Feed the poses of up to the next tick. Returns when that is. At its end the trajectory starts
 * again.
 */
int64_t walk_feed(struct walk *walk);

/* Go on along another trajectory, at a later time. */
void walk_change(struct walk *walk, const struct trajectory *trajectory);

/* All its ticks; the context is a struct walk. */
void walk_run(void *walk);

#endif
