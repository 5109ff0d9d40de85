// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A simulator's own loop that renders a scene of incise: 1000 times a second it feeds a pose of
 * its own and gets the force of the tissue. Here a script is the hand: it lowers the scalpel to
 * 8 mm below the surface, cuts along x, and lifts it. No device is needed.
 *
 *     hand() ──pose──▶ incise_plan_feed() ─▶ incise_plan_tick() ──force──▶ your actuator
 *
 *     ./own_loop liver.scene
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <incise/plan.h>

#define SECONDS 4
#define DEPTH_MM 8.0
#define CUT_MM_S 10.0

/* Height above the surface and way along x at a time. */
static void hand(double t_s, const struct incise_touch *top,
		 struct incise_tracker_sample *pose)
{
	double share = t_s < 1 ? t_s : t_s < SECONDS - 1 ? 1 : SECONDS - t_s;
	double height_mm = 2 - share * (2 + DEPTH_MM);
	double along_mm = t_s < 1 ? 0 : (t_s - 1) * CUT_MM_S;

	for (int i = 0; i < 3; i++)
		pose->position_mm[i] = top->point_mm[i] + height_mm * top->normal[i];
	pose->position_mm[0] += along_mm;
	memcpy(pose->quaternion, (double[]){1, 0, 0, 0}, sizeof(pose->quaternion));
}

static int64_t now_ns(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return now.tv_sec * INCISE_NS_PER_S + now.tv_nsec;
}

/* Each wake-up follows from the one before, so that delays do not add up. */
static void wait_until(int64_t t_ns)
{
	struct timespec at = {t_ns / INCISE_NS_PER_S, t_ns % INCISE_NS_PER_S};

	while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) == EINTR)
		;
}

static int run(struct incise_plan *plan, double rate_hz)
{
	int64_t period_ns = (int64_t)(INCISE_NS_PER_S / rate_hz), start_ns = now_ns();
	int ticks = (int)(SECONDS * rate_hz), late = 0, rc = 0;
	double most_N = 0, deepest_mm = 0;
	struct incise_touch top;
	struct incise_tick tick;

	incise_plan_top(plan, &top);
	for (int n = 1; n <= ticks && !rc; n++) {
		int64_t t_ns = start_ns + n * period_ns;
		struct incise_tracker_sample pose = {
			.t_ns = t_ns, .seq = (uint64_t)n, .status = ' ', .station = 1};
		double force_N;

		wait_until(t_ns);
		late += now_ns() - t_ns > period_ns;
		hand(n / rate_hz, &top, &pose);
		incise_plan_feed(plan, &pose, 1);
		rc = incise_plan_tick(plan, t_ns, &tick);
		force_N = sqrt(tick.command_N[0] * tick.command_N[0] +
			       tick.command_N[1] * tick.command_N[1] +
			       tick.command_N[2] * tick.command_N[2]);
		most_N = fmax(most_N, force_N);
		deepest_mm = fmax(deepest_mm, tick.depth_mm);
		if (n % (ticks / 16) == 0)
			printf("%5.2f s %6.2f mm %6.3f N\n", n / rate_hz, tick.depth_mm,
			       force_N);
	}
	printf("%d ticks, %d late; up to %.2f mm and %.3f N\n", ticks, late, deepest_mm,
	       most_N);
	return rc;
}

int main(int argc, char **argv)
{
	/* The poses are this program's own: new at each tick, and without a delay. */
	struct incise_tracker_info poses = {
		.name = "own", .rate_hz = 1000, .stations = 1};
	struct incise_scene *scene;
	struct incise_plan *plan = NULL;
	struct incise_error err = {0};
	int rc = -1;

	if (argc != 2) {
		fprintf(stderr, "usage: %s SCENE\n", argv[0]);
		return 2;
	}
	scene = incise_scene_load(argv[1], NULL, &err);
	if (scene) {
		poses.rate_hz = incise_scene_rate_hz(scene);
		plan = incise_plan_new_fed(scene, &poses, &err);
	}
	if (plan)
		rc = run(plan, poses.rate_hz);
	else
		fprintf(stderr, "%s: %s\n", argv[0], err.text);
	incise_plan_free(plan); /* before its scene */
	incise_scene_free(scene);
	return rc ? 1 : 0;
}
