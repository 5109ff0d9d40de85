// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Where the blade was; see blade.h.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include "../../base/vector.h"
#include "blade.h"

/* Below this a series is closer than 1e-10, and quicker than sines. */
#define SMALL_ANGLE 0.1

static double dot4(const double a[4], const double b[4])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

/* From the device's tip to that of the blade; where they are the same, not a bit moves. */
static void go_to_tip(const struct incise_blade *blade, const double q[4],
		      double position_mm[3])
{
	const double *tip_mm = blade->tip_mm;
	double arm_mm[3];

	if (tip_mm[0] == 0 && tip_mm[1] == 0 && tip_mm[2] == 0)
		return;
	v3_rotate(arm_mm, q, tip_mm);
	v3_add(position_mm, position_mm, 1, arm_mm);
}

/* What is the same for all rows between two poses. */
static void between(struct incise_blade *blade)
{
	const struct incise_blade_pose *a = &blade->pose[0], *b = &blade->pose[1];
	double dot = dot4(a->q, b->q), sum = 0;

	blade->sign = dot < 0 ? -1 : 1;
	blade->angle = acos(fmin(fabs(dot), 1));
	blade->sine = sin(blade->angle);
	for (int i = 0; i < 3; i++)
		sum += pow(b->position_mm[i] - a->position_mm[i], 2);
	blade->speed_mm_s = sqrt(sum) / ((double)(b->t_ns - a->t_ns) * 1e-9);
}

static int more_pose(struct incise_blade *blade, struct incise_error *err)
{
	sqlite3_stmt *stmt = blade->tracker.stmt;
	int rc = incise_rows_next(&blade->tracker, err);
	struct incise_blade_pose *pose = &blade->pose[1];
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

/* One more row goes into the smoother; 0 at the end. */
static int feed(struct incise_blade *blade, struct incise_error *err)
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

static int more_depth(struct incise_blade *blade, struct incise_error *err)
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
		record = incise_smooth_take(&blade->smooth); /* of the end */
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

int incise_blade_open(struct incise_blade *blade, struct incise_recording *recording,
		      const struct incise_calibration *given, struct incise_error *err)
{
	double rate_hz;
	int rc = incise_recording_number(recording, "tracker_hz", &rate_hz, err);

	*blade = (struct incise_blade){0};
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
	/* Its own velocity was told from few records; the smoother takes positions. */
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

void incise_blade_close(struct incise_blade *blade)
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
static void slerp(const struct incise_blade *blade, double s, double to[4])
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

/* Two values with this noise, on the line between them, and what time does. */
static double uncertainty(double noise, double share, double time_s, double speed)
{
	double line = (1 - share) * (1 - share) + share * share;

	return sqrt(noise * noise * line + time_s * time_s * speed * speed);
}

static double mix(double a, double b, double share)
{
	return a + share * (b - a);
}

int incise_blade_at(struct incise_blade *blade, int64_t t_ns, double t_sd_s,
		    struct incise_blade_value *value, struct incise_error *err)
{
	const struct incise_blade_pose *a = &blade->pose[0], *b = &blade->pose[1];
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
