// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Plays a loop that publishes its state, for tests of who reads it:
 *
 *   loop FILE done     1000 ticks of known numbers, at once; stopped as asked
 *   loop FILE run      1 kHz until SIGTERM; then stopped
 *   loop FILE fault    100 ticks, then a fault, and exit 1
 *   loop FILE stall    10 ticks, then none, but it lives
 *   loop FILE start    no tick at all, but it lives
 */
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include "../../lib/loop/state_page.h"

static volatile sig_atomic_t stop;

static void asked(int signal)
{
	stop = signal;
}

static void tick(struct incise_state_writer *writer, int64_t t_ns, int64_t n,
		 int64_t lateness_ns)
{
	struct incise_tick now = {
		.t_ns = t_ns,
		/* 0.01 mm a tick, against 2 N. */
		.tool_mm = {0, 0, -0.01 * (double)n},
		.command_N = {0, 0, 2},
		.depth_mm = 0.01 * (double)n,
		.tool = INCISE_TOOL_BLADE,
		.phase = INCISE_PHASE_CUTTING,
		.flags = INCISE_TICK_CONTACT | (n % 10 ? 0 : INCISE_TICK_CLAMPED),
	};

	incise_state_tick(writer, &now, lateness_ns, 5000, n == 500 ? 3 : 0);
}

static void go(struct incise_state_writer *writer, long ticks)
{
	struct timespec due;

	clock_gettime(CLOCK_MONOTONIC, &due);
	for (long n = 0; n < ticks && !stop; n++) {
		int64_t t_ns = due.tv_sec * 1000000000LL + due.tv_nsec;

		tick(writer, t_ns, n, 20000);
		due.tv_nsec += 1000000;
		if (due.tv_nsec >= 1000000000) {
			due.tv_nsec -= 1000000000;
			due.tv_sec++;
		}
		clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
	}
}

static void done(struct incise_state_writer *writer)
{
	const struct incise_realtime_counts counts = {11, 12, 13, 14};

	for (int n = 0; n < 1000; n++)
		tick(writer, 1000000LL * n, n, 1000 * (n + 1));
	incise_state_scene(writer, "/scenes/other.scene", NULL);
	incise_state_refused(writer, "other.scene:3: syntax error");
	incise_state_counts(writer, &counts);
	incise_state_run(writer, INCISE_RUN_STOPPED, "SIGTERM");
}

int main(int argc, char **argv)
{
	const struct incise_state_setup setup = {1000, "sim:", "SCHED_FIFO 80, CPU 1"};
	struct incise_error err = {0};
	struct incise_state_writer *writer;
	const char *what;

	if (argc != 3)
		return 2;
	what = argv[2];
	signal(SIGTERM, asked);
	writer = incise_state_new(argv[1], &setup, &err);
	if (!writer) {
		fprintf(stderr, "%s\n", err.text);
		return 1;
	}
	incise_state_scene(writer, "/scenes/neck.scene", NULL);
	if (strcmp(what, "start"))
		incise_state_run(writer, INCISE_RUN_RUNNING, NULL);
	if (!strcmp(what, "done"))
		done(writer);
	if (!strcmp(what, "run"))
		go(writer, 600000);
	if (!strcmp(what, "fault"))
		go(writer, 100);
	if (!strcmp(what, "stall"))
		go(writer, 10);
	while (!stop && (!strcmp(what, "stall") || !strcmp(what, "start")))
		pause();
	if (!strcmp(what, "fault"))
		incise_state_run(writer, INCISE_RUN_FAULT,
				 "stepper: e-stop: release it, then clear");
	else if (strcmp(what, "done"))
		incise_state_run(writer, INCISE_RUN_STOPPED, "SIGTERM");
	incise_state_free(writer);
	return !strcmp(what, "fault");
}
