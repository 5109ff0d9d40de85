// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise status: what the loops on this machine do, or did last.
 */
#include <getopt.h>
#include <math.h>
#include <stdlib.h>
#include <time.h>
#include "cli/cli.h"
#include "cli/json.h"
#include "status/state_follow.h"
#include "status/state_pages.h"
#include "status/state_prometheus.h"
#include "status/state_report.h"

enum { OPT_JSON = CLI_LONG, OPT_PROMETHEUS };

static const struct cli_option options[] = {
	{'f', "follow", NULL,
	 "go on: a live view on a terminal, a line a second in a pipe;\n"
	 "ends with the loop, or at SIGINT"},
	{OPT_JSON, "json", NULL, "report as one JSON object; with --follow one a second"},
	{OPT_PROMETHEUS, "prometheus", NULL, "report in Prometheus' text format"},
	{0},
};

static const struct cli_command command = {
	.name = "status",
	.synopsis = "[NAME|FILE] [OPTIONS]",
	.summary =
		"Say what the haptic loops on this machine do, or did last: state and reason,\n"
		"rate, how late ticks are, faults, force and energy. NAME is a scene's, FILE a\n"
		"page that a loop tells its state in; without either all are shown.",
	.options = options,
	.notes =
		"Example:\n  incise status neck --follow\n\n"
		"Exit: 0 runs, or stopped as asked; 1 in fault, dead, stalled or not there,\n"
		"2 bad usage. See incise-status(1).",
};

struct job {
	const char *asked;
	bool follow, json, prometheus;
};

static void parse(struct job *job, int argc, char **argv)
{
	int opt;

	*job = (struct job){0};
	while ((opt = cli_next(&command, argc, argv)) != CLI_END)
		switch (opt) {
		case 'f':
			job->follow = true;
			break;
		case OPT_JSON:
			job->json = true;
			break;
		case OPT_PROMETHEUS:
			job->prometheus = true;
			break;
		}
	if (argc - optind > 1)
		cli_usage("'%s': one name or file at most", argv[optind + 1]);
	job->asked = argv[optind];
	if (job->prometheus && (job->json || job->follow))
		cli_usage("--prometheus stands alone: who collects asks again");
}

/* Long enough for each to tick, if it does. Returns how long, s. */
static double pause_between(const struct incise_state_now *looks, int n)
{
	double s = 0;
	struct timespec t;

	for (int i = 0; i < n; i++)
		if (looks[i].alive && looks[i].run == INCISE_RUN_RUNNING)
			s = fmax(s, state_patience_s(&looks[i]));
	t.tv_sec = (time_t)s;
	t.tv_nsec = (long)((s - (double)t.tv_sec) * 1e9);
	nanosleep(&t, NULL);
	return s;
}

static bool show_all(const struct state_pages *pages, bool json)
{
	struct incise_state_now *before = calloc((size_t)pages->n, sizeof(*before));
	struct incise_state_now *now = calloc((size_t)pages->n, sizeof(*now));
	json_t *list = json_array();
	bool well = true;
	double gap_s;

	if (!before || !now)
		cli_fail("no memory");
	for (int i = 0; i < pages->n; i++)
		state_pages_look(&pages->page[i], &before[i]);
	gap_s = pause_between(before, pages->n);
	for (int i = 0; i < pages->n; i++) {
		struct state_look look = {.name = pages->page[i].name,
					  .path = pages->page[i].path,
					  .now = &now[i]};

		state_pages_look(&pages->page[i], &now[i]);
		state_look_since(&look, &before[i], gap_s);
		if (json)
			json_array_append_new(list, state_report_json(&look));
		else
			state_report_text(stdout, &look);
		if (!json && i < pages->n - 1)
			putchar('\n');
		well &= state_is_well(&look);
	}
	if (json)
		json_print(json_pack("{sO}", "loops", list));
	json_decref(list);
	free(before);
	free(now);
	return well;
}

static bool show_metrics(const struct state_pages *pages)
{
	struct incise_state_now *now = calloc((size_t)pages->n, sizeof(*now));
	struct state_metrics *loops = calloc((size_t)pages->n, sizeof(*loops));
	bool well = true;

	if (!now || !loops)
		cli_fail("no memory");
	for (int i = 0; i < pages->n; i++) {
		struct state_look look = {.now = &now[i]};

		state_pages_look(&pages->page[i], &now[i]);
		loops[i] = (struct state_metrics){pages->page[i].name, &now[i]};
		well &= state_is_well(&look);
	}
	state_prometheus(stdout, loops, pages->n);
	free(loops);
	free(now);
	return well;
}

/* Of several the one that runs. */
static const struct state_page_file *followed(const struct state_pages *pages)
{
	const struct state_page_file *one = NULL;

	if (pages->n == 1)
		return pages->page;
	for (int i = 0; i < pages->n; i++) {
		if (incise_state_alive(pages->page[i].state) != 1)
			continue;
		if (one)
			cli_fail("--follow: %s and %s run: name one", one->name,
				 pages->page[i].name);
		one = &pages->page[i];
	}
	if (!one)
		cli_fail("--follow: no loop runs here");
	return one;
}

int main(int argc, char **argv)
{
	struct state_pages pages;
	struct job job;
	bool well;

	parse(&job, argc, argv);
	state_pages_open(&pages, job.asked);
	if (job.follow)
		well = state_follow(followed(&pages), job.json);
	else if (job.prometheus)
		well = show_metrics(&pages);
	else
		well = show_all(&pages, job.json);
	state_pages_close(&pages);
	cli_finish();
	return well ? 0 : 1;
}
