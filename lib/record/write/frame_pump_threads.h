/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside the pump: what its threads share; drawn in frame_pump.h.
 *
 * What passes between threads is in rings, in atomics, or (errors) written once before the
 * atomic that says so. A semaphore wakes who waits for pictures: to post it never blocks.
 */
#ifndef INCISE_FRAME_PUMP_THREADS_H
#define INCISE_FRAME_PUMP_THREADS_H

#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include "../../base/ring.h"
#include "frame_pump.h"
#include "frame_slots.h"

/* A wait for room, or for the camera, at the least. */
#define FRAME_PUMP_NAP_NS 250000LL

struct frame_looked {
	uint64_t order;
	double length_px, sd_px, depth_mm, quality;
};

/* As it goes through the ring of records. */
struct frame_written {
	uint64_t order;
	bool looked_at;
	struct incise_frame_record record;
};

struct incise_frame_pump {
	struct incise_frame_pump_setup setup;
	int64_t nap_ns;
	struct incise_frame_slots slots, vision_slots;
	struct incise_ring records, results;
	sem_t filled, vision_filled, ended;
	pthread_t camera_thread, file_thread, vision_thread;
	bool camera_runs, file_runs, vision_runs;
	bool real_time, stopped, leaked;
	atomic_bool stop, drain, give_up;

	/* The camera thread's. */
	uint64_t order, lost_before;
	bool begun;
	int64_t begun_ns; /* by the clock */

	/* Errors are whole before their flag is set. */
	struct incise_error camera_error, file_error;
	atomic_bool camera_ended, file_failed;

	_Atomic uint64_t read, written, lost, dropped, unwritten, unlooked, unrecorded,
		waiting_most;
	_Atomic int64_t bytes;

	uint64_t unanswered; /* pictures that waited when the disk was given up */

	/* take()'s. */
	struct frame_written next;
	struct frame_looked result;
	bool has_next, has_result;
};

static inline void frame_pump_count(_Atomic uint64_t *n)
{
	atomic_fetch_add_explicit(n, 1, memory_order_relaxed);
}

static inline bool frame_pump_is(atomic_bool *flag)
{
	return atomic_load_explicit(flag, memory_order_acquire);
}

static inline void frame_pump_say(atomic_bool *flag)
{
	atomic_store_explicit(flag, true, memory_order_release);
}

/* Threads: of the camera, until stop; of file and vision, until drain and all is done. */
void *incise_frame_pump_camera(void *pump);
void *incise_frame_pump_file(void *pump);
void *incise_frame_pump_vision(void *pump);

#endif
