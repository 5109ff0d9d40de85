// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The uncertainty budget of a recording; see incise/budget.h. mm, N, s.
 *
 *     calibration.conf, history ──► gain, zero, tip, surface, delays ──┐
 *     zero of the recording ──────► zero                               ├─► parts of a row
 *     lines of the streams ───────► line, jitter                       │
 *     rows ───────────────────────► noise, smoothing ──────────────────┘
 *
 * A linear model of the errors e, estimate less truth:
 *
 *     force     e = -F/S e_gain - e_zero/S + e_code
 *     depth     e = -n·R e_tip + e_surface - d' (e_alignment + e_line - e_jitter) + e_noise
 *     velocity  e = v·R' e_tip - v' (e_alignment + e_line - e_jitter) + e_noise + e_smoothing
 *     time      e = e_delay (of the force) + e_jitter
 *
 * with the unit vectors n out of the tissue and v along the motion, and R of the sensor.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/budget.h>
#include "../base/ascending.h"
#include "../base/vector.h"
#include "../record/read/depth.h"
#include "../record/read/recalibration.h"
#include "../record/read/recording.h"
#include "../record/read/session.h"
#include "../record/schema.h"
#include "interpolators.h"
#include "writers.h"

#define PART(quantity, name, column, scope, source, about)                            \
	{                                                                             \
		name, column, about, INCISE_BUDGET_##quantity, INCISE_BUDGET_##scope, \
			INCISE_BUDGET_##source                                        \
	}

enum {
	FORCE_GAIN,
	FORCE_ZERO,
	FORCE_RESOLUTION,
	FORCE_NOISE,
	DEPTH_TIP,
	DEPTH_SURFACE = DEPTH_TIP + 3,
	DEPTH_ALIGNMENT,
	DEPTH_LINE,
	DEPTH_NOISE,
	DEPTH_JITTER,
	VELOCITY_TIP,
	VELOCITY_ALIGNMENT = VELOCITY_TIP + 3,
	VELOCITY_LINE,
	VELOCITY_NOISE,
	VELOCITY_SMOOTHING,
	VELOCITY_JITTER,
	TIME_DELAY,
	TIME_ALIGNMENT,
	TIME_LINE,
	TIME_JITTER,
	PARTS
};

_Static_assert(PARTS == INCISE_BUDGET_PARTS, "the header's number of parts");

#define TIP_PARTS(quantity, before, unit)                                            \
	PART(quantity, "tip_x", before "_u_tip_x_" unit, CALIBRATION, TIP_X,         \
	     "tip, x in the sensor's frame"),                                        \
		PART(quantity, "tip_y", before "_u_tip_y_" unit, CALIBRATION, TIP_Y, \
		     "tip, y, less what it shares with x"),                          \
		PART(quantity, "tip_z", before "_u_tip_z_" unit, CALIBRATION, TIP_Z, \
		     "tip, z, less what it shares with x and y")
#define TIMING_PARTS(quantity, before, unit)                                             \
	PART(quantity, "alignment", before "_u_alignment_" unit, CALIBRATION, ALIGNMENT, \
	     "delay of the tracker against the force"),                                  \
		PART(quantity, "line", before "_u_line_" unit, RECORDING, LINE,          \
		     "line through the tracker's arrivals")

static const struct incise_budget_part parts[PARTS] = {
	PART(FORCE, "gain", "force_u_gain_N", CALIBRATION, GAIN,
	     "sensitivity of the force channel"),
	PART(FORCE, "zero", "force_u_zero_N", RECORDING, ZERO,
	     "zero of the force channel, less what it shares with gain"),
	PART(FORCE, "resolution", "force_u_resolution_N", OWN, NO_SOURCE,
	     "last digit of the converter"),
	PART(FORCE, "noise", "force_u_noise_N", OWN, NO_SOURCE,
	     "noise of the force channel"),
	TIP_PARTS(DEPTH, "depth", "mm"),
	PART(DEPTH, "surface", "depth_u_surface_mm", CALIBRATION, SURFACE,
	     "tissue surface along its normal"),
	TIMING_PARTS(DEPTH, "depth", "mm"),
	PART(DEPTH, "noise", "depth_u_noise_mm", OWN, NO_SOURCE, "noise of the tracker"),
	PART(DEPTH, "jitter", "depth_u_jitter_mm", OWN, NO_SOURCE,
	     "scatter of the timestamps of the force"),
	TIP_PARTS(VELOCITY, "velocity", "mm_s"),
	TIMING_PARTS(VELOCITY, "velocity", "mm_s"),
	PART(VELOCITY, "noise", "velocity_u_noise_mm_s", OWN, NO_SOURCE,
	     "noise of the tracker"),
	PART(VELOCITY, "smoothing", "velocity_u_smoothing_mm_s", OWN, NO_SOURCE,
	     "motion that the filter of the velocity flattens"),
	PART(VELOCITY, "jitter", "velocity_u_jitter_mm_s", OWN, NO_SOURCE,
	     "scatter of the timestamps of the force"),
	PART(TIME, "delay", "t_u_delay_s", CALIBRATION, DELAY,
	     "delay of the force, less what it shares with alignment"),
	PART(TIME, "alignment", "t_u_alignment_s", CALIBRATION, ALIGNMENT,
	     "delay of the tracker against the force"),
	PART(TIME, "line", "t_u_line_s", RECORDING, LINE,
	     "line through the tracker's arrivals"),
	PART(TIME, "jitter", "t_u_jitter_s", OWN, NO_SOURCE,
	     "scatter of the timestamps of the force"),
};

static const struct incise_budget_value values[INCISE_BUDGET_QUANTITIES] = {
	{"force", "force_N", "force_u_N", "N", FORCE_GAIN, DEPTH_TIP - FORCE_GAIN},
	{"depth", "depth_mm", "depth_u_mm", "mm", DEPTH_TIP, VELOCITY_TIP - DEPTH_TIP},
	{"velocity", "velocity_mm_s", "velocity_u_mm_s", "mm/s", VELOCITY_TIP,
	 TIME_DELAY - VELOCITY_TIP},
	{"time", "t_s", "t_u_s", "s", TIME_DELAY, PARTS - TIME_DELAY},
};

struct incise_budget {
	double mV_N;
	double u[INCISE_BUDGET_SOURCES]; /* standard uncertainties; NAN: not stated */
	double covariance[INCISE_BUDGET_SOURCES][INCISE_BUDGET_SOURCES];
	double tip[3][3];	/* Cholesky's factor of the tip's covariance, lower */
	double gain_zero;	/* correlation of the two */
	double shared, delay_s; /* the delay is shared · alignment, and the rest */
	/* own */
	double resolution_N, noise_N, jitter_s;
	double samples;		   /* of the force in a row that count as one */
	double window_s;	   /* of the filter of the velocity */
	double position_mm2[3][3]; /* covariance of the noise of the tip's position */
	double normal[3];
	double line_1_s, smoother_1_s; /* noise of the velocity for one of positions */
	double smoothing_mm_s;
	char missing[INCISE_BUDGET_QUANTITIES][200];
};

const struct incise_budget_part *incise_budget_parts(void)
{
	return parts;
}

const struct incise_budget_value *incise_budget_values(void)
{
	return values;
}

/* --- calibrations -------------------------------------------------------------------- */

/* The calibrations in use. */
struct use {
	struct incise_recording *force, *tracker; /* of a session two members */
	const struct incise_calibration *given;
	bool rows; /* values of rows are asked for, and not those of the calibrations alone */
	struct history {
		struct incise_calibration calibration;
		struct incise_calibration_record *records;
		int n;
	} of_given, of_force, of_tracker;
};

/* The history that states a value: the given one's where that has the value. */
static const struct history *stating(const struct use *use, const struct history *own,
				     double given)
{
	return use->given && !isnan(given) ? &use->of_given : own;
}

/* Read the calibration that a recording was made with; one without has no history. */
static int read_own(struct incise_recording *recording, struct history *history,
		    struct incise_error *err)
{
	sqlite3_stmt *stmt = NULL;
	const char *text;
	char name[300];
	int rc;

	incise_calibration_nominal(&history->calibration);
	if (sqlite3_prepare_v2(recording->db,
			       "SELECT value FROM meta WHERE key = 'calibration_conf'",
			       -1, &stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(recording->db, recording->path, err);
	rc = sqlite3_step(stmt);
	if (rc != SQLITE_ROW && rc != SQLITE_DONE) {
		rc = incise_schema_fail(recording->db, recording->path, err);
	} else if (rc == SQLITE_ROW && sqlite3_column_type(stmt, 0) == SQLITE_TEXT) {
		text = (const char *)sqlite3_column_text(stmt, 0);
		snprintf(name, sizeof(name), "%.200s: calibration_conf", recording->path);
		rc = incise_calibration_text(text ? text : "", name,
					     &history->calibration, &history->records,
					     err);
		history->n = rc;
	} else {
		rc = 0;
	}
	sqlite3_finalize(stmt);
	return rc < 0 ? rc : 0;
}

/* The calibration that has set a key to this value; *index: of the value in it. NULL: none. */
static const struct incise_calibration_record *find_budget(const struct history *history,
							   const char *key, double value,
							   int *index)
{
	for (int i = history->n - 1; i >= 0; i--) {
		const struct incise_calibration_record *record = &history->records[i];

		for (int k = 0; record->pass && k < record->n; k++)
			if (!strcmp(record->values[k].key, key)) {
				*index = k;
				/* Else a person has changed it since. */
				return fabs(record->values[k].left - value) <=
						       1e-9 * fabs(value)
					       ? record
					       : NULL;
			}
	}
	return NULL;
}

/* Covariance of two values of a calibration; without one that it states, they have none. */
static double covariance(const struct incise_calibration_record *record, int i, int k)
{
	int low = i < k ? i : k, high = i < k ? k : i;

	if (record->n_covariance)
		return record->covariance[high * (high + 1) / 2 + low];
	return i == k ? record->values[i].u * record->values[i].u : 0;
}

static void set_budget(struct incise_budget *budget, enum incise_budget_source source,
		       double u)
{
	budget->u[source] = u;
	budget->covariance[source][source] = u * u;
}

static void set_both(struct incise_budget *budget, enum incise_budget_source a,
		     enum incise_budget_source b, double value)
{
	budget->covariance[a][b] = budget->covariance[b][a] = value;
}

/* As a part of a line of incise_budget_missing(). */
static void miss(struct incise_budget *budget, enum incise_budget_quantity quantity,
		 const char *what)
{
	char *text = budget->missing[quantity];
	size_t n = strlen(text);

	snprintf(text + n, sizeof(budget->missing[0]) - n, "%s%s", n ? "; " : "", what);
}

/* --- force --- */

#define ZERO_ROWS_MAX 100000
#define BLOCKS 64
#define BLOCK 256 /* samples */
#define CODE 2	  /* column of the force */

/*
 * Number of samples in a row that count as one: 1 + 2 Σ ρ of the recording's first @m samples, as long
 * as the correlation is more than chance; ended as Sokal does, at 5 times the sum so far. They
 * were at rest if their standard deviation is that of the zero; else 1.
 */
static double correlation_length(double *x, int m, double sd_codes)
{
	double mean = 0, power = 0, sum = 1;

	for (int i = 0; i < m; i++)
		mean += x[i] / m;
	for (int i = 0; i < m; i++) {
		x[i] -= mean;
		power += x[i] * x[i];
	}
	if (m > 100 && power < 2.25 * m * sd_codes * sd_codes)
		for (int lag = 1; lag < m / 4 && lag <= 5 * sum; lag++) {
			double product = 0;

			for (int i = lag; i < m; i++)
				product += x[i] * x[i - lag];
			if (product / power < 2 / sqrt(m))
				break;
			sum += 2 * product / power;
		}
	return sum;
}

/* The first @n codes. Returns how many there are, or -errno. */
static int first_codes(struct incise_recording *force, double *x, int n,
		       struct incise_error *err)
{
	struct incise_source source;
	int rc = incise_source_open(&source, force, INCISE_LEDGER_FORCE, err), m = 0;

	rc = rc ? rc : 1;
	while (m < n && rc > 0 && (rc = incise_source_next(&source, err)) > 0)
		for (size_t i = 0; i < source.batch.n && m < n; i++)
			x[m++] = (double)source.batch.column[CODE].i[i];
	incise_source_close(&source);
	return rc < 0 ? rc : m;
}

/*
 * Variances of codes and of times, ns², from second differences: the median of blocks, as a
 * contact is no noise, and a lost sample no scatter of timestamps.
 */
static int variances_of_blocks(struct incise_recording *force, double *codes,
			       double *times_ns2, struct incise_error *err)
{
	const uint64_t rows = force->meta.force;
	double variance[2][BLOCKS];
	int64_t first = 0, first_ns;
	int n = 0,
	    rc = incise_source_end(force, "force", false, &first, &first_ns, NULL, err);

	for (int b = 0; b < BLOCKS && (uint64_t)b * BLOCK < rows && rc > 0; b++) {
		const int64_t from = first + (int64_t)(rows / BLOCKS * (uint64_t)b);
		double x[2][3] = {{0}}, sum[2] = {0};
		struct incise_source source;
		int m = 0;

		rc = incise_source_open_at(&source, force, INCISE_LEDGER_FORCE, from,
					   err);
		rc = rc ? rc : 1;
		while (m < BLOCK && rc > 0 && (rc = incise_source_next(&source, err)) > 0)
			for (size_t i = 0; i < source.batch.n && m < BLOCK; i++) {
				const union incise_column *column = source.batch.column;

				if (column[0].i[i] < from)
					continue;
				if (!m)
					first_ns = column[1].i[i];
				for (int k = 0; k < 2; k++) {
					x[k][0] = x[k][1];
					x[k][1] = x[k][2];
					x[k][2] = k ? (double)column[1].i[i] -
								  (double)first_ns
						    : (double)column[CODE].i[i];
					if (m >= 2)
						sum[k] += pow(x[k][0] - 2 * x[k][1] +
								      x[k][2],
							      2) /
							  6;
				}
				m++;
			}
		incise_source_close(&source);
		for (int k = 0; k < 2 && m > 2; k++)
			variance[k][n] = sum[k] / (m - 2);
		n += m > 2;
		rc = rc < 0 ? rc : 1; /* its last block may be short */
	}
	*codes = n ? median(variance[0], n) : NAN;
	*times_ns2 = n ? median(variance[1], n) : NAN;
	return rc < 0 ? rc : 0;
}

/* The zero that the recording has measured, and how many of its samples count as one. */
static int measure_zero(struct incise_budget *budget, struct incise_recording *force,
			double sd_mV, double samples, double step_mV, bool used,
			struct incise_error *err)
{
	int n = (int)fmin(samples, ZERO_ROWS_MAX);
	double *codes = malloc((size_t)n * sizeof(*codes)), u_mV;

	if (!codes)
		return incise_error_set(err, ENOMEM, "out of memory");
	n = first_codes(force, codes, n, err);
	if (n >= 0)
		budget->samples = correlation_length(codes, n, sd_mV / step_mV);
	free(codes);
	if (n < 0)
		return n;
	u_mV = sd_mV * sqrt(budget->samples / samples);
	/* Noise of half a code and more makes means finer than a code. */
	if (sd_mV < step_mV / 2)
		u_mV = hypot(u_mV, step_mV / sqrt(12));
	if (used)
		set_budget(budget, INCISE_BUDGET_ZERO, u_mV);
	return 0;
}

/* Noise of the force and of its timestamps, and the zero if the recording measured it. */
static int measure_force(struct incise_budget *budget, const struct use *use,
			 bool measured, struct incise_error *err)
{
	struct incise_recording *force = use->force;
	const struct incise_recording_info *meta = &force->meta;
	double step_mV = meta->full_scale_V * 1e3 / (double)(1LL << meta->bits);
	const double sd_mV = force->numbers.zero_sd_mV;
	const double samples = force->numbers.zero_samples;
	double variance = NAN, times_ns2 = NAN;
	int rc = 0;

	if (use->rows)
		rc = variances_of_blocks(force, &variance, &times_ns2, err);
	if (!rc && !isnan(sd_mV) && samples >= 1)
		rc = measure_zero(budget, force, sd_mV, samples, step_mV, measured, err);
	/* At rest slow noise shows too. */
	variance = isnan(sd_mV) ? variance * step_mV * step_mV : sd_mV * sd_mV;
	/* The codes' variance has that of their last digit. */
	budget->resolution_N = step_mV / sqrt(12) / fabs(budget->mV_N);
	budget->noise_N =
		sqrt(fmax(0, variance - step_mV * step_mV / 12)) / fabs(budget->mV_N);
	budget->jitter_s = sqrt(times_ns2) * 1e-9;
	return rc;
}

static int find_force(struct incise_budget *budget, const struct use *use,
		      struct incise_error *err)
{
	const struct incise_recording_info *meta = &use->force->meta;
	const struct history *of_zero =
		stating(use, &use->of_force, use->of_given.calibration.force_zero_mV);
	double zero_mV = of_zero->calibration.force_zero_mV, r;
	const struct incise_calibration_record *gain, *zero = NULL;
	int rc, at_gain = 0, at_zero = 0;

	budget->mV_N =
		use->given && !meta->newtons ? use->given->force_mV_N : meta->force_mV_N;
	gain = meta->newtons ? NULL
			     : find_budget(stating(use, &use->of_force, 0), "force_mV_N",
					   budget->mV_N, &at_gain);
	if (!isnan(zero_mV) && !meta->newtons)
		zero = find_budget(of_zero, "force_zero_mV", zero_mV, &at_zero);
	rc = measure_force(budget, use, isnan(zero_mV) || meta->newtons, err);
	if (gain)
		set_budget(budget, INCISE_BUDGET_GAIN,
			   sqrt(covariance(gain, at_gain, at_gain)));
	if (zero)
		set_budget(budget, INCISE_BUDGET_ZERO,
			   sqrt(covariance(zero, at_zero, at_zero)));
	if (gain && zero)
		set_both(budget, INCISE_BUDGET_GAIN, INCISE_BUDGET_ZERO,
			 gain == zero ? covariance(gain, at_gain, at_zero) : 0);
	r = budget->covariance[INCISE_BUDGET_GAIN][INCISE_BUDGET_ZERO] /
	    (budget->u[INCISE_BUDGET_GAIN] * budget->u[INCISE_BUDGET_ZERO]);
	budget->gain_zero = isnan(r) ? 0 : fmax(-1, fmin(1, r));
	if (isnan(budget->u[INCISE_BUDGET_GAIN]))
		miss(budget, INCISE_BUDGET_FORCE,
		     meta->newtons ? "the device states no uncertainty of its newtons"
				   : "the sensitivity has no calibration (incise "
				     "calibrate force)");
	if (isnan(budget->u[INCISE_BUDGET_ZERO]))
		miss(budget, INCISE_BUDGET_FORCE,
		     "force_zero_mV was set by hand; leave it out, or incise calibrate "
		     "force --zero");
	return rc;
}

/* --- tip and surface --- */

/* The lower factor of a covariance; false: it is none. */
static bool factor(const double c[3][3], double to[3][3])
{
	memset(to, 0, 9 * sizeof(double));
	for (int k = 0; k < 3; k++)
		for (int i = k; i < 3; i++) {
			double rest = c[i][k];

			for (int j = 0; j < k; j++)
				rest -= to[i][j] * to[k][j];
			if (i == k && !(rest >= -1e-12 * c[i][i]))
				return false;
			if (i == k)
				to[i][k] = sqrt(fmax(rest, 0));
			else
				to[i][k] = to[k][k] > 0 ? rest / to[k][k] : 0;
		}
	return true;
}

static void find_tip(struct incise_budget *budget, const struct use *use)
{
	static const char *const keys[] = {"tip_x_mm", "tip_y_mm", "tip_z_mm"};
	const double *tip_mm = use->tracker->meta.tip_mm;
	const struct incise_calibration_record *record = NULL;
	double c[3][3];
	int at[3];

	for (int i = 0; i < 3; i++) {
		const struct incise_calibration_record *found =
			find_budget(&use->of_tracker, keys[i], tip_mm[i], &at[i]);

		if (i && found != record)
			found = NULL;
		record = found;
		if (!record)
			break;
	}
	for (int i = 0; i < 3; i++)
		for (int k = 0; k < 3; k++)
			c[i][k] = record ? covariance(record, at[i], at[k]) : NAN;
	if (!record || !factor(c, budget->tip)) {
		for (int i = 0; i < 9; i++)
			budget->tip[i / 3][i % 3] = NAN;
		miss(budget, INCISE_BUDGET_DEPTH,
		     "the tip has no calibration (incise calibrate tip)");
		miss(budget, INCISE_BUDGET_VELOCITY,
		     "the tip has no calibration (incise calibrate tip)");
		return;
	}
	for (int i = 0; i < 3; i++) {
		set_budget(budget, INCISE_BUDGET_TIP_X + i, sqrt(fmax(c[i][i], 0)));
		for (int k = 0; k < i; k++)
			set_both(budget, INCISE_BUDGET_TIP_X + i, INCISE_BUDGET_TIP_X + k,
				 c[i][k]);
	}
}

/* --- times --- */

/* Whether the last calibration of delays, which is in use, has this stream and lacks the other. */
static bool against(const struct history *history, const char *key, const char *other)
{
	const double value = incise_calibration_get(&history->calibration, key);
	int at;
	const struct incise_calibration_record *record =
		find_budget(history, key, value, &at);

	for (int i = 0; record && i < record->n; i++)
		if (!strcmp(record->values[i].key, other))
			return false;
	return record && !strstr(record->method, "against the camera");
}

static double delay_sd_s(const struct incise_stream *stream, double given_ms,
			 double given_sd_ms)
{
	return (isnan(given_ms) ? stream->delay_sd_ms : given_sd_ms) * 1e-3;
}

/*
 * The delays of force and tracker, and what they share. A calibration of one against the other
 * states the difference, and the other one is as it was:
 *
 *     tracker against force    alignment = the tracker's     delay of the force as stated
 *     force against tracker    alignment = -the force's      delay = that of the tracker - alignment
 *     neither                  alignment = tracker - force
 */
static int find_times(struct incise_budget *budget, const struct use *use,
		      struct incise_recording *recording, struct incise_error *err)
{
	struct incise_stream streams[INCISE_STREAMS_MAX];
	struct incise_calibration none;
	const struct incise_calibration *given = use->given ? use->given : &none;
	double force_s = NAN, tracker_s = NAN, alignment_s;
	int n = incise_recording_streams(recording, streams, err);

	incise_calibration_nominal(&none);
	for (int i = 0; i < n; i++) {
		if (!strcmp(streams[i].name, "force"))
			force_s = delay_sd_s(&streams[i], given->force_delay_ms,
					     given->force_delay_sd_ms);
		else if (!strcmp(streams[i].name, "tracker"))
			tracker_s = delay_sd_s(&streams[i], given->tracker_delay_ms,
					       given->tracker_delay_sd_ms);
	}
	if (against(stating(use, &use->of_tracker, given->tracker_delay_ms),
		    "tracker_delay_ms", "force_delay_ms")) {
		alignment_s = tracker_s;
		budget->shared = 0;
		budget->delay_s = force_s;
	} else if (against(stating(use, &use->of_force, given->force_delay_ms),
			   "force_delay_ms", "tracker_delay_ms")) {
		alignment_s = force_s;
		budget->shared = -1;
		budget->delay_s = tracker_s;
	} else {
		alignment_s = hypot(tracker_s, force_s);
		budget->shared = alignment_s > 0 ? -pow(force_s / alignment_s, 2) : 0;
		budget->delay_s = force_s * sqrt(fmax(0, 1 + budget->shared));
	}
	set_budget(budget, INCISE_BUDGET_ALIGNMENT, alignment_s);
	set_budget(budget, INCISE_BUDGET_DELAY,
		   budget->shared == 0
			   ? budget->delay_s
			   : hypot(budget->shared * alignment_s, budget->delay_s));
	set_both(budget, INCISE_BUDGET_ALIGNMENT, INCISE_BUDGET_DELAY,
		 budget->shared == 0 ? 0 : budget->shared * alignment_s * alignment_s);
	if (isnan(alignment_s)) {
		miss(budget, INCISE_BUDGET_DEPTH,
		     "the delays have no calibration (incise calibrate delay)");
		miss(budget, INCISE_BUDGET_VELOCITY,
		     "the delays have no calibration (incise calibrate delay)");
	}
	if (isnan(budget->u[INCISE_BUDGET_DELAY]))
		miss(budget, INCISE_BUDGET_TIME,
		     "the delay of the reference stream has no uncertainty "
		     "(force_delay_sd_ms in calibration.conf)");
	if (isnan(budget->jitter_s))
		miss(budget, INCISE_BUDGET_TIME,
		     "the scatter of the force's timestamps is not known");
	return n < 0 ? n : 0;
}

/* --- tracker ------------------------------------------------------------------------- */

#define FOURTH 5 /* records of a fourth difference, which has √70 of their noise */

/* Sums over the records of the tracker. */
struct tracker_sums {
	struct incise_smooth smooth;
	double position_mm[FOURTH][3];
	int64_t t_ns[FOURTH];
	int n;
	double square_mm2[3][3], squares;
	double off_mm2_s2[2], offs[2]; /* of the two velocities: outside, in the tissue */
	double line_s2, lines;
};

static bool is_even(const int64_t t_ns[FOURTH])
{
	double mean = (double)(t_ns[FOURTH - 1] - t_ns[0]) / (FOURTH - 1);

	for (int i = 1; i < FOURTH; i++)
		if (fabs((double)(t_ns[i] - t_ns[i - 1]) - mean) > 0.2 * mean ||
		    mean > INCISE_DEPTH_GAP_NS)
			return false;
	return true;
}

/* Motion has hardly a fourth difference. */
static void add_noise(struct tracker_sums *sums,
		      const struct incise_smooth_record *record)
{
	static const double weights[FOURTH] = {1, -4, 6, -4, 1};
	double bend[3] = {0};

	memmove(sums->position_mm, sums->position_mm + 1,
		(FOURTH - 1) * sizeof(*sums->position_mm));
	memmove(sums->t_ns, sums->t_ns + 1, (FOURTH - 1) * sizeof(*sums->t_ns));
	v3_copy(sums->position_mm[FOURTH - 1], record->position_mm);
	sums->t_ns[FOURTH - 1] = record->t_ns;
	if (++sums->n < FOURTH || !is_even(sums->t_ns))
		return;
	for (int i = 0; i < FOURTH; i++)
		v3_add(bend, bend, weights[i], sums->position_mm[i]);
	for (int i = 0; i < 3; i++)
		for (int k = 0; k < 3; k++)
			sums->square_mm2[i][k] += bend[i] * bend[k] / 70;
	sums->squares++;
}

static void add_finished(struct tracker_sums *sums)
{
	const struct incise_smooth_record *record;

	while ((record = incise_smooth_take(&sums->smooth))) {
		double off = v3_length(record->velocity_mm_s) - record->line_mm_s;
		bool inside = record->depth_mm > 0;

		if (isnan(off))
			continue;
		sums->off_mm2_s2[inside] += off * off;
		sums->offs[inside]++;
	}
}

static int read_tracker(struct tracker_sums *sums, struct incise_rows *rows,
			const double tip_mm[3], double delay_sd_s,
			struct incise_error *err)
{
	int rc;

	while ((rc = incise_rows_next(rows, err)) > 0) {
		struct incise_smooth_record record = {
			.seq = incise_rows_seq(rows),
			.t_ns = rows->t_ns,
			.depth_mm = incise_rows_real(rows, 2),
			.line_mm_s = incise_rows_real(rows, 3),
		};
		double q[4], sd_s = incise_row_times_sd(&rows->times, record.seq);

		for (int i = 0; i < 3; i++)
			record.position_mm[i] = incise_rows_real(rows, 4 + i);
		for (int i = 0; i < 4; i++)
			q[i] = incise_rows_real(rows, 7 + i);
		incise_go_to_tip(tip_mm, q, record.position_mm);
		sums->line_s2 += fmax(0, sd_s * sd_s - delay_sd_s * delay_sd_s);
		sums->lines++;
		add_noise(sums, &record);
		incise_smooth_push(&sums->smooth, &record);
		add_finished(sums);
	}
	incise_smooth_end(&sums->smooth);
	add_finished(sums);
	return rc;
}

/* In a session: of the clock of the force's member, s; that of the tracker's is in its rows. */
static double force_clock_s(struct incise_recording *force)
{
	const struct incise_session_map *map = force->own[INCISE_LEDGER_FORCE].map;
	int64_t seq, t_ns;

	if (!map ||
	    incise_source_end(force, "force", false, &seq, &t_ns, NULL, NULL) <= 0)
		return 0;
	/* The error is bounded, and as likely anywhere within. */
	return incise_session_bound(map, t_ns) / sqrt(3) * 1e-9;
}

static void keep_tracker(struct incise_budget *budget, const struct tracker_sums *sums,
			 double clock_s)
{
	bool inside = sums->offs[1] > 0;
	double off = sums->off_mm2_s2[inside] / sums->offs[inside], noise = 0;

	for (int i = 0; i < 3; i++) {
		for (int k = 0; k < 3; k++)
			budget->position_mm2[i][k] =
				sums->square_mm2[i][k] / sums->squares;
		noise += budget->position_mm2[i][i] / 3;
	}
	budget->smoother_1_s = sums->smooth.noise_1_s;
	budget->window_s = INCISE_DEPTH_WINDOW * sums->smooth.period_s;
	budget->line_1_s = 1 / sums->smooth.period_s /
			   sqrt(INCISE_DEPTH_HALF * (INCISE_DEPTH_HALF + 1) *
				(2 * INCISE_DEPTH_HALF + 1) / 3.);
	/* Two filters of one motion differ by noise, and by what one of them flattens. */
	off -= noise * pow(incise_smooth_line_noise(&sums->smooth, INCISE_DEPTH_HALF), 2);
	budget->smoothing_mm_s = sqrt(fmax(off, 0));
	set_budget(budget, INCISE_BUDGET_LINE,
		   sqrt(sums->line_s2 / sums->lines + clock_s * clock_s));
}

static int measure_tracker(struct incise_budget *budget, const struct use *use,
			   struct incise_recording *recording, struct incise_error *err)
{
	struct tracker_sums sums = {0};
	struct incise_rows rows;
	const double rate_hz = recording->numbers.tracker_hz;
	double delay_ns;
	int rc;

	if (incise_smooth_init(&sums.smooth, rate_hz > 0 ? rate_hz : 120))
		return incise_error_set(err, ENOMEM, "out of memory");
	rc = incise_rows_open(&rows, recording, "depth",
			      "seq, t_ns, depth_mm, velocity_mm_s, x_mm, y_mm, z_mm, qw, "
			      "qx, qy, qz",
			      recording->meta.depth, err);
	if (!rc && use->given)
		incise_row_times_calibrate(&rows.times, use->given);
	/* The delay is known as the calibration in use says: another one has added the difference. */
	delay_ns = rc ? 0 : rows.times.source->delay_sd_ns;
	delay_ns = isnan(delay_ns) ? 0 : delay_ns;
	delay_ns = sqrt(fmax(0, delay_ns * delay_ns + rows.times.variance_ns2));
	if (!rc)
		rc = read_tracker(&sums, &rows, recording->meta.tip_mm, delay_ns * 1e-9,
				  err);
	incise_rows_close(&rows);
	if (!rc)
		keep_tracker(budget, &sums, force_clock_s(use->force));
	incise_smooth_free(&sums.smooth);
	return rc;
}

/* --- the budget ---------------------------------------------------------------------- */

static int find_all(struct incise_budget *budget, const struct use *use,
		    struct incise_recording *recording, struct incise_error *err)
{
	double surface_u_mm = use->of_tracker.calibration.surface_u_mm;
	int rc = 0;

	v3_unit(budget->normal, recording->meta.surface_normal, 0);
	if (incise_recording_has_force(recording))
		rc = find_force(budget, use, err);
	find_tip(budget, use);
	set_budget(budget, INCISE_BUDGET_SURFACE, surface_u_mm);
	if (isnan(surface_u_mm))
		miss(budget, INCISE_BUDGET_DEPTH,
		     "the surface has no uncertainty (surface_u_mm in calibration.conf)");
	if (!rc)
		rc = find_times(budget, use, recording, err);
	return rc || !use->rows ? rc : measure_tracker(budget, use, recording, err);
}

struct incise_budget *incise_budget_open(struct incise_recording *recording,
					 const struct incise_export_options *options,
					 bool rows, struct incise_error *err)
{
	const struct incise_calibration *given = options->calibration;
	const char *given_path = options->calibration_path;
	struct incise_budget *budget = calloc(1, sizeof(*budget));
	struct use use = {
		.force = recording->streams[INCISE_LEDGER_FORCE]->file,
		.tracker = recording->streams[INCISE_LEDGER_TRACKER]->file,
		.given = given,
		.rows = rows,
	};
	int rc;

	if (!budget)
		return INCISE_ERROR_NULL(err, ENOMEM, "%s: out of memory",
					 recording->path);
	for (int i = 0; i < INCISE_BUDGET_SOURCES; i++) {
		budget->u[i] = NAN;
		for (int k = 0; k < INCISE_BUDGET_SOURCES; k++)
			budget->covariance[i][k] = i == k ? NAN : 0;
	}
	budget->noise_N = budget->resolution_N = budget->jitter_s = NAN;
	budget->samples = 1;
	rc = read_own(use.force, &use.of_force, err);
	if (!rc)
		rc = read_own(use.tracker, &use.of_tracker, err);
	if (!rc && given && given_path)
		rc = incise_calibration_history(given_path, &use.of_given.records, err);
	if (given) {
		use.of_given.n = rc > 0 ? rc : 0;
		use.of_given.calibration = *given;
		/* The tip and the surface stay those of the recording. */
		if (!isnan(given->surface_u_mm))
			use.of_tracker.calibration.surface_u_mm = given->surface_u_mm;
	}
	rc = rc < 0 ? rc : 0;
	if (!rc)
		rc = find_all(budget, &use, recording, err);
	free(use.of_given.records);
	free(use.of_force.records);
	free(use.of_tracker.records);
	if (!rc)
		return budget;
	free(budget);
	errno = -rc;
	return NULL;
}

struct incise_budget *incise_budget_new(struct incise_recording *recording,
					const struct incise_calibration *given,
					const char *given_path, struct incise_error *err)
{
	return incise_budget_open(recording,
				  &(struct incise_export_options){
					  .calibration = given,
					  .calibration_path = given_path,
				  },
				  true, err);
}

void incise_budget_free(struct incise_budget *budget)
{
	free(budget);
}

double incise_budget_u(const struct incise_budget *budget,
		       enum incise_budget_source source)
{
	return budget->u[source];
}

double incise_budget_covariance(const struct incise_budget *budget,
				enum incise_budget_source a, enum incise_budget_source b)
{
	if (isnan(budget->u[a]) || isnan(budget->u[b]))
		return NAN;
	return budget->covariance[a][b];
}

const char *incise_budget_missing(const struct incise_budget *budget,
				  enum incise_budget_quantity quantity)
{
	return *budget->missing[quantity] ? budget->missing[quantity] : NULL;
}

/* Noise of the position along a direction. */
static double noise_along(const struct incise_budget *budget, const double direction[3])
{
	double sum = 0;

	for (int i = 0; i < 3; i++)
		for (int k = 0; k < 3; k++)
			sum += direction[i] * direction[k] * budget->position_mm2[i][k];
	return sqrt(fmax(sum, 0));
}

/* The parts of tip: change per mm of its coordinates, times the factor of their covariance. */
static void tip_parts(const struct incise_budget *budget, const double change[3],
		      double part[3])
{
	for (int k = 0; k < 3; k++) {
		part[k] = 0;
		for (int i = k; i < 3; i++)
			part[k] += change[i] * budget->tip[i][k];
	}
}

void incise_budget_row(const struct incise_budget *budget,
		       const struct incise_budget_row *row,
		       double part[INCISE_BUDGET_PARTS])
{
	const double *u = budget->u;
	double zero_N = u[INCISE_BUDGET_ZERO] / budget->mV_N, r = budget->gain_zero;
	double along = noise_along(budget, row->direction);
	double between =
		sqrt((1 - row->share) * (1 - row->share) + row->share * row->share);
	double alignment_s = row->tracker_time ? 0 : u[INCISE_BUDGET_ALIGNMENT];
	double line_s = row->tracker_time ? 0 : u[INCISE_BUDGET_LINE];
	double jitter_s = row->tracker_time ? 0 : budget->jitter_s;

	part[FORCE_GAIN] = -row->force_N / budget->mV_N * u[INCISE_BUDGET_GAIN] -
			   (r != 0 ? r * zero_N : 0);
	part[FORCE_ZERO] = -zero_N * sqrt(1 - r * r);
	part[FORCE_RESOLUTION] = budget->resolution_N * row->force_share;
	part[FORCE_NOISE] = budget->noise_N * row->force_share;

	tip_parts(budget, row->tip, part + DEPTH_TIP);
	part[DEPTH_SURFACE] = u[INCISE_BUDGET_SURFACE];
	part[DEPTH_ALIGNMENT] = -row->depth_rate_mm_s * alignment_s;
	part[DEPTH_LINE] = -row->depth_rate_mm_s * line_s;
	part[DEPTH_NOISE] = noise_along(budget, budget->normal) * between;
	part[DEPTH_JITTER] = fabs(row->depth_rate_mm_s) * jitter_s;

	tip_parts(budget, row->tip_1_s, part + VELOCITY_TIP);
	part[VELOCITY_ALIGNMENT] = -row->acceleration_mm_s2 * alignment_s;
	part[VELOCITY_LINE] = -row->acceleration_mm_s2 * line_s;
	part[VELOCITY_NOISE] =
		along * (row->smoothed ? budget->smoother_1_s : budget->line_1_s);
	part[VELOCITY_SMOOTHING] = row->smoothed ? 0 : budget->smoothing_mm_s;
	part[VELOCITY_JITTER] = fabs(row->acceleration_mm_s2) * jitter_s;

	part[TIME_DELAY] = budget->delay_s;
	part[TIME_ALIGNMENT] = (budget->shared + row->tracker_time) == 0
				       ? 0
				       : (budget->shared + row->tracker_time) *
						 u[INCISE_BUDGET_ALIGNMENT];
	part[TIME_LINE] = row->tracker_time ? u[INCISE_BUDGET_LINE] : 0;
	part[TIME_JITTER] = row->tracker_time ? 0 : budget->jitter_s;
}

double incise_budget_total(enum incise_budget_quantity quantity,
			   const double part[INCISE_BUDGET_PARTS])
{
	const struct incise_budget_value *value = &values[quantity];
	double sum = 0;

	for (int i = value->first; i < value->first + value->n; i++)
		sum += part[i] * part[i];
	return sqrt(sum);
}

/* --- means --------------------------------------------------------------------------- */

static bool is_own(int i)
{
	return parts[i].scope == INCISE_BUDGET_OWN && i != VELOCITY_SMOOTHING;
}

/* Go on to other records of the tracker: the weights of those behind are complete. */
static void to_records(struct incise_budget_mean *mean, const int64_t record_ns[2])
{
	if (mean->record_ns[0] == record_ns[0] && mean->record_ns[1] == record_ns[1])
		return;
	mean->depth2 += mean->depth[0] * mean->depth[0];
	mean->depth[0] = 0;
	if (mean->record_ns[1] == record_ns[0])
		mean->depth[0] = mean->depth[1];
	else
		mean->depth2 += mean->depth[1] * mean->depth[1];
	mean->depth[1] = 0;
	mean->record_ns[0] = record_ns[0];
	mean->record_ns[1] = record_ns[1];
}

/* The errors that are common to a recording end with it. */
static void to_recording(struct incise_budget_mean *mean, int recording)
{
	if (mean->recording == recording)
		return;
	for (int i = 0; i < PARTS; i++)
		if (parts[i].scope == INCISE_BUDGET_RECORDING) {
			mean->past2[i] += mean->sum[i] * mean->sum[i];
			mean->sum[i] = 0;
		}
	to_records(mean, (const int64_t[2]){INT64_MIN, INT64_MIN});
	mean->recording = recording;
}

void incise_budget_mean_add(struct incise_budget_mean *mean,
			    const struct incise_budget *budget, int recording,
			    const int64_t record_ns[2],
			    const struct incise_budget_row *row)
{
	double part[PARTS], noise_mm = noise_along(budget, budget->normal);
	int64_t window = (int64_t)floor((double)record_ns[0] * 1e-9 / budget->window_s);
	/* A code that no noise moves is off by the same in all samples. */
	bool still = budget->noise_N < budget->resolution_N * sqrt(3);

	incise_budget_row(budget, row, part);
	to_recording(mean, recording);
	to_records(mean, record_ns);
	if (window != mean->window) {
		mean->velocity2 += mean->velocity * mean->velocity;
		mean->velocity = 0;
		mean->window = window;
	}
	mean->depth[0] += (1 - row->share) * noise_mm;
	mean->depth[1] += row->share * noise_mm;
	mean->velocity += part[VELOCITY_NOISE];
	for (int i = 0; i < PARTS; i++)
		mean->sum[i] += is_own(i) ? part[i] * part[i] : part[i];
	mean->force2 += part[FORCE_NOISE] * part[FORCE_NOISE];
	/* Samples that hang together count as one. */
	mean->sum[FORCE_NOISE] +=
		(budget->samples - 1) * part[FORCE_NOISE] * part[FORCE_NOISE];
	if (still)
		mean->sum[FORCE_RESOLUTION] += 2.0 * (double)mean->n *
					       part[FORCE_RESOLUTION] *
					       part[FORCE_RESOLUTION];
	mean->n++;
}

void incise_budget_mean_parts(const struct incise_budget_mean *mean, double part[PARTS])
{
	double n = (double)mean->n;

	for (int i = 0; i < PARTS; i++) {
		double sum = mean->sum[i];

		part[i] = is_own(i) ? sqrt(sum) / n : sum / n;
		if (mean->past2[i] > 0)
			part[i] = copysign(sqrt(mean->past2[i] + sum * sum), sum) / n;
	}
	/* Fewer rows than hang together have the noise of one. */
	part[FORCE_NOISE] = fmin(part[FORCE_NOISE], sqrt(mean->force2 / n));
	part[DEPTH_NOISE] = sqrt(mean->depth2 + mean->depth[0] * mean->depth[0] +
				 mean->depth[1] * mean->depth[1]) /
			    n;
	part[VELOCITY_NOISE] =
		sqrt(mean->velocity2 + mean->velocity * mean->velocity) / n;
}
