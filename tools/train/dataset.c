// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Training data described.
 *
 * A group is an outlier where the mean of a column is further from the median of all groups than
 * LIMIT standard deviations, as estimated by the median distance from that median: neither moves
 * with the outliers themselves.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/base/ascending.h"
#include "../cli/cli.h"
#include "../cli/json.h"
#include "sources.h"

#define LIMIT 3.5	 /* Iglewicz and Hoaglin (1993) */
#define GROUPS_MIN 5	 /* of fewer, none stands out */
#define MAD_TO_SD 1.4826 /* of a normal distribution */

struct dataset_row {
	const struct incise_corpus_survey *source;
	const struct incise_corpus_group *group;
	double mean[INCISE_MODEL_INPUTS_MAX + 1];
	double distance[INCISE_MODEL_INPUTS_MAX +
			1]; /* in deviations; 0 without spread */
	bool outlier;
};

struct dataset {
	const struct incise_sources_options *options;
	const struct incise_trained *trained;
	const struct incise_corpus *corpus;
	int n_columns;
	struct dataset_row *rows;
	int n;
	double min[INCISE_MODEL_INPUTS_MAX + 1], max[INCISE_MODEL_INPUTS_MAX + 1];
};

static void find_outliers(struct dataset *data)
{
	double *values = cli_alloc(data->n, sizeof(*values));

	for (int c = 0; c < data->n_columns && data->n >= GROUPS_MIN; c++) {
		double middle, spread;

		for (int i = 0; i < data->n; i++)
			values[i] = data->rows[i].mean[c];
		middle = median(values, data->n);
		for (int i = 0; i < data->n; i++)
			values[i] = fabs(data->rows[i].mean[c] - middle);
		spread = MAD_TO_SD * median(values, data->n);
		for (int i = 0; i < data->n && spread > 0; i++) {
			struct dataset_row *row = &data->rows[i];

			row->distance[c] = (row->mean[c] - middle) / spread;
			row->outlier |= fabs(row->distance[c]) > LIMIT;
		}
	}
	free(values);
}

static void collect(struct dataset *data)
{
	for (int s = 0; s < incise_corpus_sources(data->corpus); s++)
		data->n += incise_corpus_source(data->corpus, s)->n_groups;
	data->rows = cli_alloc(data->n, sizeof(*data->rows));
	data->n = 0;
	for (int s = 0; s < incise_corpus_sources(data->corpus); s++) {
		const struct incise_corpus_survey *survey =
			incise_corpus_source(data->corpus, s);

		for (int g = 0; g < survey->n_groups; g++) {
			struct dataset_row *row = &data->rows[data->n++];

			row->source = survey;
			row->group = &survey->groups[g];
			for (int c = 0; c < data->n_columns; c++)
				row->mean[c] =
					row->group->sum[c] / (double)row->group->rows;
		}
	}
	incise_corpus_ranges(data->corpus, data->min, data->max);
	if (data->trained->group)
		find_outliers(data);
}

/* A group by its name, which a whole source has as its hash. */
static const char *name_of(const struct dataset *data, const struct dataset_row *row)
{
	return strcmp(data->trained->group, "recording") ? row->group->name
							 : row->source->text;
}

/* A source's text goes on with its origins, which incise provenance prints. */
#define ORIGINS ", incise:"
#define SHOWN 60 /* bytes of a name */

static int before_origins(const char *text)
{
	const char *at = strstr(text, ORIGINS);

	return at && at - text < SHOWN ? (int)(at - text) : SHOWN;
}

static void print_source(const char *text)
{
	const char *at = strstr(text, ORIGINS), *end = at ? at + 1 : text, *next;

	while (at && !strncmp(end + 1, "incise:", 7) && (next = strchr(end, ';')))
		end = next + 1;
	printf("  %.*s%s\n", at ? (int)(at - text) : 0, text, end);
}

static void show_text(const struct dataset *data)
{
	int outliers = 0, n = incise_corpus_sources(data->corpus);

	printf("%s, %s", cli_count(n, "source"),
	       cli_count(incise_corpus_side(data->corpus, false)->rows, "row"));
	if (data->trained->group)
		printf(", %s by %s", cli_count(data->n, "group"), data->trained->group);
	if (data->trained->left_out)
		printf("; the blade did not advance in %llu more",
		       (unsigned long long)data->trained->left_out);
	printf("\n");
	for (int c = 0; c < data->n_columns; c++)
		printf("%s: %g to %g\n", data->options->columns[c], data->min[c],
		       data->max[c]);
	for (int s = 0; s < n; s++) {
		const struct incise_corpus_survey *survey =
			incise_corpus_source(data->corpus, s);

		printf("%.12s  %15s", survey->hash, cli_count(survey->rows, "row"));
		if (data->trained->group)
			printf(" %11s", cli_count(survey->n_groups, "group"));
		print_source(survey->text);
	}
	for (int i = 0; i < data->n && data->trained->group; i++) {
		const struct dataset_row *row = &data->rows[i];

		outliers += row->outlier;
		for (int c = 0; c < data->n_columns && row->outlier; c++)
			if (fabs(row->distance[c]) > LIMIT)
				printf("outlier: group %.*s of %.*s: mean %s %g is %+.1f "
				       "deviations from the median of the groups\n",
				       before_origins(name_of(data, row)),
				       name_of(data, row),
				       before_origins(row->source->text),
				       row->source->text, data->options->columns[c],
				       row->mean[c], row->distance[c]);
	}
	if (data->trained->group && data->n < GROUPS_MIN)
		printf("outliers are sought from %d groups on\n", GROUPS_MIN);
	else if (data->trained->group && !outliers)
		printf("no group is further than %g deviations from the median\n", LIMIT);
}

static void show_json(const struct dataset *data)
{
	json_t *columns = json_array(), *sources = json_array(), *groups = json_array();

	for (int c = 0; c < data->n_columns; c++)
		json_array_append_new(
			columns, json_pack("{so sf sf}", "name",
					   json_text(data->options->columns[c]), "min",
					   data->min[c], "max", data->max[c]));
	for (int s = 0; s < incise_corpus_sources(data->corpus); s++) {
		const struct incise_corpus_survey *survey =
			incise_corpus_source(data->corpus, s);

		json_array_append_new(
			sources, json_pack("{ss so sI si}", "sha256", survey->hash,
					   "text", json_text(survey->text), "rows",
					   (json_int_t)survey->rows, "groups",
					   data->trained->group ? survey->n_groups : 0));
	}
	for (int i = 0; i < data->n && data->trained->group; i++) {
		const struct dataset_row *row = &data->rows[i];

		json_array_append_new(
			groups,
			json_pack("{so ss sI so so sb}", "name",
				  json_text(name_of(data, row)), "source",
				  row->source->hash, "rows", (json_int_t)row->group->rows,
				  "means", json_numbers(row->mean, data->n_columns),
				  "deviations",
				  json_numbers(row->distance, data->n_columns), "outlier",
				  row->outlier));
	}
	json_print(json_pack("{ss sI sI so so so}", "kind", "dataset", "rows",
			     (json_int_t)incise_corpus_side(data->corpus, false)->rows,
			     "left_out", (json_int_t)data->trained->left_out, "columns",
			     columns, "sources", sources, "groups", groups));
}

static int show_source(void *user, const struct incise_train_step *step)
{
	(void)user;
	cli_progress("source %d of %d", step->source + 1, step->sources);
	return 0;
}

void dataset_show(struct incise_train_source *sources, int n,
		  struct incise_sources_options *options, bool json)
{
	struct incise_trained trained;
	struct dataset data = {.options = options,
			       .trained = &trained,
			       .n_columns = options->n_inputs + 1};
	struct incise_error err = {0};

	options->train.progress = show_source;
	options->end = INCISE_TRAIN_TO_CORPUS;
	cli_check(incise_train_sources(sources, n, options, &trained, &err), &err);
	cli_progress_end();
	data.corpus = trained.corpus;
	collect(&data);
	json ? show_json(&data) : show_text(&data);
	free(data.rows);
	incise_trained_free(&trained);
}
