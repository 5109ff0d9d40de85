// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Export of recordings; see incise/recording.h.
 *
 *     recordings ──► cuts ──► raw rows, or means over 1/rate            ──► table
 *                        └──► bins of depth × velocity (Song et al. (2006), §4.1), ──► table
 *                             of where the blade advances, and of where not
 *     recordings ──► rows at the force's times, or on a grid            ──► table
 *     recording  ──► messages                                           ──► MCAP
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/outfile.h>
#include "../../control/model_input.h"
#include "../read/cut.h"
#include "../read/recording.h"
#include "interpolators.h"
#include "writers.h"
#include "provenance.h"
#include "table_writer.h"

#define COLUMNS(columns) ((int)(sizeof(columns) / sizeof(*(columns))))
#define BINS_MAX 1000 /* in one direction; all of them are held in memory */

/* --- a pass over the cuts ------------------------------------------------------------ */

/* Force samples of one bin, or of one row of a raw export. Set to {0} before use. */
struct bin {
	uint64_t n;
	double t_s, depth_mm, velocity_mm_s, force_N; /* means … */
	double acceleration_mm_s2, tilt_deg, time_in_tissue_s;
	double m2; /* sum of squared deviations of the force */
	int cuts;  /* that have samples here */
	int last;  /* the cut counted last */
	bool clipped;
	bool advancing; /* all of them */
};

/* A pass over the cuts of some recordings, which are streamed, into the rows of a table. */
struct pass {
	const struct incise_export_options *options;
	struct incise_table *table;
	struct incise_export_report report;
	struct incise_error *err;

	char *name;		       /* of the present recording, unique */
	uint64_t samples, samples_all; /* of force, read and to be read */
	int cut;		       /* the present one of all recordings, from 1 */
	int number;		       /* of the same cut in its recording */
	struct {
		int cut, number;	      /* in the table */
	} named;			      /* the last one with a name there */
	struct incise_blade_pose_value blade; /* at the present sample */
	struct incise_wall *wall; /* of the present recording; NULL: without TAI */
	int64_t first_ns;	  /* its time 0, CLOCK_MONOTONIC */
	double depth_deepest_mm;  /* of any row, for the error without a cut */

	/* Uncertainties, if they are asked for; else NULL. */
	struct incise_budget **budgets; /* of each recording */
	const struct incise_budget_columns *columns;
	int recording;			  /* the present one, from 0 */
	int width;			  /* columns without those of TAI */
	struct incise_budget_row row;	  /* of the present sample … */
	int64_t record_ns[2];		  /* … and the tracker's records around it */
	struct incise_budget_mean *means; /* of the visitor's bins */
	void *state;			  /* of the visitor */
};

/* Functions for each sample and cut; each returns 0 or -errno. */
struct visitor {
	int (*sample)(struct pass *pass, const struct incise_cut_sample *sample,
		      double t_s);
	int (*end_cut)(struct pass *pass); /* or NULL */
};

/* Name of a recording, unlike any before it: a/liver.rec and b/liver.rec differ. NULL: no memory. */
static char *unique_name(struct incise_recording *const *recordings, int at)
{
	const char *name = recordings[at]->name;
	int same = 1;
	char *text;

	for (int i = 0; i < at; i++)
		same += !strcmp(recordings[i]->name, name);
	/* No recording's own name ends in such a suffix. */
	if (same > 1 ? asprintf(&text, "%s~%d", name, same) < 0
		     : asprintf(&text, "%s", name) < 0)
		return NULL;
	for (char *c = text; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '_';
	return text;
}

/* Number of the present cut's name in the table, or -ENOMEM. */
static int cut_name(struct pass *pass)
{
	char *text;
	int rc;

	if (pass->named.cut && pass->named.cut == pass->cut)
		return pass->named.number;
	if (asprintf(&text, "%s-%02d", pass->name, pass->number) < 0)
		return incise_error_set(pass->err, ENOMEM, "out of memory");
	rc = incise_table_name(pass->table, text);
	free(text);
	if (rc < 0)
		return incise_error_set(pass->err, -rc, "out of memory");
	pass->named.cut = pass->cut;
	pass->named.number = rc;
	return rc;
}

/* Write the uncertainties of bin number @at, and empty them. */
static void put_uncertainties(struct pass *pass, size_t at, union incise_cell *cells)
{
	double part[INCISE_BUDGET_PARTS];

	if (!pass->budgets)
		return;
	incise_budget_mean_parts(&pass->means[at], part);
	incise_budget_cells(pass->columns, part, cells);
	pass->means[at] = (struct incise_budget_mean){0};
}

/* Add a sample to bin number @at. Welford's way: one pass, no cancellation. */
static void bin_add(struct bin *bin, size_t at, const struct pass *pass,
		    const struct incise_cut_sample *sample, double t_s)
{
	int cut = pass->cut;
	double share = 1.0 / ++bin->n;
	double delta = sample->force_N - bin->force_N;

	bin->t_s += share * (t_s - bin->t_s);
	bin->depth_mm += share * (sample->depth_mm - bin->depth_mm);
	bin->velocity_mm_s += share * (sample->velocity_mm_s - bin->velocity_mm_s);
	bin->acceleration_mm_s2 +=
		share * (pass->blade.acceleration_mm_s2 - bin->acceleration_mm_s2);
	bin->tilt_deg += share * (pass->blade.tilt_deg - bin->tilt_deg);
	bin->time_in_tissue_s +=
		share * (pass->blade.time_in_tissue_s - bin->time_in_tissue_s);
	bin->force_N += share * delta;
	bin->m2 += delta * (sample->force_N - bin->force_N);
	bin->clipped |= sample->clipped;
	bin->advancing = pass->blade.advancing && (bin->n == 1 || bin->advancing);
	if (bin->last != cut) {
		bin->last = cut;
		bin->cuts++;
	}
	if (pass->budgets)
		incise_budget_mean_add(&pass->means[at], pass->budgets[pass->recording],
				       pass->recording, pass->record_ns, &pass->row);
}

/* Extend the bins without a given end to the largest sample that is not clipped. */
static void extend(struct pass *pass, const struct incise_cut_sample *sample)
{
	const struct incise_export_options *o = pass->options;
	struct incise_export_report *report = &pass->report;

	if (sample->clipped)
		return;
	if (!(o->depth_max_mm > 0))
		report->depth_max_mm = fmax(report->depth_max_mm, sample->depth_mm);
	if (!(o->velocity_max_mm_s > 0))
		report->velocity_max_mm_s =
			fmax(report->velocity_max_mm_s, sample->velocity_mm_s);
}

static int end_cut(struct pass *pass, const struct visitor *visitor)
{
	return pass->number && visitor->end_cut ? visitor->end_cut(pass) : 0;
}

/* Find what the uncertainties of a sample depend on. */
static void find_row(struct pass *pass, const struct incise_blade_pose *blade,
		     const struct incise_cut_sample *sample)
{
	if (!pass->budgets)
		return;
	pass->row = (struct incise_budget_row){
		.force_N = sample->force_N,
		.force_share = 1,
	};
	incise_blade_pose_budget(blade, sample->t_ns, &pass->blade, &pass->row);
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
			   struct incise_blade_pose *blade, const struct visitor *visitor)
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
			rc = end_cut(pass, visitor);
			if (rc)
				return rc;
			pass->number = sample.cut;
			pass->cut++;
		}
		pass->first_ns = cuts->first_ns;
		rc = visitor->sample(pass, &sample,
				     (sample.t_ns - cuts->first_ns) * 1e-9);
		if (!rc && (cuts->force.n & 0xfff) == 0)
			rc = incise_export_progress(
				pass->options, (double)(pass->samples + cuts->force.n),
				(double)pass->samples_all, pass->err);
		if (rc)
			return rc;
	}
	return rc ? rc : end_cut(pass, visitor);
}

static int each_sample(struct pass *pass, struct incise_recording *recording,
		       const struct visitor *visitor)
{
	const struct incise_calibration *calibration = pass->options->calibration;
	struct incise_blade_pose blade;
	struct incise_cuts cuts;
	int rc;

	rc = incise_cuts_open(&cuts, recording, pass->err);
	if (rc)
		return rc;
	if (calibration)
		incise_cuts_calibrate(&cuts, calibration);
	rc = incise_recording_need_zero(recording, &cuts.scale, pass->err);
	if (!rc) {
		rc = incise_blade_pose_open(&blade, recording, calibration, pass->err);
		if (!rc)
			rc = each_cut_sample(pass, &cuts, &blade, visitor);
		incise_blade_pose_close(&blade);
	}
	pass->samples += cuts.force.n;
	pass->depth_deepest_mm = fmax(pass->depth_deepest_mm, cuts.depth_max_mm);
	incise_cuts_close(&cuts);
	return rc;
}

/* Read the wall time of a recording, where it is asked for. Returns 0 or -errno. */
static int open_wall(struct pass *pass, struct incise_recording *recording)
{
	incise_wall_free(pass->wall);
	pass->wall = NULL;
	if (!pass->options->tai)
		return 0;
	pass->wall = incise_recording_wall(recording, pass->err);
	return pass->wall ? 0 : -errno;
}

/* Visit every sample in a cut, in order. Returns 0 or -errno. */
static int each_cut(struct pass *pass, struct incise_recording *const *recordings, int n,
		    const struct visitor *visitor)
{
	int rc = 0;

	pass->cut = 0;
	for (int i = 0; i < n && !rc; i++) {
		free(pass->name);
		pass->recording = i;
		pass->name = unique_name(recordings, i);
		rc = pass->name ? open_wall(pass, recordings[i])
				: incise_error_set(pass->err, ENOMEM, "out of memory");
		if (!rc)
			rc = each_sample(pass, recordings[i], visitor);
	}
	return rc;
}

/* --- force samples, or means over 1/rate --------------------------------------------- */

#define CUT                                                                           \
	{                                                                             \
		"cut", "1", "recording and number of the cut", INCISE_COLUMN_NAME, 0, \
			NULL, NULL                                                    \
	}

static const struct incise_table_column raw_columns[] = {
	CUT,
	{"t_s", "s", "since the recording's first force sample", INCISE_COLUMN_REAL, 6,
	 NULL, NULL},
	{"depth_mm", "mm", "of the tip below the surface", INCISE_COLUMN_SINGLE, 4, NULL,
	 NULL},
	{"velocity_mm_s", "mm/s", "speed of the tip", INCISE_COLUMN_SINGLE, 3, NULL,
	 NULL},
	{"force_N", "N", "on the blade", INCISE_COLUMN_SINGLE, 5, NULL, NULL},
	{"clipped", "1", "1: the converter was at an end", INCISE_COLUMN_FLAG, 0, NULL,
	 NULL},
	INCISE_ADVANCING_COLUMN,
	{INCISE_ACCELERATION_COLUMN, INCISE_COLUMN_SINGLE, 1, NULL, NULL},
	{INCISE_TILT_COLUMN, INCISE_COLUMN_SINGLE, 2, NULL, NULL},
	{INCISE_TIME_COLUMN, INCISE_COLUMN_SINGLE, 4, NULL, NULL},
};

struct raw {
	struct bin row;
	int64_t slot; /* of the row, 1/rate each */
};

static int put_row(struct pass *pass)
{
	struct raw *raw = pass->state;
	const struct bin *row = &raw->row;
	union incise_cell cells[COLUMNS(raw_columns) + INCISE_BUDGET_COLUMNS +
				INCISE_TAI_COLUMNS] = {
		{.integer = 0},
		{.real = row->t_s},
		{.real = row->depth_mm},
		{.real = row->velocity_mm_s},
		{.real = row->force_N},
		{.integer = row->clipped},
		{.integer = row->advancing},
		{.real = row->acceleration_mm_s2},
		{.real = row->tilt_deg},
		{.real = row->time_in_tissue_s},
	};
	int rc = 0;

	if (!row->n)
		return 0;
	cells[0].integer = cut_name(pass);
	if (cells[0].integer < 0)
		return (int)cells[0].integer;
	put_uncertainties(pass, 0, cells);
	if (pass->wall)
		rc = incise_tai_cells(pass->wall,
				      pass->first_ns + llround(row->t_s * 1e9),
				      cells + pass->width, pass->err);
	if (!rc)
		rc = incise_table_add(pass->table, cells, pass->err);
	pass->report.rows++;
	raw->row = (struct bin){0};
	return rc;
}

static int add_to_row(struct pass *pass, const struct incise_cut_sample *sample,
		      double t_s)
{
	struct raw *raw = pass->state;
	double rate = pass->options->rate_hz;
	/* Half a ns keeps a sample on the edge in its own slot; times are whole ns. */
	int64_t slot = rate > 0 ? (int64_t)floor((t_s + 0.5e-9) * rate) : raw->slot + 1;
	int rc;

	extend(pass, sample);
	pass->report.clipped += sample->clipped;
	rc = slot != raw->slot ? put_row(pass) : 0;

	raw->slot = slot;
	bin_add(&raw->row, 0, pass, sample, t_s);
	return rc;
}

static int write_raw(struct pass *pass, struct incise_recording *const *recordings, int n)
{
	static const struct visitor rows = {add_to_row, put_row};
	struct incise_budget_mean mean = {0};
	struct raw raw = {0};

	pass->state = &raw;
	pass->means = &mean;
	return each_cut(pass, recordings, n, &rows);
}

/* --- means over bins of depth and velocity (Song et al. 2006, §4.1) --- */

static const struct incise_table_column bin_columns[] = {
	CUT,
	{"depth_mm", "mm", "mean depth in the bin", INCISE_COLUMN_REAL, -1, NULL, NULL},
	{"velocity_mm_s", "mm/s", "mean speed in the bin", INCISE_COLUMN_REAL, -1, NULL,
	 NULL},
	{"force_N", "N", "mean force in the bin", INCISE_COLUMN_REAL, -1, NULL, NULL},
	{"sd_N", "N", "standard deviation of single samples", INCISE_COLUMN_REAL, -1,
	 NULL, NULL},
	{"count", "1", "samples", INCISE_COLUMN_INTEGER, 0, NULL, NULL},
	{"cuts", "1", "number of cuts in the bin", INCISE_COLUMN_INTEGER, 0, NULL, NULL},
	INCISE_ADVANCING_COLUMN,
	{INCISE_ACCELERATION_COLUMN, INCISE_COLUMN_REAL, -1, NULL, NULL},
	{INCISE_TILT_COLUMN, INCISE_COLUMN_REAL, -1, NULL, NULL},
	{INCISE_TIME_COLUMN, INCISE_COLUMN_REAL, -1, NULL, NULL},
};

/* Bin of a value; the upper end belongs to the last one. -1: above it. */
static int bin_of(double value, double max, int bins)
{
	if (value > max || !(max > 0))
		return -1;
	return value < max ? (int)fmin(value / max * bins, bins - 1) : bins - 1;
}

static int add_to_bin(struct pass *pass, const struct incise_cut_sample *sample,
		      double t_s)
{
	struct bin *bins = pass->state;
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

	if (i >= 0 && k >= 0) {
		size_t at =
			(size_t)2 * (i * o->velocity_bins + k) + pass->blade.advancing;

		bin_add(&bins[at], at, pass, sample, 0);
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
		struct bin *bin = &bins[i];
		union incise_cell cells[COLUMNS(bin_columns) + INCISE_BUDGET_COLUMNS] = {
			{.integer = 0},
			{.real = bin->depth_mm},
			{.real = bin->velocity_mm_s},
			{.real = bin->force_N},
			{.real = bin->n > 1 ? sqrt(bin->m2 / (bin->n - 1)) : 0.0},
			{.integer = (int64_t)bin->n},
			{.integer = bin->cuts},
			{.integer = bin->advancing},
			{.real = bin->acceleration_mm_s2},
			{.real = bin->tilt_deg},
			{.real = bin->time_in_tissue_s},
		};

		if (bin->n >= enough && !rc) {
			if (o->by_cut) {
				rc = cut_name(pass);
				cells[0].integer = rc;
			}
			put_uncertainties(pass, i, cells + !o->by_cut);
			if (rc >= 0)
				rc = incise_table_add(pass->table, cells + !o->by_cut,
						      pass->err);
			pass->report.rows++;
		}
		if (pass->means && bin->n)
			pass->means[i] = (struct incise_budget_mean){0};
		*bin = (struct bin){0};
	}
	return rc;
}

static int find_extent(struct pass *pass, const struct incise_cut_sample *sample,
		       double t_s)
{
	(void)t_s;
	if (pass->blade.advancing)
		extend(pass, sample);
	return 0;
}

static int find_any_extent(struct pass *pass, const struct incise_cut_sample *sample,
			   double t_s)
{
	(void)t_s;
	extend(pass, sample);
	return 0;
}

/* The bins' upper ends: those of where the blade advances, else of all. */
static int find_ends(struct pass *pass, struct incise_recording *const *recordings, int n)
{
	const struct visitor advancing = {find_extent, NULL};
	const struct visitor any = {find_any_extent, NULL};
	const struct incise_export_report *report = &pass->report;
	int rc = each_cut(pass, recordings, n, &advancing);

	if (!rc && !(report->depth_max_mm > 0 && report->velocity_max_mm_s > 0))
		rc = each_cut(pass, recordings, n, &any);
	return rc;
}

static int write_bins(struct pass *pass, struct incise_recording *const *recordings,
		      int n)
{
	const struct incise_export_options *o = pass->options;
	struct visitor rows = {add_to_bin, o->by_cut ? put_bins : NULL};
	uint64_t all = pass->samples_all;
	int rc = 0;

	pass->state =
		calloc((size_t)2 * o->depth_bins * o->velocity_bins, sizeof(struct bin));
	if (pass->budgets)
		pass->means = calloc((size_t)2 * o->depth_bins * o->velocity_bins,
				     sizeof(*pass->means));
	if (!pass->state || (pass->budgets && !pass->means)) {
		free(pass->state);
		return incise_error_set(pass->err, ENOMEM, "%d × %d bins: out of memory",
					o->depth_bins, o->velocity_bins);
	}
	if (!(o->depth_max_mm > 0 && o->velocity_max_mm_s > 0)) {
		pass->samples_all += all; /* each is read twice */
		rc = find_ends(pass, recordings, n);
	}
	if (!rc)
		rc = each_cut(pass, recordings, n, &rows);
	if (!rc && !o->by_cut)
		rc = put_bins(pass);
	free(pass->means);
	free(pass->state);
	return rc;
}

/* --- exporting ----------------------------------------------------------------------- */

void incise_export_options_init(struct incise_export_options *options)
{
	*options = (struct incise_export_options){.min_count = 50};
}

int incise_export_check(const struct incise_export_options *o, struct incise_error *err)
{
	if (!(o->rate_hz >= 0 && o->rate_hz <= 1e9))
		return incise_error_set(err, EINVAL,
					"rate of export %g Hz: expected 0 to 1e9",
					o->rate_hz);
	if (!(o->from_s >= 0 && o->to_s >= 0) || (o->to_s > 0 && o->to_s <= o->from_s) ||
	    o->cut < 0)
		return incise_error_set(err, EINVAL,
					"part from %g s to %g s, cut %d: the end is not "
					"behind the beginning, or there is none",
					o->from_s, o->to_s, o->cut);
	if (o->depth_bins < 0 || o->depth_bins > BINS_MAX || o->velocity_bins < 0 ||
	    o->velocity_bins > BINS_MAX || !o->depth_bins != !o->velocity_bins)
		return incise_error_set(err, EINVAL,
					"%d × %d bins: expected 1 to %d each, or both 0",
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
					"resampling needs a rate of 1 Hz or more, and "
					"no averages");
	if (o->tai && (o->depth_bins || o->ros2))
		return incise_error_set(err, EINVAL,
					"TAI is of rows, not of averages in bins, and "
					"messages of ROS 2 have UTC");
	if (o->uncertainty && o->ros2)
		return incise_error_set(err, EINVAL,
					"messages of ROS 2 have no place for "
					"uncertainties");
	if (o->min_count < 0)
		return incise_error_set(err, EINVAL, "smallest count %d is negative",
					o->min_count);
	return 0;
}

/* Say why there is none. */
static int no_cut(struct pass *pass, struct incise_recording *const *recordings, int n)
{
	const char *path = recordings[0]->path, *others = n > 1 ? " and the others" : "";
	const struct incise_export_options *o = pass->options;

	if (o->from_s > 0 || o->to_s > 0)
		return incise_error_set(
			pass->err, ENODATA,
			"%s%s: no cut in the part from %g s; give another "
			"--from and --to, or the rows of all of it "
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

static int write_cuts(struct pass *pass, struct incise_recording *const *recordings,
		      int n)
{
	const struct incise_export_options *o = pass->options;
	int rc;

	pass->report.depth_max_mm = o->depth_max_mm;
	pass->report.velocity_max_mm_s = o->velocity_max_mm_s;
	rc = o->depth_bins ? write_bins(pass, recordings, n)
			   : write_raw(pass, recordings, n);
	if (rc)
		return rc;
	pass->report.cuts = pass->cut;
	if (!pass->cut)
		return no_cut(pass, recordings, n);
	if (!pass->report.rows)
		return incise_error_set(
			pass->err, ENODATA,
			"%s%s: no bin has %d samples; give fewer bins or a smaller "
			"minimum count",
			recordings[0]->path, n > 1 ? " and the others" : "",
			o->min_count);
	return incise_table_finish(pass->table, pass->err);
}

static int write_resampled(struct pass *pass, struct incise_recording *const *recordings,
			   int n)
{
	int rc = 0;

	for (int i = 0; i < n && !rc; i++) {
		char *name = unique_name(recordings, i);

		rc = name ? open_wall(pass, recordings[i])
			  : incise_error_set(pass->err, ENOMEM, "out of memory");
		if (!rc)
			rc = incise_resample(recordings[i], name, pass->options,
					     pass->budgets ? pass->budgets[i] : NULL,
					     pass->columns, pass->wall, pass->table,
					     &pass->report, pass->samples,
					     pass->samples_all, pass->err);
		pass->samples += recordings[i]->meta.force;
		free(name);
	}
	if (!rc && !pass->report.rows && n && recordings[0]->range.limited)
		rc = incise_error_set(pass->err, ENODATA,
				      "%s: has nothing in this part; give another --from "
				      "and --to",
				      recordings[0]->path);
	return rc ? rc : incise_table_finish(pass->table, pass->err);
}

void incise_report_unstated(struct incise_export_report *report,
			    const struct incise_budget *budget)
{
	char *text = report->unstated;

	for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++) {
		const char *missing =
			incise_budget_missing(budget, (enum incise_budget_quantity)q);
		size_t n = strlen(text);
		char line[400];

		if (!missing)
			continue;
		snprintf(line, sizeof(line), "%s: %s", incise_budget_values()[q].name,
			 missing);
		/* Several recordings may lack the same. */
		if (!strstr(text, line))
			snprintf(text + n, sizeof(report->unstated) - n, "%s%s",
				 n ? "\n" : "", line);
	}
}

static void close_budgets(struct pass *pass, int n)
{
	for (int i = 0; i < n && pass->budgets; i++)
		incise_budget_free(pass->budgets[i]);
	free(pass->budgets);
}

/* The budgets of all recordings, if uncertainties are asked for. Returns 0 or -errno. */
static int open_budgets(struct pass *pass, struct incise_recording *const *recordings,
			int n)
{
	if (!pass->options->uncertainty)
		return 0;
	pass->budgets = calloc((size_t)n, sizeof(struct incise_budget *));
	if (!pass->budgets)
		return incise_error_set(pass->err, ENOMEM, "out of memory");
	for (int i = 0; i < n; i++) {
		pass->budgets[i] =
			incise_budget_open(recordings[i], pass->options, true, pass->err);
		if (!pass->budgets[i])
			return -errno;
		incise_report_unstated(&pass->report, pass->budgets[i]);
	}
	return 0;
}

/* Write the rows of a table of these columns; those of TAI come last. */
static int write_table(struct pass *pass, struct incise_recording *const *recordings,
		       int n, const struct incise_table_format *format, FILE *out,
		       const struct incise_table_column *columns,
		       const struct incise_provenance *provenance)
{
	struct incise_table_column *with_tai = NULL;
	struct incise_table table;
	int rc, width = pass->width;

	if (pass->options->tai) {
		columns = with_tai = incise_tai_columns(columns, width);
		width += INCISE_TAI_COLUMNS;
		if (!columns)
			return incise_error_set(pass->err, ENOMEM, "out of memory");
	}
	rc = incise_table_open(&table, format, out, columns, width, provenance,
			       pass->err);
	if (!rc) {
		pass->table = &table;
		rc = pass->options->resample ? write_resampled(pass, recordings, n)
					     : write_cuts(pass, recordings, n);
		incise_table_close(&table);
	}
	free(with_tai);
	return rc;
}

int incise_export_table(struct incise_recording *const *recordings, int n,
			const struct incise_export_options *options,
			const struct incise_table_format *format, FILE *out,
			const struct incise_provenance *provenance,
			struct incise_export_report *report, struct incise_error *err)
{
	struct pass pass = {
		.options = options, .err = err, .depth_deepest_mm = -INFINITY};
	bool bins = options->depth_bins > 0, whole = !bins || options->by_cut;
	const struct incise_table_column *columns =
		options->resample ? incise_resample_columns
				  : (bins ? bin_columns : raw_columns) + !whole;
	struct incise_budget_columns with_budget = {0};
	int rc;

	for (int i = 0; i < n; i++)
		pass.samples_all += recordings[i]->meta.force;
	pass.width = (bins ? COLUMNS(bin_columns) : COLUMNS(raw_columns)) - !whole;
	if (options->resample)
		pass.width = incise_resample_width(recordings, n, err);
	if (pass.width < 0)
		return pass.width;
	rc = open_budgets(&pass, recordings, n);
	if (!rc && options->uncertainty) {
		rc = incise_budget_columns(&with_budget, columns, pass.width,
					   options->uncertainty);
		if (rc)
			incise_error_set(err, ENOMEM, "out of memory");
		columns = with_budget.columns;
		pass.columns = &with_budget;
		pass.width = with_budget.n;
	}
	/* Behind the budgets, which are of all rows. */
	for (int i = 0; i < n && !rc; i++)
		rc = incise_recording_limit(recordings[i], options, err);
	if (!rc)
		rc = write_table(&pass, recordings, n, format, out, columns, provenance);
	for (int i = 0; i < n; i++)
		recordings[i]->range = (struct incise_recording_range){0};
	close_budgets(&pass, n);
	free(with_budget.columns);
	incise_wall_free(pass.wall);
	free(pass.name);
	if (!rc && report)
		*report = pass.report;
	return rc;
}

/* Whether a path has an ending, in either case. */
static bool ends_with(const char *path, const char *end)
{
	size_t n = strlen(path), k = strlen(end);

	return n > k && !strcasecmp(path + n - k, end);
}

static int write_mcap(struct incise_recording *const *recordings, int n,
		      const struct incise_export_options *options, const char *path,
		      FILE *out, const struct incise_provenance *provenance,
		      struct incise_export_report *report, struct incise_error *err)
{
	if (n > 1)
		return incise_error_set(
			err, EINVAL,
			"%s: MCAP holds one recording, and %d are given; export each to a "
			"file of its own, or give -o FILE.csv or FILE.h5",
			path, n);
	if (options->rate_hz > 0 || options->depth_bins || options->resample)
		return incise_error_set(
			err, EINVAL,
			"%s: MCAP has every row as it was recorded; give -o FILE.csv or "
			"FILE.h5 for a rate, averages or resampled rows",
			path);
	return incise_export_mcap(recordings[0], options, out, provenance, report, err);
}

int incise_export(struct incise_recording *const *recordings, int n,
		  const struct incise_export_options *options, const char *path,
		  struct incise_export_report *report, struct incise_error *err)
{
	bool hdf5 = ends_with(path, ".h5") || ends_with(path, ".hdf5");
	const struct incise_table_format *format = &incise_table_csv;
	struct incise_provenance provenance = {0};
	struct incise_outfile *file;
	int rc = incise_export_check(options, err);

	if (rc)
		return rc;
	if (n < 1)
		return incise_error_set(err, EINVAL, "no recording to export");
	if (options->ros2 && !ends_with(path, ".mcap"))
		return incise_error_set(
			err, EINVAL,
			"%s: messages of ROS 2 are written as MCAP; give -o "
			"FILE.mcap",
			path);
	if (hdf5 && !(format = incise_table_hdf5(err)))
		return -errno;
	file = incise_outfile_open(path, err);
	if (!file)
		return -errno;
	rc = incise_provenance_of(&provenance, recordings, n, options, NULL, err);
	if (!rc && ends_with(path, ".mcap"))
		rc = write_mcap(recordings, n, options, path, incise_outfile_stream(file),
				&provenance, report, err);
	else if (!rc)
		rc = incise_export_table(recordings, n, options, format,
					 incise_outfile_stream(file),
					 hdf5 || options->provenance ? &provenance : NULL,
					 report, err);
	incise_provenance_free(&provenance);
	if (!rc)
		return incise_outfile_commit(file, err);
	incise_outfile_abort(file);
	errno = -rc;
	return rc;
}
