// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From bytes of a tracker to samples; see polhemus_stream.h.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "../../base/vector.h"
#include "polhemus_stream.h"

/* --- gaps --- */

#define REFUSED_MAX 2 /* in a row; then base_ns is wrong */
#define FAR_NS (INT64_C(1) << 60)

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

static void restart_window(struct polhemus_gaps *gaps)
{
	gaps->in_window = 0;
	gaps->moved = false;
	gaps->least_ns = FAR_NS;
}

static void step_polhemus_stream(struct polhemus_gaps *gaps, uint64_t steps)
{
	gaps->seq += steps;
	gaps->lost += steps - 1;
}

/* All stations of a counted frame have the time of the frame. */
static int64_t due_ns(const struct polhemus_gaps *gaps, uint64_t seq)
{
	uint64_t n = gaps->counts ? (uint64_t)gaps->n : 1;

	return (int64_t)((seq + gaps->first_place) / n * n) * gaps->period_ns;
}

static int64_t lateness(const struct polhemus_gaps *gaps, int64_t t_ns, uint64_t seq)
{
	return t_ns - gaps->base_ns - due_ns(gaps, seq);
}

/* Steps from the last record to the next one of @where, at least 1. */
static uint64_t in_order(const struct polhemus_gaps *gaps, int where)
{
	return (uint64_t)((where - gaps->last - 1 + 2 * gaps->n) % gaps->n) + 1;
}

/* Whole rounds of the stations in @ns, to the nearest. */
static uint64_t rounds(const struct polhemus_gaps *gaps, int64_t ns)
{
	int64_t round_ns = gaps->n * gaps->period_ns;

	return ns > 0 && round_ns ? (uint64_t)((ns + round_ns / 2) / round_ns) : 0;
}

/*
 * After a pause only time and order are known; time from the earliest possible arrival,
 * as the last record before the pause may have been late.
 */
static void step_over(struct polhemus_gaps *gaps, int64_t t_ns, int where)
{
	uint64_t steps = in_order(gaps, where);
	uint64_t more = rounds(gaps, lateness(gaps, t_ns, gaps->seq + steps));

	/* Without a period count one round, so that the gap shows. */
	if (!gaps->period_ns)
		more = 1;
	step_polhemus_stream(gaps, steps + more * (uint64_t)gaps->n);
	gaps->base_ns = t_ns - due_ns(gaps, gaps->seq);
	gaps->broken = gaps->settled = false;
	gaps->restarted = true;
	restart_window(gaps);
}

/* Too early by half a period: impossible, unless it repeats and base_ns is wrong. */
static bool is_too_early(struct polhemus_gaps *gaps, int64_t late)
{
	if (late >= -gaps->period_ns / 2 || !gaps->settled ||
	    gaps->refused >= REFUSED_MAX)
		return false;
	gaps->refused++;
	return true;
}

/* Lateness that stayed for a window is missing records; the rest is drift. */
static void look_back(struct polhemus_gaps *gaps, int64_t late)
{
	uint64_t missing = 0;

	if (late < 0) {
		gaps->moved |= late < -gaps->period_ns / 4;
		gaps->base_ns += late;
		late = 0;
	}
	if (!gaps->in_window)
		gaps->first_ns = late;
	if (late < gaps->least_ns)
		gaps->least_ns = late;
	if (++gaps->in_window < POLHEMUS_GAPS_WINDOW)
		return;
	/* Unless it shrinks: records that were held up arrive all at once. */
	if (late >= gaps->first_ns - gaps->period_ns / 2) {
		if (!gaps->counts)
			missing = rounds(gaps, gaps->least_ns) * (uint64_t)gaps->n;
		gaps->base_ns +=
			(gaps->least_ns - (int64_t)missing * gaps->period_ns) / 4;
	}
	gaps->seq += missing;
	gaps->lost += missing;
	gaps->settled = !gaps->moved;
	restart_window(gaps);
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
	int64_t late = steps > 0
			       ? lateness(gaps, record->t_ns, gaps->seq + (uint64_t)steps)
			       : -FAR_NS;

	/* A count of the past or of the future is damaged. */
	if (steps <= 0 || late < -gaps->n * gaps->period_ns / 2) {
		if (!count_restarted(gaps, record))
			return false;
		step_over(gaps, record->t_ns, where);
		return true;
	}
	step_polhemus_stream(gaps, (uint64_t)steps);
	look_back(gaps, late);
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
	more = rounds(gaps, lateness(gaps, record->t_ns, gaps->seq + steps)) *
	       (uint64_t)gaps->n;
	while (more && steps - 1 + more > most + (uint64_t)gaps->n - 1)
		more -= (uint64_t)gaps->n;
	return steps + more;
}

static bool add_timed(struct polhemus_gaps *gaps, const struct polhemus_record *record,
		      int where)
{
	int64_t late = lateness(gaps, record->t_ns, gaps->seq + in_order(gaps, where));

	/* Its station is damaged, or it is there twice. */
	if (is_too_early(gaps, late))
		return false;
	step_polhemus_stream(gaps, by_bytes(gaps, record, where));
	look_back(gaps, lateness(gaps, record->t_ns, gaps->seq));
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
				  const struct polhemus_record *record, int where)
{
	uint64_t n = (uint64_t)gaps->n, missing = 0, most;

	if (gaps->started) {
		most = rounds(gaps, record->t_ns - gaps->last_ns) * n;
		missing = (record->skipped + gaps->length / 2) / gaps->length;
		if (gaps->period_ns && missing > most)
			missing = most;
		if (gaps->broken && polhemus_gaps_silent(gaps, record->t_ns) > missing)
			missing = polhemus_gaps_silent(gaps, record->t_ns);
	}
	gaps->begun = true;
	gaps->broken = false;
	gaps->first_place = gaps->counts ? (uint64_t)where : 0;
	/* Whole rounds, so that the stations keep their places. */
	gaps->seq = gaps->lost = (missing + n - 1) / n * n;
	gaps->base_ns = record->t_ns - due_ns(gaps, gaps->seq);
	restart_window(gaps);
}

bool polhemus_gaps_add(struct polhemus_gaps *gaps, const struct polhemus_record *record,
		       uint64_t *seq)
{
	int where = find_gap_place(gaps, record->station);

	gaps->restarted = false;
	if (!gaps->begun) {
		begin_polhemus_stream(gaps, record, where);
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

#define WAIT_NS INT64_C(250000000)  /* for records that come by and by */
#define WORKER_NS INT64_C(50000000) /* for the kernel's worker, on a busy machine */
#define CAPACITY ((size_t)POLHEMUS_RING_S * 240 * POLHEMUS_STATIONS)

int polhemus_stream_init(struct polhemus_stream *stream,
			 const struct incise_tracker_setup *setup,
			 const struct polhemus_layout *layout)
{
	double hz = polhemus_family_hz(layout->family, setup->n_stations);
	int rc;

	/* Pulses from outside have no known rate; the others have no such input. */
	if (layout->family == POLHEMUS_FASTRAK && setup->sync != INCISE_TRACKER_INTERNAL)
		hz = 0;
	memset(stream, 0, sizeof(*stream));
	stream->setup = *setup;
	polhemus_records_init(&stream->records, layout);
	polhemus_gaps_init(&stream->gaps, setup->stations, setup->n_stations,
			   layout->family != POLHEMUS_FASTRAK, hz,
			   (unsigned int)polhemus_layout_length(layout));
	stream->wait.records = calloc(CAPACITY, sizeof(*stream->wait.records));
	if (!stream->wait.records)
		return -ENOMEM;
	rc = incise_ring_init(&stream->ring, sizeof(struct incise_tracker_sample),
			      CAPACITY);
	if (rc) {
		free(stream->wait.records);
		stream->wait.records = NULL;
	}
	return rc;
}

void polhemus_stream_free(struct polhemus_stream *stream)
{
	incise_ring_free(&stream->ring);
	free(stream->wait.records);
	stream->wait.records = NULL;
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

/* Lateness of one more record, if no record is missing before it and the waiting ones. */
static int64_t late_if_held_up(const struct polhemus_stream *stream,
			       const struct polhemus_record *record, uint64_t *seq)
{
	struct polhemus_gaps gaps = stream->gaps;

	if (stream->wait.n) {
		gaps.seq = stream->wait.seq;
		gaps.last = stream->wait.last;
	}
	*seq = gaps.seq + by_bytes(&gaps, record, find_gap_place(&gaps, record->station));
	return lateness(&gaps, record->t_ns, *seq);
}

/* Number the records that wait, the first of them behind @missing. */
static void release(struct polhemus_stream *stream, uint64_t missing)
{
	size_t n = stream->wait.n;

	stream->wait.n = 0;
	stream->gaps.seq += missing;
	stream->gaps.lost += missing;
	for (size_t i = 0; i < n; i++)
		number_polhemus_record(stream, &stream->wait.records[i]);
}

static int64_t round_of(const struct polhemus_gaps *gaps)
{
	return gaps->n * gaps->period_ns;
}

/*
 * By the least late one, as between them others may be missing. Lateness is never negative but
 * for a drift of 500 ppm: with one too many, a record would be there before its time.
 */
static uint64_t missing_before(const struct polhemus_stream *stream)
{
	const struct polhemus_gaps *gaps = &stream->gaps;
	int64_t round_ns = round_of(gaps), late_ns = stream->wait.late_ns;

	if (late_ns > stream->wait.least_late_ns)
		late_ns = stream->wait.least_late_ns;
	late_ns += late_ns / 2000 + round_ns / 256;
	return (uint64_t)(late_ns / round_ns) * (uint64_t)gaps->n;
}

/* Until then those that wait may be followed by others that were held up. */
int64_t polhemus_stream_due_ns(const struct polhemus_stream *stream)
{
	const struct polhemus_wait *wait = &stream->wait;
	int64_t half_ns = round_of(&stream->gaps) / 2;
	bool held_up = wait->least_late_ns < wait->first_late_ns - half_ns;

	return wait->n ? wait->since_ns + (held_up ? WORKER_NS : half_ns) : INT64_MAX;
}

/* The end of the wait, if the record that came last shows it. */
static void decide(struct polhemus_stream *stream)
{
	const struct polhemus_wait *wait = &stream->wait;
	int64_t round_ns = round_of(&stream->gaps);
	int64_t last_ns = wait->records[wait->n - 1].t_ns;

	if (wait->late_ns < round_ns)
		release(stream, 0);
	else if (last_ns >= polhemus_stream_due_ns(stream))
		release(stream, missing_before(stream));
	/* They come by and by, as of a slow line. */
	else if (last_ns - wait->records[0].t_ns > WAIT_NS + round_ns ||
		 wait->n == CAPACITY)
		release(stream, 0);
}

static void count_polhemus_stream(struct polhemus_stream *stream, uint64_t silent)
{
	atomic_store_explicit(&stream->lost,
			      stream->gaps.lost + stream->overflowed + silent,
			      memory_order_relaxed);
}

void polhemus_stream_quiet(struct polhemus_stream *stream, int64_t t_ns)
{
	if (!stream->wait.n || t_ns < polhemus_stream_due_ns(stream))
		return;
	release(stream, stream->wait.late_ns >= round_of(&stream->gaps) * 3 / 2
				? missing_before(stream)
				: 0);
	count_polhemus_stream(stream, 0);
}

static void take_record(struct polhemus_stream *stream,
			const struct polhemus_record *record)
{
	struct polhemus_gaps *gaps = &stream->gaps;
	struct polhemus_wait *wait = &stream->wait;
	int64_t late_ns;
	uint64_t seq;

	if (!gaps->begun || gaps->broken || gaps->counts || !gaps->period_ns) {
		number_polhemus_record(stream, record);
		return;
	}
	late_ns = late_if_held_up(stream, record, &seq);
	/* Maybe no call looked in between. */
	if (wait->n && late_ns >= wait->least_late_ns - round_of(gaps) / 2) {
		polhemus_stream_quiet(stream, record->t_ns);
		late_ns = late_if_held_up(stream, record, &seq);
	}
	if (!wait->n && late_ns < round_of(gaps) * 3 / 2) {
		number_polhemus_record(stream, record);
		return;
	}
	if (!wait->n)
		wait->first_late_ns = late_ns;
	if (!wait->n || late_ns < wait->least_late_ns - round_of(gaps) / 2) {
		wait->least_late_ns = late_ns;
		wait->since_ns = record->t_ns;
	}
	wait->late_ns = late_ns;
	wait->seq = seq;
	wait->last = find_gap_place(gaps, record->station);
	wait->records[wait->n++] = *record;
	decide(stream);
}

void polhemus_stream_silent(struct polhemus_stream *stream, int64_t t_ns)
{
	polhemus_stream_quiet(stream, t_ns);
	count_polhemus_stream(stream, polhemus_gaps_silent(&stream->gaps, t_ns));
}

void polhemus_stream_broken(struct polhemus_stream *stream,
			    const struct polhemus_layout *layout)
{
	polhemus_stream_quiet(stream, INT64_MAX);
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
			take_record(stream, &record);
	}
	count_polhemus_stream(stream, 0);
	return found;
}

uint64_t polhemus_stream_lost(const struct polhemus_stream *stream)
{
	return atomic_load_explicit(&stream->lost, memory_order_relaxed);
}
