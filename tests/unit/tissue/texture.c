// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The texture of a cut, in both kinds of numbers: its tape; the way of the front, which depends on places alone;
 * closed motions through a saw-tooth, which give no work back.
 */
#include "../unit.h"
#include "../cases.h"
#include "../../../driver/kunit/trial.h"
#include "../../../lib/base/random.h"
#include "../../../lib/tissue/tick.h"
#include "kinds.h"

#define K 0.3
#define BOTH 2 /* kinds: double, integers */

static const double up[3] = {0, 0, 1}, side[3] = {0, 1, 0};

static struct incise_fixed_texture tape;
static const struct incise_double_plan in_double = {.texture = &tape};
static const struct incise_fixed_plan in_integers = {.texture = &tape};

/* A front of either kind. */
struct front {
	bool whole;
	int left; /* lines of its cut, so far */
	struct incise_double_front d;
	struct incise_fixed_front i;
};

static bool enter(struct front *f, const double at[3])
{
	int32_t p[3], n[3], s[3];

	q16_all(p, at);
	q30_all(n, up);
	q30_all(s, side);
	return f->whole ? incise_fixed_front_enter(&f->i, p, n, s)
			: incise_double_front_enter(&f->d, at, up, side);
}

/* New tissue of this place, and the way. */
static double advance(struct front *f, const double at[3], double depth)
{
	int32_t p[3], n[3], s[3], fresh, before;
	double new_mm;

	q16_all(p, at);
	q30_all(n, up);
	q30_all(s, side);
	before = f->whole ? f->i.newest : f->d.newest;
	if (f->whole) {
		fresh = incise_fixed_front_advance(&f->i, p, n, s);
		incise_fixed_front_way(&f->i, q16(depth));
		new_mm = fresh / ONE;
	} else {
		new_mm = incise_double_front_advance(&f->d, at, up, side);
		incise_double_front_way(&f->d, depth);
	}
	f->left += (f->whole ? f->i.newest : f->d.newest) != before;
	return new_mm;
}

static double way_of(const struct front *f)
{
	return f->whole ? (double)f->i.way.most / ONE : f->d.way.most;
}

static uint32_t cut_of(const struct front *f)
{
	return f->whole ? f->i.way.number : f->d.way.number;
}

/* Of the texture: 1 + τ, and the factor. */
static double tooth(const struct front *f, double *factor)
{
	int32_t whole, share;

	if (!f->whole)
		return incise_double_texture_at(&in_double, &f->d.way, factor);
	share = incise_fixed_texture_at(&in_integers, &f->i.way, &whole);
	*factor = whole / ONE;
	return share / ONE;
}

static double force(struct front *f, double stiff, double friction, double depth,
		    double fresh, double cutting)
{
	return f->whole ? incise_fixed_front_force(&f->i, q16(stiff), q16(friction),
						   q16(depth), q16(fresh), q16(cutting)) /
				  ONE
			: incise_double_front_force(&f->d, stiff, friction, depth, fresh,
						    cutting);
}

static double go_to(struct front *f, double x, double y, double depth)
{
	advance(f, (const double[]){x, y, 0}, depth);
	return way_of(f);
}

static void near_by(double is, double should, double most)
{
	if (!(fabs(is - should) <= most))
		fail_msg("%.12g, expected %.12g", is, should);
}

/* --- the tape --------------------------------------------------------------------------- */

/* Linear between knots, round and round; a bit and a half of integers. */
TEST(test_tape)
{
	uint64_t seed = cases_seed(1);
	int n = cases_of(400, 40);

	for (int k = 0; k < n; k++) {
		double step_mm, at, factor[BOTH], is[BOTH], a, b;

		incise_fx_trial_texture(&seed, k % 2 ? INCISE_TEXTURE_MOST : 3000, &tape);
		assert_true(incise_fixed_texture_good(&tape));
		step_mm = ldexp(1, tape.step_shift) / ONE;
		for (int i = 0; i < 200; i++) {
			struct front f = {.whole = false};
			uint32_t cut = (uint32_t)(incise_random_next(&seed) >> 40);
			int64_t most =
				(int64_t)(incise_random_next(&seed) >> (20 + i % 40));

			f.d.way.number = f.i.way.number = cut;
			f.i.way.most = most;
			f.d.way.most = (double)most / ONE;
			is[0] = tooth(&f, &factor[0]);
			f.whole = true;
			is[1] = tooth(&f, &factor[1]);
			at = fmod(tape.start[cut % 64] + (double)most / ONE / step_mm,
				  8192);
			a = tape.knot[(int)at];
			b = tape.knot[((int)at + 1) % 8192];
			near_by(is[0], 1 + (a + (at - floor(at)) * (b - a)) / 16384,
				1e-6);
			near_by(is[1], is[0], 1 / ONE);
			assert_true(is[1] > 0.09 && is[1] < 1.91);
			near_by(factor[0], tape.factor[cut % 64] / ONE, 0);
			near_by(factor[1], factor[0], 0);
		}
	}
}

/* --- the way ---------------------------------------------------------------------------- */

/* Draws back, rests, comes again: only where the blade was not before the way goes on. */
TEST(test_it_stays)
{
	for (int whole = 0; whole < BOTH; whole++) {
		struct front f = {.whole = whole};
		const double e = whole ? 8 / ONE : 1e-12;

		assert_true(enter(&f, (const double[]){0, 0, 0}));
		near_by(go_to(&f, 0, 0, 0), 0, 0);
		near_by(go_to(&f, 0, 0, 3), 3, e);
		for (int i = 0; i < 1000; i++)
			near_by(go_to(&f, 0, 0, 3), 3, e);
		near_by(go_to(&f, 0, 0, 1), 3, e);
		near_by(go_to(&f, 0, 0, 3), 3, e);
		near_by(go_to(&f, 10, 0, 3), 13, e);
		/* On a slope of 45° it is where it was. */
		near_by(go_to(&f, 12, 0, 1), 13, e);
		near_by(go_to(&f, 12, 0, 1.5), 13.5, e);
		near_by(go_to(&f, 2, 0, 1.5), 13.5, e);
		near_by(go_to(&f, 12, 0, 1.5), 13.5, e);
		/* Out, and in again: another cut, then the first one, which was left so deep. */
		assert_true(enter(&f, (const double[]){0, 30, 0}));
		assert_int_equal(cut_of(&f), 1);
		near_by(go_to(&f, 0, 30, 2), 2, e);
		assert_false(enter(&f, (const double[]){5, 0.1, 0}));
		assert_int_equal(cut_of(&f), 0);
		near_by(go_to(&f, 5, 0.1, 1), 13.5, e);
		near_by(go_to(&f, 12, 0, 2), 14, e);
		/* Sideways on other lines: the same cut. */
		for (int i = 1; i <= 80; i++)
			go_to(&f, 12, i * 0.1, 2);
		assert_int_equal(cut_of(&f), 0);
		assert_true(f.left > 5);
		/* A step leaves a line 1.1 mm beside it. */
		near_by(way_of(&f), 14 + 1.1 * 53 / 128 + 6.9, 80 * e);
	}
}

/* A way in 0.4 s: to and fro along a line and aside, in and out; mm. */
struct journey {
	double x, y, d, aside; /* sizes; speed aside */
	double w[3], p[3];
};

#define MS 400

static struct journey draw_journey(uint64_t *seed, bool beside)
{
	struct journey j;

	j.x = 11 + 9 * incise_random_symmetric(seed);
	j.y = beside ? 5 + 4 * incise_random_symmetric(seed) : 0.4;
	j.d = 2.5 + 1.5 * incise_random_symmetric(seed);
	j.aside = beside ? 20 * incise_random_symmetric(seed) : 0;
	for (int i = 0; i < 3; i++) {
		j.w[i] = 4 + 3 * incise_random_symmetric(seed);
		j.p[i] = M_PI * incise_random_symmetric(seed);
	}
	return j;
}

/* As a tracker of both kinds has it. */
static double at_time(const struct journey *j, double t, double at[3])
{
	at[0] = q16(j->x * (sin(j->w[0] * t + j->p[0]) - sin(j->p[0]))) / ONE;
	at[1] = q16(j->y * (sin(j->w[1] * t + j->p[1]) - sin(j->p[1])) + j->aside * t) /
		ONE;
	at[2] = 0;
	return q16(j->d * (1 - cos(j->w[2] * t))) / ONE;
}

/* The way of a hand in 1 ms at most; where a line is left as much of it aside, there and back. */
#define TICK_MM 0.2
#define LEFT_MM (2 * TICK_MM)
/* a dt² / 8 of a turn between two ticks of 1 ms, of two ends, aside and in depth, at 2 m/s². */
#define TURN_MM 1e-3
/* Where a line is left at different ticks they are so many ms apart, or for good. */
#define UNLIKE 10

/*
 * The same way at 1, 2 and 5 kHz: at each ms the same to a tick's way, as it may turn where the cut ends, and mostly to the
 * turn of a hand; nothing adds up but a tick's way aside, there and back, for each line that was left. Where only one of
 * them leaves a line they are apart. On one line: as all of its places say.
 */
TEST(test_same_way_at_any_rate)
{
	static const int rates[] = {1, 2, 5}; /* per ms */
	int n = cases_of(10000, 1000), apart = 0, lines = 0, turns = 0, all = 0;
	uint64_t seed = cases_seed(1);
	double worst = 0;

	for (int k = 0; k < n; k++) {
		struct front f[BOTH][3];
		struct journey j = draw_journey(&seed, k % 2);
		double at[3], low = 0, high = 0, most = 0;
		int unlike = 0; /* ms in a row */

		for (int whole = 0; whole < BOTH; whole++)
			for (int r = 0; r < 3; r++) {
				f[whole][r] = (struct front){.whole = whole};
				enter(&f[whole][r], (const double[]){0, 0, 0});
			}
		for (int ms = 1; ms <= MS && unlike < UNLIKE; ms++) {
			bool alike = true;

			for (int r = 0; r < 3; r++)
				for (int i = 1; i <= rates[r]; i++) {
					double t = 1e-3 * (ms - 1 + (double)i / rates[r]),
					       d = at_time(&j, t, at);

					for (int whole = 0; whole < BOTH; whole++)
						advance(&f[whole][r], at, d);
					if (rates[r] < 5)
						continue;
					low = fmin(low, at[0]);
					high = fmax(high, at[0]);
					most = fmax(most,
						    d + fmax(high - low, fabs(at[1])) +
							    fmin(high - low,
								 fabs(at[1])) *
								    53 / 128);
				}
			for (int r = 0; r < 3; r++) {
				const struct front *fine = &f[0][2];
				int left = fine->left;
				double off, e = left * LEFT_MM;

				if (left != f[0][r].left || left != f[1][r].left) {
					alike = false;
					continue;
				}
				off = way_of(&f[0][r]) - way_of(fine);
				near_by(off, 0, e + TICK_MM);
				turns += fabs(off) > TURN_MM;
				all++;
				near_by(way_of(&f[1][r]), way_of(&f[0][r]),
					(8 + 8 * left) / ONE);
				if (!left)
					near_by(way_of(fine), most, 1e-9);
				worst = fmax(worst, fabs(off));
			}
			unlike = alike ? 0 : unlike + 1;
		}
		apart += unlike > 0;
		lines += f[0][2].left;
	}
	printf("%d ways, %d lines left, %d apart, %.2g mm at most, %.2g of them by more than a turn\n",
	       n, lines, apart, worst, (double)turns / all);
	assert_true(lines > n && apart < n / 10 && turns < all / 10);
}

/* --- work ------------------------------------------------------------------------------- */

/* A law of depth and speed; a tooth of it may be steeper than K. */
static double law(double depth_mm, double speed_mm_s)
{
	return (0.05 * depth_mm + 0.004 * depth_mm * depth_mm) *
	       (1 + 0.35 * speed_mm_s / (speed_mm_s + 15));
}

/* Work by the mean of both forces of a step, so much of it put in; rounded by integers at most, and by a turn in a step. */
struct taken {
	double work, put, rounded, turned;
};

static struct taken take(struct front *f, uint64_t *seed, double friction)
{
	const int steps = 2000;
	struct taken taken = {0};
	double u[6], last_N = 0, before = 0, x = 0, factor, share = 0;

	for (int i = 0; i < 6; i++)
		u[i] = (1 + incise_random_symmetric(seed)) / 2;
	for (int i = 1; i <= steps; i++) {
		double t = 2 * M_PI * i / steps, d, dx, fresh, cutting, step, was_N;
		double at[3] = {0};

		d = (3 + 12 * u[0]) * pow(sin(t / 2), 2) *
		    (1 + 0.5 * u[1] * sin((1 + floor(8 * u[2])) * t));
		d = i == steps ? 0 : q16(fmax(d, 0)) / ONE;
		dx = 0.02 * u[3] * (1 + sin((1 + floor(20 * u[4])) * t + u[5]));
		at[0] = x = q16(x + dx) / ONE;
		was_N = last_N;
		fresh = advance(f, at, d);
		*(f->whole ? &f->i.rises : &f->d.rises) = share < tooth(f, &factor);
		share = tooth(f, &factor);
		cutting = law(d, 1e3 * hypot(d - before, dx)) * share * factor;
		last_N = force(f, K, friction, d, fresh, cutting);
		step = (was_N + last_N) / 2 * (d - before);
		taken.work += step;
		taken.put += fmax(step, 0);
		/* Of a force half a bit, of the rest another one. */
		if (f->whole)
			taken.rounded += (fabs(d - before) + fabs(last_N)) / ONE / 2;
		taken.turned += fabs(last_N - was_N) * fabs(d - before) / 2;
		before = d;
	}
	return taken;
}

/* Through any saw-tooth, with falls of up to 1.8 from one knot to the next; twice in the same cut. */
TEST(test_takes_work)
{
	int n = cases_of(10000, 500), back = 0, lossy = 0;
	uint64_t seed = cases_seed(1);

	for (int k = 0; k < n; k++) {
		struct front f = {.whole = k % 2};

		if (k % 8 == 0)
			incise_fx_trial_texture(&seed, INCISE_TEXTURE_MOST, &tape);
		for (int i = 0; i < 2; i++) {
			struct taken taken;

			assert_int_equal(enter(&f, (const double[]){0, 0, 0}), !i);
			taken = take(&f, &seed, 0.05 * (k % 3));
			/* In the open cut it may be little that is taken. */
			back += !(taken.work >=
				  -1e-9 - taken.rounded - (i ? 2 * taken.turned : 0));
			lossy += !i && taken.work > 0.1 * taken.put;
		}
	}
	printf("%d closed motions, %d of them took a tenth of the work\n", 2 * n, lossy);
	assert_int_equal(back, 0);
	assert_true(lossy > n / 4);
}
