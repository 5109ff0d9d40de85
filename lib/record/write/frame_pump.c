// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The pump between a camera and its file; drawn in frame_pump.h. ns of the rig's clock.
 *
 * Threads share rings, atomics and errors, which are written once before the atomic flag that
 * announces them. A semaphore wakes a thread that waits for frames; posting it never blocks.
 */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/camera.h>
#include "../../base/monotonic.h"
#include "../../base/ring.h"
#include "../../rig/thread.h"
#include "frame_pump.h"

#define SLOTS_S 2.5 /* bridges several fdatasync(2) of 0.3 s */
#define SLOTS_MIN 16
#define VISION_SLOTS 8
#define RECORDS 8192 /* more than a minute at 120 Hz */
/* Reads per period of the camera; the naps between them have limits. */
#define READS 8
#define NAP_MIN_NS 250000LL
#define NAP_MAX_NS 4000000LL
#define PATIENCE_NS (5 * INCISE_NS_PER_S)

/*
 * A ring of frames between one thread that copies them in and one that reads the oldest in
 * place; ../../base/ring.h would copy it a second time.
 *
 *     put: one thread                 oldest, drop: another
 *        |  head                         |  tail
 *        v                               v
 *     [   ][ 9 ][ 8 ][ 7 ][   ][   ][   ]        full: the new one is refused
 *
 * All memory is allocated at the start, and becomes resident when a slot is first used: of the
 * slots for the largest possible JPEG, only the bytes that frames fill.
 */
struct slot {
	struct incise_camera_frame frame; /* its data is the slot's */
	int64_t arrival_ns;
	uint64_t order; /* of the accepted frames, from 0 */
	bool looked_at; /* vision has a copy */
};

struct slots {
	size_t size; /* of the largest frame, bytes */
	uint64_t count;
	uint8_t *bytes;
	struct slot *slots;
	/* Far apart: the two threads do not share a cache line. */
	_Alignas(64) _Atomic uint64_t head;
	_Alignas(64) _Atomic uint64_t tail;
};

struct looked {
	uint64_t order;
	double length_px, sd_px, depth_mm, quality;
};

struct written {
	uint64_t order;
	bool looked_at;
	struct incise_frame_record record;
};

struct incise_frame_pump {
	struct incise_frame_pump_setup setup;
	int64_t nap_ns;
	struct slots slots, vision_slots;
	struct incise_ring records, results;
	sem_t filled, vision_filled, ended;
	pthread_t camera_thread, file_thread, vision_thread;
	bool camera_runs, file_runs, vision_runs;
	bool real_time, stopped, leaked;
	atomic_bool stop, drain, give_up;

	/* Owned by the camera thread. */
	uint64_t order, lost_before;
	bool started;
	int64_t started_ns;

	/* Errors are whole before their flag is set. */
	struct incise_error camera_error, file_error;
	atomic_bool camera_ended, file_failed;

	_Atomic uint64_t read, written, lost, dropped, unwritten, unlooked, unrecorded,
		waiting_most;
	_Atomic int64_t bytes;

	uint64_t unanswered; /* frames that waited when the disk was given up */

	/* Owned by the thread that calls take(). */
	struct written next;
	struct looked result;
	bool has_next, has_result;
};

static void count(_Atomic uint64_t *n)
{
	atomic_fetch_add_explicit(n, 1, memory_order_relaxed);
}

static bool is_set(atomic_bool *flag)
{
	return atomic_load_explicit(flag, memory_order_acquire);
}

static void set(atomic_bool *flag)
{
	atomic_store_explicit(flag, true, memory_order_release);
}

/* --- slots --------------------------------------------------------------------------- */

/* The slots are freed by slots_free() even after an error. */
static int slots_init(struct slots *slots, size_t size, uint64_t count)
{
	slots->size = size;
	slots->count = count;
	slots->bytes = calloc(count, size);
	slots->slots = calloc(count, sizeof(*slots->slots));
	return slots->bytes && slots->slots ? 0 : -ENOMEM;
}

static void slots_free(struct slots *slots)
{
	free(slots->bytes);
	free(slots->slots);
}

/* May be called by any thread. */
static uint64_t slots_waiting(const struct slots *slots)
{
	/* The head is read after the tail, so it is not smaller. */
	uint64_t tail = atomic_load_explicit(&slots->tail, memory_order_acquire);

	return atomic_load_explicit(&slots->head, memory_order_acquire) - tail;
}

static bool slots_available(const struct slots *slots)
{
	return slots_waiting(slots) < slots->count;
}

/* False when the ring is full or the frame is larger than a slot. */
static bool slots_put(struct slots *slots, const struct slot *slot)
{
	uint64_t head = atomic_load_explicit(&slots->head, memory_order_relaxed);
	struct slot *to = &slots->slots[head % slots->count];
	uint8_t *bytes = slots->bytes + head % slots->count * slots->size;

	if (!slots_available(slots) || slot->frame.size > slots->size)
		return false;
	*to = *slot;
	memcpy(bytes, slot->frame.data, slot->frame.size);
	to->frame.data = bytes;
	atomic_store_explicit(&slots->head, head + 1, memory_order_release);
	return true;
}

/* NULL if none waits; valid until it is dropped. */
static const struct slot *slots_oldest(const struct slots *slots)
{
	uint64_t tail = atomic_load_explicit(&slots->tail, memory_order_relaxed);

	if (atomic_load_explicit(&slots->head, memory_order_acquire) == tail)
		return NULL;
	return &slots->slots[tail % slots->count];
}

static void slots_drop(struct slots *slots)
{
	uint64_t tail = atomic_load_explicit(&slots->tail, memory_order_relaxed);

	atomic_store_explicit(&slots->tail, tail + 1, memory_order_release);
}

/* --- camera thread ------------------------------------------------------------------- */

static void nap(int64_t ns)
{
	struct timespec time = {ns / INCISE_NS_PER_S, ns % INCISE_NS_PER_S};

	clock_nanosleep(CLOCK_MONOTONIC, 0, &time, NULL);
}

/*
 * Copy a frame to the file thread and the vision thread. A frame without a free slot is
 * dropped and counted; with @wait, as in simulated time, a slot is waited for.
 */
static void hand_on(struct incise_frame_pump *p, const struct incise_camera_frame *frame,
		    int64_t arrival_ns, bool wait)
{
	struct slot slot = {
		.frame = *frame,
		.arrival_ns = arrival_ns,
		.order = p->order,
	};
	uint64_t waiting;

	while (wait && !slots_available(&p->slots) && !is_set(&p->file_failed))
		nap(NAP_MIN_NS);
	while (wait && p->vision_runs && !slots_available(&p->vision_slots))
		nap(NAP_MIN_NS);
	if (is_set(&p->file_failed)) {
		count(&p->unwritten);
		return;
	}
	if (!slots_available(&p->slots) || frame->size > p->slots.size) {
		count(&p->dropped);
		return;
	}
	if (p->vision_runs) {
		slot.looked_at = slots_put(&p->vision_slots, &slot);
		if (slot.looked_at)
			sem_post(&p->vision_filled);
		else
			count(&p->unlooked);
	}
	slots_put(&p->slots, &slot);
	sem_post(&p->filled);
	p->order++;
	waiting = slots_waiting(&p->slots);
	if (waiting > atomic_load_explicit(&p->waiting_most, memory_order_relaxed))
		atomic_store_explicit(&p->waiting_most, waiting, memory_order_relaxed);
}

static int step(struct incise_frame_pump *p, bool wait)
{
	struct incise_camera_frame frame;
	char text[sizeof(p->camera_error.text)];
	int rc;

	if (is_set(&p->camera_ended))
		return -p->camera_error.code;
	rc = incise_camera_read(p->setup.camera, &frame);
	if (rc < 0) {
		incise_camera_cause(p->setup.camera, text, sizeof(text));
		incise_error_set(&p->camera_error, -rc, "%s",
				 *text ? text : strerror(-rc));
		set(&p->camera_ended);
		return rc;
	}
	if (!rc)
		return 0;
	/* Frames from before the start are skipped, not lost. */
	if (!p->started) {
		p->lost_before = incise_camera_lost(p->setup.camera);
		if (frame.t_ns < p->started_ns)
			return 1;
	}
	p->started = true;
	count(&p->read);
	hand_on(p, &frame, incise_clock_now(p->setup.clock), wait);
	atomic_store_explicit(&p->lost,
			      incise_camera_lost(p->setup.camera) - p->lost_before,
			      memory_order_relaxed);
	return 1;
}

static void *run_camera(void *pump)
{
	struct incise_frame_pump *p = pump;
	int rc = 0;

	while (rc >= 0 && !is_set(&p->stop)) {
		rc = step(p, false);
		if (!rc)
			nap(p->nap_ns);
	}
	return NULL;
}

int incise_frame_pump_step(struct incise_frame_pump *pump)
{
	return pump->camera_runs || pump->stopped ? 0 : step(pump, true);
}

/* --- file thread --------------------------------------------------------------------- */

static void put(struct incise_frame_pump *p, const struct slot *slot)
{
	struct incise_frames_stored stored;
	struct incise_error err = {0};
	struct written written;
	int rc;

	if (is_set(&p->file_failed) || is_set(&p->give_up)) {
		count(&p->unwritten);
		return;
	}
	rc = incise_frames_put(p->setup.writer, &slot->frame, &stored, &err);
	if (rc) {
		count(&p->unwritten);
		/* EINVAL: the frame is not of the announced shape; the next may be. */
		if (rc == -EINVAL)
			return;
		p->file_error = err;
		set(&p->file_failed);
		return;
	}
	written = (struct written){
		.order = slot->order,
		.looked_at = slot->looked_at,
		.record =
			{
				.seq = slot->frame.seq,
				.t_ns = slot->frame.t_ns,
				.arrival_ns = slot->arrival_ns,
				.pts_ms = stored.pts_ms,
				.bytes = stored.bytes,
				.crc = stored.crc,
				.length_px = NAN,
				.sd_px = NAN,
				.depth_mm = NAN,
				.quality = NAN,
			},
	};
	memcpy(written.record.sha256, stored.sha256, sizeof(stored.sha256));
	count(&p->written);
	atomic_fetch_add_explicit(&p->bytes, stored.bytes, memory_order_relaxed);
	if (!incise_ring_put(&p->records, &written))
		count(&p->unrecorded);
}

static void *run_file(void *pump)
{
	struct incise_frame_pump *p = pump;
	const struct slot *slot;
	struct incise_error err = {0};
	int rc;

	for (;;) {
		/* Read before the slots: frames put before the flag was set are seen. */
		bool last = is_set(&p->drain);

		while ((slot = slots_oldest(&p->slots))) {
			put(p, slot);
			slots_drop(&p->slots);
		}
		if (last)
			break;
		while (sem_wait(&p->filled))
			;
	}
	rc = incise_frames_writer_close(p->setup.writer, &err);
	if (rc && !is_set(&p->file_failed)) {
		p->file_error = err;
		set(&p->file_failed);
	}
	sem_post(&p->ended);
	return NULL;
}

/* --- vision thread ------------------------------------------------------------------- */

static void *run_vision(void *pump)
{
	struct incise_frame_pump *p = pump;
	const struct slot *slot;

	for (;;) {
		bool last = is_set(&p->drain);

		while ((slot = slots_oldest(&p->vision_slots))) {
			struct incise_vision_result seen = {0};
			struct looked looked = {slot->order, NAN, NAN, NAN, 0};

			if (!incise_vision_measure(p->setup.vision, &slot->frame,
						   &seen) &&
			    seen.found)
				looked = (struct looked){slot->order, seen.length_px,
							 seen.sd_px, seen.depth_mm,
							 seen.quality};
			incise_ring_put(&p->results, &looked);
			slots_drop(&p->vision_slots);
		}
		if (last)
			return NULL;
		while (sem_wait(&p->vision_filled))
			;
	}
}

/* --- records ------------------------------------------------------------------------- */

/*
 * Add vision's result to a record. False while there is no result yet. Both rings are in order;
 * a result without a record (its frame was not written) is skipped.
 */
static bool join(struct incise_frame_pump *p, struct written *written)
{
	if (!written->looked_at)
		return true;
	while (!p->has_result || p->result.order < written->order) {
		p->has_result = incise_ring_take(&p->results, &p->result, 1) == 1;
		if (!p->has_result)
			return p->stopped;
	}
	if (p->result.order != written->order)
		return true;
	p->has_result = false;
	written->record.length_px = p->result.length_px;
	written->record.sd_px = p->result.sd_px;
	written->record.depth_mm = p->result.depth_mm;
	written->record.quality = p->result.quality;
	return true;
}

int incise_frame_pump_take(struct incise_frame_pump *pump,
			   struct incise_frame_record *records, int n)
{
	int taken = 0;

	while (taken < n) {
		if (!pump->has_next)
			pump->has_next =
				incise_ring_take(&pump->records, &pump->next, 1) == 1;
		if (!pump->has_next || !join(pump, &pump->next))
			break;
		pump->has_next = false;
		records[taken++] = pump->next.record;
	}
	return taken;
}

void incise_frame_pump_stats(struct incise_frame_pump *p,
			     struct incise_frame_pump_stats *stats)
{
	*stats = (struct incise_frame_pump_stats){
		.read = p->read,
		.written = p->written,
		.lost = p->lost,
		.dropped = p->dropped,
		.unwritten = p->unwritten,
		.unlooked = p->unlooked,
		.unrecorded = p->unrecorded,
		.waiting = slots_waiting(&p->slots),
		.capacity = p->slots.count,
		.waiting_most = p->waiting_most,
		.bytes = p->bytes,
		.real_time = p->real_time,
	};
	if (is_set(&p->camera_ended))
		stats->camera = p->camera_error;
	if (is_set(&p->file_failed))
		stats->file = p->file_error;
}

/* --- start and end ------------------------------------------------------------------- */

/* Bytes of the largest frame. A JPEG of a noisy scene is smaller than its pixels. */
static size_t frame_bytes(const struct incise_camera_info *info)
{
	size_t row = incise_frames_row(info->pixels, info->width);

	/* Drivers pad rows; the largest padding seen aligns them to 64 bytes. */
	return (row ? row + 64 : (size_t)info->width * 2) * (size_t)info->height + 4096;
}

static int start(struct incise_frame_pump *p)
{
	struct incise_camera_info info;
	uint64_t slots = SLOTS_MIN;
	size_t size;
	int rc;

	p->started_ns = incise_clock_now(p->setup.clock);
	incise_camera_info(p->setup.camera, &info);
	if (info.width < INCISE_FRAMES_SIDE_MIN || info.width > INCISE_FRAMES_SIDE_MAX ||
	    info.height < INCISE_FRAMES_SIDE_MIN || info.height > INCISE_FRAMES_SIDE_MAX)
		return -EINVAL;
	size = frame_bytes(&info);
	if (info.rate_hz > 0 && info.rate_hz <= 1e4) {
		p->nap_ns = (int64_t)((double)INCISE_NS_PER_S / info.rate_hz / READS);
		if (info.rate_hz * SLOTS_S > SLOTS_MIN)
			slots = (uint64_t)ceil(info.rate_hz * SLOTS_S);
	} else {
		slots = 150; /* a camera of unknown rate counts as one of 60 Hz */
	}
	if (p->nap_ns < NAP_MIN_NS)
		p->nap_ns = p->nap_ns ? NAP_MIN_NS : NAP_MAX_NS / 2;
	if (p->nap_ns > NAP_MAX_NS)
		p->nap_ns = NAP_MAX_NS;
	rc = slots_init(&p->slots, size, slots);
	if (!rc)
		rc = incise_ring_init(&p->records, sizeof(struct written), RECORDS);
	if (!rc && p->setup.vision)
		rc = slots_init(&p->vision_slots, size, VISION_SLOTS);
	if (!rc && p->setup.vision)
		rc = incise_ring_init(&p->results, sizeof(struct looked), RECORDS);
	if (rc)
		return rc;
	rc = incise_thread_start(&p->file_thread, run_file, p, NULL);
	p->file_runs = !rc;
	if (!rc && p->setup.vision) {
		rc = incise_thread_start(&p->vision_thread, run_vision, p, NULL);
		p->vision_runs = !rc;
	}
	if (!rc && incise_clock_is_real(p->setup.clock)) {
		rc = incise_thread_start(&p->camera_thread, run_camera, p, &p->real_time);
		p->camera_runs = !rc;
	}
	return rc;
}

struct incise_frame_pump *incise_frame_pump_new(
	const struct incise_frame_pump_setup *setup, struct incise_error *err)
{
	struct incise_frame_pump *p = aligned_alloc(64, sizeof(*p));
	int rc;

	if (!p) {
		incise_frames_writer_close(setup->writer, NULL);
		return INCISE_ERROR_NULL(err, ENOMEM, "camera: out of memory");
	}
	memset(p, 0, sizeof(*p));
	p->setup = *setup;
	sem_init(&p->filled, 0, 0);
	sem_init(&p->vision_filled, 0, 0);
	sem_init(&p->ended, 0, 0);
	rc = start(p);
	if (!rc)
		return p;
	if (!p->file_runs)
		incise_frames_writer_close(setup->writer, NULL);
	incise_frame_pump_free(p);
	return INCISE_ERROR_NULL(err, -rc, "camera: its frames cannot be recorded: %s",
				 strerror(-rc));
}

/*
 * Wait until the file is closed, as long as the disk takes frames. False if it took none for
 * @patience_ns.
 */
static bool wait_for_file(struct incise_frame_pump *p, int64_t patience_ns)
{
	struct timespec until;
	uint64_t waiting;
	int64_t until_ns;
	int rc;

	do {
		waiting = slots_waiting(&p->slots);
		until_ns = incise_monotonic_ns() + patience_ns;
		until = (struct timespec){until_ns / INCISE_NS_PER_S,
					  until_ns % INCISE_NS_PER_S};
		do {
			rc = sem_clockwait(&p->ended, CLOCK_MONOTONIC, &until);
		} while (rc && errno == EINTR);
	} while (rc && slots_waiting(&p->slots) != waiting);
	return !rc;
}

int incise_frame_pump_stop(struct incise_frame_pump *p, int64_t patience_ns,
			   struct incise_error *err)
{
	if (!p->stopped) {
		set(&p->stop);
		if (p->camera_runs)
			pthread_join(p->camera_thread, NULL);
		set(&p->drain);
		sem_post(&p->filled);
		sem_post(&p->vision_filled);
		if (p->file_runs && !wait_for_file(p, patience_ns)) {
			p->unanswered = slots_waiting(&p->slots);
			/* It may stay in write(2) for ever and use the pump's memory. */
			set(&p->give_up);
			pthread_detach(p->file_thread);
			p->leaked = true;
		} else if (p->file_runs) {
			pthread_join(p->file_thread, NULL);
		}
		if (p->vision_runs)
			pthread_join(p->vision_thread, NULL);
		p->stopped = true;
	}
	if (p->leaked)
		return incise_error_set(
			err, ETIMEDOUT,
			"camera: disk or encoder were too slow; %llu frames are not "
			"written",
			(unsigned long long)p->unanswered);
	if (is_set(&p->file_failed)) {
		if (err)
			*err = p->file_error;
		errno = p->file_error.code;
		return -p->file_error.code;
	}
	return 0;
}

void incise_frame_pump_free(struct incise_frame_pump *p)
{
	if (!p)
		return;
	incise_frame_pump_stop(p, PATIENCE_NS, NULL);
	if (p->leaked)
		return;
	slots_free(&p->slots);
	slots_free(&p->vision_slots);
	incise_ring_free(&p->records);
	incise_ring_free(&p->results);
	sem_destroy(&p->filled);
	sem_destroy(&p->vision_filled);
	sem_destroy(&p->ended);
	free(p);
}
