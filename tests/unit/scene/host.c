// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A plan in the loop of a simulator: equal to the plan itself at its rate, safe with any input, and at rest at the
 * steps of slow hosts, which an independent loop shows.
 */
#include "../unit.h"
#include <incise/host.h>
#include "../cases.h"
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "fed.h"

#define TICK_NS 1000000

static const char flat[] =
	"surface = { kind = \"plane\"; point_mm = [0.0, 0.0, 0.0]; "
	"normal = [0.0, 0.0, 1.0]; };"
	"tissue = { reaction_N_mm = 0.2; plane_N_mm = 0.1; damping_N_s_mm = 0.0005; };";

static const char hill[] =
	"model = \"m.fis\"; surface = { kind = \"mesh\"; file = \"hill.obj\"; };"
	"effects = { average_ticks = 8; };"
	"tissue = { plane_N_mm = 0.1; insertion_N_mm = 0.05; spread_N_mm = 0.05; };";

/* Of the test that runs. */
static struct fed_folder folder;
static struct incise_scene *scene;
static struct incise_host *host;
static struct incise_host_wrench wrench;

static void start(const char *text, const struct incise_host_options *options)
{
	fed_folder_make(&folder);
	scene = fed_scene(&folder, text, &err);
	if (!scene)
		fail_msg("%s", err.text);
	host = incise_host_new(scene, options, &err);
	if (!host)
		fail_msg("%s", err.text);
}

static void end(void)
{
	incise_host_free(host);
	incise_scene_free(scene);
	fed_folder_remove(&folder);
}

/* A hand that goes into the tissue, along it, and turns. */
static void path(double t_s, struct incise_host_pose *pose, double mm_s[3])
{
	const double way_mm[3] = {9, 7, 5}, rad_s[3] = {1.1, 0.7, 2.3};

	for (int i = 0; i < 3; i++) {
		pose->position_mm[i] = way_mm[i] * sin(rad_s[i] * t_s);
		mm_s[i] = way_mm[i] * rad_s[i] * cos(rad_s[i] * t_s);
	}
	pose->position_mm[2] += 1;
	fed_attitude(pose->quaternion, 0.8 * sin(t_s), 0.5 * sin(0.3 * t_s));
}

static double size(const double v[3])
{
	return v3_length(v);
}

/* A host that adds up its steps, as simulators do, gets the plan's bits. */
static void compare_with_plan(const char *text, int steps)
{
	struct incise_tracker_info poses = {.rate_hz = 1000, .stations = 1};
	const double tip_mm[3] = {3, -2, -1};
	struct incise_host_options options = {.tip_mm = {3, -2, -1}};
	struct incise_plan *plan;
	double most_N = 0, t_s = -3.7;

	start(text, &options);
	plan = incise_plan_new_fed(scene, &poses, &err);
	assert_non_null(plan);
	assert_int_equal(incise_plan_set_tip(plan, tip_mm), 0);
	for (int k = 0; k < steps; k++, t_s += 1e-3) {
		struct incise_tracker_sample sample = {
			.t_ns = INCISE_NS_PER_S + k * (int64_t)TICK_NS, .status = ' '};
		struct incise_host_pose pose;
		struct incise_tick own, tick;
		double mm_s[3], lever[3], torque[3];

		path(k * 1e-3, &pose, mm_s);
		v3_copy(sample.position_mm, pose.position_mm);
		memcpy(sample.quaternion, pose.quaternion, sizeof(pose.quaternion));
		incise_plan_feed(plan, &sample, 1);
		assert_int_equal(incise_plan_tick(plan, sample.t_ns, &tick), 0);
		assert_int_equal(incise_host_step(host, llround(t_s * 1e9), &pose, NULL,
						  &wrench),
				 0);
		incise_host_last(host, &own);
		own.t_ns = tick.t_ns;
		assert_memory_equal(&own, &tick, sizeof(tick));
		assert_memory_equal(wrench.force_N, tick.command_N,
				    sizeof(wrench.force_N));
		v3_rotate(lever, tick.quaternion, tip_mm);
		v3_add(lever, lever, 1, tick.tool_mm);
		v3_add(lever, lever, -1, tick.position_mm);
		v3_cross(torque, lever, tick.command_N);
		for (int i = 0; i < 3; i++)
			assert_float_equal(torque[i], wrench.torque_N_mm[i], 1e-9);
		most_N = fmax(most_N, size(wrench.force_N));
	}
	assert_true(most_N > 0.1);
	incise_plan_free(plan);
	end();
}

TEST(test_at_the_ticks_rate_it_is_the_plan)
{
	compare_with_plan(flat, 100000);
	compare_with_plan(hill, cases_of(100000, 5000));
}

/* In between, any steps give the bits of the poses at the ticks, where those are on a line. */
TEST(test_a_line_is_the_same_at_any_steps)
{
	struct incise_host_options options = {.host_period_s = 0.05};
	struct incise_host_pose pose = {.quaternion = {1}};
	double N[2][3];

	for (int way = 0; way < 2; way++) {
		int64_t t_ns = 0;

		start(flat, &options);
		for (int k = 0; t_ns < 2 * INCISE_NS_PER_S; k++) {
			t_ns += way ? TICK_NS
				    : (int64_t)(1 +
						incise_random_bits(1, (uint64_t)k) % 20) *
						TICK_NS;
			t_ns = t_ns < 2 * INCISE_NS_PER_S ? t_ns : 2 * INCISE_NS_PER_S;
			pose.position_mm[2] = 2 - 2e-9 * (double)t_ns;
			assert_int_equal(
				incise_host_step(host, t_ns, &pose, NULL, &wrench), 0);
		}
		v3_copy(N[way], wrench.force_N);
		end();
	}
	assert_true(N[0][2] > 0.2);
	assert_float_equal(N[0][2], N[1][2], 1e-6);
}

TEST(test_a_reset_starts_again)
{
	double N[2][3];

	start(hill, NULL);
	for (int way = 0; way < 2; way++) {
		for (int k = 0; k < 2000; k++) {
			struct incise_host_pose pose;
			double mm_s[3];

			path(k * 1e-3, &pose, mm_s);
			incise_host_step(host, k * (int64_t)TICK_NS, &pose, NULL,
					 &wrench);
		}
		v3_copy(N[way], wrench.force_N);
		incise_host_reset(host);
	}
	assert_true(size(N[0]) > 0);
	assert_memory_equal(N[0], N[1], sizeof(N[0]));
	end();
}
