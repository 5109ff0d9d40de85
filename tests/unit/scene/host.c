// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A plan in the loop of a simulator: equal to the plan itself at its rate, safe with any input,
 * and at rest at the steps of slow hosts, which an independent loop shows.
 */
#include "../unit.h"
#include <pthread.h>
#include <incise/host.h>
#include "../cases.h"
#include "../message.h"
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/scene/plan.h"
#include "fed.h"

#define TICK_NS 1000000

static const char flat[] =
	"surface = { kind = \"plane\"; point_mm = [0.0, 0.0, 0.0]; "
	"normal = [0.0, 0.0, 1.0]; };"
	"tissue = { reaction_N_mm = 0.2; plane_N_mm = 0.1; damping_N_s_mm = 0.0005; };";

static const char hill[] =
	"model = \"m.fis\"; surface = { kind = \"mesh\"; file = \"hill.obj\"; };"
	"effects = { average_ticks = 8; };"
	"tissue = { plane_N_mm = 0.1; insertion_N_mm = 0.05; spread_N_mm = 0.05; "
	"unloading_N_mm = 0.1331; };";

/* The test that runs has these. */
static struct incise_scene *scene;
static struct incise_host *host;
static struct incise_host_wrench wrench;

/* Hosts that move by themselves; whether the scene is stable is not asked. */
static void start(const char *text, const struct incise_host_options *options)
{
	fed_folder_make(&folder);
	scene = fed_scene(&folder, text, &err);
	if (!scene)
		fail_msg("%s", err.text);
	scene->unchecked = !(options && options->fit_gain);
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

/* Press into the skin at a constant depth from a time on, for so many steps. Returns the last answer. */
static int press(int64_t *t_ns, int steps, int64_t step_ns)
{
	struct incise_host_pose pose = {.quaternion = {1}};
	int rc = 0;

	for (int k = 0; k < steps; k++, *t_ns += step_ns) {
		pose.position_mm[2] = *t_ns < INCISE_NS_PER_S / 2 ? 1 : -2;
		rc = incise_host_step(host, *t_ns, &pose, NULL, &wrench);
	}
	return rc;
}

/* The flat scene's force at that depth. */
#define PRESSED_N 0.4

TEST(test_a_late_step_lets_go)
{
	const struct incise_host_options options = {.host_period_s = 0.01};
	int64_t t_ns = 0;

	start(flat, &options);
	assert_int_equal(press(&t_ns, 200, 10 * TICK_NS), 0);
	assert_float_equal(wrench.force_N[2], PRESSED_N, 1e-3);
	/* A tick later than said: part of the fade. */
	t_ns += TICK_NS;
	assert_int_equal(press(&t_ns, 1, 10 * TICK_NS), -ESTALE);
	assert_in_range((int64_t)(wrench.force_N[2] * 1e6), 1, 399000);
	assert_true(wrench.flags & INCISE_TICK_STARTING);
	/* It goes on by itself, and comes back. */
	for (int k = 0; size(wrench.force_N) > 0; k++) {
		assert_true(k < 100);
		assert_int_equal(press(&t_ns, 1, 10 * TICK_NS), 0);
	}
	assert_int_equal(press(&t_ns, 200, 10 * TICK_NS), 0);
	assert_float_equal(wrench.force_N[2], PRESSED_N, 1e-3);
	/* After years there is none left. */
	t_ns += INT64_C(1000000000) * INCISE_NS_PER_S;
	assert_int_equal(press(&t_ns, 1, 10 * TICK_NS), -ESTALE);
	assert_true(size(wrench.force_N) == 0);
	assert_int_equal(press(&t_ns, 200, 10 * TICK_NS), 0);
	assert_float_equal(wrench.force_N[2], PRESSED_N, 1e-3);
	end();
}

/* Steps up to the largest are never late, wherever the ticks fall between them. */
static void press_in_steps(double period_s, const int64_t step_ns[2], int hold_ticks,
			   int steps)
{
	const struct incise_host_options options = {.host_period_s = period_s};
	struct incise_host_info info;
	int64_t t_ns = 0;

	start(flat, &options);
	incise_host_info(host, &info);
	assert_int_equal(info.hold_ticks, hold_ticks);
	for (int k = 0; k < steps; k++)
		assert_int_equal(press(&t_ns, 1, step_ns[k % 2]), 0);
	assert_float_equal(wrench.force_N[2], PRESSED_N, 1e-3);
	end();
}

TEST(test_no_step_up_to_the_largest_is_late)
{
	press_in_steps(0.0005, (int64_t[]){500000, 500000}, 1, 3000);
	press_in_steps(0.0007, (int64_t[]){700000, 700000}, 3, 3000);
	press_in_steps(0.010, (int64_t[]){9500000, 10000000}, 10, 300);
	press_in_steps(0.010001, (int64_t[]){9500000, 10000000}, 12, 300);
	/* This host drifts through a whole tick. */
	press_in_steps(0.0040008, (int64_t[]){4000800, 4000800}, 6, 3000);
}

TEST(test_time_back_lets_go)
{
	int64_t t_ns = 0;

	start(flat, NULL);
	assert_int_equal(press(&t_ns, 2000, TICK_NS), 0);
	t_ns -= 5 * TICK_NS;
	assert_int_equal(press(&t_ns, 1, TICK_NS), -ERANGE);
	assert_true(size(wrench.force_N) < PRESSED_N);
	while (size(wrench.force_N) > 0) {
		assert_true(t_ns < 3 * INCISE_NS_PER_S);
		assert_int_equal(press(&t_ns, 1, TICK_NS), 0);
	}
	assert_int_equal(press(&t_ns, 1000, TICK_NS), 0);
	assert_float_equal(wrench.force_N[2], PRESSED_N, 1e-3);
	/* The same time again changes nothing. */
	t_ns -= TICK_NS;
	assert_int_equal(press(&t_ns, 1, TICK_NS), 0);
	assert_float_equal(wrench.force_N[2], PRESSED_N, 1e-3);
	end();
}

/* A clock that goes on while the host stands still, or is slower. */
TEST(test_a_live_host_lets_go)
{
	struct incise_clock *clock = incise_clock_new_simulated(0);
	const struct incise_host_options options = {.clock = clock};
	int64_t t_ns = 0, clock_ns = 77;

	start(flat, &options);
	for (int k = 0; k < 2000; k++) {
		incise_clock_wait_until(clock, clock_ns += TICK_NS);
		assert_int_equal(press(&t_ns, 1, TICK_NS), 0);
	}
	assert_float_equal(wrench.force_N[2], PRESSED_N, 1e-3);
	/* limits.pose_age_ms is 50: as long as it may be, and a second more. */
	incise_clock_wait_until(clock, clock_ns += 50 * TICK_NS);
	assert_int_equal(press(&t_ns, 1, 0), 0);
	assert_float_equal(wrench.force_N[2], PRESSED_N, 1e-3);
	incise_clock_wait_until(clock, clock_ns += 1000 * TICK_NS);
	assert_int_equal(press(&t_ns, 1, 0), -ESTALE);
	assert_true(size(wrench.force_N) == 0);
	for (int k = 0; k < 1000; k++) {
		t_ns += TICK_NS;
		incise_clock_wait_until(clock, clock_ns += TICK_NS);
		assert_int_equal(press(&t_ns, 1, 0), 0);
	}
	assert_float_equal(wrench.force_N[2], PRESSED_N, 1e-3);
	end();
	incise_clock_free(clock);
}

/* Any bits, or something near. */
static double any_number(uint64_t *random)
{
	uint64_t bits = incise_random_next(random);
	double number;

	if (bits % 4)
		return 20 * incise_random_symmetric(random);
	memcpy(&number, &(uint64_t){incise_random_next(random)}, sizeof(number));
	return bits % 8 ? number : bits % 16 ? INFINITY : NAN;
}

TEST(test_any_input_stays_within_the_limits)
{
	uint64_t random = cases_seed(1);
	int answers[4] = {0};

	for (int way = 0; way < 2; way++) {
		const struct incise_host_options options = {.host_period_s = 0.02,
							    .gives_velocity = way};
		struct incise_scene_limits limits;
		int64_t t_ns = 0;

		start(hill, &options);
		incise_scene_limits(scene, &limits);
		for (int k = 0; k < cases_of(1000000, 50000); k++) {
			struct incise_host_pose pose;
			double velocity[3];
			struct incise_tick tick;
			int rc;

			path(k * 1e-3, &pose, velocity);
			for (int i = 0; incise_random_draw(&random, 8) == 0 && i < 3;
			     i++) {
				pose.position_mm[i] = any_number(&random);
				velocity[i] = any_number(&random);
				pose.quaternion[i] += any_number(&random) / 20;
			}
			t_ns += incise_random_draw(&random, 10 * TICK_NS);
			if (incise_random_draw(&random, 200) == 0)
				t_ns = (int64_t)incise_random_next(&random);
			rc = incise_host_step(host, t_ns, &pose, velocity, &wrench);
			answers[rc == 0		? 0
				: rc == -EINVAL ? 1
				: rc == -ESTALE ? 2
						: 3]++;
			assert_true(rc == 0 || rc == -EINVAL || rc == -ESTALE ||
				    rc == -ERANGE);
			assert_true(v3_finite(wrench.force_N));
			assert_true(v3_finite(wrench.torque_N_mm));
			assert_true(size(wrench.force_N) <= limits.force_N);
			incise_host_last(host, &tick);
			assert_true(isfinite(tick.depth_mm) && v3_finite(tick.tool_mm));
		}
		end();
	}
	for (int i = 0; i < 4; i++)
		assert_true(answers[i] > 10);
}

/* An input that is refused changes nothing. */
TEST(test_a_refused_step_is_not_made)
{
	struct incise_host_pose pose = {.position_mm = {NAN}, .quaternion = {1}};
	struct incise_host_pose turned = {.quaternion = {0}};
	struct incise_host_pose far = {.position_mm = {0, 0, -2}, .quaternion = {1}};
	struct incise_host_pose longer = {.quaternion = {1.2}};
	struct incise_tick before, after;
	int64_t t_ns = 0;

	start(flat, NULL);
	press(&t_ns, 2000, TICK_NS);
	incise_host_last(host, &before);
	assert_int_equal(incise_host_step(host, t_ns, &pose, NULL, &wrench), -EINVAL);
	assert_true(size(wrench.force_N) == 0 && size(wrench.torque_N_mm) == 0);
	assert_int_equal(incise_host_step(host, t_ns, &turned, NULL, &wrench), -EINVAL);
	assert_int_equal(incise_host_step(host, t_ns, &longer, NULL, &wrench), -EINVAL);
	for (int i = 0; i < 6; i++) {
		far.position_mm[i % 3] = i < 3 ? 1e4 : -1e300;
		assert_int_equal(incise_host_step(host, t_ns, &far, NULL, &wrench),
				 -EINVAL);
		far.position_mm[i % 3] = 0;
	}
	assert_int_equal(incise_host_step(host, t_ns, NULL, NULL, &wrench), -EINVAL);
	incise_host_last(host, &after);
	assert_memory_equal(&before, &after, sizeof(before));
	assert_int_equal(press(&t_ns, 1, TICK_NS), 0);
	assert_float_equal(wrench.force_N[2], PRESSED_N, 1e-3);
	end();
}

/* Several threads step, read and reset one host; each call is whole. */
static void *step_thread(void *arg)
{
	uint64_t random = (uint64_t)(uintptr_t)arg;
	bool *whole = malloc(sizeof(*whole));

	*whole = true;
	for (int k = 0; k < 20000; k++) {
		struct incise_host_wrench own;
		struct incise_host_pose pose;
		struct incise_tick tick;
		double mm_s[3];

		path((double)incise_random_draw(&random, 3000) * 1e-3, &pose, mm_s);
		incise_host_step(host, k * (int64_t)TICK_NS, &pose, NULL, &own);
		incise_host_last(host, &tick);
		*whole = *whole && v3_length(own.force_N) <= 4 && tick.depth_mm >= 0;
		if (k % 1000 == 0)
			incise_host_reset(host);
		if (k % 100 == 0)
			incise_host_set_tool(host, (enum incise_tool)(k / 100 % 4));
	}
	return whole;
}

TEST(test_any_thread_may_step)
{
	pthread_t thread[2];

	start(hill, NULL);
	for (uintptr_t i = 0; i < 2; i++)
		assert_int_equal(pthread_create(&thread[i], NULL, step_thread,
						(void *)(i + 1)),
				 0);
	for (int i = 0; i < 2; i++) {
		void *whole;

		assert_int_equal(pthread_join(thread[i], &whole), 0);
		assert_true(*(bool *)whole);
		free(whole);
	}
	end();
}

/* A slower host bears less; the refusal names the gain that the fit takes. */
TEST(test_a_slow_host_bears_less)
{
	static const char stiff[] =
		"surface = { kind = \"plane\"; }; tissue = { reaction_N_mm = 3.0; };";
	double before = INFINITY, first = 0;

	for (int ticks = 1; ticks <= 40; ticks *= cases_are_all() ? 2 : 6) {
		struct incise_host_options options = {.host_period_s = ticks * 1e-3};
		struct incise_host_info info;
		struct incise_scene *own;
		char gain[64];

		options.fit_gain = true;
		start(stiff, &options);
		incise_host_info(host, &info);
		assert_int_equal(info.hold_ticks, ticks);
		assert_float_equal(info.tick_s, 1e-3, 0);
		assert_float_equal(info.scene_gain, 1, 0);
		/* The search ends within some hundredths. */
		assert_true(info.gain < 1.05 * before);
		first = ticks == 1 ? info.gain : first;
		before = info.gain;
		options.fit_gain = false;
		own = fed_scene(&folder, stiff, &err);
		snprintf(gain, sizeof(gain), "set tissue.gain to at most %.3g",
			 info.gain);
		assert_error(incise_host_new(own, &options, &err), EDOM, &err,
			     folder.scene, gain);
		incise_scene_free(own);
		end();
	}
	assert_true(before < 0.7 * first);
}

/* A slanting groove of few facets. */
static void write_groove(const char *path)
{
	FILE *out = fopen(path, "w");

	fprintf(out, "ncols 5\nnrows 5\nxllcenter -40\nyllcenter -40\ncellsize 20\n");
	for (int y = 40; y >= -40; y -= 20)
		for (int x = -40; x <= 40; x += 20)
			fprintf(out, "%.2f%c", fabs(0.45 * y - 0.6 * x),
				x == 40 ? '\n' : ' ');
	fclose(out);
}

/*
 * Each step of a host up to the longest is judged from where the lean came to rest: a state that must be kicked is so at
 * 8, 6, 4, 3, 2 and 1 ticks, and rests again after each. From what a kick left behind the next one would swing.
 */
TEST(test_a_kick_at_one_step_is_none_at_the_next)
{
	static const char groove[] =
		"surface = { kind = \"heights\"; file = \"hill.asc\"; }; rate_hz = 250.0;"
		"device = { mass_kg = 0.025; damping_N_s_mm = 0.004; };"
		"limits = { force_N = 0.6; pose_age_ms = 1000.0; };"
		"effects = { average_ticks = 40; }; tissue = { reaction_N_mm = 0.12; };";
	static const struct incise_tracker_info poses = {.name = "host", .rate_hz = 250};
	static const struct {
		int ticks, kicks;
	} longest[] = {{1, 1}, {8, 6}};

	fed_folder_make(&folder);
	write_groove(folder.heights);
	scene = fed_scene(&folder, groove, &err);
	succeeds(scene);
	for (int i = cases_are_all() ? 0 : 1; i < 2; i++) {
		struct incise_host_hold hold = {.ticks = longest[i].ticks};
		struct incise_plan *plan =
			incise_plan_new_held(scene, &poses, &hold, &err);
		struct incise_plan_stability s;

		succeeds(plan);
		incise_plan_stability(plan, &s);
		assert_int_equal(s.weakest.paid, longest[i].kicks);
		incise_plan_free(plan);
	}
	incise_scene_free(scene);
	fed_folder_remove(&folder);
}

TEST(test_options_are_checked)
{
	struct incise_host_options options = {.host_period_s = NAN};

	start(flat, NULL);
	assert_error(incise_host_new(scene, &options, &err), EINVAL, &err,
		     "host_period_s", "512");
	options.host_period_s = 0.513;
	assert_error(incise_host_new(scene, &options, &err), EINVAL, &err,
		     "host_period_s", "512");
	options = (struct incise_host_options){.tip_mm = {0, INFINITY, 0}};
	assert_error(incise_host_new(scene, &options, &err), EINVAL, &err, "tip_mm",
		     "1e6");
	/* Poses of such steps are always too old. */
	options = (struct incise_host_options){.host_period_s = 0.06};
	assert_error(incise_host_new(scene, &options, &err), EDOM, &err, folder.scene,
		     "limits.pose_age_ms: a host's poses", "host_period_s");
	incise_host_free(NULL);
	end();
}
