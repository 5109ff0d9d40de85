// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A dataset of recordings; see incise/recording.h.
 *
 *     recordings ──► cuts ──► raw rows, or means over 1/rate            ──► CSV
 *                        └──► bins of depth × velocity (paper 1, §4.1)  ──► CSV
 *
 * Memory is that of the bins; recordings are streamed.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/c_locale.h"
#include "cut.h"
#include "recording.h"

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
	FILE *out;
	struct incise_export_report report;
	struct incise_error *err;

	char *name; /* of the recording under way, unique and ready for CSV */
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
	if (o->min_count < 0)
		return incise_error_set(err, EINVAL, "smallest count %d is negative",
					o->min_count);
	return 0;
}

/*
 * Names the recording in the cut column: quoted where CSV wants it, and unlike any
 * recording before it, so that a/liver.rec and b/liver.rec stay apart.
 */
static char *cut_name(struct incise_recording *const *recordings, int at)
{
	const char *name = recordings[at]->name;
	char *text, *to;
	int same = 1;

	for (int i = 0; i < at; i++)
		same += !strcmp(recordings[i]->name, name);
	text = malloc(2 * strlen(name) + 16);
	if (!text)
		return NULL;
	to = text;
	for (const char *c = name; *c; c++) {
		if (*c == '"')
			*to++ = '"';
		*to++ = (unsigned char)*c < ' ' || *c == 0x7f ? '_' : *c;
	}
	*to = 0;
	/* '~' stands in no recording's own suffix of this kind. */
	if (same > 1)
		sprintf(to, "~%d", same);
	return text;
}

/* The header waits for the first row, so that a failure before it prints nothing. */
static void print_header(struct export *export)
{
	if (export->report.rows)
		return;
	if (!export->bins)
		fputs("cut,t_s,depth_mm,velocity_mm_s,force_N,clipped\n", export->out);
	else
		fprintf(export->out, "%sdepth_mm,velocity_mm_s,force_N,sd_N,count,cuts\n",
			export->options->by_cut ? "cut," : "");
}

static void print_cut(struct export *export)
{
	bool quote = strpbrk(export->name, ",\" ;#") != NULL;

	fprintf(export->out, "%s%s-%02d%s,", quote ? "\"" : "", export->name,
		export->number, quote ? "\"" : "");
}

static int check_out(struct export *export)
{
	if (!ferror(export->out))
		return 0;
	return incise_error_set(
		export->err, errno ? errno : EIO,
		"the dataset cannot be written: %s; make room, or give another -o",
		strerror(errno ? errno : EIO));
}

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

static void print_row(struct export *export)
{
	const struct bin *row = &export->row;

	if (!row->n)
		return;
	print_header(export);
	print_cut(export);
	fprintf(export->out, "%.6f,%.4f,%.3f,%.5f,%d\n", row->t_s, row->depth_mm,
		row->velocity_mm_s, row->force_N, row->clipped);
	export->report.rows++;
	export->row = (struct bin){0};
}

static void add_raw(struct export *export, const struct incise_cut_sample *sample,
		    double t_s)
{
	double rate = export->options->rate_hz;
	/* Times are whole ns: half of one keeps a sample on the edge in its own slot. */
	int64_t slot =
		rate > 0 ? (int64_t)floor((t_s + 0.5e-9) * rate) : export->slot + 1;

	if (slot != export->slot)
		print_row(export);
	export->slot = slot;
	bin_add(&export->row, sample, t_s, export->cut);
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

/* Print the bins that hold enough, and empty them. */
static void print_bins(struct export *export)
{
	const struct incise_export_options *o = export->options;
	size_t n = (size_t)o->depth_bins * o->velocity_bins;
	uint64_t enough = o->min_count > 1 ? o->min_count : 1;

	for (size_t i = 0; i < n; i++) {
		struct bin *bin = &export->bins[i];

		if (bin->n >= enough) {
			print_header(export);
			if (o->by_cut)
				print_cut(export);
			fprintf(export->out, "%.9g,%.9g,%.9g,%.9g,%llu,%d\n",
				bin->depth_mm, bin->velocity_mm_s, bin->force_N,
				bin->n > 1 ? sqrt(bin->m2 / (bin->n - 1)) : 0.0,
				(unsigned long long)bin->n, bin->cuts);
			export->report.rows++;
		}
		*bin = (struct bin){0};
	}
}

/* --- all --------------------------------------------------------------------------- */

/* What was gathered of the cut before goes out before a new one starts. */
static void end_cut(struct export *export)
{
	if (!export->bins)
		print_row(export);
	else if (export->options->by_cut)
		print_bins(export);
}

typedef void (*visit)(struct export *export, const struct incise_cut_sample *sample,
		      double t_s);

/* Pass over the cuts of one recording. */
static int each_sample(struct export *export, struct incise_recording *recording,
		       visit visit)
{
	struct incise_cut_sample sample;
	struct incise_cuts cuts;
	int rc;

	if (isnan(recording->meta.zero_mV))
		return incise_error_set(
			export->err, EINVAL,
			"%s: ended before the zero of the force channel was "
			"known (0.5 s), so no force can be told",
			recording->path);
	rc = incise_cuts_open(&cuts, recording, export->err);
	if (rc)
		return rc;
	export->number = 0;
	while ((rc = incise_cuts_next(&cuts, &sample, export->err)) > 0) {
		if (sample.cut != export->number) {
			if (export->number)
				end_cut(export);
			export->number = sample.cut;
			export->cut++;
		}
		visit(export, &sample, (sample.t_ns - cuts.first_ns) * 1e-9);
		/* Often enough to stop soon on a full disk. */
		if ((cuts.force_rows & 0xfff) == 0 && (rc = check_out(export)))
			break;
	}
	if (!rc && export->number)
		end_cut(export);
	export->depth_deepest_mm = fmax(export->depth_deepest_mm, cuts.depth_max_mm);
	incise_cuts_close(&cuts);
	return rc;
}

static void visit_extent(struct export *export, const struct incise_cut_sample *sample,
			 double t_s)
{
	const struct incise_export_options *o = export->options;
	struct incise_export_report *report = &export->report;

	(void)t_s; /* visitors share one form */
	if (sample->clipped)
		return;
	if (!(o->depth_max_mm > 0))
		report->depth_max_mm = fmax(report->depth_max_mm, sample->depth_mm);
	if (!(o->velocity_max_mm_s > 0))
		report->velocity_max_mm_s =
			fmax(report->velocity_max_mm_s, sample->velocity_mm_s);
}

static void visit_raw(struct export *export, const struct incise_cut_sample *sample,
		      double t_s)
{
	visit_extent(export, sample, t_s);
	export->report.clipped += sample->clipped;
	add_raw(export, sample, t_s);
}

static void visit_binned(struct export *export, const struct incise_cut_sample *sample,
			 double t_s)
{
	(void)t_s;
	if (sample->clipped)
		export->report.clipped++;
	else
		add_binned(export, sample);
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

static int write_csv(struct export *export, struct incise_recording *const *recordings,
		     int n)
{
	const struct incise_export_options *o = export->options;
	struct bin *bins = export->bins;
	int rc = 0;

	export->report.depth_max_mm = o->depth_max_mm;
	export->report.velocity_max_mm_s = o->velocity_max_mm_s;
	if (!bins) {
		rc = each_recording(export, recordings, n, visit_raw);
	} else {
		export->bins = NULL; /* the first pass gathers nothing */
		if (!(o->depth_max_mm > 0) || !(o->velocity_max_mm_s > 0))
			rc = each_recording(export, recordings, n, visit_extent);
		export->bins = bins;
		if (!rc)
			rc = each_recording(export, recordings, n, visit_binned);
		if (!rc && !o->by_cut)
			print_bins(export);
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
	if (fflush(export->out))
		rc = check_out(export);
	return rc;
}

int incise_export_csv(struct incise_recording *const *recordings, int n,
		      const struct incise_export_options *options, FILE *out,
		      struct incise_export_report *report, struct incise_error *err)
{
	struct export export = {.options = options,
				.out = out,
				.err = err,
				.depth_deepest_mm = -INFINITY};
	struct incise_c_locale locale;
	int rc = check_options(options, err);

	if (rc)
		return rc;
	if (n < 1)
		return incise_error_set(err, EINVAL, "no recording to export");
	if (options->depth_bins) {
		export.bins = calloc((size_t)options->depth_bins * options->velocity_bins,
				     sizeof(*export.bins));
		if (!export.bins)
			return incise_error_set(err, ENOMEM,
						"%d × %d bins: out of memory",
						options->depth_bins,
						options->velocity_bins);
	}
	locale = incise_c_locale_begin();
	rc = write_csv(&export, recordings, n);
	incise_c_locale_end(locale);
	free(export.bins);
	free(export.name);
	if (!rc && report)
		*report = export.report;
	return rc;
}
