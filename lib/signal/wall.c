// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From CLOCK_MONOTONIC to TAI and back; see incise/wall.h.
 *
 *     part 0                        part 1
 *     ●───────●───────●┄┄┄┄┄┄┄┄┄┄┄┄┄●──────●
 *                      hull of both: ↑ restart
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/clock.h>
#include <incise/wall.h>

/* Furthest extrapolation. */
#define BEYOND_NS (60 * INCISE_NS_PER_S)
/* 146 years: times and their differences stay below 2^63. */
#define TIME_MAX (INT64_MAX / 2)
/* A program that sets the clock right does not change its rate by more: chrony's limit is 8 %. */
#define SLEW_MAX 0.1
#define RATE_MAX_PPB 1e8
#define SHORT 0.25
#define UTC_OFFSET_MAX_S 1000

struct incise_wall {
	size_t n;
	struct incise_wall_point *points;
	/* Sum of the restarts that contradict their bounds, ns. */
	double widened_ns;
};

/* An interval of TAI less a base that is near, ns. */
struct interval {
	double low, high;
};

static bool ends_in(const char *text, size_t size)
{
	return memchr(text, 0, size) != NULL;
}

static bool is_valid(const struct incise_wall_point *p)
{
	return p->t_ns >= -TIME_MAX && p->t_ns <= TIME_MAX && p->tai_ns >= -TIME_MAX &&
	       p->tai_ns <= TIME_MAX && p->uncertainty_ns >= 0 &&
	       fabs(p->rate_ppb) <= RATE_MAX_PPB && p->rate_uncertainty_ppb >= 0 &&
	       p->rate_uncertainty_ppb <= RATE_MAX_PPB &&
	       abs(p->utc_offset_s) <= UTC_OFFSET_MAX_S &&
	       ends_in(p->source, sizeof(p->source)) &&
	       ends_in(p->reference, sizeof(p->reference)) &&
	       ends_in(p->leap, sizeof(p->leap)) &&
	       ends_in(p->restart, sizeof(p->restart));
}

/* TAI at @t_ns by one point, less its own, and the growth of the bound since. */
static double advance_wall(const struct incise_wall_point *p, int64_t t_ns)
{
	double s_ns = (double)(t_ns - p->t_ns);

	return s_ns + s_ns * p->rate_ppb * 1e-9;
}

static double growth(const struct incise_wall_point *p, double s_ns)
{
	return fabs(s_ns) * p->rate_uncertainty_ppb * 1e-9;
}

/* Whether the mapping starts again between points i and i + 1. */
static bool restarts(const struct incise_wall *wall, size_t i)
{
	return *wall->points[i + 1].restart != 0;
}

/*
 * A suspend moves the mapping by the time that it took, which contradicts nothing. Where the
 * reference differs, the two parts cannot be compared.
 */
static double contradiction(const struct incise_wall_point *a,
			    const struct incise_wall_point *b)
{
	double jump_ns = (double)(b->tai_ns - a->tai_ns) - advance_wall(a, b->t_ns);
	double bound_ns = a->uncertainty_ns + growth(a, (double)(b->t_ns - a->t_ns)) +
			  b->uncertainty_ns;

	if (!*b->restart || !strcmp(b->restart, "suspend") ||
	    strcmp(a->reference, b->reference) != 0)
		return 0;
	return fabs(jump_ns) > bound_ns ? fabs(jump_ns) : 0;
}

struct incise_wall *incise_wall_new(const struct incise_wall_point *points, size_t n)
{
	struct incise_wall *wall;

	if (!n) {
		errno = ENODATA;
		return NULL;
	}
	for (size_t i = 0; i < n; i++)
		if (!is_valid(&points[i]) ||
		    (i && points[i].t_ns <= points[i - 1].t_ns)) {
			errno = EINVAL;
			return NULL;
		}
	wall = calloc(1, sizeof(*wall));
	if (wall)
		wall->points = calloc(n, sizeof(*points));
	if (!wall || !wall->points) {
		free(wall);
		errno = ENOMEM;
		return NULL;
	}
	memcpy(wall->points, points, n * sizeof(*points));
	wall->n = n;
	for (size_t i = 0; i + 1 < n; i++)
		wall->widened_ns += contradiction(&points[i], &points[i + 1]);
	return wall;
}

void incise_wall_free(struct incise_wall *wall)
{
	if (!wall)
		return;
	free(wall->points);
	free(wall);
}

size_t incise_wall_points(const struct incise_wall *wall,
			  const struct incise_wall_point **points)
{
	*points = wall->points;
	return wall->n;
}

/* --- intervals ------------------------------------------------------------------------ */

/* Mean rate between points i and i + 1, less 1; that of the first one where they are parted. */
static double rate_of(const struct incise_wall *wall, size_t i)
{
	const struct incise_wall_point *a = &wall->points[i], *b = a + 1;

	return restarts(wall, i)
		       ? a->rate_ppb * 1e-9
		       : (double)((b->tai_ns - a->tai_ns) - (b->t_ns - a->t_ns)) /
				 (double)(b->t_ns - a->t_ns);
}

/*
 * CLOCK_MONOTONIC is slewed with the clock that is set right, at any moment between two points:
 *
 *     ●───────╲                the largest distance from the chord is that by which the
 *              ╲───────●       mean rate differs from the rates on both sides
 */
static double kink(const struct incise_wall *wall, size_t i)
{
	const struct incise_wall_point *a = &wall->points[i], *b = a + 1;
	double span_ns = (double)(b->t_ns - a->t_ns), here = rate_of(wall, i);
	double before = a->rate_ppb * 1e-9, after = b->rate_ppb * 1e-9;

	/* The rate over a short time, as before the end of a recording, is mostly noise. */
	if (i && !*a->restart && (double)(a->t_ns - a[-1].t_ns) > span_ns * SHORT)
		before = rate_of(wall, i - 1);
	if (i + 2 < wall->n && !restarts(wall, i + 1) &&
	    (double)(b[1].t_ns - b->t_ns) > span_ns * SHORT)
		after = rate_of(wall, i + 1);

	return fmax(fabs(here - before), fabs(here - after)) * span_ns;
}

/* TAI at @t_ns as point @i gives it, relative to @base_ns. */
static struct interval by_point(const struct incise_wall *wall, size_t i, int64_t t_ns,
				int64_t base_ns)
{
	const struct incise_wall_point *p = &wall->points[i];
	double tai = (double)(p->tai_ns - base_ns) + advance_wall(p, t_ns);
	double u = p->uncertainty_ns + growth(p, (double)(t_ns - p->t_ns)) +
		   wall->widened_ns;

	return (struct interval){tai - u, tai + u};
}

/* Interpolated between points i and i + 1 of one part. */
static struct interval between_wall(const struct incise_wall *wall, size_t i,
				    int64_t t_ns, int64_t base_ns)
{
	const struct incise_wall_point *a = &wall->points[i], *b = a + 1;
	double span_ns = (double)(b->t_ns - a->t_ns);
	double s_ns = (double)(t_ns - a->t_ns), left_ns = span_ns - s_ns;
	double share = s_ns / span_ns;
	double tai = (double)(a->tai_ns - base_ns) + s_ns + s_ns * rate_of(wall, i);
	double u = fmin(growth(a, s_ns), growth(b, left_ns)) + wall->widened_ns +
		   fmin(kink(wall, i), SLEW_MAX * fmin(s_ns, left_ns));

	/* 0 · INFINITY is no number. */
	if (share < 1)
		u += (1 - share) * a->uncertainty_ns;
	if (share > 0)
		u += share * b->uncertainty_ns;
	return (struct interval){tai - u, tai + u};
}

static struct interval hull(struct interval a, struct interval b)
{
	return (struct interval){fmin(a.low, b.low), fmax(a.high, b.high)};
}

/* The last point at or before @t_ns; 0 if there is none. */
static size_t find(const struct incise_wall *wall, int64_t t_ns)
{
	size_t low = 0, high = wall->n;

	while (high - low > 1) {
		size_t middle = low + (high - low) / 2;

		if (wall->points[middle].t_ns <= t_ns)
			low = middle;
		else
			high = middle;
	}
	return low;
}

static struct interval interval_at(const struct incise_wall *wall, size_t i, int64_t t_ns,
				   int64_t base_ns)
{
	if (t_ns <= wall->points[i].t_ns || i + 1 == wall->n)
		return by_point(wall, i, t_ns, base_ns);
	if (!restarts(wall, i))
		return between_wall(wall, i, t_ns, base_ns);
	return hull(by_point(wall, i, t_ns, base_ns),
		    by_point(wall, i + 1, t_ns, base_ns));
}

/* Nearest value of an interval whose bounds may be infinite, from a time that is finite. */
static void settle(struct interval interval, double otherwise, int64_t base_ns,
		   int64_t *value, int64_t *uncertainty_ns)
{
	bool known = isfinite(interval.low) && isfinite(interval.high) &&
		     fabs(interval.low) < 9e18 && fabs(interval.high) < 9e18;
	double middle = known ? (interval.low + interval.high) / 2 : otherwise;

	*value = base_ns + llrint(middle);
	if (uncertainty_ns)
		*uncertainty_ns = known ? llrint(ceil((interval.high - interval.low) / 2))
					: INCISE_WALL_UNKNOWN;
}

int incise_wall_tai(const struct incise_wall *wall, int64_t t_ns, int64_t *tai_ns,
		    int64_t *uncertainty_ns)
{
	const struct incise_wall_point *p;
	double middle;
	size_t i;

	if (t_ns < wall->points[0].t_ns - BEYOND_NS ||
	    t_ns > wall->points[wall->n - 1].t_ns + BEYOND_NS)
		return -ENODATA;
	i = find(wall, t_ns);
	p = &wall->points[i];
	middle = t_ns > p->t_ns && i + 1 < wall->n && !restarts(wall, i)
			 ? (double)(t_ns - p->t_ns) * (1 + rate_of(wall, i))
			 : advance_wall(p, t_ns);
	settle(interval_at(wall, i, t_ns, p->tai_ns), middle, p->tai_ns, tai_ns,
	       uncertainty_ns);
	return 0;
}

int incise_wall_utc_offset_s(const struct incise_wall *wall, int64_t t_ns)
{
	return wall->points[find(wall, t_ns)].utc_offset_s;
}

void incise_wall_utc_text(int64_t tai_ns, int utc_offset_s, char text[INCISE_WALL_TEXT])
{
	int64_t utc_ns = tai_ns - utc_offset_s * INCISE_NS_PER_S;
	int64_t ns = utc_ns % INCISE_NS_PER_S;
	time_t s = utc_ns / INCISE_NS_PER_S;
	struct tm utc;
	char whole[24];

	if (ns < 0) {
		ns += INCISE_NS_PER_S;
		s--;
	}
	strftime(whole, sizeof(whole), "%Y-%m-%dT%H:%M:%S", gmtime_r(&s, &utc));
	snprintf(text, INCISE_WALL_TEXT, "%s.%09dZ", whole, (int)ns);
}

/* --- the inverse ----------------------------------------------------------------------- */

/* Time of the part of points i to last that has this TAI; outside of it, by its end's rate. */
static int64_t invert(const struct incise_wall *wall, size_t i, size_t last,
		      int64_t tai_ns)
{
	const struct incise_wall_point *p = &wall->points[i];
	double rate;

	while (i < last && wall->points[i + 1].tai_ns <= tai_ns)
		p = &wall->points[++i];
	rate = i < last && tai_ns > p->tai_ns ? rate_of(wall, i) : p->rate_ppb * 1e-9;
	return p->t_ns + llrint((double)(tai_ns - p->tai_ns) / (1 + rate));
}

int incise_wall_monotonic(const struct incise_wall *wall, int64_t tai_ns, int64_t *t_ns,
			  int64_t *uncertainty_ns)
{
	struct interval found = {INFINITY, -INFINITY};
	int64_t base_ns = wall->points[0].t_ns, value = base_ns;
	double u_ns = 0;
	bool any = false;

	for (size_t i = 0, last; i < wall->n; i = last + 1) {
		int64_t from_ns, to_ns, t, tai, u;

		for (last = i; last + 1 < wall->n && !restarts(wall, last);)
			last++;
		/* The part holds up to the points on both sides of it. */
		from_ns = i ? wall->points[i - 1].t_ns : wall->points[0].t_ns - BEYOND_NS;
		to_ns = last + 1 < wall->n ? wall->points[last + 1].t_ns
					   : wall->points[last].t_ns + BEYOND_NS;
		t = invert(wall, i, last, tai_ns);
		/* Between two parts where TAI leaps: the nearer ends. */
		if (i && t < from_ns && tai_ns > wall->points[i - 1].tai_ns)
			t = from_ns;
		else if (last + 1 < wall->n && t > to_ns &&
			 tai_ns < wall->points[last + 1].tai_ns)
			t = to_ns;
		if (t < from_ns || t > to_ns || incise_wall_tai(wall, t, &tai, &u))
			continue;
		any = true;
		value = t;
		u_ns = fmax(u_ns, u == INCISE_WALL_UNKNOWN ? INFINITY : (double)u);
		found = hull(found, (struct interval){(double)(t - base_ns),
						      (double)(t - base_ns)});
	}
	if (!any)
		return -ENODATA;
	/* The rate is within SLEW_MAX of 1. */
	settle((struct interval){found.low - u_ns * (1 + SLEW_MAX),
				 found.high + u_ns * (1 + SLEW_MAX)},
	       (double)(value - base_ns), base_ns, t_ns, uncertainty_ns);
	return 0;
}
