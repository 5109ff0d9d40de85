// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Pairs to train from, and to check with; see train_side.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "train_side.h"

/* The rows of one side of the split, or all of them. */
static void take_side(struct train_side *side, const struct incise_dataset *data,
		      const struct train_wish *wish, const bool *check, bool want)
{
	size_t n = incise_dataset_rows(data), width = wish->n_inputs + 1, taken = 0;
	bool *seen = calloc(incise_dataset_n_groups(data) + 1, sizeof(*seen));

	side->rows = malloc(n * width * sizeof(double));
	side->groups = wish->group ? malloc(n * sizeof(int)) : NULL;
	side->n_groups = 0;
	if (!seen || !side->rows || (wish->group && !side->groups))
		cli_fail("%s: no memory for its %zu pairs", wish->data, n);
	for (size_t i = 0; i < n; i++) {
		int group = incise_dataset_group(data, i);

		if (check && check[i] != want)
			continue;
		memcpy(side->rows + taken * width, incise_dataset_row(data, i),
		       width * sizeof(double));
		if (group >= 0) {
			side->n_groups += !seen[group];
			seen[group] = true;
			side->groups[taken] = group;
		}
		taken++;
	}
	free(seen);
	side->pairs = (struct incise_pairs){side->rows, taken, wish->n_inputs};
}

void train_sides_take(struct train_side *fit, struct train_side *check,
		      const struct incise_dataset *data, const struct train_wish *wish)
{
	size_t n = incise_dataset_rows(data);
	struct incise_error err = {0};
	bool *split = NULL;

	if (wish->check > 0) {
		int *groups = wish->group ? malloc(n * sizeof(*groups)) : NULL;

		split = malloc(n * sizeof(*split));
		if (!split || (wish->group && !groups))
			cli_fail("%s: no memory for its %zu pairs", wish->data, n);
		for (size_t i = 0; i < n && groups; i++)
			groups[i] = incise_dataset_group(data, i);
		if (incise_split(n, groups, wish->check, wish->train.seed, split, &err))
			cli_fail("%s: %s", wish->data, err.text);
		free(groups);
		take_side(check, data, wish, split, true);
	}
	take_side(fit, data, wish, split, false);
	free(split);
}

void train_side_free(struct train_side *side)
{
	free(side->rows);
	free(side->groups);
}

/* Range of a column over the training pairs: unseen ones shape nothing. */
static void variable(struct incise_variable *v, const struct incise_pairs *pairs,
		     int column, const char *name)
{
	size_t width = pairs->n_inputs + 1;

	snprintf(v->name, sizeof(v->name), "%s", name);
	v->min = v->max = pairs->rows[column];
	for (size_t i = 1; i < pairs->n; i++) {
		v->min = fmin(v->min, pairs->rows[i * width + column]);
		v->max = fmax(v->max, pairs->rows[i * width + column]);
	}
}

struct incise_model *train_first_model(struct train_wish *wish,
				       const struct train_side *fit)
{
	struct incise_variable in[INCISE_MODEL_INPUTS_MAX], out;
	struct incise_error err = {0};
	struct incise_model *model;

	for (int i = 0; i < wish->n_inputs; i++)
		variable(&in[i], &fit->pairs, i, wish->inputs[i]);
	variable(&out, &fit->pairs, wish->n_inputs, wish->output);
	if (!isfinite(out.max - out.min))
		cli_fail("%s: column %s spans %g to %g: too far for a double; scale it",
			 wish->data, out.name, out.min, out.max);
	if (!(out.min < out.max))
		out.max = out.min + fmax(fabs(out.min), 1) * 1e-6;
	wish->train.groups = fit->groups;
	if (wish->auto_mfs && incise_train_choose_grid(&fit->pairs, in, wish->type,
						       &wish->train, wish->mfs, &err))
		cli_fail("%s: %s", wish->data, err.text);
	model = incise_model_new_grid(wish->n_inputs, in, wish->mfs, wish->type, &out,
				      &err);
	if (!model)
		cli_fail("%s: %s", wish->data, err.text);
	return model;
}
