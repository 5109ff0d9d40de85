/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A third kind of number for the .proto.c of lib/tissue: how far the integers of fixed.h are from the doubles
 * of double.h. In C++, so that the same source does: its operators work on these, and each scale is a type of
 * its own. A length that is taken for a direction does not compile; of a `wide`, whose scale stands beside
 * it, the scale is checked when it is computed.
 *
 *   a number   low … high    where the double is
 *              in            how far errors from before this tick move the integer away from it, at most
 *              own           how far rounding at this tick does
 *              bits          behind the point of the integer
 *   a vector   one `ball` for all of its parts: high is the bound of its length, in and own of the length
 *              of its error. Frames do not count: a turned vector keeps its length.
 *
 * A branch which is not decided is taken both ways, one after the other: a tick is run again and again, along
 * all paths. A path narrows its numbers by its decisions. In a copy of a number all of that is known, too,
 * as a number is only a place in a table.
 *
 *              ┌─ a < b ──┬─ c < 0 ── path 1      a force that is continuous where the integer goes
 *     tick ────┤          └─ else ─── path 2      another path than the double differs by no more than
 *              └─ else ────────────── path 3      the largest `in` of all paths and the largest `own`
 *
 * For on the straight way from the double's state to that of the integers each piece of the way lies on
 * some path, and adds at most its share of that path's `in`. The bound does not cover discontinuities: see
 * incise_plan_bound().
 */
#ifndef INCISE_NUMBER_BOUNDED_H
#define INCISE_NUMBER_BOUNDED_H

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Sine of 30°: a blade in the skin has at least this share of its length across it. */
#define STANDS 0.5

struct bounds {
	double low, high, in, own;
	int bits; /* -1: 0, of any scale */
	bool ball;
};

#define BOUNDS_MOST 8192
#define CHOICES_MOST 400
#define NARROWED_MOST 8192
#define PATHS_MOST 5000000

/* The paths of a tick. */
struct paths {
	struct bounds of[BOUNDS_MOST];
	uint32_t n;
	uint8_t chosen[CHOICES_MOST], ways[CHOICES_MOST];
	int n_chosen, at;
	/* Numbers as they were before this path narrowed them, in order. */
	struct {
		uint32_t id;
		struct bounds of;
	} before[NARROWED_MOST];
	uint32_t n_narrowed;
	bool dead;	    /* no numbers go along this one */
	const char *failed; /* why nothing is bounded, or NULL */
	/* Beside the numbers, for stages: a tick's time, and the error of an acceleration by poses. */
	double tick_s, hard_mm_s2;
	long n_paths; /* gone along so far */
};

/* Paths of the thread, while a bound is computed. */
static __thread struct paths *paths;

/* Room for one computation; end_paths() frees it. Returns false: no memory. */
static inline bool begin_paths(void)
{
	paths = (struct paths *)calloc(1, sizeof(*paths));
	if (!paths)
		return false;
	paths->of[0].bits = -1;
	paths->n = 1;
	return true;
}

/* Returns the bound, infinite without one. */
static inline double end_paths(double bound)
{
	if (paths->failed || !(bound >= 0))
		bound = INFINITY;
	free(paths);
	paths = NULL;
	return bound;
}

/* Nothing is bounded. */
static inline void fail(const char *why)
{
	paths->failed = why;
}

static inline uint32_t put(const struct bounds &of)
{
	if (paths->n == BOUNDS_MOST) {
		fail("more numbers than there are places");
		paths->n = 1;
	}
	paths->of[paths->n] = of;
	return paths->n++;
}

/* A number that this path knows more of. */
static inline struct bounds &narrowed(uint32_t id)
{
	if (paths->n_narrowed == NARROWED_MOST) {
		fail("more numbers than there are places");
		paths->n_narrowed = 0;
	}
	paths->before[paths->n_narrowed++] = {id, paths->of[id]};
	return paths->of[id];
}

/* Any of so many ways; each path takes another one. */
static inline int choose(int ways)
{
	if (paths->dead)
		return 0;
	if (paths->at == CHOICES_MOST) {
		fail("more choices than there are places");
		return 0;
	}
	if (paths->at == paths->n_chosen) {
		paths->chosen[paths->at] = 0;
		paths->ways[paths->n_chosen++] = (uint8_t)ways;
	}
	return paths->chosen[paths->at++];
}

/*
 * The paths from here on. The paths of a part of a tick are joined at its end, so that their number adds to the
 * number of the others, and does not multiply it.
 *
 *   fork.begin(); do { ... } while (fork.next());
 */
struct fork {
	uint32_t n, n_narrowed;
	int at, first;
	bool alive;

	void begin()
	{
		n = paths->n;
		n_narrowed = paths->n_narrowed;
		at = paths->at;
		/* Behind all that the tick's path has chosen, also after this part. */
		first = paths->at = paths->n_chosen;
		alive = false;
	}

	/* Return to their begin, for the next path. Returns false after the last one. */
	bool next()
	{
		int last = paths->n_chosen;

		alive |= !paths->dead;
		paths->n_paths++;
		while (last > first &&
		       paths->chosen[last - 1] + 1 == paths->ways[last - 1])
			last--;
		while (paths->n_narrowed > n_narrowed) {
			paths->n_narrowed--;
			paths->of[paths->before[paths->n_narrowed].id] =
				paths->before[paths->n_narrowed].of;
		}
		paths->n = n;
		if (paths->n_paths > PATHS_MOST)
			fail("more paths than there is time for");
		if (last == first || paths->failed) {
			paths->dead = !alive;
			paths->at = at;
			paths->n_chosen = first;
			return false;
		}
		paths->chosen[last - 1]++;
		paths->n_chosen = last;
		paths->at = first;
		paths->dead = false;
		return true;
	}
};

static inline double lsb(int bits)
{
	return ldexp(1, -bits);
}

/* A constant, with its rounding. */
static inline uint32_t constant(double value, int bits)
{
	double whole = rint(ldexp(value, bits));

	if (!(value < 0) && !(value > 0))
		return 0;
	return put({value, value, 0, fabs(ldexp(whole, -bits) - value), bits, false});
}

struct bounded_wide;

template <int Bits> struct bounded {
	uint32_t id;

	bounded() = default;
	bounded(int value) : id(constant(value, Bits))
	{
	}
	static bounded of(uint32_t id)
	{
		bounded a;

		a.id = id;
		return a;
	}
};

struct bounded_wide {
	uint32_t id;

	bounded_wide() = default;
	/* Only 0, which has each scale, or a factor. */
	bounded_wide(int value) : id(constant(value, 0))
	{
	}
	template <int Bits> bounded_wide(bounded<Bits> a) : id(a.id)
	{
	}
	static bounded_wide of(uint32_t id)
	{
		bounded_wide a(0);

		a.id = id;
		return a;
	}
};

/* --- the kind; see fixed_kind.h --- */

#define T(name) incise_bounded_##name

#define num bounded<16>
#define dir bounded<30>
#define num12 bounded<12>
#define num20 bounded<20>
#define num24 bounded<24>
#define num28 bounded<28>
#define wide bounded_wide
#define stored num
#define span double
#define period double
#define CUTS 1
#define OWNED
#define T_PART(state, part) (&(state)->part)
/* A number along all paths to it; the state's errors cover its other numbers on them. */
#define T_JOINED(state, of) joined(state, [&] { return of; })
#define T_OWN_SURFACE

static inline struct bounds &at(uint32_t id)
{
	return paths->of[id];
}

static inline double most_of(const struct bounds &a)
{
	return fmax(fabs(a.low), fabs(a.high));
}

static inline double off(const struct bounds &a)
{
	return a.in + a.own;
}

static inline double sqrt3(void)
{
	return 1.7320508075688774;
}

/* Rounding to so many bits, of a number or of all three of a vector. */
static inline double rounding(int bits, bool ball)
{
	return (ball ? sqrt3() : 1) * lsb(bits + 1);
}

/* --- sums, products, quotients --- */

static inline uint32_t sum(uint32_t ia, uint32_t ib, int sign)
{
	struct bounds a = at(ia), b = at(ib), to;

	if (!ib)
		return ia;
	if (a.bits >= 0 && b.bits >= 0 && a.bits != b.bits)
		fail("two scales in a sum");
	to = {a.low + (sign > 0 ? b.low : -b.high),
	      a.high + (sign > 0 ? b.high : -b.low),
	      a.in + b.in,
	      a.own + b.own,
	      b.bits,
	      a.ball || b.ball};
	if (to.ball) {
		to.high = most_of(a) + most_of(b);
		to.low = -to.high;
	}
	return put(to);
}

static inline uint32_t product(uint32_t ia, uint32_t ib, int bits)
{
	struct bounds a = at(ia), b = at(ib), to;
	double A = most_of(a), B = most_of(b);
	bool ball = a.ball || b.ball;

	if (!ia || !ib)
		return 0;
	to = {fmin(fmin(a.low * b.low, a.low * b.high),
		   fmin(a.high * b.low, a.high * b.high)),
	      fmax(fmax(a.low * b.low, a.low * b.high),
		   fmax(a.high * b.low, a.high * b.high)),
	      A * b.in + B * a.in + a.in * b.in,
	      A * b.own + B * a.own + a.in * b.own + a.own * off(b),
	      bits,
	      ball};
	if (ball) {
		to.high = A * B;
		to.low = -to.high;
	}
	if (bits < a.bits + b.bits)
		to.own += rounding(bits, ball);
	return put(to);
}

/* The number at another scale. */
static inline uint32_t scaled(uint32_t ia, int bits)
{
	struct bounds to = at(ia);

	if (!ia)
		return 0;
	if (bits < to.bits)
		to.own += rounding(bits, to.ball);
	to.bits = bits;
	return put(to);
}

static inline uint32_t negative(uint32_t ia)
{
	struct bounds a = at(ia);

	return ia ? put({-a.high, -a.low, a.in, a.own, a.bits, a.ball}) : 0;
}

/* --- decisions --- */

static inline bool below(uint32_t ia, uint32_t ib)
{
	struct bounds a = at(ia), b = at(ib);
	double slack = off(a) + off(b);
	bool is;

	/* A number is not below itself; and where both kinds are, they are. */
	if (ia == ib || (a.low >= b.high && a.low - b.high >= slack))
		return false;
	if (a.high < b.low && b.low - a.high > slack)
		return true;
	is = !choose(2);
	/* Either of the two kinds may have gone this way. */
	if (is) {
		a.high = fmin(a.high, b.high + slack);
		b.low = fmax(b.low, a.low - slack);
	} else {
		a.low = fmax(a.low, b.low - slack);
		b.high = fmin(b.high, a.high + slack);
	}
	if (ia && !a.ball)
		narrowed(ia) = a;
	if (ib && !b.ball)
		narrowed(ib) = b;
	paths->dead |= at(ia).low > at(ia).high || at(ib).low > at(ib).high;
	return is;
}

/* --- paths that are joined --- */

/* The largest errors of a number along all paths. */
struct worst {
	double low, high, in, own, both;
};

static inline void take(struct worst *worst, uint32_t id)
{
	struct bounds of = at(id);

	/* 0/0 and 0 ∞ say nothing. */
	if (isnan(of.in) || isnan(of.own))
		of.in = of.own = INFINITY;
	worst->low = fmin(worst->low, of.low);
	worst->high = fmax(worst->high, of.high);
	worst->in = fmax(worst->in, of.in);
	worst->own = fmax(worst->own, of.own);
	worst->both = fmax(worst->both, off(of));
}

static inline num worst_of(const struct worst &of)
{
	return num::of(put({of.low, of.high, of.in, of.own, 16, false}));
}

/* The number that a part of a tick makes, along all of its paths; the state is as it was. */
template <typename state, typename part> static num joined(state *of, const part &run)
{
	const state from = *of;
	struct worst worst = {};
	struct fork fork;

	fork.begin();
	do {
		num to;

		*of = from;
		to = run();
		if (!paths->dead)
			take(&worst, to.id);
	} while (fork.next());
	*of = from;
	return worst_of(worst);
}

/* --- parts of a size --- */

/* A size ≥ 0 by parts, each up to this times as large, down to its error: narrowed to one of them. */
#define PART 1.25

static inline double part_of(uint32_t ia)
{
	struct bounds a = at(ia);
	double least = fmax(off(a), 1e-12), high = fmax(most_of(a), least);
	int n = (int)fmin(ceil(log(high / least) / log(PART)), 250), i = choose(n + 1);
	double low = i == n ? 0 : high / pow(PART, i + 1);

	a.high = i == n ? least : high / pow(PART, i);
	a.low = a.ball ? -a.high : fmax(a.low, low);
	narrowed(ia) = a;
	return low;
}

/* --- numbers --- */

#define N(p) num::of(constant(p, 16))
#define N_OF(p, q) num::of(constant((double)(p) / (q), 16))
#define D_OF(p, q) dir::of(constant((double)(p) / (q), 30))
#define D_ONE dir::of(constant(1, 30))
#define HALF_PI num::of(constant(M_PI / 2, 16))
#define LEAST num::of(put({0, 0, 0, lsb(16), 16, false})) /* 0 of doubles */
#define FAR_MOST num::of(put({32767, 1e9, 0, 0, 16, false}))
#define CREEP num::of(put({0, 0, 0, 2 * lsb(16), 16, false}))
#define DT_MOST INT64_MAX

static inline num n_add(num a, num b)
{
	return num::of(sum(a.id, b.id, 1));
}

static inline num n_sub(num a, num b)
{
	return num::of(a.id || !b.id ? sum(a.id, b.id, -1) : negative(b.id));
}

static inline num n_neg(num a)
{
	return num::of(negative(a.id));
}

static inline num operator-(num a)
{
	return n_neg(a);
}

static inline dir operator-(dir a)
{
	return dir::of(negative(a.id));
}

static inline uint32_t size_of(uint32_t ia)
{
	struct bounds a = at(ia);

	if (!ia || (!a.ball && a.low >= 0))
		return ia;
	return put({a.ball || a.high >= 0 ? 0 : -a.high, most_of(a), a.in, a.own, a.bits,
		    false});
}

static inline num n_abs(num a)
{
	return num::of(size_of(a.id));
}

static inline num n_half(num a)
{
	struct bounds of = at(a.id);

	return num::of(put(
		{of.low / 2, of.high / 2, of.in / 2, of.own / 2 + lsb(17), 16, of.ball}));
}

static inline num n_times(num a, num b)
{
	return num::of(product(a.id, b.id, 16));
}

/* b > 0 */
static inline num n_over(num a, num b)
{
	double low = at(b.id).low > 0 ? at(b.id).low : part_of(b.id);
	struct bounds x = at(a.id), y = at(b.id);
	/* The integers' divisor is as near to 0 as this. */
	double least = fmax(low - off(y), 0), most = most_of(x) / low;

	if (!a.id)
		return 0;
	return num::of(put({x.low < 0 ? x.low / low : x.low / y.high,
			    x.high < 0 ? x.high / y.high : x.high / low,
			    (x.in + most * y.in) / least,
			    (x.own + most * y.own) / least + lsb(17), 16, false}));
}

static inline bool n_below(num a, num b)
{
	return below(a.id, b.id);
}

static inline bool d_below(dir a, dir b)
{
	return below(a.id, b.id);
}

static inline num n_min(num a, num b)
{
	return n_below(a, b) ? a : b;
}

static inline num n_max(num a, num b)
{
	return n_below(a, b) ? b : a;
}

/* Between two numbers it is off by no more than they are apart. */
static inline num n_within(num v, num least, num most)
{
	double wide_open = at(most.id).high - at(least.id).low;

	if (n_below(most, v))
		return most;
	if (n_below(v, least))
		return least;
	if (off(at(v.id)) > wide_open)
		return num::of(put(
			{at(least.id).low, at(most.id).high, wide_open, 0, 16, false}));
	return v;
}

/* A number between places in a cut, which are not looked at here. */
static inline num n_between(num a, num, num, num)
{
	fail("unbounded");
	return a;
}

static inline int64_t n_cell(num, num)
{
	fail("unbounded");
	return 0;
}

static inline num n_multiple(int64_t times, num size)
{
	return n_times(N((double)times), size);
}

static inline num n_keep(num a)
{
	return a;
}

static inline num n_damp(num a, num28 damping, num speed)
{
	return n_sub(a, num::of(product(damping.id, speed.id, 16)));
}

static inline num n_share_of(dir a)
{
	struct bounds of = at(size_of(a.id));

	return num::of(put(
		{fmin(of.low, 1), fmin(of.high, 1), of.in, of.own + lsb(17), 16, false}));
}

/* --- vectors: all parts are one ball, and so is what a loop makes of each of them --- */

static inline bool alike(const struct bounds &a, const struct bounds &b)
{
	return a.ball && b.ball && fabs(a.high - b.high) <= 0 && fabs(a.in - b.in) <= 0 &&
	       fabs(a.own - b.own) <= 0;
}

template <typename part> static inline uint32_t ball_of(const part *a, int n = 3)
{
	struct bounds to = {0, 0, 0, 0, -1, true};
	bool same = true;

	for (int i = 0; i < n; i++) {
		const struct bounds &of = at(a[i].id);

		same = same && alike(of, at(a[0].id));
		to.high = hypot(to.high, most_of(of));
		to.in = hypot(to.in, of.in);
		to.own = hypot(to.own, of.own);
		to.bits = of.bits > to.bits ? of.bits : to.bits;
	}
	to.low = -to.high;
	if (to.bits < 0)
		return 0;
	return same ? a[0].id : put(to);
}

template <typename part> static inline void set_ball(part *to, uint32_t id, int n = 3)
{
	for (int i = 0; i < n; i++)
		to[i] = part::of(id);
}

static inline uint32_t ball(double most, double in, double own, int bits)
{
	return put({-most, most, in, own, bits, true});
}

/* A scalar product. */
static inline uint32_t along(uint32_t a, uint32_t b, int bits)
{
	struct bounds of = at(product(a, b, 64));

	return put({of.low, of.high, of.in, of.own + lsb(bits + 1), bits, false});
}

/* A vector of length 1, from a vector longer than @least; by twice the difference over both lengths. */
static inline uint32_t unit_of(uint32_t ia, double least)
{
	struct bounds a = at(ia);
	double both = fmax(least - off(a) / 2, 0);

	return ball(1, both > 0 ? fmin(a.in / both, 2) : 2,
		    (both > 0 ? fmin(a.own / both, 2) : 0) + sqrt3() * lsb(30), 30);
}

static inline void d_copy(dir to[3], const dir a[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = a[i];
}

static inline dir d_abs(dir a)
{
	return dir::of(size_of(a.id));
}

static inline dir d_dot(const dir u[3], const dir v[3])
{
	return dir::of(along(ball_of(u), ball_of(v), 30));
}

static inline void d_cross(dir to[3], const dir u[3], const dir v[3])
{
	set_ball(to, product(ball_of(u), ball_of(v), 30));
}

/*
 * u + 2 s v × u + 2 v × (v × u) of q = (s, v): by 2 (|Δs| |v| + |s| |Δv| + 2 |v| |Δv|) |u|, which is at most
 * 2 √5 |Δq| |u|, as q may be no unit, and its squares; t, of which no more than its length counts, and two sums
 * round.
 */
#define TURN 4.5
#define TURN2 2.5

static inline uint32_t turned(uint32_t q, uint32_t u, int bits)
{
	struct bounds by = at(q), of = at(u);
	double most = most_of(of) + of.in;

	if (!u)
		return 0;
	of.own += most * (TURN * by.own + TURN2 * by.own * (by.own + 2 * by.in)) +
		  of.own * (TURN * off(by) + TURN2 * off(by) * off(by)) +
		  3 * rounding(bits, true);
	of.in += most * by.in * (TURN + TURN2 * by.in);
	return ball(most_of(of), of.in, of.own, bits);
}

static inline void d_turn(dir to[3], const dir q[4], const dir u[3])
{
	set_ball(to, turned(ball_of(q, 4), ball_of(u), 30));
}

/* The direction of a blade in the skin: it stands at 30° in it, or more. */
static inline bool d_unit(dir to[3], const dir a[3], dir)
{
	set_ball(to, unit_of(ball_of(a), STANDS));
	return true;
}

/* A mean of two on the shorter way: of no less than 1/√2. */
static inline bool d_unit4(dir to[4], const wide q[4])
{
	set_ball(to, unit_of(ball_of(q, 4), sqrt(0.5)), 4);
	return true;
}

/* The mean of normals that differ by no more than 60° from it. */
static inline bool d_mean(dir to[3], const wide sum[3])
{
	uint32_t id = ball_of(sum);

	set_ball(to, unit_of(id, most_of(at(id)) / 2));
	return true;
}

static inline bool d_attitude(dir to[4], const dir q[4])
{
	set_ball(to, unit_of(ball_of(q, 4), 0.9), 4);
	return true;
}

static inline void v_copy(num to[3], const num a[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = a[i];
}

static inline void v_sub(num to[3], const num a[3], const num b[3])
{
	set_ball(to, sum(ball_of(a), ball_of(b), -1));
}

static inline void v_add(num to[3], const num a[3], num size, const dir unit[3])
{
	uint32_t push = product(size.id, ball_of(unit), 16);

	if (push)
		set_ball(to, sum(ball_of(a), push, 1));
	else
		v_copy(to, a);
}

static inline void v_pull(num to[3], const num a[3], num stiffness, const num b[3])
{
	uint32_t pull = product(stiffness.id, ball_of(b), 16);

	if (pull)
		set_ball(to, sum(ball_of(a), pull, -1));
	else
		v_copy(to, a);
}

static inline num v_along(const num a[3], const dir unit[3])
{
	return num::of(along(ball_of(a), ball_of(unit), 16));
}

/* A vector without its part along a direction is not longer. */
static inline void v_across(num to[3], const num a[3], const dir unit[3])
{
	struct bounds of = at(ball_of(a)), by = at(ball_of(unit));
	double most = most_of(of);

	set_ball(to, ball(most, of.in + most * by.in * (2 + by.in),
			  of.own + most * by.own * (2 + by.own + 2 * by.in) +
				  2 * rounding(16, true),
			  16));
}

static inline num v_length(const num a[3])
{
	struct bounds of = at(ball_of(a));

	return num::of(put({0, of.high, of.in, of.own + lsb(17), 16, false}));
}

static inline bool v_is_short(const num a[3], num most)
{
	return !n_below(most, v_length(a));
}

static inline bool v_is_zero(const num[3])
{
	return choose(2);
}

static inline bool v_is_number(const num[3])
{
	return true;
}

static inline void v_reach(num to[3], const num from[3], const dir q[4], const num arm[3])
{
	set_ball(to, sum(ball_of(from), turned(ball_of(q, 4), ball_of(arm), 16), 1));
}

static inline bool v_direction(dir to[3], const num a[3])
{
	uint32_t id = ball_of(a);
	double low = part_of(id);

	set_ball(to, unit_of(id, low));
	return low > 0 || !choose(2);
}

/* --- wide ones --- */

#define W_ONE wide::of(constant(1, 30))
#define W_MM wide::of(constant(1, 32))
#define W_MM_S wide::of(constant(1, 20))
#define W_MM_S2 wide::of(constant(1, 16))
#define W_MISS_MM wide::of(constant(1, 24))
#define W_SHARE wide::of(constant(1, 26))

static inline wide operator+(wide a, wide b)
{
	return wide::of(sum(a.id, b.id, 1));
}

static inline wide operator-(wide a, wide b)
{
	return wide::of(a.id || !b.id ? sum(a.id, b.id, -1) : negative(b.id));
}

static inline wide operator-(wide a)
{
	return wide::of(negative(a.id));
}

static inline wide operator*(wide a, wide b)
{
	return wide::of(product(a.id, b.id, at(a.id).bits + at(b.id).bits));
}

/* The limit divides so; no bound asks for it. */
static inline wide operator/(wide a, int)
{
	fail("unbounded");
	return a;
}

static inline wide &operator+=(wide &a, wide b)
{
	return a = a + b;
}

static inline wide &operator-=(wide &a, wide b)
{
	return a = a - b;
}

static inline bool operator<(wide a, wide b)
{
	return below(a.id, b.id);
}

static inline bool operator>(wide a, wide b)
{
	return below(b.id, a.id);
}

static inline bool operator<=(wide a, wide b)
{
	return !below(b.id, a.id);
}

static inline wide w_of(num a)
{
	return a;
}

static inline num n_of(wide a)
{
	return num::of(scaled(a.id, 16));
}

static inline wide w_min(wide a, wide b)
{
	return a < b ? a : b;
}

static inline wide w_half(wide a)
{
	struct bounds of = at(a.id);

	if (!a.id)
		return a;
	return wide::of(put({of.low / 2, of.high / 2, of.in / 2,
			     of.own / 2 + rounding(of.bits, of.ball), of.bits, of.ball}));
}

/* It is no farther off than before. */
static inline wide w_within(wide v, wide least, wide most)
{
	struct bounds of = at(v.id);

	of.low = fmin(fmax(of.low, at(least.id).low), at(most.id).high);
	of.high = fmax(fmin(of.high, at(most.id).high), at(least.id).low);
	return wide::of(put(of));
}

static inline wide w_times(wide a, wide b, int shift)
{
	return wide::of(product(a.id, b.id, at(a.id).bits + at(b.id).bits - shift));
}

static inline wide w_shifted(wide a, int shift)
{
	return wide::of(scaled(a.id, at(a.id).bits - shift));
}

/* Up to this time. */
static inline wide w_seconds(int64_t ns)
{
	return wide::of(put({0, (double)ns * 1e-9, 0, 1.5 * lsb(30), 30, false}));
}

/* The share left at any time of a period; no share is the limit of a small share. */
static inline wide w_left(int64_t, span period_ns)
{
	return wide::of(put({2 * lsb(26), 1, 0, lsb(26) + 1 / period_ns, 26, false}));
}

static inline wide w_place(num a)
{
	return wide::of(scaled(a.id, 32));
}

static inline num n_place(wide x)
{
	return num::of(scaled(x.id, 16));
}

static inline num n_speed(wide v)
{
	return num::of(scaled(v.id, 16));
}

/* A hand does not jump: it is so near, mm, to where the filter expects it. */
#define MISS_MM 2

static inline bool w_is_near(const wide miss[3], wide)
{
	struct bounds of = at(ball_of(miss));

	of.high = fmin(of.high, MISS_MM);
	of.low = -of.high;
	for (int i = 0; i < 3; i++)
		narrowed(miss[i].id) = of;
	return true;
}

/* Work there is enough: an advance that is short of it is not in the bound. */
static inline wide w_work(wide work2, num, num, num)
{
	return work2;
}

static inline num w_paid(num, wide, wide)
{
	return FAR_MOST;
}

static inline wide w_taken(wide work2, const num *, const num *, const num *)
{
	return work2;
}

static inline num w_stored(num, wide)
{
	return FAR_MOST;
}

/* A bound is of forces before start and limit. */
static inline wide w_ramp(int64_t, double)
{
	fail("unbounded");
	return W_ONE;
}

static inline num w_scale(wide, num a)
{
	fail("unbounded");
	return a;
}

static inline bool v_shorten(wide[3], num)
{
	fail("unbounded");
	return false;
}

#endif
