// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A plan that is accepted comes to rest, and its message is right where it is not: the real plan
 * in a closed loop of this test's own, integrated in steps of 50 µs, which shares no code with
 * the search for swings.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/model.h>
#include <incise/plan.h>

#define STEP_S 50e-6
#define STEPS_PER_TICK 20
#define AIR_S 0.4
#define WAY 64

struct loop {
	const char *tissue; /* of the scene, beside the model */
	double mass_kg, damping_N_s_mm, tracker_hz, latency_s;
	int late_ticks;
	double lean_N, along_mm_s, run_s;
};

static const struct incise_tracker_info *tracker_of(const struct loop *loop)
{
	static struct incise_tracker_info tracker;

	tracker = (struct incise_tracker_info){
		.rate_hz = loop->tracker_hz,
		.latency_ns = llround(loop->latency_s * 1e9),
	};
	return &tracker;
}

/* The shipped model in a scene of this loop's device. */
static struct incise_scene *scene_of(const struct loop *loop)
{
	char path[] = "/tmp/incise-rest-XXXXXX", model[4096];
	struct incise_error err = {0};
	struct incise_scene *scene;
	FILE *file;
	int fd;

	assert_non_null(realpath("scenes/liver.fis", model));
	fd = mkstemp(path);
	assert_true(fd >= 0);
	file = fdopen(fd, "w");
	fprintf(file,
		"model = \"%s\"; tissue = { %s };\n"
		"device = { mass_kg = %.6f; damping_N_s_mm = %.6f; late_ticks = %d; };\n",
		model, loop->tissue, loop->mass_kg, loop->damping_N_s_mm,
		loop->late_ticks);
	assert_int_equal(fclose(file), 0);
	scene = incise_scene_load(path, NULL, &err);
	unlink(path);
	if (!scene)
		fail_msg("%s", err.text);
	return scene;
}

/* The plan, or NULL with the reason. */
static struct incise_plan *plan_of(const struct loop *loop, struct incise_scene **scene,
				   struct incise_error *err)
{
	struct incise_plan *plan;

	*scene = scene_of(loop);
	plan = incise_plan_new_fed(*scene, tracker_of(loop), err);
	if (!plan)
		assert_int_equal(err->code, EDOM);
	return plan;
}

static int64_t to_ns(double t_s)
{
	return 2000000000 + llround(t_s * 1e9);
}

/*
 * Range of the device's position over the last quarter, mm; the force through *force_N. A plan
 * goes on from run to run: each has its own time, and its own place on the skin.
 */
static double swing(struct incise_plan *plan, const struct loop *loop, int run,
		    double *force_N)
{
	double x = 0.5, v = 0, y = 200 * run, t_s, next_s = 0, force = 0;
	double held[17] = {0}, begin_s = 100 * run;
	double m = loop->mass_kg * 1e-3, low = INFINITY, high = -INFINITY;
	double way[WAY][3];
	unsigned int first = 0, last = 0;
	struct incise_tick tick;

	for (long i = 0; i < (long)(loop->run_s / STEP_S); i++) {
		t_s = i * STEP_S;
		if (t_s >= next_s) {
			way[last % WAY][0] = t_s + loop->latency_s;
			way[last % WAY][1] = y;
			way[last++ % WAY][2] = x;
			next_s += 1 / loop->tracker_hz;
		}
		if (i % STEPS_PER_TICK == 0) {
			for (; first != last && way[first % WAY][0] <= t_s; first++) {
				const double *pose = way[first % WAY];
				struct incise_tracker_sample sample = {
					.t_ns = to_ns(begin_s + pose[0]),
					.status = ' ',
					.position_mm = {pose[1], 0, pose[2]},
					.quaternion = {1},
				};

				assert_int_equal(incise_plan_feed(plan, &sample, 1), 1);
			}
			assert_int_equal(
				incise_plan_tick(plan, to_ns(begin_s + t_s), &tick), 0);
			held[loop->late_ticks] = tick.command_N[2];
			force = held[0];
			memmove(held, held + 1, (size_t)loop->late_ticks * sizeof(*held));
		}
		/* In the air until the force may start, then the hand leans. */
		if (t_s > AIR_S) {
			v += STEP_S * (force - loop->lean_N - loop->damping_N_s_mm * v) /
			     m;
			x += STEP_S * v;
			y += STEP_S * loop->along_mm_s;
		}
		if (t_s > 0.75 * loop->run_s) {
			low = fmin(low, x);
			high = fmax(high, x);
		}
	}
	*force_N = force;
	return high - low;
}

/* The liver, as it is shipped but for the tissue. */
static struct loop liver(const char *tissue)
{
	return (struct loop){tissue, 0.05, 0.01, 120, 4.2e-3, 0, 0, 0, 8};
}

/* 0.01 mm: what counts as rest; a static force is the lean's to the last roundings. */
static void rests(struct incise_plan *plan, const struct loop *loop, int run)
{
	double force_N, swing_mm = swing(plan, loop, run, &force_N);

	if (!(swing_mm <= 0.01) || !(fabs(force_N - loop->lean_N) < 0.01))
		fail_msg(
			"%s, %g kg, %g N s/mm, %g Hz, %d ticks late, %g N at %g mm/s: swings "
			"by %g mm, pushes with %g N",
			loop->tissue, loop->mass_kg, loop->damping_N_s_mm,
			loop->tracker_hz, loop->late_ticks, loop->lean_N,
			loop->along_mm_s, swing_mm, force_N);
}

static void lean_on(const struct loop *as, const double *leans, int n)
{
	struct loop loop = *as;
	struct incise_error err = {0};
	struct incise_scene *scene;

	struct incise_plan *plan = plan_of(&loop, &scene, &err);

	if (!plan)
		fail_msg("%s", err.text);
	for (int i = 0; i < n; i++) {
		loop.lean_N = leans[i];
		rests(plan, &loop, i);
	}
	incise_plan_free(plan);
	incise_scene_free(scene);
}

static const double all_leans[] = {0.2, 0.6, 1.2, 1.8, 1.9, 2.0, 2.1, 2.2, 2.4, 3, 3.8};
#define N(array) ((int)(sizeof(array) / sizeof(*(array))))

/* The leans on which the paper's formula swings for ever, and those around them. */
static void test_liver_rests(void **state)
{
	struct loop loop = liver("");

	lean_on(&loop, all_leans, N(all_leans));
	loop.along_mm_s = 15;
	lean_on(&loop, (const double[]){0.5, 2.1}, 2);
}

/* Devices and trackers: what is accepted rests, and of both there are some. */
static void test_accepted_rests(void **state)
{
	static const double leans[] = {0.3, 1.9};
	static const struct {
		const char *tissue;
		double mass_kg, damping_N_s_mm, tracker_hz;
		int late_ticks;
	} cases[] = {
		{"", 0.05, 0.025, 60, 0},
		{"", 0.08, 0.01, 240, 5},
		{"friction = 0.0;", 0.05, 0.01, 120, 0},
		{"withdrawal = \"paper\"; gain = 0.5;", 0.08, 0.015, 120, 5},
		{"withdrawal = \"paper\"; gain = 0.5;", 0.03, 0.02, 60, 0},
		{"", 0.05, 0.005, 60, 0},
		{"unloading_N_mm = 0.6;", 0.05, 0.01, 120, 0},
		{"withdrawal = \"paper\";", 0.05, 0.01, 120, 0},
	};
	int accepted = 0;

	for (int k = 0; k < N(cases); k++) {
		struct loop loop = {cases[k].tissue,
				    cases[k].mass_kg,
				    cases[k].damping_N_s_mm,
				    cases[k].tracker_hz,
				    4.2e-3,
				    cases[k].late_ticks,
				    0,
				    0,
				    6};
		struct incise_error err = {0};
		struct incise_scene *scene;
		struct incise_plan *plan = plan_of(&loop, &scene, &err);

		accepted += !!plan;
		incise_plan_free(plan);
		incise_scene_free(scene);
		if (plan)
			lean_on(&loop, leans, 2);
	}
	assert_int_equal(accepted, 5);
}

/* Number behind a word of a message. */
static double after(const char *text, const char *words)
{
	const char *at = strstr(text, words);

	assert_non_null(at);
	return atof(at + strlen(words));
}

/* The paper's formula is refused with a gain and a damping that do rest. */
static void test_refused_with_a_way_out(void **state)
{
	struct loop paper = liver("withdrawal = \"paper\";"), loop = paper;
	struct incise_error err = {0}, none = {0};
	struct incise_scene *scene;
	char gain[60];

	assert_null(plan_of(&paper, &scene, &err));
	incise_scene_free(scene);
	/* Softer leans rest: an independent loop found swings from 1.9 N on. */
	assert_true(after(err.text, "leans on it with ") > 1.8);
	loop.damping_N_s_mm = after(err.text, "device.damping_N_s_mm of at least ");
	assert_true(loop.damping_N_s_mm > 0.01 && loop.damping_N_s_mm < 0.03);
	lean_on(&loop, all_leans, 9);
	snprintf(gain, sizeof(gain), "withdrawal = \"paper\"; gain = %.6f;",
		 after(err.text, "tissue.gain to at most "));
	loop = liver(gain);
	lean_on(&loop, all_leans, 6);
	/* Far above, it is refused again. */
	loop = liver("withdrawal = \"paper\"; gain = 1.5;");
	assert_null(plan_of(&loop, &scene, &none));
	incise_scene_free(scene);
}

/* A lean above the scene's limit: it sinks, and never comes out again. */
static void test_above_the_limit(void **state)
{
	struct loop loop = liver("");
	struct incise_error err = {0};
	struct incise_scene *scene;
	struct incise_plan *plan = plan_of(&loop, &scene, &err);
	double force_N;

	loop.lean_N = 4.5; /* of at most 4 */
	loop.run_s = 4;
	/* It goes on by 0.5 N / 0.01 N s/mm = 50 mm/s for the last second. */
	assert_true(fabs(swing(plan, &loop, 0, &force_N) - 50) < 1);
	assert_true(fabs(force_N - 4) < 1e-6);
	incise_plan_free(plan);
	incise_scene_free(scene);
}

static void test_wrong_words(void **state)
{
	static const char *const wrong[] = {"withdrawal = \"Paper\";", "withdrawal = 1;",
					    "friction = 1.1;", "unloading_N_mm = -1.0;"};

	for (int i = 0; i < N(wrong); i++) {
		char path[] = "/tmp/incise-rest-XXXXXX";
		struct incise_error err = {0};
		int fd = mkstemp(path);

		assert_true(fd >= 0);
		dprintf(fd, "tissue = { reaction_N_mm = 0.1; %s };\n", wrong[i]);
		close(fd);
		assert_null(incise_scene_load(path, NULL, &err));
		unlink(path);
		assert_int_equal(err.code, EINVAL);
		assert_non_null(strstr(err.text, ":1"));
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_liver_rests),
		cmocka_unit_test(test_accepted_rests),
		cmocka_unit_test(test_refused_with_a_way_out),
		cmocka_unit_test(test_above_the_limit),
		cmocka_unit_test(test_wrong_words),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
