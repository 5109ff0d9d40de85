// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Does something to a program that drives a motor on the simulated chip, and measures on the
 * motor's lines what became of it:
 *
 *   strike STEP ENABLE [--beyond STEPS] [--for MS] kill PID SIGNAL | input LINE LEVEL |
 *                                                  write FILE TEXT | none
 *
 *   step    _|~|_|~|_|~|_|~|_|~|__________        what is done      at struck_ns
 *   enable  ~~~~~~~~~~~~~~~~~~~~~~~~~~|__         last step         last_ms later
 *                 ^          ^       ^            power off         off_ms later
 *              struck       last    off
 *
 * Lines of the chip are numbers. --beyond waits first until the carriage is above so many
 * steps and moves. It looks until power has gone, for 10 s at most; or for all of --for. It
 * prints one line of NAME=NUMBER for the shell: from (where the carriage was), steps (from then
 * on), last_us and off_us (when, after the stroke; -1: not at all), at (where the carriage is
 * then), idle (steps without power: never), lost (edges that were not kept). The stroke of
 * `input`, which drives a line of the chip, is that line's edge.
 */
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include "../../clock.h"
#include "../simulator.h"

#define GIVE_UP_NS INT64_C(10000000000)
#define NEVER INT64_MIN

struct count {
	unsigned int step, enable; /* lines */
	int input;		   /* whose edge is the stroke; -1: none */
	bool powered;
	uint64_t steps, idle;
	int64_t last_ns, off_ns, struck_ns;
	uint64_t before; /* steps, until the stroke */
};

static void nap(void)
{
	nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
}

static void take(struct count *c)
{
	static struct incise_sim_edge edges[4096];
	long n;

	while ((n = simulator_edges(edges, 4096)) > 0)
		for (long i = 0; i < n; i++) {
			const struct incise_sim_edge *e = &edges[i];

			if (e->line == c->input) {
				c->struck_ns = e->t_ns;
				c->before = c->steps;
			} else if (e->line == c->enable) {
				c->powered = e->value;
				if (!e->value)
					c->off_ns = e->t_ns;
			} else if (e->line == c->step && e->value) {
				c->steps++;
				c->idle += !c->powered;
				c->last_ns = e->t_ns;
			}
		}
}

static int64_t carriage(void)
{
	return simulator_number_of("carriage", "0", "position");
}

/* Above so many steps, and on its way: steps of the last milliseconds. */
static bool get_going(struct count *c, int64_t beyond)
{
	int64_t end_ns = now_ns() + GIVE_UP_NS;

	while (now_ns() < end_ns) {
		uint64_t before = c->steps;

		nap();
		take(c);
		if (c->steps != before && carriage() > beyond)
			return true;
	}
	return false;
}

static bool act(char **word)
{
	FILE *file;

	if (!strcmp(word[0], "kill"))
		return !kill(atoi(word[1]), atoi(word[2]));
	if (!strcmp(word[0], "none"))
		return true;
	if (!strcmp(word[0], "input"))
		return !simulator_write("inputs", "%s %s", word[1], word[2]);
	file = fopen(word[1], "w");
	return file && fprintf(file, "%s\n", word[2]) > 0 && !fclose(file);
}

static int64_t after_us(int64_t t_ns, int64_t struck_ns)
{
	return t_ns < struck_ns ? -1 : (t_ns - struck_ns) / 1000;
}

static void watch(struct count *c, int64_t end_ns, bool all)
{
	do {
		nap();
		take(c);
	} while (now_ns() < end_ns && (all || c->off_ns < c->struck_ns));
}

static int strike(struct count *c, char **word, int64_t beyond, int64_t for_ns)
{
	int64_t from;

	if (beyond != NEVER && !get_going(c, beyond)) {
		fprintf(stderr, "the motor never moved beyond %" PRId64 "\n", beyond);
		return 1;
	}
	if (!strcmp(word[0], "input"))
		c->input = atoi(word[1]);
	from = carriage();
	c->before = c->steps;
	c->struck_ns = now_ns();
	if (!act(word)) {
		perror("strike");
		return 1;
	}
	watch(c, c->struck_ns + (for_ns ? for_ns : GIVE_UP_NS), for_ns);
	printf("from=%" PRId64 " steps=%" PRIu64 " last_us=%" PRId64 " off_us=%" PRId64
	       " at=%" PRId64 " idle=%" PRIu64 " lost=%" PRId64 "\n",
	       from, c->steps - c->before, after_us(c->last_ns, c->struck_ns),
	       after_us(c->off_ns, c->struck_ns), carriage(), c->idle,
	       simulator_number("status", "lost"));
	return 0;
}

int main(int argc, char **argv)
{
	/* That it has no power the next edges would show. */
	struct count c = {
		.input = -1, .powered = true, .last_ns = NEVER, .off_ns = NEVER};
	int64_t beyond = NEVER, for_ns = 0;
	int at = 3;

	for (; at + 1 < argc && !strncmp(argv[at], "--", 2); at += 2)
		if (!strcmp(argv[at], "--beyond"))
			beyond = atoll(argv[at + 1]);
		else
			for_ns = atoll(argv[at + 1]) * INT64_C(1000000);
	if (at >= argc || argc - at != (strcmp(argv[at], "none") ? 3 : 1))
		return 2;
	c.step = (unsigned int)atoi(argv[1]);
	c.enable = (unsigned int)atoi(argv[2]);
	mlockall(MCL_CURRENT | MCL_FUTURE);
	/* What was before is not counted. */
	simulator_write("edges", "reset");
	return strike(&c, argv + at, beyond, for_ns);
}
