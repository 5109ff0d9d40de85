// SPDX-License-Identifier: GPL-2.0-or-later
/* Columns of uncertainties; see uncertainties.h. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/infile.h>
#include <incise/recording.h>
#include "../cli/cli.h"
#include "../cli/file_kind.h"
#include "uncertainties.h"

/* All that there are of the columns of a model. */
static void list(struct uncertainties *all, const char *const *columns, int n_inputs)
{
	const struct incise_budget_part *parts = incise_budget_parts();
	const struct incise_budget_value *values = incise_budget_values();

	all->n = 0;
	for (int i = 0; i < INCISE_BUDGET_PARTS; i++)
		for (int c = 0; c <= n_inputs; c++) {
			if (strcmp(values[parts[i].quantity].value, columns[c]))
				continue;
			all->columns[all->n] = parts[i].column;
			all->parts[all->n++] = (struct incise_propagation_part){
				.of = c,
				.source = parts[i].scope == INCISE_BUDGET_OWN
						  ? -1
						  : parts[i].source,
				.calibration =
					parts[i].scope == INCISE_BUDGET_CALIBRATION,
			};
			break;
		}
}

/* The next field of a line of CSV, without quotes; NULL: there is none. */
static char *next_field(char **at)
{
	char *field = *at, *end;

	if (!field)
		return NULL;
	end = strchr(field, ',');
	*at = end ? end + 1 : NULL;
	if (end)
		*end = '\0';
	field += strspn(field, " \t\"");
	field[strcspn(field, "\"\r\n")] = '\0';
	return field;
}

/* The next line that is no comment: 1, 0 at the end or on an error, which reading finds again. */
static int next_line(struct incise_infile *in, char **line)
{
	int rc;

	do
		rc = incise_infile_line(in, line, NULL);
	while (rc > 0 && (**line == '#' || !(*line)[strspn(*line, " \t\r")]));
	return rc > 0;
}

/* The columns that a file has; *stated: its first row has numbers there. */
static void look(const char *path, const struct uncertainties *all, bool *has,
		 bool *stated)
{
	static const struct incise_infile_kind kind = {.name = "a table",
						       .advice = "give a CSV file"};
	struct incise_infile *in = incise_infile_open(path, &kind, NULL);
	int column[INCISE_BUDGET_PARTS], n = 0;
	char *line, *field, *end;

	memset(has, 0, INCISE_BUDGET_PARTS * sizeof(*has));
	*stated = true;
	if (!in)
		return; /* its reader says why */
	if (next_line(in, &line))
		for (int at = 0; (field = next_field(&line)); at++)
			for (int i = 0; i < all->n; i++)
				if (!strcmp(field, all->columns[i])) {
					has[i] = true;
					column[i] = at;
					n++;
				}
	if (n && next_line(in, &line))
		for (int at = 0; (field = next_field(&line)); at++)
			for (int i = 0; i < all->n; i++)
				if (has[i] && column[i] == at) {
					double value = strtod(field, &end);

					*stated &= end > field && value - value == 0;
				}
	incise_infile_close(in);
}

/* Fail unless a recording states the uncertainties of all columns that have parts. */
static void need_stated(const char *path, const char *const *columns, int n_inputs)
{
	const struct incise_budget_value *values = incise_budget_values();
	struct incise_error err = {0};
	struct incise_recording *recording =
		cli_require(incise_recording_open(path, &err), &err);
	struct incise_budget *budget =
		cli_require(incise_budget_new(recording, NULL, NULL, &err), &err);

	for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++)
		for (int c = 0; c <= n_inputs; c++) {
			const char *missing = incise_budget_missing(budget, q);

			if (!strcmp(values[q].value, columns[c]) && missing)
				cli_fail("%s: the uncertainty of %s is not stated: %s",
					 path, columns[c], missing);
		}
	incise_budget_free(budget);
	incise_recording_close(recording);
}

static void take(struct uncertainties *found, const struct uncertainties *all,
		 const bool *has)
{
	found->n = 0;
	for (int i = 0; i < all->n; i++)
		if (has[i]) {
			found->columns[found->n] = all->columns[i];
			found->parts[found->n++] = all->parts[i];
		}
}

void uncertainties_find(struct uncertainties *found, enum uncertainties_wanted wanted,
			const char *const *columns, int n_inputs, char **paths, int n)
{
	bool has[INCISE_BUDGET_PARTS], first[INCISE_BUDGET_PARTS] = {0}, stated;
	struct uncertainties all;

	found->n = 0;
	if (wanted == UNCERTAINTIES_NONE)
		return;
	list(&all, columns, n_inputs);
	for (int s = 0; s < n; s++) {
		const char *path = paths[s];

		memset(has, 0, sizeof(has));
		stated = true;
		if (file_kind_of(path) == FILE_RECORDING) {
			if (wanted == UNCERTAINTIES_PARTS)
				need_stated(path, columns, n_inputs);
			for (int i = 0; i < all.n; i++)
				has[i] = wanted == UNCERTAINTIES_PARTS;
		} else if (strcmp(path, "-") && file_kind_of(path) == FILE_TABLE) {
			look(path, &all, has, &stated);
		}
		if (!stated && wanted == UNCERTAINTIES_PARTS)
			cli_fail("%s: an uncertainty is not stated (nan); calibrate what "
				 "`incise export` names, or leave out --uncertainty",
				 path);
		if (!stated) {
			cli_warn(
				"%s: its uncertainties are not all stated (nan), so none "
				"is used",
				path);
			memset(has, 0, sizeof(has));
		}
		if (wanted == UNCERTAINTIES_PARTS && !memchr(has, true, sizeof(has)))
			cli_fail("%s: has no uncertainties of these columns; export it "
				 "with --uncertainty parts",
				 path);
		if (!s)
			memcpy(first, has, sizeof(has));
		else if (memcmp(first, has, sizeof(has)))
			cli_fail("%s: has other uncertainties than %s; export both with "
				 "--uncertainty parts, or give --uncertainty none",
				 path, paths[0]);
	}
	take(found, &all, first);
}
