// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench all --report DIR: every word of incise bench, one after the other, as one
 * report that anyone can repeat. Each word is a program of its own, so that none meets what
 * another has left in memory.
 *
 *   incise-bench WORD --json ─▶ DIR/data/WORD.json ─┐
 *                     --plot ─▶ DIR/pictures/       ├─▶ DIR/report.{json,html,md}
 */
#include <errno.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/version.h>
#include "cli/cli.h"
#include "bench/compare.h"
#include "cli/json.h"
#include "bench/machine.h"
#include "bench/report_folder.h"
#include "bench/report_measure.h"
#include "bench/report_sections.h"

enum { OPT_REPORT = CLI_LONG, OPT_FROM, OPT_AGAINST, OPT_ONLY, OPT_QUICK, OPT_JSON };

static const struct cli_option options[] = {
	{OPT_REPORT, "report", "DIR",
	 "folder to leave everything in; a report that is there\nis replaced"},
	{OPT_FROM, "from", "DIR",
	 "measure nothing: write report.html and report.md of\nDIR/report.json again"},
	{OPT_AGAINST, "against", "OLD.json",
	 "say what changed beyond noise since that report.json"},
	{OPT_ONLY, "only", "WORD,...", "these words only"},
	{OPT_QUICK, "quick", NULL, "fewer points and repeats: a look, not a measurement"},
	{OPT_JSON, "json", NULL, "print report.json, too"},
	{0},
};

static const struct cli_command verb = {
	.name = "bench all",
	.synopsis = "--report DIR [OPTIONS]",
	.summary =
		"Run every bench and leave one report: report.html to read, on a phone and on\n"
		"paper, too; report.md, the same; report.json; pictures; the JSON of each word.",
	.options = options,
	.notes =
		"Exit: 0 done, 1 failed, a word has, or figures got worse: the report says\n"
		"which and why; 2 bad usage. See incise-bench-all(1).",
};

#define WORDS 32

struct job {
	const char *folder, *from, *against;
	char *only[WORDS];
	int n_only;
	bool quick, json;
};

static bool wanted(const struct job *job, const char *word)
{
	for (int i = 0; i < job->n_only; i++)
		if (!strcmp(job->only[i], word))
			return true;
	return !job->n_only;
}

static void check_words(const struct job *job)
{
	for (int i = 0; i < job->n_only; i++) {
		const struct report_section *s = report_sections;

		while (s->word && strcmp(s->word, job->only[i]))
			s++;
		if (!s->word)
			cli_usage("--only: '%s' is no word of incise bench",
				  job->only[i]);
	}
}

/* What is typed to get the same; the folder is another on another machine. */
static json_t *command(const struct job *job)
{
	char line[600];
	int n = snprintf(line, sizeof(line), "incise bench all --report DIR%s",
			 job->quick ? " --quick" : "");

	for (int i = 0; i < job->n_only; i++)
		n += snprintf(line + n, sizeof(line) - (size_t)n, "%s%.30s",
			      i ? "," : " --only ", job->only[i]);
	return json_text(line);
}

static json_t *begin_report(const struct job *job)
{
	struct machine machine;
	time_t now = time(NULL);
	struct tm utc;
	char date[40];

	machine_init(&machine);
	gmtime_r(&now, &utc);
	strftime(date, sizeof(date), "%Y-%m-%d %H:%M UTC", &utc);
	return json_pack("{ss ss so sb so so so so so}", "version", incise_version(),
			 "date", date, "command", command(job), "quick", job->quick,
			 "machine", machine_json(&machine), "runs", json_object(),
			 "failed", json_array(), "words", json_object(), "figures",
			 json_array());
}

/* Of a report of all words; of one word it is that. */
static const json_t *words_of(const json_t *report)
{
	const json_t *words = json_object_get(report, "words");

	return words ? words : report;
}

/* What changed goes into the report; that it cannot be told does, too. */
static void compare(const char *path, const json_t *old, json_t *report)
{
	struct incise_error err = {0};
	json_t *comparison =
		compare_reports(words_of(old), path, words_of(report), "this run", &err);

	if (!comparison)
		comparison = json_pack("{so}", "failed", json_text(err.text));
	json_object_set_new(comparison, "file", json_text(path));
	json_object_set_new(report, "against", comparison);
}

static json_t *measure(const struct job *job)
{
	struct report_folder folder;
	struct report_measure m = {.quick = job->quick};
	struct incise_error err = {0};
	json_t *old = job->against ? compare_load(job->against) : NULL;
	int n = 0, of = 0;

	report_folder_begin(&folder, job->folder);
	m.folder = folder.unfinished;
	m.report = begin_report(job);
	for (const struct report_section *s = report_sections; s->word; s++)
		of += wanted(job, s->word);
	for (const struct report_section *s = report_sections; s->word && !cli_stop; s++)
		if (wanted(job, s->word))
			report_measure(&m, s, ++n, of);
	if (cli_stop) {
		report_folder_abandon(&folder);
		cli_fail("%s: %s is as it was", strsignal(cli_stop), job->folder);
	}
	if (old)
		compare(job->against, old, m.report);
	json_decref(old);
	if (report_folder_write(folder.unfinished, m.report, &err)) {
		report_folder_abandon(&folder);
		cli_fail_with(&err);
	}
	report_folder_finish(&folder);
	return m.report;
}

static void parse(struct job *job, int argc, char **argv)
{
	int opt;

	*job = (struct job){0};
	while ((opt = cli_next(&verb, argc, argv)) != CLI_END)
		switch (opt) {
		case OPT_REPORT:
			job->folder = optarg;
			break;
		case OPT_FROM:
			job->from = optarg;
			break;
		case OPT_AGAINST:
			job->against = optarg;
			break;
		case OPT_ONLY:
			job->n_only = cli_list("only", optarg, job->only, WORDS);
			break;
		case OPT_QUICK:
			job->quick = true;
			break;
		case OPT_JSON:
			job->json = true;
			break;
		}
	if (optind < argc)
		cli_usage("'%s': bench all takes options only", argv[optind]);
	if (!job->folder == !job->from)
		cli_usage("expected --report DIR, or --from DIR");
	if (job->from && (job->quick || job->n_only || job->against))
		cli_usage(
			"--from measures nothing; --against, --only and --quick go with "
			"--report");
	if (!*(job->folder ? job->folder : job->from))
		cli_usage("the folder has no name");
	check_words(job);
}

/* The one line of what is not as it should be, and what of it is first. */
static void judge(const struct job *job, const json_t *report)
{
	const json_t *against = json_object_get(report, "against");
	size_t failed = json_array_size(json_object_get(report, "failed"));
	const char *why = json_string_value(json_object_get(against, "failed"));
	int worse = compare_worse(against);

	if (!json_object_size(json_object_get(report, "words")) && !failed)
		cli_fail("nothing was measured; %s/report.md says why", job->folder);
	if (failed)
		cli_fail("%zu of %zu words failed; %s/report.md says why", failed,
			 json_object_size(json_object_get(report, "runs")), job->folder);
	if (why)
		cli_fail("%s", why);
	if (worse)
		cli_fail("%d figure%s worse or gone against %s; %s/report.md says which",
			 worse, worse > 1 ? "s are" : " is", job->against, job->folder);
}

int main(int argc, char **argv)
{
	struct incise_error err = {0};
	struct job job;
	json_t *report;

	parse(&job, argc, argv);
	cli_catch_signals();
	if (job.from) {
		report = report_folder_load(job.from);
		if (report_folder_write(job.from, report, &err))
			cli_fail_with(&err);
	} else {
		report = measure(&job);
	}
	if (job.json)
		json_print(json_incref(report));
	else
		printf("%s/report.html, report.md, report.json: figures of %zu of %zu words\n",
		       job.folder ? job.folder : job.from,
		       json_object_size(json_object_get(report, "words")),
		       json_object_size(json_object_get(report, "runs")));
	cli_finish();
	if (job.folder)
		judge(&job, report);
	json_decref(report);
	return 0;
}
