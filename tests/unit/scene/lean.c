// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Nothing that a scene does not need, as a property: of random scenes the plan with the stages that the
 * scene needs has the ticks of the plan with all stages, to the bit, with its flags. choose.c leaves out
 * one stage at a time.
 *
 *     seed ─▶ a scene as text ─▶ in double  ─▶ lean ─┐ each tick    poses, tools, fades
 *                             └▶ in integers ─▶ full ─┘ the same ◀── of the same seed
 *
 * The scenes are not checked to be stable: no force moves this hand. SEED=N begins with the scene of a
 * seed that failed.
 */
#include "../unit.h"
#include "../cases.h"
#include "drawn.h"

#define SCENES 10000
#define SCENES_FEW 200
#define TICKS 400
#define PRINTED 3 /* scenes of each arithmetic that fail */

/* --- the property ------------------------------------------------------------------------- */

/* What all scenes met. */
struct seen {
	unsigned int flags, phases, tools;
	int ticks, with_force;
	int parted; /* scenes whose plans are not the same */
	struct {
		const char *name;
		int plans;
	} left_out[INCISE_PLAN_STAGES_MAX + INCISE_PLAN_NO_STAGES];
};

/* The first field that is not the same, NULL: all are. */
static const char *difference(const struct incise_tick *a, const struct incise_tick *b)
{
#define DIFFERS(field)                                      \
	if (memcmp(&a->field, &b->field, sizeof(a->field))) \
		return #field;
	DIFFERS(command_N)
	DIFFERS(flags)
	DIFFERS(phase)
	DIFFERS(tool)
	DIFFERS(depth_mm)
	DIFFERS(normal)
	DIFFERS(proxy_mm)
	DIFFERS(tool_mm)
	DIFFERS(position_mm)
	DIFFERS(quaternion)
	DIFFERS(velocity_mm_s)
#undef DIFFERS
	return NULL;
}

static void print_tick(const char *name, const struct incise_tick *tick)
{
	printf("%s: %.17g %.17g %.17g N, flags 0x%x, phase %d, tool %d, depth %.17g mm\n",
	       name, tick->command_N[0], tick->command_N[1], tick->command_N[2],
	       tick->flags, tick->phase, tick->tool, tick->depth_mm);
}

static void print_difference(uint64_t seed, int at, const struct drawn *d, int k,
			     const struct incise_tick tick[2])
{
	const char *what = difference(&tick[0], &tick[1]);

	printf("the scene of seed %" PRIu64 " parts at tick %d: %s\n", seed, at,
	       what ? what : "a fault, or whether the force has faded");
	print_tick("lean", &tick[0]);
	print_tick("full", &tick[1]);
	printf("tracker: %.9g Hz, %lld ns, station of the tube %d\n%s\n",
	       d->tracker.rate_hz, (long long)d->tracker.latency_ns,
	       d->tracker.tube_station, d->text[k].all);
}

static void see(struct seen *seen, const struct incise_tick *tick)
{
	seen->flags |= tick->flags;
	seen->phases |= 1U << tick->phase;
	seen->tools |= 1U << tick->tool;
	seen->ticks++;
	seen->with_force += v3_length(tick->command_N) > 0;
}

static bool leaves_out(const struct incise_plan *plan, const char *name)
{
	const char *out;

	for (int i = 0; (out = incise_plan_left_out(plan, i, NULL)); i++)
		if (!strcmp(out, name))
			return true;
	return false;
}

/* Count the stages that only the full plan has. */
static void see_left_out(struct seen *seen, const struct incise_plan *lean,
			 const struct incise_plan *full)
{
	const char *name;

	for (int i = 0; (name = incise_plan_stage(full, i)); i++) {
		seen->left_out[i].name = name;
		seen->left_out[i].plans += leaves_out(lean, name);
	}
}

/* Returns the tick at which lean and full plan part, -1: at none. */
static int first_difference(struct hand *h, struct incise_tick tick[2], struct seen *seen)
{
	for (int i = 0; i < TICKS; i++) {
		int rc[2];

		step(h);
		for (int k = 0; k < 2; k++)
			rc[k] = incise_plan_tick(h->plan[k], h->t_ns, &tick[k]);
		if (rc[0] || rc[1] || difference(&tick[0], &tick[1]) ||
		    incise_plan_faded(h->plan[0]) != incise_plan_faded(h->plan[1]))
			return i;
		see(seen, &tick[0]);
	}
	return -1;
}

static void compare(uint64_t seed, const struct drawn *d, int k, struct seen *seen)
{
	struct incise_scene *scene = fed_scene(&folder, d->text[k].all, &err);
	struct incise_plan *plan[2] = {NULL, NULL};
	struct incise_tick tick[2];
	struct hand hand;
	int at;

	if (scene)
		scene->unchecked = true;
	for (int full = 0; scene && full < 2; full++) {
		incise_scene_set_full(scene, full);
		plan[full] = incise_plan_new_fed(scene, &d->tracker, &err);
	}
	if (!plan[0] || !plan[1])
		fail_msg("scene of seed %" PRIu64 ": %s\n%s", seed, err.text,
			 d->text[k].all);
	see_left_out(seen, plan[0], plan[1]);
	hand = hand_of(seed, d, scene, plan);
	at = first_difference(&hand, tick, seen);
	if (at >= 0 && seen->parted++ < PRINTED)
		print_difference(seed, at, d, k, tick);
	for (int full = 0; full < 2; full++)
		incise_plan_free(plan[full]);
	incise_scene_free(scene);
}

/* The scenes were varied: else the property says little. */
static void assert_varied(const struct seen *seen, int scenes)
{
	const unsigned int met =
		INCISE_TICK_CONTACT | INCISE_TICK_EXTRAPOLATED | INCISE_TICK_STALE |
		INCISE_TICK_CLAMPED | INCISE_TICK_SLEWED | INCISE_TICK_STARTING |
		INCISE_TICK_UNUSABLE | INCISE_TICK_IN_CUT | INCISE_TICK_MEMBRANE |
		INCISE_TICK_LUMEN | INCISE_TICK_BACK_WALL | INCISE_TICK_FULL;
	int out = 0;

	assert_int_equal(seen->flags & met, met);
	assert_int_equal(seen->phases, 7);
	assert_int_equal(seen->tools, 1 << INCISE_TOOL_BLADE | 1 << INCISE_TOOL_HANDLE |
					      1 << INCISE_TOOL_TUBE);
	assert_true(seen->with_force > seen->ticks / 10);
	for (int i = 0; seen->left_out[i].name; i++)
		out += seen->left_out[i].plans > 0;
	/* Tool, normal, incision, membrane, work, texture, and each force. */
	assert_int_equal(out, 6 + incise_n_tissue_forces);
}

TEST(test_a_plan_needs_no_more_than_its_scene)
{
	int scenes = cases_are_all() ? SCENES : SCENES_FEW;
	uint64_t first = cases_seed(1);
	struct seen seen[2] = {0};
	static struct drawn d;

	for (int i = 0; i < scenes; i++) {
		draw(first + (uint64_t)i, &d);
		for (int k = 0; k < 2; k++)
			compare(first + (uint64_t)i, &d, k, &seen[k]);
	}
	if (seen[0].parted || seen[1].parted)
		fail_msg("of %d scenes %d in double and %d in integers are not those of "
			 "the whole pipeline",
			 scenes, seen[0].parted, seen[1].parted);
	for (int k = 0; k < 2; k++)
		assert_varied(&seen[k], scenes);
}

GROUP(drawn_set_up, drawn_tear_down);
