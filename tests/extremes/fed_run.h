/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A plan on a ground that is run by fed poses. Each tick is checked: finite, the force and its
 * change within the limits, phase and tool what they can be.
 */
#ifndef INCISE_TEST_FED_RUN_H
#define INCISE_TEST_FED_RUN_H

#include "../../lib/scene/plan.h"
#include "extremes.h"
#include "ground.h"

#define MS INT64_C(1000000)
#define YEAR_NS INT64_C(31557600000000000)

struct fed_run {
	struct extremes_row *row; /* of its checks */
	const struct ground *ground;
	struct incise_plan *plan;
	struct incise_touch top;
	int64_t t_ns;
	struct incise_tick tick; /* the last one */
	bool waved;		 /* it moves in free air: there is no force */
	long contacts;		 /* ticks in contact */
};

void fed_run_begin(struct fed_run *run, struct extremes_row *row,
		   const struct ground *ground, const struct incise_scene *scene,
		   int64_t t_ns);
void fed_run_end(struct fed_run *run);

/* Feed one pose. @return whether the plan took it */
bool fed_run_feed(struct fed_run *run, int64_t t_ns, const double position_mm[3],
		  const double quaternion[4]);

/* One tick, at a time or after one; time ends at INT64_MAX. */
void fed_run_tick(struct fed_run *run, int64_t t_ns);
void fed_run_step(struct fed_run *run, int64_t dt_ns);

/* A place along the normal at the top: below 0 is in the tissue. */
void fed_run_above(const struct fed_run *run, double height_mm, double p[3]);

/* Hold the end of whatever is held somewhere for some ticks, by a good tracker. */
void fed_run_hold(struct fed_run *run, const double end_mm[3], const double attitude[4],
		  int ticks);

/* Move along the normal from one height to another, and stay there. */
void fed_run_move(struct fed_run *run, double from_mm, double to_mm, int ticks, int stay,
		  const double attitude[4]);

#endif
