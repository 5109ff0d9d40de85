// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * kill -9 of `incise capture` at random moments, in real time: kill COUNT SEED [camera].
 *
 *     ├ commit ─ 100 ms ─ commit ─ 100 ms ─ ┤ kill
 *                         └──── lost ───────┘
 *
 * A machine that does little else loses at most 200 ms. The figure is printed and not judged, since beside
 * other programs it says more of them; in simulated time the bound is a unit test's.
 */
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include "round.h"

/* A machine, or a disk, that stands still so long is not measured. */
#define STALL_NS (40 * MS)

static struct {
	_Atomic int64_t late_ns; /* most, since it was cleared */
	_Atomic bool stop;
} canary;

/* Longest wait of a program that wants to run every 5 ms. */
static void *watch_machine(void *unused)
{
	int64_t next = now_ns();

	while (!canary.stop) {
		int64_t late_ns;

		next += 5 * MS;
		nap(next > now_ns() ? next - now_ns() : 0);
		late_ns = now_ns() - next;
		if (late_ns > canary.late_ns)
			canary.late_ns = late_ns;
		if (late_ns > 5 * MS)
			next = now_ns();
	}
	return unused;
}

static void attack(struct round *round, int count)
{
	int64_t lost_most_ns = 0, lost_sum_ns = 0;
	int timed = 0, unbegun = 0, stalled = 0, with_rows = 0;
	pthread_t thread;

	pthread_create(&thread, NULL, watch_machine, NULL);
	for (round->number = 1; round->number <= count; round->number++) {
		int64_t delay_ns = draw(1200 * MS), killed_ns, last_ns, lost_ns, took_ns;
		struct stat st;
		pid_t pid;

		snprintf(round->what, sizeof(round->what), "killed after %.4f s",
			 delay_ns * 1e-9);
		clear(round);
		pid = start(round, "sim:clock=real", NULL);
		for (int i = 0; stat("a.rec.part", &st) && i < 120000; i++)
			nap(MS / 2);
		if (stat("a.rec.part", &st))
			fail(round, "does not begin: %s", text_of("err"));
		/* Every other one is killed after its first rows came to the disk. */
		for (int i = 0;
		     round->number % 2 && round->page->seq[WATCH_FORCE] < 0 && i < 120000;
		     i++)
			nap(MS / 2);
		canary.late_ns = 0;
		nap(delay_ns);
		took_ns = round->page->took_ns;
		if (round->page->began_ns && now_ns() - round->page->began_ns > took_ns)
			took_ns = now_ns() - round->page->began_ns;
		killed_ns = now_ns();
		kill(pid, SIGKILL);
		waitpid(pid, NULL, 0);
		if (!round->page->commits) {
			/* There was no recording yet, and nothing to lose. */
			check_unbegun(round);
			unbegun++;
			continue;
		}
		check_recording(round, false);
		last_ns = ask(round,
			      "SELECT max(last_ns) FROM blocks WHERE stream = 'force'");
		with_rows += last_ns >= 0;
		if (last_ns < 0)
			last_ns = ask(round, "SELECT max(t_ns) FROM events");
		lost_ns = killed_ns - last_ns;
		if (took_ns > STALL_NS || canary.late_ns > STALL_NS) {
			stalled++;
			continue;
		}
		if (lost_ns > lost_most_ns)
			lost_most_ns = lost_ns;
		lost_sum_ns += lost_ns;
		timed++;
	}
	canary.stop = true;
	pthread_join(thread, NULL);
	if (!with_rows) {
		fprintf(stderr, "not one of %d recordings had rows\n", count);
		exit(1);
	}
	printf("kill: %d times, %d before the first commit; all others open, are intact, sealed and "
	       "have what was committed; lost at most %.1f ms, %.1f ms on average, by %d of "
	       "them (%d while the machine or its disk stood still)\n",
	       count, unbegun, lost_most_ns * 1e-6,
	       timed ? lost_sum_ns * 1e-6 / timed : 0, timed, stalled);
}

int main(int argc, char **argv)
{
	struct round round;
	int count = round_begin(&round, argc, argv, 1);

	attack(&round, count);
	return 0;
}
