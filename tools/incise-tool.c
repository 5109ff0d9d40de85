// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise tool: the tool of a running loop, by its control socket; see haptic/control.h.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "cli/cli.h"
#include "cli/loop_report.h"
#include "haptic/control.h"
#include "status/pages.h"

struct tool_job {
	bool json;
};

static const struct cli_option options[] = {
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct tool_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "tool",
	.synopsis = "LOOP [blade|handle|tube|auto] [OPTIONS]",
	.summary =
		"Set the tool in the hand of a running haptic loop, or print it. The "
		"force ramps to zero before a tool in the tissue changes, and ramps up "
		"afterwards.",
	.options = options,
	.notes =
		"LOOP is the name of a scene, or a status file, as for incise status. "
		"auto is blade or handle by the scalpel's turn, and a tube with a station "
		"of its own while it is nearer to the tissue.",
	.examples = "incise tool neck tube",
	.success = "the loop accepted it",
};

static void check_tool(const char *name)
{
	for (const char *const *tool = loop_tool_names; *tool; tool++)
		if (!strcmp(name, *tool))
			return;
	cli_unknown("tool", name, loop_tool_names);
}

/* A loop that lives answers at its next look, within 0.1 s. */
#define PATIENCE_MS 2000

/* Longest wait for the tool to be in the hand: the force fades before. */
#define FADE_LOOKS 50
#define LOOK_NS 20000000

static struct {
	const char *name, *user;
	char *path;
} loop;

static _Noreturn void fail_to_ask(int code)
{
	switch (code) {
	case ENOENT:
		cli_fail("%s: its loop has no control socket: %s is missing; start the "
			 "loop again",
			 loop.name, loop.path);
	case ECONNREFUSED:
		cli_fail("%s: no program listens at %s: its loop has just ended; start "
			 "it again",
			 loop.name, loop.path);
	case EAGAIN:
		cli_fail("%s: its loop does not answer; try again", loop.name);
	case ECONNRESET:
		cli_fail("%s: its loop does not answer: it has ended, or too many "
			 "programs ask it at once; try again",
			 loop.name);
	case EACCES:
	case EPERM:
		cli_fail("%s: only user %s, or in /run/incise the group incise, may use "
			 "%s; run as one of them",
			 loop.name, loop.user, loop.path);
	default:
		cli_fail("%s: %s: %s", loop.name, loop.path, strerror(code));
	}
}

/* Send a request, and take the tool that is held and the one that is wanted. */
static void ask(const char *request, char held[CONTROL_LINE], char wanted[CONTROL_LINE])
{
	char reply[CONTROL_LINE];
	int rc = control_ask(loop.path, request, PATIENCE_MS, reply);

	if (rc)
		fail_to_ask(-rc);
	if (!strncmp(reply, "error ", strlen("error ")))
		cli_fail("%s: %s", loop.name, reply + strlen("error "));
	/* Both arrays are as long as a reply. */
	if (sscanf(reply, "ok held=%255[a-z] wanted=%255[a-z]", held, wanted) != 2)
		cli_fail("%s: its loop answers '%s': it runs another version of "
			 "incise; restart it",
			 loop.name, reply);
}

/* Find the loop as incise status does: it must live. */
static void find_loop(struct state_pages *pages, const char *name)
{
	struct incise_state_now *now = cli_alloc(1, sizeof(*now));

	state_pages_open(pages, name);
	state_pages_look(pages->page, now);
	loop.name = pages->page->name;
	loop.user = pages->page->user;
	loop.path = control_path(pages->page->path);
	if (!now->alive)
		cli_fail("%s: no loop of that name runs; 'incise status %s' shows how "
			 "it ended",
			 loop.name, name);
	free(now);
}

static void set_tool(const char *tool, char held[CONTROL_LINE], char wanted[CONTROL_LINE])
{
	const struct timespec pause = {.tv_nsec = LOOK_NS};
	char *request = cli_text("tool %s", tool);

	ask(request, held, wanted);
	free(request);
	/* The loop takes it at its next tick, and for auto that is all. */
	for (int i = 0; i < FADE_LOOKS; i++) {
		nanosleep(&pause, NULL);
		ask("tool", held, wanted);
		if (!strcmp(wanted, "auto") || !strcmp(held, wanted))
			break;
	}
}

int main(int argc, char **argv)
{
	char held[CONTROL_LINE], wanted[CONTROL_LINE];
	struct state_pages pages;
	struct tool_job job = {0};
	int n;

	cli_parse(&command, argc, argv, &job);
	n = argc - optind;
	if (n < 1)
		cli_usage("missing LOOP (name, as 'incise status' lists it)");
	if (n > 2)
		cli_usage("unexpected argument '%s'; give a loop and a tool",
			  argv[optind + 2]);
	if (n == 2)
		check_tool(argv[optind + 1]);
	find_loop(&pages, argv[optind]);
	if (n == 2)
		set_tool(argv[optind + 1], held, wanted);
	else
		ask("tool", held, wanted);
	if (job.json)
		json_print(json_pack("{ss ss ss}", "loop", loop.name, "tool", held,
				     "wanted", wanted));
	else if (!strcmp(held, wanted))
		printf("%s: %s\n", loop.name, held);
	else
		printf("%s: %s (%s)\n", loop.name, held, wanted);
	free(loop.path);
	state_pages_close(&pages);
	cli_finish();
	return 0;
}
