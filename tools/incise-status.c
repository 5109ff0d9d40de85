// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise status: the state of the loops on this machine, once or live.
 */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>
#include "cli/cli.h"
#include "cli/json.h"
#include "status/pages.h"
#include "status/report.h"

struct status_job {
	bool follow, json, prometheus;
};

static const struct cli_option options[] = {
	{'f', "follow", NULL,
	 "keep reporting: a live view on a terminal, one line per second in a "
	 "pipe; ends with the loop, or at Ctrl-C",
	 CLI_FLAG(struct status_job, follow)},
	{0, "json", NULL, "report as one JSON object; with --follow one per second",
	 CLI_FLAG(struct status_job, json)},
	{0, "prometheus", NULL, "report in Prometheus' text format",
	 CLI_FLAG(struct status_job, prometheus)},
	{0},
};

static const struct cli_command command = {
	.name = "status",
	.synopsis = "[NAME|FILE] [OPTIONS]",
	.summary =
		"Report what the haptic loops on this machine do, or did last: state and "
		"reason, rate, lateness of ticks, faults, force and energy. NAME is the "
		"name of a scene, FILE the status file of a loop; the default is all "
		"loops.",
	.options = options,
	.examples = "incise status neck --follow",
	.success = "each loop runs, or stopped as requested",
	.failure = "a loop is in fault, dead, stalled or missing",
};

/* --- live ---------------------------------------------------------------------------- */

#define VIEW_NS 200000000LL
#define LINE_NS 1000000000LL

/* Bytes of a line that fill at most so many columns; UTF-8. */
static size_t width_of_status(const char *line, size_t n, int columns)
{
	size_t i;

	for (i = 0; i < n; i++)
		if (((unsigned char)line[i] & 0xc0) != 0x80 && !columns--)
			break;
	return i;
}

/* Draw over the view before, cut to the size of the terminal. */
static void draw_status(const char *text)
{
	struct winsize size = {.ws_row = 24, .ws_col = 80};

	ioctl(STDOUT_FILENO, TIOCGWINSZ, &size);
	fputs("\033[H", stdout);
	for (int row = 1; *text && row < size.ws_row; row++) {
		size_t n = strcspn(text, "\n");

		printf("%.*s\033[K\n", (int)width_of_status(text, n, size.ws_col), text);
		text += n + (text[n] == '\n');
	}
	fputs("\033[J", stdout);
}

static void draw_look(const struct state_look *look)
{
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	if (!out)
		cli_fail("no memory");
	state_report_text(out, look);
	fputs("Ctrl-C ends this view\n", out);
	fclose(out);
	draw_status(text);
	free(text);
}

static void show_status(const struct state_look *look, bool view, bool json)
{
	if (json) {
		json_t *report = state_report_json(look);

		json_write(stdout, report, JSON_COMPACT);
		json_decref(report);
	} else if (view) {
		draw_look(look);
	} else {
		state_report_line(stdout, look);
	}
	/* A pipe gets it at once, and a closed one ends the program. */
	if (fflush(stdout))
		cli_finish();
}

/* Wait in parts, so that a signal is noticed within 50 ms. */
static void wait_ns(int64_t ns)
{
	const struct timespec part = {.tv_nsec = 50000000};

	for (; ns > 0 && !cli_stop; ns -= part.tv_nsec)
		nanosleep(&part, NULL);
}

/* Switch to an own screen, or back to the one before. */
static void screen(bool own)
{
	fputs(own ? "\033[?1049h\033[?25l" : "\033[?1049l\033[?25h", stdout);
}

/*
 * On a terminal a view, drawn 5 times a second; else a line a second, or an object with
 * @json. Ends at cli_stop or with the loop. Returns whether all is well then.
 */
static bool state_follow(const struct state_page_file *page, bool json)
{
	static struct incise_state_now looks[2];
	struct state_look look = {
		.name = page->name, .path = page->path, .user = page->user};
	bool view = !json && isatty(STDOUT_FILENO);
	struct incise_error err = {0};
	int i = 0;

	cli_catch_signals();
	state_pages_look(page, &looks[0]);
	if (view && looks[0].alive)
		screen(true);
	while (looks[i].alive && !cli_stop) {
		wait_ns(view ? VIEW_NS : LINE_NS);
		if (cli_stop)
			break;
		i = !i;
		if (state_pages_try(page, &looks[i], &err))
			break;
		look.now = &looks[i];
		state_look_since(&look, &looks[!i],
				 view ? VIEW_NS * 1e-9 : LINE_NS * 1e-9);
		show_status(&look, view, json);
	}
	if (view && look.now)
		screen(false);
	cli_check(err.code, &err);
	/* A loop that had ended before is shown once; a view shows its last state. */
	if (view || !look.now) {
		look.now = &looks[i];
		if (view)
			state_report_text(stdout, &look);
		else
			show_status(&look, false, json);
	}
	return state_is_well(&look);
}

/* --- once ---------------------------------------------------------------------------- */

/* Wait long enough for each running loop to tick. Returns how long, s. */
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

/* The model of a loop's scene at its last tick, read by this program: the loop has no part in it. */
static bool find_model(const struct incise_state_now *now, struct model_force *force)
{
	struct incise_scene *scene = now->ticks && *now->scene
					     ? incise_scene_load(now->scene, NULL, NULL)
					     : NULL;
	bool found = scene && model_force_at(scene, now->tick.depth_mm,
					     now->tick.velocity_mm_s, force);

	incise_scene_free(scene);
	return found;
}

static bool show_all(const struct state_pages *pages, bool json)
{
	struct incise_state_now *before = cli_alloc((size_t)pages->n, sizeof(*before));
	struct incise_state_now *now = cli_alloc((size_t)pages->n, sizeof(*now));
	json_t *list = json_array();
	struct model_force force;
	bool well = true;
	double gap_s;

	for (int i = 0; i < pages->n; i++)
		state_pages_look(&pages->page[i], &before[i]);
	gap_s = pause_between(before, pages->n);
	for (int i = 0; i < pages->n; i++) {
		struct state_look look = {.name = pages->page[i].name,
					  .path = pages->page[i].path,
					  .user = pages->page[i].user,
					  .now = &now[i]};

		state_pages_look(&pages->page[i], &now[i]);
		state_look_since(&look, &before[i], gap_s);
		if (find_model(&now[i], &force))
			look.model = &force;
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
	struct incise_state_now *now = cli_alloc((size_t)pages->n, sizeof(*now));
	struct state_look *loops = cli_alloc((size_t)pages->n, sizeof(*loops));
	bool well = true;

	for (int i = 0; i < pages->n; i++) {
		state_pages_look(&pages->page[i], &now[i]);
		loops[i] =
			(struct state_look){.name = pages->page[i].name, .now = &now[i]};
		well &= state_is_well(&loops[i]);
	}
	state_prometheus(stdout, loops, pages->n);
	free(loops);
	free(now);
	return well;
}

/* The only page, or that of the only loop that runs. */
static const struct state_page_file *followed(const struct state_pages *pages)
{
	const struct state_page_file *one = NULL;

	if (pages->n == 1)
		return pages->page;
	for (int i = 0; i < pages->n; i++) {
		if (incise_state_alive(pages->page[i].state) != 1)
			continue;
		if (one)
			cli_fail("--follow: more than one loop runs, for example %s "
				 "and %s; name one",
				 one->name, pages->page[i].name);
		one = &pages->page[i];
	}
	if (!one)
		cli_fail("--follow: no loop runs here; 'incise haptic SCENE' starts one");
	return one;
}

int main(int argc, char **argv)
{
	struct state_pages pages;
	struct status_job job = {0};
	bool well;

	cli_parse(&command, argc, argv, &job);
	if (argc - optind > 1)
		cli_usage("unexpected argument '%s'; give one NAME or FILE at a time",
			  argv[optind + 1]);
	if (job.prometheus && (job.json || job.follow))
		cli_usage("--prometheus cannot be combined with --follow or --json");
	state_pages_open(&pages, argv[optind]);
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
