// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench all -o DIR: every benchmark of incise bench, one after the other, as one
 * report that anyone can repeat. This program becomes tools/report/measure.py, which runs them.
 */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include <incise/version.h>
#include "bench/metrics.h"
#include "cli/machine.h"
#include "cli/cli.h"
#include "cli/file.h"
#include "cli/folder.h"
#include "cli/json.h"
#include "cli/report_script.h"

/* In the order of the report. */
static const char *const benchmarks[] = {"precision", "training", "realism", "stability",
					 "loop",      "view",	  "scenes",  NULL};
#define BENCHMARKS (int)(sizeof(benchmarks) / sizeof(*benchmarks) - 1)

struct bench_all_job {
	const char *folder, *from, *against;
	char *only[BENCHMARKS];
	int n_only;
	bool quick, json;
};

static void parse_only(void *options, char *text)
{
	struct bench_all_job *job = options;

	job->n_only = cli_list("only", text, job->only, BENCHMARKS);
	for (int i = 0; i < job->n_only; i++)
		cli_choice("only", job->only[i], benchmarks);
}

static const struct cli_option options[] = {
	{'o', "output", "DIR", "folder to write everything to",
	 CLI_OUTPUTS(struct bench_all_job, folder)},
	{0, "from", "DIR",
	 "measure nothing: write report.html and report.md of DIR/report.json "
	 "again",
	 CLI_TEXT(struct bench_all_job, from)},
	{0, "against", "OLD.json",
	 "report what changed beyond noise since that report.json",
	 CLI_INPUT(struct bench_all_job, against)},
	{0, "only", "LIST", "these benchmarks only", CLI_PARSED_BY(parse_only)},
	{0, "quick", NULL, "smoke test: few points and repeats, not for publication",
	 CLI_FLAG(struct bench_all_job, quick)},
	{0, "json", NULL, "print report.json, too", CLI_FLAG(struct bench_all_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "bench all",
	.synopsis = "-o DIR [OPTIONS]",
	.summary =
		"Run every benchmark and write one report: report.html to read, on a "
		"phone and on paper, too; report.md, the same; report.json; plots; the "
		"JSON of each benchmark.",
	.options = options,
	.failure =
		"failure, or a benchmark failed, or metrics got worse: the report lists "
		"which and why",
};

/* --- the folder --- */

/* A report, or one that was never finished; or nothing at all. */
static bool may_be_replaced(const char *path)
{
	DIR *folder = opendir(path);
	struct dirent *entry;
	bool empty = true;
	json_t *report = json_read(cli_text("%s/report.json", path), NULL);
	bool is_report = json_is_object(json_object_get(report, "benchmarks"));

	if (!folder)
		cli_fail("%s: %s", path, strerror(errno));
	while ((entry = readdir(folder)))
		empty &= !strcmp(entry->d_name, ".") || !strcmp(entry->d_name, "..") ||
			 !strcmp(entry->d_name, ".unfinished");
	closedir(folder);
	return empty || is_report;
}

/* Files of a report that is there are replaced with --overwrite only. */
static void reserve_files(const char *folder, bool texts)
{
	static const char *const names[] = {"report.html", "report.md", "report.json"};

	for (int i = 0; i < (texts ? 2 : 3); i++)
		cli_output(cli_text("%s/%s", folder, names[i]));
}

/* Fail the program when there is something else at that path. Returns whether it is new. */
static bool prepare_folder(const char *path)
{
	bool made = access(path, F_OK);

	folder_make_all(path);
	if (!made && !may_be_replaced(path))
		cli_fail("%s: not empty and not a report; give another -o DIR", path);
	reserve_files(path, false);
	return made;
}

static void require_report(const char *folder)
{
	char *file = cli_text("%s/report.json", folder);
	struct incise_error err = {0};
	json_t *report = cli_require(json_read(file, &err), &err);

	if (!json_is_object(json_object_get(report, "benchmarks")))
		cli_fail("%s: not a report of 'incise bench all'", file);
	reserve_files(folder, true);
}

/* --- the script --- */

static bool wanted(const struct bench_all_job *job, const char *benchmark)
{
	for (int i = 0; i < job->n_only; i++)
		if (!strcmp(job->only[i], benchmark))
			return true;
	return !job->n_only;
}

static json_t *wanted_names(const struct bench_all_job *job)
{
	json_t *names = json_array();

	for (int i = 0; i < BENCHMARKS; i++)
		if (wanted(job, benchmarks[i]))
			json_array_append_new(names, json_string(benchmarks[i]));
	return names;
}

/* The job of measure.py. */
static json_t *describe_job(const struct bench_all_job *job)
{
	json_t *old, *all;

	if (job->from) {
		require_report(job->from);
		return json_pack("{ss sb sn}", "folder", job->from, "json", job->json,
				 "benchmarks");
	}
	/* Before minutes of work. */
	old = job->against ? compare_load(job->against) : NULL;
	all = json_pack("{ss sb so sb}", "folder", job->folder, "json", job->json,
			"benchmarks", wanted_names(job), "quick", job->quick);
	json_object_set_new(all, "programs", json_text(cli_folder()));
	json_object_set_new(all, "only", json_boolean(job->n_only));
	json_object_set_new(all, "report",
			    json_with_schema(json_pack("{ss so}", "version",
						       incise_version(), "machine",
						       machine_json()),
					     NULL));
	if (old)
		json_object_update_new(all, json_pack("{ss so}", "against", job->against,
						      "old", old));
	json_object_set_new(all, "made", json_boolean(prepare_folder(job->folder)));
	return all;
}

/* The script takes the place of this program. */
static _Noreturn void run_script(json_t *all)
{
	struct memory_file file = memory_file_begin("job");
	char *argv[] = {REPORT_PYTHON, "-B", report_script_path("measure"), NULL};

	json_dumpf(all, file.file, JSON_COMPACT);
	memory_file_written(&file);
	rewind(file.file);
	dup2(fileno(file.file), STDIN_FILENO);
	execv(argv[0], argv);
	cli_fail("%s: %s", argv[0], strerror(errno));
}

/* --- the command line --- */

static void parse_bench_all(struct bench_all_job *job, int argc, char **argv)
{
	*job = (struct bench_all_job){0};
	cli_parse(&command, argc, argv, job);
	if (optind < argc)
		cli_usage("'%s': bench all takes options only", argv[optind]);
	if (!job->folder == !job->from)
		cli_usage("expected -o DIR, or --from DIR");
	if (job->from && (job->quick || job->n_only || job->against))
		cli_usage(
			"--from measures nothing; --against, --only and --quick go with "
			"-o");
	if (!*(job->folder ? job->folder : job->from))
		cli_usage("the folder has no name");
}

int main(int argc, char **argv)
{
	struct incise_error err = {0};
	struct bench_all_job job;

	parse_bench_all(&job, argc, argv);
	cli_check(report_script("check", NULL, NULL, NULL, &err), &err);
	run_script(describe_job(&job));
}
