// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Two reports of incise bench; see compare.h. What is in a file may have been written by
 * anyone: each type is looked at, and names reach the terminal only when they are plain.
 */
#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include "cli.h"
#include "compare.h"
#include "figures.h"
#include "json.h"
#include "memory_file.h"

#define FILE_MAX (16 << 20) /* a report of all words has less than 1 */
#define FIGURES_MAX 100000
#define NAME_MAX_BYTES 300

enum kind { TIME, MEASURED, EXACT, KINDS };
static const char *const kind_names[KINDS] = {"time", "measured", "exact"};

struct figure {
	const char *word; /* NULL in a report of one word */
	const char *name, *unit;
	enum kind kind;
	double value;
	/* What is compared: a time in each yardstick, else the value. */
	struct interval {
		double middle, low, high;
	} by[YARDSTICKS];
	int scales;
	bool more_is_better, met;
};

struct figures {
	const char *report; /* as messages name it */
	struct figure *figure;
	int n;
	json_t *index; /* place by word and name; of a word alone it is there, too */
};

/* ---- reading ---- */

static json_t *read_file(FILE *file, const char *path, struct incise_error *err)
{
	char *text = malloc(FILE_MAX + 1);
	json_error_t wrong;
	json_t *report = NULL;
	size_t n;

	if (!text) {
		incise_error_set(err, ENOMEM, "%s: no memory", path);
		return NULL;
	}
	n = fread(text, 1, FILE_MAX + 1, file);
	if (ferror(file)) {
		incise_error_set(err, errno, "%s: %s", path, strerror(errno));
	} else if (n > FILE_MAX) {
		incise_error_set(
			err, EFBIG,
			"%s: more than %d MiB; no report of incise bench is so large",
			path, FILE_MAX >> 20);
	} else {
		report = json_loadb(text, n, JSON_REJECT_DUPLICATES, &wrong);
		if (!report && !*wrong.text) {
			incise_error_set(err, ENOMEM, "%s: no memory", path);
		} else if (!report) {
			for (char *c = wrong.text; *c; c++)
				if ((unsigned char)*c < ' ' || (unsigned char)*c >= 0x7f)
					*c = '?';
			incise_error_set(err, EINVAL, "%s:%d: no JSON: %s", path,
					 wrong.line, wrong.text);
		}
	}
	free(text);
	return report;
}

json_t *compare_load(const char *path, struct incise_error *err)
{
	FILE *file = fopen(path, "re");
	json_t *report;

	if (!file) {
		incise_error_set(err, errno, "%s: %s", path, strerror(errno));
		return NULL;
	}
	report = read_file(file, path, err);
	fclose(file);
	return report;
}

/* Fit for a terminal: UTF-8 it is, as jansson reads no other. */
static bool plain(const char *text)
{
	size_t n = strlen(text);

	if (!n || n > NAME_MAX_BYTES)
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
	while (kind < KINDS && strcmp(name, kind_names[kind]))
		kind++;
	if (kind == KINDS)
		return incise_error_set(err, EINVAL,
					"%s: '%s' is none of time, measured and exact",
					where, name);
	f->kind = (enum kind)kind;
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
	if (f->kind == MEASURED)
		return read_interval(from, "value", "", &f->by[0], where, err);
	if (f->kind == TIME)
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

static int add(struct figures *all, const char *word, const json_t *list,
	       struct incise_error *err)
{
	char where[600], key[2 * NAME_MAX_BYTES + 2];
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
static int read_figures(const json_t *report, const char *name, struct figures *all,
			struct incise_error *err)
{
	const json_t *list = json_object_get(report, "figures"), *member;
	const char *word;
	int rc = 0;

	*all = (struct figures){.report = name, .index = json_object()};
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

static void free_figures(struct figures *all)
{
	free(all->figure);
	json_decref(all->index);
}

/* ---- comparing ---- */

static struct figure *find(const struct figures *all, const struct figure *like)
{
	char key[2 * NAME_MAX_BYTES + 2];
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

/*
 * By how much the yardsticks disagree about a time, as part of it: one of the machines, or
 * of its hours, was slower at some work than at other, and at which this is, is not known.
 */
static double disagreement(const struct figure *was, const struct figure *is)
{
	double least = INFINITY, most = 0;

	for (int i = 0; i < is->scales; i++) {
		double ratio = fabs(is->by[i].middle / was->by[i].middle);

		least = fmin(least, ratio);
		most = fmax(most, ratio);
	}
	return is->scales > 1 && isfinite(most / least) ? most / least - 1 : 0;
}

/* Beyond noise: 1 more, -1 less, else 0. A time is, where it is so in each yardstick. */
static int changed(const struct figure *was, const struct figure *is)
{
	static const double noises[KINDS] = {COMPARE_TIME_NOISE, COMPARE_MEASURED_NOISE,
					     COMPARE_EXACT};
	double noise = noises[is->kind] + disagreement(was, is);
	int more = 0, less = 0;

	for (int i = 0; i < is->scales; i++) {
		const struct interval *a = &was->by[i], *b = &is->by[i];
		double least = noise * fmax(fabs(a->middle), fabs(b->middle));

		more += b->low - a->high > least;
		less += a->low - b->high > least;
	}
	return (more == is->scales) - (less == is->scales);
}

/* New by old; of a time the one that is nearest to 1, by which it is judged. */
static double ratio(const struct figure *was, const struct figure *is)
{
	double nearest = is->by[0].middle / was->by[0].middle;

	for (int i = 1; i < is->scales; i++) {
		double other = is->by[i].middle / was->by[i].middle;

		if (fabs(log(other)) < fabs(log(nearest)))
			nearest = other;
	}
	return nearest;
}

static json_t *figure_json(const struct figure *f)
{
	return json_pack("{ss? ss ss ss}", "word", f->word, "name", f->name, "kind",
			 kind_names[f->kind], "unit", f->unit);
}

static json_t *change_json(const struct figure *was, const struct figure *is, bool worse)
{
	json_t *change = figure_json(is);

	json_object_set_new(change, "old", json_number(was->value));
	json_object_set_new(change, "new", json_number(is->value));
	json_object_set_new(change, "ratio", json_number(ratio(was, is)));
	json_object_set_new(change, "worse", json_boolean(worse));
	return change;
}

/* Figures of @from that @to has not. A word that is not there at all is one line. */
static json_t *missing(const struct figures *from, const struct figures *to)
{
	char key[NAME_MAX_BYTES + 2];
	const char *word = NULL;
	bool known = true;
	json_t *list = json_array();

	for (int i = 0; i < from->n; i++) {
		const struct figure *f = &from->figure[i];

		/* Figures of a word are together. */
		if (f->word && f->word != word) {
			word = f->word;
			known = json_object_get(to->index,
						key_of_word(word, key, sizeof(key)));
			if (!known)
				json_array_append_new(list, json_pack("{ss sn}", "word",
								      word, "name"));
		}
		if (known && !find(to, f))
			json_array_append_new(list, figure_json(f));
	}
	return list;
}

static const json_t *part_of(const json_t *report, const char *key)
{
	const json_t *is = json_object_get(report, key), *member;
	const char *word;

	if (is)
		return is;
	json_object_foreach((json_t *)report, word, member)
	{
		is = json_object_get(member, key);
		if (is && json_object_get(member, "figures"))
			return is;
	}
	return NULL;
}

/* What of machine and build is not the same, by its key. */
static json_t *differing(const json_t *old_report, const json_t *new_report)
{
	static const char *const keys[] = {"version",	 "cpu",	       "compiler",
					   "flags",	 "kernel",     "vectors",
					   "preempt_rt", "hypervisor", "processors",
					   "governor"};
	const json_t *was = part_of(old_report, "machine"),
		     *is = part_of(new_report, "machine");
	json_t *list = json_array();

	for (size_t i = 0; i < sizeof(keys) / sizeof(*keys); i++) {
		const json_t *a = json_object_get(was, keys[i]),
			     *b = json_object_get(is, keys[i]);

		if ((a || b) && !json_equal(a, b))
			json_array_append_new(list, json_string(keys[i]));
	}
	return list;
}

static json_t *compare_all(struct figures *was, struct figures *is, const json_t *differs)
{
	json_t *list = json_array();
	int same = 0, better = 0, worse = 0;

	for (int i = 0; i < is->n; i++) {
		const struct figure *f = &is->figure[i], *before = find(was, f);
		int way = before ? changed(before, f) : 0;
		bool bad = way > 0 ? !f->more_is_better : f->more_is_better;

		if (!way) {
			same += before != NULL;
			continue;
		}
		worse += bad;
		better += !bad;
		json_array_append_new(list, change_json(before, f, bad));
	}
	return json_pack("{sO so so so si si si}", "differs", differs, "changed", list,
			 "gone", missing(was, is), "new", missing(is, was), "same", same,
			 "better", better, "worse", worse);
}

static int comparable(const struct figures *was, const struct figures *is,
		      const json_t *old_report, const json_t *new_report,
		      struct incise_error *err)
{
	const json_t *old_quick = part_of(old_report, "quick"),
		     *new_quick = part_of(new_report, "quick");

	if (json_is_boolean(old_quick) && json_is_boolean(new_quick) &&
	    json_is_true(old_quick) != json_is_true(new_quick))
		return incise_error_set(
			err, EINVAL,
			"%s is of --quick and %s is not: they measured "
			"other things",
			json_is_true(old_quick) ? was->report : is->report,
			json_is_true(old_quick) ? is->report : was->report);
	for (int i = 0; i < is->n; i++)
		if (find(was, &is->figure[i]))
			return 0;
	return incise_error_set(err, EINVAL,
				"%s and %s have no figure in common: compare two of one "
				"word, or two of incise bench all",
				was->report, is->report);
}

json_t *compare_reports(const json_t *old_report, const char *old_name,
			const json_t *new_report, const char *new_name,
			struct incise_error *err)
{
	json_t *comparison = NULL, *differs = NULL;
	struct figures was, is = {0};
	int rc = read_figures(old_report, old_name, &was, err);

	if (!rc)
		rc = read_figures(new_report, new_name, &is, err);
	if (!rc)
		rc = comparable(&was, &is, old_report, new_report, err);
	if (!rc) {
		differs = differing(old_report, new_report);
		comparison = compare_all(&was, &is, differs);
		json_decref(differs);
		if (!comparison)
			incise_error_set(err, ENOMEM, "no memory for a comparison");
	}
	free_figures(&was);
	free_figures(&is);
	return comparison;
}

int compare_worse(const json_t *comparison)
{
	return (int)json_integer_value(json_object_get(comparison, "worse")) +
	       (int)json_array_size(json_object_get(comparison, "gone"));
}

/* ---- report ---- */

static const char *text_of(const json_t *object, const char *key)
{
	return json_string_value(json_object_get(object, key));
}

static void name_of(const json_t *figure, char *name, size_t size)
{
	const char *word = text_of(figure, "word"), *is = text_of(figure, "name");

	snprintf(name, size, "%s%s%s", word ? word : "", word && is ? ": " : "",
		 is ? is : "");
}

static void print_names(const json_t *comparison, const char *key)
{
	const json_t *figure;
	char name[2 * NAME_MAX_BYTES];
	size_t i;

	json_array_foreach(json_object_get(comparison, key), i, figure)
	{
		name_of(figure, name, sizeof(name));
		printf("%s: %s\n", key, name);
	}
}

void compare_print(const json_t *comparison)
{
	const json_t *differs = json_object_get(comparison, "differs"),
		     *list = json_object_get(comparison, "changed"), *change;
	char name[2 * NAME_MAX_BYTES];
	size_t i;

	for (i = 0; i < json_array_size(differs); i++)
		printf("%s%s", i ? ", " : "another machine or build: ",
		       json_string_value(json_array_get(differs, i)));
	if (i)
		printf("\n");
	if (json_array_size(list))
		printf("%-52s %12s %12s %8s\n", "changed beyond noise", "old", "new",
		       "ratio");
	json_array_foreach((json_t *)list, i, change)
	{
		name_of(change, name, sizeof(name));
		printf("%-52s %12.5g %12.5g", name,
		       json_number_value(json_object_get(change, "old")),
		       json_number_value(json_object_get(change, "new")));
		/* From 0 there is none. */
		if (json_is_null(json_object_get(change, "ratio")))
			printf(" %8s", "-");
		else
			printf(" %8.3f",
			       json_number_value(json_object_get(change, "ratio")));
		printf(" %s, %s\n", text_of(change, "unit"),
		       json_is_true(json_object_get(change, "worse")) ? "worse"
								      : "better");
	}
	print_names(comparison, "gone");
	print_names(comparison, "new");
	printf("%lld same, %lld better, %lld worse, %zu gone, %zu new\n",
	       (long long)json_integer_value(json_object_get(comparison, "same")),
	       (long long)json_integer_value(json_object_get(comparison, "better")),
	       (long long)json_integer_value(json_object_get(comparison, "worse")),
	       json_array_size(json_object_get(comparison, "gone")),
	       json_array_size(json_object_get(comparison, "new")));
}

void compare_finish(json_t *comparison, bool json)
{
	int worse = compare_worse(comparison);

	if (json) {
		json_print(comparison);
	} else {
		compare_print(comparison);
		json_decref(comparison);
		cli_finish();
	}
	if (worse)
		cli_fail("%d figure%s worse or gone, see above", worse,
			 worse > 1 ? "s are" : " is");
}

/* ---- --against ---- */

/* In the first process: what the other one said, and how it ended. */
static void wait_and_compare(pid_t pid, const struct memory_file *said, const char *path,
			     json_t *old_report, bool json)
{
	struct incise_error err = {0};
	json_t *report, *comparison;
	int status, worse;

	/* A Ctrl-C is for who measures. */
	signal(SIGINT, SIG_IGN);
	while (waitpid(pid, &status, 0) < 0)
		if (errno != EINTR)
			cli_fail("what measures is lost: %s", strerror(errno));
	rewind(said->file);
	/* What failed before it had a report has said why. */
	report = read_file(said->file, "the report", &err);
	if (!report && status)
		_exit(WIFEXITED(status) ? WEXITSTATUS(status) : 1);
	comparison = report ? compare_reports(old_report, path, report, "this run", &err)
			    : NULL;
	if (!comparison)
		cli_fail_with(&err);
	if (json) {
		worse = compare_worse(comparison);
		json_object_set_new(report, "against", comparison);
		json_print(report);
		if (worse)
			cli_fail("%d worse or gone against %s", worse, path);
	} else {
		compare_finish(comparison, false);
	}
	exit(WIFEXITED(status) ? WEXITSTATUS(status) : 1);
}

void compare_against(const char *path, bool json)
{
	struct memory_file said = memory_file_begin("report");
	struct incise_error err = {0};
	json_t *old_report = compare_load(path, &err), *itself;
	pid_t parent = getpid(), pid;

	/* One that is no report is said now, not after the work. */
	itself = old_report ? compare_reports(old_report, path, old_report, path, &err)
			    : NULL;
	if (!itself)
		cli_fail_with(&err);
	json_decref(itself);
	fflush(stdout);
	pid = fork();
	if (pid < 0)
		cli_fail("no process to measure in: %s", strerror(errno));
	if (pid)
		wait_and_compare(pid, &said, path, old_report, json);
	prctl(PR_SET_PDEATHSIG, SIGTERM);
	if (getppid() != parent)
		_exit(1);
	if (dup2(fileno(said.file), STDOUT_FILENO) < 0)
		cli_fail("no output to report to: %s", strerror(errno));
	fclose(said.file);
	json_decref(old_report);
}
