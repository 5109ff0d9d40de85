// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A dataset of recordings; see incise/recording.h.
 *
 *     recordings ──► cuts ──► raw rows, or means over 1/rate            ──► table
 *                        └──► bins of depth × velocity (paper 1, §4.1)  ──► table
 *     recordings ──► rows at the force's times, or on a grid            ──► table
 *     recording  ──► messages                                           ──► MCAP
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "export_mcap.h"
#include "export_pass.h"
#include "../read/recording.h"
#include "resample.h"
#include "table_writer.h"

#define BINS_MAX 1000 /* in one direction; all of them are held in memory */

void incise_export_options_init(struct incise_export_options *options)
{
	*options = (struct incise_export_options){.min_count = 50};
}

static int check_options(const struct incise_export_options *o, struct incise_error *err)
{
	if (!(o->rate_hz >= 0 && o->rate_hz <= 1e9))
		return incise_error_set(err, EINVAL,
					"rate of export %g Hz is not within 0 to 1e9",
					o->rate_hz);
	if (o->depth_bins < 0 || o->depth_bins > BINS_MAX || o->velocity_bins < 0 ||
	    o->velocity_bins > BINS_MAX || !o->depth_bins != !o->velocity_bins)
		return incise_error_set(
			err, EINVAL,
			"%d × %d bins: each number must be within 1 to %d, or both "
			"0",
			o->depth_bins, o->velocity_bins, BINS_MAX);
	if (!(o->depth_max_mm >= 0 && o->depth_max_mm < 1e9) ||
	    !(o->velocity_max_mm_s >= 0 && o->velocity_max_mm_s < 1e12))
		return incise_error_set(
			err, EINVAL,
			"upper ends of the bins, %g mm and %g mm/s, must be "
			"positive, or 0 for the largest in the data",
			o->depth_max_mm, o->velocity_max_mm_s);
	if (o->resample && (o->depth_bins || (o->rate_hz > 0 && o->rate_hz < 1)))
		return incise_error_set(err, EINVAL,
					"resampling takes a rate of 1 Hz or more, and "
					"no averages");
	if (o->min_count < 0)
		return incise_error_set(err, EINVAL, "smallest count %d is negative",
					o->min_count);
	return 0;
}

static int write_cuts(struct incise_export_pass *pass,
		      struct incise_recording *const *recordings, int n)
{
	const struct incise_export_options *o = pass->options;
	int rc;

	pass->report.depth_max_mm = o->depth_max_mm;
	pass->report.velocity_max_mm_s = o->velocity_max_mm_s;
	rc = o->depth_bins ? incise_export_bins(pass, recordings, n)
			   : incise_export_raw(pass, recordings, n);
	if (rc)
		return rc;
	pass->report.cuts = pass->cut;
	if (!pass->cut)
		return incise_error_set(
			pass->err, ENODATA,
			"%s%s: no cut: the blade was never deeper than %.1f mm "
			"(deepest %.2f mm); check `surface` in the rig's "
			"configuration",
			recordings[0]->path, n > 1 ? " and the others" : "",
			INCISE_CUT_START_MM, pass->depth_deepest_mm);
	if (!pass->report.rows)
		return incise_error_set(
			pass->err, ENODATA,
			"%s%s: no bin holds %d samples; take fewer bins or a "
			"smaller least count",
			recordings[0]->path, n > 1 ? " and the others" : "",
			o->min_count);
	return incise_table_finish(pass->table, pass->err);
}

static int write_resampled(struct incise_export_pass *pass,
			   struct incise_recording *const *recordings, int n)
{
	int rc = 0;

	for (int i = 0; i < n && !rc; i++) {
		char *name = incise_export_name(recordings, i);

		rc = name ? incise_resample(recordings[i], name, pass->options,
					    pass->table, &pass->report, pass->samples,
					    pass->samples_all, pass->err)
			  : incise_error_set(pass->err, ENOMEM, "out of memory");
		pass->samples += recordings[i]->meta.force;
		free(name);
	}
	return rc ? rc : incise_table_finish(pass->table, pass->err);
}

/* To a file or, where that is NULL, to a stream. */
static int export_table(struct incise_recording *const *recordings, int n,
			const struct incise_export_options *options,
			const struct incise_table_format *format,
			struct incise_outfile *file, FILE *out,
			const struct incise_lineage *lineage,
			struct incise_export_report *report, struct incise_error *err)
{
	struct incise_export_pass pass = {
		.options = options, .err = err, .depth_deepest_mm = -INFINITY};
	bool bins = options->depth_bins > 0, whole = !bins || options->by_cut;
	struct incise_table table;
	int rc;

	for (int i = 0; i < n; i++)
		pass.samples_all += recordings[i]->meta.force;
	if (options->resample) {
		rc = incise_resample_width(recordings, n, err);
		if (rc > 0)
			rc = incise_table_open(&table, format, file, out,
					       incise_resample_columns, rc, lineage, err);
	} else {
		rc = incise_table_open(
			&table, format, file, out,
			(bins ? incise_export_bin_columns : incise_export_raw_columns) +
				!whole,
			(bins ? INCISE_EXPORT_BIN_COLUMNS : INCISE_EXPORT_RAW_COLUMNS) -
				!whole,
			lineage, err);
	}
	if (!rc) {
		pass.table = &table;
		rc = options->resample ? write_resampled(&pass, recordings, n)
				       : write_cuts(&pass, recordings, n);
		incise_table_close(&table);
	}
	free(pass.name);
	if (!rc && report)
		*report = pass.report;
	return rc;
}

int incise_export_csv(struct incise_recording *const *recordings, int n,
		      const struct incise_export_options *options, FILE *out,
		      struct incise_export_report *report, struct incise_error *err)
{
	struct incise_lineage lineage = {0};
	int rc = check_options(options, err);

	if (rc)
		return rc;
	if (n < 1)
		return incise_error_set(err, EINVAL, "no recording to export");
	if (options->lineage)
		rc = incise_lineage_of(&lineage, recordings, n, options, err);
	if (!rc)
		rc = export_table(recordings, n, options, &incise_table_csv, NULL, out,
				  options->lineage ? &lineage : NULL, report, err);
	incise_lineage_free(&lineage);
	return rc;
}

/* The ending of a path, without regard to case. */
static bool ends_with(const char *path, const char *end)
{
	size_t n = strlen(path), k = strlen(end);

	return n > k && !strcasecmp(path + n - k, end);
}

static int write_mcap(struct incise_recording *const *recordings, int n,
		      const struct incise_export_options *options, FILE *out,
		      const struct incise_lineage *lineage,
		      struct incise_export_report *report, struct incise_error *err)
{
	if (n > 1 || options->rate_hz > 0 || options->depth_bins || options->resample)
		return incise_error_set(
			err, EINVAL,
			"MCAP takes one recording as it is: no rate, no "
			"averages; give -o FILE.csv or FILE.h5 for these");
	return incise_export_mcap(recordings[0], options, out, lineage, report, err);
}

int incise_export(struct incise_recording *const *recordings, int n,
		  const struct incise_export_options *options, const char *path,
		  struct incise_export_report *report, struct incise_error *err)
{
	bool hdf5 = ends_with(path, ".h5") || ends_with(path, ".hdf5");
	const struct incise_table_format *format = &incise_table_csv;
	struct incise_lineage lineage = {0};
	struct incise_outfile *file;
	int rc = check_options(options, err);

	if (rc)
		return rc;
	if (n < 1)
		return incise_error_set(err, EINVAL, "no recording to export");
	if (hdf5 && !(format = incise_table_hdf5(err)))
		return -errno;
	file = incise_outfile_open(path, err);
	if (!file)
		return -errno;
	rc = incise_lineage_of(&lineage, recordings, n, options, err);
	if (!rc && ends_with(path, ".mcap"))
		rc = write_mcap(recordings, n, options, incise_outfile_stream(file),
				&lineage, report, err);
	else if (!rc)
		rc = export_table(recordings, n, options, format, file, NULL,
				  hdf5 || options->lineage ? &lineage : NULL, report,
				  err);
	incise_lineage_free(&lineage);
	if (!rc)
		return incise_outfile_commit(file, err);
	incise_outfile_abort(file);
	errno = -rc;
	return rc;
}
