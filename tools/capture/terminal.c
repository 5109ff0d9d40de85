// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The terminal of a running capture; see capture.h.
 *
 *     12.3 of 60.0 s   disk 5.2 h
 *     force    0.532 N [####......] of 4.03 N
 *          1 N|⠀⠀⡠⠒⠢⡀   the last seconds
 *          0 N|⠤⠊⠀⠀⠀⠈
 *     depth     4.21 mm
 *          … a trace
 *     stream     rate/s       rows   lost   late jitter ms   drift ppm      offset ms
 *     force    10000.00     123456      0      0 …
 *     m: marker   q: end
 */
#include <errno.h>
#include <fcntl.h>
#include <langinfo.h>
#include <locale.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>
#include "../cli/cli.h"
#include "../cli/stopwatch.h"
#include "../cli/stream_report.h"
#include "capture.h"
#include "trace.h"

/* --- the view ------------------------------------------------------------------------ */

#define SHOW_NS 100000000LL
#define LINE_NS 1000000000LL /* in a pipe */
#define READ_NS 20000000LL   /* values for the traces */
#define BAR 10
#define WIDTH_MOST 79  /* characters: a line of 80 would wrap */
#define TRACE_HEIGHT 4 /* lines, where there are as many */
#define STARTING_RANGE_N 0.1
#define STARTING_RANGE_MM 1.0

static struct capture_view {
	double planned_s; /* 0: not known */
	bool vision;	  /* measures the depth, too */
	bool live;	  /* its clock is real: in a pipe there is a line each second */
	int markers;
	char last[80]; /* the last marker */
	int64_t shown_ns, read_ns, line_ns;
	struct trace force_N, depth_mm;
} view;

static bool terminal_ready(void)
{
	struct pollfd terminal = {.fd = STDERR_FILENO, .events = POLLOUT};

	return isatty(STDERR_FILENO) && poll(&terminal, 1, 0) == 1 &&
	       terminal.revents == POLLOUT;
}

static void put_time_left(char *text, size_t size, double seconds)
{
	if (!isfinite(seconds))
		snprintf(text, size, "-");
	else if (seconds < 120)
		snprintf(text, size, "%.0f s", seconds);
	else if (seconds < 7200)
		snprintf(text, size, "%.0f min", seconds / 60);
	else if (seconds < 172800)
		snprintf(text, size, "%.1f h", seconds / 3600);
	else
		snprintf(text, size, "%.0f days", seconds / 86400);
}

static void draw_level(char bar[BAR + 1], double share)
{
	int full = isfinite(share) ? (int)lround(fmin(1, fabs(share)) * BAR) : 0;

	memset(bar, '.', BAR);
	memset(bar, '#', (size_t)full);
	bar[BAR] = 0;
}

/* "ARMED 12.3 of 60.0 s   disk 5.2 h   tracker ENDED" */
static void put_headline(FILE *out, const struct incise_recorder_stats *stats,
			 double seconds)
{
	char left[32];

	put_time_left(left, sizeof(left), stats->disk_s);
	fprintf(out, "%s%.1f", stats->armed ? "ARMED " : "", seconds);
	if (view.planned_s > 0)
		fprintf(out, " of %.1f", view.planned_s);
	fprintf(out, " s   disk %s", left);
	for (int i = 0; i < stats->n_streams; i++)
		if (*stats->streams[i].ended)
			fprintf(out, "   %s ENDED", stats->streams[i].name);
}

/* @span_s: of the trace below; 0: there is none. */
static void put_force(FILE *out, const struct incise_recorder_stats *stats, double span_s)
{
	char bar[BAR + 1];

	draw_level(bar, stats->force_N / stats->full_scale_N);
	if (isnan(stats->zero_mV))
		fputs("\nzero of the force: hold the tool free", out);
	else
		fprintf(out, "\nforce  %7.3f N [%s] of %.3g N", stats->force_N, bar,
			stats->full_scale_N);
	if (span_s > 0)
		fprintf(out, "   last %.0f s", span_s);
}

static void put_depth(FILE *out, const struct incise_recorder_stats *stats)
{
	fprintf(out, "\ndepth  %7.2f mm", stats->depth_mm);
	if (view.vision && isfinite(stats->camera_depth_mm))
		fprintf(out, " (camera %.2f)", stats->camera_depth_mm);
	else if (view.vision)
		fputs(" (camera -)", out);
	if (stats->button)
		fputs("   button", out);
}

/* Braille where the locale has UTF-8; the font of Linux's own console has none. */
static bool has_braille(void)
{
	const char *terminal = getenv("TERM");
	locale_t locale = newlocale(LC_CTYPE_MASK, "", (locale_t)0);
	bool has = locale && !strcmp(nl_langinfo_l(CODESET, locale), "UTF-8") &&
		   !(terminal && !strcmp(terminal, "linux"));

	if (locale)
		freelocale(locale);
	return has;
}

/* The lines of the terminal that are not needed otherwise, for two traces. */
static int trace_height(int lines, const struct incise_recorder_stats *stats)
{
	/* Headline, force, depth, heading, streams and keys. */
	int height = (lines - 5 - stats->n_streams) / 2;

	return height < 2 ? 0 : height < TRACE_HEIGHT ? height : TRACE_HEIGHT;
}

static void draw_view(const struct incise_recorder_stats *stats, double seconds)
{
	bool braille = has_braille();
	int width, lines, height;
	char *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	if (!out)
		return;
	cli_terminal_size(&width, &lines);
	width = width - 1 < WIDTH_MOST ? width - 1 : WIDTH_MOST;
	height = trace_height(lines, stats);
	put_headline(out, stats, seconds);
	put_force(out, stats, height ? trace_span_s(width) : 0);
	if (height)
		trace_put(&view.force_N, width, height, braille, out);
	put_depth(out, stats);
	if (height)
		trace_put(&view.depth_mm, width, height, braille, out);
	fprintf(out, "\n%s", stream_heading);
	for (int i = 0; i < stats->n_streams; i++) {
		char line[200];

		stream_line(&stats->streams[i], line, sizeof(line));
		fprintf(out, "\n%s", line);
	}
	fprintf(out, "\nm, 1-9: marker   %sq: end   %s",
		stats->armed ? "t: trigger   " : "", view.last);
	if (!fclose(out))
		cli_progress("%s", text);
	free(text);
}

/* "12 s: force 0.532 N, depth 4.21 mm; 120000 force samples, 1440 tracker records, 0 lost" */
static void put_line(const struct incise_recorder_stats *stats, double seconds)
{
	char force[40] = "zero not known";

	if (!isnan(stats->zero_mV))
		snprintf(force, sizeof(force), "%.3f N", stats->force_N);
	fprintf(stderr,
		"%s%.0f s: force %s, depth %.2f mm; %llu force samples, %llu tracker records",
		stats->armed ? "armed " : "", seconds, force, stats->depth_mm,
		(unsigned long long)stats->force, (unsigned long long)stats->tracker);
	if (stats->n_streams > 2)
		fprintf(stderr, ", %llu frames", (unsigned long long)stats->frames);
	fprintf(stderr, ", %llu lost%s%s\n",
		(unsigned long long)(stats->force_lost + stats->tracker_lost +
				     stats->frames_lost),
		*view.last ? "; " : "", view.last);
}

static void show_streams(const struct incise_recorder *recorder, double seconds)
{
	int64_t now_ns = (int64_t)stopwatch_ns();
	bool terminal = isatty(STDERR_FILENO);
	struct incise_recorder_stats stats;

	if (!terminal && (!view.live || now_ns - view.line_ns < LINE_NS))
		return;
	if (terminal && now_ns - view.read_ns < READ_NS)
		return;
	view.read_ns = now_ns;
	incise_recorder_stats(recorder, &stats);
	if (!terminal) {
		/* The first one is after a second. */
		if (view.line_ns)
			put_line(&stats, seconds);
		/* Whole seconds, of which some may have passed meanwhile. */
		view.line_ns = view.line_ns ? now_ns - (now_ns - view.line_ns) % LINE_NS
					    : now_ns;
		return;
	}
	trace_add(&view.force_N, seconds, isnan(stats.zero_mV) ? NAN : stats.force_N);
	trace_add(&view.depth_mm, seconds, stats.tracker ? stats.depth_mm : NAN);
	if (now_ns - view.shown_ns < SHOW_NS || !terminal_ready())
		return;
	view.shown_ns = now_ns;
	draw_view(&stats, seconds);
}

/*
 * --- keys ------------------------------------------------------------------------------
 *
 *     begin ─► keys ── Ctrl-Z ─► as before, stopped ── fg ─► keys ─► end: as before
 *                                                   └─ bg ─► as the shell has it
 */

static volatile sig_atomic_t started, resumed;
static struct termios before, keys;

/* A background process that reads or sets the terminal would be stopped. */
static bool in_front(void)
{
	return tcgetpgrp(STDIN_FILENO) == getpgrp();
}

static void end_keyboard(void)
{
	if (started && in_front())
		tcsetattr(STDIN_FILENO, TCSANOW, &before);
	started = false;
}

static void on_continue(int number)
{
	int error = errno;

	(void)number;
	resumed = true;
	if (started && in_front())
		tcsetattr(STDIN_FILENO, TCSANOW, &keys);
	errno = error;
}

/* Ctrl-Z and Ctrl-\: restore the terminal, then do their default. */
static void on_stop(int number)
{
	struct sigaction action = {.sa_handler = SIG_DFL}, ours;
	int error = errno;

	if (started && in_front())
		tcsetattr(STDIN_FILENO, TCSANOW, &before);
	sigaction(number, &action, &ours);
	raise(number);
	sigaction(number, &ours, NULL);
	/* An orphaned process group is not stopped. */
	on_continue(number);
	errno = error;
}

static void watch_signal(int number, void (*handler)(int))
{
	/* SA_NODEFER, as the handler raises the signal. */
	struct sigaction action = {.sa_handler = handler,
				   .sa_flags = SA_RESTART | SA_NODEFER},
			 had;

	if (!sigaction(number, NULL, &had) && had.sa_handler != SIG_IGN)
		sigaction(number, &action, NULL);
}

static void begin_keyboard(void)
{
	if (started || !isatty(STDIN_FILENO) || !in_front() ||
	    tcgetattr(STDIN_FILENO, &before))
		return;
	keys = before;
	keys.c_lflag &= ~(tcflag_t)(ICANON | ECHO); /* Ctrl-C goes on to be a signal */
	keys.c_cc[VMIN] = 0;
	keys.c_cc[VTIME] = 0;
	watch_signal(SIGTSTP, on_stop);
	watch_signal(SIGQUIT, on_stop);
	watch_signal(SIGCONT, on_continue);
	started = true;
	atexit(end_keyboard);
	tcsetattr(STDIN_FILENO, TCSANOW, &keys);
}

/* The next key, or 0; does not wait. */
static int next_key(void)
{
	unsigned char key;

	return started && in_front() && read(STDIN_FILENO, &key, 1) == 1 ? key : 0;
}

static int put_marker(struct incise_recorder *recorder, const char *text,
		      struct incise_error *err)
{
	snprintf(view.last, sizeof(view.last), "marked: %s", text);
	view.shown_ns = 0;
	return incise_recorder_mark(recorder, "marker", text, err);
}

static int handle_keys(const struct incise_capture_state *state, struct incise_error *err)
{
	char text[40];
	int key, rc = 0;

	while (!rc && (key = next_key())) {
		if (key == 'm' || key == ' ') {
			snprintf(text, sizeof(text), "marker %d", ++view.markers);
			rc = put_marker(state->recorder, text, err);
		} else if (key >= '1' && key <= '9') {
			snprintf(text, sizeof(text), "%c", key);
			rc = put_marker(state->recorder, text, err);
		} else if (key == 't' && state->armed) {
			incise_recorder_trigger(state->recorder);
		} else if (key == 'q') {
			cli_stop = SIGINT;
		}
	}
	return rc;
}

/* --- a capture ------------------------------------------------------------------------- */

/*
 * A terminal that is stopped (Ctrl-S) or unreachable must not hold up the recording, so writes
 * do not block. It is opened again, as the shell shares the flags of the inherited one.
 */
static void unblock_terminal(void)
{
	int fd = isatty(STDERR_FILENO)
			 ? open("/proc/self/fd/2",
				O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC)
			 : -1;

	if (fd < 0)
		return;
	dup2(fd, STDERR_FILENO);
	close(fd);
}

void capture_view_begin(bool live, bool vision)
{
	view.live = live;
	view.vision = vision;
	trace_begin(&view.force_N, "N", STARTING_RANGE_N);
	trace_begin(&view.depth_mm, "mm", STARTING_RANGE_MM);
	begin_keyboard();
	unblock_terminal();
}

void capture_view_end(void)
{
	end_keyboard();
	if (isatty(STDERR_FILENO))
		fcntl(STDERR_FILENO, F_SETFL,
		      fcntl(STDERR_FILENO, F_GETFL) & ~O_NONBLOCK);
	cli_progress_end();
}

int capture_view_step(void *context, const struct incise_capture_state *state,
		      struct incise_error *err)
{
	int rc;

	(void)context;
	view.planned_s = state->planned_s;
	if (!isnan(state->left_s))
		snprintf(view.last, sizeof(view.last),
			 state->left_s > 0 ? "starts in %.0f s" : "",
			 ceil(state->left_s));
	rc = handle_keys(state, err);
	if (resumed)
		cli_progress_forget();
	resumed = false;
	if (!rc)
		show_streams(state->recorder, state->seconds);
	return rc;
}
