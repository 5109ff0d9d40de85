/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The wound in the texture: what the blade left, continuous at any speed and tick rate.
 *
 * A cut is a line through points, each with a depth and a half-width. It grows by the way
 * swept between two ticks in which the blade is in the tissue. A texel looks at its distance
 * to that line, not at stamps along it:
 *
 *        ░░░░░░░░░░░░░░░░░░░░░░░     ░ halo: reddened, fades into the skin
 *      ░░▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒░░     ▒ lips: lighter
 *      ░▒▓▓●━━━━━━●━━━━━━●━━━━▓▒░    ▓ raw, darker with the depth
 *      ░░▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒▒░░
 *
 * Three fields are kept for each texel: how far inside of the lips it is, how deep, how
 * reddened. Each stretch of line raises them to its own values where these are larger, so
 * that a joint, a crossing or the same way twice is the union, and the order does not
 * matter. (Paper 2, §2.1, has a stamp of 5 × 5 blurred such that neighbours match at their
 * edges: here they match because they are one.) Colour is a function of the fields.
 *
 * Handle and tube open the cut where they are inserted: its points move apart up to half the
 * tool's width, less along the cut the farther away; they close again when it leaves, to a
 * little wider than before. What moves, and the last of the line behind the blade, which
 * tapers, is laid over the fields for each painting and not kept in them.
 *
 * Memory: the fields, 6 bytes a texel, taken from the system where there are wounds only;
 * and the newest WOUND_POINTS points. Points are WOUND_SPACING_MM apart, or more. When there
 * are more of them the oldest are forgotten: what they drew stays, but it cannot be opened.
 *
 * Lengths in mm on the surface, times those of the ticks.
 */
#ifndef INCISE_VIEW_WOUND_H
#define INCISE_VIEW_WOUND_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/plan.h>
#include "canvas.h"
#include "uv_map.h"
#include "ground.h"

#define WOUND_POINTS 4096
#define WOUND_SPACING_MM 0.25

/* A point of the line. */
struct wound_point {
	float px[2];
	float depth_mm;
	float half_mm;	/* of the width, at rest and never opened */
	float open_mm;	/* by which that is opened now */
	float wider_mm; /* by which it stays wider */
	float arc_mm;	/* from the cut's beginning */
	bool joined;	/* to the point before it */
	bool settled;	/* its width and depth are final, and in the fields */
	struct ground_metric metric;
};

/* What a tick added to the cut, for who bleeds from it. */
struct wound_stroke {
	double from_px[2], to_px[2];
	double length_mm;
	double fresh_mm; /* of its depth that was not cut before */
	bool begins;	 /* a cut of its own */
};

struct wound;

struct wound *wound_new(const struct uv_map *map, struct incise_error *err);

/* Returns whether a stretch of line was added, and which. */
bool wound_tick(struct wound *wound, const struct incise_tick *tick,
		struct wound_stroke *stroke);

/* 10 ms of the ticks' time: lips open and close. */
void wound_step(struct wound *wound);

/* Where a handle or tube is in the tissue now; false: none is. */
bool wound_inserted(const struct wound *wound, double px[2], double *depth_mm);

/* Bring the layer up to date, and say what changed of it. */
void wound_paint(struct wound *wound, struct incise_canvas *canvas, int layer);

/* How far a place is inside of the lips, mm; below 0 outside. For tests and blood. */
double wound_inside_mm(const struct wound *wound, int x, int y);

double wound_cut_mm(const struct wound *wound);
uint64_t wound_stamps(const struct wound *wound);
int wound_points(const struct wound *wound);
size_t wound_memory(const struct wound *wound);
void wound_free(struct wound *wound);

#endif
