/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Pairs of loads and readings as CSV: what --from reads and --keep writes.
 *
 *     mass_g,reading_mV,series,direction
 *     100,1395.2,1,up
 *
 * force_N may stand in place of mass_g; series and direction (up, down) may be left out, and
 * other columns are passed over. Lines that begin with '#' as well.
 */
#ifndef INCISE_CALIBRATE_PAIRS_H
#define INCISE_CALIBRATE_PAIRS_H

#include <incise/calibrate_force.h>

#define CALIBRATE_PAIRS_MAX 10000

struct calibrate_pairs {
	struct incise_calibrate_force_pair *pair;
	int n;
};

/* Add a pair; fails the program where there are too many. */
void calibrate_pairs_add(struct calibrate_pairs *pairs,
			 const struct incise_calibrate_force_pair *pair);

/* Read a file; fails the program with file and line. */
void calibrate_pairs_read(struct calibrate_pairs *pairs, const char *path);

/* Write one; fails the program where that cannot be. */
void calibrate_pairs_write(const struct calibrate_pairs *pairs, const char *path);

#endif
