// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A dataset of recordings; see incise/recording.h.
 *
 *     recordings ──► cuts ──► raw rows, or means over 1/rate            ──► table
 *                        └──► bins of depth × velocity (paper 1, §4.1)  ──► table
 *
 * Memory is that of the bins; recordings are streamed.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "cut.h"
#include "export_mcap.h"
#include "recording.h"
#include "resample.h"
#include "table_writer.h"

#define BINS_MAX 1000 /* in one direction; all of them are held in memory */

/* Force samples of one bin, or of one row of a raw export. */
struct bin {
	uint64_t n;
	double t_s, depth_mm, velocity_mm_s, force_N; /* means */
	double m2; /* sum of squared deviations of the force */
	int cuts;  /* that have samples here */
	int last;  /* the cut counted last */
	bool clipped;
};

struct export
{
	const struct incise_export_options *options;
	struct incise_table *table;
	struct incise_export_report report;
	struct incise_error *err;

	char *name;		       /* of the recording under way, unique */
	uint64_t samples, samples_all; /* of force, gone through and to go through */
	int cut;    /* of all recordings, from 1; that of the bins or row under way */
	int number; /* of the same cut in its recording */
	double depth_deepest_mm; /* of any row, for who finds no cut */

	struct bin *bins; /* depth_bins × velocity_bins, velocity fastest; NULL: raw */
	struct bin row;	  /* raw with a rate */
	int64_t slot;	  /* of the row, 1/rate each */
};

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

/*
 * Names the recording in the cut column: unlike any recording before it, so that
 * a/liver.rec and b/liver.rec stay apart.
 */
static char *cut_name(struct incise_recording *const *recordings, int at)
{
	const char *name = recordings[at]->name;
	int same = 1;
	char *text;

	for (int i = 0; i < at; i++)
		same += !strcmp(recordings[i]->name, name);
	/* '~' stands in no recording's own suffix of this kind. */
	if (same > 1 ? asprintf(&text, "%s~%d", name, same) < 0
		     : asprintf(&text, "%s", name) < 0)
		return NULL;
	for (char *c = text; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '_';
	return text;
}

/* Number of the present cut's name in the table, or -errno. */
static int name_cut(struct export *export)
{
	char *text;
	int rc;

	if (asprintf(&text, "%s-%02d", export->name, export->number) < 0)
		return incise_error_set(export->err, ENOMEM, "out of memory");
	rc = incise_table_name(export->table, text);
	free(text);
	if (rc < 0)
		return incise_error_set(export->err, -rc, "out of memory");
	return rc;
}

/* What the columns are: raw, and averaged, of which the first is left out for all cuts. */
#define CUT                                                                          \
	{                                                                            \
		"cut", "1", "recording and number of the cut", INCISE_COLUMN_NAME, 0 \
	}
static const struct incise_column raw_columns[] = {
	CUT,
	{"t_s", "s", "since the recording's first force sample", INCISE_COLUMN_REAL, 6},
	{"depth_mm", "mm", "of the tip below the surface", INCISE_COLUMN_SINGLE, 4},
	{"velocity_mm_s", "mm/s", "speed of the tip", INCISE_COLUMN_SINGLE, 3},
	{"force_N", "N", "on the blade", INCISE_COLUMN_SINGLE, 5},
	{"clipped", "1", "1: the converter was at an end", INCISE_COLUMN_FLAG, 0},
};
static const struct incise_column bin_columns[] = {
	CUT,
	{"depth_mm", "mm", "mean depth in the bin", INCISE_COLUMN_REAL, -1},
	{"velocity_mm_s", "mm/s", "mean speed in the bin", INCISE_COLUMN_REAL, -1},
	{"force_N", "N", "mean force in the bin", INCISE_COLUMN_REAL, -1},
	{"sd_N", "N", "standard deviation of single samples", INCISE_COLUMN_REAL, -1},
	{"count", "1", "samples", INCISE_COLUMN_INTEGER, 0},
	{"cuts", "1", "different cuts that they are from", INCISE_COLUMN_INTEGER, 0},
};

#define COLUMNS(of) ((int)(sizeof(of) / sizeof(*(of))))

/* Welford's way: one pass, no cancellation. */
static void bin_add(struct bin *bin, const struct incise_cut_sample *sample, double t_s,
		    int cut)
{
	double share = 1.0 / ++bin->n;
	double delta = sample->force_N - bin->force_N;

	bin->t_s += share * (t_s - bin->t_s);
	bin->depth_mm += share * (sample->depth_mm - bin->depth_mm);
	bin->velocity_mm_s += share * (sample->velocity_mm_s - bin->velocity_mm_s);
	bin->force_N += share * delta;
	bin->m2 += delta * (sample->force_N - bin->force_N);
	bin->clipped |= sample->clipped;
	if (bin->last != cut) {
		bin->last = cut;
		bin->cuts++;
	}
}

/* --- raw --------------------------------------------------------------------------- */

static int put_row(struct export *export)
{
	const struct bin *row = &export->row;
	int name, rc;

	if (!row->n)
		return 0;
	name = name_cut(export);
	if (name < 0)
		return name;
	rc = incise_table_add(export->table,
			      (union incise_cell[]){
				      {.integer = name},
				      {.real = row->t_s},
				      {.real = row->depth_mm},
				      {.real = row->velocity_mm_s},
				      {.real = row->force_N},
				      {.integer = row->clipped},
			      },
			      export->err);
	export->report.rows++;
	export->row = (struct bin){0};
	return rc;
}

static int add_raw(struct export *export, const struct incise_cut_sample *sample,
		   double t_s)
{
	double rate = export->options->rate_hz;
	/* Times are whole ns: half of one keeps a sample on the edge in its own slot. */
	int64_t slot =
		rate > 0 ? (int64_t)floor((t_s + 0.5e-9) * rate) : export->slot + 1;
	int rc = slot != export->slot ? put_row(export) : 0;

	export->slot = slot;
	bin_add(&export->row, sample, t_s, export->cut);
	return rc;
}

/* --- averaged ---------------------------------------------------------------------- */

/* Bin of a value; the upper end belongs to the last one. -1: above it. */
static int bin_of(double value, double max, int bins)
{
	if (value > max || !(max > 0))
		return -1;
	return value < max ? (int)fmin(value / max * bins, bins - 1) : bins - 1;
}

static void add_binned(struct export *export, const struct incise_cut_sample *sample)
{
	const struct incise_export_options *o = export->options;
	int i = bin_of(sample->depth_mm, export->report.depth_max_mm, o->depth_bins);
	int k = bin_of(sample->velocity_mm_s, export->report.velocity_max_mm_s,
		       o->velocity_bins);

	if (i >= 0 && k >= 0)
		bin_add(&export->bins[i * o->velocity_bins + k], sample, 0, export->cut);
}

/* The bins that hold enough go out, and all are emptied. */
static int put_bins(struct export *export)
{
	const struct incise_export_options *o = export->options;
	size_t n = (size_t)o->depth_bins * o->velocity_bins;
	uint64_t enough = o->min_count > 1 ? o->min_count : 1;
	int rc = 0;

	for (size_t i = 0; i < n; i++) {
		struct bin *bin = &export->bins[i];
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
				rc = name_cut(export);
				cells[0].integer = rc;
			}
			if (rc >= 0)
				rc = incise_table_add(export->table, cells + !o->by_cut,
						      export->err);
			export->report.rows++;
		}
		*bin = (struct bin){0};
	}
	return rc;
}

/* --- all --------------------------------------------------------------------------- */

/* What was gathered of the cut before goes out before a new one starts. */
static int end_cut(struct export *export)
{
	if (!export->bins)
		return put_row(export);
	return export->options->by_cut ? put_bins(export) : 0;
}

typedef int (*visit)(struct export *export, const struct incise_cut_sample *sample,
		     double t_s);

/* 0, or -EINTR where whoever watches wants it to end. */
static int tell(struct export *export, uint64_t samples)
{
	const struct incise_export_options *o = export->options;

	if (o->progress &&
	    o->progress(o->context, fmin(1, (double)(export->samples + samples) /
						    fmax(1, export->samples_all))))
		return incise_error_set(export->err, EINTR, "interrupted");
	return 0;
}

/* Pass over the cuts of one recording. */
static int each_sample(struct export *export, struct incise_recording *recording,
		       visit visit)
{
	const struct incise_calibration *calibration = export->options->calibration;
	struct incise_cut_sample sample;
	struct incise_cuts cuts;
	int rc;

	rc = incise_cuts_open(&cuts, recording, export->err);
	if (rc)
		return rc;
	if (calibration)
		incise_cuts_calibrate(&cuts, calibration);
	if (isnan(cuts.zero_N)) {
		incise_cuts_close(&cuts);
		return incise_error_set(
			export->err, EINVAL,
			"%s: ended before the zero of the force channel was "
			"known (0.5 s), so no force can be told",
			recording->path);
	}
	export->number = 0;
	while ((rc = incise_cuts_next(&cuts, &sample, export->err)) > 0) {
		if (sample.cut != export->number) {
			rc = export->number ? end_cut(export) : 0;
			if (rc)
				break;
			export->number = sample.cut;
			export->cut++;
		}
		rc = visit(export, &sample, (sample.t_ns - cuts.first_ns) * 1e-9);
		if (!rc && (cuts.force_rows & 0xfff) == 0)
			rc = tell(export, cuts.force_rows);
		if (rc)
			break;
	}
	if (!rc && export->number)
		rc = end_cut(export);
	export->samples += cuts.force_rows;
	export->depth_deepest_mm = fmax(export->depth_deepest_mm, cuts.depth_max_mm);
	incise_cuts_close(&cuts);
	return rc;
}

static int visit_extent(struct export *export, const struct incise_cut_sample *sample,
			double t_s)
{
	const struct incise_export_options *o = export->options;
	struct incise_export_report *report = &export->report;

	(void)t_s; /* visitors share one form */
	if (sample->clipped)
		return 0;
	if (!(o->depth_max_mm > 0))
		report->depth_max_mm = fmax(report->depth_max_mm, sample->depth_mm);
	if (!(o->velocity_max_mm_s > 0))
		report->velocity_max_mm_s =
			fmax(report->velocity_max_mm_s, sample->velocity_mm_s);
	return 0;
}

static int visit_raw(struct export *export, const struct incise_cut_sample *sample,
		     double t_s)
{
	visit_extent(export, sample, t_s);
	export->report.clipped += sample->clipped;
	return add_raw(export, sample, t_s);
}

static int visit_binned(struct export *export, const struct incise_cut_sample *sample,
			double t_s)
{
	(void)t_s;
	if (sample->clipped)
		export->report.clipped++;
	else
		add_binned(export, sample);
	return 0;
}

static int each_recording(struct export *export,
			  struct incise_recording *const *recordings, int n, visit visit)
{
	int rc = 0;

	export->cut = 0;
	export->row = (struct bin){0};
	for (int i = 0; i < n && !rc; i++) {
		free(export->name);
		export->name = cut_name(recordings, i);
		rc = export->name
			     ? each_sample(export, recordings[i], visit)
			     : incise_error_set(export->err, ENOMEM, "out of memory");
	}
	return rc;
}

static int write_table(struct export *export, struct incise_recording *const *recordings,
		       int n)
{
	const struct incise_export_options *o = export->options;
	struct bin *bins = export->bins;
	bool extent = bins && !(o->depth_max_mm > 0 && o->velocity_max_mm_s > 0);
	int rc = 0;

	for (int i = 0; i < n; i++)
		export->samples_all += recordings[i]->meta.force * (1 + extent);
	export->report.depth_max_mm = o->depth_max_mm;
	export->report.velocity_max_mm_s = o->velocity_max_mm_s;
	if (!bins) {
		rc = each_recording(export, recordings, n, visit_raw);
	} else {
		export->bins = NULL; /* the first pass gathers nothing */
		if (extent)
			rc = each_recording(export, recordings, n, visit_extent);
		export->bins = bins;
		if (!rc)
			rc = each_recording(export, recordings, n, visit_binned);
		if (!rc && !o->by_cut)
			rc = put_bins(export);
	}
	if (rc)
		return rc;
	export->report.cuts = export->cut;
	if (!export->cut)
		return incise_error_set(
			export->err, ENODATA,
			"%s%s: no cut: the blade was never deeper than %.1f mm "
			"(deepest %.2f mm); check `surface` in the rig's "
			"configuration",
			recordings[0]->path, n > 1 ? " and the others" : "",
			INCISE_CUT_BEGIN_MM, export->depth_deepest_mm);
	if (!export->report.rows)
		return incise_error_set(
			export->err, ENODATA,
			"%s%s: no bin holds %d samples; take fewer bins or a "
			"smaller least count",
			recordings[0]->path, n > 1 ? " and the others" : "",
			o->min_count);
	return incise_table_finish(export->table, export->err);
}

static int write_resampled(struct export *export,
			   struct incise_recording *const *recordings, int n)
{
	int rc = 0;

	for (int i = 0; i < n; i++)
		export->samples_all += recordings[i]->meta.force;
	for (int i = 0; i < n && !rc; i++) {
		char *name = cut_name(recordings, i);

		rc = name ? incise_resample(recordings[i], name, export->options,
					    export->table, &export->report,
					    export->samples, export->samples_all,
					    export->err)
			  : incise_error_set(export->err, ENOMEM, "out of memory");
		export->samples += recordings[i]->meta.force;
		free(name);
	}
	return rc ? rc : incise_table_finish(export->table, export->err);
}

/* To a file or, where that is NULL, to a stream. */
static int export_table(struct incise_recording *const *recordings, int n,
			const struct incise_export_options *options,
			const struct incise_table_format *format,
			struct incise_outfile *file, FILE *out,
			const struct incise_lineage *lineage,
			struct incise_export_report *report, struct incise_error *err)
{
	struct export export = {
		.options = options, .err = err, .depth_deepest_mm = -INFINITY};
	bool bins = options->depth_bins > 0, whole = !bins || options->by_cut;
	struct incise_table table;
	int rc;

	if (bins) {
		export.bins = calloc((size_t)options->depth_bins * options->velocity_bins,
				     sizeof(*export.bins));
		if (!export.bins)
			return incise_error_set(err, ENOMEM,
						"%d × %d bins: out of memory",
						options->depth_bins,
						options->velocity_bins);
	}
	if (options->resample)
		rc = incise_table_open(&table, format, file, out, incise_resample_columns,
				       INCISE_RESAMPLE_COLUMNS, lineage, err);
	else
		rc = incise_table_open(
			&table, format, file, out,
			(bins ? bin_columns : raw_columns) + !whole,
			(bins ? COLUMNS(bin_columns) : COLUMNS(raw_columns)) - !whole,
			lineage, err);
	if (!rc) {
		export.table = &table;
		rc = options->resample ? write_resampled(&export, recordings, n)
				       : write_table(&export, recordings, n);
		incise_table_close(&table);
	}
	free(export.bins);
	free(export.name);
	if (!rc && report)
		*report = export.report;
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
