// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A recording on one grid of time; see writers.h. Memory is that of the samples near a row.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include <stdlib.h>
#include "../../control/model_input.h"
#include "../read/recording.h"
#include "writers.h"
#include "interpolators.h"

#define SINGLE(name, unit, about, decimals)                                   \
	{                                                                     \
		name, unit, about, INCISE_COLUMN_SINGLE, decimals, NULL, NULL \
	}
#define FLAG(name, about)                                           \
	{                                                           \
		name, "1", about, INCISE_COLUMN_FLAG, 0, NULL, NULL \
	}
#define POSITION "position of the tip"
#define ORIENTATION "orientation, unit quaternion"

const struct incise_table_column incise_resample_columns[INCISE_RESAMPLE_COLUMNS +
							 INCISE_RESAMPLE_CAMERA_COLUMNS] =
	{
		{"recording", "1", "its name", INCISE_COLUMN_NAME, 0, NULL, NULL},
		{"cut", "1", "number of the cut, 0 outside", INCISE_COLUMN_INTEGER, 0,
		 NULL, NULL},
		{"t_s", "s", "since the recording's first force sample",
		 INCISE_COLUMN_REAL, 6, NULL, NULL},
		SINGLE("x_mm", "mm", POSITION, 4),
		SINGLE("y_mm", "mm", POSITION, 4),
		SINGLE("z_mm", "mm", POSITION, 4),
		SINGLE("position_u_mm", "mm",
		       "standard uncertainty of x, y and z from noise and time", 4),
		SINGLE("qw", "1", ORIENTATION, 6),
		SINGLE("qx", "1", ORIENTATION, 6),
		SINGLE("qy", "1", ORIENTATION, 6),
		SINGLE("qz", "1", ORIENTATION, 6),
		{"station", "1", "sensor of the tracker, 0: unknown",
		 INCISE_COLUMN_INTEGER, 0, NULL, NULL},
		FLAG("button", "1: the button of the stylus was pressed"),
		SINGLE("depth_mm", "mm", "of the tip below the surface", 4),
		SINGLE("depth_u_mm", "mm", "standard uncertainty from noise and time", 4),
		SINGLE("velocity_mm_s", "mm/s", "speed of the tip, smoothed", 3),
		SINGLE("force_N", "N", "on the blade", 5),
		SINGLE("force_u_N", "N", "standard uncertainty of force_N from noise", 6),
		FLAG("clipped", "1: the converter was at an end"),
		FLAG("interpolated", "1: a tracker record is missing here"),
		FLAG("tracker_error", "1: the tracker reported an error"),
		INCISE_ADVANCING_COLUMN,
		{INCISE_ACCELERATION_COLUMN, INCISE_COLUMN_SINGLE, 1, NULL, NULL},
		{INCISE_TILT_COLUMN, INCISE_COLUMN_SINGLE, 2, NULL, NULL},
		{INCISE_TIME_COLUMN, INCISE_COLUMN_SINGLE, 4, NULL, NULL},
		SINGLE("camera_depth_mm", "mm", "depth from the frames", 4),
		SINGLE("camera_depth_sd_mm", "mm",
		       "standard deviation of the edge in the frames", 4),
		SINGLE("camera_depth_u_mm", "mm",
		       "standard uncertainty from the edge and time", 4),
		SINGLE("quality", "1", "quality of the frames, 0 to 1", 3),
		FLAG("low_quality", "1: below 0.5 in a frame, or not detected"),
};

/* A hundred days: longer than any session; a grid over forged times would not end. */
#define SPAN_MAX_NS 1e16
/* Depths of less say little of a scale. */
#define COMPARED_LEAST_MM 3.0

struct resample {
	struct incise_force_interpolator force;
	struct incise_blade_pose blade;
	struct incise_camera_interpolator camera;
	double t_sd_s; /* of times of force */

	const struct incise_export_options *options;
	struct incise_table *table;
	struct incise_export_report *report;
	const struct incise_wall *wall; /* NULL: without TAI */
	int width;			/* columns without those of TAI */
	bool camera_columns;
	/* Uncertainties, or NULL. */
	const struct incise_budget *budget;
	const struct incise_budget_columns *columns;
	bool has_force;
	int64_t name, first_ns;
	int64_t from_ns, to_ns; /* of rows, from the first sample */
	int64_t begin_ns;	/* of what is read */
	int cut;		/* of the last row in one */
	uint64_t samples, all;
	struct {
		double n, depth, camera, depth2, both, least_mm, most_mm;
	} compared; /* sums over rows with both depths */
	struct incise_error *err;
};

/* Depth of the camera, whose zero is its own, over that of the tracker. */
static void compare_depths(struct resample *r, double depth_mm, double camera_mm)
{
	if (!(depth_mm > 0) || isnan(camera_mm))
		return;
	if (!r->compared.n++)
		r->compared.least_mm = r->compared.most_mm = depth_mm;
	r->compared.least_mm = fmin(r->compared.least_mm, depth_mm);
	r->compared.most_mm = fmax(r->compared.most_mm, depth_mm);
	r->compared.depth += depth_mm;
	r->compared.camera += camera_mm;
	r->compared.depth2 += depth_mm * depth_mm;
	r->compared.both += depth_mm * camera_mm;
}

static void report_camera(const struct resample *r)
{
	const double n = r->compared.n,
		     span_mm = r->compared.most_mm - r->compared.least_mm;
	const double mean_mm = r->compared.depth / n;

	r->report->camera_ratio = r->report->camera_off_mm = NAN;
	if (!(n > 100) || span_mm < COMPARED_LEAST_MM)
		return;
	r->report->camera_ratio = (r->compared.both - mean_mm * r->compared.camera) /
				  (r->compared.depth2 - mean_mm * r->compared.depth);
	r->report->camera_off_mm = fabs(r->report->camera_ratio - 1) * span_mm;
}

int incise_resample_width(struct incise_recording *const *recordings, int n,
			  struct incise_error *err)
{
	for (int i = 0; i < n; i++) {
		int any = incise_camera_interpolator_any(recordings[i], err);

		if (any)
			return any < 0 ? any
				       : INCISE_RESAMPLE_COLUMNS +
						 INCISE_RESAMPLE_CAMERA_COLUMNS;
	}
	return INCISE_RESAMPLE_COLUMNS;
}

static double least(double a, double b)
{
	return isnan(b) ? a : fmax(a, b);
}

/* Columns of uncertainties of a row. */
static void put_uncertainties(const struct resample *r, int64_t t_ns,
			      const struct incise_blade_pose_value *blade,
			      const struct incise_force_value *force,
			      union incise_cell *cells)
{
	struct incise_budget_row row = {
		.force_N = force->force_N,
		.force_share = force->share,
		.smoothed = true,
		.tracker_time = !r->has_force,
	};
	double part[INCISE_BUDGET_PARTS];

	incise_blade_pose_budget(&r->blade, t_ns, blade, &row);
	incise_budget_row(r->budget, &row, part);
	incise_budget_cells(r->columns, part, cells);
}

static int put_row(struct resample *r, int64_t t_ns,
		   const struct incise_force_value *force)
{
	struct incise_export_report *report = r->report;
	struct incise_camera_value camera;
	struct incise_blade_pose_value blade;
	union incise_cell all[INCISE_RESAMPLE_COLUMNS + INCISE_RESAMPLE_CAMERA_COLUMNS +
			      INCISE_BUDGET_COLUMNS + INCISE_TAI_COLUMNS];
	int rc = incise_blade_pose_at(&r->blade, t_ns, r->t_sd_s, &blade, r->err);

	if (!rc && r->camera_columns)
		rc = incise_camera_interpolator_at(&r->camera, t_ns, r->t_sd_s, &camera,
						   r->err);
	else
		camera = (struct incise_camera_value){0};
	/* Rows before the range count its cuts. */
	if (rc || t_ns - r->first_ns < r->from_ns)
		return rc;
	if (r->camera_columns)
		compare_depths(r, blade.depth_mm, camera.depth_mm);
	report->cuts += blade.cut && blade.cut != r->cut;
	r->cut = blade.cut ? blade.cut : r->cut;
	report->clipped += force->clipped;
	report->depth_max_mm = least(report->depth_max_mm, blade.depth_mm);
	report->velocity_max_mm_s = least(report->velocity_max_mm_s, blade.velocity_mm_s);
	const union incise_cell cells[] = {
		{.integer = r->name},
		{.integer = blade.cut},
		{.real = (double)(t_ns - r->first_ns) * 1e-9},
		{.real = blade.position_mm[0]},
		{.real = blade.position_mm[1]},
		{.real = blade.position_mm[2]},
		{.real = incise_coarse(blade.position_u_mm)},
		{.real = blade.q[0]},
		{.real = blade.q[1]},
		{.real = blade.q[2]},
		{.real = blade.q[3]},
		{.integer = blade.station},
		{.integer = blade.button},
		{.real = blade.depth_mm},
		{.real = incise_coarse(blade.depth_u_mm)},
		{.real = blade.velocity_mm_s},
		{.real = force->force_N},
		{.real = incise_coarse(force->u_N)},
		{.integer = force->clipped},
		{.integer = blade.interpolated},
		{.integer = blade.error},
		{.integer = blade.advancing},
		{.real = blade.acceleration_mm_s2},
		{.real = blade.tilt_deg},
		{.real = blade.time_in_tissue_s},
		{.real = camera.depth_mm},
		{.real = incise_coarse(camera.sd_mm)},
		{.real = incise_coarse(camera.u_mm)},
		{.real = camera.quality},
		{.integer = camera.low_quality},
	};

	memcpy(all, cells, sizeof(cells));
	if (r->budget)
		put_uncertainties(r, t_ns, &blade, force, all);
	if (r->wall)
		rc = incise_tai_cells(r->wall, t_ns, all + r->width, r->err);
	if (!rc)
		rc = incise_table_add(r->table, all, r->err);
	if (!rc && (++report->rows & 0xfff) == 0)
		rc = incise_export_progress(r->options,
					    (double)(r->samples + r->force.rows.n),
					    (double)r->all, r->err);
	return rc;
}

/* The number of the first row of a grid behind the beginning of what is read. */
static int64_t first_row(const struct resample *r, double row_ns)
{
	return r->begin_ns > r->first_ns
		       ? (int64_t)ceil((double)(r->begin_ns - r->first_ns) / row_ns)
		       : 0;
}

/* A row for each force sample, with the noise of 8 samples to each side. */
static int on_force(struct resample *r)
{
	struct incise_force_interpolator *force = &r->force;
	struct incise_force_value value;
	size_t at = 0;
	int rc = 1, bad = 0;

	for (; !bad; at++) {
		int64_t since_ns;

		while (rc > 0 && force->n < at + INCISE_FORCE_HALF + 1)
			rc = incise_force_interpolator_more(force, r->err);
		if (rc < 0 || at >= force->n)
			return rc < 0 ? rc : 0;
		if (at > INCISE_FORCE_HALF)
			at -= incise_force_interpolator_forget(force,
							       at - INCISE_FORCE_HALF);
		since_ns = force->samples[at].t_ns - r->first_ns;
		if (since_ns >= r->to_ns)
			return 0;
		incise_force_interpolator_sample(force, at, &value);
		bad = put_row(r, force->samples[at].t_ns, &value);
	}
	return bad;
}

/* A row for each multiple of 1/rate from the first force sample to the last. */
static int on_grid(struct resample *r, double force_hz)
{
	struct incise_force_interpolator *force = &r->force;
	double row_ns = 1e9 / r->options->rate_hz;
	bool drops = r->options->rate_hz < force_hz;
	/* A line needs two samples of force to each side. */
	double reach_ns = INCISE_FORCE_HALF * row_ns;
	int rc = 1, bad;

	if (!drops)
		reach_ns = fmax(reach_ns, 2e9 / force_hz);
	for (int64_t k = first_row(r, row_ns);; k++) {
		int64_t t_ns = r->first_ns + llround(k * row_ns);
		struct incise_force_value value;
		size_t old = 0;

		if (t_ns > force->last_ns)
			break;
		if (t_ns - r->first_ns >= r->to_ns)
			return 0;
		while (rc > 0 && force->samples[force->n - 1].t_ns < t_ns + reach_ns)
			rc = incise_force_interpolator_more(force, r->err);
		if (rc < 0)
			return rc;
		/* The last one stays: it is the end of the samples. */
		while (old + 1 < force->n && force->samples[old].t_ns < t_ns - reach_ns)
			old++;
		incise_force_interpolator_forget(force, old);
		if (drops)
			incise_force_interpolator_filter(force, t_ns, row_ns, &value);
		else
			incise_force_interpolator_line(force, t_ns, &value);
		bad = put_row(r, t_ns, &value);
		if (bad)
			return bad;
	}
	/* Rows behind the grid are checked too. */
	while (rc > 0) {
		force->n = 0;
		rc = incise_force_interpolator_more(force, r->err);
	}
	return rc;
}

static int check_span(const struct resample *r, const struct incise_recording *recording,
		      const char *table, int64_t last_ns)
{
	if ((double)(last_ns - r->first_ns) <= SPAN_MAX_NS)
		return 0;
	return incise_error_set(r->err, EINVAL,
				"%s: damaged: table %s: times from %lld to %lld ns are "
				"invalid",
				recording->path, table, (long long)r->first_ns,
				(long long)last_ns);
}

/* Without a force channel, a row for each multiple of 1/rate from the first pose to the last. */
static int on_poses(struct resample *r, struct incise_recording *recording)
{
	const struct incise_calibration *given = r->options->calibration;
	const struct incise_force_value none = {.force_N = NAN, .u_N = NAN, .share = NAN};
	struct incise_rows rows;
	int64_t last_ns;
	int rc;

	if (!(r->options->rate_hz > 0))
		return incise_error_set(
			r->err, EINVAL,
			"%s: has no force channel, whose samples would be the rows; give "
			"--rate HZ, for example 120",
			recording->path);
	rc = incise_rows_open(&rows, recording, "tracker", "seq, t_ns",
			      recording->meta.tracker, r->err);
	if (!rc && given)
		incise_row_times_calibrate(&rows.times, given);
	if (!rc)
		rc = incise_rows_last(&rows, &last_ns, r->err);
	if (!rc)
		rc = incise_rows_first(&rows, &r->first_ns, r->err);
	if (!rc)
		rc = incise_rows_next(&rows, r->err);
	incise_rows_close(&rows);
	if (rc > 0)
		rc = check_span(r, recording, "tracker", last_ns);
	for (int64_t k = first_row(r, 1e9 / r->options->rate_hz); rc >= 0; k++) {
		int64_t t_ns = r->first_ns + llround(k * 1e9 / r->options->rate_hz);

		if (t_ns > last_ns || t_ns - r->first_ns >= r->to_ns)
			break;
		rc = put_row(r, t_ns, &none);
	}
	return rc;
}

/* Rows at the times of the force, or on a grid over it. */
static int on_samples(struct resample *r, struct incise_recording *recording)
{
	double span_ns = (double)(r->force.last_ns - r->force.first_ns);
	int rc;

	r->first_ns = r->force.first_ns;
	r->t_sd_s = incise_row_times_sd(&r->force.rows.times, 0);
	rc = check_span(r, recording, "force", r->force.last_ns);
	if (rc)
		return rc;
	if (!(r->options->rate_hz > 0))
		return on_force(r);
	return on_grid(r, span_ns > 0 ? (recording->meta.force - 1) * 1e9 / span_ns : 1);
}

int incise_resample(struct incise_recording *recording, const char *name,
		    const struct incise_export_options *options,
		    const struct incise_budget *budget,
		    const struct incise_budget_columns *columns,
		    const struct incise_wall *wall, struct incise_table *table,
		    struct incise_export_report *report, uint64_t samples, uint64_t all,
		    struct incise_error *err)
{
	const struct incise_calibration *given = options->calibration;
	struct resample r = {
		.options = options,
		.table = table,
		.report = report,
		.wall = wall,
		.width = table->n_columns - (wall ? INCISE_TAI_COLUMNS : 0),
		.budget = budget,
		.columns = columns,
		.name = incise_table_name(table, name),
		.samples = samples,
		.all = all,
		.err = err,
	};
	bool has_force = incise_recording_has_force(recording);
	int rc = 0;

	r.has_force = has_force;
	r.to_ns = INT64_MAX;
	if (recording->range.limited) {
		r.begin_ns = recording->range.begin_ns;
		r.from_ns = recording->range.from_ns;
		r.to_ns = recording->range.to_ns;
	}
	for (int i = 0; i < r.width; i++)
		if (!strcmp(table->columns[i].name, "camera_depth_mm"))
			r.camera_columns = true;
	if (r.name < 0)
		return incise_error_set(err, ENOMEM, "out of memory");
	if (has_force)
		rc = incise_force_interpolator_open(&r.force, recording, given, err);
	if (!rc)
		rc = incise_blade_pose_open(&r.blade, recording, given, err);
	if (!rc)
		rc = incise_camera_interpolator_open(&r.camera, recording, given, err);
	if (!rc && !has_force)
		rc = on_poses(&r, recording);
	else if (!rc && r.force.n)
		rc = on_samples(&r, recording);
	report_camera(&r);
	incise_force_interpolator_close(&r.force);
	incise_blade_pose_close(&r.blade);
	incise_camera_interpolator_close(&r.camera);
	return rc;
}
