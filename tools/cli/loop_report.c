// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Reports of the commands that run the loop; see loop_report.h.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "loop_report.h"
#include "stopwatch.h"

const char *const loop_tool_names[] = {"auto", "blade", "handle", "tube", NULL};

const char *const loop_flag_names[INCISE_TICK_FLAGS] = {
	"contact",  "extrapolated", "stale",	 "clamped",    "fault",	   "slewed",
	"travel",   "unpaid",	    "starting",	 "not_finite", "unusable", "in_cut",
	"membrane", "lumen",	    "back_wall", "full",
};

const char *loop_flags_text(unsigned int flags, char *text)
{
	static const char letters[] = "cesofvtprnuimlbx";

	_Static_assert(sizeof(letters) == INCISE_TICK_FLAGS + 1, "a letter for each");
	for (int i = 0; letters[i]; i++)
		text[i] = flags & 1u << i ? letters[i] : '-';
	text[strlen(letters)] = 0;
	return text;
}

json_t *loop_flags_json(const uint64_t counts[INCISE_TICK_FLAGS])
{
	json_t *flags = json_object();

	for (int i = 0; i < INCISE_TICK_FLAGS; i++)
		json_object_set_new(flags, loop_flag_names[i],
				    json_integer((json_int_t)counts[i]));
	return flags;
}

double loop_quantile(const uint64_t *histogram, double share, double unit)
{
	double bin = incise_loop_quantile(histogram, share);
	uint64_t n = 0;

	for (int i = 0; i < INCISE_LOOP_BINS; i++)
		n += histogram[i];
	if (!stopwatch_resolves(n, share))
		return NAN;
	return bin < INCISE_LOOP_BINS ? bin * unit : INFINITY;
}

const char *loop_below(char *text, size_t size, double us)
{
	if (isnan(us))
		snprintf(text, size, "- (too few)");
	else if (isfinite(us))
		snprintf(text, size, "< %g us", us);
	else
		snprintf(text, size, "beyond the histogram");
	return text;
}

static json_t *histogram_json(const uint64_t *histogram)
{
	json_t *list = json_array();

	for (int i = 0; i < INCISE_LOOP_BINS; i++)
		if (histogram[i])
			json_array_append_new(list, json_pack("[iI]", i,
							      (json_int_t)histogram[i]));
	return list;
}

json_t *loop_lateness_json(const struct incise_loop_stats *s)
{
	return json_pack("{so so so so so}", "median",
			 json_number(loop_quantile(s->lateness_us, 0.5, 1)), "p99",
			 json_number(loop_quantile(s->lateness_us, 0.99, 1)), "p999",
			 json_number(loop_quantile(s->lateness_us, 0.999, 1)), "max",
			 json_number(s->lateness_max_ns * 1e-3), "histogram",
			 histogram_json(s->lateness_us));
}

void loop_texture_line(const struct incise_loop_stats *s,
		       const struct incise_scene *scene)
{
	const char *why = incise_scene_texture_left_out(scene);

	if (why)
		printf("texture    %s\n", why);
	if (!isnan(s->texture_felt))
		printf("texture    %.0f %% of it acted on the hand\n",
		       100 * s->texture_felt);
}

void loop_lateness_line(const struct incise_loop_stats *s)
{
	char a[32], b[32], c[32];

	printf("lateness   median %s, 99 %% %s, 99.9 %% %s, max %.0f us\n",
	       loop_below(a, sizeof(a), loop_quantile(s->lateness_us, 0.5, 1)),
	       loop_below(b, sizeof(b), loop_quantile(s->lateness_us, 0.99, 1)),
	       loop_below(c, sizeof(c), loop_quantile(s->lateness_us, 0.999, 1)),
	       s->lateness_max_ns * 1e-3);
}
