// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The view of a running capture; see capture_view.h.
 *
 *     12.3 of 60.0 s   force   0.532 N [####......]   depth   4.21 mm   disk 5.2 h
 *     stream      rate/s       rows   lost   late  jitter ms  drift ppm       offset ms
 *     force     10000.00     123456      0      0 …
 *     m: marker   q: end
 */
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include <incise/clock.h>
#include "capture_view.h"
#include "../cli/cli.h"
#include "../cli/stopwatch.h"
#include "../cli/stream_report.h"

#define SHOW_NS 200000000LL
#define BAR 10

/*
 * A terminal that is held (Ctrl-S), or at the other end of a line that hangs, must not hold up
 * who records: nothing waits for it. It is opened anew, as flags of the one that was inherited
 * are the shell's too.
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

static bool terminal_takes(void)
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
	if (!terminal_takes())
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
