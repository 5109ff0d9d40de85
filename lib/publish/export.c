// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The rows of an export; see incise/recording.h. Those of resampled recordings are in resample.c.
 *
 *     recordings ──► cuts ──► raw rows, or means over 1/rate            ──► table
 *                        └──► bins of depth × velocity (Song et al. (2006), §4.1), ──► table
 *                             of where the blade advances, and of where not
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../control/model_input.h"
#include "../record/read/cut.h"
#include "../record/read/recording.h"
#include "interpolators.h"
#include "writers.h"

#define COLUMNS(columns) ((int)(sizeof(columns) / sizeof(*(columns))))

/* --- a pass over the cuts ------------------------------------------------------------ */

/* Force samples of one bin, or of one row of a raw export. Set to {0} before use. */
struct bin {
	uint64_t n;
	double t_s, depth_mm, velocity_mm_s, force_N; /* means … */
	double acceleration_mm_s2, tilt_deg, time_in_tissue_s;
	double mean_speed_mm_s, deepest_mm, way_mm;
	double m2;    /* sum of squared deviations of the force */
	int64_t cuts; /* that have samples here */
	int last;     /* the cut counted last */
	bool clipped;
	bool advancing; /* all of them */
};

/* A row of a table. */
struct export_row {
	int64_t cut; /* its name */
	struct bin bin;
	double sd_N;
	struct incise_row_extra extra;
};

/* The largest values of samples that are not clipped. */
struct extent {
	double depth_mm, velocity_mm_s;
};

/* A pass over the cuts of some recordings, which are streamed, into the rows of a table. */
struct pass {
	struct incise_export_pass *all;
	const struct incise_export_options *options;
	struct incise_export_report *report;
	struct incise_error *err;
	const struct visitor *visitor;

	int cut;    /* the present one of all recordings, from 1 */
	int number; /* of the same cut in its recording */
	struct {
		int cut, number;	      /* in the table */
	} named;			      /* the last one with a name there */
	struct incise_blade_pose_value blade; /* at the present sample */
	struct extent any, advancing; /* of all samples so far; of an advancing blade */
	int64_t first_ns;	      /* time 0 of its recording, CLOCK_MONOTONIC */
	double t_s;		      /* of the present sample, from there */
	double depth_deepest_mm;      /* of any row, for the error without a cut */

	/* Uncertainties, if they are asked for. */
	struct incise_budget_row budget_row; /* of the present sample … */
	int64_t record_ns[2];		     /* … and the tracker's records around it */
	struct incise_budget_mean *means;    /* of the visitor's bins */
	void *state;			     /* of the visitor */
};

/* Functions for each sample and cut; each returns 0 or -errno. */
struct visitor {
	int (*sample)(struct pass *pass, const struct incise_cut_sample *sample);
	int (*end_cut)(struct pass *pass); /* or NULL */
};

/* Number of the present cut's name in the table, or -ENOMEM. */
static int cut_name(struct pass *pass)
{
	char *text;
	int rc;

	if (pass->named.cut && pass->named.cut == pass->cut)
		return pass->named.number;
	if (asprintf(&text, "%s-%02d", pass->all->name, pass->number) < 0)
		return incise_error_set(pass->err, ENOMEM, "out of memory");
	rc = incise_table_name(pass->all->table, text);
	free(text);
	if (rc < 0)
		return incise_error_set(pass->err, -rc, "out of memory");
	pass->named.cut = pass->cut;
	pass->named.number = rc;
	return rc;
}

/* Add a row, with the uncertainties of bin number @at, which is emptied. */
static int add_export_row(struct pass *pass, struct export_row *row, size_t at)
{
	double part[INCISE_BUDGET_PARTS];
	int rc;

	if (pass->all->budgets) {
		incise_budget_mean_parts(&pass->means[at], part);
		incise_extra_budget(&row->extra, part);
		pass->means[at] = (struct incise_budget_mean){0};
	}
	row->cut = cut_name(pass);
	if (row->cut < 0)
		return (int)row->cut;
	rc = incise_extra_tai(&row->extra, pass->all->wall,
			      pass->first_ns + llround(row->bin.t_s * 1e9), pass->err);
	if (!rc)
		rc = incise_table_add(pass->all->table, row, pass->err);
	pass->report->rows++;
	return rc;
}

/* Add a sample to bin number @at. Welford's way: one pass, no cancellation. */
static void bin_add(struct bin *bin, size_t at, const struct pass *pass,
		    const struct incise_cut_sample *sample)
{
	int cut = pass->cut;
	double share = 1.0 / ++bin->n;
	double delta = sample->force_N - bin->force_N;

	bin->t_s += share * (pass->t_s - bin->t_s);
	bin->depth_mm += share * (sample->depth_mm - bin->depth_mm);
	bin->velocity_mm_s += share * (sample->velocity_mm_s - bin->velocity_mm_s);
	bin->acceleration_mm_s2 +=
		share * (pass->blade.acceleration_mm_s2 - bin->acceleration_mm_s2);
	bin->tilt_deg += share * (pass->blade.tilt_deg - bin->tilt_deg);
	bin->time_in_tissue_s +=
		share * (pass->blade.time_in_tissue_s - bin->time_in_tissue_s);
	bin->mean_speed_mm_s +=
		share * (pass->blade.mean_speed_mm_s - bin->mean_speed_mm_s);
	bin->deepest_mm += share * (pass->blade.deepest_mm - bin->deepest_mm);
	bin->way_mm += share * (pass->blade.way_mm - bin->way_mm);
	bin->force_N += share * delta;
	bin->m2 += delta * (sample->force_N - bin->force_N);
	bin->clipped |= sample->clipped;
	bin->advancing = pass->blade.advancing && (bin->n == 1 || bin->advancing);
	if (bin->last != cut) {
		bin->last = cut;
		bin->cuts++;
	}
	if (pass->all->budgets)
		incise_budget_mean_add(&pass->means[at],
				       pass->all->budgets[pass->all->recording],
				       pass->all->recording, pass->record_ns,
				       &pass->budget_row);
}

static void extend_to(struct extent *extent, const struct incise_cut_sample *sample)
{
	if (sample->clipped)
		return;
	extent->depth_mm = fmax(extent->depth_mm, sample->depth_mm);
	extent->velocity_mm_s = fmax(extent->velocity_mm_s, sample->velocity_mm_s);
}

/* Report the largest values, unless they are given. */
static void report_extent(const struct pass *pass, const struct extent *extent)
{
	const struct incise_export_options *o = pass->options;

	pass->report->depth_max_mm =
		o->depth_max_mm > 0 ? o->depth_max_mm : extent->depth_mm;
	pass->report->velocity_max_mm_s =
		o->velocity_max_mm_s > 0 ? o->velocity_max_mm_s : extent->velocity_mm_s;
}

static int end_cut(struct pass *pass)
{
	return pass->number && pass->visitor->end_cut ? pass->visitor->end_cut(pass) : 0;
}

/* Find what the uncertainties of a sample depend on. */
static void find_row(struct pass *pass, const struct incise_blade_pose *blade,
		     const struct incise_cut_sample *sample)
{
	if (!pass->all->budgets)
		return;
	pass->budget_row = (struct incise_budget_row){
		.force_N = sample->force_N,
		.force_share = 1,
	};
	incise_blade_pose_budget(blade, sample->t_ns, &pass->blade, &pass->budget_row);
	pass->record_ns[0] = blade->deep[0].t_ns;
	pass->record_ns[1] = blade->deep[1].t_ns;
}

/* Means are of whole slots: all samples of one are in a range in which it begins. */
static int64_t since_ns(const struct pass *pass, int64_t t_ns)
{
	const double rate = pass->options->rate_hz;

	return rate > 0 ? llround(floor(((double)t_ns * 1e-9 + 0.5e-9) * rate) / rate *
				  1e9)
			: t_ns;
}

/* Pass over the cuts of one recording; the blade is that of the same one. */
static int each_cut_sample(struct pass *pass, struct incise_cuts *cuts,
			   struct incise_blade_pose *blade)
{
	struct incise_cut_sample sample;
	int rc;

	pass->number = 0;
	while ((rc = incise_cuts_next(cuts, &sample, pass->err)) > 0) {
		rc = incise_blade_pose_at(blade, sample.t_ns, 0, &pass->blade, pass->err);
		if (rc)
			return rc;
		if (!incise_range_has(&cuts->recording->range,
				      since_ns(pass, sample.t_ns - cuts->first_ns),
				      sample.cut))
			continue;
		find_row(pass, blade, &sample);
		if (sample.cut != pass->number) {
			rc = end_cut(pass);
			if (rc)
				return rc;
			pass->number = sample.cut;
			pass->cut++;
		}
		pass->first_ns = cuts->first_ns;
		pass->t_s = (sample.t_ns - cuts->first_ns) * 1e-9;
		rc = pass->visitor->sample(pass, &sample);
		if (!rc && (cuts->force.n & 0xfff) == 0)
			rc = incise_export_progress(pass->all,
						    pass->all->samples + cuts->force.n,
						    pass->all->samples_all);
		if (rc)
			return rc;
	}
	return rc ? rc : end_cut(pass);
}

static int each_sample(struct incise_export_pass *all, struct incise_recording *recording)
{
	const struct incise_calibration *calibration = all->options->calibration;
	struct pass *pass = all->state;
	struct incise_blade_pose blade;
	struct incise_cuts cuts;
	int rc = incise_cuts_open(&cuts, recording, all->err);

	if (rc)
		return rc;
	if (calibration)
		incise_cuts_calibrate(&cuts, calibration);
	rc = incise_recording_need_zero(recording, &cuts.scale, all->err);
	if (!rc) {
		rc = incise_blade_pose_open(&blade, recording, calibration, all->err);
		if (!rc)
			rc = each_cut_sample(pass, &cuts, &blade);
		incise_blade_pose_close(&blade);
	}
	all->samples += cuts.force.n;
	pass->depth_deepest_mm = fmax(pass->depth_deepest_mm, cuts.depth_max_mm);
	incise_cuts_close(&cuts);
	return rc;
}

/* Visit every sample in a cut, in order. Returns 0 or -errno. */
static int each_cut(struct pass *pass, const struct visitor *visitor)
{
	pass->visitor = visitor;
	pass->cut = 0;
	return incise_export_each(pass->all, each_sample);
}

/* --- force samples, or means over 1/rate --------------------------------------------- */

#define COLUMN(member, ...) INCISE_COLUMN(struct export_row, member, __VA_ARGS__)
#define CUT COLUMN(cut, NAME, 0, "cut", "1", "recording and number of the cut")

static const struct incise_table_column raw_columns[] = {
	CUT,
	COLUMN(bin.t_s, REAL, 6, "t_s", "s", "since the recording's first force sample"),
	COLUMN(bin.depth_mm, SINGLE, 4, "depth_mm", "mm", "of the tip below the surface"),
	COLUMN(bin.velocity_mm_s, SINGLE, 3, "velocity_mm_s", "mm/s", "speed of the tip"),
	COLUMN(bin.force_N, SINGLE, 5, "force_N", "N", "on the blade"),
	COLUMN(bin.clipped, FLAG, 0, "clipped", "1", "1: the converter was at an end"),
	COLUMN(bin.advancing, FLAG, 0, INCISE_ADVANCING_COLUMN),
	COLUMN(bin.acceleration_mm_s2, SINGLE, 1, INCISE_ACCELERATION_COLUMN),
	COLUMN(bin.tilt_deg, SINGLE, 2, INCISE_TILT_COLUMN),
	COLUMN(bin.time_in_tissue_s, SINGLE, 4, INCISE_TIME_COLUMN),
	COLUMN(bin.mean_speed_mm_s, SINGLE, 3, INCISE_MEAN_SPEED_COLUMN),
	COLUMN(bin.deepest_mm, SINGLE, 4, INCISE_DEEPEST_COLUMN),
	COLUMN(bin.way_mm, SINGLE, 4, INCISE_WAY_COLUMN),
};

struct raw {
	struct bin bin;
	int64_t slot; /* of the row, 1/rate each */
};

static int put_row(struct pass *pass)
{
	struct raw *raw = pass->state;
	struct export_row row = {.bin = raw->bin};

	raw->bin = (struct bin){0};
	return row.bin.n ? add_export_row(pass, &row, 0) : 0;
}

static int add_to_row(struct pass *pass, const struct incise_cut_sample *sample)
{
	struct raw *raw = pass->state;
	double rate = pass->options->rate_hz;
	/* Half a ns keeps a sample on the edge in its own slot; times are whole ns. */
	int64_t slot =
		rate > 0 ? (int64_t)floor((pass->t_s + 0.5e-9) * rate) : raw->slot + 1;
	int rc;

	extend_to(&pass->any, sample);
	pass->report->clipped += sample->clipped;
	rc = slot != raw->slot ? put_row(pass) : 0;

	raw->slot = slot;
	bin_add(&raw->bin, 0, pass, sample);
	return rc;
}

static int write_raw(struct pass *pass)
{
	static const struct visitor rows = {add_to_row, put_row};
	struct incise_budget_mean mean = {0};
	struct raw raw = {0};
	int rc;

	pass->state = &raw;
	pass->means = &mean;
	rc = each_cut(pass, &rows);
	report_extent(pass, &pass->any);
	return rc;
}

/* --- means over bins of depth and velocity (Song et al. 2006, §4.1) --- */

static const struct incise_table_column bin_columns[] = {
	CUT,
	COLUMN(bin.depth_mm, REAL, -1, "depth_mm", "mm", "mean depth in the bin"),
	COLUMN(bin.velocity_mm_s, REAL, -1, "velocity_mm_s", "mm/s",
	       "mean speed in the bin"),
	COLUMN(bin.force_N, REAL, -1, "force_N", "N", "mean force in the bin"),
	COLUMN(sd_N, REAL, -1, "sd_N", "N", "standard deviation of single samples"),
	COLUMN(bin.n, INTEGER, 0, "count", "1", "samples"),
	COLUMN(bin.cuts, INTEGER, 0, "cuts", "1", "number of cuts in the bin"),
	COLUMN(bin.advancing, FLAG, 0, INCISE_ADVANCING_COLUMN),
	COLUMN(bin.acceleration_mm_s2, REAL, -1, INCISE_ACCELERATION_COLUMN),
	COLUMN(bin.tilt_deg, REAL, -1, INCISE_TILT_COLUMN),
	COLUMN(bin.time_in_tissue_s, REAL, -1, INCISE_TIME_COLUMN),
	COLUMN(bin.mean_speed_mm_s, REAL, -1, INCISE_MEAN_SPEED_COLUMN),
	COLUMN(bin.deepest_mm, REAL, -1, INCISE_DEEPEST_COLUMN),
};

/* Bin of a value; the upper end belongs to the last one. -1: above it. */
static int bin_of(double value, double max, int bins)
{
	if (value > max || !(max > 0))
		return -1;
	return value < max ? (int)fmin(value / max * bins, bins - 1) : bins - 1;
}

static int add_to_bin(struct pass *pass, const struct incise_cut_sample *sample)
{
	struct bin *bins = pass->state;
	const struct incise_export_options *o = pass->options;
	int i, k;

	if (sample->clipped) {
		pass->report->clipped++;
		return 0;
	}
	i = bin_of(sample->depth_mm, pass->report->depth_max_mm, o->depth_bins);
	k = bin_of(sample->velocity_mm_s, pass->report->velocity_max_mm_s,
		   o->velocity_bins);

	if (i >= 0 && k >= 0) {
		size_t at =
			(size_t)2 * (i * o->velocity_bins + k) + pass->blade.advancing;

		bin_add(&bins[at], at, pass, sample);
	}
	return 0;
}

/* Write the bins with enough samples, and empty all. */
static int put_bins(struct pass *pass)
{
	struct bin *bins = pass->state;
	const struct incise_export_options *o = pass->options;
	size_t n = (size_t)2 * o->depth_bins * o->velocity_bins;
	uint64_t enough = o->min_count > 1 ? o->min_count : 1;
	int rc = 0;

	for (size_t i = 0; i < n; i++) {
		struct export_row row = {.bin = bins[i]};

		row.sd_N = row.bin.n > 1 ? sqrt(row.bin.m2 / (row.bin.n - 1)) : 0.0;
		if (row.bin.n >= enough && !rc)
			rc = add_export_row(pass, &row, i);
		if (pass->means && row.bin.n)
			pass->means[i] = (struct incise_budget_mean){0};
		bins[i] = (struct bin){0};
	}
	return rc;
}

static int find_extent(struct pass *pass, const struct incise_cut_sample *sample)
{
	extend_to(&pass->any, sample);
	if (pass->blade.advancing)
		extend_to(&pass->advancing, sample);
	return 0;
}

/* Find the bins' upper ends: those of where the blade advances, else of all. Each sample is read once more. */
static int find_ends(struct pass *pass)
{
	static const struct visitor visitor = {find_extent, NULL};
	const struct incise_export_report *report = pass->report;
	int rc;

	pass->all->samples_all *= 2;
	rc = each_cut(pass, &visitor);
	report_extent(pass, &pass->advancing);
	if (!(report->depth_max_mm > 0 && report->velocity_max_mm_s > 0))
		report_extent(pass, &pass->any);
	return rc;
}

static int write_bins(struct pass *pass)
{
	const struct incise_export_options *o = pass->options;
	struct visitor rows = {add_to_bin, o->by_cut ? put_bins : NULL};
	size_t n = (size_t)2 * o->depth_bins * o->velocity_bins;
	int rc = 0;

	pass->state = calloc(n, sizeof(struct bin));
	if (pass->all->budgets)
		pass->means = calloc(n, sizeof(*pass->means));
	if (!pass->state || (pass->all->budgets && !pass->means))
		rc = incise_error_set(pass->err, ENOMEM, "%d × %d bins: out of memory",
				      o->depth_bins, o->velocity_bins);
	report_extent(pass, &pass->any);
	if (!rc && !(o->depth_max_mm > 0 && o->velocity_max_mm_s > 0))
		rc = find_ends(pass);
	if (!rc)
		rc = each_cut(pass, &rows);
	if (!rc && !o->by_cut)
		rc = put_bins(pass);
	free(pass->means);
	free(pass->state);
	return rc;
}

/* --- exporting ----------------------------------------------------------------------- */

/* Say why there is none. */
static int no_cut(const struct pass *pass, const char *path, const char *others)
{
	const struct incise_export_options *o = pass->options;

	if (o->from_s > 0 || o->to_s > 0)
		return incise_error_set(
			pass->err, ENODATA,
			"%s%s: no cut in the part from %g s; give another "
			"--range, or the rows of all of it "
			"(--resample)",
			path, others, o->from_s);
	if (isinf(pass->depth_deepest_mm))
		return incise_error_set(
			pass->err, ENODATA,
			"%s%s: no cut: without a pose there is no depth; join a recording "
			"of the tracker (incise join), or export the force alone "
			"(--resample)",
			path, others);
	if (pass->depth_deepest_mm > INCISE_CUT_START_MM)
		return incise_error_set(
			pass->err, ENODATA,
			"%s%s: no cut: no force was recorded while the blade was deeper "
			"than %.1f mm (deepest %.2f mm); `incise info` shows which "
			"streams overlap",
			path, others, INCISE_CUT_START_MM, pass->depth_deepest_mm);
	return incise_error_set(pass->err, ENODATA,
				"%s%s: no cut: the blade was never deeper than %.1f mm "
				"(deepest %.2f mm); check `surface` in the rig's "
				"configuration",
				path, others, INCISE_CUT_START_MM,
				pass->depth_deepest_mm);
}

static int write_cuts(struct incise_export_pass *all)
{
	const struct incise_export_options *o = all->options;
	struct pass pass = {
		.all = all,
		.options = o,
		.report = &all->report,
		.err = all->err,
		.depth_deepest_mm = -INFINITY,
	};
	const char *path = all->recordings[0]->path;
	const char *others = all->n > 1 ? " and the others" : "";
	int rc;

	all->state = &pass;
	rc = o->depth_bins ? write_bins(&pass) : write_raw(&pass);
	if (rc)
		return rc;
	all->report.cuts = pass.cut;
	if (!pass.cut)
		return no_cut(&pass, path, others);
	if (!all->report.rows)
		return incise_error_set(
			all->err, ENODATA,
			"%s%s: no bin has %d samples; give fewer bins or a smaller "
			"minimum count",
			path, others, o->min_count);
	return 0;
}

static const struct incise_row_kind raw_rows = {raw_columns, COLUMNS(raw_columns),
						offsetof(struct export_row, extra),
						write_cuts};
static const struct incise_row_kind bin_rows = {bin_columns, COLUMNS(bin_columns),
						offsetof(struct export_row, extra),
						write_cuts};

/* The kind of rows that is asked for, with their columns. Returns 0 or -errno. */
static int choose_rows(struct incise_export_pass *pass, struct incise_row_kind *kind)
{
	const struct incise_export_options *o = pass->options;

	*kind = o->resample ? incise_resample : o->depth_bins ? bin_rows : raw_rows;
	if (o->depth_bins && !o->by_cut) { /* without the column cut */
		kind->columns++;
		kind->n--;
	}
	for (int i = 0; i < pass->n && o->resample && !pass->camera; i++) {
		int any = incise_camera_interpolator_any(pass->recordings[i], pass->err);

		if (any < 0)
			return any;
		pass->camera = any;
	}
	if (o->resample && !pass->camera)
		kind->n -= INCISE_RESAMPLE_CAMERA_COLUMNS;
	return 0;
}

/* Write the rows of this kind, with the columns that the options add. */
static int write_rows(struct incise_export_pass *pass, const struct incise_row_kind *kind,
		      const struct incise_table_format *format, FILE *out,
		      const struct incise_provenance *provenance)
{
	int n = kind->n, rc;
	struct incise_table_column *columns =
		incise_extra_columns(kind->columns, &n, kind->extra, pass->options);
	struct incise_table table = {
		.format = format,
		.out = out,
		.columns = columns,
		.n_columns = n,
		.provenance = provenance,
	};

	if (!columns)
		return incise_error_set(pass->err, ENOMEM, "out of memory");
	rc = incise_table_open(&table, pass->err);
	if (!rc) {
		pass->table = &table;
		rc = kind->write(pass);
		if (!rc)
			rc = incise_table_finish(&table, pass->err);
		incise_table_close(&table);
	}
	free(columns);
	return rc;
}

int incise_export_rows(struct incise_export_pass *pass,
		       const struct incise_table_format *format, FILE *out,
		       const struct incise_provenance *provenance)
{
	struct incise_row_kind kind;
	int rc;

	for (int i = 0; i < pass->n; i++)
		pass->samples_all += pass->recordings[i]->meta.force;
	rc = choose_rows(pass, &kind);
	if (!rc)
		rc = incise_export_budgets(pass);
	/* Behind the budgets, which are of all rows. */
	for (int i = 0; i < pass->n && !rc; i++)
		rc = incise_recording_limit(pass->recordings[i], pass->options, true,
					    pass->err);
	if (!rc)
		rc = write_rows(pass, &kind, format, out, provenance);
	incise_export_close(pass);
	return rc;
}
