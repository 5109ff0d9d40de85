// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A plan that is accepted comes to rest, and its message is right where it is not: in a closed
 * loop that shares no line with the search for swings.
 */
#include "../unit.h"
#include <incise/model.h>
#include <incise/plan.h>
#include "../../../tools/bench/closed_loop.h"
#include "../cases.h"
#include "../message.h"

struct loop {
	const char *tissue; /* of the scene, beside the model */
	struct closed_loop is;
};

/* The shipped model in a scene of this loop's device. */
static struct incise_scene *scene_of(const struct loop *loop)
{
	char path[] = "/tmp/incise-rest-XXXXXX", model[4096];
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
		model, loop->tissue, loop->is.mass_kg, loop->is.damping_N_s_mm,
		loop->is.late_ticks);
	assert_int_equal(fclose(file), 0);
	scene = incise_scene_load(path, NULL, &err);
	unlink(path);
	succeeds(scene);
	return scene;
}

/* The plan, or NULL with the reason. */
static struct incise_plan *plan_of(const struct loop *loop, struct incise_scene **scene,
				   struct incise_error *err)
{
	struct incise_tracker_info tracker = closed_loop_tracker(&loop->is);
	struct incise_plan *plan;

	*scene = scene_of(loop);
	plan = incise_plan_new_fed(*scene, &tracker, err);
	if (!plan)
		assert_int_equal(err->code, EDOM);
	return plan;
}

static struct closed_loop_end end_of(struct incise_plan *plan, const struct loop *loop,
				     int run)
{
	struct closed_loop_end end;

	assert_true(closed_loop_run(plan, &loop->is, run, &end));
	return end;
}

/* The liver, as it is shipped but for the tissue. */
static struct loop liver(const char *tissue)
{
	return (struct loop){tissue,
			     {.mass_kg = 0.05,
			      .damping_N_s_mm = 0.01,
			      .tracker_hz = 120,
			      .latency_s = 4.2e-3,
			      .run_s = 8}};
}

/* A static force is the lean's to the last roundings. */
static struct closed_loop_end rests(struct incise_plan *plan, const struct loop *loop,
				    int run)
{
	const struct closed_loop *is = &loop->is;
	struct closed_loop_end end = end_of(plan, loop, run);

	if (!(end.moved_mm <= CLOSED_LOOP_SWING_MM) ||
	    !(fabs(end.force_N - is->lean_N) < 0.01))
		fail_msg(
			"%s, %g kg, %g N s/mm, %g Hz, %d ticks late, %g N at %g mm/s: moves "
			"within %g mm, pushes with %g N",
			loop->tissue, is->mass_kg, is->damping_N_s_mm, is->tracker_hz,
			is->late_ticks, is->lean_N, is->along_mm_s, end.moved_mm,
			end.force_N);
	return end;
}

static void lean_on(const struct loop *as, const double *leans, int n)
{
	struct loop loop = *as;
	struct incise_scene *scene;

	struct incise_plan *plan = plan_of(&loop, &scene, &err);

	succeeds(plan);
	for (int i = 0; i < n; i++) {
		loop.is.lean_N = leans[i];
		rests(plan, &loop, i);
	}
	incise_plan_free(plan);
	incise_scene_free(scene);
}

static const double all_leans[] = {0.2, 0.6, 1.2, 1.8, 1.9, 2.0, 2.1, 2.2, 2.4, 3, 3.8};
#define N(array) ((int)(sizeof(array) / sizeof(*(array))))

/* The leans on which the paper's formula swings for ever, and those around them. */
TEST(test_liver_rests)
{
	struct loop loop = liver("");

	lean_on(&loop, all_leans, N(all_leans));
	loop.is.along_mm_s = 15;
	lean_on(&loop, (const double[]){0.5, 2.1}, 2);
}

/* Devices and trackers: what is accepted rests, and of both there are some. */
TEST(test_accepted_rests)
{
	static const double leans[] = {0.3, 1.9};
	static const struct {
		const char *tissue;
		double mass_kg, damping_N_s_mm, tracker_hz;
		int late_ticks;
		bool accepted;
	} cases[] = {
		{"", 0.05, 0.025, 60, 0, true},
		{"", 0.08, 0.01, 240, 5, true},
		{"friction = 0.0;", 0.05, 0.01, 120, 0, true},
		{"withdrawal = \"paper\"; gain = 0.5;", 0.08, 0.015, 120, 5, true},
		{"withdrawal = \"paper\"; gain = 0.5;", 0.03, 0.02, 60, 0, true},
		{"", 0.05, 0.005, 60, 0, false},
		{"unloading_N_mm = 0.6;", 0.05, 0.01, 120, 0, false},
		{"withdrawal = \"paper\";", 0.05, 0.01, 120, 0, false},
	};
	for (int k = 0; k < N(cases); k += cases_are_all() ? 1 : 3) {
		struct loop loop = liver(cases[k].tissue);
		struct incise_scene *scene;
		struct incise_plan *plan;

		loop.is.mass_kg = cases[k].mass_kg;
		loop.is.damping_N_s_mm = cases[k].damping_N_s_mm;
		loop.is.tracker_hz = cases[k].tracker_hz;
		loop.is.late_ticks = cases[k].late_ticks;
		loop.is.run_s = 6;
		plan = plan_of(&loop, &scene, &err);
		if (!!plan != cases[k].accepted)
			fail_msg("case %d: %s", k, plan ? "accepted" : err.text);
		incise_plan_free(plan);
		incise_scene_free(scene);
		if (plan)
			lean_on(&loop, leans, 2);
	}
}

/* Number behind a word of a message. */
static double after(const char *text, const char *words)
{
	const char *at = strstr(text, words);

	assert_non_null(at);
	return atof(at + strlen(words));
}

/* The paper's formula is refused with a gain and a damping that do rest. */
TEST(test_refused_with_a_way_out)
{
	struct loop paper = liver("withdrawal = \"paper\";"), loop = paper;
	struct incise_error err = {0}, none = {0};
	struct incise_scene *scene;
	double push_N;
	char gain[60];

	assert_null(plan_of(&paper, &scene, &err));
	incise_scene_free(scene);
	/* Softer leans rest: an independent loop found swings from 1.9 N on. */
	assert_int_equal(sscanf(strstr(err.text, " under ["), " under [%*f, %*f, %lf]",
				&push_N),
			 1);
	assert_true(push_N < -1.8);
	loop.is.damping_N_s_mm = after(err.text, "device.damping_N_s_mm of at least ");
	assert_true(loop.is.damping_N_s_mm > 0.01 && loop.is.damping_N_s_mm < 0.03);
	lean_on(&loop, all_leans, cases_of(9, 3));
	snprintf(gain, sizeof(gain), "withdrawal = \"paper\"; gain = %.6f;",
		 after(err.text, "tissue.gain to at most "));
	loop = liver(gain);
	lean_on(&loop, all_leans, cases_of(6, 2));
	/* Far above, it is refused again. */
	loop = liver("withdrawal = \"paper\"; gain = 1.5;");
	assert_null(plan_of(&loop, &scene, &none));
	incise_scene_free(scene);
}

/* A lean above the scene's limit: it sinks, and never comes out again. */
TEST(test_above_the_limit)
{
	struct loop loop = liver("");
	struct incise_scene *scene;
	struct incise_plan *plan = plan_of(&loop, &scene, &err);
	struct closed_loop_end end;

	loop.is.lean_N = 4.5; /* of at most 4 */
	loop.is.run_s = 4;
	/* It goes on by 0.5 N / 0.01 N s/mm = 50 mm/s for the last second. */
	end = end_of(plan, &loop, 0);
	assert_true(fabs(end.moved_mm - 50) < 1);
	assert_true(end.swing_mm < 1e-9);
	assert_true(fabs(end.force_N - 4) < 1e-6);
	incise_plan_free(plan);
	incise_scene_free(scene);
}

/*
 * A wall of 0.14 N/mm with a membrane 2 mm below, which yields at 0.8 N more, and a back wall: a
 * blade rests in front of it, on it, and behind the airway; also at the step where it yields.
 */
TEST(test_membrane)
{
	static const double leans_N[] = {0.1, 0.27, 0.29, 0.6, 1.05, 1.1, 1.5, 2, 3};
	const double front_N = 2 * 0.14, slope_N_mm = 0.8 / 5;
	struct loop loop = liver("");
	struct incise_tracker_info tracker = closed_loop_tracker(&loop.is);
	char path[] = "/tmp/incise-rest-XXXXXX";
	struct incise_scene *scene;
	struct incise_plan *plan;
	int fd = mkstemp(path);

	assert_true(fd >= 0);
	dprintf(fd, "tissue = { reaction_N_mm = 0.14; };\n"
		    "membrane = { point_mm = [0.0, 0.0, -2.0]; radius_mm = 1000.0;\n"
		    "thickness_mm = 5.0; puncture_N = 0.8; back_wall_mm = 14.0; };\n");
	close(fd);
	scene = incise_scene_load(path, NULL, &err);
	unlink(path);
	succeeds(scene);
	plan = incise_plan_new_fed(scene, &tracker, &err);
	succeeds(plan);
	for (int i = 0; i < N(leans_N); i++) {
		double over_N = leans_N[i] - front_N, want_mm;
		struct closed_loop_end end;

		loop.is.lean_N = leans_N[i];
		end = rests(plan, &loop, i);
		/* The first that it yields to opens it for all that follow. */
		want_mm = over_N < 0	 ? leans_N[i] / 0.14
			  : over_N < 0.8 ? 2 + over_N / slope_N_mm
					 : 2 + 14 + over_N / slope_N_mm;
		if (!(fabs(end.depth_mm - want_mm) < CLOSED_LOOP_SWING_MM))
			fail_msg("%g N: rests at %g mm and not at %g", leans_N[i],
				 end.depth_mm, want_mm);
	}
	incise_plan_free(plan);
	incise_scene_free(scene);
}

TEST(test_wrong_words)
{
	static const char *const wrong[] = {"withdrawal = \"Paper\";", "withdrawal = 1;",
					    "friction = 1.1;", "unloading_N_mm = -1.0;"};

	for (int i = 0; i < N(wrong); i++) {
		char path[] = "/tmp/incise-rest-XXXXXX";
		int fd = mkstemp(path);

		assert_true(fd >= 0);
		dprintf(fd, "tissue = { reaction_N_mm = 0.1; %s };\n", wrong[i]);
		close(fd);
		assert_error(incise_scene_load(path, NULL, &err), EINVAL, &err, path,
			     ":1");
		unlink(path);
	}
}
