// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The terminal of a running capture; see terminal.h.
 *
 *     12.3 of 60.0 s   force   0.532 N [####......]   depth   4.21 mm   disk 5.2 h
 *     stream      rate/s       rows   lost   late  jitter ms  drift ppm       offset ms
 *     force     10000.00     123456      0      0 …
 *     m: marker   q: end
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>
#include <incise/clock.h>
#include "../cli/cli.h"
#include "../cli/stopwatch.h"
#include "../cli/stream_report.h"
#include "terminal.h"

/* --- the view ------------------------------------------------------------------------ */

#define SHOW_NS 200000000LL
#define BAR 10

/*
 * A terminal that is stopped (Ctrl-S) or unreachable must not hold up the recording, so writes
 * do not block. It is opened again, as the shell shares the flags of the inherited one.
 */
void capture_view_begin(void)
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

void capture_view_end(void)
{
	if (isatty(STDERR_FILENO))
		fcntl(STDERR_FILENO, F_SETFL,
		      fcntl(STDERR_FILENO, F_GETFL) & ~O_NONBLOCK);
	cli_progress_end();
}

static bool terminal_ready(void)
{
	struct pollfd terminal = {.fd = STDERR_FILENO, .events = POLLOUT};

	return isatty(STDERR_FILENO) && poll(&terminal, 1, 0) == 1 &&
	       terminal.revents == POLLOUT;
}

static void time_left(char *text, size_t size, double seconds)
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

static void level(char bar[BAR + 1], double share)
{
	int full = isfinite(share) ? (int)lround(fmin(1, fabs(share)) * BAR) : 0;

	memset(bar, '.', BAR);
	memset(bar, '#', (size_t)full);
	bar[BAR] = 0;
}

static void headline(const struct capture_view *view,
		     const struct incise_recorder_stats *stats, double seconds,
		     char *text, size_t size)
{
	char left[32], bar[BAR + 1], camera[40] = "", of[32] = "";

	time_left(left, sizeof(left), stats->disk_s);
	level(bar, stats->force_N / view->full_scale_N);
	if (view->depth && isfinite(stats->camera_depth_mm))
		snprintf(camera, sizeof(camera), " (camera %.2f)",
			 stats->camera_depth_mm);
	else if (view->depth)
		snprintf(camera, sizeof(camera), " (camera -)");
	if (view->planned_s > 0)
		snprintf(of, sizeof(of), " of %.1f", view->planned_s);
	if (isnan(stats->zero_mV))
		snprintf(text, size,
			 "zero of the force: hold the tool free   depth %.2f mm",
			 stats->depth_mm);
	else
		snprintf(text, size,
			 "%s%.1f%s s   force %7.3f N [%s]   depth %6.2f mm%s%s   disk %s",
			 stats->armed ? "ARMED " : "", seconds, of, stats->force_N, bar,
			 stats->depth_mm, camera, stats->button ? "   button" : "", left);
}

void capture_view_show(struct capture_view *view, const struct incise_recorder *recorder,
		       double seconds)
{
	struct incise_recorder_stats stats;
	char top[200], lines[INCISE_STREAMS_MAX][200] = {{0}};
	int64_t now_ns = (int64_t)stopwatch_ns();

	if (now_ns - view->shown_ns < SHOW_NS)
		return;
	view->shown_ns = now_ns;
	if (!terminal_ready())
		return;
	incise_recorder_stats(recorder, &stats);
	headline(view, &stats, seconds, top, sizeof(top));
	for (int i = 0; i < stats.n_streams; i++)
		stream_line(&stats.streams[i], lines[i], sizeof(lines[i]));
	cli_progress("%s\n%s\n%s\n%s\n%s%sm, 1-9: marker   %sq: end   %s", top,
		     stream_heading, lines[0], lines[1], lines[2],
		     stats.n_streams > 2 ? "\n" : "", stats.armed ? "t: trigger   " : "",
		     view->last);
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

void keyboard_end(void)
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

static void watch(int number, void (*handler)(int))
{
	/* SA_NODEFER, as the handler raises the signal. */
	struct sigaction action = {.sa_handler = handler,
				   .sa_flags = SA_RESTART | SA_NODEFER},
			 had;

	if (!sigaction(number, NULL, &had) && had.sa_handler != SIG_IGN)
		sigaction(number, &action, NULL);
}

void keyboard_begin(void)
{
	if (started || !isatty(STDIN_FILENO) || !in_front() ||
	    tcgetattr(STDIN_FILENO, &before))
		return;
	keys = before;
	keys.c_lflag &= ~(tcflag_t)(ICANON | ECHO); /* Ctrl-C goes on to be a signal */
	keys.c_cc[VMIN] = 0;
	keys.c_cc[VTIME] = 0;
	watch(SIGTSTP, on_stop);
	watch(SIGQUIT, on_stop);
	watch(SIGCONT, on_continue);
	started = true;
	atexit(keyboard_end);
	tcsetattr(STDIN_FILENO, TCSANOW, &keys);
}

bool keyboard_resumed(void)
{
	bool was = resumed;

	resumed = false;
	return was;
}

int keyboard_next(void)
{
	unsigned char key;

	return started && in_front() && read(STDIN_FILENO, &key, 1) == 1 ? key : 0;
}
