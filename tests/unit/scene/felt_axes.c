// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The shipped neck on virtual rigs of one to three axes: a hand cuts and then goes sideways, and
 * the plane constraint is felt where an actuator pushes across the blade, and counted as not felt
 * where none does.
 */
#include "../unit.h"
#include <incise/backend.h>
#include <incise/loop.h>
#include <incise/plan.h>
#include <incise/sim.h>

#define PLANE_N_mm 0.17 /* of scenes/neck.scene */
#define ASIDE_MM 5
#define DOWN_MM 3
#define AT_TICK 1200 /* the hand rests since 0.3 s */
#define TICKS 1500
#define NS_PER_MS 1000000

/* Down to the depth, then aside, then at rest; after 0.2 s above the skin, so that force may
 * begin. */
static void hold(struct incise_sim *sim, int tick)
{
	double down = fmin(1, fmax(0, (tick - 200) / 300.0));
	double aside = fmin(1, fmax(0, (tick - 500) / 400.0));
	double position_mm[3] = {50, ASIDE_MM * aside, 1 - (1 + DOWN_MM) * down};
	double velocity_mm_s[3] = {0, aside > 0 && aside < 1 ? ASIDE_MM / 0.4 : 0,
				   down > 0 && down < 1 ? -(1 + DOWN_MM) / 0.3 : 0};
	const double upright[4] = {1};

	assert_int_equal(incise_sim_hold(sim, position_mm, velocity_mm_s, upright), 0);
}

/* Targets that a rig's first actuator is given. */
static double *targets_mm;
static int n_targets;
static const struct incise_stepper_ops *real_ops;

static int noted_set(struct incise_stepper *stepper, double position_mm)
{
	if (n_targets < TICKS)
		targets_mm[n_targets] = position_mm;
	n_targets++;
	return real_ops->set(stepper, position_mm);
}

struct run {
	struct incise_tick tick[TICKS];
	double target_mm[TICKS];
	double hand_N[3]; /* of each actuator at AT_TICK, by itself */
};

static void run(const char *spec, int axes, struct run *run)
{
	struct incise_scene *scene = incise_scene_load("scenes/neck.scene", NULL, NULL);
	struct incise_rig *rig =
		incise_rig_open(spec, INCISE_RIG_TRACKER | INCISE_RIG_STEPPER, NULL);
	struct incise_stepper *first = incise_rig_stepper(rig);
	struct incise_clock *clock = incise_rig_clock(rig);
	struct incise_plan *plan = incise_plan_new(scene, rig, NULL);
	struct incise_stepper_ops noting = *first->ops;

	assert_non_null(plan);
	real_ops = first->ops;
	noting.set = noted_set;
	first->ops = &noting;
	targets_mm = run->target_mm;
	n_targets = 0;
	for (int i = 0; i < TICKS; i++) {
		hold(incise_rig_sim(rig), i);
		incise_clock_wait_until(clock, incise_clock_now(clock) + NS_PER_MS);
		assert_int_equal(incise_plan_tick(plan, incise_clock_now(clock),
						  &run->tick[i]),
				 0);
		for (int k = 0; i == AT_TICK && k < axes; k++) {
			struct incise_stepper_status status;

			incise_stepper_status(incise_rig_axis(rig, k, NULL), &status);
			run->hand_N[k] = status.force_N;
		}
	}
	assert_int_equal(n_targets, TICKS);
	first->ops = real_ops;
	incise_plan_free(plan);
	incise_rig_close(rig);
	incise_scene_free(scene);
}

static struct run of[3];

static int run_all(void **state)
{
	static const char *const specs[] = {
		"sim:mouse,clock=simulated,tracker_noise_mm=0,axes=1",
		"sim:mouse,clock=simulated,tracker_noise_mm=0,axes=2",
		"sim:mouse,clock=simulated,tracker_noise_mm=0,axes=3",
	};

	for (int i = 0; i < 3; i++)
		run(specs[i], i + 1, &of[i]);
	return 0;
}

/* The paper's Fx = -Kx (P - P0)·Sx Sx on the hand: aside by 5 mm, towards the cut. */
TEST(the_plane_constraint_is_felt_with_two_axes)
{
	double want_N = -PLANE_N_mm * ASIDE_MM;
	const struct incise_tick *tick = &of[1].tick[AT_TICK];

	/* The skin is round: the blade's side lies in its tangent plane within some degrees. */
	assert_true(fabs(tick->command_N[1] - want_N) < 0.1 * fabs(want_N));
	assert_true(fabs(tick->actuated_N[1] - tick->command_N[1]) < 1e-12);
	/* The spring holds what was asked, to a microstep of 2 mm / 3200 times 2 N/mm, and
	 * friction of the handle is no part of it. */
	assert_true(fabs(of[1].hand_N[1] - tick->command_N[1]) < 2 * 2.0 / 3200);
	/* Less and less remains across. */
	assert_true(of[2].tick[AT_TICK].unfelt_N < 1e-12);
}

TEST(with_one_axis_it_is_reported_as_not_felt)
{
	const struct incise_tick *tick = &of[0].tick[AT_TICK];

	assert_true(fabs(tick->unfelt_N - hypot(tick->command_N[0], tick->command_N[1])) <
		    1e-12);
	assert_true(tick->unfelt_N > 0.9 * PLANE_N_mm * ASIDE_MM);
	assert_true(tick->actuated_N[1] == 0 && tick->rendered_N[1] == 0);
	assert_true(of[1].tick[AT_TICK].unfelt_N < 0.1 * tick->unfelt_N);
}

/* More axes change nothing of the first one, to the bit. */
TEST(the_first_axis_is_as_if_alone)
{
	for (int n = 1; n < 3; n++) {
		assert_memory_equal(of[n].target_mm, of[0].target_mm,
				    sizeof(of[0].target_mm));
		for (int i = 0; i < TICKS; i++) {
			const struct incise_tick *a = &of[0].tick[i], *b = &of[n].tick[i];

			assert_memory_equal(a->command_N, b->command_N,
					    sizeof(a->command_N));
			assert_true(a->actuated_N[0] == b->actuated_N[0]);
			assert_true(a->rendered_N[0] == b->rendered_N[0]);
		}
	}
	/* And they were driven. */
	assert_true(of[0].target_mm[AT_TICK] > 0.1);
}

GROUP(run_all, NULL);
