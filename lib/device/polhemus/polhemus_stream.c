// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From bytes of the device to samples in a ring; see polhemus_stream.h.
 */
#include <string.h>
#include "polhemus_stream.h"

#define ROOM ((size_t)POLHEMUS_RING_S * 240 * POLHEMUS_STATIONS)

int polhemus_stream_init(struct polhemus_stream *stream,
			 const struct incise_tracker_setup *setup,
			 const struct polhemus_layout *layout)
{
	double hz = polhemus_family_hz(layout->family, setup->n_stations);

	/* Pulses from outside come as they like; the others have no such input. */
	if (layout->family == POLHEMUS_FASTRAK && setup->sync != INCISE_TRACKER_INTERNAL)
		hz = 0;
	memset(stream, 0, sizeof(*stream));
	stream->setup = *setup;
	polhemus_records_init(&stream->records, layout);
	polhemus_gaps_init(&stream->gaps, setup->stations, setup->n_stations,
			   layout->family != POLHEMUS_FASTRAK, hz,
			   (unsigned int)polhemus_layout_length(layout));
	return incise_ring_init(&stream->ring, sizeof(struct incise_tracker_sample),
				ROOM);
}

void polhemus_stream_start(struct polhemus_stream *stream, int64_t t_ns)
{
	polhemus_gaps_start(&stream->gaps, t_ns);
}

void polhemus_stream_free(struct polhemus_stream *stream)
{
	incise_ring_free(&stream->ring);
}

void polhemus_stream_broken(struct polhemus_stream *stream,
			    const struct polhemus_layout *layout)
{
	polhemus_records_init(&stream->records, layout);
	stream->gaps.length = (unsigned int)polhemus_layout_length(layout);
	polhemus_gaps_broken(&stream->gaps);
}

void polhemus_stream_silent(struct polhemus_stream *stream, int64_t t_ns)
{
	atomic_store_explicit(&stream->lost,
			      stream->gaps.lost + stream->no_room +
				      polhemus_gaps_silent(&stream->gaps, t_ns),
			      memory_order_relaxed);
}

/* to += v turned by the unit quaternion q: v + 2w(u × v) + 2u × (u × v). */
static void add_turned(double to[3], const double q[4], const double v[3])
{
	double t[3], u[3] = {q[1], q[2], q[3]};

	for (int i = 0; i < 3; i++)
		t[i] = 2 * (u[(i + 1) % 3] * v[(i + 2) % 3] -
			    u[(i + 2) % 3] * v[(i + 1) % 3]);
	for (int i = 0; i < 3; i++)
		to[i] += v[i] + q[0] * t[i] + u[(i + 1) % 3] * t[(i + 2) % 3] -
			 u[(i + 2) % 3] * t[(i + 1) % 3];
}

static void put_sample(struct polhemus_stream *stream,
		       const struct polhemus_record *record, uint64_t seq)
{
	struct incise_tracker_sample sample = {
		.t_ns = record->t_ns,
		.seq = seq,
		.status = record->status,
		.station = record->station,
		.button = record->button,
		.begins = stream->anew,
	};

	memcpy(sample.position_mm, record->position_mm, sizeof(sample.position_mm));
	memcpy(sample.quaternion, record->quaternion, sizeof(sample.quaternion));
	add_turned(sample.position_mm, sample.quaternion, stream->setup.tip_mm);
	/* Where the first one finds no room the next one tells it. */
	if (incise_ring_put(&stream->ring, &sample))
		stream->anew = false;
	else
		stream->no_room++;
}

int polhemus_stream_put(struct polhemus_stream *stream, const unsigned char *bytes,
			size_t n, int64_t t_ns)
{
	struct polhemus_record record;
	uint64_t seq;
	int found = 0;

	while (n) {
		size_t some = n < POLHEMUS_RECORD_MAX ? n : POLHEMUS_RECORD_MAX;
		size_t taken = polhemus_records_put(&stream->records, bytes, some, t_ns);

		bytes += taken;
		n -= taken;
		for (; polhemus_records_next(&stream->records, &record); found++)
			if (polhemus_gaps_take(&stream->gaps, &record, &seq)) {
				stream->anew |= stream->gaps.anew;
				put_sample(stream, &record, seq);
			}
	}
	atomic_store_explicit(&stream->lost, stream->gaps.lost + stream->no_room,
			      memory_order_relaxed);
	return found;
}

int polhemus_stream_take(struct polhemus_stream *stream,
			 struct incise_tracker_sample *samples, int n)
{
	return incise_ring_take(&stream->ring, samples, n);
}

uint64_t polhemus_stream_lost(const struct polhemus_stream *stream)
{
	return atomic_load_explicit(&stream->lost, memory_order_relaxed);
}
