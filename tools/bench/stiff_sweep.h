/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Walls of 10 N/m to 1 GN/m: whether a scene with one is accepted, and what a device makes
 * of it all the same, with the guard of passivity off and on, behind the limit of force.
 *
 *   pressed by a weight ──▶ ○ device ──▶ │ wall ──▶ [guard] ──▶ limit ──▶ device
 *
 * By two ways: a whole plan, fed by a tracker of 120 Hz that is 4.2 ms late; and the wall
 * alone, whose position is that of the tick, as by an encoder.
 */
#ifndef INCISE_STIFF_SWEEP_H
#define INCISE_STIFF_SWEEP_H

#include <stdbool.h>
#include <jansson.h>

#define STIFF_ROWS_MAX 120

enum stiff_path { STIFF_PLAN, STIFF_WALL, STIFF_PATHS };

struct stiff_row {
	enum stiff_path path;
	bool guard;
	double K_N_mm;
	double limit_N_mm; /* by theory */
	bool accepted;	   /* as it is; else it was forced */
	double largest_N, largest_mm;
	double late_mm; /* from one end to the other, in the last quarter */
	long not_finite;
	bool bounded;
	char failed[160]; /* why it was not run, or what is not as it shall be */
	bool missed;	  /* the latter */
};

struct stiff_sweep {
	struct stiff_row row[STIFF_ROWS_MAX];
	int n;
};

void stiff_sweep(struct stiff_sweep *sweep, bool quick);

/* How many are not as theory says: what is accepted is still, what is not is bounded. */
int stiff_sweep_missed(const struct stiff_sweep *sweep);

void stiff_sweep_print(const struct stiff_sweep *sweep);
json_t *stiff_sweep_json(const struct stiff_sweep *sweep);
void stiff_sweep_figures(const struct stiff_sweep *sweep, json_t *figures);
void stiff_sweep_draw(const struct stiff_sweep *sweep, const char *folder,
		      const char *name);

#endif
