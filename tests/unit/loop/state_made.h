/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A folder with a state page, and ticks whose every field depends on their number, so that a
 * mixture of two is detected.
 */
#ifndef INCISE_TEST_STATE_MADE_H
#define INCISE_TEST_STATE_MADE_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../../../lib/loop/state_page.h"

/* Of the test that runs. */
static struct {
	char dir[200], path[256];
	struct incise_state_writer *writer;
} made;

static inline int made_folder(void **state)
{
	const char *base = getenv("TMPDIR");

	snprintf(made.dir, sizeof(made.dir), "%s/incise-XXXXXX", base ? base : "/tmp");
	if (!mkdtemp(made.dir))
		abort();
	snprintf(made.path, sizeof(made.path), "%s/neck.state", made.dir);
	made.writer = NULL;
	return 0;
}

static const struct incise_state_setup made_setup = {
	.rate_hz = 1000, .rig = "sim:", .policy = "SCHED_FIFO 80, CPU 1"};

static inline int made_page(void **state)
{
	made_folder(state);
	made.writer = incise_state_new(made.path, &made_setup, NULL);
	return made.writer ? 0 : -1;
}

static inline void made_close(void)
{
	incise_state_free(made.writer);
	made.writer = NULL;
}

static inline int made_end(void **state)
{
	made_close();
	unlink(made.path);
	return rmdir(made.dir); /* fails where something was left there */
}

/* Tick number n, from 0 on. */
static inline struct incise_tick made_tick(int64_t n)
{
	double x = (double)n;

	return (struct incise_tick){
		.t_ns = n,
		.position_mm = {x, x + 1, x + 2},
		.quaternion = {x + 3, x + 4, x + 5, x + 6},
		.tool_mm = {x + 7, x + 8, x + 9},
		.proxy_mm = {x + 10, x + 11, x + 12},
		.normal = {x + 13, x + 14, x + 15},
		.depth_mm = x + 16,
		.velocity_mm_s = x + 17,
		.command_N = {0, 0, x + 18},
		.actuated_N = {x + 19},
		.rendered_N = {x + 20},
		.flags = (unsigned int)n % (1u << INCISE_TICK_FLAGS),
		.phase = (enum incise_phase)(n % 3),
		.tool = (enum incise_tool)(1 + n % 3),
	};
}

/* Field by field: there may be holes between them. */
static inline int made_same(const struct incise_tick *a, const struct incise_tick *b)
{
	return a->t_ns == b->t_ns &&
	       !memcmp(a->position_mm, b->position_mm, sizeof(a->position_mm)) &&
	       !memcmp(a->quaternion, b->quaternion, sizeof(a->quaternion)) &&
	       !memcmp(a->tool_mm, b->tool_mm, sizeof(a->tool_mm)) &&
	       !memcmp(a->proxy_mm, b->proxy_mm, sizeof(a->proxy_mm)) &&
	       !memcmp(a->normal, b->normal, sizeof(a->normal)) &&
	       a->depth_mm == b->depth_mm && a->velocity_mm_s == b->velocity_mm_s &&
	       !memcmp(a->command_N, b->command_N, sizeof(a->command_N)) &&
	       a->actuated_N[0] == b->actuated_N[0] &&
	       a->rendered_N[0] == b->rendered_N[0] && a->flags == b->flags &&
	       a->phase == b->phase && a->tool == b->tool;
}

static inline void made_ticks(struct incise_state_writer *writer, int64_t from,
			      int64_t to)
{
	for (int64_t n = from; n < to; n++) {
		struct incise_tick tick = made_tick(n);

		incise_state_tick(writer, &tick, n, 2 * n, 0);
	}
	incise_state_mirror(writer);
}

#endif
