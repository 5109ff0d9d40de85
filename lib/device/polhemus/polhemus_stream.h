/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * From bytes of the device to samples in a ring:
 *
 *   bytes -> polhemus_records -> gaps: seq and losses -> flag, offset, mm -> ring -> reader
 *
 * No thread, no clock, no system call, so that tests have their own time, in ns.
 */
#ifndef INCISE_POLHEMUS_STREAM_H
#define INCISE_POLHEMUS_STREAM_H

#include <stdatomic.h>
#include <incise/tracker.h>
#include "../../base/ring.h"
#include "../../rig/pace.h"
#include "../../rig/tracker_feed.h"
#include "polhemus_records.h"

/*
 * Gaps: how many records were lost before this one.
 *
 * LIBERTY and PATRIOT count their frames. A FASTRAK does not: only the order of its stations and
 * the time are known. A loss is reported at once where stations are out of order, or half a record
 * or more was damaged. Where only time shows it, see lib/rig/pace.h: then the number is right,
 * but its place in seq is up to three windows late, which a reader of the recording mends by the
 * arrivals. With sync from outside there is no period; only order and damage show a loss.
 */
struct polhemus_gaps {
	uint8_t order[POLHEMUS_STATIONS]; /* of stations in the stream */
	int n;
	bool counts;	   /* the device counts frames */
	int64_t period_ns; /* of records; 0: not known */
	unsigned int length;

	uint64_t lost, seq; /* so far; of the last record */
	bool started, begun, broken;
	bool restarted; /* the last record starts new periods, maybe of another phase */
	struct incise_pace pace; /* of records; if they are counted, of frames */
	int64_t last_ns;	 /* of the last record; before the first: the start */
	int last;		 /* its place in the order */
	uint32_t frame;		 /* its count */
	unsigned int early;	 /* that came too early, less records since then */
	unsigned int refused;	 /* in a row, for their count */
	/* The last record refused for its count. */
	uint32_t refused_frame;
	int64_t refused_ns;
};

/* @hz: records of all stations per second; 0: not known. @length of a record in bytes. */
void polhemus_gaps_init(struct polhemus_gaps *gaps, const uint8_t *stations, int n,
			bool counts, double hz, unsigned int length);

/* The device started at @t_ns: records missing before the first one are lost. */
void polhemus_gaps_start(struct polhemus_gaps *gaps, int64_t t_ns);

/* The link was gone: all records until the next one are lost. */
void polhemus_gaps_broken(struct polhemus_gaps *gaps);

/*
 * Records that are certainly missing if no record came since the last; never more than count as lost
 * when a record comes after polhemus_gaps_broken().
 */
uint64_t polhemus_gaps_silent(const struct polhemus_gaps *gaps, int64_t t_ns);

/* *seq of a record. False: it came too early, so it is damaged or doubled. */
bool polhemus_gaps_add(struct polhemus_gaps *gaps, const struct polhemus_record *record,
		       uint64_t *seq);

#define POLHEMUS_RING_S 4 /* capacity for samples at 240 Hz of four stations */

struct polhemus_stream {
	struct incise_tracker_setup setup;
	struct polhemus_records records;
	struct polhemus_gaps gaps;
	struct incise_ring ring; /* of struct incise_tracker_sample */
	struct tracker_repeat repeat[POLHEMUS_STATIONS];
	uint64_t overflowed; /* samples lost because the ring was full */
	bool restarted;	     /* the next sample is marked so */
	_Atomic uint64_t lost;
	_Atomic bool unsure; /* that may lack some */
};

/* 0, -ENOMEM. @setup is copied. */
int polhemus_stream_init(struct polhemus_stream *stream,
			 const struct incise_tracker_setup *setup,
			 const struct polhemus_layout *layout);
void polhemus_stream_free(struct polhemus_stream *stream);

/* The link was gone, and the device was set up again, with records of @layout. */
void polhemus_stream_broken(struct polhemus_stream *stream,
			    const struct polhemus_layout *layout);

/* Nothing came up to @t_ns: missing records count as lost until one comes. */
void polhemus_stream_silent(struct polhemus_stream *stream, int64_t t_ns);

/* Bytes that arrived at @t_ns; how many records they complete. By one thread. */
int polhemus_stream_put(struct polhemus_stream *stream, const unsigned char *bytes,
			size_t n, int64_t t_ns);

/* Any thread; real-time safe, as is taking samples from the ring by one other thread. */
uint64_t polhemus_stream_lost(const struct polhemus_stream *stream);

#endif
