// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From a camera to its file; see frame_pump.h.
 *
 * What passes between threads is in rings, in atomics, or (errors) written once before the
 * atomic that says so. A semaphore wakes who waits for pictures: to post it never blocks.
 */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <semaphore.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "../base/ring.h"
#include "../device/thread.h"
#include "frame_pump.h"
#include "frame_slots.h"

#define SLOTS_S 2.5 /* an fdatasync(2) that takes 0.3 s, several times over */
#define SLOTS_MIN 16
#define VISION_SLOTS 8
#define RECORDS 8192 /* more than a minute of 120 Hz */
/* Read so often in a period, but for the sake of the computer not more than 4 kHz. */
#define READS 8
#define NAP_MIN_NS 250000LL
#define NAP_MAX_NS 4000000LL
#define PATIENCE_NS (5 * INCISE_NS_PER_S)

struct looked {
	uint64_t order;
	double length_px, sd_px, depth_mm, quality;
};

/* As it goes through the ring of records. */
struct written {
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
	struct written next;
	struct looked result;
	bool has_next, has_result;
};

static void count(_Atomic uint64_t *n)
{
	atomic_fetch_add_explicit(n, 1, memory_order_relaxed);
}

static bool is(atomic_bool *flag)
{
	return atomic_load_explicit(flag, memory_order_acquire);
}

static void say(atomic_bool *flag)
{
	atomic_store_explicit(flag, true, memory_order_release);
}

static void nap(int64_t ns)
{
	struct timespec time = {ns / INCISE_NS_PER_S, ns % INCISE_NS_PER_S};

	clock_nanosleep(CLOCK_MONOTONIC, 0, &time, NULL);
}

/* --- camera ------------------------------------------------------------------------ */

/* Copy a picture to whoever is to have it. @wait: until there is room. */
static void hand_on(struct incise_frame_pump *p, const struct incise_camera_frame *frame,
		    int64_t arrival_ns, bool wait)
{
	struct incise_frame_slot slot = {
		.frame = *frame,
		.arrival_ns = arrival_ns,
		.order = p->order,
	};
	uint64_t waiting;

	while (wait && !incise_frame_slots_room(&p->slots) && !is(&p->file_failed))
		nap(NAP_MIN_NS);
	while (wait && p->vision_runs && !incise_frame_slots_room(&p->vision_slots))
		nap(NAP_MIN_NS);
	if (is(&p->file_failed)) {
		count(&p->unwritten);
		return;
	}
	if (!incise_frame_slots_room(&p->slots) || frame->size > p->slots.size) {
		count(&p->dropped);
		return;
	}
	if (p->vision_runs) {
		slot.looked_at = incise_frame_slots_put(&p->vision_slots, &slot);
		if (slot.looked_at)
			sem_post(&p->vision_filled);
		else
			count(&p->unlooked);
	}
	incise_frame_slots_put(&p->slots, &slot);
	sem_post(&p->filled);
	p->order++;
	waiting = incise_frame_slots_wait(&p->slots);
	if (waiting > atomic_load_explicit(&p->waiting_most, memory_order_relaxed))
		atomic_store_explicit(&p->waiting_most, waiting, memory_order_relaxed);
}

static int step(struct incise_frame_pump *p, bool wait)
{
	struct incise_camera_frame frame;
	char text[sizeof(p->camera_error.text)];
	int rc;

	if (is(&p->camera_ended))
		return -p->camera_error.code;
	rc = incise_camera_read(p->setup.camera, &frame);
	if (rc < 0) {
		incise_camera_cause(p->setup.camera, text, sizeof(text));
		incise_error_set(&p->camera_error, -rc, "%s",
				 *text ? text : strerror(-rc));
		say(&p->camera_ended);
		return rc;
	}
	if (!rc)
		return 0;
	/* What was shot before it began was not asked for, and lost by nobody. */
	if (!p->begun) {
		p->lost_before = incise_camera_lost(p->setup.camera);
		if (frame.t_ns < p->begun_ns)
			return 1;
	}
	p->begun = true;
	count(&p->read);
	hand_on(p, &frame, incise_clock_now(p->setup.clock), wait);
	atomic_store_explicit(&p->lost,
			      incise_camera_lost(p->setup.camera) - p->lost_before,
			      memory_order_relaxed);
	return 1;
}

static void *camera_run(void *argument)
{
	struct incise_frame_pump *p = argument;
	int rc = 0;

	while (rc >= 0 && !is(&p->stop)) {
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

/* --- file -------------------------------------------------------------------------- */

static void put(struct incise_frame_pump *p, const struct incise_frame_slot *slot)
{
	struct incise_frames_stored stored;
	struct incise_error err = {0};
	struct written written;
	int rc;

	if (is(&p->file_failed) || is(&p->give_up)) {
		count(&p->unwritten);
		return;
	}
	rc = incise_frames_put(p->setup.writer, &slot->frame, &stored, &err);
	if (rc) {
		count(&p->unwritten);
		/* EINVAL: a picture that is not as the camera said; the next may be. */
		if (rc == -EINVAL)
			return;
		p->file_error = err;
		say(&p->file_failed);
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
	count(&p->written);
	atomic_fetch_add_explicit(&p->bytes, stored.bytes, memory_order_relaxed);
	if (!incise_ring_put(&p->records, &written))
		count(&p->unrecorded);
}

static void *file_run(void *argument)
{
	struct incise_frame_pump *p = argument;
	const struct incise_frame_slot *slot;
	struct incise_error err = {0};
	int rc;

	for (;;) {
		/* Read before looking: what was put before it is seen. */
		bool last = is(&p->drain);

		while ((slot = incise_frame_slots_oldest(&p->slots))) {
			put(p, slot);
			incise_frame_slots_drop(&p->slots);
		}
		if (last)
			break;
		while (sem_wait(&p->filled))
			;
	}
	rc = incise_frames_writer_close(p->setup.writer, &err);
	if (rc && !is(&p->file_failed)) {
		p->file_error = err;
		say(&p->file_failed);
	}
	sem_post(&p->ended);
	return NULL;
}

/* --- vision ------------------------------------------------------------------------ */

static void *vision_run(void *argument)
{
	struct incise_frame_pump *p = argument;
	const struct incise_frame_slot *slot;

	for (;;) {
		bool last = is(&p->drain);

		while ((slot = incise_frame_slots_oldest(&p->vision_slots))) {
			struct incise_vision_result seen = {0};
			struct looked looked = {slot->order, NAN, NAN, NAN, 0};

			if (!incise_vision_measure(p->setup.vision, &slot->frame,
						   &seen) &&
			    seen.found)
				looked = (struct looked){slot->order, seen.length_px,
							 seen.sd_px, seen.depth_mm,
							 seen.quality};
			incise_ring_put(&p->results, &looked);
			incise_frame_slots_drop(&p->vision_slots);
		}
		if (last)
			return NULL;
		while (sem_wait(&p->vision_filled))
			;
	}
}

/*
 * Join what was seen to a record. False: it is not known yet. Both rings are in order, and
 * what has no partner (a picture that was not written) is passed over.
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

/* --- beginning and end ------------------------------------------------------------- */

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
		.waiting = incise_frame_slots_wait(&p->slots),
		.room = p->slots.count,
		.waiting_most = p->waiting_most,
		.bytes = p->bytes,
		.real_time = p->real_time,
	};
	if (is(&p->camera_ended))
		stats->camera = p->camera_error;
	if (is(&p->file_failed))
		stats->file = p->file_error;
}

/* A thread that signals, which are the program's, pass by. */
static int start(pthread_t *thread, void *(*run)(void *), struct incise_frame_pump *p)
{
	sigset_t all, before;
	int rc;

	sigfillset(&all);
	pthread_sigmask(SIG_SETMASK, &all, &before);
	rc = pthread_create(thread, NULL, run, p);
	pthread_sigmask(SIG_SETMASK, &before, NULL);
	return -rc;
}

/* Bytes of the largest picture. A JPEG of a noisy scene is less than what it is made of. */
static size_t picture_bytes(const struct incise_camera_info *info)
{
	size_t row = incise_frames_row(info->pixels, info->width);

	/* Drivers pad rows, to 64 bytes at most that were seen. */
	return (row ? row + 64 : (size_t)info->width * 2) * (size_t)info->height + 4096;
}

static int make(struct incise_frame_pump *p)
{
	struct incise_camera_info info;
	uint64_t slots = SLOTS_MIN;
	size_t size;
	int rc;

	p->begun_ns = incise_clock_now(p->setup.clock);
	incise_camera_info(p->setup.camera, &info);
	if (info.width < INCISE_FRAMES_SIDE_MIN || info.width > INCISE_FRAMES_SIDE_MAX ||
	    info.height < INCISE_FRAMES_SIDE_MIN || info.height > INCISE_FRAMES_SIDE_MAX)
		return -EINVAL;
	size = picture_bytes(&info);
	if (info.rate_hz > 0 && info.rate_hz <= 1e4) {
		p->nap_ns = (int64_t)((double)INCISE_NS_PER_S / info.rate_hz / READS);
		if (info.rate_hz * SLOTS_S > SLOTS_MIN)
			slots = (uint64_t)ceil(info.rate_hz * SLOTS_S);
	} else {
		slots = 150; /* a camera that does not say is taken for one of 60 Hz */
	}
	if (p->nap_ns < NAP_MIN_NS)
		p->nap_ns = p->nap_ns ? NAP_MIN_NS : NAP_MAX_NS / 2;
	if (p->nap_ns > NAP_MAX_NS)
		p->nap_ns = NAP_MAX_NS;
	rc = incise_frame_slots_init(&p->slots, size, slots);
	if (!rc)
		rc = incise_ring_init(&p->records, sizeof(struct written), RECORDS);
	if (!rc && p->setup.vision)
		rc = incise_frame_slots_init(&p->vision_slots, size, VISION_SLOTS);
	if (!rc && p->setup.vision)
		rc = incise_ring_init(&p->results, sizeof(struct looked), RECORDS);
	if (rc)
		return rc;
	rc = start(&p->file_thread, file_run, p);
	p->file_runs = !rc;
	if (!rc && p->setup.vision) {
		rc = start(&p->vision_thread, vision_run, p);
		p->vision_runs = !rc;
	}
	if (!rc && incise_clock_is_real(p->setup.clock)) {
		rc = incise_thread_start(&p->camera_thread, camera_run, p, &p->real_time);
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
		incise_error_set(err, ENOMEM, "camera: out of memory");
		return NULL;
	}
	memset(p, 0, sizeof(*p));
	p->setup = *setup;
	sem_init(&p->filled, 0, 0);
	sem_init(&p->vision_filled, 0, 0);
	sem_init(&p->ended, 0, 0);
	rc = make(p);
	if (!rc)
		return p;
	if (!p->file_runs)
		incise_frames_writer_close(setup->writer, NULL);
	incise_frame_pump_free(p);
	incise_error_set(err, -rc, "camera: its pictures cannot be recorded: %s",
			 strerror(-rc));
	return NULL;
}

/*
 * Wait until the file is closed. A disk that is slow is waited for as long as it takes
 * pictures: false where it took none for @patience_ns.
 */
static bool wait_for_file(struct incise_frame_pump *p, int64_t patience_ns)
{
	struct timespec now, until;
	uint64_t waiting;
	int64_t until_ns;
	int rc;

	do {
		waiting = incise_frame_slots_wait(&p->slots);
		clock_gettime(CLOCK_MONOTONIC, &now);
		until_ns = now.tv_sec * INCISE_NS_PER_S + now.tv_nsec + patience_ns;
		until = (struct timespec){until_ns / INCISE_NS_PER_S,
					  until_ns % INCISE_NS_PER_S};
		do {
			rc = sem_clockwait(&p->ended, CLOCK_MONOTONIC, &until);
		} while (rc && errno == EINTR);
	} while (rc && incise_frame_slots_wait(&p->slots) != waiting);
	return !rc;
}

int incise_frame_pump_stop(struct incise_frame_pump *p, int64_t patience_ns,
			   struct incise_error *err)
{

	if (!p->stopped) {
		say(&p->stop);
		if (p->camera_runs)
			pthread_join(p->camera_thread, NULL);
		say(&p->drain);
		sem_post(&p->filled);
		sem_post(&p->vision_filled);
		if (p->file_runs && !wait_for_file(p, patience_ns)) {
			p->unanswered = incise_frame_slots_wait(&p->slots);
			/* It may sit in write(2) for ever, with memory of ours. */
			say(&p->give_up);
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
			"camera: disk or coder did not get on; %llu pictures "
			"are not written",
			(unsigned long long)p->unanswered);
	if (is(&p->file_failed)) {
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
	incise_frame_slots_free(&p->slots);
	incise_frame_slots_free(&p->vision_slots);
	incise_ring_free(&p->records);
	incise_ring_free(&p->results);
	sem_destroy(&p->filled);
	sem_destroy(&p->vision_filled);
	sem_destroy(&p->ended);
	free(p);
}
