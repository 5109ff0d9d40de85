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

struct memory_file sheet_of_waves(int cells)
{
	struct memory_file file = memory_file_begin("sheet");
	int side = cells + 1;

	for (int k = 0; k < side * side; k++) {
		double x = SHEET_MM * ((double)(k % side) / cells - 0.5);
		double y = SHEET_MM * ((double)(k / side) / cells - 0.5);
		double z = HEIGHT_MM / 4 *
			   (cos(2 * M_PI * x / WAVE_MM) + cos(2 * M_PI * y / WAVE_MM));

		fprintf(file.file, "v %.6f %.6f %.6f\n", x, y, z);
	}
	for (int k = 0; k < cells * cells; k++) {
		int a = k / cells * side + k % cells + 1;

		fprintf(file.file, "f %d %d %d\nf %d %d %d\n", a, a + 1, a + side + 1, a,
			a + side + 1, a + side);
	}
	memory_file_written(&file);
	return file;
}
