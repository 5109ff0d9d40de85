/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * What a scene's plan saves against the full pipeline, which is the same scene with every
 * stage kept and those neutral that it does not need (incise_scene_set_full()): time,
 * instructions and memory of both, and whether their forces are the same to the bit.
 */
#ifndef INCISE_SCENE_SAVING_H
#define INCISE_SCENE_SAVING_H

#include <incise/plan.h>
#include "course.h"
#include "harness.h"

/* One of the two. */
struct scene_way {
	struct incise_scene *scene;
	struct incise_plan *plan;
	struct course_walk walk;
	struct harness_time time;		 /* of a tick, ns */
	double instructions;			 /* of a tick; NaN: not counted */
	double p99_ns;				 /* of single ticks */
	double stage_ns[INCISE_PLAN_STAGES_MAX]; /* means of the middle half */
};

struct scene_saving {
	struct scene_way few, full;
	const char *path;
	bool kept;
	struct course course;
	long ticks_compared, ticks_in_contact;
	long first_difference; /* number of the tick; -1: none */
	char failed[520];      /* why there is nothing of it, or "" */
};

/* Read a scene and make both plans. @kept: the full pipeline twice. */
void scene_saving_begin(struct scene_saving *saving, const char *path, bool kept);

/* Run both over a long and varied course, and compare the forces of each tick. */
void scene_saving_compare(struct scene_saving *saving);

/* Times of all of them in turn. */
void scene_savings_time(struct scene_saving *const *savings, int n, bool quick);

/*
 * Instructions of both of all of them.
 *
 * @param why  why there are none
 * @return how: "counter" or "callgrind", or NULL
 */
const char *scene_savings_count(struct scene_saving *const *savings, int n, bool quick,
				const char **why);

/* Run the ticks that are counted, and nothing else, for another program that counts. */
void scene_profile(const char *path, bool full);

void scene_saving_end(struct scene_saving *saving);

#endif
