// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/signal/timeline.c: the envelope against a search through all lines, and
 * against theory.
 */
#include "../unit.h"
#include <float.h>
#include "../../../lib/signal/timeline.h"
#include "../record/stream.h"

#define PERIOD_NS 1e6
/* The first blocks are of 0.5 s / 2^8. */
#define FIRST_BLOCK_NS 1953125

static double exponential(struct stream *random, double mean)
{
	return -mean * log(1 - stream_random(random));
}

/* Height at x of the highest line through two blocks that no block is below. */
static double highest(const struct incise_envelope *env, double x_ns)
{
	double best_ns = -DBL_MAX;

	for (int i = 0; i < env->count; i++) {
		for (int j = i + 1; j < env->count; j++) {
			const struct incise_envelope_block *a = &env->blocks[i];
			const struct incise_envelope_block *b = &env->blocks[j];
			double slope = (b->y_ns - a->y_ns) / (b->x_ns - a->x_ns);
			bool below = false;

			for (int k = 0; k < env->count; k++) {
				const struct incise_envelope_block *c = &env->blocks[k];

				below |= c->y_ns <
					 a->y_ns + slope * (c->x_ns - a->x_ns) - 1e-6;
			}
			if (!below)
				best_ns =
					fmax(best_ns, a->y_ns + slope * (x_ns - a->x_ns));
		}
	}
	return best_ns;
}

TEST(highest_of_all_lines)
{
	for (int seed = 0; seed < 30; seed++) {
		struct stream random = {.random = (uint64_t)seed};
		double slope = 4e-4 * stream_random(&random) - 2e-4;
		struct incise_envelope env;
		int lines = 0;

		incise_envelope_init(&env, PERIOD_NS, 0);
		for (int i = 0; i < 3000 + 100 * seed; i++) {
			double x_ns = i * PERIOD_NS;
			double y_ns = slope * x_ns + exponential(&random, 1000);

			if (!incise_envelope_add(&env, x_ns, y_ns) || ++lines % 10)
				continue;
			/* nor is it when the new arrival has pulled it down since */
			if (env.count < 32 ||
			    y_ns - incise_envelope_at(&env, x_ns) < 1e-3)
				continue;
			/* the slope leans to 0 by the square of a few ppm over 300 at first,
			 * over 20 later: tens of ns at first */
			assert_true(fabs(env.y_ns - highest(&env, env.x_ns)) < 30);
		}
		assert_true(lines > 100);
		/* 64 blocks, each the lowest of 32 or more: some ns over some s */
		assert_true(fabs(env.slope - slope) < 1e-6);
		for (int i = 0; i < env.count; i++)
			assert_true(env.blocks[i].y_ns >=
				    incise_envelope_at(&env, env.blocks[i].x_ns) - 1e-3);
	}
}

/* Below 64 exponential excesses the line is too high by 2/64 of their mean, on average. */
TEST(gap_is_known)
{
	const int seeds = 400;
	double before = 0, after = 0, covered = 0;

	for (int seed = 0; seed < seeds; seed++) {
		struct stream random = {.random = (uint64_t)seed + 7000};
		struct incise_envelope env;
		double error_ns;

		incise_envelope_init(&env, PERIOD_NS, 0);
		for (int i = 0; i <= 64; i++)
			incise_envelope_add(&env, i * (double)FIRST_BLOCK_NS,
					    i < 64 ? exponential(&random, 6400) : 1e6);
		assert_int_equal(env.count, 64);
		before += env.y_ns / seeds;
		error_ns = env.y_ns - env.gap_ns;
		after += error_ns / seeds;
		covered += fabs(error_ns) <= 2 * env.gap_sd_ns;
	}
	/* 200 ns with a deviation of √2 · 100 over 400: 3 of those are 21 */
	assert_true(fabs(before - 200) < 25);
	/* a shape learnt from as few as 64 is too high rather than too low: the line comes
	 * out as far below the truth as it was above, at most */
	assert_true(fabs(after) < 150);
	assert_true(covered / seeds >= 0.95);
}

/* Blocks double up to 0.5 s; then the oldest go. */
TEST(blocks_are_bounded)
{
	struct incise_envelope env;
	bool was_full = false;

	incise_envelope_init(&env, PERIOD_NS, 0);
	for (int i = 0; i < 100000; i++) {
		incise_envelope_add(&env, i * PERIOD_NS, i % 10);
		assert_in_range(env.count, 0, INCISE_ENVELOPE_BLOCKS);
		assert_true(env.block_ns <= INCISE_ENVELOPE_BLOCK_MAX_NS);
		assert_true(!was_full || incise_envelope_full(&env));
		was_full = incise_envelope_full(&env);
	}
	assert_true(was_full);
	assert_true(env.blocks[0].x_ns > 100000 * PERIOD_NS - 65 * env.block_ns - 1);
	/* a hole as long as all of it */
	incise_envelope_add(&env, 1e6 * PERIOD_NS, 3);
	incise_envelope_add(&env, 2e6 * PERIOD_NS, 3);
	assert_int_equal(env.count, 1);
	assert_true(isfinite(incise_envelope_at(&env, 2e6 * PERIOD_NS)));
}

/* 1000 Hz on frames of 1 ms: a device with the host's own rate may be 1 ms off, unseen. */
TEST(grid_is_doubted)
{
	static const struct {
		double grain_ns, slope, least_ns, most_ns;
	} cases[] = {
		{0, 0, 0, 30e3},		  /* no grid: only the bend of a clock */
		{PERIOD_NS, 0, 280e3, 330e3},	  /* 1 ms / √12 */
		{PERIOD_NS, 50e-6, 280e3, 330e3}, /* less than 2: not enough */
		{PERIOD_NS, 200e-6, 0, 30e3},	  /* 6 bottoms */
		{PERIOD_NS / 8, 0, 35e3, 45e3},	  /* 0.125 ms / √12, and the bend */
		{PERIOD_NS / 64, 0, 0, 30e3},	  /* does not matter */
	};

	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++) {
		struct incise_envelope env;

		incise_envelope_init(&env, PERIOD_NS, cases[c].grain_ns);
		for (int i = 0; i < 40000; i++)
			incise_envelope_add(&env, i * PERIOD_NS,
					    cases[c].slope * i * PERIOD_NS);
		assert_true(env.gap_sd_ns >= cases[c].least_ns);
		assert_true(env.gap_sd_ns <= cases[c].most_ns);
	}
}
