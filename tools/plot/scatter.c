// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Points of a scatter plot, as many as there are places for them; see figure.h.
 */
#include <math.h>
#include <stdlib.h>
#include "../cli/cli.h"
#include "figure.h"

/* Half a point's width apart in a plot of half the figure's width. */
#define COLUMNS 300
#define ROWS 200

void scatter_begin(struct scatter *scatter, const double low[2], const double high[2])
{
	*scatter = (struct scatter){.taken = cli_alloc(COLUMNS * ROWS / 8, 1)};
	for (int i = 0; i < 2; i++) {
		scatter->low[i] = low[i];
		scatter->high[i] = high[i];
	}
}

/* The place of a value along an axis of n places. */
static int find_scatter_place(double value, double low, double high, int n)
{
	double share = (value - low) / (high - low);

	/* Also where the axis has no length. */
	return share > 0 ? (int)fmin(share * n, n - 1) : 0;
}

bool scatter_takes(struct scatter *scatter, double x, double y)
{
	int at = find_scatter_place(x, scatter->low[0], scatter->high[0], COLUMNS) +
		 COLUMNS * find_scatter_place(y, scatter->low[1], scatter->high[1], ROWS);
	uint8_t *byte = &scatter->taken[at / 8], bit = (uint8_t)(1 << at % 8);

	if (*byte & bit)
		return false;
	*byte |= bit;
	return true;
}

void scatter_end(struct scatter *scatter)
{
	free(scatter->taken);
}
