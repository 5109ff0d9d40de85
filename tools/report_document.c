// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Summary, how it was run, a section for each word; see report_document.h. What is said of a
 * word stands in report_sections.c, what was measured in the JSON.
 */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "cli.h"
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

/* ---- what failed ---- */

/* Rows that say why they failed, wherever they are. */
static void put_failed_rows(struct document *d, const char *word, const json_t *value)
{
	static const char *const names[] = {"name", "integrator", "wall", "load"};
	const json_t *member;
	const char *key, *why = text_at(value, "failed");
	size_t i;

	if (*why) {
		const char *name = "";

		for (i = 0; i < sizeof(names) / sizeof(*names) && !*name; i++)
			name = text_at(value, names[i]);
		document_item(d, "%s: %s: %s", word, name, why);
	}
	json_array_foreach((json_t *)value, i, member) put_failed_rows(d, word, member);
	json_object_foreach((json_t *)value, key, member)
	{
		if (strcmp(key, "integrators"))
			put_failed_rows(d, word, member);
	}
}

static void put_failed(struct document *d, const json_t *report)
{
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
		put_failed_rows(d, word, word_json);
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
	char file[100];

	document_section(d, s->title);
	document_text(d, "%s", s->question);
	put_pictures(d, s, folder);
	for (const struct report_table *t = s->tables; t->rows; t++)
		report_table_put(d, t, word);
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
	for (const struct report_section *s = report_sections; s->word; s++) {
		const json_t *word = word_of(report, s->word);

		if (word)
			put_section(d, s, word, folder);
	}
	put_failed(d, report);
	return d;
}
