/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A sheet of 2 mm waves as an OBJ file, or a grid of heights, in memory, which is read as a user's would be.
 *
 *        _       _       _
 *      _/ \_   _/ \_   _/ \_    2 mm high, 8 mm long, along x and along y
 *            \_/     \_/          100 mm × 100 mm
 */
#ifndef INCISE_SHEET_H
#define INCISE_SHEET_H

#include <stdbool.h>
#include "../cli/file.h"

/* With so many cells of two triangles along each side. */
struct memory_file sheet_of_waves(int cells, bool grid);

#endif
