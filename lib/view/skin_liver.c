// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The surface of a liver: dark reddish brown, in lobules of 1 to 2 mm with paler borders, under a
 * smooth wet capsule.
 */
#include "skin_look.h"

enum {
	TONE_WIDE,
	TONE_MIDDLE,
	TONE_FINE,
	TONE_FLECK,
	RED_WIDE,
	RED_MIDDLE,
	GRAIN,
	GRAIN_FINE,
	WARP_X,
	WARP_Y,
	WARP_WIDE_X,
	WARP_WIDE_Y,
	PALE,
	BUMP,
	BUMP_MIDDLE,
	BUMP_WIDE,
	N_NOISES,
};

enum { LOBULE, SINUS, N_CELLS };

enum { TONE, RED, SPECK, UX, UY, NEAR, FAR, SINUS_NEAR, SINUS_FAR, PALENESS };

static const float base[3] = {94, 41, 33};

static void mix_skin_liver(const struct skin_work *work, int y, float *const colour[3],
			   float *height_mm)
{
	const float fade = cells_fade(work->cells[LOBULE]);
	const float *tone = SKIN_SUM(work, y, TONE, TONE_WIDE, 0.5F, 0.4F, 0.3F, 0.3F);
	const float *red = SKIN_SUM(work, y, RED, RED_WIDE, 0.6F, 0.5F);
	const float *speck = SKIN_SUM(work, y, SPECK, GRAIN, 0.6F, 0.5F);
	const float *pale = SKIN_SUM(work, y, PALENESS, PALE, 0.3F);
	float *const *row = work->row;

	SKIN_SUM(work, y, UX, WARP_X, 0.16F);
	SKIN_SUM(work, y, UY, WARP_Y, 0.16F);
	noise_row(work->noise[WARP_WIDE_X], y, 0.4F, row[UX]);
	noise_row(work->noise[WARP_WIDE_Y], y, 0.4F, row[UY]);
	cells_row(work->cells[LOBULE], y, row[UX], row[UY], row[NEAR], row[FAR]);
	cells_row(work->cells[SINUS], y, row[UX], row[UY], row[SINUS_NEAR],
		  row[SINUS_FAR]);
	skin_clear(height_mm, work->size, 0);
	noise_row(work->noise[BUMP], y, 0.009F, height_mm);
	noise_row(work->noise[BUMP_MIDDLE], y, 0.03F, height_mm);
	noise_row(work->noise[BUMP_WIDE], y, 0.08F, height_mm);
	for (int x = 0; x < work->size; x++) {
		float border = fade * skin_bump(row[FAR][x] / 0.36F);
		float middle = fade * skin_bump(row[NEAR][x] / 0.45F);
		float sinus = skin_bump(row[SINUS_FAR][x] / 0.35F);
		float light = 1 + 0.055F * tone[x] + 0.04F * speck[x] - 0.05F * middle;
		float fibre = border * skin_clamp(0.4F + pale[x], 0.1F, 1);

		colour[0][x] = light * (base[0] + 3 * red[x] + 6 * fibre - 3.5F * sinus);
		colour[1][x] =
			light * (base[1] - 0.8F * red[x] + 5.5F * fibre - 2.5F * sinus);
		colour[2][x] = light * (base[2] + 4 * fibre - 2 * sinus);
		height_mm[x] -= 0.001F * border;
	}
}

const struct skin_look skin_liver = {
	.n_noises = N_NOISES,
	.n_cells = N_CELLS,
	.noise =
		{
			[TONE_WIDE] = {37, 41},
			[TONE_MIDDLE] = {14, 13},
			[TONE_FINE] = {5.3, 4.9},
			[TONE_FLECK] = {2.1, 1.9},
			[RED_WIDE] = {23, 27},
			[RED_MIDDLE] = {7.9, 8.3},
			[GRAIN] = {0.37, 0.41},
			[GRAIN_FINE] = {0.19, 0.17},
			[WARP_X] = {1.7, 1.9},
			[WARP_Y] = {1.8, 1.6},
			[WARP_WIDE_X] = {6.7, 7.3},
			[WARP_WIDE_Y] = {7.1, 6.3},
			[PALE] = {9, 8},
			[BUMP] = {1.3, 1.2},
			[BUMP_MIDDLE] = {4.3, 3.9},
			[BUMP_WIDE] = {13, 12},
		},
	.cells = {[LOBULE] = {1.4, 1.3}, [SINUS] = {0.31, 0.33}},
	.mix = mix_skin_liver,
};
