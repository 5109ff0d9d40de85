// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The front of a cut, in both kinds of numbers: its line in the surface; forces on the way in, back and in
 * again; no closed motion gives work back. Then integers next to double.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/scene/plan.h"
#include "../../../lib/tissue/tick.h"
#include "kinds.h"

#define K 0.3
#define FRICTION 0.1

static const double up[3] = {0, 0, 1}, side[3] = {0, 1, 0}, origin[3];

static struct incise_double_front in_double;
static struct incise_fixed_front in_integers;

/* Enter, or advance: whether the cut is new, or the length of new tissue. */
static double place_double(bool enter, const double at[3], const double normal[3],
			   const double to[3])
{
	return enter ? incise_double_front_enter(&in_double, at, normal, to)
		     : incise_double_front_advance(&in_double, at, normal, to);
}

static double place_fixed(bool enter, const double at[3], const double normal[3],
			  const double to[3])
{
	int32_t p[3], n[3], s[3];

	q16_all(p, at);
	q30_all(n, normal);
	q30_all(s, to);
	return enter ? incise_fixed_front_enter(&in_integers, p, n, s)
		     : incise_fixed_front_advance(&in_integers, p, n, s) / ONE;
}

static double force_double(double unloading, double friction, double depth,
			   double advance, double cutting)
{
	return incise_double_front_force(&in_double, unloading, friction, depth, advance,
					 cutting);
}

static struct incise_double_front seen_double(void)
{
	return in_double;
}

static double force_fixed(double unloading, double friction, double depth, double advance,
			  double cutting)
{
	return incise_fixed_front_force(&in_integers, q16(unloading), q16(friction),
					q16(depth), q16(advance), q16(cutting)) /
	       ONE;
}

static struct incise_double_front seen_fixed(void)
{
	const struct incise_fixed_front *f = &in_integers;
	struct incise_double_front seen = {
		.depth = f->depth / ONE,
		.force = f->force / ONE,
		.rest = f->rest / ONE,
		.cut = f->cut / ONE,
		.work2 = (double)f->work2 / ONE / ONE,
		.most2 = (double)f->most2 / ONE / ONE,
		.line = {.there = f->line.there,
			 .from = f->line.from / ONE,
			 .to = f->line.to / ONE},
	};

	from_q16(seen.line.at, f->line.at);
	from_q30(seen.line.side, f->line.side);
	from_q30(seen.line.along, f->line.along);
	return seen;
}

/*
 * rounding: of a thousand forces of some mm and N; of integers each is off by half a bit, and a rest by as
 * much over K. length: of one product; unit: of a direction.
 */
static const struct kind {
	bool is_double;
	double rounding, length, unit;
	double (*place)(bool enter, const double at[3], const double normal[3],
			const double to[3]);
	double (*force)(double unloading, double friction, double depth, double advance,
			double cutting);
	struct incise_double_front (*seen)(void);
} kinds[] = {{true, 1e-9, 1e-12, 1e-14, place_double, force_double, seen_double},
	     {false, 4 / K / ONE, 2 / ONE, 4e-6, place_fixed, force_fixed, seen_fixed}},
  *kind;

/* A blade that was nowhere yet. */
static void fresh(void)
{
	in_double = (struct incise_double_front){0};
	in_integers = (struct incise_fixed_front){0};
}

static void begin(void)
{
	fresh();
	assert_true(kind->place(true, origin, up, side));
}

static double advance_to(double x, double y)
{
	return kind->place(false, (const double[]){x, y, 0}, up, side);
}

/* A law of depth and speed whose slope by depth stays below K. */
static double law(double depth_mm, double speed_mm_s)
{
	return (0.05 * depth_mm + 0.004 * depth_mm * depth_mm) *
	       (1 + 0.35 * speed_mm_s / (speed_mm_s + 15));
}

/* Go to a depth in small steps; the last force. */
static double go(double depth, double friction)
{
	double from = kind->seen().depth, force = 0;

	for (int i = 1; i <= 1000; i++) {
		double d = from + (depth - from) * i / 1000;

		force = kind->force(K, friction, d, 0, law(d, 0));
	}
	return force;
}

static void near_by(double is, double should, double most)
{
	if (!(fabs(is - should) <= most))
		fail_msg("%.12g, expected %.12g", is, should);
}

static void near(double is, double should)
{
	near_by(is, should, kind->rounding);
}

/* --- the line --------------------------------------------------------------------------- */

#define ANY             \
	{               \
		0, 0, 0 \
	} /* any direction in the surface */
#define C30 0.86602540378443865
/* The sine of an angle of 2 mrad: the blade still has a direction; 0.5 mrad: it has not. */
#define S2 2e-3
#define S05 0.5e-3

TEST_KINDS(test_direction)
{
	static const double at[3] = {7, 8, 9};
	static const struct {
		double normal[3], side[3], along[3];
	} cases[] = {
		{{0, 0, 1}, {0, 1, 0}, {1, 0, 0}},
		{{0, 0, 1}, {0, -1, 0}, {-1, 0, 0}},
		{{0, 0, 1}, {1, 0, 0}, {0, -1, 0}},
		{{1, 0, 0}, {0, 1, 0}, {0, 0, -1}},
		/* A blade that leans over cuts along the same line. */
		{{0, 0, 1}, {0, C30, 0.5}, {1, 0, 0}},
		{{0, 0, 1}, {0, S2, 1}, {1, 0, 0}},
		/* Flat on the skin: its cut has no direction of its own. */
		{{0, 0, 1}, {0, 0, 1}, ANY},
		{{0, 0, 1}, {0, 0, -1}, ANY},
		{{1, 0, 0}, {1, 0, 0}, ANY},
		{{0, 1, 0}, {0, -1, 0}, ANY},
		{{0.6, 0, 0.8}, {0.6, 0, 0.8}, ANY},
		{{C30, 0.5, 0}, {-C30, -0.5, 0}, ANY},
		{{0, 0, 1}, {0, S05, 1}, ANY},
		/* Places as a broken rig may give them. */
		{{0, 0, 1}, {0, 0, 0}, ANY},
		{{0, 0, 1}, {NAN, 0, 0}, ANY},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		const double *want = cases[i].along;
		struct incise_double_line line;

		if (isnan(cases[i].side[0]) && !kind->is_double)
			continue;
		fresh();
		assert_true(kind->place(true, at, cases[i].normal, cases[i].side));
		line = kind->seen().line;
		assert_true(line.there && line.from == 0 && line.to == 0);
		/* In the surface and of length 1, whatever the blade: some roundings. */
		near_by(v3_dot(line.along, line.along), 1, kind->unit);
		near_by(v3_dot(line.along, cases[i].normal), 0, kind->unit);
		for (int k = 0; k < 3; k++) {
			if (v3_length(want) > 0)
				near_by(line.along[k], want[k], kind->unit);
			assert_true(line.at[k] == at[k]);
		}
	}
}

/* Any blade on any surface. */
TEST_KINDS(test_any_direction)
{
	const uint64_t key = incise_random_key(4, 99);

	for (uint64_t n = 0; n < 100000; n++) {
		double v[2][3], along[3];

		for (uint64_t i = 0; i < 6; i++)
			v[i / 3][i % 3] = incise_random_normal(key, 6 * n + i);
		if (!v3_unit(v[0], v[0], 1e-3) || !v3_unit(v[1], v[1], 1e-3))
			continue;
		fresh();
		kind->place(true, origin, v[0], n % 10 ? v[1] : v[0]);
		v3_copy(along, kind->seen().line.along);
		near_by(v3_length(along), 1, kind->is_double ? 1e-14 : 1e-8);
		/* Both are rounded, and a cross product of 1/1000 is scaled up. */
		near_by(v3_dot(along, v[0]), 0, kind->is_double ? 1e-12 : 4000 / UNIT);
	}
}

/* A cut from x = 0 that runs along x, to where these places are. */
TEST_KINDS(test_extent)
{
	static const struct {
		double at[3], from, to, fresh;
	} steps[] = {
		{{5, 0, 0}, 0, 5, 5},
		{{3, 0, 0}, 0, 5, 0},
		{{-2, 0, 0}, -2, 5, 2},
		{{20, 0.9, 0}, -2, 20, 15},
		{{20, 0, -0.9}, -2, 20, 0},
		/* Sideways out of its line: new tissue, and a new line from there on. */
		{{20, 1.2, 0}, 0, 0, INCISE_FRONT_BESIDE_MM},
		{{25, 1.2, 0}, 0, 5, 5},
	};

	begin();
	for (size_t i = 0; i < sizeof(steps) / sizeof(*steps); i++) {
		double advance = kind->place(false, steps[i].at, up, side);

		near_by(advance, steps[i].fresh, kind->length);
		near_by(kind->seen().line.from, steps[i].from, kind->length);
		near_by(kind->seen().line.to, steps[i].to, kind->length);
	}
	near_by(kind->seen().line.at[1], 1.2, kind->length);
	/* What is no place is forgotten with the next one. */
	if (kind->is_double)
		kind->place(false, (const double[]){NAN, 0, 0}, up, side);
	advance_to(50, 0);
	near_by(advance_to(53, 0), 3, kind->length);
}

/* The cut from -2 to 20 has the shape of a capsule around it: in it the blade is in its cut. */
TEST_KINDS(test_reach)
{
	static const struct {
		double at[3];
		bool holds;
	} cases[] = {
		{{0, 0, 0}, true},	   {{10, 1, 0}, true},
		{{10, 1.001, 0}, false},   {{10, -1, 0}, true},
		{{10, 0, 0.999}, true},	   {{10, 0, -1.001}, false},
		{{21, 0, 0}, true},	   {{21.001, 0, 0}, false},
		{{-3, 0, 0}, true},	   {{-3.001, 0, 0}, false},
		{{20.599, 0.8, 0}, true}, /* 3-4-5 around the end */
		{{20.601, 0.8, 0}, false}, {{40, 0, 0}, false},
		{{NAN, 0, 0}, false},	   {{10, NAN, 0}, false},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		if (isnan(v3_length(cases[i].at)) && !kind->is_double)
			continue;
		/* Before the first cut there is none. */
		begin();
		advance_to(20, 0);
		advance_to(-2, 0);
		go(10, 0);
		go(0, 0);
		if (kind->place(true, cases[i].at, up, side) == cases[i].holds)
			fail_msg("case %zu", i);
		assert_true((kind->seen().line.to > 0) == cases[i].holds);
		/* In its cut there is nothing to cut. */
		near(go(2, 0), cases[i].holds ? 0 : law(2, 0));
	}
}

static bool enter_at(double x, double y)
{
	return kind->place(true, (const double[]){x, y, 0}, up, side);
}

/* A cut of 10 mm at @y, so deep; how deep it was left open. */
static double cut_at(double y, double depth)
{
	double cut;

	assert_true(enter_at(0, y));
	kind->place(false, (const double[]){10, y, 0}, up, side);
	go(depth, FRICTION);
	cut = kind->seen().cut;
	go(0, FRICTION);
	return cut;
}

/* Back in any of the last cuts it is as it was left: friction, and new tissue beyond its floor. */
TEST_KINDS(test_several_cuts)
{
	double cut[T_FRONT_CUTS + 1];

	fresh();
	for (int i = 0; i <= T_FRONT_CUTS; i++)
		cut[i] = cut_at(3 * i, 5 + i);
	for (int i = T_FRONT_CUTS; i > 0; i--) {
		assert_false(enter_at(5, 3 * i));
		assert_true(kind->seen().cut == cut[i] && cut[i] > 1);
		near(go(1, FRICTION), FRICTION * law(1, 0));
		/* Deeper, which is remembered too. */
		go(15 + i, FRICTION);
		cut[i] = kind->seen().cut;
	}
	for (int i = 1; i <= T_FRONT_CUTS; i++) {
		assert_false(enter_at(5, 3 * i));
		assert_true(kind->seen().cut == cut[i]);
	}
	/* The one that began first was forgotten for the last; so is the second for it now. */
	assert_true(enter_at(5, 0));
	assert_true(kind->seen().cut == 0);
	assert_true(enter_at(5, 3));
	for (int i = 3; i <= T_FRONT_CUTS; i++)
		assert_false(enter_at(5, 3 * i));
}

/* Of two cuts that hold the blade it is in the nearer one; a cut that it left sideways stays, too. */
TEST_KINDS(test_the_nearest_cut)
{
	double a, b;

	fresh();
	a = cut_at(0, 10);
	b = cut_at(1.5, 4);
	assert_true(a > b);
	assert_false(enter_at(5, 0.7));
	assert_true(kind->seen().cut == a);
	assert_false(enter_at(5, 0.9));
	assert_true(kind->seen().cut == b);
	kind->place(false, (const double[]){5, 8, 0}, up, side);
	assert_false(enter_at(9, 1.5));
	assert_true(kind->seen().cut == b);
	assert_false(enter_at(5, 8));
}

/* --- forces ----------------------------------------------------------------------------- */

TEST_KINDS(test_in_back_and_in_again)
{
	double c = law(15, 0), cut;

	begin();
	near(go(7, FRICTION), law(7, 0));
	near(go(15, FRICTION), c);
	/* Unloading: a straight line to 0, and on to friction against the way out. */
	near(go(15 - c / 2 / K, FRICTION), c / 2);
	near(go(15 - c / K, FRICTION), 0);
	near(go(3, FRICTION), -FRICTION * law(3, 0));
	/* Half of the unloading again, for the other way. */
	near(go(4, FRICTION), FRICTION * law(4, 0));
	/* The open cut ends where the force was gone. */
	cut = kind->seen().cut;
	near(cut, 15 - c / K);
	near(go(cut, FRICTION), FRICTION * law(cut, 0));
	near(go(15, FRICTION), c);
	near(go(16, FRICTION), law(16, 0));
}

TEST_KINDS(test_without_friction)
{
	begin();
	go(12, 0);
	assert_true(go(2, 0) == 0);
	near_by(go(kind->seen().cut, 0), 0, kind->is_double ? 0 : 1 / ONE);
	near(go(12, 0), law(12, 0));
}

/* New tissue along the skin: the model's force at once, at any speed, while work was put in. */
TEST_KINDS(test_along)
{
	begin();
	go(10, FRICTION);
	for (int i = 0; i < 1000; i++) {
		double speed = 20 + 15 * sin(i * 0.01), d = 10 - 0.2 * sin(i * 0.003);
		double force = kind->force(K, FRICTION, d, speed * 1e-3, law(d, speed));

		/* From a standstill the force needs some mm to rise to that of the speed. */
		if (i > 300)
			near(force, law(d, speed));
	}
	/* It rests: no more than the force of standing. */
	double d = kind->seen().depth;

	near(kind->force(K, FRICTION, d, 0, law(d, 0)), law(d, 0));
}

/* The work that a random closed motion takes, as the trapezium rule has it and as forces that are
 * held for a step have it, as a loop's are. */
struct taken {
	double work, held, deep;
};

static struct taken take(uint64_t n)
{
	const uint64_t key = incise_random_key(1, 99);
	const int steps = 4000;
	double work = 0, held = 0, force = 0, before = 0, x = 0, deep = 0;

	kind->place(true, origin, up, side);
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
		force = kind->force(K, FRICTION * (n % 3) / 2, d, advance_to(x, 0),
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
 * for nothing; in integers its forces, all but 0, are rounded.
 */
TEST_KINDS(test_takes_work)
{
	/* 4000 steps of at most 0.02 mm, each with a force that is off by half a bit. */
	double rounding = kind->is_double ? 0 : 4000 * 0.02 * 0.5 / ONE;
	int worse = 0, again = 0;

	for (uint64_t n = 0; n < 2000; n++) {
		struct taken taken;

		fresh();
		taken = take(n);
		worse += taken.work <= 0 || taken.held <= 0;
		assert_true(taken.deep > 1);
		/* Without friction nothing is lost in the open cut. */
		if ((n + 1) % 3)
			again += take(n + 1).work <= -rounding;
	}
	assert_int_equal(worse, 0);
	assert_int_equal(again, 0);
}

/* Accumulated work is that of the held forces, and what is paid for is never more. */
TEST_KINDS(test_account)
{
	double work2;

	begin();
	/* Shallow, then fast along the skin, then out: the force of speed cannot be got out. */
	go(4, 0);
	work2 = kind->seen().work2;
	for (int i = 0; i < 3000; i++)
		kind->force(K, 0, 4, 0.1, law(4, 100));
	assert_true(pow(kind->seen().force, 2) / K <= work2);
	go(0, 0);
	assert_true(kind->seen().work2 > 0);
}

/* Any numbers: nothing wraps (the sanitizers' build sees that), and the force keeps its range. */
TEST(test_any_integers)
{
	static const int32_t ends[] = {INT32_MIN, INT32_MIN + 1, -65536,  -1,	    0,
				       1,	  65536,	 1 << 30, INT32_MAX};
	const uint64_t key = incise_random_key(3, 99);

	fresh();
	for (uint64_t i = 0; i < 200000; i++) {
		int32_t v[5], force;

		for (int k = 0; k < 5; k++)
			v[k] = ends[(int)(9 * incise_random_uniform(
						      key, 5 * i + (uint64_t)k))];
		force = incise_fixed_front_force(&in_integers, v[0], v[1], v[2], v[3],
						 v[4]);
		assert_true(force <= (v[4] > 0 ? v[4] : 0));
		assert_true(force >= (v[4] > 0 ? -v[4] : 0));
	}
}

/* --- integers next to double ------------------------------------------------------------ */

/* How far a place is beside the line of the front in double, mm. */
static double beside(const double at[3])
{
	double off[3], across[3];

	v3_sub(off, at, in_double.line.at);
	v3_cross(across, off, in_double.line.along);
	return v3_length(across);
}

/*
 * New tissue, tick for tick: the along of a line is off by some 2^-30, a product by 2^-17. Only where the
 * edge of a line lies within that, one may begin anew and the other not.
 */
TEST(test_same_new_tissue)
{
	const uint64_t key = incise_random_key(5, 99);
	uint64_t u = 0;
	int apart = 0;

	for (int run = 0; run < 200; run++) {
		double x = 0, y = 0, angle = 0;

		fresh();
		for (int t = 0; t <= 400; t++) {
			double way = (t ? 0.4 : 1) * incise_random_uniform(key, u++), a,
			       b;
			double at[3] = {0}, to[3] = {0}, edge;

			angle += 0.1 * incise_random_uniform(key, u++) - 0.05;
			if (incise_random_uniform(key, u++) < 1.0 / 60)
				angle += 4 * incise_random_uniform(key, u++) - 2;
			x += way * cos(angle);
			y += way * sin(angle);
			at[0] = q16(x) / ONE;
			at[1] = q16(y) / ONE;
			to[0] = q30(-sin(angle)) / UNIT;
			to[1] = q30(cos(angle)) / UNIT;
			if (!t) {
				place_double(true, at, up, to);
				place_fixed(true, at, up, to);
				continue;
			}
			edge = fabs(beside(at) - INCISE_FRONT_BESIDE_MM);
			a = place_double(false, at, up, to);
			b = place_fixed(false, at, up, to);
			if (edge < 2 / ONE && fabs(b - a) > 2 / ONE) {
				apart++;
				break;
			}
			near_by(b, a, 2 / ONE);
		}
	}
	/* Seldom: in one run of a hundred. */
	assert_true(apart <= 2);
}

/* On random motions, with a cutting force that is wrong by a bound of its own. */
TEST(test_same_force)
{
	const uint64_t key = incise_random_key(2, 99);
	const double wrong_N = 0.01;
	double worst = 0;

	for (uint64_t n = 0; n < 300; n++) {
		double stiff = 0.25 + incise_random_uniform(key, 2 * n);
		double friction = 0.5 * incise_random_uniform(key, 2 * n + 1);
		double bound = incise_front_bound(stiff, friction, 4, wrong_N);

		fresh();
		for (int i = 0; i < 3000; i++) {
			uint64_t at = 10000 * n + (uint64_t)i;
			/* From the air, so that no force comes without work. */
			double d = (8 + 5 * sin(i * 0.01 + (double)n) +
				    3 * sin(i * 0.037 * (1 + (double)(n % 7)))) *
				   fmin(i * 0.01, 1);
			double cutting = law(fmax(d, 0), 30 + 30 * sin(i * 0.02));
			double off = 2 * incise_random_uniform(key + 1, at) - 1;

			d = fmax(d, 0);
			off = fmax(cutting + off * (wrong_N - 1 / ONE), 0);
			worst = fmax(worst,
				     fabs(force_double(stiff, friction, d, 0, cutting) -
					  force_fixed(stiff, friction, d, 0, off)) /
					     bound);
		}
	}
	/* The bound holds, and is not idle. */
	if (!(worst <= 1 && worst > 0.2))
		fail_msg("largest error / bound %g", worst);
}

/* Without an error of the model: some bits. */
TEST(test_same_force_of_the_same_model)
{
	double bound = incise_front_bound(K, FRICTION, 4, 0), worst = 0;

	fresh();
	for (int i = 0; i < 100000; i++) {
		double d = fmax(0, 7 + 6 * sin(i * 0.001) + 3 * sin(i * 0.0171));
		double x = i < 50000 ? 0 : 0.01 * (1 + sin(i * 0.01));
		double c = law(d, 40);

		worst = fmax(worst, fabs(force_double(K, FRICTION, d, x, c) -
					 force_fixed(K, FRICTION, d, x, c)) /
					    bound);
	}
	if (!(worst <= 1 && worst > 0.1))
		fail_msg("largest error / bound %g", worst);
}
