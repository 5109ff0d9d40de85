// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A pass over recordings, which exports of all kinds use: with their names, wall times and budgets; see writers.h.
 */
#include <stdlib.h>
#include <string.h>
#include "../record/read/recording.h"
#include "writers.h"

/* Name of a recording, unlike any before it: a/liver.rec and b/liver.rec differ. NULL: no memory. */
static char *unique_name(struct incise_recording *const *recordings, int at)
{
	const char *name = recordings[at]->name;
	int same = 1;
	char *text;

	for (int i = 0; i < at; i++)
		same += !strcmp(recordings[i]->name, name);
	/* No recording's own name ends in such a suffix. */
	if (same > 1 ? asprintf(&text, "%s~%d", name, same) < 0
		     : asprintf(&text, "%s", name) < 0)
		return NULL;
	for (char *c = text; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '_';
	return text;
}

/* Say in the report which uncertainties are not stated, each cause once. */
static void report_unstated(struct incise_export_report *report,
			    const struct incise_budget *budget)
{
	char *text = report->unstated;

	for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++) {
		const char *missing =
			incise_budget_missing(budget, (enum incise_budget_quantity)q);
		size_t n = strlen(text);
		char line[400];

		if (!missing)
			continue;
		snprintf(line, sizeof(line), "%s: %s", incise_budget_values()[q].name,
			 missing);
		/* Several recordings may lack the same. */
		if (!strstr(text, line))
			snprintf(text + n, sizeof(report->unstated) - n, "%s%s",
				 n ? "\n" : "", line);
	}
}

int incise_export_budgets(struct incise_export_pass *pass)
{
	if (!pass->options->uncertainty)
		return 0;
	pass->budgets = calloc((size_t)pass->n, sizeof(*pass->budgets));
	if (!pass->budgets)
		return incise_error_set(pass->err, ENOMEM, "out of memory");
	for (int i = 0; i < pass->n; i++) {
		pass->budgets[i] = incise_budget_open(pass->recordings[i], pass->options,
						      true, pass->err);
		if (!pass->budgets[i])
			return -errno;
		report_unstated(&pass->report, pass->budgets[i]);
	}
	return 0;
}

void incise_export_close(struct incise_export_pass *pass)
{
	for (int i = 0; i < pass->n; i++) {
		pass->recordings[i]->range = (struct incise_recording_range){0};
		if (pass->budgets)
			incise_budget_free(pass->budgets[i]);
	}
	free(pass->budgets);
	incise_wall_free(pass->wall);
	free(pass->name);
}

/* Name and wall time of a recording, as asked for. Returns 0 or -errno. */
static int open_recording(struct incise_export_pass *pass, int i)
{
	free(pass->name);
	incise_wall_free(pass->wall);
	pass->wall = NULL;
	pass->recording = i;
	pass->name = unique_name(pass->recordings, i);
	if (!pass->name)
		return incise_error_set(pass->err, ENOMEM, "out of memory");
	if (pass->options->tai)
		pass->wall = incise_recording_wall(pass->recordings[i], pass->err);
	return pass->options->tai && !pass->wall ? -errno : 0;
}

int incise_export_progress(const struct incise_export_pass *pass, uint64_t done,
			   uint64_t all)
{
	const struct incise_export_options *o = pass->options;
	double share = fmin(1, (double)done / fmax(1, (double)all));

	if (o->progress && o->progress(o->context, share))
		return incise_error_set(pass->err, EINTR, "interrupted");
	return 0;
}

int incise_export_check_part(const struct incise_export_pass *pass)
{
	const struct incise_recording *first = pass->recordings[0];

	if (pass->report.rows || !first->range.limited)
		return 0;
	return incise_error_set(pass->err, ENODATA,
				"%s: has nothing in this part; give another --range",
				first->path);
}

int incise_export_each(struct incise_export_pass *pass,
		       int (*visit)(struct incise_export_pass *pass,
				    struct incise_recording *recording))
{
	int rc = 0;

	for (int i = 0; i < pass->n && !rc; i++) {
		rc = open_recording(pass, i);
		if (!rc)
			rc = visit(pass, pass->recordings[i]);
	}
	return rc;
}
