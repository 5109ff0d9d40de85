// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The live view; see state_follow.h.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>
#include "../cli/cli.h"
#include "state_follow.h"
#include "state_report.h"

#define VIEW_NS 200000000LL
#define LINE_NS 1000000000LL

/* At most so many characters; a byte that begins none counts for nothing. */
static size_t width_of(const char *line, size_t n, int columns)
{
	size_t i;

	for (i = 0; i < n; i++)
		if (((unsigned char)line[i] & 0xc0) != 0x80 && !columns--)
			break;
	return i;
}

/* Over what was drawn before, and no longer than the terminal is wide or high. */
static void draw(const char *text)
{
	struct winsize size = {.ws_row = 24, .ws_col = 80};

	ioctl(STDOUT_FILENO, TIOCGWINSZ, &size);
	fputs("\033[H", stdout);
	for (int row = 1; *text && row < size.ws_row; row++) {
		size_t n = strcspn(text, "\n");

		printf("%.*s\033[K\n", (int)width_of(text, n, size.ws_col), text);
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
	draw(text);
	free(text);
}

static void show(const struct state_look *look, bool view, bool json)
{
	if (json) {
		json_t *report = state_report_json(look);

		json_dumpf(report, stdout, JSON_COMPACT);
		putchar('\n');
		json_decref(report);
	} else if (view) {
		draw_look(look);
	} else {
		state_report_line(stdout, look);
	}
	/* Who reads a pipe has it at once, and one that is closed ends this. */
	if (fflush(stdout))
		cli_finish();
}

/* Until a time, in parts: a signal is seen within one. */
static void wait_ns(int64_t ns)
{
	const struct timespec part = {.tv_nsec = 50000000};

	for (; ns > 0 && !cli_stop; ns -= part.tv_nsec)
		nanosleep(&part, NULL);
}

/* A screen of its own, so that what was there before comes back. */
static void screen(bool own)
{
	fputs(own ? "\033[?1049h\033[?25l" : "\033[?1049l\033[?25h", stdout);
}

bool state_follow(const struct state_page_file *page, bool json)
{
	static struct incise_state_now looks[2];
	struct state_look look = {.name = page->name, .path = page->path};
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
		show(&look, view, json);
	}
	if (view && look.now)
		screen(false);
	if (err.code)
		cli_fail_with(&err);
	/* Of a loop that had ended before there is one look; that of a view stays. */
	if (view || !look.now) {
		look.now = &looks[i];
		if (view)
			state_report_text(stdout, &look);
		else
			show(&look, false, json);
	}
	return state_is_well(&look);
}
