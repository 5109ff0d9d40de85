// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Wall time of a recording; see wall_report.h.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "json.h"
#include "wall_report.h"

void wall_uncertainty_text(int64_t uncertainty_ns, char text[INCISE_WALL_TEXT])
{
	if (uncertainty_ns == INCISE_WALL_UNKNOWN)
		snprintf(text, INCISE_WALL_TEXT, "unknown");
	else
		snprintf(text, INCISE_WALL_TEXT, "%.3g ms",
			 (double)uncertainty_ns * 1e-6);
}

/* The ends of a recording, and what its points say. */
struct summary {
	int64_t tai_ns[2], uncertainty_ns[2]; /* start, end */
	char utc[2][INCISE_WALL_TEXT];
	size_t n, held, restarts;
	const struct incise_wall_point *points;
	bool several; /* sources or references */
};

static void summarise(const struct incise_wall *wall, int64_t start_ns, int64_t end_ns,
		      struct summary *sum)
{
	const int64_t ends[] = {start_ns, end_ns};

	*sum = (struct summary){0};
	sum->n = incise_wall_points(wall, &sum->points);
	for (int i = 0; i < 2; i++) {
		/* A recording that was cut off ends with its last point. */
		if (incise_wall_tai(wall, ends[i], &sum->tai_ns[i],
				    &sum->uncertainty_ns[i])) {
			const struct incise_wall_point *p =
				&sum->points[i ? sum->n - 1 : 0];

			sum->tai_ns[i] = p->tai_ns + (ends[i] - p->t_ns);
			sum->uncertainty_ns[i] = INCISE_WALL_UNKNOWN;
		}
		incise_wall_utc_text(sum->tai_ns[i],
				     incise_wall_utc_offset_s(wall, ends[i]),
				     sum->utc[i]);
	}
	for (size_t i = 0; i < sum->n; i++) {
		sum->held += sum->points[i].held;
		sum->restarts += *sum->points[i].restart != 0;
		sum->several |=
			strcmp(sum->points[i].source, sum->points[0].source) ||
			strcmp(sum->points[i].reference, sum->points[0].reference);
	}
}

/* Movement of the mapping at a restart, ns. */
static double moved_ns(const struct incise_wall_point *p)
{
	const struct incise_wall_point *before = p - 1;
	double passed_ns = (double)(p->t_ns - before->t_ns);

	return (double)((p->tai_ns - before->tai_ns) - (p->t_ns - before->t_ns)) -
	       passed_ns * before->rate_ppb * 1e-9;
}

void wall_text(const struct incise_wall *wall, int64_t start_ns, int64_t end_ns)
{
	char bounds[2][INCISE_WALL_TEXT];
	const struct incise_wall_point *p;
	struct summary sum;

	summarise(wall, start_ns, end_ns, &sum);
	for (int i = 0; i < 2; i++)
		wall_uncertainty_text(sum.uncertainty_ns[i], bounds[i]);
	p = sum.points;
	printf("wall time  %s to %s, uncertainty (bound) %s", sum.utc[0], sum.utc[1],
	       bounds[0]);
	if (strcmp(bounds[0], bounds[1]) != 0)
		printf(" to %s", bounds[1]);
	putchar('\n');
	printf("           by %s%s, time of %s; TAI is UTC + %d s (%s)\n", p->source,
	       sum.several ? " and others" : "", p->reference, p->utc_offset_s, p->leap);
	if (sum.held)
		printf("           no valid time from the source at %zu of %zu points: "
		       "held, with a growing uncertainty\n",
		       sum.held, sum.n);
	for (size_t i = 1; i < sum.n; i++)
		if (*sum.points[i].restart)
			printf("           restart after %.1f s: %s, moved by %+.6f s\n",
			       (double)(sum.points[i].t_ns - start_ns) * 1e-9,
			       sum.points[i].restart, moved_ns(&sum.points[i]) * 1e-9);
}

static json_t *bound_json(int64_t uncertainty_ns)
{
	return uncertainty_ns == INCISE_WALL_UNKNOWN ? json_null()
						     : json_integer(uncertainty_ns);
}

/* Names without repetition, in the order of the points. */
static json_t *names_json(const struct summary *sum, size_t offset)
{
	json_t *names = json_array();

	for (size_t i = 0; i < sum->n; i++) {
		const char *name = (const char *)&sum->points[i] + offset;
		size_t k = 0;

		while (k < json_array_size(names) &&
		       strcmp(json_string_value(json_array_get(names, k)), name) != 0)
			k++;
		if (k == json_array_size(names))
			json_array_append_new(names, json_text(name));
	}
	return names;
}

json_t *wall_json(const struct incise_wall *wall, int64_t start_ns, int64_t end_ns)
{
	json_t *restarts = json_array(), *ends[2];
	struct summary sum;

	summarise(wall, start_ns, end_ns, &sum);
	for (size_t i = 1; i < sum.n; i++)
		if (*sum.points[i].restart)
			json_array_append_new(
				restarts,
				json_pack("{ss sI sf}", "kind", sum.points[i].restart,
					  "t_ns", (json_int_t)sum.points[i].t_ns,
					  "moved_s", moved_ns(&sum.points[i]) * 1e-9));
	for (int i = 0; i < 2; i++)
		ends[i] = json_pack("{sI sI ss so}", "t_ns",
				    (json_int_t)(i ? end_ns : start_ns), "tai_ns",
				    (json_int_t)sum.tai_ns[i], "utc", sum.utc[i],
				    "uncertainty_ns", bound_json(sum.uncertainty_ns[i]));
	return json_pack("{so so so so si ss sI sI so}", "start", ends[0], "end", ends[1],
			 "sources",
			 names_json(&sum, offsetof(struct incise_wall_point, source)),
			 "references",
			 names_json(&sum, offsetof(struct incise_wall_point, reference)),
			 "utc_offset_s", sum.points->utc_offset_s, "leap",
			 sum.points->leap, "points", (json_int_t)sum.n, "held",
			 (json_int_t)sum.held, "restarts", restarts);
}
