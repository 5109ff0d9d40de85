// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/signal/wall.c and wall_follow.c on simulated machines, whose clocks and sources
 * are made here of a true time that the code under test never sees:
 *
 *     truth ─► oscillator: rate + wander ─► RAW ─┬─► MONOTONIC = RAW + slews, stands in suspends
 *                                                └─► REALTIME  = MONOTONIC + steps
 *           └► source: REALTIME less UTC, with noise below the bound that it states
 */
#include "../unit.h"
#include <incise/wall.h>
#include "../../../lib/base/random.h"
#include "../../../lib/signal/wall_follow.h"

#define S 1000000000LL
#define EPOCH (1800000000LL * S) /* TAI of the simulated start */
#define SECONDS 240
#define NONE -1

/* --- a simulated machine ---------------------------------------------------------------- */

struct machine {
	uint64_t random;
	double now_s;		      /* true time since the start */
	double raw_s, mono_s, boot_s; /* since the machine's own zero */
	double real_less_mono_s;
	double rate;	/* of the oscillator, less 1 */
	double slew;	/* of the program that sets the clock */
	double error_s; /* of the source, at this measurement */
	double bound_s; /* that it states */
	int64_t updated;
	/* what happens, in s of true time; NONE */
	double lost_s, found_s, step_s, step_by_s, suspend_s, suspend_for_s;
	double slew_from_s, slew_to_s;
	double offset_at_update_s; /* REALTIME less UTC, as the source measured it */
};

static double uniform(struct machine *m, double low, double high)
{
	return low + (high - low) * (incise_random_symmetric(&m->random) + 1) / 2;
}

static const double tai_less_utc_s = 37;

static double true_tai_s(const struct machine *m)
{
	return m->now_s;
}

/* REALTIME counts from the epoch of the test, as all here. */
static double real_s(const struct machine *m)
{
	return m->mono_s + m->real_less_mono_s;
}

static void measure(struct machine *m)
{
	m->error_s = uniform(m, -m->bound_s, m->bound_s) * 0.9;
	m->offset_at_update_s = real_s(m) - (true_tai_s(m) - tai_less_utc_s) + m->error_s;
	m->updated++;
}

static void init(struct machine *m, uint64_t seed, double ppm, double off_s)
{
	*m = (struct machine){.bound_s = 20e-6,
			      .random = seed,
			      .rate = ppm * 1e-6,
			      .lost_s = NONE,
			      .found_s = NONE,
			      .step_s = NONE,
			      .suspend_s = NONE,
			      .slew_from_s = NONE,
			      .slew_to_s = NONE};
	m->raw_s = uniform(m, 10, 1e5);
	m->mono_s = m->raw_s + uniform(m, -5, 5);
	m->boot_s = m->mono_s + uniform(m, 0, 1000);
	m->real_less_mono_s = -tai_less_utc_s + off_s - m->mono_s;
	measure(m);
}

/* Advance by a short time: 1 ms, in which all rates are constant. */
static void advance(struct machine *m, double dt_s)
{
	bool slews = m->slew_from_s != NONE && m->now_s >= m->slew_from_s &&
		     m->now_s < m->slew_to_s;
	/* wander: 0.1 ppm over a minute */
	double rate = m->rate + 1e-7 * sin(m->now_s / 10);

	if (m->suspend_s != NONE && m->now_s >= m->suspend_s) {
		/* Its length is known to the kernel within some tenths of a second. */
		double known_s = m->suspend_for_s + uniform(m, -0.4, 0.4);

		m->now_s += m->suspend_for_s;
		m->boot_s += known_s;
		m->real_less_mono_s += known_s;
		m->suspend_s = NONE;
	}
	if (m->step_s != NONE && m->now_s >= m->step_s) {
		m->real_less_mono_s += m->step_by_s;
		m->step_s = NONE;
	}
	m->now_s += dt_s;
	m->raw_s += dt_s * (1 + rate);
	m->mono_s += dt_s * (1 + rate) * (1 + (slews ? m->slew : 0));
	m->boot_s += dt_s * (1 + rate) * (1 + (slews ? m->slew : 0));
	m->offset_at_update_s += dt_s * (1 + rate) * (1 + (slews ? m->slew : 0)) - dt_s;
}

static int64_t ns(double s)
{
	return llrint(s * 1e9);
}

static void read_clocks(struct machine *m, struct incise_wall_clocks *clocks)
{
	*clocks = (struct incise_wall_clocks){
		.mono_ns = ns(m->mono_s),
		.raw_ns = ns(m->raw_s),
		.boot_ns = ns(m->boot_s),
		.real_ns = EPOCH + ns(real_s(m)) + ns(uniform(m, -1e-7, 1e-7)),
		.half_ns = 200,
		.utc_offset_s = (int)tai_less_utc_s,
		.leap = "kernel",
	};
}

/*
 * The source states its offset as of its last measurement. It knows the rate, and slews since
 * then are its own, so that it accounts for them; it knows nothing of steps by others.
 */
static void read_source(struct machine *m, const struct incise_wall_clocks *clocks,
			struct incise_wall_reading *readings)
{
	bool lost = m->lost_s != NONE && m->now_s >= m->lost_s && m->now_s < m->found_s;

	readings[0] = (struct incise_wall_reading){
		.good = !lost,
		.source = "ptp",
		.reference = "TAI",
		.tai_ns = clocks->real_ns + ns(tai_less_utc_s - m->offset_at_update_s),
		/* the wander since the measurement, and the reading */
		.bound_ns = m->bound_s * 1e9 + 1000,
		.rate_uncertainty_ppb = 1000,
		.utc_offset_s = (int)tai_less_utc_s,
		.leap = "ptp",
		.updated = m->updated,
	};
	readings[1] = (struct incise_wall_reading){
		.good = true,
		.source = "plain",
		.reference = "TAI",
		.tai_ns = clocks->real_ns + ns(tai_less_utc_s),
		.bound_ns = INFINITY,
		.utc_offset_s = (int)tai_less_utc_s,
		.leap = "kernel",
	};
	if (!lost)
		measure(m);
}

/* --- a recording of it -------------------------------------------------------------------- */

#define EVENTS 200

struct recorded {
	struct incise_wall *wall;
	struct incise_wall_point points[2 * SECONDS];
	size_t n;
	int n_events;
	char events[100][160];
	/* true time and CLOCK_MONOTONIC of the same moment */
	double event_s[EVENTS];
	int64_t event_ns[EVENTS];
};

/* @event_s: true times in increasing order. */
static void record(struct machine *m, const double *event_s, struct recorded *out)
{
	struct incise_wall_follow follow = {0};
	double next_s = 0;
	int event = 0;

	out->n = 0;
	out->n_events = 0;
	while (m->now_s < SECONDS) {
		struct incise_wall_reading readings[2];
		struct incise_wall_clocks clocks;
		struct incise_wall_result result;

		while (event < EVENTS && event_s[event] <= m->now_s) {
			out->event_s[event] = m->now_s;
			out->event_ns[event++] = ns(m->mono_s);
		}
		if (m->mono_s >= next_s) {
			read_clocks(m, &clocks);
			read_source(m, &clocks, readings);
			incise_wall_follow(&follow, &clocks, readings, 2, &result);
			out->points[out->n++] = result.point;
			for (int i = 0; i < result.n_events && out->n_events < 100; i++)
				strcpy(out->events[out->n_events++], result.events[i]);
			next_s = m->mono_s + 1;
		}
		advance(m, 1e-3);
	}
	for (; event < EVENTS; event++) {
		out->event_s[event] = m->now_s;
		out->event_ns[event] = ns(m->mono_s);
	}
	out->wall = incise_wall_new(out->points, out->n);
	assert_non_null(out->wall);
}

static bool has_event(const struct recorded *r, const char *text)
{
	for (int i = 0; i < r->n_events; i++)
		if (strstr(r->events[i], text))
			return true;
	return false;
}

/* Largest uncertainty, and number of those below 0.1 ms; fails where the truth is outside of one. */
static int64_t check_truth(const struct recorded *r, uint64_t seed, int *small)
{
	int64_t largest = 0;

	*small = 0;

	for (int i = 0; i < EVENTS; i++) {
		int64_t truth = EPOCH + ns(r->event_s[i]), tai, u, back, back_u;

		assert_int_equal(incise_wall_tai(r->wall, r->event_ns[i], &tai, &u), 0);
		/* to the rounding of the doubles of this test */
		if (llabs(tai - truth) > u + 1000)
			fail_msg("run %llu: at %.3f s TAI is wrong by %lld ns, stated "
				 "%lld",
				 (unsigned long long)seed, r->event_s[i],
				 (long long)(tai - truth), (long long)u);
		assert_int_equal(incise_wall_monotonic(r->wall, truth, &back, &back_u),
				 0);
		if (llabs(back - r->event_ns[i]) > back_u + 1000)
			fail_msg("run %llu: at %.3f s the inverse is wrong by %lld ns, "
				 "stated %lld",
				 (unsigned long long)seed, r->event_s[i],
				 (long long)(back - r->event_ns[i]), (long long)back_u);
		largest = u > largest ? u : largest;
		*small += u < 100000;
	}
	return largest;
}

/*
 * Two machines 50 ppm and 3 s apart see the same events. The bounds: 20 µs of the source, held for
 * up to 60 s at 10 ppm, 2 s after a suspend of 30 s, which itself is the hull of both parts.
 */
TEST(events_of_two_machines_agree)
{
	for (uint64_t seed = 1; seed <= 100; seed++) {
		static struct recorded a, b;
		double event_s[EVENTS];
		struct machine ma, mb;
		int64_t largest;
		int small;

		init(&ma, seed, 25, 1.5);
		init(&mb, seed + 1000, -25, -1.5);
		for (int i = 0; i < EVENTS; i++)
			event_s[i] =
				SECONDS * (i + 0.5) / EVENTS + uniform(&ma, -0.3, 0.3);
		if (seed % 2) {
			ma.lost_s = uniform(&ma, 20, 60);
			ma.found_s = ma.lost_s + 60;
		}
		if (seed % 3 == 1) {
			mb.step_s = uniform(&mb, 20, 200);
			mb.step_by_s = seed % 2 ? 1 : -1;
		}
		if (seed % 5 == 2) {
			ma.slew = seed % 4 ? 0.08 : -0.08;
			ma.slew_from_s = uniform(&ma, 130, 180);
			ma.slew_to_s = ma.slew_from_s + uniform(&ma, 0.2, 4);
		}
		if (seed % 7 == 3) {
			mb.suspend_s = uniform(&mb, 20, 150);
			mb.suspend_for_s = 30;
		}
		record(&ma, event_s, &a);
		record(&mb, event_s, &b);
		largest = check_truth(&a, seed, &small);
		/* held for 60 s at 10 ppm; a slew within a second moves 80 ms at most */
		assert_true(largest <= (seed % 5 == 2 ? 100000000 : 750000));
		largest = check_truth(&b, seed, &small);
		/* Nothing but the suspend and the second behind it is uncertain. */
		assert_true(small >= EVENTS * 8 / 10);
		assert_true(largest <= (seed % 7 == 3 ? 18 * S : 100000));
		for (int i = 0; i < EVENTS; i++) {
			int64_t at, au, bt, bu;

			/* An event in b's suspend is seen by a alone. */
			if (a.event_s[i] != b.event_s[i])
				continue;
			incise_wall_tai(a.wall, a.event_ns[i], &at, &au);
			incise_wall_tai(b.wall, b.event_ns[i], &bt, &bu);
			assert_true(llabs(at - bt) <= au + bu + 1000);
		}
		assert_int_equal(seed % 2, has_event(&a, "ptp: no valid time"));
		assert_int_equal(seed % 3 == 1, has_event(&b, "stepped by"));
		assert_int_equal(seed % 7 == 3, has_event(&b, "suspended for"));
		incise_wall_free(a.wall);
		incise_wall_free(b.wall);
	}
}

/* --- mappings of given points --------------------------------------------------------------- */

/* At mono_s, TAI less that; within u_ns. */
static struct incise_wall_point point(double mono_s, double tai_s, double u_ns,
				      const char *restart)
{
	struct incise_wall_point p = {.t_ns = ns(mono_s),
				      .tai_ns = EPOCH + ns(mono_s) + ns(tai_s),
				      .uncertainty_ns = u_ns,
				      .rate_uncertainty_ppb = 1000,
				      .utc_offset_s = 37,
				      .source = "kernel",
				      .reference = "TAI",
				      .leap = "list"};

	strcpy(p.restart, restart);
	return p;
}

static void bound_holds(const struct incise_wall *wall, double mono_s, double tai_s,
			int64_t least, int64_t most)
{
	int64_t tai, u;

	assert_int_equal(incise_wall_tai(wall, ns(mono_s), &tai, &u), 0);
	assert_true(llabs(tai - (EPOCH + ns(mono_s) + ns(tai_s))) <= u);
	assert_in_range(u, least, most);
}

/* One of both parts is wrong by 1 s, and nothing says which. */
TEST(step_of_a_synchronised_clock_widens_all)
{
	const struct incise_wall_point points[] = {
		point(0, 0, 5e6, ""),
		point(1, 0, 5e6, ""),
		point(2, 1, 5e6, "step"),
		point(3, 1, 5e6, ""),
	};
	struct incise_wall *wall = incise_wall_new(points, 4);

	for (double s = 0; s <= 3; s += 0.1) {
		/* both are within: 1 s and 5 ms; between the parts half of that more */
		bound_holds(wall, s, 0, 1005000000, 1510000000);
		bound_holds(wall, s, 1, 1005000000, 1510000000);
	}
	incise_wall_free(wall);
}

/* A correction within its bounds contradicts nothing. */
TEST(correction_within_the_bounds_widens_nothing)
{
	const struct incise_wall_point points[] = {
		point(0, 0, 5e6, ""),
		point(1, 0, 5e6, ""),
		point(2, 4e-3, 1e5, "step"),
		point(3, 4e-3, 1e5, ""),
	};
	struct incise_wall *wall = incise_wall_new(points, 4);

	bound_holds(wall, 0.5, 4e-3, 5000000, 5002000);
	bound_holds(wall, 1.5, 4e-3, 4500000, 5002000);
	bound_holds(wall, 2.5, 4e-3, 100000, 102000);
	incise_wall_free(wall);
}

TEST(unknown_and_far_times)
{
	const struct incise_wall_point points[] = {
		point(0, 0, INFINITY, ""),
		point(1, 0, 1000, ""),
		point(2, 0, 1000, ""),
	};
	struct incise_wall *wall = incise_wall_new(points, 3);
	int64_t tai, u;

	assert_int_equal(incise_wall_tai(wall, S / 2, &tai, &u), 0);
	assert_int_equal(u, INCISE_WALL_UNKNOWN);
	assert_int_equal(tai, EPOCH + S / 2);
	bound_holds(wall, 1, 0, 1000, 1001);
	/* 1 ppm from the last point on */
	bound_holds(wall, 12, 0, 11000, 11001);
	assert_int_equal(incise_wall_tai(wall, 62 * S, &tai, &u), 0);
	assert_int_equal(incise_wall_tai(wall, 62 * S + 1, &tai, &u), -ENODATA);
	assert_int_equal(incise_wall_tai(wall, -60 * S - 1, &tai, &u), -ENODATA);
	incise_wall_free(wall);
	assert_null(incise_wall_new(points, 0));
	assert_int_equal(errno, ENODATA);
	assert_null(
		incise_wall_new((struct incise_wall_point[]){points[1], points[0]}, 2));
	assert_int_equal(errno, EINVAL);
}

/* After a step backwards two times have the same TAI. */
TEST(inverse_contains_both_times)
{
	const struct incise_wall_point points[] = {
		point(0, 0, 1000, ""),
		point(2, 0, 1000, ""),
		point(3, -1, INFINITY, "step"),
		point(5, -1, INFINITY, ""),
	};
	struct incise_wall *wall = incise_wall_new(points, 2);
	int64_t t, u;

	assert_int_equal(incise_wall_monotonic(wall, EPOCH + S, &t, &u), 0);
	assert_in_range(t, S - 1, S + 1);
	assert_in_range(u, 1000, 2200); /* 1 µs and the growth of 1 s at 1 ppm */
	incise_wall_free(wall);
	wall = incise_wall_new(points, 4);
	assert_int_equal(incise_wall_monotonic(wall, EPOCH + 5 * S / 2, &t, &u), 0);
	assert_int_equal(u, INCISE_WALL_UNKNOWN);
	incise_wall_free(wall);
}

TEST(text_of_utc)
{
	char text[INCISE_WALL_TEXT];

	incise_wall_utc_text(EPOCH + 37 * S + 5, 37, text);
	assert_string_equal(text, "2027-01-15T08:00:00.000000005Z");
	incise_wall_utc_text(-1, 0, text);
	assert_string_equal(text, "1969-12-31T23:59:59.999999999Z");
}
