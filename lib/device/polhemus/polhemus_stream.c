// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From bytes of a tracker to samples; see polhemus_stream.h.
 */
#include <math.h>
#include <string.h>
#include "../../base/vector.h"
#include "polhemus_stream.h"

/* --- gaps --- */

#define OFF 2e-3    /* of its clock, a crystal */
#define EARLY_MAX 8 /* three in ten records, or so */
#define EARLY 4

void polhemus_gaps_init(struct polhemus_gaps *gaps, const uint8_t *stations, int n,
			bool counts, double hz, unsigned int length)
{
	*gaps = (struct polhemus_gaps){
		.n = n,
		.counts = counts,
		.period_ns = hz > 0 ? (int64_t)(1e9 / hz + 0.5) : 0,
		.length = length,
	};
	memcpy(gaps->order, stations, (size_t)n);
	if (hz > 0)
		incise_pace_init(&gaps->pace, counts ? hz / n : hz, OFF,
				 counts ? 1 : (unsigned int)n);
}

void polhemus_gaps_start(struct polhemus_gaps *gaps, int64_t t_ns)
{
	gaps->started = true;
	gaps->last_ns = t_ns;
}

void polhemus_gaps_broken(struct polhemus_gaps *gaps)
{
	gaps->broken = gaps->begun || gaps->started;
}

/* Less one round, which may be on its way. */
uint64_t polhemus_gaps_silent(const struct polhemus_gaps *gaps, int64_t t_ns)
{
	int64_t round_ns = gaps->n * gaps->period_ns;
	int64_t rounds = (gaps->begun || gaps->started) && round_ns
				 ? (t_ns - gaps->last_ns) / round_ns - 1
				 : 0;

	return rounds > 0 ? (uint64_t)(rounds * gaps->n) : 0;
}

static int find_gap_place(const struct polhemus_gaps *gaps, uint8_t station)
{
	for (int i = 0; i < gaps->n; i++)
		if (gaps->order[i] == station)
			return i;
	return 0;
}

static void step_polhemus_stream(struct polhemus_gaps *gaps, uint64_t steps)
{
	gaps->seq += steps;
	gaps->lost += steps - 1;
}

/* Steps from the last record to the next one of @where, at least 1. */
static uint64_t in_order(const struct polhemus_gaps *gaps, int where)
{
	return (uint64_t)((where - gaps->last - 1 + 2 * gaps->n) % gaps->n) + 1;
}

/* Records of whole rounds of the stations in @ns, to the nearest. */
static uint64_t in_rounds(const struct polhemus_gaps *gaps, double ns)
{
	double period_ns = gaps->pace.period_ns * (gaps->counts ? 1 : gaps->n);

	return ns > 0 && gaps->period_ns
		       ? (uint64_t)llround(ns / period_ns) * (uint64_t)gaps->n
		       : 0;
}

/* After a pause only time and order are known; time from the earliest possible arrival. */
static void step_over(struct polhemus_gaps *gaps, int64_t t_ns, int where)
{
	uint64_t steps = in_order(gaps, where);
	uint64_t due = gaps->counts ? (uint64_t)(where <= gaps->last) : steps;

	/* Without a period count one round, so that the gap shows. */
	steps += gaps->period_ns
			 ? in_rounds(gaps, incise_pace_late(&gaps->pace, t_ns, due))
			 : (uint64_t)gaps->n;
	step_polhemus_stream(gaps, steps);
	incise_pace_broken(&gaps->pace);
	incise_pace_add(&gaps->pace, t_ns, t_ns);
	gaps->broken = false;
	gaps->restarted = true;
}

/* Too early by half a period: impossible, unless it repeats. Then the line is wrong. */
static bool is_too_early(struct polhemus_gaps *gaps, double late_ns)
{
	if (late_ns >= -incise_pace_early_ns(&gaps->pace)) {
		gaps->early -= gaps->early > 0;
		return false;
	}
	gaps->early += EARLY;
	if (gaps->early <= EARLY_MAX)
		return true;
	gaps->early = 0;
	incise_pace_init(&gaps->pace, 1e9 / gaps->pace.nominal_ns, OFF, gaps->pace.unit);
	return false;
}

/* Two records in a row refused for their count agree: the count has restarted. */
static bool count_restarted(struct polhemus_gaps *gaps,
			    const struct polhemus_record *record)
{
	int64_t round_ns = gaps->n * gaps->period_ns;
	int64_t frames = (int32_t)(record->frame - gaps->refused_frame);
	int64_t apart_ns = record->t_ns - gaps->refused_ns - frames * round_ns;
	bool restarted = gaps->refused && frames >= 0 && apart_ns > -4 * round_ns &&
			 apart_ns < 4 * round_ns;

	gaps->refused++;
	gaps->refused_frame = record->frame;
	gaps->refused_ns = record->t_ns;
	return restarted;
}

static bool add_counted(struct polhemus_gaps *gaps, const struct polhemus_record *record,
			int where)
{
	int64_t frames = (int32_t)(record->frame - gaps->frame);
	int64_t steps = frames * gaps->n + where - gaps->last;

	/* A count of the past or of the future is damaged. */
	if (steps <= 0 || incise_pace_late(&gaps->pace, record->t_ns, (uint64_t)frames) <
				  -gaps->pace.period_ns / 2) {
		if (!count_restarted(gaps, record))
			return false;
		step_over(gaps, record->t_ns, where);
		return true;
	}
	step_polhemus_stream(gaps, (uint64_t)steps);
	/* All stations of a frame have its time. */
	if (frames) {
		incise_pace_skip(&gaps->pace, (uint64_t)frames - 1);
		incise_pace_add(&gaps->pace, record->t_ns, record->t_ns);
	}
	return true;
}

/*
 * Steps to a record by order and by its skipped bytes: as many as these make, to the nearest,
 * and fit into the time: a late host must not turn one into two.
 */
static uint64_t by_bytes(const struct polhemus_gaps *gaps,
			 const struct polhemus_record *record, int where)
{
	uint64_t steps = in_order(gaps, where), most, more;

	if (!record->skipped)
		return steps;
	most = (record->skipped + gaps->length / 2) / gaps->length;
	more = in_rounds(gaps, incise_pace_late(&gaps->pace, record->t_ns, steps));
	while (more && steps - 1 + more > most + (uint64_t)gaps->n - 1)
		more -= (uint64_t)gaps->n;
	return steps + more;
}

static bool add_timed(struct polhemus_gaps *gaps, const struct polhemus_record *record,
		      int where)
{
	double late_ns =
		incise_pace_late(&gaps->pace, record->t_ns, in_order(gaps, where));
	uint64_t steps;

	/* Its station is damaged, or it is there twice. */
	if (is_too_early(gaps, late_ns))
		return false;
	steps = by_bytes(gaps, record, where);
	incise_pace_skip(&gaps->pace, steps - 1);
	steps += incise_pace_add(&gaps->pace, record->t_ns, record->t_ns);
	step_polhemus_stream(gaps, steps);
	return true;
}

/* By order, and by skipped bytes of half a record or more. */
static void add_ordered(struct polhemus_gaps *gaps, const struct polhemus_record *record,
			int where)
{
	uint64_t steps = in_order(gaps, where);

	if (gaps->n == 1)
		steps += (record->skipped + gaps->length / 2) / gaps->length;
	step_polhemus_stream(gaps, steps);
}

/*
 * Before the first record, as many are missing as the skipped bytes make and fit into the
 * time; where the link was gone, all since the start, less one round for the first.
 */
static void begin_polhemus_stream(struct polhemus_gaps *gaps,
				  const struct polhemus_record *record)
{
	uint64_t n = (uint64_t)gaps->n, missing = 0, most;

	if (gaps->started) {
		most = in_rounds(gaps, (double)(record->t_ns - gaps->last_ns));
		missing = (record->skipped + gaps->length / 2) / gaps->length;
		if (gaps->period_ns && missing > most)
			missing = most;
		if (gaps->broken && polhemus_gaps_silent(gaps, record->t_ns) > missing)
			missing = polhemus_gaps_silent(gaps, record->t_ns);
	}
	gaps->begun = true;
	gaps->broken = false;
	/* Whole rounds, so that the stations keep their places. */
	gaps->seq = gaps->lost = (missing + n - 1) / n * n;
	if (gaps->period_ns)
		incise_pace_add(&gaps->pace, record->t_ns, record->t_ns);
}

bool polhemus_gaps_add(struct polhemus_gaps *gaps, const struct polhemus_record *record,
		       uint64_t *seq)
{
	int where = find_gap_place(gaps, record->station);

	gaps->restarted = false;
	if (!gaps->begun) {
		begin_polhemus_stream(gaps, record);
	} else if (gaps->broken) {
		step_over(gaps, record->t_ns, where);
	} else if (gaps->counts) {
		if (!add_counted(gaps, record, where))
			return false;
	} else if (!gaps->period_ns) {
		add_ordered(gaps, record, where);
	} else if (!add_timed(gaps, record, where)) {
		return false;
	}
	gaps->refused = 0;
	gaps->last_ns = record->t_ns;
	gaps->last = where;
	gaps->frame = record->frame;
	*seq = gaps->seq;
	return true;
}

/* --- samples --- */

#define CAPACITY ((size_t)POLHEMUS_RING_S * 240 * POLHEMUS_STATIONS)

int polhemus_stream_init(struct polhemus_stream *stream,
			 const struct incise_tracker_setup *setup,
			 const struct polhemus_layout *layout)
{
	double hz = polhemus_family_hz(layout->family, setup->n_stations);

	/* Pulses from outside have no known rate; the others have no such input. */
	if (layout->family == POLHEMUS_FASTRAK && setup->sync != INCISE_TRACKER_INTERNAL)
		hz = 0;
	memset(stream, 0, sizeof(*stream));
	stream->setup = *setup;
	polhemus_records_init(&stream->records, layout);
	polhemus_gaps_init(&stream->gaps, setup->stations, setup->n_stations,
			   layout->family != POLHEMUS_FASTRAK, hz,
			   (unsigned int)polhemus_layout_length(layout));
	return incise_ring_init(&stream->ring, sizeof(struct incise_tracker_sample),
				CAPACITY);
}

void polhemus_stream_free(struct polhemus_stream *stream)
{
	incise_ring_free(&stream->ring);
}

/*
 * The record's flag, or '=' where its station sends the same pose for too long. Records are
 * singles, which resolve 1e-5 mm: a thousandth of the noise.
 */
static char flag_of(struct polhemus_stream *stream, const struct polhemus_record *record)
{
	double pose[7];
	bool repeats;

	memcpy(pose, record->position_mm, sizeof(record->position_mm));
	memcpy(pose + 3, record->quaternion, sizeof(record->quaternion));
	repeats = tracker_repeats(
		&stream->repeat[(record->station - 1) % POLHEMUS_STATIONS], pose, 7,
		record->t_ns, stream->setup.repeat_ms);
	/* The device's own flag says more, unless it leaves the pose usable. */
	return repeats && incise_pose_usable(record->status) ? '=' : record->status;
}

static void put_sample(struct polhemus_stream *stream,
		       const struct polhemus_record *record, uint64_t seq)
{
	struct incise_tracker_sample sample = {
		.t_ns = record->t_ns,
		.seq = seq,
		.status = flag_of(stream, record),
		.station = record->station,
		.button = record->button,
		.restarted = stream->restarted,
	};
	double offset[3];

	memcpy(sample.quaternion, record->quaternion, sizeof(sample.quaternion));
	v3_rotate(offset, sample.quaternion, stream->setup.offset_mm);
	v3_add(sample.position_mm, record->position_mm, 1, offset);
	/* Where the ring is full, the next sample has the mark. */
	if (incise_ring_put(&stream->ring, &sample))
		stream->restarted = false;
	else
		stream->overflowed++;
}

static void number_polhemus_record(struct polhemus_stream *stream,
				   const struct polhemus_record *record)
{
	uint64_t seq;

	if (polhemus_gaps_add(&stream->gaps, record, &seq)) {
		stream->restarted |= stream->gaps.restarted;
		put_sample(stream, record, seq);
	}
}

static void count_polhemus_stream(struct polhemus_stream *stream, uint64_t silent)
{
	atomic_store_explicit(&stream->lost,
			      stream->gaps.lost + stream->overflowed + silent,
			      memory_order_relaxed);
	atomic_store_explicit(&stream->unsure,
			      stream->gaps.pace.unsure && !stream->gaps.counts,
			      memory_order_relaxed);
}

void polhemus_stream_silent(struct polhemus_stream *stream, int64_t t_ns)
{
	count_polhemus_stream(stream, polhemus_gaps_silent(&stream->gaps, t_ns));
}

void polhemus_stream_broken(struct polhemus_stream *stream,
			    const struct polhemus_layout *layout)
{
	polhemus_records_init(&stream->records, layout);
	stream->gaps.length = (unsigned int)polhemus_layout_length(layout);
	polhemus_gaps_broken(&stream->gaps);
	memset(stream->repeat, 0, sizeof(stream->repeat));
}

int polhemus_stream_put(struct polhemus_stream *stream, const unsigned char *bytes,
			size_t n, int64_t t_ns)
{
	struct polhemus_record record;
	int found = 0;

	while (n) {
		size_t some = n < POLHEMUS_RECORD_MAX ? n : POLHEMUS_RECORD_MAX;
		size_t taken = polhemus_records_put(&stream->records, bytes, some, t_ns);

		bytes += taken;
		n -= taken;
		for (; polhemus_records_next(&stream->records, &record); found++)
			number_polhemus_record(stream, &record);
	}
	count_polhemus_stream(stream, 0);
	return found;
}

uint64_t polhemus_stream_lost(const struct polhemus_stream *stream)
{
	return atomic_load_explicit(&stream->lost, memory_order_relaxed);
}
