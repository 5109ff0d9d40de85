/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Force samples on their way from a card's thread to the reader, and the count of losses;
 * the same for every kind of card.
 *
 *   device ─▶ kernel's buffer ─▶ thread of the card ─▶ ring ─▶ incise_force_read()
 *                   │ full                              │ full
 *                   ╰───────── seq goes on: a gap ──────╯  counted in lost, overflows
 */
#ifndef INCISE_DAQ_FEED_H
#define INCISE_DAQ_FEED_H

#include <pthread.h>
#include <stdatomic.h>
#include <incise/backend.h>
#include "../base/ring.h"
#include "pace.h"

/* Capacity of the ring: the longest pause of a reader without loss, s. */
#define DAQ_FEED_CAPACITY_S 4

struct daq_feed {
	struct incise_force force;     /* first: the caller's handle */
	struct incise_force_info info; /* constant after opening */
	struct incise_ring ring;
	_Atomic uint64_t clipped, lost, overflows;
	_Atomic bool unsure; /* lost may lack some */
	atomic_int error;    /* 0, or -errno once the card is gone: then cause is there */
	struct incise_error cause;
	/* The thread's. */
	uint64_t seq; /* of the next sample */
	bool full;    /* the last sample did not fit */
	pthread_t thread;
	bool runs, real_time;
	int stop; /* eventfd; readable: the thread is to end */
};

/* Settings of rig.conf, or defaults. 0 or -EINVAL. */
int daq_feed_setup(const struct incise_backend_request *request,
		   struct incise_force_setup *setup, struct incise_error *err);

/* @feed->info is set. 0 or -ENOMEM, -EMFILE …; then daq_feed_free() is due all the same. */
int daq_feed_init(struct daq_feed *feed);
void daq_feed_free(struct daq_feed *feed);

/* Start the thread; it gets @feed's card. 0 or -errno. */
int daq_feed_start(struct daq_feed *feed, void *(*run)(void *), void *card);
/* Ends it, once run() calls daq_feed_wait() again. */
void daq_feed_stop(struct daq_feed *feed);

/* The thread's. */

enum daq_wait { DAQ_STOP, DAQ_READY, DAQ_QUIET };

/* Until @fd has data, it is to stop, or @ms are over. */
enum daq_wait daq_feed_wait(struct daq_feed *feed, int fd, int ms);
void daq_feed_put(struct daq_feed *feed, int64_t t_ns, int32_t code);
/* @n samples are missing before the next; counted as one overflow, unless @n is 0. */
void daq_feed_lose(struct daq_feed *feed, uint64_t n);
/* The next sample has @t_ns, and arrived at @arrival_ns: loses those that @pace finds missing. */
void daq_feed_pace(struct daq_feed *feed, struct incise_pace *pace, int64_t t_ns,
		   int64_t arrival_ns);
/*
 * The last word: 0 (it was to stop), -ENODEV, or -EIO because of @what; reported to readers once
 * they have read all.
 */
void daq_feed_end(struct daq_feed *feed, int error, const char *what);

/* struct incise_force_ops */
int daq_feed_read(struct incise_force *force, struct incise_force_sample *samples, int n);
void daq_feed_info(const struct incise_force *force, struct incise_force_info *info);
uint64_t daq_feed_lost(const struct incise_force *force);
int daq_feed_cause(struct incise_force *force, char *text, size_t size);

#endif
