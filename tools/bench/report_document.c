// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Summary, how it was run, a section for each word; see report_document.h. What is said of a
 * word stands in report_sections.c, what was measured in the JSON.
 */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../cli/cli.h"
#include "report_document.h"
#include "report_sections.h"
#include "report_table.h"

#define FAILED "What failed or was left out"

static const char *text_at(const json_t *object, const char *key)
{
	const char *text = json_string_value(json_object_get(object, key));

	return text ? text : "";
}

static const json_t *word_of(const json_t *report, const char *word)
{
	return json_object_get(json_object_get(report, "words"), word);
}

static const struct report_section *section_of(const char *word)
{
	const struct report_section *s = report_sections;

	while (s->word && strcmp(s->word, word))
		s++;
	return s->word ? s : NULL;
}

/* ---- summary ---- */

static void put_facts(struct document *d, const json_t *report, int promise)
{
	bool begun = false;

	for (const struct report_fact *f = report_facts; f->word; f++) {
		char text[200];

		if (f->promise != promise ||
		    !report_fact_text(f, word_of(report, f->word), text, sizeof(text)))
			continue;
		if (!begun) {
			document_table(d, "The figures that matter most");
			document_column(d, "what", false);
			document_column(d, "figure", true);
			document_column(d, "more", false);
		}
		begun = true;
		document_cell(d, "%s", f->what);
		document_cell(d, "%s%s%s", text, *f->unit ? " " : "", f->unit);
		document_cell_to(d, section_of(f->word)->title, f->word);
	}
	if (!begun)
		document_text(d, "Nothing of this was measured.");
}

static void put_summary(struct document *d, const json_t *report)
{
	document_section(d, "Summary");
	if (json_is_true(json_object_get(report, "quick")))
		document_notice(d,
				"A look with --quick, and not a measurement: few points "
				"and repeats, short runs.");
	if (json_array_size(json_object_get(report, "failed")))
		document_notice(
			d,
			"Not all of it was measured, or came out as it should: see "
			"“%s”.",
			FAILED);
	for (int i = 0; report_promises[i].title; i++) {
		document_heading(d, report_promises[i].title);
		document_text(d, "%s", report_promises[i].text);
		put_facts(d, report, i + 1);
	}
}

/* ---- how it was run ---- */

static void put_machine(struct document *d, const json_t *machine)
{
	const json_t *value;
	const char *key;
	char text[64];

	document_table(d, "Machine and build");
	document_column(d, "what", false);
	document_column(d, "is", false);
	json_object_foreach((json_t *)machine, key, value)
	{
		if (!json_is_string(value) && !json_is_number(value) &&
		    !json_is_boolean(value))
			continue;
		document_cell(d, "%s", key);
		if (json_is_number(value)) {
			report_number(json_number_value(value), 6, text, sizeof(text));
			document_cell(d, "%s", text);
		} else if (json_is_string(value)) {
			document_cell(d, "%s", json_string_value(value));
		} else {
			document_cell(d, "%s", json_is_true(value) ? "yes" : "no");
		}
	}
}

static void put_times(struct document *d, const json_t *report)
{
	const json_t *runs = json_object_get(report, "runs"), *run;
	const char *word;
	char text[64];

	document_table(d, "How long it took");
	document_column(d, "word", false);
	document_column(d, "time, s", true);
	document_column(d, "came out", false);
	json_object_foreach((json_t *)runs, word, run)
	{
		const struct report_section *s = section_of(word);

		if (!s)
			continue;
		report_number(json_number_value(json_object_get(run, "seconds")), 3, text,
			      sizeof(text));
		if (word_of(report, word))
			document_cell_to(d, s->title, word);
		else
			document_cell(d, "%s", word);
		document_cell(d, "%s", text);
		document_cell(d, "%s", text_at(run, "state"));
	}
}

static void put_way(struct document *d, const json_t *report)
{
	document_section(d, "How it was run");
	document_text(d,
		      "Every figure here comes from one command, which anyone can repeat "
		      "without any of the hardware:");
	document_command(d, "%s", text_at(report, "command"));
	document_text(
		d,
		"It ran on %s, by incise %s. What each word reported is in the folder "
		"data, all of it together in report.json; --json and the keys are "
		"documented in incise-bench(1).",
		text_at(report, "date"), text_at(report, "version"));
	document_text(
		d, "Times are medians of ways that take turns on one processor. Where "
		   "several norms of an error are given, rms is the root mean square and "
		   "largest is of all that was tried. “–” is what does not apply.");
	put_machine(d, json_object_get(report, "machine"));
	put_times(d, report);
}

/* ---- what changed ---- */

static void put_names(struct document *d, const char *title, const json_t *figures)
{
	const json_t *figure;
	size_t i;

	json_array_foreach((json_t *)figures, i, figure)
	{
		const char *name = text_at(figure, "name");

		document_item(d, "%s: %s%s%s", title, text_at(figure, "word"),
			      *name ? ": " : "", name);
	}
}

static void put_changed(struct document *d, const json_t *against)
{
	static const struct report_table changed = {
		"Changed beyond noise; the ratio of times is of multiples of a yardstick",
		"changed",
		NULL,
		{{"word", "word", 0, PART_VALUE, 0},
		 {"name", "figure", 0, PART_VALUE, 0},
		 {"kind", "kind", 0, PART_VALUE, 0},
		 {"unit", "unit", 0, PART_VALUE, 0},
		 {"old", "old", 4, PART_VALUE, 0},
		 {"new", "new", 4, PART_VALUE, 0},
		 {"ratio", "ratio", 4, PART_VALUE, 0},
		 {"worse", "worse", 0, PART_VALUE, 0}}};
	const json_t *differs = json_object_get(against, "differs"), *key;
	size_t i;

	document_section(d, "What changed");
	document_text(d, "Against %s.", text_at(against, "file"));
	if (*text_at(against, "failed")) {
		document_notice(d, "They cannot be compared: %s.",
				text_at(against, "failed"));
		return;
	}
	document_text(d,
		      "%lld figures are the same within noise, %lld better, %lld worse.",
		      (long long)json_integer_value(json_object_get(against, "same")),
		      (long long)json_integer_value(json_object_get(against, "better")),
		      (long long)json_integer_value(json_object_get(against, "worse")));
	json_array_foreach((json_t *)differs, i, key)
		document_item(d, "Another machine or build: %s differs",
			      json_is_string(key) ? json_string_value(key) : "it");
	report_table_put(d, &changed, against);
	put_names(d, "Gone", json_object_get(against, "gone"));
	put_names(d, "New", json_object_get(against, "new"));
}

/* ---- what failed ---- */

#define MOST_FAILED 40 /* rows of a word; the JSON has all */

/* What tells a row that failed from its neighbours: its texts, and what was set for it. */
static void row_name(const json_t *row, char *name, size_t size)
{
	static const char *const set[] = {"rate_hz", "tracker_hz", "delay_ms",
					  "gap_ms",  "window_s",   "drift_ppm",
					  "K_N_m",   "K_N_mm",	   "stiffness_N_mm"};
	const json_t *value;
	const char *key;
	size_t n = 0;

	*name = 0;
	json_object_foreach((json_t *)row, key, value)
	{
		bool told = json_is_string(value) && strcmp(key, "failed");
		char number[64];

		for (size_t i = 0; i < sizeof(set) / sizeof(*set) && !told; i++)
			told = json_is_number(value) && !strcmp(key, set[i]);
		if (!told || n >= size)
			continue;
		report_number(json_number_value(value), 4, number, sizeof(number));
		n += (size_t)snprintf(name + n, size - n, "%s%s%s%s", n ? ", " : "",
				      json_is_string(value) ? "" : key,
				      json_is_string(value) ? "" : " ",
				      json_is_string(value) ? json_string_value(value)
							    : number);
	}
}

struct failed_rows {
	struct document *d;
	bool begun; /* the table */
	int n;	    /* of this word */
};

static void put_failed_row(struct failed_rows *rows, const char *word, const char *name,
			   const char *why)
{
	if (!rows->begun) {
		document_table(rows->d, "Rows that failed");
		document_column(rows->d, "word", false);
		document_column(rows->d, "row", false);
		document_column(rows->d, "why", false);
		rows->begun = true;
	}
	document_cell(rows->d, "%s", word);
	document_cell(rows->d, "%s", name);
	document_cell(rows->d, "%s", why);
}

/* Rows that say why they failed, wherever they are. */
static void put_failed_rows(struct failed_rows *rows, const char *word,
			    const json_t *value)
{
	const json_t *member;
	const char *key, *why = text_at(value, "failed");
	char name[200];
	size_t i;

	if (*why && rows->n++ < MOST_FAILED) {
		row_name(value, name, sizeof(name));
		put_failed_row(rows, word, name, why);
	}
	json_array_foreach((json_t *)value, i, member)
		put_failed_rows(rows, word, member);
	json_object_foreach((json_t *)value, key, member)
	{
		if (strcmp(key, "integrators"))
			put_failed_rows(rows, word, member);
	}
}

static void put_failed(struct document *d, const json_t *report)
{
	struct failed_rows rows = {.d = d};
	const json_t *run, *word_json;
	const char *word;

	document_section(d, FAILED);
	document_text(
		d,
		"Whole words first, what they warned of, then single rows: some fail as "
		"they should, such as a table that is too large. Integrators that "
		"diverge are counted in their own table.");
	json_object_foreach(json_object_get(report, "runs"), word, run)
	{
		const json_t *line;
		size_t i;

		if (strcmp(text_at(run, "state"), "measured"))
			document_item(d, "%s: %s: %s", word, text_at(run, "state"),
				      text_at(run, "why"));
		json_array_foreach(json_object_get(run, "warnings"), i, line)
			document_item(d, "%s: %s", word, json_string_value(line));
	}
	json_object_foreach(json_object_get(report, "words"), word, word_json)
	{
		char more[40];

		rows.n = 0;
		put_failed_rows(&rows, word, word_json);
		if (rows.n > MOST_FAILED) {
			snprintf(more, sizeof(more), "%d more", rows.n - MOST_FAILED);
			put_failed_row(&rows, word, more, "as in its JSON");
		}
	}
}

/* ---- words ---- */

static void put_pictures(struct document *d, const struct report_section *s,
			 const char *folder)
{
	for (const struct report_picture *p = s->pictures; p->part; p++) {
		char file[100], *path;

		snprintf(file, sizeof(file), "pictures/%s%s%s.svg", s->word,
			 *p->part ? "-" : "", p->part);
		if (asprintf(&path, "%s/%s", folder, file) < 0)
			cli_fail("no memory");
		if (!access(path, R_OK))
			document_picture(d, file, p->caption, p->instead);
		free(path);
	}
}

static void put_section(struct document *d, const struct report_section *s,
			const json_t *word, const char *folder)
{
	const json_t *value;
	const char *key;
	char file[100];

	document_section(d, s->title);
	document_text(d, "%s", s->question);
	put_pictures(d, s, folder);
	for (const struct report_table *t = s->tables; t->rows; t++)
		report_table_put(d, t, word);
	json_object_foreach((json_t *)word, key, value)
	{
		size_t n = strlen(key);

		if (json_is_string(value) && n > 7 && !strcmp(key + n - 7, "_failed"))
			document_text(d, "Failed: %.*s. Why: %s", (int)n - 7, key,
				      json_string_value(value));
	}
	document_item(d, "Method: %s", s->method);
	document_item(d, "Reference: %s", s->reference);
	document_item(d, "Limits: %s", s->limits);
	snprintf(file, sizeof(file), "data/%s.json", s->word);
	document_file(d, file, "All figures, as JSON:");
}

struct document *report_document(const json_t *report, const char *folder)
{
	struct document *d = document_new(
		"incise: error against run time, and what each scene leaves out");

	put_summary(d, report);
	put_way(d, report);
	if (json_is_object(json_object_get(report, "against")))
		put_changed(d, json_object_get(report, "against"));
	for (const struct report_section *s = report_sections; s->word; s++) {
		const json_t *word = word_of(report, s->word);

		if (word)
			put_section(d, s, word, folder);
	}
	put_failed(d, report);
	return d;
}
