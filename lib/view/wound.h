/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The wound in the texture: cuts of the blade, continuous at any speed and tick rate.
 *
 * A cut is a line through points, each with a depth and a half-width. It grows by the way of the
 * blade between two ticks in the tissue. A texel depends on its distance to that line:
 *
 *        ░░░░░░░░░░░░░░░░░░░░░░░     ░ halo: reddened, fades into the skin
 *      ░░▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒░░     ▒ lips: lighter
 *      ░▒▓▓●━━━━━━●━━━━━━●━━━━▓▒░    ▓ raw, darker with the depth
 *      ░░▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒░░
 *
 * Each texel has three fields: distance inside of the lips, depth, redness. Each stretch of line
 * raises them to its own values where these are larger, so that joints, crossings and repeated
 * cuts are unions in any order. The stretch that is nearest also gives the cut's half-width and
 * the lean of its walls to the lamp. (Bhasin et al. 2005, §2.1,
 * uses a stamp of 5 × 5, blurred so that neighbours
 * match at their edges.) Colour is a function of the fields.
 *
 * Handle and tube open the cut where they are inserted: points move apart by up to half the tool's
 * extent across the cut, less with the distance along it; afterwards they close to the opening that
 * the incision, shared with the forces, says stays. Moving
 * stretches, and the tapering end behind the blade, are drawn over the fields at each painting.
 *
 * Memory: the fields, 8 bytes a texel, only where there are wounds; and the newest WOUND_POINTS
 * points, WOUND_SPACING_MM apart or more. Cuts of older points stay, but no longer open.
 *
 * Lengths in mm on the surface, times of the ticks.
 */
#ifndef INCISE_VIEW_WOUND_H
#define INCISE_VIEW_WOUND_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/incision.h>
#include <incise/plan.h>
#include "canvas.h"
#include "uv_map.h"

#define WOUND_POINTS 4096
#define WOUND_SPACING_MM 0.25

/* The stretch that a tick added to a cut, for its bleeding. */
struct wound_stroke {
	double from_px[2], to_px[2];
	double length_mm;
	double fresh_mm; /* depth that was not cut before */
	bool begins;	 /* a new cut */
};

struct wound;

/*
 * map        must live longer
 * incision   is fed with the ticks, and says how wide cuts stay open; NULL: they close
 */
struct wound *wound_new(const struct uv_map *map,
			const struct incise_scene_scalpel *scalpel,
			struct incise_incision *incision, struct incise_error *err);

/* Returns whether a stretch of line was added, and which. */
bool wound_tick(struct wound *wound, const struct incise_tick *tick,
		struct wound_stroke *stroke);

/* 10 ms of the ticks' time: lips open and close. */
void wound_step(struct wound *wound);

/* The place of a handle or tube in the tissue; false: no such tool there. */
bool wound_inserted(const struct wound *wound, double px[2], double *depth_mm);

/*
 * Update two layers, and mark the changed parts of the canvas: the skin along the cuts, and the
 * flesh between their lips, which belongs above the blood on the skin.
 */
void wound_paint(struct wound *wound, struct incise_canvas *canvas, int skin_layer,
		 int flesh_layer);

/* Distance of a place inside of the lips, mm; below 0 outside. For tests. */
double wound_inside_mm(const struct wound *wound, int x, int y);

double wound_cut_mm(const struct wound *wound);
uint64_t wound_stamps(const struct wound *wound);
int wound_points(const struct wound *wound);
void wound_free(struct wound *wound);

#endif
