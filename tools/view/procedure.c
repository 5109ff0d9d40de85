// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Paper 2's procedure; see procedure.h.
 */
#include <math.h>
#include <stdlib.h>
#include <incise/loop.h>
#include <incise/sim.h>
#include "../cli/cli.h"
#include "procedure.h"

/* Position of the leading end, from the top, and attitude of the scalpel. */
struct key {
	double t_s, end_mm[3];
	double round; /* 1: turned over, handle down */
	double twist; /* about its axis, rad */
	enum incise_tool tool;
};

#define BLADE INCISE_TOOL_BLADE
#define HANDLE INCISE_TOOL_HANDLE
#define TUBE INCISE_TOOL_TUBE
/* Depth of the tube's end where its flange meets the skin over the cartilages. */
#define SEATED_MM 17.5
#define TURNED M_PI_2 /* the edge lies across the neck */

/*
 * The neck lies along x, with the cricothyroid membrane below the top. Its incisions are those of
 * an open cricothyroidotomy: vertical through the skin in the midline, 30 mm (LearnEM,
 * "Cricothyrotomy", has 3 cm; WikEM, "Surgical airway", 3.5 cm), then horizontal through the
 * membrane, 15 mm, which a handle of 10 mm fits into.
 */
#define SKIN_MM 15.0 /* half of the vertical incision */
#define MEMBRANE_MM \
	6.2 /* half of the horizontal one, 9 mm below the skin of a round neck */

static const struct key keys[] = {
	{0.0, {-SKIN_MM, 0, 25}, 0, 0, BLADE},
	{0.6, {-SKIN_MM, 0, 3}, 0, 0, BLADE},
	{1.0, {-SKIN_MM, 0, -4}, 0, 0, BLADE},
	{2.6, {SKIN_MM, 0, -4}, 0, 0, BLADE},
	{2.9, {SKIN_MM + 1, 0, 4}, 0, 0, BLADE},
	{3.6, {0, -MEMBRANE_MM, 6}, 0, TURNED, BLADE},
	{4.1, {0, -MEMBRANE_MM, -9.4}, 0, TURNED, BLADE},
	{5.2, {0, MEMBRANE_MM, -9.4}, 0, TURNED, BLADE},
	{5.5, {0, MEMBRANE_MM + 1, 5}, 0, TURNED, BLADE},
	{6.2, {45, -10, 40}, 0, 0, BLADE},
	{9.0, {45, -10, 40}, 0, 0, BLADE},
	/* Turned over high above, where it touches nothing. */
	{9.8, {30, 0, 60}, 1, TURNED, HANDLE},
	{10.6, {0, 0, 6}, 1, TURNED, HANDLE},
	{11.2, {0, 0, -9}, 1, TURNED, HANDLE},
	/* In the horizontal incision; turned, it spreads it. */
	{12.0, {0, 0, -10}, 1, 0, HANDLE},
	{12.6, {0, 1.5, -10}, 1, 0.2, HANDLE},
	{13.2, {0, -1.5, -10}, 1, -0.2, HANDLE},
	{13.8, {0, 0, -8}, 1, 0, HANDLE},
	{14.2, {0, 0, 12}, 1, 0, HANDLE},
	{15.0, {20, -20, 90}, 1, 0, HANDLE},
	{15.1, {20, -20, 90}, 0, 0, TUBE},
	{16.2, {0, 0, 8}, 0, 0, TUBE},
	/* Down to its flange. */
	{18.0, {0, 0, -SEATED_MM}, 0, 0, TUBE},
	{PROCEDURE_S, {0, 0, -SEATED_MM}, 0, 0, TUBE},
};
#define KEYS (int)(sizeof(keys) / sizeof(*keys))

static const struct key *key_before(double t_s)
{
	int k = 0;

	while (k + 2 < KEYS && keys[k + 1].t_s <= t_s)
		k++;
	return &keys[k];
}

/* The blade's edge is along x: turned by @round about x, then by @twist about z. */
static void turn(double round, double twist, double q[4], double axis[3])
{
	double a = round * M_PI / 2, b = twist / 2;

	q[0] = cos(b) * cos(a);
	q[1] = cos(b) * sin(a);
	q[2] = sin(b) * sin(a);
	q[3] = sin(b) * cos(a);
	/* The scalpel's z, turned. */
	axis[0] = 2 * (q[1] * q[3] + q[0] * q[2]);
	axis[1] = 2 * (q[2] * q[3] - q[0] * q[1]);
	axis[2] = 1 - 2 * (q[1] * q[1] + q[2] * q[2]);
}

static void place(const struct incise_touch *top, double handle_mm, double t_s,
		  struct procedure_pose *pose)
{
	const struct key *a = key_before(t_s), *b = a + 1;
	double share = fmax(0, fmin(1, (t_s - a->t_s) / (b->t_s - a->t_s)));
	/* From rest to rest; the cut itself has constant speed. */
	double s = a->end_mm[2] < 0 && b->end_mm[2] < 0 ? share
							: (1 - cos(M_PI * share)) / 2;
	double round = a->round + s * (b->round - a->round), axis[3];

	pose->tool = share < 1 ? a->tool : b->tool;
	turn(round, a->twist + s * (b->twist - a->twist), pose->quaternion, axis);
	for (int i = 0; i < 3; i++)
		pose->position_mm[i] = top->point_mm[i] + a->end_mm[i] +
				       s * (b->end_mm[i] - a->end_mm[i]) -
				       round * handle_mm * axis[i];
}

void procedure_at(const struct incise_touch *top, double handle_mm, double t_s,
		  struct procedure_pose *pose)
{
	const double step_s = 1e-3;
	struct procedure_pose later;

	place(top, handle_mm, t_s, pose);
	place(top, handle_mm, t_s + step_s, &later);
	for (int i = 0; i < 3; i++)
		pose->velocity_mm_s[i] =
			(later.position_mm[i] - pose->position_mm[i]) / step_s;
}

struct run {
	struct incise_scene *scene;
	struct incise_rig *rig;
	struct incise_plan *plan;
	struct incise_touch top;
	int64_t first_ns;
};

static void move(struct run *run, double t_s)
{
	struct procedure_pose pose;

	procedure_at(&run->top, incise_scene_handle_mm(run->scene), t_s, &pose);
	incise_sim_hold(incise_rig_sim(run->rig), pose.position_mm, pose.velocity_mm_s,
			pose.quaternion);
	incise_plan_set_tool(run->plan, pose.tool == INCISE_TOOL_TUBE ? INCISE_TOOL_TUBE
								      : INCISE_TOOL_AUTO);
}

static int ticked(void *context, const struct incise_tick *tick)
{
	struct run *run = context;

	if (!run->first_ns)
		run->first_ns = tick->t_ns;
	move(run, (double)(tick->t_ns - run->first_ns) / INCISE_NS_PER_S);
	return 0;
}

static void open_run(struct run *run, const char *path)
{
	struct incise_error err = {0};

	*run = (struct run){.scene = incise_scene_load(path, NULL, &err)};
	if (run->scene)
		run->rig = incise_rig_open("sim:mouse,clock=simulated",
					   INCISE_RIG_TRACKER, &err);
	if (run->rig)
		run->plan = incise_plan_new(run->scene, run->rig, &err);
	if (!run->plan)
		cli_fail_with(&err);
	incise_plan_top(run->plan, &run->top);
	move(run, 0);
}

void view_script_begin(struct view_script *script, const char *scene, double seconds)
{
	struct incise_loop_stats *stats = malloc(sizeof(*stats));
	struct incise_loop_options loop = {.ticked = ticked};
	struct incise_error err = {0};
	struct run run;

	open_run(&run, scene);
	loop.context = &run;
	loop.rate_hz = incise_scene_rate_hz(run.scene);
	loop.duration_ns = (int64_t)(seconds * INCISE_NS_PER_S);
	loop.log_size = (size_t)(seconds * loop.rate_hz) + 2;
	loop.log = calloc(loop.log_size, sizeof(*loop.log));
	if (!stats || !loop.log)
		cli_fail("no memory for %.3g s of ticks", seconds);
	if (incise_loop_run(run.plan, incise_rig_clock(run.rig), &loop, stats, &err) < 0)
		cli_fail_with(&err);
	*script = (struct view_script){
		.scene = scene, .tick = loop.log, .n = (int)stats->logged};
	free(stats);
	incise_plan_free(run.plan);
	incise_rig_close(run.rig);
	incise_scene_free(run.scene);
}

void view_script_end(struct view_script *script)
{
	free(script->tick);
	*script = (struct view_script){0};
}

void fed_view_open(struct fed_view *fed, const struct view_script *script, int texture_px,
		   int width, int height)
{
	const struct incise_view_setup setup = {.width = width, .height = height};
	struct incise_error err = {0};

	*fed = (struct fed_view){.script = script,
				 .scene = incise_scene_load(script->scene, NULL, &err)};
	if (fed->scene && texture_px)
		incise_scene_set_texture(fed->scene, texture_px);
	if (fed->scene)
		fed->plan = incise_plan_new(fed->scene, NULL, &err);
	if (fed->plan)
		fed->view = incise_view_new(fed->scene, fed->plan, &setup, &err);
	if (!fed->view)
		cli_fail_with(&err);
}

void fed_view_until(struct fed_view *fed, double t_s)
{
	const struct view_script *script = fed->script;
	int64_t until_ns = script->tick[0].t_ns + (int64_t)(t_s * INCISE_NS_PER_S);
	int n = fed->fed;

	while (n < script->n && script->tick[n].t_ns <= until_ns)
		n++;
	incise_view_ticks(fed->view, script->tick + fed->fed, n - fed->fed);
	fed->fed = n;
}

void fed_view_frame(struct fed_view *fed)
{
	struct incise_error err = {0};

	if (incise_view_frame(fed->view, NULL, &err))
		cli_fail_with(&err);
}

void fed_view_close(struct fed_view *fed)
{
	incise_view_free(fed->view);
	incise_plan_free(fed->plan);
	incise_scene_free(fed->scene);
}
