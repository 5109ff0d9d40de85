// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench all -o DIR: every benchmark of incise bench, one after the other, as one
 * report that anyone can repeat. tools/report/measure.py runs them. A new report is made within
 * the folder, hidden, and takes the old one's place when it is whole.
 *
 *   incise-bench NAME --json ─▶ data/NAME.json ─┐
 *                     -o     ─▶ plots/         ├─▶ report.{json,html,md}
 *
 *   DIR/.unfinished/{data,plots,report.*}  ─▶  DIR/{data,plots,report.*}
 */
#include <dirent.h>
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <incise/outfile.h>
#include <incise/version.h>
#include "bench/metrics.h"
#include "bench/machine.h"
#include "cli/child.h"
#include "cli/cli.h"
#include "cli/file.h"
#include "cli/folder.h"
#include "cli/json.h"
#include "cli/report_script.h"

/* In the order of the report. */
static const char *const benchmarks[] = {"precision", "training", "stability", "loop",
					 "view",      "scenes",	  NULL};
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

struct folder {
	const char *path;
	char *unfinished;
	bool made; /* by us */
};

static void remove_all(const char *path)
{
	int rc = folder_remove(path);

	if (rc && rc != -ENOENT)
		cli_fail("%s: cannot be removed: %s", path, strerror(-rc));
}

/* A report, or one that was never finished; or nothing at all. */
static bool may_be_replaced(const char *path)
{
	DIR *folder = opendir(path);
	struct dirent *entry;
	bool empty = true;
	char *file = cli_text("%s/report.json", path);
	json_t *report = json_read(file, NULL);
	bool is_report = json_is_object(json_object_get(report, "benchmarks"));

	free(file);
	json_decref(report);
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

	for (int i = 0; i < (texts ? 2 : 3); i++) {
		char *path = cli_text("%s/%s", folder, names[i]);

		cli_output(path);
		free(path);
	}
}

/* Prepare a new report; fails the program when there is something else at that path. */
static struct folder folder_begin(const char *path)
{
	struct folder folder = {path, cli_text("%s/.unfinished", path), false};
	char *data = cli_text("%s/data", folder.unfinished),
	     *plots = cli_text("%s/plots", folder.unfinished);

	folder.made = access(path, F_OK);
	folder_make_all(path);
	if (!folder.made && !may_be_replaced(path))
		cli_fail("%s: not empty and not a report; give another -o DIR", path);
	reserve_files(path, false);
	remove_all(folder.unfinished);
	folder_make_all(data);
	folder_make_all(plots);
	free(data);
	free(plots);
	return folder;
}

/* Put the new report in the old one's place. */
static void folder_finish(const struct folder *folder)
{
	static const char *const parts[] = {"data", "plots", "report.json", "report.html",
					    "report.md"};

	for (size_t i = 0; i < sizeof(parts) / sizeof(*parts); i++) {
		char *from = cli_text("%s/%s", folder->unfinished, parts[i]),
		     *to = cli_text("%s/%s", folder->path, parts[i]);

		remove_all(to);
		if (rename(from, to) && errno != ENOENT)
			cli_fail("%s: %s", to, strerror(errno));
		free(from);
		free(to);
	}
	remove_all(folder->unfinished);
}

static void folder_abandon(const struct folder *folder)
{
	remove_all(folder->unfinished);
	if (folder->made)
		rmdir(folder->path);
}

/* report.json; fails the program where there is none. */
static json_t *load_report(const char *path)
{
	char *file = cli_text("%s/report.json", path);
	struct incise_error err = {0};
	json_t *report = cli_require(json_read(file, &err), &err);

	if (!json_is_object(json_object_get(report, "benchmarks")))
		cli_fail("%s: not a report of 'incise bench all'", file);
	free(file);
	return report;
}

/* --- the report --- */

/* report.json, whole or not at all. */
static int write_json(const char *path, json_t *report, struct incise_error *err)
{
	char *name = cli_text("%s/report.json", path);
	struct incise_outfile *file = incise_outfile_open(name, err);

	free(name);
	if (!file)
		return -errno;
	json_write(incise_outfile_stream(file), report, JSON_INDENT(1));
	return incise_outfile_commit(file, err);
}

/* report.json, and report.md and report.html of it. */
static int write_report(const char *path, json_t *report, struct incise_error *err)
{
	int rc = write_json(path, report, err);

	return rc ? rc : report_script("bench", path, NULL, NULL, err);
}

/* --- measurement --- */

#define POLL_US 50000

/* Into the folder; adds to the report. NULL where it was interrupted, or failed. */
static json_t *run_benchmarks(const char *folder, json_t *names, bool quick,
			      json_t *report)
{
	struct memory_file job = memory_file_begin("job"),
			   out = memory_file_begin("report");
	json_t *all = json_pack("{so sO sb so}", "programs", json_text(cli_folder()),
				"benchmarks", names, "quick", quick, "report", report),
	       *measured;
	char *script = report_script_path("measure");
	char *argv[] = {REPORT_PYTHON, "-B", script, job.path, (char *)folder, NULL};
	bool ended;
	int status;
	pid_t pid;

	json_dumpf(all, job.file, JSON_COMPACT);
	memory_file_written(&job);
	pid = child_start(argv, fileno(out.file), STDERR_FILENO);
	while (!(ended = child_ended(pid, &status)) && !cli_stop)
		usleep(POLL_US);
	if (!ended)
		child_end(pid, 0);
	rewind(out.file);
	measured = !ended || status ? NULL : json_loadf(out.file, 0, NULL);
	fclose(job.file);
	fclose(out.file);
	free(script);
	json_decref(all);
	return measured;
}

static bool wanted(const struct bench_all_job *job, const char *benchmark)
{
	for (int i = 0; i < job->n_only; i++)
		if (!strcmp(job->only[i], benchmark))
			return true;
	return !job->n_only;
}

/* The command that gives the same; the folder is another on another machine. */
static json_t *command_of(const struct bench_all_job *job)
{
	char line[600];
	int n = snprintf(line, sizeof(line), "incise bench all -o DIR%s",
			 job->quick ? " --quick" : "");

	for (int i = 0; i < job->n_only; i++)
		n += snprintf(line + n, sizeof(line) - (size_t)n, "%s%.30s",
			      i ? "," : " --only ", job->only[i]);
	return json_text(line);
}

static json_t *begin_report(const struct bench_all_job *job)
{
	time_t now = time(NULL);
	struct tm utc;
	char date[40];

	gmtime_r(&now, &utc);
	strftime(date, sizeof(date), "%Y-%m-%d %H:%M UTC", &utc);
	return json_with_schema(json_pack("{ss ss so sb so so so so so}", "version",
					  incise_version(), "date", date, "command",
					  command_of(job), "quick", job->quick, "machine",
					  machine_json(), "runs", json_object(), "failed",
					  json_array(), "benchmarks", json_object(),
					  "figures", json_array()),
				NULL);
}

/* The benchmarks in a report of all; a report of one benchmark is itself. */
static const json_t *benchmarks_of(const json_t *report)
{
	const json_t *words = json_object_get(report, "benchmarks");

	return words ? words : report;
}

/* The comparison goes into the report, or the reason why there is none. */
static void compare_bench_all(const char *path, const json_t *old, json_t *report)
{
	struct incise_error err = {0};
	json_t *comparison = compare_reports(benchmarks_of(old), path,
					     benchmarks_of(report), "this run", &err);

	if (!comparison)
		comparison = json_pack("{so}", "failed", json_text(err.text));
	json_object_del(comparison, "text");
	json_object_set_new(comparison, "file", json_text(path));
	json_object_set_new(report, "against", comparison);
}

static json_t *measure_bench_all(const struct bench_all_job *job)
{
	json_t *old = job->against ? compare_load(job->against) : NULL;
	json_t *names = json_array(), *report;
	struct incise_error err = {0};
	struct folder folder;

	/* Before minutes of work. */
	if (report_script("check", NULL, NULL, NULL, &err))
		cli_fail_with(&err);
	folder = folder_begin(job->folder);
	for (int i = 0; i < BENCHMARKS; i++)
		if (wanted(job, benchmarks[i]))
			json_array_append_new(names, json_string(benchmarks[i]));
	report = run_benchmarks(folder.unfinished, names, job->quick, begin_report(job));
	json_decref(names);
	if (!report) {
		folder_abandon(&folder);
		cli_fail("%s: %s is unchanged",
			 cli_stop ? strsignal(cli_stop) : "its script failed",
			 job->folder);
	}
	if (old)
		compare_bench_all(job->against, old, report);
	json_decref(old);
	if (write_report(folder.unfinished, report, &err)) {
		folder_abandon(&folder);
		cli_fail_with(&err);
	}
	folder_finish(&folder);
	free(folder.unfinished);
	return report;
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

/* One line for the worst that is not as it should be. */
static void judge_bench_all(const struct bench_all_job *job, const json_t *report)
{
	const json_t *against = json_object_get(report, "against");
	size_t failed = json_array_size(json_object_get(report, "failed"));
	const char *why = json_string_value(json_object_get(against, "failed"));
	int worse = compare_worse(against);

	if (!json_object_size(json_object_get(report, "benchmarks")) && !failed)
		cli_fail("nothing was measured; %s/report.md says why", job->folder);
	if (failed)
		cli_fail("%zu of %zu benchmarks failed; %s/report.md says why", failed,
			 json_object_size(json_object_get(report, "runs")), job->folder);
	if (why)
		cli_fail("%s", why);
	if (worse)
		cli_fail(
			"%d metric%s worse or missing compared with %s; %s/report.md says which",
			worse, worse > 1 ? "s are" : " is", job->against, job->folder);
}

int main(int argc, char **argv)
{
	struct incise_error err = {0};
	struct bench_all_job job;
	json_t *report;

	parse_bench_all(&job, argc, argv);
	cli_catch_signals();
	if (job.from) {
		report = load_report(job.from);
		reserve_files(job.from, true);
		if (report_script("bench", job.from, NULL, NULL, &err))
			cli_fail_with(&err);
	} else {
		report = measure_bench_all(&job);
	}
	if (job.json)
		json_print(json_incref(report));
	else
		printf("wrote %s/report.html, report.md, report.json: %zu of %zu benchmarks\n",
		       job.folder ? job.folder : job.from,
		       json_object_size(json_object_get(report, "benchmarks")),
		       json_object_size(json_object_get(report, "runs")));
	cli_finish();
	if (job.folder)
		judge_bench_all(&job, report);
	json_decref(report);
	return 0;
}
