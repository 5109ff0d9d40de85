// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The members of a joined recording; see joined_report.h.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "json.h"
#include "joined_report.h"

const struct cli_unit joined_times[] = {
	{"s", 1}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}, {0}};

static void print_times(const struct incise_session_info *member)
{
	bool same = !strcmp(member->method, "same");

	printf("  offset %.9f s, rate %+.4f ppm, uncertainty %.3g ms, %s%s",
	       (double)member->offset_ns * 1e-9, member->rate_ppm,
	       member->uncertainty_ns * 1e-6, same ? "the same clock" : "by ",
	       same ? "" : member->method);
	if (member->matches)
		printf(" (%s)", cli_count(member->matches, "mark"));
	printf("\n");
	if (!isnan(member->agreement_ns))
		printf("  signal less clocks: %.6g ms, within %.3g ms\n",
		       member->agreement_ns * 1e-6, member->agreement_bound_ns * 1e-6);
	if (member->overlap_ns >= 0)
		printf("  overlap with those before: %.3f s\n",
		       (double)member->overlap_ns * 1e-9);
	else
		printf("  no overlap with those before: a gap of %.3f s\n",
		       (double)-member->overlap_ns * 1e-9);
}

void joined_print(const struct incise_session_info *members, int n)
{
	for (int i = 0; i < n; i++) {
		const struct incise_session_info *member = &members[i];

		printf("%s: %s, %.3f to %.3f s%s%s%s\n", member->name,
		       *member->streams ? member->streams : "no rows",
		       (double)member->first_ns * 1e-9, (double)member->last_ns * 1e-9,
		       *member->host ? ", on " : "", member->host,
		       member->complete ? "" : ", interrupted");
		if (i)
			print_times(member);
	}
}

/* "force, tracker" as an array. */
static json_t *streams_of(const char *text)
{
	json_t *list = json_array();

	while (*text) {
		size_t n = strcspn(text, ",");

		json_array_append_new(list, json_stringn(text, n));
		text += n;
		text += strspn(text, ", ");
	}
	return list;
}

json_t *joined_json(const struct incise_session_info *members, int n)
{
	json_t *list = json_array();

	for (int i = 0; i < n; i++) {
		const struct incise_session_info *member = &members[i];
		bool gap = member->overlap_ns < 0;

		json_array_append_new(
			list, json_pack("{so so ss so sb sI sI sI so so si so so so so}",
					"name", json_text(member->name), "host",
					json_text(member->host), "method", member->method,
					"streams", streams_of(member->streams),
					"complete", member->complete, "first_ns",
					(json_int_t)member->first_ns, "last_ns",
					(json_int_t)member->last_ns, "offset_ns",
					(json_int_t)member->offset_ns, "rate_ppm",
					json_number(member->rate_ppm), "uncertainty_ns",
					json_number(member->uncertainty_ns), "matches",
					member->matches, "overlap_ns",
					i && !gap ? json_integer(member->overlap_ns)
						  : json_null(),
					"gap_ns",
					i && gap ? json_integer(-member->overlap_ns)
						 : json_null(),
					"agreement_ns", json_number(member->agreement_ns),
					"agreement_bound_ns",
					json_number(member->agreement_bound_ns)));
	}
	return list;
}
