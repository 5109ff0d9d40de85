// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A plan in the kernel gives the same bits as in a program: noisy poses of 120 Hz with gaps go
 * through the page, and the same ticks once more afterwards, with what the status said of when a
 * pose was taken.
 *
 *   stepper_plan_bits TICKS MODEL SEED
 */
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>

#include "../draw.h"
#include "../plan.h"
#include "../tap.h"

#define DEADMAN_NS 2000000000

static struct bench bench;
#define FIGURES 20000
static uint32_t cost_ns[FIGURES], late_ns[FIGURES];

static uint64_t all_ticks, all_poses, all_seen;
static uint32_t all_differ;

static void remember(struct plan_log *log, const struct incise_stepper_plan_status *now)
{
	log->seen[log->n_seen++] =
		(struct plan_seen){.ticks = now->ticks, .digest = now->digest};
}

/* A pose, until a tick has taken it. */
static bool hand_over(struct plan_log *log, unsigned int slot, struct plan_hand *hand,
		      uint32_t tool)
{
	struct incise_fixed_pose pose = plan_hand_at(hand, bench_now_ns());
	struct incise_stepper_plan_status now;
	uint32_t seq;

	pose.tool = tool;
	seq = plan_pose(&bench, slot, &pose);
	for (int tries = 0; tries < 100; tries++) {
		bench_nap(200000);
		now = plan_look(&bench);
		if (seq !=
		    (slot == INCISE_STEPPER_SLOT_TUBE ? now.tube_seq : now.pose_seq))
			continue;
		if (slot == INCISE_STEPPER_SLOT_TUBE)
			pose.tool |= INCISE_FIXED_POSE_TUBE;
		log->taken[log->n_taken++] =
			(struct plan_taken){.tick = now.pose_tick, .pose = pose};
		remember(log, &now);
		return true;
	}
	return false;
}

/* Poses until there were so many ticks. Returns whether all were taken. */
static bool feed(struct plan_log *log, const struct plan_recipe *recipe, uint64_t ticks)
{
	struct plan_hand hand = {.draw = draw() | 1, .start_ns = bench_now_ns()};
	struct plan_hand tube = hand;
	int64_t next_ns = hand.start_ns;
	bool taken = true;

	tube.tube = true;
	while (taken && plan_look(&bench).ticks < ticks &&
	       log->n_taken + 4 < log->capacity) {
		uint32_t tool = recipe->inserts ? INCISE_TOOL_AUTO : INCISE_TOOL_BLADE;

		/* For a second each, the hand is told to hold something, or to let go. */
		if (recipe->inserts && draw_between(0, 3) == 0)
			tool = (uint32_t)draw_between(INCISE_TOOL_AUTO, INCISE_TOOL_TUBE);
		if (draw_between(0, 40) == 0)
			tool |= INCISE_STEPPER_POSE_FADE;
		taken = hand_over(log, 0, &hand, tool);
		if (taken && recipe->tube)
			taken = hand_over(log, INCISE_STEPPER_SLOT_TUBE, &tube, tool);
		next_ns += draw_between(0, 60) ? 8333333 : 150000000;
		if (next_ns > bench_now_ns())
			bench_nap(next_ns - bench_now_ns());
	}
	/* The last force fades. */
	bench_nap(200000000);
	return taken;
}

static bool start(const struct plan_recipe *recipe, const void *file, uint32_t size)
{
	const uint32_t motors = (1U << recipe->axes) - 1;
	int ret = 0;

	for (int m = 0; m < recipe->axes && !ret; m++) {
		struct incise_stepper_config config =
			plan_config(&bench, m, recipe->tick_ns, DEADMAN_NS);

		ret = bench_configure(&bench, &config, 750);
	}
	ret = ret ? ret : plan_load(&bench, file, size, motors);
	ret = ret ? ret : bench_command(&bench, INCISE_STEPPER_ENABLE, motors);
	for (int m = 1; m < recipe->axes && !ret; m++)
		plan_pose(&bench, m, &(struct incise_fixed_pose){.t_ns = 0});
	return check(!ret, "%s: it runs (%s)", recipe->name, strerror(-ret));
}

/* Reported: an emulator's figures, of instructions of 2 ns. */
static void figures(const char *name)
{
	uint32_t n = plan_trace_end(cost_ns, late_ns, FIGURES);
	int64_t load = plan_table(&bench, "plan", "load_ns", 1);
	int64_t motor = plan_table(&bench, "tick_cost", "mean_ns", 0);

	if (!check(n > 0 && load > 0 && motor > 0, "%s: its ticks are traced", name))
		return;
	note("%s: a tick costs %u ns, 99 %% %u, max %u; at load %lld; the motor's own %lld (mean)",
	     name, cost_ns[n / 2], cost_ns[n - n / 100 - 1], cost_ns[n - 1],
	     (long long)load, (long long)motor);
	note("%s: it is late by %u ns, 99 %% %u, max %u", name, late_ns[n / 2],
	     late_ns[n - n / 100 - 1], late_ns[n - 1]);
}

static void one(const struct plan_recipe *recipe, uint64_t ticks)
{
	const uint32_t motors = (1U << recipe->axes) - 1;
	/* Twice a pose's, and the tube's; 1 ms is the shortest between two. */
	uint32_t capacity =
		(uint32_t)(ticks * (uint64_t)recipe->tick_ns / 2000000 + 1000);
	struct plan_log log = {
		.taken = calloc(capacity, sizeof(*log.taken)),
		.seen = calloc(capacity, sizeof(*log.seen)),
		.capacity = capacity,
	};
	struct incise_stepper_plan_status now;
	struct incise_fixed_tick last = {0};
	uint32_t size = 0, differ;
	void *file = plan_make(recipe, &size);
	bool taken, moved = false;

	if (!file || !log.taken || !log.seen) {
		check(false, "%s: memory", recipe->name);
		return;
	}
	if (start(recipe, file, size)) {
		plan_trace_begin();
		taken = feed(&log, recipe, ticks);
		figures(recipe->name);
		now = plan_look(&bench);
		remember(&log, &now);
		log.first_ns =
			now.t_ns - (int64_t)(now.ticks - 1) * (int64_t)recipe->tick_ns;
		for (int m = 0; m < recipe->axes; m++)
			moved |= bench_look(&bench, m).steps_up > 0;
		check(taken && moved, "%s: poses are taken, and move it", recipe->name);
		check(!now.missed && !now.refused,
		      "%s: no tick missed (%llu), no pose refused (%llu)", recipe->name,
		      (unsigned long long)now.missed, (unsigned long long)now.refused);
		bench_command(&bench, INCISE_STEPPER_DISABLE, motors);
		differ = plan_replay(file, size, &log, &last);
		note("%s: %llu ticks, %u poses", recipe->name,
		     (unsigned long long)now.ticks, log.n_taken);
		check(!differ, "%s: the same bits as in a program; %u of %u differ",
		      recipe->name, differ, log.n_seen);
		check(!memcmp(last.command, now.command, sizeof(last.command)) &&
			      !memcmp(last.tool, now.tool, sizeof(last.tool)),
		      "%s: the status is of the same tick", recipe->name);
		all_ticks += now.ticks;
		all_poses += log.n_taken;
		all_seen += log.n_seen;
		all_differ += differ;
	}
	for (int m = 0; m < recipe->axes; m++)
		for (int i = 0; i < 1000 && bench_look(&bench, m).state !=
						    INCISE_STEPPER_STATE_DISABLED;
		     i++)
			bench_nap(1000000);
	plan_unload(&bench, motors);
	simulator_write("edges", "reset");
	free(file);
	free(log.taken);
	free(log.seen);
}

int main(int argc, char **argv)
{
	const uint64_t ticks = argc > 1 ? strtoull(argv[1], NULL, 0) : 100000;
	const char *model = argc > 2 && *argv[2] ? argv[2] : NULL;
	const struct plan_recipe recipes[] = {
		{"spring, 1 kHz", INCISE_FIXED_PLANE, 1, 1000000, .plain = true},
		{"plane, model, 1 kHz", INCISE_FIXED_PLANE, 1, 1000000, .inserts = true,
		 .membrane = true, .model = model},
		{"plane, texture, 1 kHz", INCISE_FIXED_PLANE, 1, 1000000, .model = model,
		 .texture = true},
		{"capsule, 2 axes, 1 kHz", INCISE_FIXED_CAPSULE, 2, 1000000,
		 .inserts = true, .tube = true, .model = model},
		{"grid, 3 axes, 1 kHz", INCISE_FIXED_GRID, 3, 1000000, .inserts = true,
		 .tube = true, .membrane = true, .model = model},
		{"grid, 10 kHz", INCISE_FIXED_GRID, 1, 100000, .plain = true},
		{"capsule, 10 kHz", INCISE_FIXED_CAPSULE, 1, 100000, .inserts = true,
		 .membrane = true},
	};
	const int n = sizeof(recipes) / sizeof(*recipes);

	mlockall(MCL_CURRENT | MCL_FUTURE);
	draw_seed(argc > 3 ? strtoull(argv[3], NULL, 0) : 1);
	for (int i = 0; i < n; i++) {
		int ret = bench_bind(&bench, recipes[i].axes);

		ret = ret ? ret : bench_open(&bench);
		if (check(!ret, "%s: motors are bound (%s)", recipes[i].name,
			  strerror(-ret)))
			one(&recipes[i], ticks / n);
		bench_close(&bench);
		check(!bench_unbind(&bench), "%s: they are unbound", recipes[i].name);
	}
	note("%llu ticks, %llu poses, compared at %llu: %u differ",
	     (unsigned long long)all_ticks, (unsigned long long)all_poses,
	     (unsigned long long)all_seen, all_differ);
	return tap_failures != 0;
}
