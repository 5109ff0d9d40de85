// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Paper 2's procedure as a script; see procedure.h.
 */
#include <math.h>
#include <stddef.h>
#include "procedure.h"

/* Where the end that goes first is, from the top, and how the scalpel is turned. */
struct key {
	double t_s, end_mm[3];
	double round; /* 1: turned round, handle down */
	double twist; /* about its axis, rad */
	enum incise_tool tool;
};

#define BLADE INCISE_TOOL_BLADE
#define HANDLE INCISE_TOOL_HANDLE
#define TUBE INCISE_TOOL_TUBE

static const struct key keys[] = {
	{0.0, {-15, 0, 25}, 0, 0, BLADE},
	{0.7, {-15, 0, 3}, 0, 0, BLADE},
	{1.0, {-15, 0, -3}, 0, 0, BLADE},
	{3.0, {15, 0, -3}, 0, 0, BLADE},
	{3.3, {16, 0, 4}, 0, 0, BLADE},
	{4.0, {45, -10, 40}, 0, 0, BLADE},
	{9.0, {45, -10, 40}, 0, 0, BLADE},
	/* Turned round high above, where nothing can be touched. */
	{9.8, {30, 0, 60}, 1, 0, HANDLE},
	{10.6, {0, 0, 6}, 1, 0, HANDLE},
	{11.2, {0, 0, -7}, 1, 0, HANDLE},
	{12.0, {-4, 0, -8}, 1, 0.9, HANDLE},
	{13.2, {4, 0, -8}, 1, -0.9, HANDLE},
	{13.8, {0, 0, -6}, 1, 0, HANDLE},
	{14.2, {0, 0, 12}, 1, 0, HANDLE},
	{15.0, {20, -20, 90}, 1, 0, HANDLE},
	{15.1, {20, -20, 90}, 0, 0, TUBE},
	{16.2, {0, 0, 8}, 0, 0, TUBE},
	{17.5, {0, 0, -12}, 0, 0, TUBE},
	{PROCEDURE_S, {0, 0, -12}, 0, 0, TUBE},
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
	/* What it makes of the scalpel's z. */
	axis[0] = 2 * (q[1] * q[3] + q[0] * q[2]);
	axis[1] = 2 * (q[2] * q[3] - q[0] * q[1]);
	axis[2] = 1 - 2 * (q[1] * q[1] + q[2] * q[2]);
}

static void place(const struct incise_touch *top, double handle_mm, double t_s,
		  struct procedure_pose *pose)
{
	const struct key *a = key_before(t_s), *b = a + 1;
	double share = fmax(0, fmin(1, (t_s - a->t_s) / (b->t_s - a->t_s)));
	/* From rest to rest; the cut itself is even. */
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
