// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * How well a delay is known: blocks of the run, drawn again and again; see delay.h.
 *
 * A part of one noun: tests/unit/calib/delay.c tests it through its door.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/ascending.h"
#include "delay.h"

#define BLOCK_S 1.0
#define BLOCKS_MIN 7
#define DRAWS 400

/* Standard deviation of `value` n times; few blocks have Student's tails, k = 2 holds them. */
static double spread(const double *value, int n, int blocks)
{
	double mean = 0, sum = 0, freedom = blocks - 2;

	for (int i = 0; i < n; i++)
		mean += value[i] / n;
	for (int i = 0; i < n; i++)
		sum += (value[i] - mean) * (value[i] - mean);
	return sqrt(sum / (n - 1) * blocks / freedom) * (1 + 1.21 / freedom);
}

/* Draw blocks of the run again and again, and solve for each. */
int delay_bootstrap(struct delay *d, const struct delay_tangent *t,
		    struct incise_delay_fit *fit, struct incise_error *err)
{
	int length = (int)(BLOCK_S / DELAY_STEP_S), n = t->n / length, used = 0;
	int at = d->grid.columns;
	struct delay_normal *blocks = malloc((size_t)(n + 1) * sizeof(*blocks));
	double delays[DRAWS], drifts[DRAWS], x[DELAY_UNKNOWNS], wider, plain, ms;
	uint64_t state = 1;

	if (!blocks)
		return incise_error_set(err, ENOMEM, "out of memory");
	for (int b = 0; b < n; b++) {
		delay_tangent_normal(t, b * length, (b + 1) * length, 0, &blocks[used]);
		used += blocks[used].yy > 0;
	}
	fit->blocks = used;
	if (used < BLOCKS_MIN) {
		free(blocks);
		return incise_error_set(err, EDOM,
					"too much of the motion is missing; record "
					"longer");
	}
	for (int draw = 0; draw < DRAWS; draw++) {
		struct delay_normal sum = {.m = t->m}, without;

		for (int b = 0; b < used; b++) {
			state = state * 6364136223846793005u + 1442695040888963407u;
			delay_add_normal(&sum,
					 &blocks[(state >> 33) % (unsigned int)used], 1);
		}
		drifts[draw] = delay_solve(&sum, x) ? x[t->m - 1] : 0;
		without = (struct delay_normal){.m = t->m - 1, .yy = sum.yy};
		for (int i = 0; i < without.m; i++) {
			without.b[i] = sum.b[i];
			for (int j = 0; j <= i; j++)
				without.a[i * without.m + j] = sum.a[i * sum.m + j];
		}
		delays[draw] = delay_solve(&without, x) ? x[at] : 0;
	}
	ms = DELAY_STEP_S * 1e3;
	fit->sd_ms = spread(delays, DRAWS, used) * ms;
	fit->drift_sd_ms = spread(drifts, DRAWS, used) * ms;
	{
		struct delay_normal sum = {.m = t->m};

		for (int b = 0; b < used; b++)
			delay_add_normal(&sum, &blocks[b], 1);
		fit->drift_ms = delay_solve(&sum, x) ? x[t->m - 1] * ms : NAN;
	}
	free(blocks);
	/* the quantiles, as much wider as the standard deviation was made */
	qsort(delays, DRAWS, sizeof(*delays), ascending);
	plain = 0;
	for (int i = 0; i < DRAWS; i++)
		plain += delays[i] * delays[i] / DRAWS;
	wider = plain > 0 ? fit->sd_ms / (sqrt(plain) * ms) : 1;
	fit->low_ms = fit->delay_ms + delays[DRAWS / 40] * wider * ms;
	fit->high_ms = fit->delay_ms + delays[DRAWS - 1 - DRAWS / 40] * wider * ms;
	return 0;
}
