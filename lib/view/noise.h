/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Smooth noise over a texture, made row by row.
 *
 * Random numbers stand on a lattice and cubic B-splines run between: a row of the lattice
 * is blended first, so that a texel costs four products whatever the cell's size. Mean 0,
 * standard deviation about 1, within ±4. The same seed gives the same bits on one type of
 * machine.
 */
#ifndef INCISE_NOISE_H
#define INCISE_NOISE_H

#include <stdint.h>

struct noise;

/*
 * @size of the texture; cells in texels. Cells of less than 3 texels fade, those of less
 * than 1.5 are none, which costs nothing. NULL: no memory.
 */
struct noise *noise_new(uint64_t seed, int size, double cell_x, double cell_y);
void noise_free(struct noise *noise);

/* Add gain × noise to a row; y from 0 to size - 1. The noise keeps a blended row: one user. */
void noise_row(struct noise *noise, int y, float gain, float *row);

/* A number from 0 to 1, less than 1, for a place of a lattice. */
float noise_at(uint64_t seed, int x, int y);

#endif
