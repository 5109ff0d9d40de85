// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The skin of a neck. Its colour is bare tissue minus the absorption of melanin and blood, each with
 * its own blotches, and of two veins below. Its surface is the net of fine furrows of human skin,
 * well below 1 mm wide and elongated around the neck, with pores, wrinkles and a few creases.
 *
 *   x along the neck ──►     creases and wrinkles run in y, veins in x
 */
#include <math.h>
#include "skin_look.h"

enum {
	MELANIN_WIDE,
	MELANIN_MIDDLE,
	MELANIN_FINE,
	BLOOD_WIDE,
	BLOOD_MIDDLE,
	BLOOD_FINE,
	BLOOD_FLECK,
	GRAIN,
	GRAIN_FINE,
	WARP_X,
	WARP_Y,
	WARP_FINE_X,
	WARP_FINE_Y,
	WRINKLE,
	WRINKLE_SHARE,
	CREASE_WAY,
	CREASE_WAY_FINE,
	CREASE_SHARE,
	RELIEF_SHARE,
	VEIN_WAY,
	VEIN_SHARE,
	VEIN_NET,
	BUMP,
	BUMP_WIDE,
	N_NOISES,
};

enum { FURROW, FURROW_FINE, PORE, MOLE, N_CELLS };

/* Rows of the work. */
enum {
	MELANIN,
	BLOOD,
	SPECK,
	UX,
	UY,
	VX,
	VY,
	NEAR,
	FAR,
	EDGE,
	FINE_EDGE,
	HOLE,
	FOLD,
	SPOT,
	VEIN,
	TEMP
};

/* Bare tissue; absorption of melanin, of blood and of veins per channel. */
static const float base[3] = {221, 178, 154};
static const float of_melanin[3] = {11, 14, 15}, of_blood[3] = {3, 13, 11};
static const float of_vein[3] = {11, 4, -1};

/* Distance of creases, and half-width. */
#define CREASE_APART_MM 37.0F
#define CREASE_WIDE_MM 1.3F

/* The anterior jugular veins: distance from the midline, and half-width. */
#define VEIN_ASIDE_MM 17.0F
#define VEIN_WIDE_MM 2.6F

static void pigments(const struct skin_work *work, int y)
{
	float *melanin = SKIN_SUM(work, y, MELANIN, MELANIN_WIDE, 0.30F, 0.24F, 0.16F);
	float *blood = SKIN_SUM(work, y, BLOOD, BLOOD_WIDE, 0.26F, 0.22F, 0.2F, 0.16F);

	SKIN_SUM(work, y, SPECK, GRAIN, 0.6F, 0.5F);
	for (int x = 0; x < work->size; x++) {
		melanin[x] += 0.6F;
		blood[x] += 0.6F;
	}
}

/* Moles and freckles: soft brown spots, where there is melanin. */
static void moles(const struct skin_work *work, int y)
{
	const float fade = cells_fade(work->cells[MOLE]);
	const float *melanin = work->row[MELANIN];
	float *spot = work->row[SPOT], *still = work->row[TEMP];

	skin_clear(still, work->size, 0);
	cells_row(work->cells[MOLE], y, still, still, spot, work->row[FAR]);
	for (int x = 0; x < work->size; x++) {
		float wide = skin_clamp(0.14F * (melanin[x] - 0.8F), 0, 0.05F);

		spot[x] = spot[x] < wide ? fade * skin_bump(spot[x] / wide) : 0;
	}
}

/* The net of furrows: 0 in them, 1 between. */
static void furrows(const struct skin_work *work, int y)
{
	const float fade = cells_fade(work->cells[FURROW]);
	const float fine_fade = cells_fade(work->cells[FURROW_FINE]);
	float *edge = work->row[EDGE], *fine = work->row[FINE_EDGE];
	float *near = work->row[NEAR], *far = work->row[FAR];

	SKIN_SUM(work, y, UX, WARP_X, 0.25F);
	SKIN_SUM(work, y, UY, WARP_Y, 0.25F);
	cells_row(work->cells[FURROW], y, work->row[UX], work->row[UY], near, far);
	for (int x = 0; x < work->size; x++)
		edge[x] = 1 - fade * skin_bump(far[x] / 0.42F);
	SKIN_SUM(work, y, VX, WARP_FINE_X, 0.2F);
	SKIN_SUM(work, y, VY, WARP_FINE_Y, 0.2F);
	cells_row(work->cells[FURROW_FINE], y, work->row[VX], work->row[VY], near, far);
	for (int x = 0; x < work->size; x++)
		fine[x] = 1 - fine_fade * skin_bump(far[x] / 0.55F);
}

static void pores(const struct skin_work *work, int y)
{
	const float fade = cells_fade(work->cells[PORE]);
	float *hole = work->row[HOLE];

	cells_row(work->cells[PORE], y, work->row[UX], work->row[UY], hole,
		  work->row[FAR]);
	for (int x = 0; x < work->size; x++)
		hole[x] = fade * skin_bump(hole[x] / 0.13F);
}

/* Lines thinner than texels fade, or they would be dotted. */
static float line_fade(float wide_mm, double texel_mm)
{
	return skin_clamp(wide_mm / (float)texel_mm - 0.5F, 0, 1);
}

/* Wrinkles and creases around the neck, 0 to about 1. */
static void folds(const struct skin_work *work, int y, float *height_mm)
{
	float *wrinkle = SKIN_SUM(work, y, TEMP, WRINKLE, 1);
	float *share = SKIN_SUM(work, y, NEAR, WRINKLE_SHARE, 0.35F);
	float *fold = work->row[FOLD];
	const float fade = line_fade(CREASE_WIDE_MM, work->x_mm);
	float *way, *part;

	for (int x = 0; x < work->size; x++) {
		float line = skin_bump(wrinkle[x] / 0.3F);

		fold[x] = 0.3F * line * skin_clamp(0.45F + share[x], 0, 1);
		height_mm[x] -= 0.05F * fold[x];
	}
	way = SKIN_SUM(work, y, TEMP, CREASE_WAY, 5.5F, 0.45F);
	part = SKIN_SUM(work, y, NEAR, CREASE_SHARE, 0.45F);
	for (int x = 0; x < work->size; x++) {
		float at = ((float)(x + 0.5F) * (float)work->x_mm + way[x]) /
				   CREASE_APART_MM +
			   0.5F;
		float aside = (at - floorf(at) - 0.5F) * CREASE_APART_MM;
		float crease = fade * skin_bump(aside / CREASE_WIDE_MM) *
			       skin_clamp(0.35F + part[x], 0, 0.9F);

		fold[x] += 0.75F * crease;
		height_mm[x] -= 0.16F * crease;
	}
}

static void veins(const struct skin_work *work, int y)
{
	float side = fabsf((float)((y + 0.5 - work->size / 2) * work->y_mm));
	const float fade = line_fade(VEIN_WIDE_MM, work->y_mm);
	float *vein = work->row[VEIN];
	float *way = SKIN_SUM(work, y, TEMP, VEIN_WAY, 3.5F);
	float *share = SKIN_SUM(work, y, NEAR, VEIN_SHARE, 0.35F);
	float *net = SKIN_SUM(work, y, FAR, VEIN_NET, 1);

	for (int x = 0; x < work->size; x++) {
		float main = skin_bump((side + way[x] - VEIN_ASIDE_MM) / VEIN_WIDE_MM);
		float branch = 0.5F * skin_bump(net[x] / 0.22F);

		vein[x] = fade * skin_clamp(0.55F + share[x], 0, 1) *
			  (main > branch ? main : branch);
	}
}

static void mix_skin_neck(const struct skin_work *work, int y, float *const colour[3],
			  float *height_mm)
{
	float *const *row = work->row;
	const float *share;

	skin_clear(height_mm, work->size, 0);
	noise_row(work->noise[BUMP], y, 0.010F, height_mm);
	noise_row(work->noise[BUMP_WIDE], y, 0.03F, height_mm);
	pigments(work, y);
	furrows(work, y);
	moles(work, y);
	pores(work, y);
	folds(work, y, height_mm);
	veins(work, y);
	/* Coarseness varies from place to place. */
	share = SKIN_SUM(work, y, TEMP, RELIEF_SHARE, 0.3F);
	for (int x = 0; x < work->size; x++) {
		/* A net that is as deep everywhere looks like leather. */
		float coarse = skin_clamp(0.5F + share[x], 0.05F, 1);
		float low = 0.45F * (1 - row[EDGE][x]) + 0.4F * (1 - row[FINE_EDGE][x]);
		float melanin = row[MELANIN][x] + 2.6F * row[SPOT][x];
		float blood = row[BLOOD][x] + 0.10F * coarse * low + 0.3F * row[HOLE][x] +
			      0.7F * row[FOLD][x];
		float dark = 1 - 0.012F * coarse * low - 0.03F * row[HOLE][x] -
			     0.05F * row[FOLD][x] + 0.016F * row[SPECK][x];
		float vein = row[VEIN][x];

		height_mm[x] -= 0.009F * coarse * (1 - row[EDGE][x]) +
				0.008F * coarse * (1 - row[FINE_EDGE][x]) +
				0.016F * row[HOLE][x];
		for (int c = 0; c < 3; c++)
			colour[c][x] = dark * (base[c] - melanin * of_melanin[c] -
					       blood * of_blood[c] - vein * of_vein[c]);
	}
}

const struct skin_look skin_neck = {
	.n_noises = N_NOISES,
	.n_cells = N_CELLS,
	.noise =
		{
			[MELANIN_WIDE] = {46, 41},     [MELANIN_MIDDLE] = {17, 19},
			[MELANIN_FINE] = {6.1, 5.7},   [BLOOD_WIDE] = {29, 33},
			[BLOOD_MIDDLE] = {11, 12},     [BLOOD_FINE] = {4.3, 4.7},
			[BLOOD_FLECK] = {1.7, 1.9},    [GRAIN] = {0.62, 0.71},
			[GRAIN_FINE] = {0.27, 0.31},   [WARP_X] = {3.1, 3.7},
			[WARP_Y] = {3.3, 2.9},	       [WARP_FINE_X] = {1.3, 1.1},
			[WARP_FINE_Y] = {1.2, 1.4},    [WRINKLE] = {3.4, 19},
			[WRINKLE_SHARE] = {13, 11},    [CREASE_WAY] = {64, 31},
			[CREASE_WAY_FINE] = {17, 7.3}, [CREASE_SHARE] = {33, 21},
			[RELIEF_SHARE] = {12, 14},     [VEIN_WAY] = {23, 60},
			[VEIN_SHARE] = {31, 27},       [VEIN_NET] = {43, 21},
			[BUMP] = {1.9, 2.3},	       [BUMP_WIDE] = {5.3, 6.1},
		},
	.cells =
		{
			[FURROW] = {0.62, 0.85},
			[FURROW_FINE] = {0.31, 0.38},
			[PORE] = {1.5, 1.6},
			[MOLE] = {12, 13},
		},
	.mix = mix_skin_neck,
};
