// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Time that the loop needs to publish its state: one tick after the other, and at 1 kHz, when its
 * memory is no longer in the cache. ns; times at 1 kHz are with the clock's own, which is reported.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include "../../lib/loop/state_page.h"

enum { PACED = 5000, CLOSE = 10000000 };

static int64_t now_ns(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static int by_size(const void *a, const void *b)
{
	const int64_t *x = a, *y = b;

	return (*x > *y) - (*x < *y);
}

static void publish(struct incise_state_writer *writer, int64_t n)
{
	struct incise_tick tick = {
		.t_ns = n * 1000000,
		.tool_mm = {0, 0, (double)(n % 1000)},
		.command_N = {0, 0, 1},
		.tool = INCISE_TOOL_BLADE,
		.flags = INCISE_TICK_CONTACT,
	};

	incise_state_tick(writer, &tick, 1000 + n * 7919 % 50000, 500 + n * 31 % 3000, 0);
}

static void close_together(struct incise_state_writer *writer)
{
	int64_t begin = now_ns();

	for (int64_t n = 0; n < CLOSE; n++)
		publish(writer, n);
	printf("one after the other: %.1f\n", (double)(now_ns() - begin) / CLOSE);
}

static void paced(struct incise_state_writer *writer)
{
	static int64_t cost[PACED], clock[PACED];
	int64_t due = now_ns();

	for (int n = 0; n < PACED; n++) {
		struct timespec t;
		int64_t a, b;

		due += 1000000;
		t = (struct timespec){due / 1000000000, due % 1000000000};
		clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
		a = now_ns();
		b = now_ns();
		publish(writer, n);
		cost[n] = now_ns() - b;
		clock[n] = b - a;
	}
	qsort(cost, PACED, sizeof(*cost), by_size);
	qsort(clock, PACED, sizeof(*clock), by_size);
	printf("at 1 kHz: median %lld, 99 %% %lld, 99.9 %% %lld; of that the clock %lld\n",
	       (long long)cost[PACED / 2], (long long)cost[PACED * 99 / 100],
	       (long long)cost[PACED * 999 / 1000], (long long)clock[PACED / 2]);
}

int main(void)
{
	const struct incise_state_setup setup = {.rate_hz = 1000};
	struct incise_error err = {0};
	struct incise_state_writer *writer;
	char path[60];

	snprintf(path, sizeof(path), "/dev/shm/incise-bench-%d.state", (int)getpid());
	writer = incise_state_new(path, &setup, &err);
	if (!writer) {
		fprintf(stderr, "%s\n", err.text);
		return 1;
	}
	close_together(writer);
	paced(writer);
	incise_state_free(writer);
	unlink(path);
	return 0;
}
