/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The hand at a window: mouse, pen or joystick move the scalpel of sim:mouse over the tissue.
 *
 *     pointer ──ray──▶ point of the surface ──▶ tip above it; pressed: that deep below it
 */
#ifndef INCISE_VIEW_HAND_H
#define INCISE_VIEW_HAND_H

#include <incise/sim.h>
#include <incise/view.h>

struct view_hand {
	struct incise_sim *sim;
	double handle_mm;
	double depth_mm; /* when it is pressed */
	enum incise_tool tool;

	/* Where the pointer is on the surface, and how hard it presses, 0 … 1. */
	bool placed;
	double point_mm[3], normal[3], press;
	double stick[2]; /* of a joystick */
	/* Where the tip is now. */
	double height_mm, at_mm[3], round;
};

void view_hand_begin(struct view_hand *hand, struct incise_sim *sim, double handle_mm,
		     const struct incise_touch *top);

/* Whether it was one for the hand. */
bool view_hand_event(struct view_hand *hand, const struct incise_view_event *event);

/* Move on by so much time; once a frame. */
void view_hand_move(struct view_hand *hand, double dt_s);

#endif
