// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From samples to blocks: the time of acquisition, the columns of a commit; see recorder.h.
 *
 *     force ────► timeline ─┐
 *       └► zero: 0.5 s      │
 *     tracker ──► timeline ─┼─► batch of the commit ─┬─► table blocks, with CRC and SHA-256
 *       └► depth: cuts      │                        └─► table seal
 *     camera ───► timeline ─┘
 *
 * Before the trigger, rows go into the pretrigger rings instead.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "../../base/vector.h"
#include "../frames.h"
#include "../ledger.h"
#include "../read/cut.h"
#include "../schema.h"
#include "recorder.h"

/* Time for the zero of the force channel, with the tool held free. */
#define ZERO_NS 500000000LL
/* The zero does not wait longer for a silent tracker. */
#define ZERO_PATIENCE_NS (2 * ZERO_NS)
/* The noise of the channel is some mN; a touch is tenths of N. */
#define ZERO_SD_MAX_N 0.03
/* Longer than devices and networks hold samples back. */
#define SILENT_NS 250000000LL
#define SILENT_PERIODS 4

/* --- streams ------------------------------------------------------------------------- */

/* A sample with its time of acquisition. */
struct force_row {
	uint64_t seq;
	int64_t t_ns;
	int32_t code;
};

struct tracker_row {
	int64_t t_ns;
	struct incise_tracker_sample sample;
};

/* The delay of the calibration if there is one, else that of the device. */
static int64_t delay_ns(double calibrated_ms, int64_t device_ns)
{
	return isnan(calibrated_ms) ? device_ns : llround(calibrated_ms * 1e6);
}

static void start_stream(struct incise_recorder *rec, int i, const char *name,
			 const char *device, double delay_sd_ms,
			 const struct incise_timeline_setup *setup)
{
	struct incise_recorder_stream *stream = &rec->streams[i];
	struct incise_timeline_setup with_sd = *setup;

	stream->name = name;
	stream->exists = true;
	stream->delay_sd_ms = delay_sd_ms;
	if (!isnan(delay_sd_ms))
		with_sd.delay_sd_ns = llround(delay_sd_ms * 1e6);
	snprintf(stream->device, sizeof(stream->device), "%s", device);
	incise_ledger_init(&stream->ledger);
	incise_timeline_init(&stream->timeline, &with_sd);
}

void incise_recorder_count_losses(struct incise_recorder *rec)
{
	struct incise_tracker *tracker = incise_rig_tracker(rec->rig);
	struct incise_force *force = incise_rig_force(rec->rig);

	if (force)
		rec->streams[INCISE_LEDGER_FORCE].lost_at_start =
			incise_force_lost(force);
	if (tracker)
		rec->streams[INCISE_LEDGER_TRACKER].lost_at_start =
			incise_tracker_lost(tracker);
}

void incise_recorder_start_streams(struct incise_recorder *rec)
{
	const struct incise_calibration *calibration = &rec->calibration;
	double force_sd_ms = calibration->force_delay_sd_ms;

	rec->started_ns = incise_clock_now(incise_rig_clock(rec->rig));
	/* A calibrated delay has the deviation that was measured with it. */
	if (isnan(force_sd_ms) && rec->force_info.t_sd_ns > 0)
		force_sd_ms = (double)rec->force_info.t_sd_ns * 1e-6;
	if (incise_rig_force(rec->rig))
		start_stream(rec, INCISE_LEDGER_FORCE, "force", rec->force_info.name,
			     force_sd_ms,
			     &(struct incise_timeline_setup){
				     .timestamped = true,
				     .rate_hz = rec->force_info.rate_hz,
				     .delay_ns = delay_ns(calibration->force_delay_ms, 0),
			     });
	if (incise_rig_tracker(rec->rig))
		start_stream(
			rec, INCISE_LEDGER_TRACKER, "tracker", rec->tracker_info.name,
			calibration->tracker_delay_sd_ms,
			&(struct incise_timeline_setup){
				/* A sender's timestamps, on this clock by the least delay. */
				.timestamped = rec->tracker_info.network,
				/* Pulses from outside have no period: no line is drawn. */
				.rate_hz = rec->tracker_info.external_sync
						   ? 0
						   : rec->tracker_info.rate_hz,
				.delay_ns = delay_ns(calibration->tracker_delay_ms,
						     rec->tracker_info.latency_ns),
				.grain_ns = rec->tracker_info.grain_ns,
			});
	incise_recorder_count_losses(rec);
	if (incise_rig_camera(rec->rig))
		start_stream(rec, INCISE_LEDGER_CAMERA, "camera", rec->camera_info.name,
			     calibration->camera_delay_sd_ms,
			     &(struct incise_timeline_setup){
				     .timestamped = true,
				     .rate_hz = rec->camera_info.rate_hz,
				     .delay_ns =
					     delay_ns(calibration->camera_delay_ms, 0),
			     });
}

uint64_t incise_recorder_lost(const struct incise_recorder *rec, int i)
{
	const struct incise_recorder_stream *stream = &rec->streams[i];
	uint64_t since = stream->gaps - stream->gaps_held;

	return stream->gaps_held + stream->silent +
	       (since > stream->device_lost ? since : stream->device_lost);
}

/* Samples that are missing in @silent_ns at an end of a stream; more of a hole than a device makes. */
static uint64_t missing_in(int64_t silent_ns, double rate_hz)
{
	const double periods = (double)silent_ns * 1e-9 * rate_hz;

	return silent_ns > SILENT_NS && periods > SILENT_PERIODS
		       ? (uint64_t)llround(periods) - 1
		       : 0;
}

bool incise_recorder_unsure(const struct incise_recorder *rec, int stream)
{
	struct incise_tracker *tracker = incise_rig_tracker(rec->rig);
	struct incise_force *force = incise_rig_force(rec->rig);
	struct incise_tracker_info tracker_info = {0};
	struct incise_force_info force_info = {0};

	if (tracker && stream == INCISE_LEDGER_TRACKER)
		incise_tracker_info(tracker, &tracker_info);
	if (force && stream == INCISE_LEDGER_FORCE)
		incise_force_info(force, &force_info);
	return tracker_info.lost_unsure || force_info.lost_unsure;
}

int incise_recorder_find_silence(struct incise_recorder *rec, struct incise_error *err)
{
	const struct incise_tracker_info *tracker = &rec->tracker_info;
	/* Pulses from outside may pause; a sender over a network has a rate. */
	const double rates_hz[] = {
		[INCISE_LEDGER_FORCE] = rec->force_info.rate_hz,
		[INCISE_LEDGER_TRACKER] = tracker->external_sync && !tracker->network
						  ? 0
						  : tracker->rate_hz,
		[INCISE_LEDGER_CAMERA] = rec->camera_info.rate_hz,
	};
	int rc = SQLITE_OK;

	for (int i = INCISE_LEDGER_FORCE; i <= INCISE_LEDGER_CAMERA; i++) {
		struct incise_recorder_stream *stream = &rec->streams[i];
		bool camera = i == INCISE_LEDGER_CAMERA;
		/* It keeps no frames of before the trigger; one that falls silent has ended. */
		int64_t began_ns = camera ? rec->camera.began_ns : rec->began_ns;
		uint64_t since = stream->gaps - stream->gaps_held, counted, late, early;

		if (!stream->rows || *stream->ended || !began_ns)
			continue;
		if (incise_recorder_unsure(rec, i))
			rc |= incise_recorder_note(
				rec, "lost",
				"%s: samples came in blocks: single losses may be missing "
				"in the count",
				stream->device);
		/* The device may have counted some of the rows that are missing at an end. */
		counted = stream->device_lost > since ? stream->device_lost - since : 0;
		late = missing_in(stream->first_row_ns - began_ns, rates_hz[i]);
		early = camera ? 0
			       : missing_in(rec->polled_ns - stream->ledger.last_ns,
					    rates_hz[i]);
		if (late)
			rc |= incise_recorder_note_at(
				rec, stream->first_row_ns, "lost",
				"%s: %llu samples: it began %.3f s after the recording",
				stream->device, (unsigned long long)late,
				(double)(stream->first_row_ns - began_ns) * 1e-9);
		if (early)
			rc |= incise_recorder_note(
				rec, "lost",
				"%s: %llu samples: it was silent for the last %.3f s",
				stream->device, (unsigned long long)early,
				(double)(rec->polled_ns - stream->ledger.last_ns) * 1e-9);
		stream->silent = camera ? (late > counted ? late - counted : 0)
					: late + (early > counted ? early - counted : 0);
	}
	return rc == SQLITE_OK ? 0 : incise_recorder_fail(rec, err);
}

static void describe_recorder_rows(const struct incise_recorder *rec, int i,
				   struct incise_stream *out)
{
	const struct incise_recorder_stream *stream = &rec->streams[i];
	struct incise_timeline_report report;

	incise_timeline_report(&stream->timeline, &report);
	*out = (struct incise_stream){
		.timestamped = stream->timeline.setup.timestamped,
		.nominal_hz = stream->timeline.setup.rate_hz,
		.delay_ms = (double)stream->timeline.setup.delay_ns * 1e-6,
		.delay_sd_ms = stream->delay_sd_ms,
		.rows = stream->rows,
		.lost = incise_recorder_lost(rec, i),
		.late = report.late,
		.rate_hz = report.rate_hz,
		.drift_ppm = report.drift_ppm,
		.drift_sd_ppm = report.drift_sd_ppm,
		.jitter_ms = report.jitter_ns * 1e-6,
		.jitter_max_ms = report.jitter_max_ns * 1e-6,
		.offset_ms = report.offset_ns * 1e-6,
		.offset_sd_ms = report.offset_sd_ns * 1e-6,
	};
	/* Without a period there is no line, but a mean rate. */
	if (!(out->nominal_hz > 0) && stream->rows > 1 &&
	    stream->ledger.last_ns > stream->first_ns)
		out->rate_hz = (double)(stream->rows - 1 + stream->gaps) /
			       (double)(stream->ledger.last_ns - stream->first_ns) * 1e9;
	if (i == INCISE_LEDGER_CAMERA && rec->camera_info.clock_ns)
		out->offset_sd_ms = hypot(out->offset_sd_ms,
					  (double)rec->camera_info.clock_ns * 1e-6);
	/* Only the delay of a timestamp is uncertain, and it is not known. */
	if (out->timestamped && isnan(out->delay_sd_ms))
		out->offset_sd_ms = NAN;
	snprintf(out->name, sizeof(out->name), "%s", stream->name);
	snprintf(out->device, sizeof(out->device), "%s", stream->device);
	snprintf(out->ended, sizeof(out->ended), "%s", stream->ended);
	snprintf(out->note, sizeof(out->note), "%s",
		 i == INCISE_LEDGER_FORCE     ? rec->force_info.note
		 : i == INCISE_LEDGER_TRACKER ? rec->tracker_info.note
					      : rec->camera_info.note);
}

int incise_recorder_describe_streams(const struct incise_recorder *rec,
				     struct incise_stream streams[INCISE_STREAMS_MAX])
{
	int n = 0;

	for (int i = 0; i < INCISE_LEDGER_STREAMS; i++)
		if (rec->streams[i].exists)
			describe_recorder_rows(rec, i, &streams[n++]);
	return n;
}

int incise_recorder_end_stream(struct incise_recorder *rec, int i, const char *why,
			       struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[i];

	snprintf(stream->ended, sizeof(stream->ended), "%.199s", why);
	return incise_recorder_check(
		rec, incise_recorder_note(rec, "failed", "%s: %s", stream->name, why),
		err);
}

/*
 * --- zero of the force channel -----------------------------------------------------------
 *
 *     force    |◄── 0.5 s: mean ──►|
 *     tracker      |◄── not in the tissue ──►|     comes later: up to 1 s is waited
 */

/* A difference of codes in mV. */
static double span_mV(const struct incise_recorder *rec, double codes)
{
	return codes * rec->force_info.full_scale_V * 1e3 / (1LL << rec->force_info.bits);
}

static double code_mV(const struct incise_recorder *rec, double code)
{
	return rec->force_info.offset_V * 1e3 + span_mV(rec, code);
}

static void zero_force(struct incise_recorder *rec, int64_t t_ns, int32_t code,
		       bool clipped)
{
	if (t_ns - rec->streams[INCISE_LEDGER_FORCE].first_ns >= ZERO_NS)
		return;
	if (!rec->zero.n++)
		rec->zero.base = code;
	rec->zero.sum += (double)code - rec->zero.base;
	rec->zero.sum2 += pow((double)code - rec->zero.base, 2);
	rec->zero.clipped |= clipped;
}

static void zero_depth(struct incise_recorder *rec, int64_t t_ns, double depth_mm)
{
	if (isnan(rec->stats.zero_mV) && rec->streams[INCISE_LEDGER_FORCE].started &&
	    t_ns - rec->streams[INCISE_LEDGER_FORCE].first_ns < ZERO_NS)
		rec->zero.depth_max_mm = fmax(rec->zero.depth_max_mm, depth_mm);
}

int incise_recorder_settle_zero(struct incise_recorder *rec, struct incise_error *err)
{
	const struct incise_recorder_zero *zero = &rec->zero;
	const char *remedy = "keep the tool free of contact for the first 0.5 s, or give "
			     "force_zero_mV in the calibration";
	double above = zero->sum / (double)zero->n, mean = zero->base + above;
	double var = fmax(0, zero->sum2 / (double)zero->n - above * above);
	double sd_mV = span_mV(rec, sqrt(var));
	double sd_N = sd_mV / fabs(rec->calibration.force_mV_N);

	rec->worthless = true;
	if (zero->depth_max_mm > INCISE_CUT_END_MM)
		return incise_error_set(
			err, EBUSY,
			"%s: the blade was %.1f mm deep while the zero of the "
			"force channel was measured; %s",
			rec->path, zero->depth_max_mm, remedy);
	if (zero->clipped)
		return incise_error_set(
			err, EBUSY,
			"%s: the force channel was at the end of its range while "
			"its zero was measured; check the amplifier; %s",
			rec->path, remedy);
	if (sd_N > ZERO_SD_MAX_N)
		return incise_error_set(
			err, EBUSY,
			"%s: the force varied by %.3f N (sd; expected at most %.2f) "
			"while its zero was measured; %s",
			rec->path, sd_N, ZERO_SD_MAX_N, remedy);
	rec->worthless = false;
	rec->stats.zero_mV = code_mV(rec, mean);
	if (incise_recorder_set_real(rec, "force_zero_mV", rec->stats.zero_mV) !=
		    SQLITE_OK ||
	    incise_recorder_set_real(rec, "force_zero_sd_mV", sd_mV) != SQLITE_OK ||
	    incise_recorder_set_integer(rec, "force_zero_samples", zero->n) !=
		    SQLITE_OK ||
	    incise_recorder_note(
		    rec, "zero", "force zero %.2f mV, sd %.2f mV over %lld samples",
		    rec->stats.zero_mV, sd_mV, (long long)zero->n) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	return 0;
}

bool incise_recorder_zero_due(const struct incise_recorder *rec)
{
	int64_t end_ns = rec->streams[INCISE_LEDGER_FORCE].first_ns + ZERO_NS;

	return isnan(rec->stats.zero_mV) && rec->streams[INCISE_LEDGER_FORCE].started &&
	       rec->streams[INCISE_LEDGER_FORCE].timeline.last_ns >= end_ns &&
	       (rec->zero.tracker_ns >= end_ns ||
		rec->streams[INCISE_LEDGER_FORCE].timeline.last_ns >=
			rec->streams[INCISE_LEDGER_FORCE].first_ns + ZERO_PATIENCE_NS);
}

/* --- rows ---------------------------------------------------------------------------- */

/*
 * Take a sample's number into its stream and find its time. A number that does not increase is a
 * fault of the backend. Returns 0 or -EIO.
 */
static int take_number(struct incise_recorder_stream *stream, uint64_t seq,
		       int64_t arrival_ns, int64_t *t_ns, struct incise_error *err)
{
	if (seq > INT64_MAX || (stream->started && seq < stream->next))
		return incise_error_set(err, EIO,
					"%s: sample %llu arrived after %llu; the "
					"driver of this device is faulty",
					stream->device, (unsigned long long)seq,
					(unsigned long long)stream->next - 1);
	*t_ns = incise_timeline_sample(&stream->timeline, seq, arrival_ns);
	if (!stream->started)
		stream->first_ns = *t_ns;
	stream->started = true;
	stream->next = seq + 1;
	return 0;
}

/*
 * A row of a stream's open block, for number and time and the columns that the caller fills; samples
 * missing before it are an event. Returns its place, or -errno.
 */
static ssize_t enter(struct incise_recorder *rec, int i, int64_t seq, int64_t t_ns,
		     struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[i];
	struct incise_ledger *ledger =
		i == INCISE_LEDGER_WALL ? &rec->wall.ledger : &stream->ledger;
	struct incise_batch *batch = &rec->batches[i];
	uint64_t missing = ledger->started ? (uint64_t)(seq - ledger->last_seq - 1) : 0;

	struct incise_ledger_block block;
	ssize_t at;

	batch->form = &incise_ledger_forms[i];
	/* After a stall: a commit may have several blocks of a stream. */
	if (batch->n == INCISE_BATCH_ROWS_MAX && incise_ledger_end(ledger, &block) &&
	    incise_block_writer_put(&rec->blocks, i, batch, &block) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	if (!incise_batch_reserve(batch, batch->n + 1))
		return incise_schema_no_memory(rec->path, err);
	at = (ssize_t)batch->n;
	batch->column[0].i[at] = seq;
	batch->column[1].i[at] = t_ns;
	batch->n++;
	incise_ledger_count(ledger, seq, t_ns);
	if (i == INCISE_LEDGER_WALL)
		return at;
	if (!stream->rows++)
		stream->first_row_ns = t_ns;
	stream->gaps += missing;
	if (missing && incise_recorder_note_at(
			       rec, t_ns, "lost", "%s: %llu samples before number %llu",
			       stream->device, (unsigned long long)missing,
			       (unsigned long long)seq) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	return at;
}

static int write_force(struct incise_recorder *rec, const struct force_row *row,
		       struct incise_error *err)
{
	const ssize_t at = enter(rec, INCISE_LEDGER_FORCE, row->seq, row->t_ns, err);
	int64_t top = (1LL << rec->force_info.bits) - 1;

	if (at < 0)
		return (int)at;
	rec->batches[INCISE_LEDGER_FORCE].column[2].i[at] = row->code;
	incise_recorder_follow_force(rec, row->t_ns, row->code);
	rec->stats.force_clipped += row->code == 0 || row->code == top;
	return 0;
}

/* Readers find depths again from the poses: they are counted, and cuts are events. */
static int count_depth(struct incise_recorder *rec, const struct incise_depth_row *row,
		       struct incise_error *err)
{
	bool before = rec->cut.inside;

	rec->stats.depth++;
	incise_recorder_follow_depth(rec, row);
	if (incise_cut_step(&rec->cut, row->depth_mm) == before || !rec->cuts)
		return 0;
	return incise_recorder_note_at(rec, row->t_ns, "cut", "cut %d %s", rec->cut.count,
				       rec->cut.inside ? "begins" : "ends") == SQLITE_OK
		       ? 0
		       : incise_recorder_fail(rec, err);
}

int incise_recorder_flush_depth(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_depth_row row;
	int rc = 0;

	while (!rc && incise_depth_flush(&rec->depth, &row))
		rc = count_depth(rec, &row, err);
	return rc;
}

/* Position of the blade's tip. Rows have the device's own position, depth is the tip's. */
static void tip_of(const struct incise_recorder *rec,
		   const struct incise_tracker_sample *sample, double tip_mm[3])
{
	double arm_mm[3];

	v3_rotate(arm_mm, sample->quaternion, rec->calibration.tip_mm);
	v3_add(tip_mm, sample->position_mm, 1, arm_mm);
}

static int write_tracker(struct incise_recorder *rec, const struct tracker_row *row,
			 struct incise_error *err)
{
	const struct incise_tracker_sample *sample = &row->sample;
	const ssize_t at =
		enter(rec, INCISE_LEDGER_TRACKER, (int64_t)sample->seq, row->t_ns, err);
	union incise_column *column = rec->batches[INCISE_LEDGER_TRACKER].column;
	struct incise_depth_row depth;
	double tip_mm[3];

	if (at < 0)
		return (int)at;
	column[2].i[at] = sample->t_ns + sample->after_ns;
	for (int i = 0; i < 3; i++)
		column[3 + i].r[at] = sample->position_mm[i];
	for (int i = 0; i < 4; i++)
		column[6 + i].r[at] = sample->quaternion[i];
	column[10].c[at] = sample->status;
	column[11].i[at] = sample->station;
	column[12].i[at] = sample->button;
	tip_of(rec, sample, tip_mm);
	/* A record that is no pose is kept, but gives no depth. */
	if (incise_pose_count(&rec->stats.poses, sample->status) &&
	    incise_depth_push(&rec->depth, (int64_t)sample->seq, row->t_ns, tip_mm,
			      &depth))
		return count_depth(rec, &depth, err);
	return 0;
}

/* --- wall time ------------------------------------------------------------------------ */

static int write_wall(struct incise_recorder *rec, const struct incise_wall_point *point,
		      struct incise_error *err)
{
	const char *const texts[] = {point->source, point->reference, point->leap,
				     point->restart};
	const ssize_t at =
		enter(rec, INCISE_LEDGER_WALL, (int64_t)rec->wall.rows, point->t_ns, err);
	union incise_column *column = rec->batches[INCISE_LEDGER_WALL].column;

	if (at < 0)
		return (int)at;
	rec->wall.rows++;
	column[2].i[at] = point->tai_ns;
	column[3].r[at] = isfinite(point->uncertainty_ns) ? point->uncertainty_ns : NAN;
	column[4].r[at] = point->rate_ppb;
	column[5].r[at] = point->rate_uncertainty_ppb;
	column[6].i[at] = point->utc_offset_s;
	column[7].i[at] = point->held;
	for (int i = 0; i < 4; i++) {
		memset(column[8 + i].s[at], 0, sizeof(*column->s));
		memcpy(column[8 + i].s[at], texts[i],
		       strnlen(texts[i], sizeof(*column->s) - 1));
	}
	return 0;
}

/* The points of the second before the trigger. */
static int release_wall(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_recorder_wall *wall = &rec->wall;
	int rc = 0;

	for (int i = 0; i < wall->n_kept && !rc; i++) {
		/* Nothing is before the first one. */
		if (!i)
			*wall->kept[i].restart = 0;
		rc = write_wall(rec, &wall->kept[i], err);
	}
	wall->n_kept = 0;
	return rc;
}

static int put_point(struct incise_recorder *rec, const struct incise_wall_point *point,
		     struct incise_error *err)
{
	struct incise_recorder_wall *wall = &rec->wall;
	const int most = sizeof(wall->kept) / sizeof(*wall->kept);

	wall->known = true;
	wall->newest = *point;
	if (!rec->stats.armed)
		return write_wall(rec, point, err);
	if (wall->n_kept == most) {
		memmove(wall->kept, wall->kept + 1, (most - 1) * sizeof(*wall->kept));
		wall->n_kept--;
	}
	wall->kept[wall->n_kept++] = *point;
	return 0;
}

int incise_recorder_put_wall(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_wall_result results[4];
	int n = 4, rc = 0;

	while (rec->wall.sampler && n == 4 && !rc) {
		n = incise_wall_sampler_take(rec->wall.sampler,
					     incise_clock_now(incise_rig_clock(rec->rig)),
					     results, 4);
		for (int i = 0; i < n && !rc; i++) {
			for (int k = 0; k < results[i].n_events && !rc; k++)
				rc = incise_recorder_check(
					rec,
					incise_recorder_note_at(
						rec, results[i].point.t_ns, "clock", "%s",
						results[i].events[k]),
					err);
			if (!rc)
				rc = put_point(rec, &results[i].point, err);
		}
	}
	return rc;
}

/*
 * --- pretrigger --------------------------------------------------------------------------
 *
 *     ─────────────[── 1 s kept ──]▼ trigger
 *                   recording ─────────────────────►
 *
 * The trigger is seen late, by the delay of the sample and by a poll: the second before it
 * contains its cause.
 */

/* More than a second at any rate near the nominal one. */
static size_t pretrigger_rows(double rate_hz)
{
	return rate_hz > 0 && rate_hz < 1e6 ? (size_t)ceil(rate_hz * 1.1) + 16 : 100000;
}

int incise_recorder_arm(struct incise_recorder *rec)
{
	int rc = incise_ring_init(&rec->pretrigger.force, sizeof(struct force_row),
				  pretrigger_rows(rec->force_info.rate_hz));

	if (!rc)
		rc = incise_ring_init(&rec->pretrigger.tracker,
				      sizeof(struct tracker_row),
				      pretrigger_rows(rec->tracker_info.rate_hz));
	rec->stats.armed = !rc;
	return rc;
}

void incise_recorder_disarm(struct incise_recorder *rec)
{
	incise_ring_free(&rec->pretrigger.force);
	incise_ring_free(&rec->pretrigger.tracker);
}

/* Add a row; the oldest is dropped when the ring is full. */
static void keep_recorder_rows(struct incise_ring *ring, const void *row)
{
	union {
		struct force_row force;
		struct tracker_row tracker;
	} oldest;

	while (!incise_ring_put(ring, row))
		incise_ring_take(ring, &oldest, 1);
}

/* Both streams start at one time, whatever the capacity of the rings. */
int incise_recorder_release(struct incise_recorder *rec, struct incise_error *err)
{
	int64_t now_ns = incise_clock_now(incise_rig_clock(rec->rig));
	int64_t from_ns = now_ns - INCISE_NS_PER_S;
	struct tracker_row tracker;
	struct force_row force;
	int rc = 0;

	rec->stats.armed = false;
	rec->not_finite = 0;
	if (from_ns > rec->began_ns)
		rec->began_ns = from_ns;
	incise_recorder_count_losses(rec);
	if (incise_recorder_note(rec, "trigger",
				 "triggered; the recording starts 1 s "
				 "before") != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	while (!rc && incise_ring_take(&rec->pretrigger.force, &force, 1))
		if (force.t_ns >= from_ns)
			rc = write_force(rec, &force, err);
	while (!rc && incise_ring_take(&rec->pretrigger.tracker, &tracker, 1))
		if (tracker.t_ns >= from_ns)
			rc = write_tracker(rec, &tracker, err);
	/* The device's count starts here; samples missing in the second before were lost too. */
	for (int i = 0; i < INCISE_LEDGER_STREAMS; i++)
		rec->streams[i].gaps_held = rec->streams[i].gaps;
	if (!rc)
		rc = release_wall(rec, err);
	incise_recorder_disarm(rec);
	return rc;
}

/*
 * --- rate of the tracker -------------------------------------------------------------------
 *
 * A window of records is of a higher rate if it is shorter than it can be, and not because some
 * were held up, as these arrive together; of a lower one if hardly any two are a period apart. One
 * may be so by chance, and after a backlog of a slow line; PACE_ODD in a row are not.
 */
#define PACE 60
#define PACE_ODD 4

/* 1: the window ended, and is of another rate; 0: of the right one; -1: it is not over. */
static int count_pace(struct incise_recorder_pace *pace, int64_t t_ns, double period_ns)
{
	double periods = (double)(t_ns - pace->last_ns) / period_ns, span_ns;
	int odd;

	if (!pace->last_ns)
		pace->from_ns = t_ns;
	else
		pace->n++;
	pace->together += pace->last_ns && periods < 0.25;
	pace->close += periods >= 0.25 && periods < 1.1;
	pace->last_ns = t_ns;
	if (pace->n < PACE)
		return -1;
	span_ns = (double)(t_ns - pace->from_ns);
	odd = pace->together <= PACE / 20 &&
	      (span_ns < 0.9 * PACE * period_ns || pace->close <= PACE / 10);
	pace->odd_ns = odd ? pace->odd_ns + span_ns : 0;
	pace->odd = odd ? pace->odd + 1 : 0;
	pace->from_ns = t_ns;
	pace->n = pace->together = pace->close = 0;
	return odd;
}

/*
 * A rate that the tracker does not say it has: the end of its stream when it starts so, later an
 * event, as what was recorded before is good. 0; -EIO: @why has the cause; or a disk error.
 */
static int check_pace(struct incise_recorder *rec, int64_t t_ns, struct incise_error *why,
		      struct incise_error *err)
{
	const struct incise_tracker_info *info = &rec->tracker_info;
	struct incise_recorder_pace *pace = &rec->pace;
	double hz;
	int odd;

	if (info->external_sync || !(info->rate_hz > 0))
		return 0;
	odd = count_pace(pace, t_ns, 1e9 / info->rate_hz);
	if (odd < 0)
		return 0;
	if (!odd) {
		pace->even = true;
		if (!pace->noted)
			return 0;
		pace->noted = false;
		return incise_recorder_check(
			rec,
			incise_recorder_note(rec, "rate",
					     "tracker: records arrive at %g Hz again",
					     info->rate_hz),
			err);
	}
	if (pace->odd < PACE_ODD || pace->noted)
		return 0;
	hz = pace->odd * PACE / pace->odd_ns * 1e9;
	if (!pace->even) {
		incise_error_set(
			why, EIO,
			"%s: sends %.0f records/s instead of %g; set its rate and "
			"sync, or tracker_setup in rig.conf, and start again",
			info->name, hz, info->rate_hz);
		return -EIO;
	}
	pace->noted = true;
	return incise_recorder_check(
		rec,
		incise_recorder_note(
			rec, "rate",
			"tracker: %.0f records/s arrive instead of %g: their t_ns is "
			"wrong from %.1f s before",
			hz, info->rate_hz, pace->odd_ns * 1e-9),
		err);
}

/* --- samples of the devices ---------------------------------------------------------- */

/* It waited in a queue while other devices were opened, which may take seconds. */
#define OLD_NS 100000000LL

static bool is_old(const struct incise_recorder *rec, int stream, int64_t t_ns)
{
	return !rec->streams[stream].started && t_ns < rec->started_ns - OLD_NS;
}

int incise_recorder_put_force(struct incise_recorder *rec,
			      const struct incise_force_sample *sample,
			      struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_FORCE];
	struct force_row row = {.seq = sample->seq, .code = sample->code};
	int64_t top = (1LL << rec->force_info.bits) - 1;
	struct incise_error why = {0};
	int rc = 0;

	if (is_old(rec, INCISE_LEDGER_FORCE, sample->t_ns))
		return 0;
	if (sample->code < 0 || sample->code > top)
		rc = incise_error_set(&why, EIO,
				      "%s: code %d is not within 0 to %lld; the driver "
				      "of this device is faulty",
				      stream->device, sample->code, (long long)top);
	if (rc || take_number(stream, sample->seq, sample->t_ns, &row.t_ns, &why))
		return incise_recorder_end_stream(rec, INCISE_LEDGER_FORCE, why.text,
						  err);
	if (rec->stats.armed)
		keep_recorder_rows(&rec->pretrigger.force, &row);
	else
		rc = write_force(rec, &row, err);
	if (!isnan(rec->stats.zero_mV)) {
		rec->stats.force_N = (code_mV(rec, sample->code) - rec->stats.zero_mV) /
				     rec->calibration.force_mV_N;
		rec->pretrigger.triggered |=
			rec->pretrigger.force_N > 0 &&
			fabs(rec->stats.force_N) >= rec->pretrigger.force_N;
	} else {
		zero_force(rec, row.t_ns, sample->code,
			   sample->code == 0 || sample->code == top);
	}
	return rc;
}

static bool finite_record(const struct incise_tracker_sample *sample)
{
	return v3_finite(sample->position_mm) && v3_finite(sample->quaternion) &&
	       isfinite(sample->quaternion[3]);
}

int incise_recorder_put_tracker(struct incise_recorder *rec,
				const struct incise_tracker_sample *sample,
				struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_TRACKER];
	struct tracker_row row = {.sample = *sample};
	struct incise_error why = {0};
	double tip_mm[3];
	int rc = 0;

	if (is_old(rec, INCISE_LEDGER_TRACKER, sample->t_ns))
		return 0;
	/* One line through both parts would be wrong for either. */
	if (sample->restarted)
		incise_timeline_replug(&stream->timeline);
	rc = check_pace(rec, sample->t_ns, &why, err);
	if (rc && !why.code)
		return rc;
	rc = 0;
	if (why.code || take_number(stream, sample->seq, sample->t_ns, &row.t_ns, &why))
		return incise_recorder_end_stream(rec, INCISE_LEDGER_TRACKER, why.text,
						  err);
	rec->zero.tracker_ns = row.t_ns;
	if (!finite_record(sample)) { /* the table cannot hold it: it counts as lost */
		rec->not_finite++;
		return incise_recorder_check(
			rec,
			incise_recorder_note(rec, "lost", "%s: record %llu is not finite",
					     stream->device,
					     (unsigned long long)sample->seq),
			err);
	}
	if (incise_pose_usable(sample->status)) {
		tip_of(rec, sample, tip_mm);
		rec->stats.depth_mm = incise_depth_of(&rec->depth, tip_mm);
		zero_depth(rec, row.t_ns, rec->stats.depth_mm);
	}
	if (sample->button != rec->stats.button) {
		rec->stats.button = sample->button;
		rec->pretrigger.triggered |= rec->pretrigger.button && sample->button;
		if (incise_recorder_note_at(rec, row.t_ns, "button", "%s",
					    sample->button ? "pressed" : "released") !=
		    SQLITE_OK)
			return incise_recorder_fail(rec, err);
	}
	if (rec->stats.armed)
		keep_recorder_rows(&rec->pretrigger.tracker, &row);
	else
		rc = write_tracker(rec, &row, err);
	return rc;
}

int incise_recorder_put_frame(struct incise_recorder *rec,
			      const struct incise_frame_record *frame,
			      struct incise_error *err)
{
	struct incise_recorder_stream *stream = &rec->streams[INCISE_LEDGER_CAMERA];
	union incise_column *column = rec->batches[INCISE_LEDGER_CAMERA].column;
	const double seen[] = {frame->length_px, frame->sd_px, frame->depth_mm,
			       frame->quality};
	struct incise_error why = {0};
	int64_t t_ns;
	ssize_t at;

	if (take_number(stream, frame->seq, frame->t_ns, &t_ns, &why))
		return incise_recorder_end_stream(rec, INCISE_LEDGER_CAMERA, why.text,
						  err);
	at = enter(rec, INCISE_LEDGER_CAMERA, (int64_t)frame->seq, t_ns, err);
	if (at < 0)
		return (int)at;
	column[2].i[at] = frame->arrival_ns;
	column[3].i[at] = frame->pts_ms;
	column[4].i[at] = (int64_t)frame->bytes;
	column[5].i[at] = frame->crc;
	for (int i = 0; i < 4; i++)
		column[6 + i].r[at] = isfinite(seen[i]) ? seen[i] : NAN;
	memcpy(column[10].h[at], frame->sha256, sizeof(*column->h));
	rec->stats.camera_depth_mm = frame->depth_mm;
	return 0;
}

/* --- tables streams, knots and ledger ------------------------------------------------ */

static int write_stream(struct incise_recorder *rec, int i)
{
	const struct incise_recorder_stream *stream = &rec->streams[i];
	sqlite3_stmt *stmt = rec->stmt[SET_STREAM];
	struct incise_stream now;

	describe_recorder_rows(rec, i, &now);
	sqlite3_bind_text(stmt, 1, now.name, -1, SQLITE_TRANSIENT);
	sqlite3_bind_text(stmt, 2, now.device, -1, SQLITE_TRANSIENT);
	sqlite3_bind_int(stmt, 3, now.timestamped);
	sqlite3_bind_double(stmt, 4, now.nominal_hz);
	sqlite3_bind_int64(stmt, 5, stream->timeline.setup.delay_ns);
	if (isnan(now.delay_sd_ms))
		sqlite3_bind_null(stmt, 6);
	else
		sqlite3_bind_int64(stmt, 6, stream->timeline.setup.delay_sd_ns);
	sqlite3_bind_int64(stmt, 7, stream->timeline.setup.grain_ns);
	sqlite3_bind_int64(stmt, 8, now.rows);
	sqlite3_bind_int64(stmt, 9, now.lost);
	sqlite3_bind_int64(stmt, 10, now.late);
	sqlite3_bind_double(stmt, 11, now.rate_hz);
	sqlite3_bind_double(stmt, 12, now.drift_ppm);
	sqlite3_bind_double(stmt, 13, now.drift_sd_ppm);
	sqlite3_bind_double(stmt, 14, now.jitter_ms * 1e6);
	sqlite3_bind_double(stmt, 15, now.jitter_max_ms * 1e6);
	sqlite3_bind_double(stmt, 16, now.offset_ms * 1e6);
	sqlite3_bind_double(stmt, 17, now.offset_sd_ms * 1e6);
	if (*now.ended)
		sqlite3_bind_text(stmt, 18, now.ended, -1, SQLITE_TRANSIENT);
	else
		sqlite3_bind_null(stmt, 18);
	return incise_schema_run(stmt);
}

static int write_knots(struct incise_recorder *rec, int i)
{
	const struct incise_recorder_stream *stream = &rec->streams[i];
	struct incise_timeline_knot knots[INCISE_TIMELINE_KNOTS_MAX];
	sqlite3_stmt *stmt = rec->stmt[DROP_KNOTS];
	int n = incise_timeline_knots(&stream->timeline, knots), rc;

	sqlite3_bind_text(stmt, 1, stream->name, -1, SQLITE_STATIC);
	rc = incise_schema_run(stmt);
	stmt = rec->stmt[INSERT_KNOT];
	for (int k = 0; k < n && rc == SQLITE_OK; k++) {
		sqlite3_bind_text(stmt, 1, stream->name, -1, SQLITE_STATIC);
		sqlite3_bind_int(stmt, 2, k);
		sqlite3_bind_int64(stmt, 3, knots[k].seq);
		sqlite3_bind_int64(stmt, 4, knots[k].t_ns);
		sqlite3_bind_double(stmt, 5, knots[k].sd_ns);
		sqlite3_bind_int(stmt, 6, knots[k].starts);
		rc = incise_schema_run(stmt);
	}
	return rc;
}

int incise_recorder_write_streams(struct incise_recorder *rec, bool knots)
{
	int rc = SQLITE_OK;

	for (int i = 0; i < INCISE_LEDGER_STREAMS && rc == SQLITE_OK; i++) {
		if (!rec->streams[i].exists)
			continue;
		rc = write_stream(rec, i);
		/* Timestamped samples need no line. */
		if (rc == SQLITE_OK && knots &&
		    !rec->streams[i].timeline.setup.timestamped)
			rc = write_knots(rec, i);
	}
	return rc;
}

int incise_recorder_write_ledger(struct incise_recorder *rec, int64_t t_ns, bool last)
{
	int rc = SQLITE_OK;

	for (int i = 0; i < INCISE_LEDGER_FORMS && rc == SQLITE_OK; i++) {
		const bool wall = i == INCISE_LEDGER_WALL;
		const bool exists =
			wall ? rec->wall.sampler != NULL : rec->streams[i].exists;
		struct incise_ledger *ledger =
			wall ? &rec->wall.ledger : &rec->streams[i].ledger;
		struct incise_ledger_block block;
		uint64_t lost = wall ? 0 : incise_recorder_lost(rec, i);

		if (incise_ledger_end(ledger, &block))
			rc = incise_block_writer_put(&rec->blocks, i, &rec->batches[i],
						     &block);
		if (!last || !exists || rc != SQLITE_OK)
			continue;
		/* Losses that no gap in the numbers shows. */
		incise_ledger_close(ledger, lost > ledger->lost ? lost - ledger->lost : 0,
				    &block);
		rc = incise_block_writer_put(&rec->blocks, i, &rec->batches[i], &block);
	}
	return rc == SQLITE_OK ? incise_block_writer_commit(&rec->blocks, t_ns) : rc;
}
