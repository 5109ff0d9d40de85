// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/publish/interpolators.c: where a blade advances, on motions that are known,
 * and what noise makes of it.
 */
#include "../unit.h"
#include <incise/clock.h>
#include "../../../lib/base/random.h"
#include "../../../lib/publish/interpolators.h"

#define HZ 120
#define PIECES 6

/* A straight piece of way at one speed, mm/s, and whether the blade advances on it. */
struct piece {
	double seconds, down_mm_s, along_mm_s, across_mm_s;
	bool advances;
};

struct motion {
	const char *name;
	struct piece pieces[PIECES];
};

static const struct motion motions[] = {
	{"in, out, in again up to the front, and on",
	 {{1, 10, 0, 0, true},
	  {0.8, -10, 0, 0, false},
	  {0.8, 10, 0, 0, false},
	  {0.5, 10, 0, 0, true}}},
	{"along the skin, and back in its own cut",
	 {{1, 10, 0, 0, true},
	  {1, 0, 20, 0, true},
	  {0.9, 0, -20, 0, false},
	  {0.9, 0, 20, 0, false},
	  {1, 0, 20, 0, true}}},
	{"beyond the other end of the cut",
	 {{1, 10, 0, 0, true},
	  {1, 0, 20, 0, true},
	  {1, 0, -20, 0, false},
	  {0.5, 0, -20, 0, true}}},
	{"beside the cut tissue is new",
	 {{1, 10, 0, 0, true},
	  {1, 0, 20, 0, true},
	  {1, 0, -20, 0, false},
	  {0.1, 0, 0, 20, false},
	  {1, 0, 0, 20, true}}},
	{"it rests", {{1, 10, 0, 0, true}, {1, 0, 0, 0, false}}},
	{"less deep, but faster along the skin",
	 {{1, 10, 0, 0, true}, {0.8, -5, 20, 0, true}}},
	{"out on a slant: below 0.4 of the depth nothing is sure",
	 {{1, 10, 0, 0, true}, {1.1, -5, 20, 0, true}, {0.6, -5, 20, 0, false}}},
	{"another cut, at the same place",
	 {{1, 10, 0, 0, true},
	  {1.2, -10, 0, 0, false},
	  {0.2, 10, 0, 0, false},
	  {1, 10, 0, 0, true}}},
};

/* The surface lies aslant, so that nothing depends on the axes. */
static const double normal[3] = {0.6, 0, 0.8}, along[3] = {0.8, 0, -0.6},
		    across[3] = {0, 1, 0};

/* A motion under way through the smoother; what is known of each record. */
struct run {
	struct incise_smooth smooth;
	struct incise_cut_progress progress;
	struct {
		bool known, advances;
	} truth[HZ * 10];
	int taken, all, bad;
};

static void judge(struct run *run)
{
	const struct incise_smooth_record *done;

	for (; (done = incise_smooth_take(&run->smooth)); run->taken++) {
		bool advances = incise_cut_progress_add(&run->progress, done,
							run->smooth.noise_1_s);

		if (!run->truth[run->taken].known)
			continue;
		run->all++;
		run->bad += advances != run->truth[run->taken].advances;
	}
}

/*
 * Run a motion with so much noise, from the skin on; count the records on pieces that say
 * otherwise, but for those near the ends of a piece.
 */
static int wrong(const struct motion *motion, double noise_mm, uint64_t key, int *all)
{
	struct run run = {.progress = {.normal = {0.6, 0, 0.8}}};
	double down = 0, at = 0, aside = 0;
	int n = 0;

	assert_int_equal(incise_smooth_init(&run.smooth, HZ), 0);
	for (int piece = 0; piece < PIECES; piece++) {
		const struct piece *p = &motion->pieces[piece];
		int records = (int)lround(p->seconds * HZ);

		for (int k = 0; k < records; k++, n++) {
			struct incise_smooth_record record = {
				.seq = n, .t_ns = (int64_t)n * INCISE_NS_PER_S / HZ};
			double off[3];

			down += p->down_mm_s / HZ;
			at += p->along_mm_s / HZ;
			aside += p->across_mm_s / HZ;
			for (int j = 0; j < 3; j++)
				off[j] = noise_mm *
					 incise_random_normal(key, 3 * (uint64_t)n +
									   (uint64_t)j);
			record.depth_mm = down - off[0];
			for (int j = 0; j < 3; j++)
				record.position_mm[j] = (off[0] - down) * normal[j] +
							(at + off[1]) * along[j] +
							(aside + off[2]) * across[j];
			/* The smoother rounds corners by some records. */
			run.truth[n].known = down > 0.3 && k >= 12 && k < records - 12;
			run.truth[n].advances = p->advances;
			incise_smooth_push(&run.smooth, &record);
			judge(&run);
		}
	}
	incise_smooth_end(&run.smooth);
	judge(&run);
	assert_int_equal(run.taken, n);
	incise_smooth_free(&run.smooth);
	*all += run.all;
	return run.bad;
}

/*
 * Both conditions are at 95 %: of the records on each motion one in twenty is wrong at most, with
 * much noise or little.
 */
TEST(test_motions)
{
	static const double noises_mm[] = {0.002, 0.02, 0.05};

	for (size_t i = 0; i < sizeof(motions) / sizeof(*motions); i++)
		for (size_t k = 0; k < sizeof(noises_mm) / sizeof(*noises_mm); k++) {
			int all = 0, bad = 0;

			for (uint64_t seed = 0; seed < 20; seed++)
				bad += wrong(&motions[i], noises_mm[k],
					     incise_random_key(seed, 100 + i), &all);
			if (bad > all / 20 || all < 2000)
				fail_msg("%s, noise of %g mm: %d of %d", motions[i].name,
					 noises_mm[k], bad, all);
		}
}

/* The velocity's noise is what is said of it. */
TEST(test_velocity_noise)
{
	static const double rates[] = {60, 120, 240};
	const double noise_mm = 0.02;
	const uint64_t key = incise_random_key(1, 99);

	for (size_t k = 0; k < sizeof(rates) / sizeof(*rates); k++) {
		const struct incise_smooth_record *done;
		struct incise_smooth smooth;
		const int n = 20000;
		double sum = 0;
		int i = 0;

		assert_int_equal(incise_smooth_init(&smooth, rates[k]), 0);
		for (int r = 0; r <= n; r++) {
			struct incise_smooth_record record = {
				.seq = r, .t_ns = llround(r * 1e9 / rates[k])};

			record.position_mm[0] =
				noise_mm * incise_random_normal(key, (uint64_t)r);
			if (r < n)
				incise_smooth_push(&smooth, &record);
			else
				incise_smooth_end(&smooth);
			for (; (done = incise_smooth_take(&smooth)); i++)
				if (i > 100 && i < n - 100)
					sum += done->velocity_mm_s[0] *
					       done->velocity_mm_s[0] / (n - 201);
		}
		/* Neighbours are alike: some thousand independent ones, 5 sd are 10 %. */
		if (!(fabs(sqrt(sum) / (smooth.noise_1_s * noise_mm) - 1) < 0.1))
			fail_msg("%g Hz: %g, said %g", rates[k], sqrt(sum),
				 smooth.noise_1_s * noise_mm);
		incise_smooth_free(&smooth);
	}
}

TEST(test_unknown)
{
	struct incise_cut_progress progress = {.normal = {0, 0, 1}};
	struct incise_smooth_record record = {.depth_mm = 1,
					      .velocity_mm_s = {NAN, NAN, NAN},
					      .noise_mm = NAN,
					      .depth_noise_mm = NAN};

	assert_false(incise_cut_progress_add(&progress, &record, 100));
	record.depth_mm = 2;
	assert_false(incise_cut_progress_add(&progress, &record, 100));
	/* No noise is known: it counts as none. */
	record.velocity_mm_s[0] = record.velocity_mm_s[1] = 0;
	record.velocity_mm_s[2] = -1;
	record.depth_mm = 3;
	assert_true(incise_cut_progress_add(&progress, &record, 100));
	record.depth_mm = NAN;
	assert_false(incise_cut_progress_add(&progress, &record, 100));
}
