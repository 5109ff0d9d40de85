/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * incise calibrate force: its data, result and report. The data are pairs of loads and readings,
 * measured with weights on a rig, or as CSV, which --from reads and --keep writes:
 *
 *     mass_g,reading_mV,series,direction
 *     100,1395.2,1,up
 *
 * force_N may replace mass_g; series and direction (up, down) are optional.
 */
#ifndef INCISE_CALIBRATE_FORCE_TOOL_H
#define INCISE_CALIBRATE_FORCE_TOOL_H

#include <incise/calibrate_force.h>
#include <incise/rig.h>
#include "calibrate.h"

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
	double mass_g[WEIGHTS_MAX];
	int n;
	int series;
	double mean_s;	  /* of a steady reading */
	double timeout_s; /* until it is steady */
};

struct force {
	struct calibrate common;
	bool zero, ranged;
	double latitude_deg, altitude_m; /* latitude_deg NAN: not given */
	const char *gravity;		 /* its source, for the report; NULL: not given */
	struct weights weights;
	struct incise_rig *rig;
	struct incise_calibrate_force_setup setup;
	struct incise_calibrate_force_pair *pairs;
	enum incise_calibrate_force_state *states; /* of pairs */
	int n;					   /* pairs */
	struct incise_calibrate_force result;
};

/* "0,50g,0.1kg", by rising mass, with the empty pan; else bad usage. */
void weights_parse(void *weights, char *list);

/* As struct calibrate_kind has them. */
void force_read(void *run, const char *path);
void force_measure(void *run);
void force_write(const void *run, FILE *out);
void force_text(const void *run, FILE *out);
void force_summary(const void *run, FILE *out);
json_t *force_json(const void *run);
void force_draw(const void *run, const char *folder);

#endif
