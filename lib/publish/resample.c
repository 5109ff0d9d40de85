// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A recording on one grid of time; see writers.h. Memory is that of the samples near a row.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include <stdlib.h>
#include "../control/model_input.h"
#include "../record/read/recording.h"
#include "writers.h"
#include "interpolators.h"

struct resample_row {
	int64_t recording; /* its name */
	double t_s;
	struct incise_blade_pose_value blade;
	struct incise_force_value force;
	struct incise_camera_value camera;
	struct incise_row_extra extra;
};

#define COLUMN(member, ...) INCISE_COLUMN(struct resample_row, member, __VA_ARGS__)
#define POSITION "position of the tip"
#define ORIENTATION "orientation, unit quaternion"

static const struct incise_table_column columns[] = {
	COLUMN(recording, NAME, 0, "recording", "1", "its name"),
	COLUMN(blade.cut, INTEGER, 0, "cut", "1", "number of the cut, 0 outside"),
	COLUMN(t_s, REAL, 6, "t_s", "s", "since the recording's first force sample"),
	COLUMN(blade.position_mm[0], SINGLE, 4, "x_mm", "mm", POSITION),
	COLUMN(blade.position_mm[1], SINGLE, 4, "y_mm", "mm", POSITION),
	COLUMN(blade.position_mm[2], SINGLE, 4, "z_mm", "mm", POSITION),
	COLUMN(blade.position_u_mm, COARSE, 4, "position_u_mm", "mm",
	       "standard uncertainty of x, y and z from noise and time"),
	COLUMN(blade.q[0], SINGLE, 6, "qw", "1", ORIENTATION),
	COLUMN(blade.q[1], SINGLE, 6, "qx", "1", ORIENTATION),
	COLUMN(blade.q[2], SINGLE, 6, "qy", "1", ORIENTATION),
	COLUMN(blade.q[3], SINGLE, 6, "qz", "1", ORIENTATION),
	COLUMN(blade.station, INTEGER, 0, "station", "1",
	       "sensor of the tracker, 0: unknown"),
	COLUMN(blade.button, FLAG, 0, "button", "1",
	       "1: the button of the stylus was pressed"),
	COLUMN(blade.depth_mm, SINGLE, 4, "depth_mm", "mm",
	       "of the tip below the surface"),
	COLUMN(blade.depth_u_mm, COARSE, 4, "depth_u_mm", "mm",
	       "standard uncertainty from noise and time"),
	COLUMN(blade.velocity_mm_s, SINGLE, 3, "velocity_mm_s", "mm/s",
	       "speed of the tip, smoothed"),
	COLUMN(force.force_N, SINGLE, 5, "force_N", "N", "on the blade"),
	COLUMN(force.u_N, COARSE, 6, "force_u_N", "N",
	       "standard uncertainty of force_N from noise"),
	COLUMN(force.clipped, FLAG, 0, "clipped", "1", "1: the converter was at an end"),
	COLUMN(blade.interpolated, FLAG, 0, "interpolated", "1",
	       "1: a tracker record is missing here"),
	COLUMN(blade.error, FLAG, 0, "tracker_error", "1",
	       "1: the tracker reported an error"),
	COLUMN(blade.advancing, FLAG, 0, INCISE_ADVANCING_COLUMN),
	COLUMN(blade.acceleration_mm_s2, SINGLE, 1, INCISE_ACCELERATION_COLUMN),
	COLUMN(blade.tilt_deg, SINGLE, 2, INCISE_TILT_COLUMN),
	COLUMN(blade.time_in_tissue_s, SINGLE, 4, INCISE_TIME_COLUMN),
	COLUMN(blade.mean_speed_mm_s, SINGLE, 3, INCISE_MEAN_SPEED_COLUMN),
	COLUMN(blade.deepest_mm, SINGLE, 4, INCISE_DEEPEST_COLUMN),
	COLUMN(camera.depth_mm, SINGLE, 4, "camera_depth_mm", "mm",
	       "depth from the frames"),
	COLUMN(camera.sd_mm, COARSE, 4, "camera_depth_sd_mm", "mm",
	       "standard deviation of the edge in the frames"),
	COLUMN(camera.u_mm, COARSE, 4, "camera_depth_u_mm", "mm",
	       "standard uncertainty from the edge and time"),
	COLUMN(camera.quality, SINGLE, 3, "quality", "1",
	       "quality of the frames, 0 to 1"),
	COLUMN(camera.low_quality, FLAG, 0, "low_quality", "1",
	       "1: below 0.5 in a frame, or not detected"),
};

/* A hundred days: longer than any session; a grid over forged times would not end. */
#define SPAN_MAX_NS 1e16
/* Depths of less say little of a scale. */
#define COMPARED_LEAST_MM 3.0

/* The present recording. */
struct resample {
	struct incise_export_pass *pass;
	struct incise_force_interpolator force;
	struct incise_blade_pose blade;
	struct incise_camera_interpolator camera;
	double t_sd_s; /* of times of force */

	const struct incise_budget *budget; /* or NULL */
	bool has_force;
	int64_t name, first_ns;
	int64_t from_ns, to_ns; /* of rows, from the first sample */
	int64_t begin_ns;	/* of what is read */
	int cut;		/* of the last row in one */
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
	struct incise_export_report *report = &r->pass->report;

	report->camera_ratio = report->camera_off_mm = NAN;
	if (!(n > 100) || span_mm < COMPARED_LEAST_MM)
		return;
	report->camera_ratio = (r->compared.both - mean_mm * r->compared.camera) /
			       (r->compared.depth2 - mean_mm * r->compared.depth);
	report->camera_off_mm = fabs(report->camera_ratio - 1) * span_mm;
}

static double least_resample(double a, double b)
{
	return isnan(b) ? a : fmax(a, b);
}

/* Find the uncertainties of a row. */
static void find_uncertainties(const struct resample *r, int64_t t_ns,
			       struct resample_row *to)
{
	struct incise_budget_row row = {
		.force_N = to->force.force_N,
		.force_share = to->force.share,
		.smoothed = true,
		.tracker_time = !r->has_force,
	};
	double part[INCISE_BUDGET_PARTS];

	incise_blade_pose_budget(&r->blade, t_ns, &to->blade, &row);
	incise_budget_row(r->budget, &row, part);
	incise_extra_budget(&to->extra, part);
}

/* Count a row in the report. */
static void report_row(struct resample *r, const struct resample_row *row)
{
	struct incise_export_report *report = &r->pass->report;

	if (r->pass->camera)
		compare_depths(r, row->blade.depth_mm, row->camera.depth_mm);
	report->cuts += row->blade.cut && row->blade.cut != r->cut;
	r->cut = row->blade.cut ? (int)row->blade.cut : r->cut;
	report->clipped += row->force.clipped;
	report->depth_max_mm = least_resample(report->depth_max_mm, row->blade.depth_mm);
	report->velocity_max_mm_s =
		least_resample(report->velocity_max_mm_s, row->blade.velocity_mm_s);
	report->rows++;
}

static int put_row(struct resample *r, int64_t t_ns,
		   const struct incise_force_value *force)
{
	struct incise_export_pass *pass = r->pass;
	struct resample_row row = {
		.recording = r->name,
		.t_s = (double)(t_ns - r->first_ns) * 1e-9,
		.force = *force,
	};
	int rc = incise_blade_pose_at(&r->blade, t_ns, r->t_sd_s, &row.blade, r->err);

	if (!rc && pass->camera)
		rc = incise_camera_interpolator_at(&r->camera, t_ns, r->t_sd_s,
						   &row.camera, r->err);
	/* Rows before the range count its cuts. */
	if (rc || t_ns - r->first_ns < r->from_ns)
		return rc;
	if (r->budget)
		find_uncertainties(r, t_ns, &row);
	rc = incise_extra_tai(&row.extra, pass->wall, t_ns, r->err);
	if (!rc)
		rc = incise_table_add(pass->table, &row, r->err);
	report_row(r, &row);
	if (!rc && (pass->report.rows & 0xfff) == 0)
		rc = incise_export_progress(pass, pass->samples + r->force.rows.n,
					    pass->samples_all);
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
	double row_ns = 1e9 / r->pass->options->rate_hz;
	bool drops = r->pass->options->rate_hz < force_hz;
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
	const struct incise_calibration *given = r->pass->options->calibration;
	const struct incise_force_value none = {.force_N = NAN, .u_N = NAN, .share = NAN};
	struct incise_rows rows;
	int64_t last_ns;
	int rc;

	if (!(r->pass->options->rate_hz > 0))
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
	for (int64_t k = first_row(r, 1e9 / r->pass->options->rate_hz); rc >= 0; k++) {
		int64_t t_ns = r->first_ns + llround(k * 1e9 / r->pass->options->rate_hz);

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
	if (!(r->pass->options->rate_hz > 0))
		return on_force(r);
	return on_grid(r, span_ns > 0 ? (recording->meta.force - 1) * 1e9 / span_ns : 1);
}

static int resample_recording(struct incise_export_pass *pass,
			      struct incise_recording *recording)
{
	const struct incise_calibration *given = pass->options->calibration;
	const struct incise_recording_range *range = &recording->range;
	struct resample r = {
		.pass = pass,
		.budget = pass->budgets ? pass->budgets[pass->recording] : NULL,
		.has_force = incise_recording_has_force(recording),
		.name = incise_table_name(pass->table, pass->name),
		.begin_ns = range->limited ? range->begin_ns : 0,
		.from_ns = range->limited ? range->from_ns : 0,
		.to_ns = range->limited ? range->to_ns : INT64_MAX,
		.err = pass->err,
	};
	int rc = 0;

	if (r.name < 0)
		return incise_error_set(pass->err, ENOMEM, "out of memory");
	if (r.has_force)
		rc = incise_force_interpolator_open(&r.force, recording, given, r.err);
	if (!rc)
		rc = incise_blade_pose_open(&r.blade, recording, given, r.err);
	if (!rc)
		rc = incise_camera_interpolator_open(&r.camera, recording, given, r.err);
	if (!rc && !r.has_force)
		rc = on_poses(&r, recording);
	else if (!rc && r.force.n)
		rc = on_samples(&r, recording);
	report_camera(&r);
	incise_force_interpolator_close(&r.force);
	incise_blade_pose_close(&r.blade);
	incise_camera_interpolator_close(&r.camera);
	pass->samples += recording->meta.force;
	return rc;
}

static int write_resampled(struct incise_export_pass *pass)
{
	int rc = incise_export_each(pass, resample_recording);

	return rc ? rc : incise_export_check_part(pass);
}

const struct incise_row_kind incise_resample = {columns,
						sizeof(columns) / sizeof(*columns),
						offsetof(struct resample_row, extra),
						write_resampled};
