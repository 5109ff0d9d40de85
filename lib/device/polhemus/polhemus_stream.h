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
#include "../../rig/tracker_feed.h"
#include "polhemus_records.h"

/*
 * Gaps: how many records were lost before this one.
 *
 * LIBERTY and PATRIOT count their frames. A FASTRAK does not: only the order of its
 * stations and the time are known. Record k is measured at k periods and arrives some
 * time later, never earlier; its lateness is counted from the earliest arrival of the
 * others:
 *
 *   lateness |        one record held up        one record lost
 *            |                                       o--o--o--o--
 *          T |           o
 *            |              .                        stays: a record is missing
 *          0 |--o--o--o-----o--o--o--          --o--o
 *            '---------------------------------------------------> records
 *
 * A loss is reported at once where stations are out of order, or half a record or more
 * was damaged. Where only time shows it, records behind a gap of 1.5 rounds or more are held
 * back, see struct polhemus_stream, for half a round: if they were held up, the others come
 * at once. After a shorter gap the lateness must stay for POLHEMUS_GAPS_WINDOW records (0.5 s): then
 * the number is right, but its place in seq is that much late, which a reader of the recording mends
 * by the arrivals. A drift between the two clocks is followed. With sync from outside there is no
 * period; only order and damage show a loss.
 */
#define POLHEMUS_GAPS_WINDOW 60

struct polhemus_gaps {
	uint8_t order[POLHEMUS_STATIONS]; /* of stations in the stream */
	int n;
	bool counts;	   /* the device counts frames */
	int64_t period_ns; /* of records; 0: not known */
	unsigned int length;

	uint64_t lost, seq; /* so far; of the last record */
	bool started, begun, broken;
	bool restarted; /* the last record starts new periods, maybe of another phase */
	bool settled;	/* base_ns is known: nothing came much earlier for a window */
	bool moved;	/* in this window something did */
	uint64_t first_place; /* of seq 0 in the order */
	int64_t base_ns;      /* earliest possible arrival of seq 0 */
	int64_t last_ns;      /* of the last record; before the first: the start */
	int last;	      /* its place in the order */
	uint32_t frame;	      /* its count */
	unsigned int refused; /* in a row */
	/* The last record refused for its count. */
	uint32_t refused_frame;
	int64_t refused_ns;
	/* The window: least lateness in it, lateness of its first record. */
	unsigned int in_window;
	int64_t least_ns, first_ns;
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

/*
 * Behind a long gap, records wait here until it is known how many are missing before them:
 *
 *     lost      ──o──o──o────────────────────o──┊·····   quiet for half a round, or the next one
 *     held up   ──o──o──o────────────────────ooooooo     comes as late: lost, else held up
 *
 * They are late by half a round then, once. Where records that were held up have come, more of them
 * may be on their way: a terminal hands on 4 kB, and the rest when the kernel's worker runs. Then they
 * wait for 50 ms.
 */
struct polhemus_wait {
	struct polhemus_record *records; /* capacity of the ring */
	size_t n;
	uint64_t seq; /* of the last one, if no record is missing before them */
	int last;     /* its place in the order */
	int64_t first_late_ns, late_ns, least_late_ns;
	int64_t since_ns; /* for so long no record was less late by half a round */
};

struct polhemus_stream {
	struct incise_tracker_setup setup;
	struct polhemus_records records;
	struct polhemus_gaps gaps;
	struct polhemus_wait wait;
	struct incise_ring ring; /* of struct incise_tracker_sample */
	struct tracker_repeat repeat[POLHEMUS_STATIONS];
	uint64_t overflowed; /* samples lost because the ring was full */
	bool restarted;	     /* the next sample is marked so */
	_Atomic uint64_t lost;
};

/* 0, -ENOMEM. @setup is copied. */
int polhemus_stream_init(struct polhemus_stream *stream,
			 const struct incise_tracker_setup *setup,
			 const struct polhemus_layout *layout);
void polhemus_stream_free(struct polhemus_stream *stream);

/* The link was gone, and the device was set up again, with records of @layout. */
void polhemus_stream_broken(struct polhemus_stream *stream,
			    const struct polhemus_layout *layout);

/* When polhemus_stream_quiet() is to be called if nothing comes; INT64_MAX: never. */
int64_t polhemus_stream_due_ns(const struct polhemus_stream *stream);

/* Nothing came up to @t_ns: records that wait are not followed by others. */
void polhemus_stream_quiet(struct polhemus_stream *stream, int64_t t_ns);

/* Nothing came up to @t_ns: missing records count as lost until one comes. */
void polhemus_stream_silent(struct polhemus_stream *stream, int64_t t_ns);

/* Bytes that arrived at @t_ns; how many records they complete. By one thread. */
int polhemus_stream_put(struct polhemus_stream *stream, const unsigned char *bytes,
			size_t n, int64_t t_ns);

/* Any thread; real-time safe, as is taking samples from the ring by one other thread. */
uint64_t polhemus_stream_lost(const struct polhemus_stream *stream);

#endif
