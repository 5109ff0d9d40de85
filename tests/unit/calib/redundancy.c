// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/calib/redundancy.c: made pairs of depths, alike, shifted, bent and scaled. */
#include "../unit.h"
#include <incise/redundancy.h>
#include "../../../lib/base/random.h"

#define PAIRS 1000

enum { PLAIN, SHIFTED, BENT, SCALED, WILD, CASES };

/* 20 s of cuts along a slanted way of 100 mm, at 5 and 15 mm of depth; noise as of a rig. */
static void make(struct incise_depth_pair *pairs, int how, uint64_t seed)
{
	uint64_t key = incise_random_key(seed, 9);

	for (int i = 0; i < PAIRS; i++) {
		double along = 25.0 * (i % 200) / 50, t = i / 50.0;
		struct incise_depth_pair *p = &pairs[i];

		p->t_ns = (int64_t)(t * 1e9);
		p->tracker_mm = (i / 200) % 2 ? 15 : 5;
		p->camera_mm = p->tracker_mm + 0.02 * incise_random_normal(key, i);
		p->place_mm[0] = 7 + 0.6 * along;
		p->place_mm[1] = -3 - 0.8 * along;
		p->rate_mm_s = i % 200 < 5 ? 100 : 0;
		if (p->rate_mm_s > 20)
			p->camera_mm += 3; /* must not count */
		if (how == SHIFTED)
			p->camera_mm -= 0.8;
		if (how == BENT)
			p->camera_mm += 1.5 * exp(-pow((along - 80) / 20, 2));
		if (how == SCALED)
			p->camera_mm *= 1.05;
		if (how == WILD && i % 10 == 0)
			p->camera_mm += 5; /* vision took something else */
	}
}

TEST(what_differs_is_named)
{
	static struct incise_depth_pair pairs[PAIRS];

	for (int how = 0; how < CASES; how++)
		for (int seed = 1; seed <= 5; seed++) {
			struct incise_redundancy r;

			make(pairs, how, seed);
			assert_int_equal(incise_redundancy(pairs, PAIRS, &r, NULL), 0);
			assert_int_equal(r.n, 195 * 5);
			assert_int_equal(r.place_bad, how == BENT);
			assert_int_equal(r.trend_bad, how == SCALED);
			if (how == PLAIN || how == SHIFTED || how == WILD) {
				/* sd of a median of 975: 0.0008 mm; of 10 % wild: 0.003 */
				assert_float_equal(r.bias_mm, how == SHIFTED ? -0.8 : 0,
						   0.006);
				assert_int_equal(r.bias_bad, how == SHIFTED);
				assert_float_equal(r.scatter_sd_mm, 0.02, 0.004);
			}
			if (how == BENT)
				assert_true(r.place_mm > 0.8 && r.place_mm < 1.5);
			if (how == SCALED)
				/* 0.02 mm over 10 mm and 195 pairs and more: 0.0002 */
				assert_float_equal(r.trend, 0.05, 0.001);
			assert_float_equal(r.travel_mm, 97, 0.1);
		}
}

TEST(too_little_is_refused)
{
	static struct incise_depth_pair pairs[PAIRS];
	struct incise_redundancy r;

	make(pairs, PLAIN, 1);
	assert_error(incise_redundancy(pairs, 34, &r, &err), ENODATA, &err, "29 frames");
	assert_int_equal(incise_redundancy(pairs, 150, &r, &err), -ENODATA);
	assert_int_equal(incise_redundancy(NULL, 0, &r, &err), -ENODATA);
	pairs[10].camera_mm = NAN;
	assert_int_equal(incise_redundancy(pairs, PAIRS, &r, &err), -EINVAL);
	make(pairs, PLAIN, 1);
	pairs[10].t_ns = 0;
	assert_int_equal(incise_redundancy(pairs, PAIRS, &r, &err), -EINVAL);
}

/* One place and one depth: nothing is said of trend, and no place differs. */
TEST(no_travel_is_no_fault)
{
	static struct incise_depth_pair pairs[PAIRS];
	struct incise_redundancy r;

	make(pairs, PLAIN, 1);
	for (int i = 0; i < PAIRS; i++) {
		pairs[i].place_mm[0] = pairs[i].place_mm[1] = 1;
		pairs[i].camera_mm += 10 - pairs[i].tracker_mm;
		pairs[i].tracker_mm = 10;
	}
	assert_int_equal(incise_redundancy(pairs, PAIRS, &r, NULL), 0);
	assert_true(isnan(r.trend) && !r.trend_bad && !r.place_bad && !r.bias_bad);
	assert_true(r.place_mm == 0 && r.travel_mm == 0);
}
