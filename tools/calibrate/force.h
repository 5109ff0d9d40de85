/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Pairs of loads and readings for incise calibrate force: measured with weights on a rig, or
 * as CSV, which --from reads and --keep writes.
 *
 *     mass_g,reading_mV,series,direction
 *     100,1395.2,1,up
 *
 * force_N may replace mass_g; series and direction (up, down) are optional, other columns and
 * lines that begin with '#' are ignored. Every failure ends the program.
 */
#ifndef INCISE_CALIBRATE_FORCE_TOOL_H
#define INCISE_CALIBRATE_FORCE_TOOL_H

#include <incise/calibrate_force.h>
#include <incise/rig.h>

struct pairs {
	struct incise_calibrate_force_pair *pair;
	int n;
};

/* Read a CSV file; an error names the line. */
void pairs_read(struct pairs *pairs, const char *path);
void pairs_write(const struct pairs *pairs, const char *path);

#define WEIGHTS_MAX 100

/*
 * Weights, one after the other: asked for on a terminal, waited for without one, loaded by the
 * program on the virtual rig. Each is read when the reading is steady.
 *
 *     g      ___                ___
 *          _|   |             _|   |_      series up and back to zero; the last one
 *        _|     |_  …       _|       |_    comes down by the same loads
 */
struct weights {
	struct incise_rig *rig; /* with INCISE_RIG_FORCE */
	double mass_g[WEIGHTS_MAX];
	int n;
	int series;
	double mean_s;				    /* of a steady reading */
	double timeout_s;			    /* until it is steady */
	struct incise_calibrate_force_setup *setup; /* dithered is set */
};

/* "0,50g,0.1kg" into @weights, by rising mass, with the empty pan; else bad usage. */
void weights_parse(struct weights *weights, char *list);

/* Ask for them on a terminal. */
void weights_ask(struct weights *weights);

/* Measure all of them; fails at a signal, and if a reading does not become steady. */
void weights_measure(const struct weights *weights, struct pairs *pairs);

#endif
