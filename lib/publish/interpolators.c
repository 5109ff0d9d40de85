// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Values of streams at the time of a row; see interpolators.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/tracker.h>
#include <incise/uncertainty.h>
#include "../base/grow.h"
#include "../base/vector.h"
#include "../tissue/tick.h"
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

int incise_rows_last(const struct incise_rows *rows, int64_t *last_ns,
		     struct incise_error *err)
{
	struct incise_recording *recording = rows->recording;
	struct incise_row_times times = rows->times; /* as before the first row */
	int64_t seq, t_ns;
	int rc = incise_source_end(recording, rows->table, true, &seq, &t_ns, NULL, err);

	if (!rc)
		return incise_error_set(err, ENODATA,
					"%s: has no %s sample; leave it out",
					recording->path, rows->table);
	if (rc > 0 && !incise_row_times_next(&times, seq, t_ns, last_ns))
		*last_ns = INCISE_TIME_NONE; /* reading the rows reports the damage */
	return rc < 0 ? rc : 0;
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
	rc = incise_rows_open(&force->rows, recording, "force", "seq, t_ns, code",
			      recording->meta.force, err);
	if (!rc && given)
		incise_row_times_calibrate(&force->rows.times, given);
	if (!rc)
		rc = incise_rows_first(&force->rows, &force->first_ns, err);
	if (!rc)
		rc = incise_rows_last(&force->rows, &force->last_ns, err);
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
	if (!grow_array(&force->samples, force->n, &force->capacity, 1024,
			sizeof(*force->samples)))
		return incise_error_set(err, ENOMEM, "out of memory");
	code = incise_rows_int(&force->rows, 2);
	if (code < 0 || code > force->scale.top)
		return incise_error_set(err, EINVAL,
					"%s: damaged: table force, row %lld: code is "
					"out of the converter's range",
					force->rows.recording->path,
					(long long)incise_rows_seq(&force->rows));
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
		clipped(force, at), 1};
}

void incise_force_interpolator_filter(const struct incise_force_interpolator *force,
				      int64_t t_ns, double row_ns,
				      struct incise_force_value *value)
{
	double sum = 0, squares = 0, code = 0;
	bool any = false;

	*value = (struct incise_force_value){NAN, NAN, false, NAN};
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
	value->share = sqrt(squares) / fabs(sum);
	value->force_N = code / sum * force->scale.n_per_code - force->scale.zero_N;
	value->u_N = noise(force, 0, force->n) * value->share;
}

void incise_force_interpolator_line(const struct incise_force_interpolator *force,
				    int64_t t_ns, struct incise_force_value *value)
{
	const struct incise_force_code *a, *b;
	size_t i = 0;
	double s;

	*value = (struct incise_force_value){NAN, NAN, false, NAN};
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
	value->share = sqrt((1 - s) * (1 - s) + s * s);
	value->u_N = noise(force, 0, force->n) * value->share;
	value->clipped = clipped(force, i) || clipped(force, i + 1);
}

/* --- pose of the blade --------------------------------------------------------------- */

/* Below this angle a series has an error under 1e-10 and is faster than sines. */
#define SMALL_ANGLE 0.1

static double dot4(const double a[4], const double b[4])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
}

void incise_go_to_tip(const double tip_mm[3], const double q[4], double position_mm[3])
{
	double arm_mm[3];

	if (tip_mm[0] == 0 && tip_mm[1] == 0 && tip_mm[2] == 0)
		return;
	v3_rotate(arm_mm, q, tip_mm);
	v3_add(position_mm, position_mm, 1, arm_mm);
}

/* Compute the values that are the same for all rows between two poses. */
static void between_interpolators(struct incise_blade_pose *blade)
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
	const struct incise_rows *rows = &blade->tracker;
	int rc = incise_rows_next(&blade->tracker, err);
	struct incise_blade_record *pose = &blade->pose[1];
	double norm;

	blade->pose[0] = *pose;
	pose->t_ns = INCISE_TIME_NONE;
	if (rc <= 0)
		return rc;
	pose->seq = incise_rows_seq(rows);
	pose->t_ns = rows->t_ns;
	for (int i = 0; i < 3; i++)
		pose->position_mm[i] = incise_rows_real(rows, 2 + i);
	for (int i = 0; i < 4; i++)
		pose->q[i] = incise_rows_real(rows, 5 + i);
	norm = sqrt(dot4(pose->q, pose->q));
	for (int i = 0; i < 4; i++)
		pose->q[i] = norm > 0 ? pose->q[i] / norm : NAN;
	incise_go_to_tip(blade->tip_mm, pose->q, pose->position_mm);
	pose->error = !incise_pose_usable(incise_rows_char(rows, 9));
	pose->station = (int)incise_rows_int(rows, 10);
	pose->button = incise_rows_int(rows, 11) != 0;
	if (blade->pose[0].t_ns != INCISE_TIME_NONE)
		between_interpolators(blade);
	return 1;
}

/* Add a row to the smoother; 0 at the end. */
static int feed_interpolators(struct incise_blade_pose *blade, struct incise_error *err)
{
	const struct incise_rows *rows = &blade->depth;
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
		.seq = incise_rows_seq(rows),
		.t_ns = rows->t_ns,
		.depth_mm = incise_rows_real(rows, 2),
	};
	for (int i = 0; i < 3; i++)
		record.position_mm[i] = incise_rows_real(rows, 3 + i);
	for (int i = 0; i < 4; i++)
		q[i] = incise_rows_real(rows, 6 + i);
	incise_go_to_tip(blade->tip_mm, q, record.position_mm);
	record.t_sd_s = incise_row_times_sd(&rows->times, record.seq);
	incise_smooth_push(&blade->smooth, &record);
	return 1;
}

/* The filter needs positive times; rows' are within ±2^61. */
static int64_t loop_ns(int64_t t_ns)
{
	return t_ns + (1LL << 62);
}

static void arrive(struct incise_loop_motion *loop)
{
	incise_predict_add(&loop->predict,
			   &loop->waiting[loop->first++ % INCISE_LOOP_POSES]);
}

static void loop_push(struct incise_loop_motion *loop,
		      const struct incise_smooth_record *record)
{
	struct incise_tracker_sample *sample;

	if (loop->last - loop->first == INCISE_LOOP_POSES)
		arrive(loop);
	sample = &loop->waiting[loop->last++ % INCISE_LOOP_POSES];
	*sample = (struct incise_tracker_sample){
		.t_ns = loop_ns(record->t_ns) + loop->late_ns,
		.quaternion = {1},
	};
	v3_copy(sample->position_mm, record->position_mm);
}

/* The acceleration that the loop would find at this time. */
static double loop_acceleration(struct incise_loop_motion *loop, int64_t t_ns)
{
	double x[3], v[3], a[3], attitude[4];

	while (loop->first != loop->last &&
	       loop->waiting[loop->first % INCISE_LOOP_POSES].t_ns <= loop_ns(t_ns))
		arrive(loop);
	incise_predict_at(&loop->predict, loop_ns(t_ns), x, v, attitude);
	incise_predict_acceleration(&loop->predict, loop_ns(t_ns), a);
	return incise_double_input_acceleration(v, a);
}

static int more_depth(struct incise_blade_pose *blade, struct incise_error *err)
{
	const struct incise_smooth_record *record;
	struct incise_blade_depth *deep = blade->deep;
	double speed_mm_s;
	int rc = 1;

	while (!(record = incise_smooth_take(&blade->smooth)) && rc > 0 && !blade->ended)
		rc = feed_interpolators(blade, err);
	blade->ended = blade->ended || !rc;
	if (rc < 0)
		return rc;
	if (!record)
		record = incise_smooth_take(&blade->smooth); /* after the end */
	deep[0] = deep[1];
	deep[1].t_ns = INCISE_TIME_NONE;
	if (!record)
		return 0;
	loop_push(&blade->loop, record);
	speed_mm_s = v3_length(record->velocity_mm_s);
	incise_stay_add(&blade->stay, record->t_ns, record->depth_mm, speed_mm_s);
	deep[1] = (struct incise_blade_depth){
		record->t_ns,
		record->depth_mm,
		speed_mm_s,
		record->noise_mm,
		record->depth_noise_mm,
		record->t_sd_s,
		{record->velocity_mm_s[0], record->velocity_mm_s[1],
		 record->velocity_mm_s[2]},
		incise_cut_progress_add(&blade->progress, record,
					blade->smooth.noise_1_s),
		blade->stay.inside,
		blade->stay.began_ns,
		incise_stay_mean_speed_mm_s(&blade->stay),
		blade->stay.deepest_mm,
		blade->progress.highest_mm,
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
	struct incise_tracker_info tracker = {0};
	const struct incise_recording_numbers *numbers = &recording->numbers;
	int rc;

	*blade = (struct incise_blade_pose){.cut.count = recording->range.cuts};
	memcpy(blade->tip_mm, recording->meta.tip_mm, sizeof(blade->tip_mm));
	v3_unit(blade->progress.normal, recording->meta.surface_normal, 0);
	for (int i = 0; i < 2; i++)
		blade->pose[i].t_ns = blade->deep[i].t_ns = INCISE_TIME_NONE;
	tracker.rate_hz = numbers->tracker_hz > 0 ? numbers->tracker_hz : 120;
	tracker.latency_ns = (int64_t)fmin(fmax(numbers->tracker_latency_ns, 0), 1e9);
	incise_predict_init(&blade->loop.predict, &tracker, 0);
	/* The gains of the loop's filter are made for the nominal rate. */
	if (incise_smooth_init(&blade->smooth, tracker.rate_hz))
		return incise_error_set(err, ENOMEM, "out of memory");
	rc = incise_rows_open(&blade->tracker, recording, "tracker",
			      "seq, t_ns, x_mm, y_mm, z_mm, qw, qx, qy, qz, status, "
			      "station, button",
			      recording->meta.tracker, err);
	/* Without the table's velocity, which is from few records: the smoother uses positions. */
	if (!rc)
		rc = incise_rows_open(
			&blade->depth, recording, "depth",
			"seq, t_ns, depth_mm, x_mm, y_mm, z_mm, qw, qx, qy, qz",
			recording->meta.depth, err);
	if (!rc && given) {
		incise_row_times_calibrate(&blade->tracker.times, given);
		incise_row_times_calibrate(&blade->depth.times, given);
	}
	/* Rows are dated by the calibrated delay, the loop knows that of the device. */
	blade->loop.late_ns = blade->loop.predict.latency_ns;
	if (!rc && !isnan(blade->depth.times.source->delay_ns))
		blade->loop.late_ns =
			(int64_t)fmax(fmin(blade->depth.times.source->delay_ns, 1e12),
				      -1e12) -
			blade->depth.times.shift_ns;
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

/* The uncertainty on the line between two values with this noise, where the time is uncertain at this speed. */
static double uncertainty(double noise, double share, double time_s, double speed)
{
	double line = (1 - share) * (1 - share) + share * share;

	return sqrt(noise * noise * line + time_s * time_s * speed * speed);
}

static double mix_interpolators(double a, double b, double share)
{
	return a + share * (b - a);
}

/* Set what is known of the contact that there was at this time, @share of the way between two depths. */
static void set_history(const struct incise_blade_pose *blade, int64_t t_ns, double share,
			struct incise_blade_pose_value *value)
{
	const struct incise_blade_depth *before = &blade->deep[0],
					*after = &blade->deep[1], *of = after;
	bool both =
		before->inside && after->inside && before->began_ns == after->began_ns;

	value->time_in_tissue_s = value->mean_speed_mm_s = value->deepest_mm =
		value->way_mm = isnan(share) ? NAN : 0;
	if (!after->inside || after->began_ns > t_ns)
		of = before;
	if (isnan(share) || !of->inside)
		return;
	value->time_in_tissue_s = (double)(t_ns - of->began_ns) * 1e-9;
	value->mean_speed_mm_s = both ? mix_interpolators(before->mean_speed_mm_s,
							  after->mean_speed_mm_s, share)
				      : of->mean_speed_mm_s;
	/* The record after the end of a cut starts again. */
	value->way_mm =
		both ? fmax(mix_interpolators(before->way_mm, after->way_mm, share),
			    before->way_mm)
		     : of->way_mm;
	value->deepest_mm = fmax(of == before || before->began_ns == after->began_ns
					 ? before->deepest_mm
					 : 0,
				 value->depth_mm);
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
		value->position_mm[i] =
			mix_interpolators(a->position_mm[i], b->position_mm[i], s);
	slerp(blade, s, value->q);
	value->depth_mm = mix_interpolators(c->depth_mm, d->depth_mm, e);
	value->velocity_mm_s = mix_interpolators(c->velocity_mm_s, d->velocity_mm_s, e);
	value->acceleration_mm_s2 =
		isnan(e) ? NAN : loop_acceleration(&blade->loop, t_ns);
	/* A record without an orientation has none to take a part of. */
	value->tilt_deg =
		isnan(s) ? NAN
			 : incise_input_tilt_deg(!isnan(value->q[0]) ? value->q
						 : isnan(b->q[0])    ? a->q
								     : b->q,
						 (const double[3])INCISE_SCALPEL_AXIS,
						 blade->progress.normal);
	set_history(blade, t_ns, e, value);
	value->position_u_mm = uncertainty(mix_interpolators(c->noise_mm, d->noise_mm, e),
					   s, time_s, blade->speed_mm_s);
	value->depth_u_mm =
		uncertainty(mix_interpolators(c->depth_noise_mm, d->depth_noise_mm, e), e,
			    time_s, blade->rate_mm_s);
	value->cut = !isnan(e) && incise_cut_step(&blade->cut, value->depth_mm)
			     ? blade->cut.count
			     : 0;
	value->station = isnan(s) ? 0 : a->station;
	value->button = !isnan(s) && a->button;
	value->advancing = !isnan(e) && c->advancing && d->advancing;
	value->interpolated = isnan(s) || b->seq - a->seq != 1;
	value->error = !isnan(s) && (a->error || b->error);
	return 0;
}

/* Turn back by the quaternion: components of a direction in the frame of the sensor. */
static void turn_back(double to[3], const double q[4], const double v[3])
{
	const double back[4] = {q[0], -q[1], -q[2], -q[3]};

	v3_rotate(to, back, v);
}

void incise_blade_pose_budget(const struct incise_blade_pose *blade, int64_t t_ns,
			      const struct incise_blade_pose_value *value,
			      struct incise_budget_row *row)
{
	const struct incise_blade_depth *c = &blade->deep[0], *d = &blade->deep[1];
	const struct incise_blade_record *a = &blade->pose[0], *b = &blade->pose[1];
	double e = incise_row_share(c->t_ns, d->t_ns, t_ns);
	double step_s = (double)(d->t_ns - c->t_ns) * 1e-9, from[3], to[3], speed;

	row->share = e;
	row->depth_rate_mm_s = isnan(e) ? NAN : blade->rate_mm_s;
	row->acceleration_mm_s2 =
		isnan(e) ? NAN : (d->velocity_mm_s - c->velocity_mm_s) / step_s;
	for (int i = 0; i < 3; i++)
		row->direction[i] =
			mix_interpolators(c->vector_mm_s[i], d->vector_mm_s[i], e);
	speed = v3_length(row->direction);
	for (int i = 0; i < 3; i++)
		row->direction[i] /= speed;
	turn_back(row->tip, value->q, blade->progress.normal);
	step_s = (double)(b->t_ns - a->t_ns) * 1e-9;
	turn_back(from, a->q, row->direction);
	turn_back(to, b->q, row->direction);
	for (int i = 0; i < 3; i++) {
		row->tip[i] = -row->tip[i];
		row->tip_1_s[i] = (to[i] - from[i]) / step_s;
	}
}

/* --- camera -------------------------------------------------------------------------- */

/*
 * Between frames the depth bends off the line: at the middle by an eighth of its second difference where
 * it is smooth, and by up to a fifth where it trembles 2.5 frames a turn; then the nearest ones may be small.
 */
#define BEND 0.75	/* times s (1 - s): a fifth at the middle */
#define BEND_FRAMES 8.0 /* of the mean */

int incise_camera_interpolator_any(struct incise_recording *recording,
				   struct incise_error *err)
{
	int64_t seq, t_ns;

	return incise_source_end(recording, "frames", false, &seq, &t_ns, NULL, err);
}

/* Second derivative of the depth at a frame by its neighbours, mm/s²; NAN: not known. */
static double bend_at(const struct incise_camera_depth *frame)
{
	/* Where there is no frame, the time is far off, and the depth not a number. */
	double before_s = ((double)frame->t_ns - (double)frame[-1].t_ns) * 1e-9;
	double after_s = ((double)frame[1].t_ns - (double)frame->t_ns) * 1e-9;
	double to = (frame[1].depth_mm - frame->depth_mm) / after_s;
	double from = (frame->depth_mm - frame[-1].depth_mm) / before_s;

	return 2 * fabs(to - from) / (before_s + after_s);
}

static int more(struct incise_camera_interpolator *camera, struct incise_error *err)
{
	const struct incise_rows *rows = &camera->rows;
	int rc = incise_rows_next(&camera->rows, err);
	double bend;

	memmove(camera->frame, camera->frame + 1, 3 * sizeof(*camera->frame));
	camera->frame[3] = (struct incise_camera_depth){
		.t_ns = INCISE_TIME_NONE,
		.depth_mm = NAN,
	};
	if (rc <= 0)
		return rc;
	camera->frame[3] = (struct incise_camera_depth){
		rows->t_ns,
		incise_rows_real(rows, 2) * camera->scale,
		incise_rows_real(rows, 3) * camera->mm_px,
		incise_rows_real(rows, 4),
		incise_row_times_sd(&rows->times, incise_rows_seq(rows)),
	};
	bend = bend_at(&camera->frame[2]);
	if (!isnan(bend))
		camera->bend2 += (bend * bend - camera->bend2) / BEND_FRAMES;
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
	for (int i = 0; i < 4; i++)
		camera->frame[i] = (struct incise_camera_depth){
			.t_ns = INCISE_TIME_NONE,
			.depth_mm = NAN,
		};
	rc = incise_camera_interpolator_any(recording, err);
	if (rc <= 0)
		return rc;
	rc = incise_rows_open(&camera->rows, recording, "frames",
			      "seq, t_ns, depth_mm, sd_px, quality", UINT64_MAX, err);
	if (!rc && given)
		incise_row_times_calibrate(&camera->rows.times, given);
	for (int i = 0; i < 2 && rc >= 0; i++)
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
	const struct incise_camera_depth *a = &camera->frame[1], *b = &camera->frame[2];
	double s, slope, line, time, bend, span_s;
	int rc = 0;

	*value = (struct incise_camera_value){NAN, NAN, NAN, NAN, true};
	while (rc >= 0 && b->t_ns != INCISE_TIME_NONE && b->t_ns <= t_ns)
		rc = more(camera, err);
	if (rc < 0)
		return rc;
	s = incise_row_share(a->t_ns, b->t_ns, t_ns);
	if (isnan(s) || isnan(a->depth_mm) || isnan(b->depth_mm))
		return 0;
	span_s = (double)(b->t_ns - a->t_ns) * 1e-9;
	slope = (b->depth_mm - a->depth_mm) / span_s;
	line = (1 - s) * (1 - s) * a->sd_mm * a->sd_mm + s * s * b->sd_mm * b->sd_mm;
	time = (b->t_sd_s * b->t_sd_s + t_sd_s * t_sd_s) * slope * slope;
	value->depth_mm = a->depth_mm + s * (b->depth_mm - a->depth_mm);
	bend = fmax(bend_at(a), bend_at(b));
	if (isnan(bend) && !camera->bend2)
		bend = fabs(slope) / span_s;
	bend = fmax(bend, sqrt(camera->bend2)) * span_s * span_s * BEND * s * (1 - s);
	value->sd_mm = sqrt(line);
	value->u_mm = sqrt(line + time + bend * bend);
	value->quality = a->quality + s * (b->quality - a->quality);
	value->low_quality = low(a) || low(b);
	return 0;
}
