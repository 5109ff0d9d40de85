// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * whether the stated uncertainties hold the truth. Virtual rigs with random
 * truth are each calibrated by the library's own functions, and record a cut; the errors of the
 * exported rows are compared with their intervals.
 *
 *     random truth ──► simulated rig ──► calibrations of force, tip and delay ──► calibration.conf
 *           │                └─────────► recording ──► export with parts ──► value ± 2 u
 *           └──► truth at each row's time ──────────────────────────► error ──► held or not
 *
 * The common part of an error follows from the errors of the calibrations, which are known here;
 * what is left is the row's own.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/arrow.h>
#include <incise/budget.h>
#include <incise/calibrate_delay.h>
#include <incise/calibrate_force.h>
#include <incise/calibrate_tip.h>
#include <incise/capture.h>
#include <incise/rig.h>
#include "../../lib/base/random.h"
#include "../../lib/base/vector.h"
#include "../../lib/sim/sim.h"
#include "../../tools/cli/folder.h"
#include "program.h"

#define RIGS 200
#define QUICK_RIGS 9
#define K 2.0 /* 95 % */
#define ASKED_LOW 0.93
#define ASKED_HIGH 0.97
#define EVERY 53 /* rows; a tracker's record spans 83 */

#define POLL_NS 10000000LL
#define FORCE_NS 100000 /* between samples of the force */

/* Stated by hand: a data sheet for the timestamps, a gauge for the surface. */
#define FORCE_DELAY_MS 0.3
#define FORCE_DELAY_U_MS 0.01
#define SURFACE_U_MM 0.03

enum { RAW, RESAMPLED, FORMS };
static const char *const forms[] = {"raw", "resampled"};

enum { TOTAL, COMMON, OWN, KINDS };
static const char *const kinds[] = {"total", "common", "own"};

/* A rig's truth; its numbers come from a stream of its own. */
struct rig {
	uint64_t key, draws;
	long seed;
	double gain_mV_N, zero_mV, noise_mV, force_delay_ms, jitter_ms;
	double tip_mm[3], surface_mm, tracker_noise_mm, latency_ms, tracker_jitter_ms,
		drift_ppm, depth_mm;
	char folder[200], conf[260], calibration[260];
	struct incise_error err;
};

static double uniform(struct rig *rig, double low, double high)
{
	return low + (high - low) * incise_random_uniform(rig->key, rig->draws++);
}

static double normal(struct rig *rig, double mean, double sd)
{
	return mean + sd * incise_random_normal(rig->key, rig->draws++);
}

static void draw_rig(struct rig *rig, long seed, int number, const char *folder)
{
	*rig = (struct rig){
		.key = incise_random_bits((uint64_t)seed, (uint64_t)number),
		.seed = 1 + 10 * number + 100000 * (seed % 10000),
	};
	snprintf(rig->folder, sizeof(rig->folder), "%s/%d", folder, number);
	folder_make_all(rig->folder);
	snprintf(rig->conf, sizeof(rig->conf), "%s/rig.conf", rig->folder);
	snprintf(rig->calibration, sizeof(rig->calibration), "%s/calibration.conf",
		 rig->folder);
	rig->gain_mV_N = uniform(rig, 1200, 1280);
	rig->zero_mV = uniform(rig, 100, 260);
	rig->noise_mV = uniform(rig, 2, 5);
	rig->force_delay_ms = normal(rig, FORCE_DELAY_MS, FORCE_DELAY_U_MS);
	rig->jitter_ms = uniform(rig, 0.002, 0.006);
	rig->tip_mm[0] = uniform(rig, -3, 3);
	rig->tip_mm[1] = uniform(rig, -3, 3);
	rig->tip_mm[2] = uniform(rig, -60, -20);
	/* The gauge's error: the surface is at 0. */
	rig->surface_mm = normal(rig, 0, SURFACE_U_MM);
	rig->tracker_noise_mm = uniform(rig, 0.015, 0.03);
	rig->latency_ms = uniform(rig, 2, 10);
	rig->tracker_jitter_ms = uniform(rig, 0.1, 0.4);
	rig->drift_ppm = uniform(rig, -100, 100);
	rig->depth_mm = uniform(rig, 6, 14);
}

/* rig.conf of the rig, with a motion, and a seed for what it does. */
static void write_rig(const struct rig *rig, int motion, int use, double cut_s)
{
	FILE *file = fopen(rig->conf, "w");

	if (!file)
		cli_fail("%s: cannot be written", rig->conf);
	fprintf(file,
		"clock = \"simulated\"; tracker = \"sim:\"; force = \"sim:\";\n"
		"surface = { point_mm = [0.0, 0.0, %.9f]; normal = [0.0, 0.0, 1.0]; };\n"
		"sim = { seed = %ld; motion = %d; depth_mm = [%.6f]; times = [1]; cut_s = %.3f; "
		"pause_s = 1.0; force_mV_N = %.9f; force_zero_mV = %.9f; "
		"force_noise_mV = %.9f; force_delay_ms = %.9f; force_jitter_ms = %.9f; "
		"tip_x_mm = %.9f; tip_y_mm = %.9f; tip_z_mm = %.9f; "
		"tracker_noise_mm = %.9f; tracker_latency_ms = %.9f; "
		"tracker_jitter_ms = %.9f; tracker_drift_ppm = %.9f; };\n",
		rig->surface_mm, rig->seed + use, motion, rig->depth_mm, cut_s,
		rig->gain_mV_N, rig->zero_mV, rig->noise_mV, rig->force_delay_ms,
		rig->jitter_ms, rig->tip_mm[0], rig->tip_mm[1], rig->tip_mm[2],
		rig->tracker_noise_mm, rig->latency_ms, rig->tracker_jitter_ms,
		rig->drift_ppm);
	if (fclose(file))
		cli_fail("%s: cannot be written", rig->conf);
}

/* --- calibrations: on the rig's data, by the library, into its calibration.conf --- */

static void add_value(struct incise_calibration_record *record, const char *key,
		      const char *unit, double left, double u)
{
	struct incise_calibration_value *value = &record->values[record->n++];

	snprintf(value->key, sizeof(value->key), "%s", key);
	snprintf(value->unit, sizeof(value->unit), "%s", unit);
	value->found = NAN;
	value->left = left;
	value->u = u;
}

static struct incise_calibration_record new_record(const char *kind)
{
	struct incise_calibration_record record = {.low = NAN, .high = NAN, .pass = true};

	snprintf(record.kind, sizeof(record.kind), "%s", kind);
	snprintf(record.method, sizeof(record.method), "against the force");
	return record;
}

#define READING_S 0.2
#define SETTLE_S 0.05

/* Mean of the channel's readings. */
static double read_mean_mV(struct incise_rig *opened, double load_N)
{
	struct incise_clock *clock = incise_rig_clock(opened);
	struct incise_force *force = incise_rig_force(opened);
	struct incise_force_sample samples[1000];
	int64_t start_ns = incise_clock_now(clock) + (int64_t)(SETTLE_S * 1e9);
	double sum = 0;
	int n = 0, got;

	incise_sim_load(incise_rig_sim(opened), load_N);
	incise_clock_wait_until(clock, start_ns + (int64_t)(READING_S * 1e9));
	while ((got = incise_force_read(force, samples, N(samples))) > 0)
		for (int i = 0; i < got; i++)
			if (samples[i].t_ns > start_ns) {
				sum += samples[i].code;
				n++;
			}
	return sum / n * 5000 / 4096;
}

/* Weights, a scale of 0.5 g and gravity of a place: their errors are drawn as they are stated. */
static int calibrate_force(struct rig *rig)
{
	static const double masses_g[] = {0, 60, 120, 180, 240, 300};
	struct incise_calibrate_force_pair pairs[3 * N(masses_g)];
	struct incise_calibration_record record = new_record("force");
	struct incise_calibrate_force_setup setup;
	struct incise_calibrate_force result;
	struct incise_rig *opened;
	double g, air, weight, off_g[N(masses_g)];
	int n = 0, rc;

	incise_calibrate_force_init(&setup);
	setup.gravity_u_m_s2 = 5e-4;
	setup.step_mV = 5000. / 4096;
	setup.dithered = true;
	g = normal(rig, setup.gravity_m_s2, setup.gravity_u_m_s2);
	air = uniform(rig, setup.air_kg_m3 - 0.1, setup.air_kg_m3 + 0.1);
	weight = normal(rig, setup.weight_kg_m3, setup.weight_u_kg_m3);
	for (int i = 0; i < N(masses_g); i++)
		off_g[i] = i ? uniform(rig, -setup.scale_g / 2, setup.scale_g / 2) : 0;
	write_rig(rig, 0, 1, 4);
	opened = incise_rig_open(rig->conf, INCISE_RIG_FORCE, &rig->err);
	if (!opened)
		return -1;
	for (int series = 0; series < 3; series++)
		for (int i = 0; i < N(masses_g); i++)
			pairs[n++] = (struct incise_calibrate_force_pair){
				.mass_g = masses_g[i],
				.reading_mV = read_mean_mV(
					opened, (masses_g[i] + off_g[i]) * 1e-3 * g *
							(1 - air / weight)),
				.series = series,
			};
	incise_rig_close(opened);
	rc = incise_calibrate_force(pairs, n, &setup, &result, NULL, &rig->err);
	if (rc)
		return rc;
	add_value(&record, "force_mV_N", "mV/N", result.sensitivity_mV_N,
		  result.sensitivity_u_mV_N);
	return incise_calibration_append(rig->calibration, &record, &rig->err);
}

#define TIP_S 10

static int calibrate_tip(struct rig *rig)
{
	static const char *const keys[] = {"tip_x_mm", "tip_y_mm", "tip_z_mm"};
	struct incise_calibration_record record = new_record("tip");
	static struct incise_tip_pose poses[TIP_S * 130];
	struct incise_tracker_sample samples[100];
	struct incise_tip_fit fit;
	struct incise_rig *opened;
	int n = 0, got, rc;

	write_rig(rig, 1, 2, TIP_S);
	opened = incise_rig_open(rig->conf, INCISE_RIG_TRACKER, &rig->err);
	if (!opened)
		return -1;
	for (int step = 0; step < 10 * (TIP_S + 1); step++) {
		struct incise_clock *clock = incise_rig_clock(opened);

		incise_clock_wait_until(clock, incise_clock_now(clock) + 10 * POLL_NS);
		while ((got = incise_tracker_read(incise_rig_tracker(opened), samples,
						  N(samples))) > 0)
			for (int i = 0; i < got && n < N(poses); i++) {
				poses[n].t_ns = samples[i].t_ns;
				v3_copy(poses[n].position_mm, samples[i].position_mm);
				memcpy(poses[n++].quaternion, samples[i].quaternion,
				       sizeof(poses->quaternion));
			}
	}
	incise_rig_close(opened);
	rc = incise_calibrate_tip(poses, n, NULL, &fit, &rig->err);
	if (rc)
		return rc;
	for (int i = 0; i < 3; i++) {
		add_value(&record, keys[i], "mm", fit.tip_mm[i],
			  sqrt(fit.covariance[4 * i]));
		for (int k = 0; k <= i; k++)
			record.covariance[record.n_covariance++] =
				fit.covariance[3 * i + k];
	}
	return incise_calibration_append(rig->calibration, &record, &rig->err);
}

/* Record the rig's motion; its clock's start, or -1 with *err. */
static int64_t record(struct rig *rig, const char *name, double time_s, char path[300],
		      struct incise_sim_config *config)
{
	struct incise_calibration calibration;
	struct incise_capture_options options = {.duration_s = time_s};
	struct incise_capture_result result;
	struct incise_rig *opened;
	int64_t start_ns;
	int rc;

	snprintf(path, 300, "%s/%s.rec", rig->folder, name);
	if (incise_calibration_load(rig->calibration, &calibration, &rig->err))
		return -1;
	opened = incise_rig_open(rig->conf, INCISE_RIG_TRACKER | INCISE_RIG_FORCE,
				 &rig->err);
	if (!opened)
		return -1;
	start_ns = incise_clock_now(incise_rig_clock(opened));
	*config = *incise_sim_config(incise_rig_sim(opened));
	options.recorder.calibration = &calibration;
	options.recorder.calibration_path = rig->calibration;
	rc = incise_capture_run(path, opened, &options, &result, &rig->err);
	incise_rig_close(opened);
	return rc ? -1 : start_ns;
}

static struct incise_delay_point *points_of(struct incise_recording *recording,
					    const char *name, int *n,
					    struct incise_error *err)
{
	struct incise_recording_value *values;
	struct incise_delay_point *points;

	*n = incise_recording_values(recording, name, &values, err);
	points = cli_alloc(*n > 0 ? *n : 1, sizeof(*points));
	for (int i = 0; i < *n; i++)
		points[i] = (struct incise_delay_point){values[i].t_ns, values[i].value};
	if (*n >= 0)
		free(values);
	return points;
}

#define DELAY_S 12

/* As incise calibrate delay does against the force. */
static int calibrate_delay(struct rig *rig)
{
	struct incise_calibration_record entry = new_record("delay");
	struct incise_recording_info info;
	struct incise_sim_config config;
	struct incise_delay_point *depth, *force;
	struct incise_recording *recording;
	struct incise_delay_fit fit;
	double delay_ms = NAN, line_ms = 0, u_ms;
	int n_depth, n_force, rc;
	char path[300];

	write_rig(rig, 2, 3, DELAY_S);
	if (record(rig, "delay", DELAY_S, path, &config) < 0)
		return -1;
	recording = incise_recording_open(path, &rig->err);
	if (!recording)
		return -1;
	rc = incise_recording_info(recording, &info, &rig->err);
	depth = points_of(recording, "depth", &n_depth, &rig->err);
	force = points_of(recording, "force", &n_force, &rig->err);
	incise_recording_close(recording);
	if (!rc)
		rc = incise_calibrate_delay(depth, n_depth, force, n_force,
					    INCISE_DELAY_FORCE, 150, &fit, &rig->err);
	free(depth);
	free(force);
	for (int i = 0; i < info.n_streams && !rc; i++)
		if (!strcmp(info.streams[i].name, "tracker")) {
			delay_ms = info.streams[i].delay_ms;
			/* The device's own delay has no uncertainty: it is that of the line. */
			line_ms = info.streams[i].offset_sd_ms;
		}
	folder_remove(path);
	if (rc)
		return rc;
	u_ms = hypot(fit.sd_ms, line_ms);
	add_value(&entry, "tracker_delay_ms", "ms", delay_ms + fit.delay_ms, u_ms);
	add_value(&entry, "tracker_delay_sd_ms", "ms", u_ms, 0);
	return incise_calibration_append(rig->calibration, &entry, &rig->err);
}

/* --- errors of a recording --- */

struct tally {
	double n, held, shares, shares2; /* shares of each rig, for their scatter */
};

/* Sources whose error is known: of the alignment with the line. */
static const struct {
	enum incise_budget_source source;
	const char *name;
} sources[] = {
	{INCISE_BUDGET_GAIN, "gain"},	{INCISE_BUDGET_ZERO, "zero"},
	{INCISE_BUDGET_TIP_X, "tip_x"}, {INCISE_BUDGET_TIP_Y, "tip_y"},
	{INCISE_BUDGET_TIP_Z, "tip_z"}, {INCISE_BUDGET_SURFACE, "surface"},
	{INCISE_BUDGET_DELAY, "delay"}, {INCISE_BUDGET_ALIGNMENT, "alignment"},
};

static struct totals {
	struct tally tally[FORMS][INCISE_BUDGET_QUANTITIES][KINDS];
	struct tally source[N(sources)];
	double source2[N(sources)]; /* squares of error over u */
	/* Products of errors of two rows far apart, and of one; stated ones. */
	double apart[INCISE_BUDGET_QUANTITIES], same[INCISE_BUDGET_QUANTITIES];
	double stated_apart[INCISE_BUDGET_QUANTITIES],
		stated_same[INCISE_BUDGET_QUANTITIES];
	int rigs, refused;
} totals;

/* A row with its errors and their stated parts. */
struct row {
	double error[INCISE_BUDGET_QUANTITIES];
	double part[INCISE_BUDGET_PARTS];
};

struct rows {
	struct row *row;
	int n, capacity;
};

/* Errors of the common sources: those of the calibrations, less the truth. */
struct known {
	double xi[INCISE_BUDGET_SOURCES]; /* over u, independent of each other */
	double force_s, alignment_s, alignment_u_s;
};

/* ξ of L ξ = error, with L the lower factor of the tip's covariance. */
static void solve_tip(const struct incise_budget *budget, const double error[3],
		      double xi[3])
{
	double l[3][3] = {0};

	for (int i = 0; i < 3; i++)
		for (int k = 0; k <= i; k++) {
			double rest = incise_budget_covariance(
				budget,
				(enum incise_budget_source)(INCISE_BUDGET_TIP_X + i),
				(enum incise_budget_source)(INCISE_BUDGET_TIP_X + k));

			for (int j = 0; j < k; j++)
				rest -= l[i][j] * l[k][j];
			l[i][k] = i == k ? sqrt(rest) : rest / l[k][k];
		}
	for (int i = 0; i < 3; i++) {
		double rest = error[i];

		for (int k = 0; k < i; k++)
			rest -= l[i][k] * xi[k];
		xi[i] = rest / l[i][i];
	}
}

/* Mean delay of the tracker's best times, s. */
static double tracker_late_s(struct incise_recording *recording, int64_t start_ns,
			     const struct incise_sim_config *config,
			     struct incise_error *err)
{
	double period_ns =
		1e9 / (config->tracker_hz * (1 + config->tracker_drift_ppm * 1e-6));
	struct incise_tracker_sample *poses;
	int n = incise_recording_poses(recording, &poses, err);
	double sum_ns = 0;

	for (int i = 0; i < n; i++)
		sum_ns += (double)(poses[i].t_ns - start_ns) -
			  (double)poses[i].seq * period_ns;
	if (n >= 0)
		free(poses);
	return n > 0 ? sum_ns / n * 1e-9 : NAN;
}

static int find_known(struct rig *rig, struct incise_recording *recording,
		      const struct incise_budget *budget, int64_t start_ns,
		      const struct incise_sim_config *config, struct known *known)
{
	struct incise_recording_info info;
	double tip_error[3];
	int rc = incise_recording_info(recording, &info, &rig->err);

	if (rc)
		return rc;
	*known = (struct known){0};
	known->xi[INCISE_BUDGET_GAIN] = (info.force_mV_N - rig->gain_mV_N) /
					incise_budget_u(budget, INCISE_BUDGET_GAIN);
	known->xi[INCISE_BUDGET_ZERO] = (info.zero_mV - rig->zero_mV) /
					incise_budget_u(budget, INCISE_BUDGET_ZERO);
	v3_sub(tip_error, info.tip_mm, rig->tip_mm);
	solve_tip(budget, tip_error, known->xi + INCISE_BUDGET_TIP_X);
	known->xi[INCISE_BUDGET_SURFACE] =
		rig->surface_mm / incise_budget_u(budget, INCISE_BUDGET_SURFACE);
	known->force_s = (rig->force_delay_ms - FORCE_DELAY_MS) * 1e-3;
	known->xi[INCISE_BUDGET_DELAY] =
		known->force_s / incise_budget_u(budget, INCISE_BUDGET_DELAY);
	known->alignment_s =
		tracker_late_s(recording, start_ns, config, &rig->err) - known->force_s;
	known->alignment_u_s = hypot(incise_budget_u(budget, INCISE_BUDGET_ALIGNMENT),
				     incise_budget_u(budget, INCISE_BUDGET_LINE));
	known->xi[INCISE_BUDGET_ALIGNMENT] = known->alignment_s / known->alignment_u_s;
	return isnan(known->alignment_s) ? -1 : 0;
}

static int column_of(const struct ArrowSchema *schema, const char *name)
{
	for (int i = 0; i < schema->n_children; i++)
		if (!strcmp(schema->children[i]->name, name))
			return i;
	cli_fail("bench coverage: the export has no column %s", name);
}

static double cell(const struct ArrowSchema *schema, const struct ArrowArray *block,
		   int column, int64_t row)
{
	const void *data = block->children[column]->buffers[1];

	return *schema->children[column]->format == 'f' ? ((const float *)data)[row]
							: ((const double *)data)[row];
}

/* Where the truth is: the same world again. */
struct world {
	struct incise_clock *clock;
	struct incise_sim *sim;
	int64_t start_ns, first_ns;
};

static void take_row(const struct world *world, const struct known *known,
		     const double value[INCISE_BUDGET_QUANTITIES], struct row *row)
{
	double t_ns = (double)(world->first_ns - world->start_ns) +
		      value[INCISE_BUDGET_TIME] * 1e9;
	/* The sample is on the grid: its timestamp scatters by much less than a step. */
	int64_t true_ns = llround((t_ns - known->force_s * 1e9) / FORCE_NS) * FORCE_NS;
	struct incise_sim_truth truth;

	incise_clock_wait_until(world->clock, world->start_ns + true_ns);
	incise_sim_truth(world->sim, &truth);
	row->error[INCISE_BUDGET_FORCE] = value[INCISE_BUDGET_FORCE] - truth.force_N;
	row->error[INCISE_BUDGET_DEPTH] =
		value[INCISE_BUDGET_DEPTH] + truth.position_mm[2];
	row->error[INCISE_BUDGET_VELOCITY] =
		value[INCISE_BUDGET_VELOCITY] - truth.velocity_mm_s;
	row->error[INCISE_BUDGET_TIME] = (t_ns - (double)true_ns) * 1e-9;
}

static void take_block(const struct ArrowSchema *schema, const struct ArrowArray *block,
		       const struct world *world, const struct known *known,
		       struct rows *rows, int64_t *count)
{
	int value_at[INCISE_BUDGET_QUANTITIES], part_at[INCISE_BUDGET_PARTS];

	for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++)
		value_at[q] = column_of(schema, incise_budget_values()[q].value);
	for (int i = 0; i < INCISE_BUDGET_PARTS; i++)
		part_at[i] = column_of(schema, incise_budget_parts()[i].column);
	for (int64_t i = 0; i < block->length; i++) {
		double value[INCISE_BUDGET_QUANTITIES];
		struct row *row;

		if ((*count)++ % EVERY || rows->n == rows->capacity)
			continue;
		for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++)
			value[q] = cell(schema, block, value_at[q], i);
		/* Resampled rows are outside of cuts, too. */
		if (!(value[INCISE_BUDGET_DEPTH] > INCISE_CUT_START_MM))
			continue;
		row = &rows->row[rows->n++];
		for (int k = 0; k < INCISE_BUDGET_PARTS; k++)
			row->part[k] = cell(schema, block, part_at[k], i);
		take_row(world, known, value, row);
	}
}

static int read_rows(struct rig *rig, struct incise_recording *recording, bool resample,
		     struct world *world, const struct known *known, struct rows *rows)
{
	struct incise_export_options how;
	struct ArrowArrayStream stream;
	struct incise_recording_info info;
	struct ArrowSchema schema;
	struct ArrowArray block;
	int64_t count = 0;
	int rc = incise_recording_info(recording, &info, &rig->err);

	incise_export_options_init(&how);
	how.uncertainty = INCISE_EXPORT_PARTS;
	how.resample = resample;
	world->first_ns = info.start_ns;
	if (!rc)
		rc = incise_recording_stream(recording, "table", &how, &stream,
					     &rig->err);
	if (rc)
		return rc;
	rc = stream.get_schema(&stream, &schema);
	while (!rc && !(rc = stream.get_next(&stream, &block)) && block.release) {
		take_block(&schema, &block, world, known, rows, &count);
		block.release(&block);
	}
	if (rc)
		snprintf(rig->err.text, sizeof(rig->err.text), "%s",
			 stream.get_last_error(&stream));
	else
		schema.release(&schema);
	stream.release(&stream);
	return rc;
}

/* --- tallies --- */

static void add_share(struct tally *tally, double held, double n)
{
	tally->n += n;
	tally->held += held;
	tally->shares += held / n;
	tally->shares2 += held / n * held / n;
}

/* The common part of a row's error, by the known errors, and both stated uncertainties. */
static void split(const struct row *row, const struct known *known,
		  enum incise_budget_quantity q, double *common, double u[KINDS])
{
	const struct incise_budget_value *value = &incise_budget_values()[q];
	double squares[KINDS] = {0}, alignment_u_s = 0;

	*common = 0;
	for (int i = value->first; i < value->first + value->n; i++) {
		const struct incise_budget_part *part = &incise_budget_parts()[i];
		int kind = part->scope == INCISE_BUDGET_OWN ? OWN : COMMON;

		squares[kind] += row->part[i] * row->part[i];
		squares[TOTAL] += row->part[i] * row->part[i];
		if (part->source == INCISE_BUDGET_ALIGNMENT ||
		    part->source == INCISE_BUDGET_LINE)
			alignment_u_s = hypot(alignment_u_s, row->part[i]) *
					(row->part[i] < 0 ? -1 : 1);
		else if (kind == COMMON)
			*common += row->part[i] * known->xi[part->source];
	}
	*common += alignment_u_s * known->xi[INCISE_BUDGET_ALIGNMENT];
	for (int k = 0; k < KINDS; k++)
		u[k] = sqrt(squares[k]);
}

static void tally_rows(const struct rows *rows, const struct known *known, int form)
{
	for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++) {
		double held[KINDS] = {0}, *common = cli_alloc(rows->n, sizeof(*common));
		int half = rows->n / 2;

		for (int i = 0; i < rows->n; i++) {
			const struct row *row = &rows->row[i];
			double u[KINDS], error = row->error[q];

			split(row, known, (enum incise_budget_quantity)q, &common[i], u);
			held[TOTAL] += fabs(error) <= K * u[TOTAL];
			held[COMMON] += fabs(common[i]) <= K * u[COMMON];
			held[OWN] += fabs(error - common[i]) <= K * u[OWN];
			if (form == RAW) {
				totals.same[q] += error * error;
				totals.stated_same[q] += u[TOTAL] * u[TOTAL];
			}
		}
		for (int i = 0; i < rows->n - half && form == RAW; i++) {
			const struct row *a = &rows->row[i], *b = &rows->row[i + half];
			const struct incise_budget_value *value =
				&incise_budget_values()[q];
			double weight = rows->n / (double)(rows->n - half);

			totals.apart[q] += weight * a->error[q] * b->error[q];
			for (int k = value->first; k < value->first + value->n; k++)
				if (incise_budget_parts()[k].scope != INCISE_BUDGET_OWN)
					totals.stated_apart[q] +=
						weight * a->part[k] * b->part[k];
		}
		for (int k = 0; k < KINDS; k++)
			add_share(&totals.tally[form][q][k], held[k], rows->n);
		free(common);
	}
}

static void tally_sources(const struct known *known)
{
	for (int s = 0; s < N(sources); s++) {
		double xi = known->xi[sources[s].source];

		add_share(&totals.source[s], fabs(xi) <= K, 1);
		totals.source2[s] += xi * xi;
	}
}

/* One rig, from its truth to its tallies. 0; else it was refused, with *err. */
static int run_rig(struct rig *rig)
{
	struct incise_recording *recording = NULL;
	struct incise_sim_config config;
	struct incise_budget *budget;
	struct rows rows = {.capacity = 4000};
	struct world world = {0};
	struct known known;
	char path[300];
	FILE *file = fopen(rig->calibration, "w");
	int rc;

	if (!file)
		cli_fail("%s: cannot be written", rig->calibration);
	fprintf(file,
		"force_delay_ms = %.9f; force_delay_sd_ms = %.9f; surface_u_mm = %.9f;\n",
		FORCE_DELAY_MS, FORCE_DELAY_U_MS, SURFACE_U_MM);
	fclose(file);
	rc = calibrate_force(rig);
	if (!rc)
		rc = calibrate_tip(rig);
	if (!rc)
		rc = calibrate_delay(rig);
	if (rc)
		return rc;
	write_rig(rig, 0, 4, 4);
	world.start_ns = record(rig, "cut", 6, path, &config);
	if (world.start_ns < 0)
		return -1;
	recording = incise_recording_open(path, &rig->err);
	if (!recording)
		return -1;
	budget = incise_budget_new(recording, NULL, NULL, &rig->err);
	rc = budget ? find_known(rig, recording, budget, world.start_ns, &config, &known)
		    : -1;
	rows.row = cli_alloc(rows.capacity, sizeof(*rows.row));
	for (int form = 0; form < FORMS && !rc; form++) {
		rows.n = 0;
		world.clock = incise_clock_new_simulated(world.start_ns);
		world.sim = cli_require(incise_sim_new(&config, world.clock, &rig->err),
					&rig->err);
		rc = read_rows(rig, recording, form == RESAMPLED, &world, &known, &rows);
		if (!rc)
			tally_rows(&rows, &known, form);
		incise_sim_free(world.sim);
		incise_clock_free(world.clock);
	}
	if (!rc)
		tally_sources(&known);
	incise_budget_free(budget);
	incise_recording_close(recording);
	free(rows.row);
	folder_remove(rig->folder);
	return rc;
}

/* --- the report --- */

static struct coverage_row {
	const char *name, *form, *part;
	double coverage, sd, asked_low, asked_high;
	char failed[120];
} coverage_rows[FORMS * INCISE_BUDGET_QUANTITIES * KINDS];

static struct source_row {
	const char *name;
	double coverage, rms;
} source_rows[N(sources)];

static struct correlation_row {
	const char *name;
	double measured, stated;
} correlation_rows[INCISE_BUDGET_QUANTITIES];

static const struct bench_table coverage_table = {
	.key = "rows",
	.row_bytes = sizeof(struct coverage_row),
	.columns = {COLUMN(coverage_row, "name", name),
		    COLUMN(coverage_row, "form", form),
		    COLUMN(coverage_row, "part", part),
		    COLUMN(coverage_row, "coverage", coverage),
		    COLUMN(coverage_row, "sd", sd),
		    COLUMN(coverage_row, "failed", failed, .optional = true)},
	.metrics = {METRIC(EXACT, coverage_row, coverage, "1",
			   "{name}, {form}, {part}: held")},
};

static const struct bench_table source_table = {
	.key = "sources",
	.row_bytes = sizeof(struct source_row),
	.columns = {COLUMN(source_row, "name", name),
		    COLUMN(source_row, "coverage", coverage),
		    COLUMN(source_row, "rms", rms)},
};

static const struct bench_table correlation_table = {
	.key = "correlations",
	.row_bytes = sizeof(struct correlation_row),
	.columns = {COLUMN(correlation_row, "name", name),
		    COLUMN(correlation_row, "measured", measured),
		    COLUMN(correlation_row, "stated", stated)},
};

static double sd_of(const struct tally *tally, int rigs)
{
	double mean = tally->shares / rigs;

	return sqrt(fmax(0, tally->shares2 / rigs - mean * mean) / (rigs - 1));
}

static void fill_row(int form, int q, int k, struct coverage_row *row)
{
	const struct tally *tally = &totals.tally[form][q][k];
	double chance;

	*row = (struct coverage_row){
		.name = incise_budget_values()[q].name,
		.form = forms[form],
		.part = kinds[k],
		.coverage = tally->held / tally->n,
		.sd = sd_of(tally, totals.rigs),
	};
	/* Three deviations are left to chance; what is common is one draw for each rig. */
	chance = k == OWN ? row->sd : fmax(row->sd, sqrt(0.95 * 0.05 / totals.rigs));
	if (row->coverage < ASKED_LOW - 3 * chance ||
	    row->coverage > ASKED_HIGH + 3 * chance)
		snprintf(row->failed, sizeof(row->failed),
			 "%.1f %% held, 93 to 97 %% are asked for", 100 * row->coverage);
}

static void fill_rows(void)
{
	struct coverage_row *row = coverage_rows;

	for (int form = 0; form < FORMS; form++)
		for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++)
			for (int k = 0; k < KINDS; k++)
				fill_row(form, q, k, row++);
	for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++)
		correlation_rows[q] = (struct correlation_row){
			incise_budget_values()[q].name,
			totals.apart[q] / totals.same[q],
			totals.stated_apart[q] / totals.stated_same[q],
		};
	for (int s = 0; s < N(sources); s++)
		source_rows[s] = (struct source_row){
			sources[s].name,
			totals.source[s].held / totals.source[s].n,
			sqrt(totals.source2[s] / totals.rigs),
		};
}

static void run(struct bench_run *run)
{
	int n = run->quick ? QUICK_RIGS : RIGS;
	long seed = run->seed ? run->seed : 1;
	char folder[150], why[200] = "";

	totals = (struct totals){0};
	/* An interrupted run removes the folder, too. */
	cli_catch_signals();
	folder_make(folder, sizeof(folder), "recordings of virtual rigs");
	for (int i = 0; i < n && !cli_stop; i++) {
		struct rig rig;

		cli_progress("rig %d of %d", i + 1, n);
		draw_rig(&rig, seed, i, folder);
		if (run_rig(&rig)) {
			totals.refused++;
			snprintf(why, sizeof(why), "%.190s", rig.err.text);
		} else {
			totals.rigs++;
		}
	}
	cli_progress_end();
	folder_remove(folder);
	if (cli_stop)
		cli_fail("interrupted");
	if (totals.rigs < 2) {
		bench_fail(run, "no rig could be calibrated: %s", why);
		return;
	}
	fill_rows();
	bench_values(run, "{si si sI sf}", "rigs", totals.rigs, "refused", totals.refused,
		     "seed", (json_int_t)seed, "k", K);
	bench_rows(run, &coverage_table, coverage_rows, N(coverage_rows));
	bench_rows(run, &source_table, source_rows, N(source_rows));
	bench_rows(run, &correlation_table, correlation_rows, N(correlation_rows));
}

const struct bench bench_program = {
	.name = "coverage",
	.summary = "whether stated uncertainties hold the truth, on virtual\n"
		   "rigs that are calibrated anew",
	.takes_seed = true,
	.run = run,
};
