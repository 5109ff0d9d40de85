/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The map of a member's clock to that of its session; see session.h.
 *
 *     session's clock              ╱─ knots, straight lines between them; beyond the ends the
 *     (the first member's)   ╱───╱    line goes on
 *                        ───╱
 *                     member's CLOCK_MONOTONIC
 */
#ifndef INCISE_SESSION_MAP_H
#define INCISE_SESSION_MAP_H

#include <stddef.h>
#include <stdint.h>

struct incise_session_knot {
	int64_t t_ns, to_ns; /* both increase */
	double bound_ns;     /* of the error, with the first member's */
};

struct incise_session_map {
	struct incise_session_knot *knots;
	size_t n; /* 2 or more */
};

/* A time of a member's clock on the session's, ns; without a map the same. */
int64_t incise_session_time(const struct incise_session_map *map, int64_t t_ns);

/* And back. */
int64_t incise_session_member_time(const struct incise_session_map *map, int64_t t_ns);

/* Bound of its error, ns. */
double incise_session_bound(const struct incise_session_map *map, int64_t t_ns);

#endif
