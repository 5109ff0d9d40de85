// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Paper 2's procedure; see procedure.h.
 */
#include <math.h>
#include <incise/clock.h>
#include <incise/sim.h>
#include "procedure.h"

/* Where the hand holds the scalpel, and what it holds. */
struct pose {
	double position_mm[3]; /* of the scalpel's tip */
	double velocity_mm_s[3];
	double quaternion[4];
	enum incise_tool tool;
};

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
/* Half of the horizontal one, at its depth in a round neck: 7.5 mm on the skin. */
#define MEMBRANE_MM 5.7
#define THROUGH_MM 13.4 /* the membrane, 8 mm deep, yields after 5 mm */

static const struct key keys[] = {
	{0.0, {-SKIN_MM, 0, 25}, 0, 0, BLADE},
	{0.6, {-SKIN_MM, 0, 3}, 0, 0, BLADE},
	{1.0, {-SKIN_MM, 0, -4}, 0, 0, BLADE},
	{2.6, {SKIN_MM, 0, -4}, 0, 0, BLADE},
	{2.9, {SKIN_MM + 1, 0, 4}, 0, 0, BLADE},
	/* Stabbed in the midline, and extended to both sides. */
	{3.6, {0, 0, 6}, 0, TURNED, BLADE},
	{4.2, {0, 0, -THROUGH_MM}, 0, TURNED, BLADE},
	{4.5, {0, -MEMBRANE_MM, -THROUGH_MM}, 0, TURNED, BLADE},
	{5.2, {0, MEMBRANE_MM, -THROUGH_MM}, 0, TURNED, BLADE},
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
static void turn_procedure(double round, double twist, double q[4], double axis[3])
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

/* @t_s: below 0 is the start, above PROCEDURE_S the end. */
static void place_procedure_tool(const struct procedure *procedure, double t_s,
				 struct pose *pose)
{
	const struct key *a = key_before(t_s), *b = a + 1;
	double share = fmax(0, fmin(1, (t_s - a->t_s) / (b->t_s - a->t_s)));
	/* From rest to rest; the cut itself has constant speed. */
	double s = a->end_mm[2] < 0 && b->end_mm[2] < 0 ? share
							: (1 - cos(M_PI * share)) / 2;
	double round = a->round + s * (b->round - a->round), axis[3];

	pose->tool = share < 1 ? a->tool : b->tool;
	turn_procedure(round, a->twist + s * (b->twist - a->twist), pose->quaternion,
		       axis);
	for (int i = 0; i < 3; i++)
		pose->position_mm[i] = procedure->top.point_mm[i] + a->end_mm[i] +
				       s * (b->end_mm[i] - a->end_mm[i]) -
				       round * procedure->handle_mm * axis[i];
}

static void move(const struct procedure *procedure, double t_s)
{
	const double step_s = 1e-3;
	struct pose pose, later;

	place_procedure_tool(procedure, t_s, &pose);
	place_procedure_tool(procedure, t_s + step_s, &later);
	for (int i = 0; i < 3; i++)
		pose.velocity_mm_s[i] =
			(later.position_mm[i] - pose.position_mm[i]) / step_s;
	incise_sim_hold(incise_rig_sim(procedure->rig), pose.position_mm,
			pose.velocity_mm_s, pose.quaternion);
	incise_plan_set_tool(procedure->plan, pose.tool == INCISE_TOOL_TUBE
						      ? INCISE_TOOL_TUBE
						      : INCISE_TOOL_AUTO);
}

void procedure_begin(struct procedure *procedure, struct incise_rig *rig,
		     struct incise_plan *plan, const struct incise_scene *scene)
{
	*procedure = (struct procedure){
		.rig = rig, .plan = plan, .handle_mm = incise_scene_handle_mm(scene)};
	incise_plan_top(plan, &procedure->top);
	move(procedure, 0);
}

void procedure_ticked(struct procedure *procedure, const struct incise_tick *tick)
{
	if (!procedure->started)
		procedure->first_ns = tick->t_ns;
	procedure->started = true;
	move(procedure, (double)(tick->t_ns - procedure->first_ns) / INCISE_NS_PER_S);
}
