// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Losses found by times alone (lib/rig/pace.h): each source here knows what it left out.
 */
#include "../unit.h"
#include "../../../lib/rig/pace.h"

struct source {
	const char *name;
	double rate_hz;	 /* nominal */
	double true_hz;	 /* of its clock */
	double jitter_T; /* of its times, periods, uniform */
	int chunk;	 /* samples come in chunks of one lateness */
	int hole, missing;
	int found; /* -1: as many as are missing */
	int slack; /* of the number found: scatter, rounded */
};

static double uniform(void)
{
	return (double)rand() / RAND_MAX;
}

TEST(counts_what_is_missing)
{
	static const struct source sources[] = {
		{"exact", 1000, 1000, 0, 1, 0, 0, 0, 0},
		{"one lost", 1000, 1000, 0, 1, 4000, 1, -1, 0},
		{"one lost of a clock that is off", 1000, 1000.1, 0, 1, 4000, 1, -1, 0},
		{"five lost", 100, 100, 0, 1, 800, 5, -1, 0},
		{"slow by 5 %", 1000, 950, 0, 1, 0, 0, 0, 0},
		{"fast by 5 %", 1000, 1050, 0, 1, 0, 0, 0, 0},
		{"jitter of a period", 1000, 1000, 1, 1, 0, 0, 0, 0},
		{"jitter of chunks", 1000, 980, 20, 20, 0, 0, 0, 0},
		/* The least of 25 chunks scatters: within a quarter of the jitter. */
		{"fifty lost in the jitter of chunks", 1000, 1000, 20, 20, 6000, 50, -1,
		 5},
		{"less than the jitter", 1000, 1000, 20, 20, 6000, 5, 0, 0},
		{"a hole of two seconds", 1000, 1000, 1, 1, 6000, 2000, -1, 1},
		{"slow, and five lost", 10, 10, 0, 1, 100, 5, -1, 0},
	};

	for (size_t k = 0; k < sizeof(sources) / sizeof(*sources); k++) {
		const struct source *s = &sources[k];
		int found = 0, expected = s->found < 0 ? s->missing : s->found;
		struct incise_pace pace;
		double late = 0;

		srand(1);
		incise_pace_init(&pace, s->rate_hz);
		for (int i = 0; i < 20 * (int)s->rate_hz; i++) {
			if (i % s->chunk == 0)
				late = s->jitter_T * uniform();
			if (i >= s->hole && i < s->hole + s->missing)
				continue;
			found += (int)incise_pace_add(
				&pace,
				1000000000 + (int64_t)((i + late) * 1e9 / s->true_hz));
		}
		if (abs(found - expected) > s->slack)
			fail_msg("%s: %d found, %d expected", s->name, found, expected);
	}
}

TEST(takes_any_time)
{
	static const int64_t times[] = {0, INT64_MAX, INT64_MIN, -1, 1, INT64_MAX / 2, 0};
	struct incise_pace pace;

	incise_pace_init(&pace, 1000);
	for (int i = 0; i < 7000; i++)
		assert_true(incise_pace_add(&pace, times[i % 7]) <= 1000000000);
	/* A clock that was set back loses nothing. */
	incise_pace_init(&pace, 1000);
	assert_int_equal(incise_pace_add(&pace, INT64_C(5000000000)), 0);
	assert_int_equal(incise_pace_add(&pace, INT64_C(1000000000)), 0);
	assert_int_equal(incise_pace_add(&pace, INT64_C(1001000000)), 0);
	assert_true(isfinite(pace.period_ns));
}
