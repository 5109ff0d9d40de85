// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The hand at a window; see view_hand.h.
 */
#include <math.h>
#include <string.h>
#include "view_hand.h"

#define ABOVE_MM 6.0	 /* over the tissue, when it is not pressed */
#define SINK_MM_S 40.0	 /* how fast it goes in and out: a hand's */
#define FOLLOW_S 0.03	 /* behind the pointer */
#define TURN_S 0.4	 /* to turn the scalpel round */
#define STICK_MM_S 40.0	 /* a joystick at its end */
#define DEPTH_MOST_MM 15 /* that is asked for */

void view_hand_begin(struct view_hand *hand, struct incise_sim *sim, double handle_mm,
		     const struct incise_touch *top)
{
	*hand = (struct view_hand){.sim = sim,
				   .handle_mm = handle_mm,
				   .depth_mm = 3,
				   .tool = INCISE_TOOL_BLADE,
				   .height_mm = 25};
	memcpy(hand->point_mm, top->point_mm, sizeof(hand->point_mm));
	memcpy(hand->normal, top->normal, sizeof(hand->normal));
	memcpy(hand->at_mm, top->point_mm, sizeof(hand->at_mm));
}

static bool key(struct view_hand *hand, int key)
{
	switch (key) {
	case 'b':
		hand->tool = INCISE_TOOL_BLADE;
		return true;
	case 'n':
		hand->tool = INCISE_TOOL_HANDLE;
		return true;
	case 't':
		hand->tool = INCISE_TOOL_TUBE;
		return true;
	case '+':
	case '=':
		hand->depth_mm = fmin(hand->depth_mm + 0.5, DEPTH_MOST_MM);
		return true;
	case '-':
		hand->depth_mm = fmax(hand->depth_mm - 0.5, 0.5);
		return true;
	}
	return false;
}

bool view_hand_event(struct view_hand *hand, const struct incise_view_event *event)
{
	bool points = event->type == INCISE_VIEW_MOTION ||
		      (event->type == INCISE_VIEW_BUTTON && event->button == 1);

	if (event->used)
		return false;
	if (event->type == INCISE_VIEW_KEY)
		return event->pressed && key(hand, event->key);
	if (event->type == INCISE_VIEW_AXIS && event->axis >= 0 && event->axis < 2) {
		hand->stick[event->axis] = fabs(event->value) > 0.1 ? event->value : 0;
		return true;
	}
	if (event->type == INCISE_VIEW_STICK_BUTTON && event->button == 0) {
		hand->press = event->pressed;
		return true;
	}
	if (!points)
		return false;
	hand->press = event->buttons & 1 ? event->pressure : 0;
	if (event->ray.met) {
		memcpy(hand->point_mm, event->ray.point_mm, sizeof(hand->point_mm));
		memcpy(hand->normal, event->ray.normal, sizeof(hand->normal));
	}
	return true;
}

/* A rotation that takes z to the normal, then the scalpel turned round its own x. */
static void attitude(const double n[3], double round, double q[4])
{
	double c = sqrt(fmax(0, (1 + n[2]) / 2)), a = round * M_PI / 2;
	double p[4] = {1, 0, 0, 0};

	if (c > 1e-6) {
		p[0] = c;
		p[1] = -n[1] / (2 * c);
		p[2] = n[0] / (2 * c);
	}
	q[0] = p[0] * cos(a) - p[1] * sin(a);
	q[1] = p[0] * sin(a) + p[1] * cos(a);
	q[2] = p[2] * cos(a) + p[3] * sin(a);
	q[3] = p[3] * cos(a) - p[2] * sin(a);
}

void view_hand_move(struct view_hand *hand, double dt_s)
{
	double wanted_mm = hand->press > 0 ? -hand->press * hand->depth_mm : ABOVE_MM;
	bool turned = hand->tool == INCISE_TOOL_HANDLE;
	double share = 1 - exp(-fmax(dt_s, 0) / FOLLOW_S), most = SINK_MM_S * dt_s;
	double velocity[3], tip[3], q[4], axis[3], before[3];

	if (!(dt_s > 0))
		return;
	/* An end is changed well above the tissue. */
	if (hand->round != turned) {
		wanted_mm = 3 * ABOVE_MM;
		if (hand->height_mm > 2 * ABOVE_MM)
			hand->round += fmax(-dt_s / TURN_S,
					    fmin(dt_s / TURN_S, turned - hand->round));
	}
	memcpy(before, hand->at_mm, sizeof(before));
	hand->height_mm += fmax(-most, fmin(most, wanted_mm - hand->height_mm));
	hand->point_mm[0] += hand->stick[0] * STICK_MM_S * dt_s;
	hand->point_mm[1] -= hand->stick[1] * STICK_MM_S * dt_s;
	attitude(hand->normal, hand->round, q);
	axis[0] = 2 * (q[1] * q[3] + q[0] * q[2]);
	axis[1] = 2 * (q[2] * q[3] - q[0] * q[1]);
	axis[2] = 1 - 2 * (q[1] * q[1] + q[2] * q[2]);
	for (int i = 0; i < 3; i++) {
		double to = hand->point_mm[i] + hand->height_mm * hand->normal[i];

		hand->at_mm[i] += share * (to - hand->at_mm[i]);
		velocity[i] = (hand->at_mm[i] - before[i]) / dt_s;
		tip[i] = hand->at_mm[i] - hand->round * hand->handle_mm * axis[i];
	}
	incise_sim_hold(hand->sim, tip, velocity, q);
}
