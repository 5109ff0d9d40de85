// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The virtual actuator on the bench; see bench.h.
 */
#include <math.h>
#include "bench.h"

/* The loss is there in full after so much of the way: a Jenkins element of that stiffness. */
#define LOSS_MM 0.1

/* What follows @x with a play of @width about it. */
static double play(double now, double x, double width)
{
	return fmax(x - width / 2, fmin(x + width / 2, now));
}

void incise_bench_follow(struct incise_bench *bench,
			 const struct incise_sim_config *config, double nut_mm,
			 double mm_s)
{
	const double friction_N = config->handle_friction_N;
	double moved = nut_mm - bench->nut_mm, before = bench->behind_mm, spring_N, apart;
	int way;

	bench->nut_mm = nut_mm;
	if (config->stall_mm_s > 0 && fabs(mm_s) > config->stall_mm_s)
		bench->lost_mm += moved;
	bench->behind_mm = play(before, nut_mm - bench->lost_mm, config->backlash_mm);
	bench->loss_N += config->hysteresis_N / LOSS_MM * (bench->behind_mm - before);
	bench->loss_N = fmax(-config->hysteresis_N / 2,
			     fmin(config->hysteresis_N / 2, bench->loss_N));
	spring_N = config->spring_N_mm * bench->behind_mm + bench->loss_N;

	/* The handle gives on what its friction does not hold. */
	apart = spring_N - bench->force_N;
	way = (apart > 0) - (apart < 0);
	if (bench->sliding && way == -bench->sliding)
		bench->sliding = 0;
	if (!bench->sliding && fabs(apart) > friction_N + config->stiction_N)
		bench->sliding = way;
	if (bench->sliding && fabs(apart) > friction_N)
		bench->force_N = spring_N - way * friction_N;
}
