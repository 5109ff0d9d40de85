// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The figures of a report; see reported_figures.h.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "figures.h"
#include "reported_figures.h"

#define FIGURES_MAX 100000

const char *const figure_kind_names[FIGURE_KINDS] = {"time", "measured", "exact"};

/* Fit for a terminal: UTF-8 it is, as jansson reads no other. */
static bool plain(const char *text)
{
	size_t n = strlen(text);

	if (!n || n > REPORTED_NAME_BYTES)
		return false;
	for (size_t i = 0; i < n; i++)
		if ((unsigned char)text[i] < ' ' || text[i] == 0x7f ||
		    ((unsigned char)text[i] == 0xc2 && (unsigned char)text[i + 1] < 0xa0))
			return false;
	return true;
}

static int number(const json_t *object, const char *key, double *value, const char *where,
		  struct incise_error *err)
{
	const json_t *is = json_object_get(object, key);

	if (!json_is_number(is))
		return incise_error_set(err, EINVAL, "%s: '%s' is %s", where, key,
					is ? "no number" : "missing");
	*value = json_number_value(is);
	return 0;
}

static int text(const json_t *object, const char *key, const char **value,
		const char *where, struct incise_error *err)
{
	const json_t *is = json_object_get(object, key);

	if (!json_is_string(is))
		return incise_error_set(err, EINVAL, "%s: '%s' is %s", where, key,
					is ? "no text" : "missing");
	*value = json_string_value(is);
	if (strlen(*value) != json_string_length(is) || !plain(*value))
		return incise_error_set(err, EINVAL,
					"%s: '%s' is empty, too long, or holds control "
					"characters",
					where, key);
	return 0;
}

static int read_kind(const json_t *from, struct figure *f, const char *where,
		     struct incise_error *err)
{
	const char *name;
	int rc = text(from, "kind", &name, where, err), kind = 0;

	if (rc)
		return rc;
	while (kind < FIGURE_KINDS && strcmp(name, figure_kind_names[kind]))
		kind++;
	if (kind == FIGURE_KINDS)
		return incise_error_set(err, EINVAL,
					"%s: '%s' is none of time, measured and exact",
					where, name);
	f->kind = (enum figure_kind)kind;
	return 0;
}

/* Its ends have the names of @prefix, or none. */
static int read_interval(const json_t *from, const char *key, const char *prefix,
			 struct interval *interval, const char *where,
			 struct incise_error *err)
{
	char low[40], high[40];
	int rc;

	snprintf(low, sizeof(low), "%s%slow", prefix, *prefix ? "_" : "");
	snprintf(high, sizeof(high), "%s%shigh", prefix, *prefix ? "_" : "");
	rc = number(from, key, &interval->middle, where, err);
	if (!rc)
		rc = number(from, low, &interval->low, where, err);
	if (!rc)
		rc = number(from, high, &interval->high, where, err);
	if (!rc &&
	    !(interval->low <= interval->middle && interval->middle <= interval->high))
		rc = incise_error_set(
			err, EINVAL,
			"%s: '%s', %g, is not between %g and %g, its interval", where,
			key, interval->middle, interval->low, interval->high);
	return rc;
}

static int read_figure(const json_t *from, struct figure *f, const char *where,
		       struct incise_error *err)
{
	const char *better;
	int rc;

	*f = (struct figure){0};
	if (!json_is_object(from))
		return incise_error_set(err, EINVAL, "%s is no object", where);
	rc = text(from, "name", &f->name, where, err);
	if (!rc)
		rc = text(from, "unit", &f->unit, where, err);
	if (!rc)
		rc = read_kind(from, f, where, err);
	if (!rc)
		rc = number(from, "value", &f->value, where, err);
	if (!rc && json_object_get(from, "better")) {
		rc = text(from, "better", &better, where, err);
		f->more_is_better = !rc && !strcmp(better, "more");
	}
	if (rc)
		return rc;
	f->scales = 1;
	f->by[0] = (struct interval){f->value, f->value, f->value};
	if (f->kind == FIGURE_MEASURED)
		return read_interval(from, "value", "", &f->by[0], where, err);
	if (f->kind == FIGURE_TIME)
		for (f->scales = 0; !rc && f->scales < YARDSTICKS; f->scales++)
			rc = read_interval(from, figures_yardsticks[f->scales],
					   figures_yardsticks[f->scales],
					   &f->by[f->scales], where, err);
	return rc;
}

/* A figure's key: its word and name, which hold no control characters. */
static void key_of(const struct figure *f, char *key, size_t size)
{
	snprintf(key, size, "%s\n%s", f->word ? f->word : "", f->name);
}

/* No figure's: names are not empty. */
static const char *key_of_word(const char *word, char *key, size_t size)
{
	snprintf(key, size, "%s\n", word);
	return key;
}

static int add(struct reported_figures *all, const char *word, const json_t *list,
	       struct incise_error *err)
{
	char where[600], key[2 * REPORTED_NAME_BYTES + 2];
	struct figure *room;
	const json_t *from;
	size_t i;

	if (!json_is_array(list))
		return incise_error_set(err, EINVAL, "%s: %s%s'figures' is no list",
					all->report, word ? word : "", word ? ": " : "");
	if (all->n + json_array_size(list) > FIGURES_MAX)
		return incise_error_set(err, E2BIG, "%s: more than %d figures",
					all->report, FIGURES_MAX);
	room = realloc(all->figure,
		       (all->n + json_array_size(list) + 1) * sizeof(*all->figure));
	if (!room)
		return incise_error_set(err, ENOMEM, "%s: no memory", all->report);
	all->figure = room;
	if (word && json_array_size(list) &&
	    json_object_set_new(all->index, key_of_word(word, key, sizeof(key)),
				json_integer(all->n)))
		return incise_error_set(err, ENOMEM, "%s: no memory", all->report);
	json_array_foreach((json_t *)list, i, from)
	{
		struct figure f;
		int rc;

		snprintf(where, sizeof(where), "%.200s: %s%sfigures[%zu]", all->report,
			 word ? word : "", word ? "." : "", i);
		rc = read_figure(from, &f, where, err);
		if (rc)
			return rc;
		f.word = word;
		key_of(&f, key, sizeof(key));
		if (json_object_get(all->index, key))
			return incise_error_set(err, EINVAL, "%s: '%s' stands twice",
						where, f.name);
		if (json_object_set_new(all->index, key, json_integer(all->n)))
			return incise_error_set(err, ENOMEM, "%s: no memory",
						all->report);
		all->figure[all->n++] = f;
	}
	return 0;
}

/* Figures of a report; in it they live. */
int reported_figures_read(const json_t *report, const char *name,
			  struct reported_figures *all, struct incise_error *err)
{
	const json_t *list = json_object_get(report, "figures"), *member;
	const char *word;
	int rc = 0;

	*all = (struct reported_figures){.report = name, .index = json_object()};
	if (!all->index)
		return incise_error_set(err, ENOMEM, "%s: no memory", name);
	if (list)
		return add(all, NULL, list, err);
	json_object_foreach((json_t *)report, word, member)
	{
		list = json_object_get(member, "figures");
		if (!list || rc)
			continue;
		rc = plain(word)
			     ? add(all, word, list, err)
			     : incise_error_set(err, EINVAL,
						"%s: a word's name is empty, too long, "
						"or holds control characters",
						name);
	}
	if (!rc && !all->n)
		rc = incise_error_set(err, EINVAL,
				      "%s: holds no figures; expected what 'incise bench "
				      "WORD --json' wrote",
				      name);
	return rc;
}

void reported_figures_free(struct reported_figures *all)
{
	free(all->figure);
	json_decref(all->index);
}

struct figure *reported_figures_find(const struct reported_figures *all,
				     const struct figure *like)
{
	char key[2 * REPORTED_NAME_BYTES + 2];
	struct figure *found;
	json_t *place;

	key_of(like, key, sizeof(key));
	place = json_object_get(all->index, key);
	if (!place)
		return NULL;
	found = &all->figure[json_integer_value(place)];
	/* In another unit it is another figure. */
	return found->kind == like->kind && !strcmp(found->unit, like->unit) ? found
									     : NULL;
}

bool reported_figures_have(const struct reported_figures *all, const char *word)
{
	char key[REPORTED_NAME_BYTES + 2];

	return json_object_get(all->index, key_of_word(word, key, sizeof(key)));
}
