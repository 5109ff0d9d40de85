// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A sheet of waves; see sheet.h.
 */
#include <math.h>
#include <stdio.h>
#include "sheet.h"

#define SHEET_MM 100.0
#define WAVE_MM 8.0
#define HEIGHT_MM 2.0

static double height_mm(int k, int cells)
{
	return HEIGHT_MM / 4 *
	       cos(2 * M_PI * SHEET_MM / WAVE_MM * ((double)k / cells - 0.5));
}

struct memory_file sheet_of_waves(int cells, bool grid)
{
	struct memory_file file = memory_file_begin("sheet");
	double cell_mm = SHEET_MM / cells;
	int side = cells + 1;

	if (grid)
		fprintf(file.file,
			"ncols %d\nnrows %d\nxllcenter %g\nyllcenter %g\ncellsize %.9g\n",
			side, side, -SHEET_MM / 2, -SHEET_MM / 2, cell_mm);
	for (int k = 0; k < side * side; k++) {
		double z = height_mm(k % side, cells) + height_mm(k / side, cells);

		/* It is the same from north to south. */
		if (grid)
			fprintf(file.file, "%.6f\n", z);
		else
			fprintf(file.file, "v %.6f %.6f %.6f\n",
				k % side * cell_mm - SHEET_MM / 2,
				k / side * cell_mm - SHEET_MM / 2, z);
	}
	for (int k = 0; k < cells * cells && !grid; k++) {
		int a = k / cells * side + k % cells + 1;

		fprintf(file.file, "f %d %d %d\nf %d %d %d\n", a, a + 1, a + side + 1, a,
			a + side + 1, a + side);
	}
	memory_file_written(&file);
	return file;
}
