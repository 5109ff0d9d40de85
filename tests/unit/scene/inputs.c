// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Models of one to four inputs in a plan: its force against the model evaluated directly, at inputs
 * that are found here in another way; wild poses; and what a force by acceleration may be.
 */
#include <errno.h>
#include <math.h>
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/control/model_input.h"
#include "../../../lib/scene/plan.h"
#include "../message.h"
#include "fed.h"
#include "../cases.h"

static const struct incise_variable all_inputs[INCISE_MODEL_INPUT_KINDS] = {
	[INCISE_INPUT_DEPTH] = {"depth_mm", 0, 20},
	[INCISE_INPUT_SPEED] = {"velocity_mm_s", 0, 50},
	[INCISE_INPUT_ACCELERATION] = {"acceleration_mm_s2", -500, 500},
	[INCISE_INPUT_TILT] = {"tilt_deg", 0, 60},
	[INCISE_INPUT_TIME] = {"time_in_tissue_s", 0, 4},
	[INCISE_INPUT_MEAN_SPEED] = {"mean_speed_mm_s", 0, 40},
	[INCISE_INPUT_DEEPEST] = {"deepest_mm", 0, 20},
};

/* About 0.1 N/mm, 0.005 N s/mm, @mass of kg, 0.5 mN a degree, 5 mN a second, and a little of the last two. */
static void write_model(const enum incise_model_input *inputs, int n, double mass_kg)
{
	static const struct incise_variable out = {"force_N", 0, 4};
	static const int mfs[] = {3, 2, 2, 2};
	const double slope[INCISE_MODEL_INPUT_KINDS] = {
		0.1, 0.005, 1e-3 * mass_kg, 0.0005, 0.005, 0.0005, 0.001};
	struct incise_variable in[INCISE_LOOP_INPUTS_MAX];
	struct incise_model *model;

	for (int i = 0; i < n; i++)
		in[i] = all_inputs[inputs[i]];
	model = incise_model_new_grid(n, in, mfs, INCISE_MF_GAUSS, &out, NULL);
	for (int r = 0; r < incise_model_info(model)->n_rules; r++) {
		double p[INCISE_LOOP_INPUTS_MAX + 1] = {0.003 * (r % 5)};

		for (int i = 0; i < n; i++)
			p[i + 1] = slope[inputs[i]] * (1 + 0.02 * (r % 3));
		incise_model_set_consequent(model, r, p);
	}
	assert_int_equal(incise_model_save(model, folder.model, NULL), 0);
	incise_model_free(model);
}

/*
 * Down into the tissue and along in it, faster and slower, with a scalpel that leans; with *@own for a while just
 * above it.
 */
static void cut(void *own, double t_s, struct incise_tracker_sample *pose)
{
	double s = fmax(t_s - 0.5, 0);

	pose->position_mm[0] = 8 * s + 0.9 * sin(6 * s);
	pose->position_mm[1] = 0.3 * sin(3 * s);
	pose->position_mm[2] = 2 - 3 * fmin(s, 2) + 0.8 * sin(5 * s);
	/* The depth of a blade that touches down at once, and hovers from 1 s to 1.5 s. */
	if (own && *(const bool *)own)
		pose->position_mm[2] = s < 1 ? 0.08 - 0.6 * pow(sin(M_PI * s), 2)
					     : 0.08 - 2 * fmax(s - 1.5, 0);
	fed_attitude(pose->quaternion, 0.4 * sin(2 * s), 0.7 * s);
}

/* Inputs that the loop has to find, from the poses and a tick alone. */
struct truth {
	struct incise_predict predict;
	int64_t touched_ns;
	double path_mm, deepest_mm;
};

static void find(struct truth *truth, const struct incise_tick *tick,
		 double found[INCISE_MODEL_INPUT_KINDS])
{
	double x[3], v[3], a[3], q[4], w, z;

	incise_predict_at(&truth->predict, tick->t_ns, x, v, q);
	incise_predict_acceleration(&truth->predict, tick->t_ns, a);
	w = tick->quaternion[0];
	z = tick->quaternion[3];
	found[INCISE_INPUT_DEPTH] = tick->depth_mm;
	found[INCISE_INPUT_SPEED] = v3_length(v);
	found[INCISE_INPUT_ACCELERATION] = v3_dot(v, a) / fmax(v3_length(v), 5);
	/* The z axis turned by q has cos tilt = 1 - 2 (x² + y²) = 2 (w² + z²) - 1 along z. */
	found[INCISE_INPUT_TILT] = acos(2 * (w * w + z * z) - 1) * 180 / M_PI;
	found[INCISE_INPUT_TIME] = (double)(tick->t_ns - truth->touched_ns) * 1e-9;
	truth->path_mm += tick->t_ns > truth->touched_ns ? v3_length(v) * 1e-3 : 0;
	truth->deepest_mm = fmax(truth->deepest_mm, tick->depth_mm);
	found[INCISE_INPUT_MEAN_SPEED] =
		tick->t_ns > truth->touched_ns ? truth->path_mm / found[INCISE_INPUT_TIME]
					       : v3_length(v);
	found[INCISE_INPUT_DEEPEST] = truth->deepest_mm;
}

/* Returns how many ticks were compared. */
static int compare(struct incise_plan *plan, const struct incise_model *model,
		   const enum incise_model_input *inputs, int n)
{
	const unsigned int other = INCISE_TICK_STARTING | INCISE_TICK_CLAMPED |
				   INCISE_TICK_SLEWED | INCISE_TICK_STALE |
				   INCISE_TICK_UNPAID;
	struct truth truth = {0};
	bool inside = false, hovers = inputs[0] == INCISE_INPUT_MEAN_SPEED;
	int compared = 0;

	incise_predict_init(&truth.predict, &tracker, 0);
	for (int64_t t_ns = 1000000; t_ns < 3500000000; t_ns += 1000000) {
		double found[INCISE_MODEL_INPUT_KINDS], x[INCISE_LOOP_INPUTS_MAX],
			force_N;
		int64_t arrival_ns = t_ns / FED_PERIOD_NS * FED_PERIOD_NS;
		struct incise_tracker_sample pose = {.t_ns = arrival_ns};
		struct incise_tick tick;
		unsigned int flags = 0;

		if (t_ns - arrival_ns < 1000000) {
			cut(&hovers, (double)(arrival_ns - FED_LATENCY_NS) * 1e-9, &pose);
			incise_predict_add(&truth.predict, &pose);
		}
		assert_int_equal(fed_tick(plan, t_ns, cut, &hovers, &tick), 0);
		if (tick.flags & INCISE_TICK_CONTACT && !inside) {
			truth.touched_ns = t_ns;
			truth.path_mm = truth.deepest_mm = 0;
		}
		inside = tick.flags & INCISE_TICK_CONTACT;
		if (inside)
			find(&truth, &tick, found);
		if (!inside || tick.flags & other || !(tick.depth_mm > 0))
			continue;
		for (int i = 0; i < n; i++)
			x[i] = found[inputs[i]];
		force_N = fmax(incise_model_eval(model, x, &flags), 0);
		if (fabs(tick.command_N[2] - force_N) > 1e-7)
			fail_msg("%.9f N for %.9f N at %.3f s", tick.command_N[2],
				 force_N, (double)t_ns * 1e-9);
		assert_true(!(tick.flags & INCISE_TICK_EXTRAPOLATED) == !flags);
		compared++;
	}
	return compared;
}

static const struct {
	int n;
	enum incise_model_input inputs[INCISE_LOOP_INPUTS_MAX];
} cases[] = {
	{1, {INCISE_INPUT_DEPTH}},
	{2, {INCISE_INPUT_SPEED, INCISE_INPUT_DEPTH}},
	{3, {INCISE_INPUT_DEPTH, INCISE_INPUT_SPEED, INCISE_INPUT_ACCELERATION}},
	{3, {INCISE_INPUT_TILT, INCISE_INPUT_DEPTH, INCISE_INPUT_TIME}},
	{4,
	 {INCISE_INPUT_TIME, INCISE_INPUT_ACCELERATION, INCISE_INPUT_DEPTH,
	  INCISE_INPUT_TILT}},
	{2, {INCISE_INPUT_DEPTH, INCISE_INPUT_DEEPEST}},
	{3, {INCISE_INPUT_MEAN_SPEED, INCISE_INPUT_DEPTH, INCISE_INPUT_DEEPEST}},
};
#define N_CASES ((int)(sizeof(cases) / sizeof(*cases)))

static void forces_are_those_of_the_model(void **state)
{
	for (int i = 0; i < N_CASES; i += cases_are_all() ? 1 : 2) {
		struct incise_model *model;
		struct incise_scene *scene;
		struct incise_plan *plan;

		write_model(cases[i].inputs, cases[i].n, 0.02);
		model = incise_model_load(folder.model, NULL);
		plan = fed_plan(&folder, &tracker, &scene,
				"model = \"m.fis\"; arithmetic = \"double\"; tissue = { "
				"withdrawal = \"paper\"; };");
		assert_true(compare(plan, model, cases[i].inputs, cases[i].n) > 1000);
		incise_plan_free(plan);
		incise_scene_free(scene);
		incise_model_free(model);
	}
}

/* The same motion in integers and in double, on a plane or on a capsule, with a tissue that unloads. */
static void integers_hold_their_bound(void **state)
{
	static const char *const surfaces[] = {
		"", "surface = { kind = \"capsule\"; from_mm = [ 0.0, -50.0, -40.0 ]; "
		    "to_mm = [ 0.0, 50.0, -40.0 ]; radius_mm = 40.0; };"};
	const unsigned int other = INCISE_TICK_STARTING | INCISE_TICK_CLAMPED |
				   INCISE_TICK_SLEWED | INCISE_TICK_STALE |
				   INCISE_TICK_UNPAID;

	for (int i = 0; i < N_CASES; i++) {
		struct incise_scene *scene[2];
		struct incise_plan *plan[2];
		bool hovers = cases[i].inputs[0] == INCISE_INPUT_MEAN_SPEED;
		double worst_N = 0, bound_N;
		char text[400];
		int compared = 0;

		write_model(cases[i].inputs, cases[i].n, 0.02);
		for (int k = 0; k < 2; k++) {
			snprintf(text, sizeof(text),
				 "model = \"m.fis\"; arithmetic = \"%s\"; tissue = { "
				 "unloading_N_mm = 0.15; }; %s",
				 k ? "fixed" : "double", surfaces[i % 2]);
			plan[k] = fed_plan(&folder, &tracker, &scene[k], text);
		}
		bound_N = incise_plan_bound(plan[1], 20);
		assert_true(bound_N > 0 && bound_N < 0.02);
		for (int64_t t_ns = 1000000; t_ns < 3500000000; t_ns += 1000000) {
			struct incise_tick tick[2];

			for (int k = 0; k < 2; k++)
				assert_int_equal(fed_tick(plan[k], t_ns, cut, &hovers,
							  &tick[k]),
						 0);
			if (tick[0].phase != tick[1].phase ||
			    (tick[0].flags | tick[1].flags) & other)
				continue;
			compared += tick[0].phase == INCISE_PHASE_CUTTING;
			for (int j = 0; j < 3; j++)
				worst_N = fmax(worst_N, fabs(tick[0].command_N[j] -
							     tick[1].command_N[j]));
		}
		assert_true(compared > (i % 2 ? 500 : 1500));
		if (!(worst_N <= bound_N))
			fail_msg("case %d: off by %g N of %g N", i, worst_N, bound_N);
		for (int k = 0; k < 2; k++) {
			incise_plan_free(plan[k]);
			incise_scene_free(scene[k]);
		}
	}
}

static void refused(const char *text, int code, const char *says)
{
	struct incise_error err = {0};
	struct incise_scene *scene = fed_scene(&folder, text, &err);

	assert_non_null(scene);
	assert_error(incise_plan_new_fed(scene, &tracker, &err), code, &err, says);
	incise_scene_free(scene);
}

/*
 * It acts as a mass; of a device of 50 g no more than some 150 g, with what filter and delay leave. Tissue that holds a blade
 * at rest as a spring is none.
 */
static void acceleration_is_a_mass(void **state)
{
	static const enum incise_model_input inputs[] = {INCISE_INPUT_DEPTH,
							 INCISE_INPUT_ACCELERATION};
	struct incise_plan_stability s;
	struct incise_scene *scene;
	struct incise_plan *plan;

	write_model(inputs, 2, 0.4);
	refused("model = \"m.fis\"; arithmetic = \"double\"; tissue = { withdrawal = "
		"\"paper\"; };",
		EDOM, "not stable");
	refused("model = \"m.fis\"; arithmetic = \"double\"; device = { delay_ticks = 2; "
		"};",
		EDOM, "device.delay_ticks");
	write_model(inputs, 2, 0.05);
	scene = fed_scene(&folder, "model = \"m.fis\"; arithmetic = \"double\";", NULL);
	plan = incise_plan_new_fed(scene, &tracker, NULL);
	assert_non_null(plan);
	incise_plan_stability(plan, &s);
	assert_true(s.acceleration_slope_N_s2_mm > 5e-5 &&
		    s.acceleration_slope_N_s2_mm < 1.2e-4);
	incise_plan_free(plan);
	incise_scene_free(scene);
}

/* Poses that are anything: all that comes out is a number, and within the limits. */
static void wild_poses_give_forces_within_the_limits(void **state)
{
	static const enum incise_model_input inputs[] = {INCISE_INPUT_DEPTH,
							 INCISE_INPUT_ACCELERATION,
							 INCISE_INPUT_TILT,
							 INCISE_INPUT_TIME};
	static const double odd[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300, 1e9, 0};

	write_model(inputs, 4, 0.02);
	for (int fixed = 0; fixed < 2; fixed++) {
		struct incise_scene *scene;
		struct incise_plan *plan =
			fed_plan(&folder, &tracker, &scene,
				 fixed ? "model = \"m.fis\";"
				       : "model = \"m.fis\"; arithmetic = \"double\";");
		const int64_t n = cases_of(20000, 4000), apart = n * 19 / 20;
		uint64_t seed = 1;

		for (int64_t k = 1; k < n; k++) {
			/* Some ticks are an age apart. */
			int64_t t_ns = k < apart ? k * 1000000 : INT64_MAX - (n - k);
			struct incise_tracker_sample pose = {.t_ns = t_ns,
							     .quaternion = {1}};
			struct incise_tick tick;

			pose.position_mm[2] = -5 * sin(0.002 * (double)k);
			for (int i = 0; i < 7; i++) {
				double *to = i < 3 ? &pose.position_mm[i]
						   : &pose.quaternion[i - 3];

				incise_random_step(&seed);
				if (seed >> 40 & 1 && !(seed >> 50 & 7))
					*to = odd[(seed >> 44) % 7];
			}
			incise_plan_feed(plan, &pose, k % 8 == 0);
			assert_int_equal(incise_plan_tick(plan, t_ns, &tick), 0);
			assert_true(v3_finite(tick.command_N));
			assert_true(v3_length(tick.command_N) <= 4 * (1 + 1e-12));
		}
		incise_plan_free(plan);
		incise_scene_free(scene);
	}
}

/* The error of its direction is not bounded where a tool is shallow. */
static void tilt_on_a_mesh_needs_double(void **state)
{
	static const enum incise_model_input inputs[] = {INCISE_INPUT_DEPTH,
							 INCISE_INPUT_TILT};
	struct incise_scene *scene;

	write_model(inputs, 2, 0);
	refused("model = \"m.fis\"; surface = { kind = \"mesh\"; file = \"hill.obj\"; };",
		ENOTSUP, "set arithmetic to \"double\"");
	incise_plan_free(
		fed_plan(&folder, &tracker, &scene,
			 "model = \"m.fis\"; arithmetic = \"double\"; surface = { "
			 "kind = \"mesh\"; file = \"hill.obj\"; };"));
	incise_scene_free(scene);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(forces_are_those_of_the_model),
		cmocka_unit_test(acceleration_is_a_mass),
		cmocka_unit_test(wild_poses_give_forces_within_the_limits),
		cmocka_unit_test(integers_hold_their_bound),
		cmocka_unit_test(tilt_on_a_mesh_needs_double),
	};

	return cmocka_run_group_tests(tests, fed_set_up, fed_tear_down);
}
