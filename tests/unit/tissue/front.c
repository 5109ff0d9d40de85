// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The front of a cut: forces on the way in, back and in again; no closed motion gives work back;
 * integers next to double.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/fixed/front.h"
#include "../../../lib/tissue/front.h"

#define K 0.3
#define FRICTION 0.1
#define ONE 65536.0

static const double up[3] = {0, 0, 1}, side[3] = {0, 1, 0};

/* A law of depth and speed whose slope by depth stays below K. */
static double law(double depth_mm, double speed_mm_s)
{
	return (0.05 * depth_mm + 0.004 * depth_mm * depth_mm) *
	       (1 + 0.35 * speed_mm_s / (speed_mm_s + 15));
}

/* Go to a depth in small steps; the last force. */
static double go(struct incise_double_front *front, double depth_mm, double friction)
{
	double from = front->depth_mm, force = 0;

	for (int i = 1; i <= 1000; i++) {
		double d = from + (depth_mm - from) * i / 1000;

		force = incise_double_front_force(front, K, friction, d, 0, law(d, 0));
	}
	return force;
}

/* 1e-9: a thousand roundings of numbers of some mm and N. */
static void near(double is, double should)
{
	if (!(fabs(is - should) < 1e-9))
		fail_msg("%.12g, expected %.12g", is, should);
}

TEST(test_in_back_and_in_again)
{
	struct incise_double_front front = {0};
	double c = law(15, 0);

	incise_double_front_enter(&front, (double[3]){0}, up, side);
	near(go(&front, 7, FRICTION), law(7, 0));
	near(go(&front, 15, FRICTION), c);
	/* Unloading: a straight line to 0, and on to friction against the way out. */
	near(go(&front, 15 - c / 2 / K, FRICTION), c / 2);
	near(go(&front, 15 - c / K, FRICTION), 0);
	near(go(&front, 3, FRICTION), -FRICTION * law(3, 0));
	/* Half of the unloading again, for the other way. */
	near(go(&front, 4, FRICTION), FRICTION * law(4, 0));
	/* The open cut ends where the force was gone. */
	near(front.cut_mm, 15 - c / K);
	near(go(&front, front.cut_mm, FRICTION), FRICTION * law(front.cut_mm, 0));
	near(go(&front, 15, FRICTION), c);
	near(go(&front, 16, FRICTION), law(16, 0));
}

TEST(test_without_friction)
{
	struct incise_double_front front = {0};

	incise_double_front_enter(&front, (double[3]){0}, up, side);
	go(&front, 12, 0);
	assert_true(go(&front, 2, 0) == 0);
	assert_true(go(&front, front.cut_mm, 0) == 0);
	near(go(&front, 12, 0), law(12, 0));
}

/* The blade leaves the skin and comes back: into its cut, beside it, beyond its end. */
TEST(test_place)
{
	static const struct {
		double at[3];
		bool open;
	} cases[] = {{{0, 0, 0}, true},
		     {{6, 0, 0}, true},
		     {{6, 0.9, 0}, true},
		     {{6, 1.1, 0}, false},
		     {{11.5, 0, 0}, false}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_double_front front = {0};

		incise_double_front_enter(&front, (double[3]){0}, up, side);
		near(incise_double_front_advance(&front, (double[3]){10, 0, 0}, up, side), 10);
		near(incise_double_front_advance(&front, (double[3]){4, 0, 0}, up, side), 0);
		go(&front, 10, 0);
		go(&front, 0, 0);
		incise_double_front_enter(&front, cases[i].at, up, side);
		near(go(&front, 2, 0), cases[i].open ? 0 : law(2, 0));
	}
}

/* Sideways out of its line: new tissue, and a new line from there on. */
TEST(test_sideways)
{
	struct incise_double_front front = {0};

	incise_double_front_enter(&front, (double[3]){0}, up, side);
	near(incise_double_front_advance(&front, (double[3]){0, 0.9, 0}, up, side), 0);
	assert_true(incise_double_front_advance(&front, (double[3]){0, 1.2, 0}, up, side) > 0);
	near(incise_double_front_advance(&front, (double[3]){5, 1.2, 0}, up, side), 5);
}

/* New tissue along the skin: the model's force at once, at any speed, while work was put in. */
TEST(test_along)
{
	struct incise_double_front front = {0};
	double force;

	incise_double_front_enter(&front, (double[3]){0}, up, side);
	go(&front, 10, FRICTION);
	for (int i = 0; i < 1000; i++) {
		double speed = 20 + 15 * sin(i * 0.01), d = 10 - 0.2 * sin(i * 0.003);

		force = incise_double_front_force(&front, K, FRICTION, d, speed * 1e-3,
					   law(d, speed));
		/* From a standstill the force needs some mm to rise to that of the speed. */
		if (i > 300)
			near(force, law(d, speed));
	}
	/* It rests: no more than the force of standing. */
	force = incise_double_front_force(&front, K, FRICTION, front.depth_mm, 0,
				   law(front.depth_mm, 0));
	near(force, law(front.depth_mm, 0));
}

/* The work that a random closed motion takes, as the trapezium rule has it and as forces that are
 * held for a step have it, as a loop's are. */
struct taken {
	double work, held, deep;
};

static struct taken take(struct incise_double_front *front, uint64_t n)
{
	const uint64_t key = incise_random_key(1, 99);
	const int steps = 4000;
	double work = 0, held = 0, force = 0, before = 0, x = 0, deep = 0;

	incise_double_front_enter(front, (double[3]){0}, up, side);
	for (int i = 1; i <= steps; i++) {
		double t = 2 * M_PI * i / steps, u[6], d, dx, speed;

		for (int k = 0; k < 6; k++)
			u[k] = incise_random_uniform(key, 6 * n + (uint64_t)k);
		d = (3 + 12 * u[0]) * pow(sin(t / 2), 2) *
		    (1 + 0.5 * u[1] * sin((1 + floor(8 * u[2])) * t));
		dx = 0.02 * u[3] * (1 + sin((1 + floor(20 * u[4])) * t + u[5]));
		d = i == steps ? 0 : fmax(d, 0);
		speed = 1e3 * hypot(d - before, dx);
		x += dx;
		held += force * (d - before);
		work += force / 2 * (d - before);
		force = incise_double_front_force(
			front, K, FRICTION * (n % 3) / 2, d,
			incise_double_front_advance(front, (double[3]){x, 0, 0}, up, side),
			law(d, speed));
		work += force / 2 * (d - before);
		before = d;
		deep = fmax(deep, d);
	}
	assert_true(isfinite(work));
	return (struct taken){work, held, deep};
}

/*
 * Random closed motions from the air back to it, in depth and along the skin, at any speed: work
 * goes in only, without a tolerance. The same of a second one in the cut of the first, which pays
 * for nothing.
 */
TEST(test_takes_work)
{
	int worse = 0, again = 0;

	for (uint64_t n = 0; n < 2000; n++) {
		struct incise_double_front front = {0};
		struct taken taken = take(&front, n);

		worse += taken.work <= 0 || taken.held <= 0;
		assert_true(taken.deep > 1);
		/* Without friction nothing is lost in the open cut. */
		if ((n + 1) % 3)
			again += take(&front, n + 1).work <= 0;
	}
	assert_int_equal(worse, 0);
	assert_int_equal(again, 0);
}

/* Accumulated work is that of the held forces, and what is paid for is never more. */
TEST(test_account)
{
	struct incise_double_front front = {0};
	double work;

	incise_double_front_enter(&front, (double[3]){0}, up, side);
	/* Shallow, then fast along the skin, then out: the force of speed cannot be got out. */
	go(&front, 4, 0);
	work = front.work_N_mm;
	for (int i = 0; i < 3000; i++)
		incise_double_front_force(&front, K, 0, 4, 0.1, law(4, 100));
	assert_true(front.force_N * front.force_N / (2 * K) <= work);
	go(&front, 0, 0);
	assert_true(front.work_N_mm > 0);
}

static int32_t q16(double x)
{
	return (int32_t)lrint(x * ONE);
}

/* Next to double on random motions, with a cutting force that is wrong by a bound of its own. */
TEST(test_integers)
{
	const uint64_t key = incise_random_key(2, 99);
	const double wrong_N = 0.01;
	double worst = 0;

	for (uint64_t n = 0; n < 300; n++) {
		double stiff = 0.25 + incise_random_uniform(key, 2 * n);
		double friction = 0.5 * incise_random_uniform(key, 2 * n + 1);
		double bound = incise_fixed_front_bound(stiff, friction, 4, wrong_N);
		struct incise_fixed_front fixed = {0};
		struct incise_double_front front = {0};

		incise_double_front_enter(&front, (double[3]){0}, up, side);
		for (int i = 0; i < 3000; i++) {
			uint64_t at = 10000 * n + (uint64_t)i;
			/* From the air, so that no force comes without work. */
			double d = (8 + 5 * sin(i * 0.01 + (double)n) +
				    3 * sin(i * 0.037 * (1 + (double)(n % 7)))) *
				   fmin(i * 0.01, 1);
			double cutting = law(fmax(d, 0), 30 + 30 * sin(i * 0.02));
			double off = 2 * incise_random_uniform(key + 1, at) - 1, a, b;

			d = fmax(d, 0);
			a = incise_double_front_force(&front, stiff, friction, d, 0, cutting);
			b = incise_fixed_front_force(
				    &fixed, q16(stiff), q16(friction), q16(d), 0,
				    q16(fmax(cutting + off * (wrong_N - 1 / ONE), 0))) /
			    ONE;
			worst = fmax(worst, fabs(a - b) / bound);
		}
	}
	/* The bound holds, and is not idle. */
	if (!(worst <= 1 && worst > 0.2))
		fail_msg("largest error / bound %g", worst);
}

/* Without an error of the model: some bits. */
TEST(test_integers_alone)
{
	double bound = incise_fixed_front_bound(K, FRICTION, 4, 0), worst = 0;
	struct incise_fixed_front fixed = {0};
	struct incise_double_front front = {0};

	incise_double_front_enter(&front, (double[3]){0}, up, side);
	for (int i = 0; i < 100000; i++) {
		double d = fmax(0, 7 + 6 * sin(i * 0.001) + 3 * sin(i * 0.0171));
		double x = i < 50000 ? 0 : 0.01 * (1 + sin(i * 0.01));
		double c = law(d, 40);

		worst = fmax(worst,
			     fabs(incise_double_front_force(&front, K, FRICTION, d, x, c) -
				  incise_fixed_front_force(&fixed, q16(K), q16(FRICTION),
							   q16(d), q16(x), q16(c)) /
					  ONE) /
				     bound);
	}
	if (!(worst <= 1 && worst > 0.1))
		fail_msg("largest error / bound %g", worst);
}

/* Any numbers: nothing wraps (the sanitizers' build sees that), and the force keeps its range. */
TEST(test_any_integers)
{
	static const int32_t ends[] = {INT32_MIN, INT32_MIN + 1, -65536,  -1,	    0,
				       1,	  65536,	 1 << 30, INT32_MAX};
	const uint64_t key = incise_random_key(3, 99);
	struct incise_fixed_front front = {0};

	for (uint64_t i = 0; i < 200000; i++) {
		int32_t v[5], force;

		for (int k = 0; k < 5; k++)
			v[k] = ends[(int)(9 * incise_random_uniform(
						      key, 5 * i + (uint64_t)k))];
		force = incise_fixed_front_force(&front, v[0], v[1], v[2], v[3], v[4]);
		assert_true(force <= (v[4] > 0 ? v[4] : 0));
		assert_true(force >= (v[4] > 0 ? -v[4] : 0));
	}
}
