// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Stages of a tick in double and in integers: the averaged normal against the sum made again each tick;
 * start and fade: nothing before a small force, ramps of the right length; limits of force and slew. No
 * harm from any force or time.
 */
#include "../unit.h"
#include <float.h>
#include <incise/clock.h>
#include <incise/tick_flags.h>
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "stage_kinds.h"

#define CASES(array) (sizeof(array) / sizeof(*(array)))

/* --- normal --- */

/* A root, a square, a quotient: an ulp or two; in Q30 as many. */
static double unit_error(void)
{
	return kind->is_double ? 4 * DBL_EPSILON : 0x1p-28;
}

static void assert_near(const double got[3], const double want[3], double most)
{
	for (int c = 0; c < 3; c++)
		if (!(fabs(got[c] - want[c]) <= most))
			fail_msg("%.17g %.17g %.17g is not %.17g %.17g %.17g", got[0],
				 got[1], got[2], want[0], want[1], want[2]);
}

static void unit_at_random(uint64_t n, double normal[3])
{
	double v[3];

	for (int c = 0; c < 3; c++)
		v[c] = incise_random_normal(1, 3 * n + c);
	v[2] += 1;
	assert_true(v3_unit(normal, v, 0));
}

TEST_KINDS(test_normal_is_of_the_sum)
{
	static const int ns[] = {2, 3, 10, 63, 64};

	for (size_t k = 0; k < CASES(ns); k++) {
		int n = ns[k], ticks = n == 10 ? 100000 : 1000;

		kind->set_average(n);
		for (int i = 0; i < ticks; i++) {
			double normal[3], averaged[3], sum[3] = {0}, wanted[3];

			for (int j = i < n ? 0 : i - n + 1; j <= i; j++) {
				unit_at_random(j, normal);
				v3_add(sum, sum, 1, normal);
			}
			kind->average(normal, averaged);
			v3_unit(wanted, sum, 0);
			/*
			 * No sum is above 64: each of the 3 · 64 additions since the
			 * last turn rounds by 7e-15 at most, which a short sum makes
			 * much of. In Q30 each normal is 1/2 LSB off.
			 */
			assert_near(averaged, wanted,
				    unit_error() +
					    (kind->is_double ? 2e-12 : n * 0x1p-30) /
						    v3_length(sum));
			assert_true(fabs(v3_length(averaged) - 1) < unit_error());
		}
	}
}

/* Rounding does not pile up: after a turn of equal normals nothing old is left, to the bit. */
TEST_KINDS(test_rounding_of_normals_is_forgotten)
{
	static const double up[3] = {0, 0, 1};
	double averaged[3];

	kind->set_average(7);
	for (int i = 0; i < 1000003; i++) {
		double normal[3] = {sin(i), cos(i), 0};

		kind->average(normal, averaged);
	}
	/* Two turns: one may have begun before. */
	for (int i = 0; i < 14; i++)
		kind->average(up, averaged);
	assert_memory_equal(averaged, up, sizeof(up));
}

TEST_KINDS(test_one_normal_is_itself)
{
	kind->set_average(1);
	for (int i = 0; i < 1000; i++) {
		double normal[3], averaged[3];

		unit_at_random(i, normal);
		kind->average(normal, averaged);
		assert_near(averaged, normal, kind->is_double ? 0 : 0x1p-31);
	}
}

TEST_KINDS(test_opposed_normals)
{
	double averaged[3], first[3], back[3];

	/* Of two that cancel none is left: the last average stays, tick after tick. */
	kind->set_average(2);
	unit_at_random(5, first);
	for (int c = 0; c < 3; c++)
		back[c] = -first[c];
	for (int i = 0; i < 100; i++) {
		kind->average(i % 2 ? back : first, averaged);
		assert_near(averaged, first, unit_error());
	}
	/* Three at 120° cancel but for rounding, which is no direction. */
	kind->set_average(3);
	for (int i = 0; i < 100; i++) {
		double angle = 2 * M_PI * i / 3;
		double normal[3] = {0, sin(angle), cos(angle)};
		const double between[3] = {0, sin(M_PI / 3), cos(M_PI / 3)};

		kind->average(normal, averaged);
		/* The sum of the first two points between them, at 60°; then it stays. */
		if (i > 0)
			assert_near(averaged, between, 1e-12 + unit_error());
	}
}

/* What is no normal makes no number that is none, and is forgotten after two turns. */
TEST_KINDS(test_what_is_no_normal)
{
	static const double none[][3] = {
		{0, 0, 0},	  {NAN, 0, 1},		{INFINITY, 0, 0},
		{1e-300, 0, 0},	  {1e308, 1e308, 0},	{-INFINITY, INFINITY, NAN},
		{0.1, 0.2, -0.3}, {DBL_MAX, 0, 5e-324}, {3, 0, 0},
	};
	static const double up[3] = {0, 0, 1}, across[3] = {1, 0, 0};
	const double between[3] = {M_SQRT1_2, 0, M_SQRT1_2};
	double averaged[3];

	kind->set_average(4);
	for (int round = 0; round < 2; round++) {
		for (size_t i = 0; i < CASES(none); i++) {
			kind->average(none[i], averaged);
			assert_true(v3_length(averaged) == 0 ||
				    fabs(v3_length(averaged) - 1) < unit_error());
		}
		for (int i = 0; i < 8; i++)
			kind->average(i % 2 ? up : across, averaged);
		assert_near(averaged, between, unit_error());
	}
}

/* A new contact begins with its own normal; one that goes on does not. */
TEST_KINDS(test_contact_forgets_normals)
{
	static const double up[3] = {0, 0, 1}, across[3] = {1, 0, 0};
	double averaged[3];

	kind->set_average(16);
	kind->touch(1, averaged);
	assert_true(v3_length(averaged) == 0);
	for (int round = 0; round < 2; round++) {
		kind->touch(-1, averaged);
		assert_near(averaged, up, 0);
		for (int i = 0; i < 50; i++)
			kind->average(across, averaged);
		kind->touch(-1, averaged);
		assert_true(averaged[0] > 0.99);
		kind->touch(1, averaged);
	}
}

/* --- start --- */

#define MS INT64_C(1000000)

/* Ticks in a row: what each lot of @ticks with the same input ends in. */
TEST_KINDS(test_course)
{
	static const struct {
		int ticks;
		double wanted_N;
		enum poses poses;
		double gain;
		bool released;
	} lots[] = {
		{1000, 3, FRESH, 0, false},    /* waits in the tissue */
		{1000, -0.2, FRESH, 0, false}, /* either sign */
		{1000, NAN, FRESH, 0, false},  /* not small */
		{1000, 0, STALE, 0, false},    /* small, but of an old pose … */
		{1000, 0, FADING, 0, false},   /* … or not wanted … */
		{1000, 0, CHANGING, 0, false}, /* … or of the wrong tool */
		{1, 0.1, FRESH, 0.002, true},  /* let go in the very tick */
		{249, 3, FRESH, 0.5, true},    /* whatever is wanted from here on */
		{249, 3, FRESH, 0.998, true},  {1, 3, FRESH, 1, true}, /* 0.5 s in all */
		{5000, 3, FRESH, 1, true},     {25, 3, STALE, 0.5, true}, /* poses stop */
		{25, 3, FRESH, 0.55, true}, /* and are back: from where it was */
		{27, 3, STALE, 0.01, true},    {100, 3, FADING, 0, true},
		{250, 3, FRESH, 0.5, true}, /* without waiting for a small force */
		{5, 3, CHANGING, 0.4, true},   {300, NAN, FRESH, 1, true},
	};
	int64_t t_ns = 1;

	kind->set_start(500 * MS, 50 * MS, false, 1);
	for (size_t i = 0; i < CASES(lots); i++) {
		double gain = -1, command_N, wanted_N = lots[i].wanted_N;
		bool released = false;

		for (int k = 0; k < lots[i].ticks; k++)
			gain = kind->start(wanted_N, lots[i].poses, t_ns += MS, &released,
					   &command_N);
		/* Some thousand additions of numbers up to 1; of Q30, less 1 LSB each. */
		assert_true(fabs(gain - lots[i].gain) < (kind->is_double ? 1e-12 : 1e-6));
		if (!isnan(wanted_N))
			assert_true(fabs(command_N - gain * wanted_N) <=
				    1e-15 + 2 * kind->bit);
		assert_int_equal(released, lots[i].released);
	}
}

/* One tick from half way, with times and settings that make little sense. */
TEST_KINDS(test_times)
{
	static const struct {
		int64_t ramp_ns, fade_ns, last_ns, t_ns;
		double risen, faded;
	} cases[] = {
		{500 * MS, 50 * MS, 1, 1 + MS, 0.502, 0.48},
		{500 * MS, 50 * MS, 1, 1, 0.5, 0.5},
		{500 * MS, 50 * MS, MS, MS - 1, 0.5, 0.5},
		{500 * MS, 50 * MS, INT64_MAX, INT64_MIN, 0.5, 0.5},
		/* Before the first tick there is no time. */
		{500 * MS, 50 * MS, 0, MS, 0.5, 0.5},
		{500 * MS, 50 * MS, -MS, 49900000 - MS, 0.5998, 0},
		{500 * MS, 50 * MS, 1, 3600000 * MS, 0.6, 0},
		{500 * MS, 50 * MS, INT64_MIN, INT64_MAX, 0.6, 0},
		{INT32_MAX, INT32_MAX, 1, 1 + MS, 0.5 + 1e6 / INT32_MAX,
		 0.5 - 1e6 / INT32_MAX},
		{INT32_MAX, INT32_MAX, INT64_MIN, INT64_MAX, 0.6, 0},
		{0, 0, 1, 2, 0.6, 0},
	};

	for (size_t i = 0; i < CASES(cases); i++) {
		for (int poses = FRESH; poses <= CHANGING; poses++) {
			double want = poses == FRESH ? cases[i].risen : cases[i].faded;
			double command_N, gain;
			bool released;

			kind->set_start(cases[i].ramp_ns, cases[i].fade_ns, true,
					cases[i].last_ns);
			gain = kind->start(9, (enum poses)poses, cases[i].t_ns, &released,
					   &command_N);
			assert_true(fabs(gain - want) <
				    (kind->is_double ? 1e-12 : 0x1p-29));
		}
	}
}

/* Any force at any time: the gain is from 0 to 1, rises by no more than a tenth, and waits once. */
TEST_KINDS(test_start_at_any_time)
{
	uint64_t seed = 1;
	double last = 0;
	bool started = false;

	kind->set_start(500 * MS, 50 * MS, false, 0);
	for (int i = 0; i < 100000; i++) {
		double wanted_N, gain, command_N;
		bool released;
		int64_t t_ns;

		incise_random_step(&seed);
		memcpy(&wanted_N, &seed, sizeof(seed));
		incise_random_step(&seed);
		t_ns = (int64_t)seed;
		incise_random_step(&seed);
		/* No small force at first. */
		if (i < 100)
			wanted_N = 1;
		gain = kind->start(wanted_N, (enum poses)(seed >> 62), t_ns, &released,
				   &command_N);
		assert_true(gain >= 0 && gain <= 1);
		assert_true(gain <= last + 0.1 + 1e-15);
		assert_true(released ? i >= 100 : gain == 0 && !started);
		if (isfinite(wanted_N))
			assert_true(fabs(command_N) <= fabs(kind->number(wanted_N)));
		started = released;
		last = gain;
	}
	assert_true(started);
}

/* --- limit --- */

#define FORCE INCISE_TICK_CLAMPED
#define SLEW INCISE_TICK_SLEWED
#define NOT_FINITE INCISE_TICK_NOT_FINITE

/* Forces of up to 2 N, each some roundings of 2e-16 or 2^-17 away from the one before. */
static double limit_error(void)
{
	return 1e-14 + 3 * kind->bit;
}

/* Whether a kind has such numbers. */
static bool has(const double force_N[3])
{
	for (int c = 0; c < 3; c++)
		if (!kind->is_double && !(fabs(force_N[c]) < 32768))
			return false;
	return true;
}

/* A walk of ticks, each from where the one before ended: 2 N, and 0.7 N a tick. */
TEST_KINDS(test_walk)
{
	/* The share of a turn from (1.2 0 1.6) to (0 2 0), √8 N away, in one tick. */
	const double k = 0.7 / sqrt(8);
	/* And what is left after a tick towards no force. */
	const double rest = 1 - 0.7 / (2 * hypot(1 - k, k));
	const struct {
		double asked[3], rendered[3];
		unsigned int flags;
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

	kind->set_limit(2, 0.7, (double[]){0, 0, 0});
	for (size_t i = 0; i < CASES(ticks); i++) {
		double force[3];

		if (!has(ticks[i].asked))
			continue;
		v3_copy(force, ticks[i].asked);
		assert_int_equal(kind->limit(force), ticks[i].flags);
		assert_near(force, ticks[i].rendered, limit_error());
	}
}

/* One tick each, no slew to speak of: the limit alone, at the ends of what numbers hold. */
TEST_KINDS(test_size)
{
	static const struct {
		double asked[3], rendered[3];
		unsigned int flags;
	} cases[] = {
		{{2, 0, 0}, {2, 0, 0}, 0},
		{{1.2, 0, -1.59999}, {1.2, 0, -1.59999}, 0},
		{{1.5, 1.5, 1.5},
		 {1.1547005383792515, 1.1547005383792515, 1.1547005383792515},
		 FORCE},
		{{0, -3, 4}, {0, -1.2, 1.6}, FORCE},
		{{24000, 0, -32000}, {1.2, 0, -1.6}, FORCE},
		{{32767.999, 32767.999, 0}, {M_SQRT2, M_SQRT2, 0}, FORCE},
		{{3e307, 0, -4e307}, {1.2, 0, -1.6}, FORCE},
		{{DBL_MAX, DBL_MAX, 0}, {M_SQRT2, M_SQRT2, 0}, FORCE},
		{{-DBL_MAX, 1, 1}, {-2, 0, 0}, FORCE},
		{{5e-324, 0, 5e-324}, {0, 0, 0}, 0},
		{{INFINITY, 0, 0}, {0, 0, 0}, NOT_FINITE},
		{{0, -INFINITY, INFINITY}, {0, 0, 0}, NOT_FINITE},
		{{1, 1, NAN}, {0, 0, 0}, NOT_FINITE},
	};

	for (size_t i = 0; i < CASES(cases); i++) {
		double force[3];

		if (!has(cases[i].asked))
			continue;
		kind->set_limit(2, 100, (double[]){0, 0, 0});
		v3_copy(force, cases[i].asked);
		assert_int_equal(kind->limit(force), cases[i].flags);
		assert_near(force, cases[i].rendered, limit_error());
		/* What no limit holds is not touched. */
		for (int c = 0; c < 3 && !cases[i].flags; c++)
			assert_true(force[c] == kind->number(cases[i].asked[c]));
	}
}

TEST_KINDS(test_settings)
{
	double force[3] = {0.1, -0.2, 3};

	/* No force at all, or none that changes. */
	kind->set_limit(0, 1, (double[]){0, 0, 0});
	assert_int_equal(kind->limit(force), FORCE);
	assert_true(v3_length(force) == 0);
	assert_int_equal(kind->limit(force), 0);
	kind->set_limit(2, 0, (double[]){0, 0.5, 0});
	v3_copy(force, (double[]){0.1, -0.2, 1});
	assert_int_equal(kind->limit(force), SLEW);
	assert_true(force[0] == 0 && force[1] == 0.5 && force[2] == 0);
	/* A limit that was made smaller is kept at once. */
	kind->set_limit(1, 0.1, (double[]){0, 3, 0});
	v3_copy(force, (double[]){0, 3, 0});
	assert_int_equal(kind->limit(force), FORCE | SLEW);
	assert_true(fabs(force[1] - 1) < limit_error() && v3_length(force) <= 1);
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

/* Held by its size alone: the same direction, a unit vector's worth. */
static void assert_direction(const double asked[3], const double force[3], double most)
{
	double scale = fmax(fmax(fabs(asked[0]), fabs(asked[1])), fabs(asked[2]));
	double along[3], cross[3];

	for (int c = 0; c < 3; c++)
		along[c] = asked[c] / scale;
	v3_cross(cross, along, force);
	assert_true(v3_length(cross) < most);
	assert_true(v3_dot(along, force) > 0);
}

static void try_limit(uint64_t *seed, double force_N, double slew_N, int met[8])
{
	double last[3] = {0}, wanted[3], rounding_N = 8 * DBL_EPSILON * force_N;

	kind->set_limit(force_N, slew_N, last);
	for (int i = 0; i < 5000; i++) {
		double force[3], change[3];
		unsigned int flags;

		/* Asked for long enough to get there, now and then. */
		for (int c = 0; c < 3 && i % 32 == 0; c++)
			wanted[c] = kind->number(any(seed));
		v3_copy(force, wanted);
		flags = kind->limit(force);
		met[!!(flags & FORCE) + 2 * !!(flags & SLEW) +
		    4 * !!(flags & NOT_FINITE)]++;
		/* Not by rounding either. */
		assert_true(v3_length(force) <= force_N);
		v3_sub(change, force, last);
		assert_true(v3_length(change) <= slew_N + rounding_N + 3 * kind->bit);
		assert_int_equal(!!(flags & NOT_FINITE), !v3_finite(wanted));
		if (flags == FORCE)
			assert_direction(wanted, force, rounding_N + 3 * kind->bit);
		v3_copy(last, force);
	}
}

/* Never above the limit, whatever is asked and whatever it is. */
TEST_KINDS(test_whatever_is_asked)
{
	int met[8] = {0};
	uint64_t seed = 1;

	for (int run = 0; run < 100; run++)
		try_limit(&seed, kind->number(0.3 + 0.0777 * run),
			  kind->number(0.01 + 0.0123 * run), met);
	/*
	 * Each alone and together, but the size with what is not finite: that asks
	 * for 0. Integers are finite.
	 */
	for (int i = 0; i < 8; i++)
		assert_true((met[i] > 100) == (i < 4 || (kind->is_double && !(i & 1))));
}
