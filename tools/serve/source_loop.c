// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A running loop as a source: the ticks of its status file. The loop's process does not notice.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/state.h>
#include "../cli/cli.h"
#include "../haptic/control.h"
#include "../status/pages.h"
#include "serve.h"

/* The loop's page changes each 5 ms. */
#define POLL_NS 1000000LL
/* For the state, and for a loop that was started again. */
#define LOOK_NS 100000000LL
#define BATCH 256

struct loop {
	struct serve_source base;
	struct state_pages pages;
	struct incise_state *state;
	const char *path, *name;
	uint64_t cursor, lost;
	int64_t looked_ns;
};

static const double no_tip[3];

/* The next loop has replaced the file. */
static void follow_next(struct loop *loop)
{
	struct incise_state *next = incise_state_open(loop->path, NULL);

	if (next && incise_state_alive(next) == 1) {
		incise_state_close(loop->state);
		loop->state = loop->pages.page[0].state = next;
		loop->cursor = INCISE_STATE_NEWEST;
	} else {
		incise_state_close(next);
	}
}

static void look_source_loop(struct loop *loop, struct serve_stream *stream)
{
	static const enum serve_state states[INCISE_RUNS] = {
		[INCISE_RUN_STARTING] = SERVE_STARTS, [INCISE_RUN_RUNNING] = SERVE_RUNS,
		[INCISE_RUN_RELOADING] = SERVE_RUNS,  [INCISE_RUN_STOPPING] = SERVE_RUNS,
		[INCISE_RUN_STOPPED] = SERVE_ENDED,   [INCISE_RUN_FAULT] = SERVE_FAULT,
	};
	static struct incise_state_now now; /* 16 kB */
	bool ended;
	char text[400];

	if (incise_state_read(loop->state, &now))
		return;
	ended = now.run == INCISE_RUN_STOPPED || now.run == INCISE_RUN_FAULT;
	snprintf(text, sizeof(text), "loop %s: %s%s%s", loop->name,
		 now.alive || ended ? incise_run_name(now.run) : "its process is dead",
		 *now.reason ? ": " : "", now.reason);
	serve_status(stream,
		     !now.alive && !ended		   ? SERVE_ABSENT
		     : (unsigned int)now.run < INCISE_RUNS ? states[now.run]
							   : SERVE_FAULT,
		     now.alive || ended ? incise_run_name(now.run) : "dead", text);
	if (now.alive)
		serve_loop(stream, &now);
	else
		follow_next(loop);
}

static int loop_read(struct serve_source *source, struct serve_stream *stream,
		     int64_t now_ns, int64_t *next_ns)
{
	struct loop *loop = (struct loop *)source;
	struct incise_tick ticks[BATCH];
	int n;

	*next_ns = now_ns + POLL_NS;
	if (now_ns - loop->looked_ns >= LOOK_NS) {
		loop->looked_ns = now_ns;
		look_source_loop(loop, stream);
	}
	do {
		n = incise_state_ticks(loop->state, &loop->cursor, ticks, BATCH,
				       &loop->lost);
		for (int i = 0; i < n; i++) {
			if (!(ticks[i].flags &
			      (INCISE_TICK_STALE | INCISE_TICK_UNUSABLE)))
				serve_pose(stream, ticks[i].t_ns, ticks[i].position_mm,
					   ticks[i].quaternion, no_tip, loop->lost);
			serve_force(stream, ticks[i].t_ns, ticks[i].command_N,
				    loop->lost);
			serve_depth(stream, ticks[i].t_ns, ticks[i].depth_mm);
		}
	} while (n == BATCH);
	return 0;
}

/* As incise tool does. */
static bool loop_order(struct serve_source *source, const char *what, const char *text,
		       char *reply, size_t size)
{
	const struct loop *loop = (struct loop *)source;
	char answer[CONTROL_LINE], *path, *request;
	int rc;

	if (strcmp(what, "tool")) {
		snprintf(reply, size,
			 "a loop has no order '%s': its tool can be set here", what);
		return true;
	}
	path = control_path(loop->path);
	request = cli_text("tool %s", text);
	rc = control_ask(path, request, 500, answer);
	if (rc)
		snprintf(reply, size, "%s: its loop does not answer: %s", loop->name,
			 strerror(-rc));
	else
		snprintf(reply, size, "%s", answer);
	free(path);
	free(request);
	return rc || strncmp(answer, "ok ", 3);
}

static int64_t loop_utc(struct serve_source *source, int64_t t_ns)
{
	(void)source;
	return serve_utc_of(t_ns);
}

static void loop_free(struct serve_source *source)
{
	struct loop *loop = (struct loop *)source;

	state_pages_close(&loop->pages);
	free(loop);
}

static const struct serve_source_ops loop_ops = {
	.read = loop_read, .order = loop_order, .utc = loop_utc, .free = loop_free};

/* The named page, or the page of the only loop that runs. */
static struct state_page_file *choose_source_loop(struct state_pages *pages, bool named)
{
	struct state_page_file *one = named && pages->n == 1 ? pages->page : NULL;

	for (int i = 0; i < pages->n && !one; i++) {
		if (incise_state_alive(pages->page[i].state) != 1)
			continue;
		for (int k = i + 1; k < pages->n; k++)
			if (incise_state_alive(pages->page[k].state) == 1)
				cli_fail("more than one loop runs, for example %s and "
					 "%s; name one",
					 pages->page[i].name, pages->page[k].name);
		one = &pages->page[i];
	}
	if (!one)
		cli_fail(
			"no loop runs here; 'incise haptic SCENE' starts one; or name one "
			"to wait for its next run, or give --rig RIG, or a recording");
	return one;
}

struct serve_source *serve_loop_open(const struct serve_source_options *options,
				     struct serve_info *info)
{
	struct loop *loop = cli_alloc(1, sizeof(*loop));
	struct state_page_file *page, first;

	if (options->camera_needed)
		cli_fail("--camera frames: a loop has no frames; give --rig RIG or a "
			 "recording");
	state_pages_open(&loop->pages, options->operand);
	page = choose_source_loop(&loop->pages, options->operand);
	/* The chosen one first, so that closing the pages closes the rest, too. */
	first = *loop->pages.page;
	*loop->pages.page = *page;
	*page = first;
	page = loop->pages.page;
	loop->base.ops = &loop_ops;
	loop->state = page->state;
	loop->path = page->path;
	loop->name = page->name;
	loop->cursor = INCISE_STATE_NEWEST;
	if (incise_state_alive(page->state) != 1)
		cli_warn("loop %s does not run; its next run is followed", page->name);
	info->name = cli_text("loop %s", page->name);
	info->commanded = info->tools = true;
	info->kinds[SERVE_POSE] = info->kinds[SERVE_FORCE] = true;
	info->kinds[SERVE_DEPTH] = true;
	return &loop->base;
}
