/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Plans for the stepper module made without a scene, the owner's side of one that runs, and the
 * same ticks in a program: they must give the same bits.
 *
 *   plan_make() ─▶ plan_load() ─▶ ENABLE ─▶ plan_pose() … plan_look() ─▶ plan_replay()
 */
#ifndef INCISE_VM_PLAN_H
#define INCISE_VM_PLAN_H

#include <stdbool.h>
#include <stdint.h>

#include "../../lib/fixed/plan.h"
#include "bench.h"

/* The parts of a plan. */
struct plan_recipe {
	const char *name;
	enum incise_fixed_shape_kind surface;
	int axes;
	int tick_ns;
	bool inserts, tube, membrane, plain; /* plain: a spring and nothing else */
	const char *model;		     /* a file, or NULL */
	bool texture;			     /* with a model */
};

/* The file of a plan, to be freed; NULL without memory or model. */
void *plan_make(const struct plan_recipe *recipe, uint32_t *size);

/* LOAD_PLAN for motors 0 … n_axes - 1. Returns 0 or a negative errno. */
int plan_load(const struct bench *bench, const void *file, uint32_t size,
	      uint32_t motors);

/* Takes the plan away. */
int plan_unload(const struct bench *bench, uint32_t motors);

/* A motor's config that goes with a plan of that tick. */
struct incise_stepper_config plan_config(const struct bench *bench, unsigned int motor,
					 uint32_t tick_ns, uint64_t deadman_ns);

/* Stores a pose in a motor's slot, or the tube's; returns its seq. */
uint32_t plan_pose(const struct bench *bench, unsigned int slot,
		   const struct incise_fixed_pose *pose);

struct incise_stepper_plan_status plan_look(const struct bench *bench);

/* A hand that goes into the tissue and out, with noise: @scalpel, and @tube beside it. */
struct plan_hand {
	uint64_t draw;
	int64_t start_ns;
	bool tube;
};
struct incise_fixed_pose plan_hand_at(struct plan_hand *hand, int64_t t_ns);

/* A pose, and the tick that took it. */
struct plan_taken {
	uint64_t tick;
	struct incise_fixed_pose pose;
};

/* The module's digest after so many ticks. */
struct plan_seen {
	uint64_t ticks;
	uint32_t digest;
};

struct plan_log {
	struct plan_taken *taken;
	struct plan_seen *seen;
	uint32_t n_taken, n_seen, capacity;
	int64_t first_ns; /* of tick 1 */
};

/* The ticks once more. Returns how many of what was seen differ; @last: the state then. */
uint32_t plan_replay(const void *file, uint32_t size, const struct plan_log *log,
		     struct incise_fixed_tick *last);

/*
 * Costs and lateness of the ticks since plan_trace_begin(), by the tracepoint, sorted; returns how
 * many. The newest, where there were more than fit.
 */
void plan_trace_begin(void);
uint32_t plan_trace_end(uint32_t *cost_ns, uint32_t *late_ns, uint32_t capacity);

/* The number of a row and a column, from 0, of a table of the module in debugfs; -1: none. */
int64_t plan_table(const struct bench *bench, const char *file, const char *row,
		   int column);

#endif
