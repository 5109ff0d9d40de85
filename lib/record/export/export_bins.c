// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Averages over bins of depth and velocity (paper 1, §4.1); see export_pass.h. Memory is
 * that of the bins.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "export_pass.h"

const struct incise_column incise_export_bin_columns[INCISE_EXPORT_BIN_COLUMNS] = {
	INCISE_EXPORT_CUT,
	{"depth_mm", "mm", "mean depth in the bin", INCISE_COLUMN_REAL, -1},
	{"velocity_mm_s", "mm/s", "mean speed in the bin", INCISE_COLUMN_REAL, -1},
	{"force_N", "N", "mean force in the bin", INCISE_COLUMN_REAL, -1},
	{"sd_N", "N", "standard deviation of single samples", INCISE_COLUMN_REAL, -1},
	{"count", "1", "samples", INCISE_COLUMN_INTEGER, 0},
	{"cuts", "1", "different cuts that they are from", INCISE_COLUMN_INTEGER, 0},
};

/* Bin of a value; the upper end belongs to the last one. -1: above it. */
static int bin_of(double value, double max, int bins)
{
	if (value > max || !(max > 0))
		return -1;
	return value < max ? (int)fmin(value / max * bins, bins - 1) : bins - 1;
}

static int add(struct incise_export_pass *pass, const struct incise_cut_sample *sample,
	       double t_s)
{
	struct incise_export_bin *bins = pass->made;
	const struct incise_export_options *o = pass->options;
	int i, k;

	(void)t_s; /* visitors share one form */
	if (sample->clipped) {
		pass->report.clipped++;
		return 0;
	}
	i = bin_of(sample->depth_mm, pass->report.depth_max_mm, o->depth_bins);
	k = bin_of(sample->velocity_mm_s, pass->report.velocity_max_mm_s,
		   o->velocity_bins);

	if (i >= 0 && k >= 0)
		incise_export_bin_add(&bins[i * o->velocity_bins + k], sample, 0,
				      pass->cut);
	return 0;
}

/* The bins that hold enough go out, and all are emptied. */
static int put_bins(struct incise_export_pass *pass)
{
	struct incise_export_bin *bins = pass->made;
	const struct incise_export_options *o = pass->options;
	size_t n = (size_t)o->depth_bins * o->velocity_bins;
	uint64_t enough = o->min_count > 1 ? o->min_count : 1;
	int rc = 0;

	for (size_t i = 0; i < n; i++) {
		struct incise_export_bin *bin = &bins[i];
		union incise_cell cells[] = {
			{.integer = 0},
			{.real = bin->depth_mm},
			{.real = bin->velocity_mm_s},
			{.real = bin->force_N},
			{.real = bin->n > 1 ? sqrt(bin->m2 / (bin->n - 1)) : 0.0},
			{.integer = (int64_t)bin->n},
			{.integer = bin->cuts},
		};

		if (bin->n >= enough && !rc) {
			if (o->by_cut) {
				rc = incise_export_cut_name(pass);
				cells[0].integer = rc;
			}
			if (rc >= 0)
				rc = incise_table_add(pass->table, cells + !o->by_cut,
						      pass->err);
			pass->report.rows++;
		}
		*bin = (struct incise_export_bin){0};
	}
	return rc;
}

static int find_extent(struct incise_export_pass *pass,
		       const struct incise_cut_sample *sample, double t_s)
{
	(void)t_s;
	incise_export_extent(pass, sample);
	return 0;
}

int incise_export_bins(struct incise_export_pass *pass,
		       struct incise_recording *const *recordings, int n)
{
	const struct incise_export_options *o = pass->options;
	struct incise_export_visitor ends = {find_extent, NULL};
	struct incise_export_visitor rows = {add, o->by_cut ? put_bins : NULL};
	uint64_t all = pass->samples_all;
	int rc = 0;

	pass->made = calloc((size_t)o->depth_bins * o->velocity_bins,
			    sizeof(struct incise_export_bin));
	if (!pass->made)
		return incise_error_set(pass->err, ENOMEM, "%d × %d bins: out of memory",
					o->depth_bins, o->velocity_bins);
	if (!(o->depth_max_mm > 0 && o->velocity_max_mm_s > 0)) {
		pass->samples_all += all; /* each is gone through twice */
		rc = incise_export_each(pass, recordings, n, &ends);
	}
	if (!rc)
		rc = incise_export_each(pass, recordings, n, &rows);
	if (!rc && !o->by_cut)
		rc = put_bins(pass);
	free(pass->made);
	return rc;
}
