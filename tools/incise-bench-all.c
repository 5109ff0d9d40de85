// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench all --report DIR: every benchmark of incise bench, one after the other, as one
 * report that anyone can repeat. Each is a program of its own, so that none meets what another
 * has left in memory. A new report is made within the folder, hidden, and takes the old one's
 * place when it is whole.
 *
 *   incise-bench WORD --json ─▶ data/WORD.json ─┐
 *                     --plot ─▶ plots/       ├─▶ report.{json,html,md}
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
#include "cli/plot.h"
#include "cli/report_script.h"
#include "cli/stopwatch.h"

/* In the order of the report. */
static const char *const benchmarks[] = {"precision", "training", "stability", "loop",
					 "view",      "scenes",	  NULL};
#define BENCHMARKS (int)(sizeof(benchmarks) / sizeof(*benchmarks) - 1)

struct job {
	const char *folder, *from, *against;
	char *only[BENCHMARKS];
	int n_only;
	bool quick, json;
};

static void parse_only(void *options, char *text)
{
	struct job *job = options;

	job->n_only = cli_list("only", text, job->only, BENCHMARKS);
	for (int i = 0; i < job->n_only; i++)
		cli_choice("only", job->only[i], benchmarks);
}

static const struct cli_option options[] = {
	{0, "report", "DIR", "folder to write everything to",
	 CLI_OUTPUTS(struct job, folder)},
	{0, "from", "DIR",
	 "measure nothing: write report.html and report.md of\nDIR/report.json again",
	 CLI_TEXT(struct job, from)},
	{0, "against", "OLD.json",
	 "report what changed beyond noise since that report.json",
	 CLI_INPUT(struct job, against)},
	{0, "only", "LIST", "these benchmarks only", CLI_PARSED_BY(parse_only)},
	{0, "quick", NULL, "smoke test: few points and repeats, not for publication",
	 CLI_FLAG(struct job, quick)},
	{0, "json", NULL, "print report.json, too", CLI_FLAG(struct job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "bench all",
	.synopsis = "--report DIR [OPTIONS]",
	.summary =
		"Run every benchmark and write one report: report.html to read, on a phone and on\n"
		"paper, too; report.md, the same; report.json; plots; the JSON of each benchmark.",
	.options = options,
	.notes =
		"Exit: 0 done, 1 failed, or a benchmark failed, or metrics got worse: the report\n"
		"says which and why; 2 bad usage. See incise-bench-all(1).",
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
		cli_fail("%s: not empty and not a report; give another --report DIR",
			 path);
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
#define ASKED_S 20 /* to end what it has started, and itself */
#define LINES 20   /* of warnings that are kept */

/* Wait for its end, or for ours. */
static int wait_for(pid_t pid, const char *benchmark, int number, int of)
{
	double begin_ns = stopwatch_ns();
	int status = 0;

	while (!child_ended(pid, &status)) {
		if (cli_stop) {
			kill(-pid, SIGTERM);
			return child_end(pid, ASKED_S);
		}
		cli_progress("%s (%d of %d): %.0f s", benchmark, number, of,
			     (stopwatch_ns() - begin_ns) * 1e-9);
		usleep(POLL_US);
	}
	cli_progress_end();
	return status;
}

/* Lines of its standard error: warnings, but for the last line of one that failed, which goes to
 * @why. "incise bench: " is clear from where a line stands. */
static json_t *read_warnings(FILE *said, bool failed, char *why, size_t size)
{
	json_t *lines = json_array();
	char line[600];

	rewind(said);
	while (fgets(line, sizeof(line), said)) {
		char *text = line, *colon;

		line[strcspn(line, "\n")] = 0;
		colon = strncmp(line, "incise ", 7) ? NULL : strstr(line, ": ");
		text = colon ? colon + 2 : line;
		if (!strncmp(text, "warning: ", 9))
			text += 9;
		/* A hint to --help is for a person at a shell. */
		if (!*text || !strncmp(text, "Try 'incise ", 12))
			continue;
		snprintf(why, size, "%s", text);
		if (json_array_size(lines) < LINES)
			json_array_append_new(lines, json_text(text));
	}
	if (failed && json_array_size(lines))
		json_array_remove(lines, json_array_size(lines) - 1);
	return lines;
}

static void note(json_t *report, const char *benchmark, const char *state, double seconds,
		 const char *why, json_t *warnings)
{
	if (!strcmp(state, "failed"))
		json_array_append_new(json_object_get(report, "failed"),
				      json_string(benchmark));
	json_object_set_new(json_object_get(report, "runs"), benchmark,
			    json_pack("{ss sf so so}", "state", state, "seconds", seconds,
				      "why", *why ? json_text(why) : json_null(),
				      "warnings", warnings));
}

/* Its report, and its metrics once more among those of all, named with the benchmark. */
static void add_report(json_t *report, const char *benchmark, json_t *json)
{
	const json_t *metric;
	size_t i;

	json_object_set(json_object_get(report, "benchmarks"), benchmark, json);
	json_array_foreach(json_object_get(json, "figures"), i, metric)
	{
		const char *name = json_string_value(json_object_get(metric, "name"));
		json_t *copy;

		if (!json_is_object(metric))
			continue;
		copy = json_copy((json_t *)metric);
		json_object_set_new(copy, "name",
				    json_sprintf("%s: %s", benchmark, name ? name : ""));
		json_array_append_new(json_object_get(report, "figures"), copy);
	}
}

static bool has_program(const char *benchmark)
{
	return !strcmp(benchmark, "view");
}

/* Start it, and wait; its JSON into a file. */
static int run_benchmark(const char *benchmark, const char *program, const char *folder,
			 const char *data, bool quick, FILE *said, int number, int of)
{
	char *plot = cli_text("%s/plots/%s", folder, benchmark);
	const char *argv[8] = {program};
	int n = 1, status;
	FILE *out = fopen(data, "we");

	if (!out)
		cli_fail("%s: %s", data, strerror(errno));
	/* A benchmark with a program of its own is not named once more. */
	if (!has_program(benchmark))
		argv[n++] = benchmark;
	argv[n++] = "--json";
	if (quick)
		argv[n++] = "--quick";
	if (plot_possible()) {
		argv[n++] = "--plot";
		argv[n++] = plot;
	}
	status = wait_for(child_start((char *const *)argv, fileno(out), fileno(said)),
			  benchmark, number, of);
	fclose(out);
	free(plot);
	return status;
}

/* A benchmark that fails is in the report with its last line, and the others go on. */
static void measure_one(const char *benchmark, const char *folder, bool quick,
			json_t *report, int number, int of)
{
	char *program = cli_text("%s/incise-bench%s%s", cli_folder(),
				 has_program(benchmark) ? "-" : "",
				 has_program(benchmark) ? benchmark : ""),
	     *data = cli_text("%s/data/%s.json", folder, benchmark);
	struct memory_file said = memory_file_begin("said");
	double begin_ns = stopwatch_ns();
	struct incise_error err = {0};
	json_t *json, *warnings;
	char why[600] = "";
	int status;

	if (access(program, X_OK)) {
		snprintf(why, sizeof(why),
			 "%s is missing: it is built if its libraries are installed",
			 strrchr(program, '/') + 1);
		note(report, benchmark, "left out", 0, why, json_array());
		goto out_free;
	}
	status = run_benchmark(benchmark, program, folder, data, quick, said.file, number,
			       of);
	json = json_read(data, &err);
	warnings = read_warnings(said.file, status != 0, why, sizeof(why));
	if (WIFSIGNALED(status))
		snprintf(why, sizeof(why), "ended by a signal: %s",
			 strsignal(WTERMSIG(status)));
	else if (!json_is_object(json) && !status)
		snprintf(why, sizeof(why), "its output is not JSON: %s",
			 *err.text ? err.text : "no object");
	else if (!status)
		*why = 0;
	note(report, benchmark, *why ? "failed" : "measured",
	     (stopwatch_ns() - begin_ns) * 1e-9, why, warnings);
	if (json_is_object(json))
		add_report(report, benchmark, json);
	else
		unlink(data);
	json_decref(json);
out_free:
	fclose(said.file);
	free(program);
	free(data);
}

static bool wanted(const struct job *job, const char *benchmark)
{
	for (int i = 0; i < job->n_only; i++)
		if (!strcmp(job->only[i], benchmark))
			return true;
	return !job->n_only;
}

/* The command that gives the same; the folder is another on another machine. */
static json_t *command_of(const struct job *job)
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

/* Of a report of all benchmarks; that of one is itself. */
static const json_t *benchmarks_of(const json_t *report)
{
	const json_t *words = json_object_get(report, "benchmarks");

	return words ? words : report;
}

/* The comparison goes into the report, or the reason why there is none. */
static void compare(const char *path, const json_t *old, json_t *report)
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

static json_t *measure(const struct job *job)
{
	json_t *old = job->against ? compare_load(job->against) : NULL, *report;
	struct incise_error err = {0};
	struct folder folder;
	int n = 0, of = 0;

	/* Before minutes of work. */
	if (report_script("check", NULL, NULL, NULL, &err))
		cli_fail_with(&err);
	folder = folder_begin(job->folder);
	report = begin_report(job);
	for (int i = 0; i < BENCHMARKS; i++)
		of += wanted(job, benchmarks[i]);
	for (int i = 0; i < BENCHMARKS && !cli_stop; i++)
		if (wanted(job, benchmarks[i]))
			measure_one(benchmarks[i], folder.unfinished, job->quick, report,
				    ++n, of);
	if (cli_stop) {
		folder_abandon(&folder);
		cli_fail("%s: %s is unchanged", strsignal(cli_stop), job->folder);
	}
	if (old)
		compare(job->against, old, report);
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

static void parse(struct job *job, int argc, char **argv)
{
	*job = (struct job){0};
	cli_parse(&command, argc, argv, job);
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
}

/* One line for the worst that is not as it should be. */
static void judge(const struct job *job, const json_t *report)
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
	struct job job;
	json_t *report;

	parse(&job, argc, argv);
	cli_catch_signals();
	if (job.from) {
		report = load_report(job.from);
		reserve_files(job.from, true);
		if (report_script("bench", job.from, NULL, NULL, &err))
			cli_fail_with(&err);
	} else {
		report = measure(&job);
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
		judge(&job, report);
	json_decref(report);
	return 0;
}
