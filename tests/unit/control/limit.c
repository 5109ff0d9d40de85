// SPDX-License-Identifier: GPL-2.0-or-later
/* Limits: force, slew, and nothing but numbers. */
#include "../unit.h"
#include <float.h>
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/control/limit.h"

#define FORCE INCISE_LIMIT_FORCE
#define SLEW INCISE_LIMIT_SLEW
#define NOT_FINITE INCISE_LIMIT_NOT_FINITE

/* Forces of up to 2 N, each some roundings of 2e-16 away from the one before. */
#define TOLERANCE_N 1e-14

/* A walk of ticks, each from where the one before ended: 2 N, and 0.7 N a tick. */
TEST(test_walk)
{
	/* The share of a turn from (1.2 0 1.6) to (0 2 0), √8 N away, in one tick. */
	const double k = 0.7 / sqrt(8);
	/* And what is left after a tick towards no force. */
	const double rest = 1 - 0.7 / (2 * hypot(1 - k, k));
	const struct {
		double asked[3], rendered[3];
		unsigned int events;
	} ticks[] = {
		{{0, 0, 0}, {0, 0, 0}, 0},
		{{0.3, 0, 0.4}, {0.3, 0, 0.4}, 0},
		{{3, 0, 4}, {0.72, 0, 0.96}, FORCE | SLEW},
		{{3, 0, 4}, {1.14, 0, 1.52}, FORCE | SLEW},
		{{3, 0, 4}, {1.2, 0, 1.6}, FORCE},
		{{0, 2, 0}, {1.2 * (1 - k), 2 * k, 1.6 * (1 - k)}, SLEW},
		{{0, NAN, 1},
		 {1.2 * (1 - k) * rest, 2 * k * rest, 1.6 * (1 - k) * rest},
		 NOT_FINITE | SLEW},
	};
	struct incise_limit limit = {.force_N = 2, .slew_N = 0.7};

	for (size_t i = 0; i < sizeof(ticks) / sizeof(*ticks); i++) {
		double force[3];

		v3_copy(force, ticks[i].asked);
		assert_int_equal(incise_limit_apply(&limit, force), ticks[i].events);
		for (int c = 0; c < 3; c++) {
			assert_true(fabs(force[c] - ticks[i].rendered[c]) < TOLERANCE_N);
			assert_true(limit.last_N[c] == force[c]);
		}
	}
}

/* One tick each, no slew to speak of: the limit alone, at the ends of what doubles hold. */
TEST(test_size)
{
	static const struct {
		double asked[3], rendered[3];
		unsigned int events;
	} cases[] = {
		{{2, 0, 0}, {2, 0, 0}, 0},
		{{1.2, 0, -1.6}, {1.2, 0, -1.6}, 0},
		{{1.5, 1.5, 1.5},
		 {1.1547005383792515, 1.1547005383792515, 1.1547005383792515},
		 FORCE},
		{{0, -3, 4}, {0, -1.2, 1.6}, FORCE},
		{{3e307, 0, -4e307}, {1.2, 0, -1.6}, FORCE},
		{{DBL_MAX, DBL_MAX, 0}, {M_SQRT2, M_SQRT2, 0}, FORCE},
		{{-DBL_MAX, 1, 1}, {-2, 0, 0}, FORCE},
		{{5e-324, 0, 5e-324}, {0, 0, 0}, 0},
		{{INFINITY, 0, 0}, {0, 0, 0}, NOT_FINITE},
		{{0, -INFINITY, INFINITY}, {0, 0, 0}, NOT_FINITE},
		{{1, 1, NAN}, {0, 0, 0}, NOT_FINITE},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_limit limit = {.force_N = 2, .slew_N = 100};
		double force[3];

		v3_copy(force, cases[i].asked);
		assert_int_equal(incise_limit_apply(&limit, force), cases[i].events);
		for (int c = 0; c < 3; c++)
			assert_true(fabs(force[c] - cases[i].rendered[c]) < TOLERANCE_N);
		/* What no limit holds is not touched. */
		if (!cases[i].events)
			assert_memory_equal(force, cases[i].asked, sizeof(force));
	}
}

/* Settings that make no sense render no force, or none that changes. */
TEST(test_settings)
{
	static const double none[] = {0, -1, NAN, -INFINITY};

	for (int i = 0; i < 4; i++) {
		struct incise_limit limit = {.force_N = none[i], .slew_N = 1};
		double force[3] = {0.1, -0.2, 3};

		assert_int_equal(incise_limit_apply(&limit, force), FORCE);
		assert_true(v3_length(force) == 0);
		limit = (struct incise_limit){.force_N = 2, .slew_N = none[i]};
		limit.last_N[1] = 0.5;
		force[2] = 1;
		assert_int_equal(incise_limit_apply(&limit, force), SLEW);
		assert_true(force[0] == 0 && force[1] == 0.5 && force[2] == 0);
	}
	for (int i = 0; i < 2; i++) {
		struct incise_limit limit = {INFINITY, INFINITY, {0}};
		double force[3] = {DBL_MAX, -DBL_MAX, 3};

		/* No limit is endless: the next change has to be a number too. */
		v3_copy(limit.last_N, (const double[3]){-DBL_MAX, i ? NAN : DBL_MAX, 0});
		incise_limit_apply(&limit, force);
		assert_true(v3_finite(force));
	}
	/* A limit that was made smaller is kept at once. */
	struct incise_limit limit = {.force_N = 1, .slew_N = 0.1, .last_N = {0, 3, 0}};
	double force[3] = {0, 3, 0};

	assert_int_equal(incise_limit_apply(&limit, force), FORCE | SLEW);
	assert_true(fabs(force[1] - 1) < TOLERANCE_N && v3_length(force) <= 1);
}

static double any(uint64_t *seed)
{
	uint64_t bits;
	double value;

	incise_random_step(seed);
	bits = *seed ^ *seed >> 29;
	memcpy(&value, &bits, sizeof(value));
	if (*seed >> 60 == 0)
		return *seed >> 59 & 1 ? NAN : -INFINITY;
	/* All bit patterns, or some newtons. */
	return *seed >> 62 ? (double)(bits & 0xffffff) * 0x1p-21 - 4 : value;
}

/* Never above the limit, not by rounding either, whatever is asked and whatever it is. */
TEST(test_whatever_is_asked)
{
	uint64_t seed = 1;
	int events[8] = {0};

	for (int run = 0; run < 100; run++) {
		struct incise_limit limit = {.force_N = 0.3 + 0.0777 * run,
					     .slew_N = 0.01 + 0.0123 * run};
		double wanted[3];

		for (int i = 0; i < 5000; i++) {
			double force[3], asked[3], last[3], change[3];
			unsigned int event;

			/* Asked for long enough to get there, now and then. */
			for (int c = 0; c < 3 && i % 32 == 0; c++)
				wanted[c] = any(&seed);
			v3_copy(force, wanted);
			v3_copy(asked, force);
			v3_copy(last, limit.last_N);
			event = incise_limit_apply(&limit, force);
			events[event]++;
			assert_true(v3_length(force) <= limit.force_N);
			v3_sub(change, force, last);
			assert_true(v3_length(change) <=
				    limit.slew_N + 8 * DBL_EPSILON * limit.force_N);
			assert_int_equal(!!(event & NOT_FINITE), !v3_finite(asked));
			/* Held by its size alone: the same direction, a unit vector's worth. */
			if (event == FORCE) {
				double scale = fmax(fmax(fabs(asked[0]), fabs(asked[1])),
						    fabs(asked[2]));
				double cross[3];

				for (int c = 0; c < 3; c++)
					asked[c] /= scale;
				v3_cross(cross, asked, force);
				assert_true(v3_length(cross) <
					    8 * DBL_EPSILON * limit.force_N);
				assert_true(v3_dot(asked, force) > 0);
			}
		}
	}
	/* Each alone and together, but FORCE with NOT_FINITE: that asks for 0. */
	for (int i = 0; i < 8; i++)
		assert_true((events[i] > 100) == !(i & FORCE && i & NOT_FINITE));
}

TEST(test_zero_is_at_once)
{
	struct incise_limit limit = {2, 0.1, {0.5, 1.5, -1}};
	double force[3] = {0, 0, 0};

	incise_limit_zero(&limit);
	assert_int_equal(incise_limit_apply(&limit, force), 0);
	assert_true(v3_length(force) == 0);
}
