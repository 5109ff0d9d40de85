// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The clock of a member on that of its session; see session_map.h.
 */
#include <math.h>
#include <stdbool.h>
#include "session_map.h"

/* The piece of the line at or before a time, by a member of struct knot. */
static size_t find_piece(const struct incise_session_map *map, int64_t t_ns, bool inverse)
{
	size_t low = 0, high = map->n - 1;

	while (high - low > 1) {
		size_t middle = low + (high - low) / 2;
		const struct incise_session_knot *knot = &map->knots[middle];

		if ((inverse ? knot->to_ns : knot->t_ns) <= t_ns)
			low = middle;
		else
			high = middle;
	}
	return low;
}

static int64_t on_line(int64_t a, int64_t b, int64_t to_a, int64_t to_b, int64_t t)
{
	double slope = (double)(to_b - to_a) / (double)(b - a);
	/* The offset is exact, and only the small rest is rounded. */
	double rest = (double)(t - a) * (slope - 1);

	return to_a + (t - a) + llrint(fmax(fmin(rest, 1e18), -1e18));
}

int64_t incise_session_time(const struct incise_session_map *map, int64_t t_ns)
{
	const struct incise_session_knot *a;

	if (!map)
		return t_ns;
	a = &map->knots[find_piece(map, t_ns, false)];
	return on_line(a[0].t_ns, a[1].t_ns, a[0].to_ns, a[1].to_ns, t_ns);
}

int64_t incise_session_member_time(const struct incise_session_map *map, int64_t t_ns)
{
	const struct incise_session_knot *a;

	if (!map)
		return t_ns;
	a = &map->knots[find_piece(map, t_ns, true)];
	return on_line(a[0].to_ns, a[1].to_ns, a[0].t_ns, a[1].t_ns, t_ns);
}

double incise_session_bound(const struct incise_session_map *map, int64_t t_ns)
{
	const struct incise_session_knot *a;

	if (!map)
		return 0;
	a = &map->knots[find_piece(map, t_ns, false)];
	return fmax(a[0].bound_ns, a[1].bound_ns);
}
