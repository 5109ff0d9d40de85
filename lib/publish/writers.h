/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside an export; for lib/publish/ only.
 */
#ifndef INCISE_EXPORT_PRIVATE_H
#define INCISE_EXPORT_PRIVATE_H

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <incise/budget.h>
#include <incise/recording.h>
#include <incise/wall.h>
#include "provenance.h"
#include "table_writer.h"

/* An export of some recordings. */
struct incise_export_pass {
	struct incise_recording *const *recordings;
	int n;
	const struct incise_export_options *options;
	struct incise_table *table;
	struct incise_export_report report;
	struct incise_error *err;

	int recording;		       /* the present one, from 0 */
	char *name;		       /* of it, unique */
	uint64_t samples, samples_all; /* of force, read and to be read */
	struct incise_wall *wall;      /* of the present recording; NULL: without TAI */
	bool camera;		       /* resampled rows have the columns of the camera */
	struct incise_budget **budgets; /* of each recording, or NULL */
	void *state;			/* of the kind of rows */
	int64_t first_ns; /* of messages: of the first sample, if a part is asked for */
};

/* --- columns.c ---------------------------------------------------------------------- */

/* A column of a list, whose value is in a row of this type. */
#define INCISE_COLUMN(type, member, kind, decimals, /* name, unit, about */...)      \
	{                                                                            \
		__VA_ARGS__, INCISE_COLUMN_##kind, decimals, offsetof(type, member), \
			NULL, NULL, NULL                                             \
	}

/* The column by which incise train takes the part of a cut that a model describes. */
#define INCISE_ADVANCING_COLUMN "advancing", "1", "1: the blade went into new tissue"

#define INCISE_BUDGET_COLUMNS (INCISE_BUDGET_QUANTITIES + INCISE_BUDGET_PARTS)

/* Values of a row that the options ask for. */
struct incise_row_extra {
	double u[INCISE_BUDGET_COLUMNS]; /* uncertainties: totals, then parts */
	int64_t tai_ns;
	double tai_u_ns;
};

/*
 * A copy of @n columns, to be freed, with those of uncertainties of the values among them, which replace columns
 * of their names, and with those of TAI, by the options. @at: of struct incise_row_extra in a row. NULL: no memory.
 */
struct incise_table_column *incise_extra_columns(
	const struct incise_table_column *columns, int *n, size_t at,
	const struct incise_export_options *options);

/* The uncertainties of a row with these parts. */
void incise_extra_budget(struct incise_row_extra *extra,
			 const double part[INCISE_BUDGET_PARTS]);

/*
 * TAI at a time of CLOCK_MONOTONIC, to which the mapping must reach; nothing without one. Returns 0 or
 * -ENODATA.
 */
int incise_extra_tai(struct incise_row_extra *extra, const struct incise_wall *wall,
		     int64_t t_ns, struct incise_error *err);

/* The words of correlation of a part: of whom else it is the error. */
extern const char *const incise_budget_correlations[];

/* --- budget.c ---------------------------------------------------------------------- */

/* As incise_budget_new(), or without reading rows: then only what calibrations state is known. */
struct incise_budget *incise_budget_open(struct incise_recording *recording,
					 const struct incise_export_options *options,
					 bool rows, struct incise_error *err);

/*
 * The parts of a mean over rows, in order of time; starts with {0}. Common parts and smoothing
 * are means, with their signs; own ones get smaller:
 *
 *     force     samples that are independent of each other
 *     depth     each record of the tracker by the weight that it has in the mean
 *     velocity  the same, of the records of its filter: as one
 */
struct incise_budget_mean {
	uint64_t n;
	int recording;		 /* of the present rows */
	int64_t record_ns[2];	 /* of the tracker, around the present row … */
	double depth[2], depth2; /* … their weights, and squares of those before */
	int64_t window;		 /* of the velocity's filter */
	double force2;		 /* squares of the noise of the force */
	double velocity, velocity2;
	double sum[INCISE_BUDGET_PARTS];   /* of own parts squares */
	double past2[INCISE_BUDGET_PARTS]; /* of recordings before */
};

/* Add a row of a recording, between the records of the tracker at these times. */
void incise_budget_mean_add(struct incise_budget_mean *mean,
			    const struct incise_budget *budget, int recording,
			    const int64_t record_ns[2],
			    const struct incise_budget_row *row);
void incise_budget_mean_parts(const struct incise_budget_mean *mean,
			      double part[INCISE_BUDGET_PARTS]);

/* --- formats.c --------------------------------------------------------------------- */

/* Returns 0 or -EINVAL. */
int incise_export_check(const struct incise_export_options *options,
			struct incise_error *err);

/* --- pass.c ------------------------------------------------------------------------ */

/* Go through the recordings, in order, with the name of each and its wall time. Returns 0 or -errno. */
int incise_export_each(struct incise_export_pass *pass,
		       int (*visit)(struct incise_export_pass *pass,
				    struct incise_recording *recording));

/* Report progress, @done of @all. 0, or -EINTR if the callback stops the export. */
int incise_export_progress(const struct incise_export_pass *pass, uint64_t done,
			   uint64_t all);

/*
 * Open the budgets of all recordings, if uncertainties are asked for, and report which are not stated. Returns 0
 * or -errno.
 */
int incise_export_budgets(struct incise_export_pass *pass);

/* Returns -ENODATA if the part that is asked for gave no row, else 0. */
int incise_export_check_part(const struct incise_export_pass *pass);

/* Free what the pass holds, and read the recordings to their ends again. */
void incise_export_close(struct incise_export_pass *pass);

/* --- export.c ---------------------------------------------------------------------- */

/*
 * Write the rows of what incise_export() does in this format; the options were checked. @provenance
 * may be NULL. Returns 0 or -errno.
 */
int incise_export_rows(struct incise_export_pass *pass,
		       const struct incise_table_format *format, FILE *out,
		       const struct incise_provenance *provenance);

/* A kind of rows. */
struct incise_row_kind {
	const struct incise_table_column *columns;
	int n;
	size_t extra; /* where a row has struct incise_row_extra */
	int (*write)(struct incise_export_pass *pass); /* all rows; 0 or -errno */
};

/* --- resample.c -------------------------------------------------------------------- */

/*
 * All of a recording on one grid of time, or at the times of the force samples: force, pose of
 * the blade, depth and speed, depth by the camera, each with its uncertainty and flags. The last
 * columns are of the camera, if any recording has one.
 */
#define INCISE_RESAMPLE_CAMERA_COLUMNS 5

extern const struct incise_row_kind incise_resample;

#endif
