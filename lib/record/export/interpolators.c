// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Values of streams at the time of a row; see interpolators.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../../base/vector.h"
#include "../schema.h"
#include "interpolators.h"

/* --- force --------------------------------------------------------------------------- */

#define HALF INCISE_FORCE_HALF
#define CELLS 2048 /* of the tabulated weights, per row */
#define STEPS (HALF * CELLS)

double incise_force_weight(double rows)
{
	double x = M_PI * rows / HALF, sinc = 2 * M_PI / 3 * rows;

	if (!(fabs(rows) < HALF))
		return 0;
	sinc = fabs(sinc) < 1e-9 ? 1 : sin(sinc) / sinc;
	return sinc * (0.42 + 0.5 * cos(x) + 0.08 * cos(2 * x));
}

/* Find the last time of the table, which is the end of a grid. */
static int find_last(struct incise_force_interpolator *force, struct incise_error *err)
{
	struct incise_recording *recording = force->rows.recording;
	struct incise_row_times times = force->rows.times; /* as before the first row */
	sqlite3_stmt *stmt = NULL;
	bool found = sqlite3_prepare_v2(recording->db,
					"SELECT seq, t_ns FROM force ORDER BY seq DESC "
					"LIMIT 1",
					-1, &stmt, NULL) == SQLITE_OK &&
		     sqlite3_step(stmt) == SQLITE_ROW;

	if (found &&
	    !incise_row_times_next(&times, sqlite3_column_int64(stmt, 0),
				   sqlite3_column_int64(stmt, 1), &force->last_ns))
		force->last_ns =
			INCISE_TIME_NONE; /* reading the rows reports the damage */
	sqlite3_finalize(stmt);
	return found ? 0
		     : incise_error_set(err, ENODATA, "%s: there is no force sample",
					recording->path);
}

int incise_force_interpolator_open(struct incise_force_interpolator *force,
				   struct incise_recording *recording,
				   const struct incise_calibration *given,
				   struct incise_error *err)
{
	int rc;

	*force = (struct incise_force_interpolator){0};
	incise_recording_force(recording, given, &force->scale);
	rc = incise_recording_need_zero(recording, &force->scale, err);
	if (rc)
		return rc;
	force->weights = malloc((STEPS + 2) * sizeof(*force->weights));
	if (!force->weights)
		return incise_error_set(err, ENOMEM, "out of memory");
	for (int i = 0; i < STEPS + 2; i++)
		force->weights[i] = incise_force_weight((double)i / CELLS);
	rc = incise_rows_open(&force->rows, recording, "force", "seq, t_ns, code", "iii",
			      recording->meta.force, err);
	if (!rc && given)
		incise_rows_calibrate(&force->rows, given);
	if (!rc)
		rc = find_last(force, err);
	if (!rc)
		rc = incise_force_interpolator_more(force, err);
	return rc < 0 ? rc : 0;
}

void incise_force_interpolator_close(struct incise_force_interpolator *force)
{
	incise_rows_close(&force->rows);
	free(force->samples);
	free(force->weights);
}

int incise_force_interpolator_more(struct incise_force_interpolator *force,
				   struct incise_error *err)
{
	int rc = incise_rows_next(&force->rows, err);
	int64_t code;

	if (rc <= 0)
		return rc;
	if (force->n == force->capacity) {
		size_t capacity = force->capacity ? 2 * force->capacity : 1024;
		struct incise_force_code *samples =
			realloc(force->samples, capacity * sizeof(*samples));

		if (!samples)
			return incise_error_set(err, ENOMEM, "out of memory");
		force->samples = samples;
		force->capacity = capacity;
	}
	code = sqlite3_column_int64(force->rows.stmt, 2);
	if (code < 0 || code > force->scale.top)
		return incise_error_set(err, EINVAL,
					"%s: damaged: table force, row %lld: code is "
					"out of the converter's range",
					force->rows.recording->path,
					(long long)sqlite3_column_int64(force->rows.stmt,
									0));
	force->samples[force->n++] = (struct incise_force_code){force->rows.t_ns, code};
	return 1;
}

size_t incise_force_interpolator_forget(struct incise_force_interpolator *force, size_t n)
{
	if (n < force->n / 2 && n < 4096)
		return 0;
	memmove(force->samples, force->samples + n,
		(force->n - n) * sizeof(*force->samples));
	force->n -= n;
	return n;
}

static bool clipped(const struct incise_force_interpolator *force, size_t at)
{
	return force->samples[at].code == 0 ||
	       force->samples[at].code == force->scale.top;
}

/*
 * Noise of single samples, from their differences: slow changes are no noise. It is not less
 * than that of the code's last digit.
 */
static double noise(const struct incise_force_interpolator *force, size_t from, size_t to)
{
	double sum = 0;

	for (size_t i = from + 1; i < to; i++) {
		double step = force->samples[i].code - (double)force->samples[i - 1].code;

		sum += step * step;
	}
	return fabs(force->scale.n_per_code) *
	       sqrt((to > from + 1 ? sum / (to - from - 1) / 2 : 0) + 1 / 12.);
}

void incise_force_interpolator_sample(const struct incise_force_interpolator *force,
				      size_t at, struct incise_force_value *value)
{
	*value = (struct incise_force_value){
		force->samples[at].code * force->scale.n_per_code - force->scale.zero_N,
		noise(force, at > HALF ? at - HALF : 0,
		      at + HALF < force->n ? at + HALF + 1 : force->n),
		clipped(force, at)};
}

void incise_force_interpolator_filter(const struct incise_force_interpolator *force,
				      int64_t t_ns, double row_ns,
				      struct incise_force_value *value)
{
	double sum = 0, squares = 0, code = 0, share;
	bool any = false;

	*value = (struct incise_force_value){NAN, NAN, false};
	for (size_t i = 0; i < force->n; i++) {
		double rows = fabs((force->samples[i].t_ns - t_ns) / row_ns);
		double at = rows * CELLS, w;
		int cell = (int)at;

		if (rows >= HALF)
			continue;
		w = force->weights[cell] +
		    (at - cell) * (force->weights[cell + 1] - force->weights[cell]);
		sum += w;
		squares += w * w;
		code += w * force->samples[i].code;
		any = any || rows <= 0.5;
		value->clipped = value->clipped || (rows <= 1 && clipped(force, i));
	}
	if (!any)
		return;
	share = sqrt(squares) / fabs(sum);
	value->force_N = code / sum * force->scale.n_per_code - force->scale.zero_N;
	value->u_N = noise(force, 0, force->n) * share;
}

void incise_force_interpolator_line(const struct incise_force_interpolator *force,
				    int64_t t_ns, struct incise_force_value *value)
{
	const struct incise_force_code *a, *b;
	size_t i = 0;
	double s;

	*value = (struct incise_force_value){NAN, NAN, false};
	while (i + 2 < force->n && force->samples[i + 1].t_ns <= t_ns)
		i++;
	if (i + 1 >= force->n)
		return;
	a = &force->samples[i];
	b = a + 1;
	s = incise_row_share(a->t_ns, b->t_ns, t_ns);
	value->force_N =
		(a->code + s * (b->code - (double)a->code)) * force->scale.n_per_code -
		force->scale.zero_N;
	value->u_N = noise(force, 0, force->n) * sqrt((1 - s) * (1 - s) + s * s);
	value->clipped = clipped(force, i) || clipped(force, i + 1);
}

/* --- pose of the blade --------------------------------------------------------------- */

/* Below this angle a series has an error under 1e-10 and is faster than sines. */
#define SMALL_ANGLE 0.1

static double dot4(const double a[4], const double b[4])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

/* Move from the device's tip to that of the blade; without a change of bits if it is the same. */
static void go_to_tip(const struct incise_blade_pose *blade, const double q[4],
		      double position_mm[3])
{
	const double *tip_mm = blade->tip_mm;
	double arm_mm[3];

	if (tip_mm[0] == 0 && tip_mm[1] == 0 && tip_mm[2] == 0)
		return;
	v3_rotate(arm_mm, q, tip_mm);
	v3_add(position_mm, position_mm, 1, arm_mm);
}

/* Compute the values that are the same for all rows between two poses. */
static void between(struct incise_blade_pose *blade)
{
	const struct incise_blade_record *a = &blade->pose[0], *b = &blade->pose[1];
	double dot = dot4(a->q, b->q), sum = 0;

	blade->sign = dot < 0 ? -1 : 1;
	blade->angle = acos(fmin(fabs(dot), 1));
	blade->sine = sin(blade->angle);
	for (int i = 0; i < 3; i++)
		sum += pow(b->position_mm[i] - a->position_mm[i], 2);
	blade->speed_mm_s = sqrt(sum) / ((double)(b->t_ns - a->t_ns) * 1e-9);
}

static int more_pose(struct incise_blade_pose *blade, struct incise_error *err)
{
	sqlite3_stmt *stmt = blade->tracker.stmt;
	int rc = incise_rows_next(&blade->tracker, err);
	struct incise_blade_record *pose = &blade->pose[1];
	const char *status;
	double norm;

	blade->pose[0] = *pose;
	pose->t_ns = INCISE_TIME_NONE;
	if (rc <= 0)
		return rc;
	pose->seq = sqlite3_column_int64(stmt, 0);
	pose->t_ns = blade->tracker.t_ns;
	for (int i = 0; i < 3; i++)
		pose->position_mm[i] = sqlite3_column_double(stmt, 2 + i);
	for (int i = 0; i < 4; i++)
		pose->q[i] = sqlite3_column_double(stmt, 5 + i);
	norm = sqrt(dot4(pose->q, pose->q));
	for (int i = 0; i < 4; i++)
		pose->q[i] = norm > 0 ? pose->q[i] / norm : NAN;
	go_to_tip(blade, pose->q, pose->position_mm);
	status = (const char *)sqlite3_column_text(stmt, 9);
	pose->error = status[strspn(status, " ")] != 0;
	pose->station = sqlite3_column_int(stmt, 10);
	pose->button = sqlite3_column_int(stmt, 11) != 0;
	if (blade->pose[0].t_ns != INCISE_TIME_NONE)
		between(blade);
	return 1;
}

/* Add a row to the smoother; 0 at the end. */
static int feed(struct incise_blade_pose *blade, struct incise_error *err)
{
	sqlite3_stmt *stmt = blade->depth.stmt;
	int rc = incise_rows_next(&blade->depth, err);
	struct incise_smooth_record record;
	double q[4];

	if (rc < 0)
		return rc;
	if (!rc) {
		incise_smooth_end(&blade->smooth);
		return 0;
	}
	record = (struct incise_smooth_record){
		.seq = sqlite3_column_int64(stmt, 0),
		.t_ns = blade->depth.t_ns,
		.depth_mm = sqlite3_column_double(stmt, 2),
	};
	for (int i = 0; i < 3; i++)
		record.position_mm[i] = sqlite3_column_double(stmt, 3 + i);
	for (int i = 0; i < 4; i++)
		q[i] = sqlite3_column_double(stmt, 6 + i);
	go_to_tip(blade, q, record.position_mm);
	record.t_sd_s = incise_row_times_sd(&blade->depth.times, record.seq);
	incise_smooth_push(&blade->smooth, &record);
	return 1;
}

static int more_depth(struct incise_blade_pose *blade, struct incise_error *err)
{
	const struct incise_smooth_record *record;
	struct incise_blade_depth *deep = blade->deep;
	int rc = 1;

	while (!(record = incise_smooth_take(&blade->smooth)) && rc > 0 && !blade->ended)
		rc = feed(blade, err);
	blade->ended = blade->ended || !rc;
	if (rc < 0)
		return rc;
	if (!record)
		record = incise_smooth_take(&blade->smooth); /* after the end */
	deep[0] = deep[1];
	deep[1].t_ns = INCISE_TIME_NONE;
	if (!record)
		return 0;
	deep[1] = (struct incise_blade_depth){
		record->t_ns,
		record->depth_mm,
		sqrt(record->velocity_mm_s[0] * record->velocity_mm_s[0] +
		     record->velocity_mm_s[1] * record->velocity_mm_s[1] +
		     record->velocity_mm_s[2] * record->velocity_mm_s[2]),
		record->noise_mm,
		record->depth_noise_mm,
		record->t_sd_s,
	};
	if (deep[0].t_ns != INCISE_TIME_NONE)
		blade->rate_mm_s = (deep[1].depth_mm - deep[0].depth_mm) /
				   ((double)(deep[1].t_ns - deep[0].t_ns) * 1e-9);
	return 1;
}

int incise_blade_pose_open(struct incise_blade_pose *blade,
			   struct incise_recording *recording,
			   const struct incise_calibration *given,
			   struct incise_error *err)
{
	double rate_hz;
	int rc = incise_recording_number(recording, "tracker_hz", &rate_hz, err);

	*blade = (struct incise_blade_pose){0};
	memcpy(blade->tip_mm, recording->meta.tip_mm, sizeof(blade->tip_mm));
	for (int i = 0; i < 2; i++)
		blade->pose[i].t_ns = blade->deep[i].t_ns = INCISE_TIME_NONE;
	if (rc)
		return rc;
	/* The gains of the loop's filter are made for the nominal rate. */
	if (incise_smooth_init(&blade->smooth, rate_hz > 0 ? rate_hz : 120))
		return incise_error_set(err, ENOMEM, "out of memory");
	rc = incise_rows_open(&blade->tracker, recording, "tracker",
			      recording->form < 2
				      ? "seq, t_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz, "
					"status, 0, 0"
				      : "seq, t_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz, "
					"status, station, button",
			      "iirrrrrrrtii", recording->meta.tracker, err);
	/* Without the table's velocity, which is from few records: the smoother uses positions. */
	if (!rc)
		rc = incise_rows_open_joined(
			&blade->depth, recording, "depth", "tracker",
			"depth.seq, depth.t_ns, depth_mm, x_mm, y_mm, z_mm, qw, qx, qy, qz",
			"iirrrrrrrr", recording->meta.depth, err);
	if (!rc && given) {
		incise_rows_calibrate(&blade->tracker, given);
		incise_rows_calibrate(&blade->depth, given);
	}
	if (!rc)
		rc = more_pose(blade, err);
	if (rc >= 0)
		rc = more_depth(blade, err);
	return rc < 0 ? rc : 0;
}

void incise_blade_pose_close(struct incise_blade_pose *blade)
{
	incise_rows_close(&blade->tracker);
	incise_rows_close(&blade->depth);
	incise_smooth_free(&blade->smooth);
}

/* sin x / x */
static double sinc(double x2)
{
	return 1 - x2 / 6 * (1 - x2 / 20);
}

/* On the shorter arc between the poses (K. Shoemake: Animating Rotation with Quaternion
 * Curves, 1985). */
static void slerp(const struct incise_blade_pose *blade, double s, double to[4])
{
	const double *a = blade->pose[0].q, *b = blade->pose[1].q;
	double angle = blade->angle, wa, wb;

	if (angle > SMALL_ANGLE) {
		wa = sin((1 - s) * angle) / blade->sine;
		wb = sin(s * angle) / blade->sine;
	} else {
		double a2 = angle * angle, all = sinc(a2);

		wa = (1 - s) * sinc((1 - s) * (1 - s) * a2) / all;
		wb = s * sinc(s * s * a2) / all;
	}
	wb *= blade->sign;
	for (int i = 0; i < 4; i++)
		to[i] = wa * a[i] + wb * b[i];
}

/* Of the line between two values with this noise, and of the time at this speed. */
static double uncertainty(double noise, double share, double time_s, double speed)
{
	double line = (1 - share) * (1 - share) + share * share;

	return sqrt(noise * noise * line + time_s * time_s * speed * speed);
}

static double mix(double a, double b, double share)
{
	return a + share * (b - a);
}

int incise_blade_pose_at(struct incise_blade_pose *blade, int64_t t_ns, double t_sd_s,
			 struct incise_blade_pose_value *value, struct incise_error *err)
{
	const struct incise_blade_record *a = &blade->pose[0], *b = &blade->pose[1];
	const struct incise_blade_depth *c = &blade->deep[0], *d = &blade->deep[1];
	double s, e, time_s;
	int rc = 0;

	while (rc >= 0 && b->t_ns != INCISE_TIME_NONE && b->t_ns <= t_ns)
		rc = more_pose(blade, err);
	while (rc >= 0 && d->t_ns != INCISE_TIME_NONE && d->t_ns <= t_ns)
		rc = more_depth(blade, err);
	if (rc < 0)
		return rc;
	s = incise_row_share(a->t_ns, b->t_ns, t_ns);
	e = incise_row_share(c->t_ns, d->t_ns, t_ns);
	time_s = sqrt(d->t_sd_s * d->t_sd_s + t_sd_s * t_sd_s);
	for (int i = 0; i < 3; i++)
		value->position_mm[i] = mix(a->position_mm[i], b->position_mm[i], s);
	slerp(blade, s, value->q);
	value->depth_mm = mix(c->depth_mm, d->depth_mm, e);
	value->velocity_mm_s = mix(c->velocity_mm_s, d->velocity_mm_s, e);
	value->position_u_mm = uncertainty(mix(c->noise_mm, d->noise_mm, e), s, time_s,
					   blade->speed_mm_s);
	value->depth_u_mm = uncertainty(mix(c->depth_noise_mm, d->depth_noise_mm, e), e,
					time_s, blade->rate_mm_s);
	value->cut = !isnan(e) && incise_cut_step(&blade->cut, value->depth_mm)
			     ? blade->cut.count
			     : 0;
	value->station = isnan(s) ? 0 : a->station;
	value->button = !isnan(s) && a->button;
	value->interpolated = isnan(s) || b->seq - a->seq != 1;
	value->error = !isnan(s) && (a->error || b->error);
	return 0;
}

/* --- camera -------------------------------------------------------------------------- */

int incise_camera_interpolator_any(struct incise_recording *recording,
				   struct incise_error *err)
{
	sqlite3_stmt *stmt = NULL;
	int rc;

	if (recording->form < 2)
		return 0;
	if (sqlite3_prepare_v2(recording->db, "SELECT 1 FROM frames LIMIT 1", -1, &stmt,
			       NULL) != SQLITE_OK)
		return incise_schema_fail(recording->db, recording->path, err);
	rc = sqlite3_step(stmt);
	if (rc != SQLITE_ROW && rc != SQLITE_DONE)
		rc = incise_schema_fail(recording->db, recording->path, err);
	else
		rc = rc == SQLITE_ROW;
	sqlite3_finalize(stmt);
	return rc;
}

static double column(sqlite3_stmt *stmt, int i)
{
	return sqlite3_column_type(stmt, i) == SQLITE_NULL
		       ? NAN
		       : sqlite3_column_double(stmt, i);
}

static int more(struct incise_camera_interpolator *camera, struct incise_error *err)
{
	sqlite3_stmt *stmt = camera->rows.stmt;
	int rc = incise_rows_next(&camera->rows, err);

	camera->frame[0] = camera->frame[1];
	camera->frame[1].t_ns = INCISE_TIME_NONE;
	if (rc <= 0)
		return rc;
	camera->frame[1] = (struct incise_camera_depth){
		camera->rows.t_ns,
		column(stmt, 2) * camera->scale,
		column(stmt, 3) * camera->mm_px,
		column(stmt, 4),
		incise_row_times_sd(&camera->rows.times, sqlite3_column_int64(stmt, 0)),
	};
	return 1;
}

int incise_camera_interpolator_open(struct incise_camera_interpolator *camera,
				    struct incise_recording *recording,
				    const struct incise_calibration *given,
				    struct incise_error *err)
{
	double own = recording->meta.depth_mm_px;
	int rc;

	*camera = (struct incise_camera_interpolator){
		.mm_px = given ? given->depth_mm_px : own,
		/* Depth is a difference of two lengths in pixels: linear in the scale. */
		.scale = given ? given->depth_mm_px / own : 1,
	};
	camera->frame[0].t_ns = camera->frame[1].t_ns = INCISE_TIME_NONE;
	rc = incise_camera_interpolator_any(recording, err);
	if (rc <= 0)
		return rc;
	rc = incise_rows_open(&camera->rows, recording, "frames",
			      "seq, t_ns, depth_mm, sd_px, quality", "iinnn", UINT64_MAX,
			      err);
	if (!rc && given)
		incise_rows_calibrate(&camera->rows, given);
	if (!rc)
		rc = more(camera, err);
	return rc < 0 ? rc : 0;
}

void incise_camera_interpolator_close(struct incise_camera_interpolator *camera)
{
	incise_rows_close(&camera->rows);
}

static bool low(const struct incise_camera_depth *frame)
{
	return !(frame->quality >= INCISE_CAMERA_LOW_QUALITY);
}

int incise_camera_interpolator_at(struct incise_camera_interpolator *camera, int64_t t_ns,
				  double t_sd_s, struct incise_camera_value *value,
				  struct incise_error *err)
{
	const struct incise_camera_depth *a = &camera->frame[0], *b = &camera->frame[1];
	double s, slope, line, time;
	int rc = 1;

	*value = (struct incise_camera_value){NAN, NAN, NAN, NAN, true};
	while (rc > 0 && b->t_ns != INCISE_TIME_NONE && b->t_ns <= t_ns)
		rc = more(camera, err);
	if (rc < 0)
		return rc;
	s = incise_row_share(a->t_ns, b->t_ns, t_ns);
	if (isnan(s) || isnan(a->depth_mm) || isnan(b->depth_mm))
		return 0;
	slope = (b->depth_mm - a->depth_mm) / ((double)(b->t_ns - a->t_ns) * 1e-9);
	line = (1 - s) * (1 - s) * a->sd_mm * a->sd_mm + s * s * b->sd_mm * b->sd_mm;
	time = (b->t_sd_s * b->t_sd_s + t_sd_s * t_sd_s) * slope * slope;
	value->depth_mm = a->depth_mm + s * (b->depth_mm - a->depth_mm);
	value->sd_mm = sqrt(line);
	value->u_mm = sqrt(line + time);
	value->quality = a->quality + s * (b->quality - a->quality);
	value->low_quality = low(a) || low(b);
	return 0;
}
