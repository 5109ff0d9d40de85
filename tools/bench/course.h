/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The same work for several plans of a scene: strokes over its surface (stroke.h), one after
 * the other, with blade, handle and tube in turn, and the poses of them all made before.
 *
 *     \                  \                  \
 *   ───\──────────────────\──────────────────\────────────── surface
 *       ╰◀── blade ──▶     ╰◀── handle ──▶    ╰◀── tube ──▶
 */
#ifndef INCISE_COURSE_H
#define INCISE_COURSE_H

#include <incise/plan.h>

struct course {
	struct incise_tracker_info tracker;
	struct incise_tracker_sample *poses; /* times from 0 on */
	int n_poses, strokes, ticks;
	int64_t period_ns, stroke_ns;
};

/*
 * Strokes over the top of a plan's surface. Plain ones are 1 mm deep; varied ones are up to
 * 30 mm deeper, the scalpel turns about, and at times no poses come. With @inserts the plan
 * has handle and tube; else it is the blade all the time.
 * Fails the program without memory.
 */
void course_begin(struct course *course, const struct incise_scene *scene,
		  const struct incise_plan *plan, int strokes, bool inserts, bool varied);

void course_end(struct course *course);

/* A plan on its way along it. */
struct course_walk {
	const struct course *course;
	struct incise_plan *plan;
	int64_t begin_ns; /* when this time along it began */
	int tick, pose;	  /* the next ones */
};

/* Hand over what has come until the next tick, and say when that is: for incise_plan_tick().
 * At its end the course begins again. */
int64_t course_feed(struct course_walk *walk);

#endif
