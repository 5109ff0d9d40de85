// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From a camera to its file: beginning and end; see frame_pump.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "../../device/thread.h"
#include "frame_pump_threads.h"

#define SLOTS_S 2.5 /* an fdatasync(2) that takes 0.3 s, several times over */
#define SLOTS_MIN 16
#define VISION_SLOTS 8
#define RECORDS 8192 /* more than a minute of 120 Hz */
/* Read so often in a period, but for the sake of the computer not more than 4 kHz. */
#define READS 8
#define NAP_MAX_NS 4000000LL
#define PATIENCE_NS (5 * INCISE_NS_PER_S)

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
	if (frame_pump_is(&p->camera_ended))
		stats->camera = p->camera_error;
	if (frame_pump_is(&p->file_failed))
		stats->file = p->file_error;
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
	if (p->nap_ns < FRAME_PUMP_NAP_NS)
		p->nap_ns = p->nap_ns ? FRAME_PUMP_NAP_NS : NAP_MAX_NS / 2;
	if (p->nap_ns > NAP_MAX_NS)
		p->nap_ns = NAP_MAX_NS;
	rc = incise_frame_slots_init(&p->slots, size, slots);
	if (!rc)
		rc = incise_ring_init(&p->records, sizeof(struct frame_written), RECORDS);
	if (!rc && p->setup.vision)
		rc = incise_frame_slots_init(&p->vision_slots, size, VISION_SLOTS);
	if (!rc && p->setup.vision)
		rc = incise_ring_init(&p->results, sizeof(struct frame_looked), RECORDS);
	if (rc)
		return rc;
	rc = incise_thread_start(&p->file_thread, incise_frame_pump_file, p, NULL);
	p->file_runs = !rc;
	if (!rc && p->setup.vision) {
		rc = incise_thread_start(&p->vision_thread, incise_frame_pump_vision, p,
					 NULL);
		p->vision_runs = !rc;
	}
	if (!rc && incise_clock_is_real(p->setup.clock)) {
		rc = incise_thread_start(&p->camera_thread, incise_frame_pump_camera, p,
					 &p->real_time);
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
		frame_pump_say(&p->stop);
		if (p->camera_runs)
			pthread_join(p->camera_thread, NULL);
		frame_pump_say(&p->drain);
		sem_post(&p->filled);
		sem_post(&p->vision_filled);
		if (p->file_runs && !wait_for_file(p, patience_ns)) {
			p->unanswered = incise_frame_slots_wait(&p->slots);
			/* It may sit in write(2) for ever, with memory of ours. */
			frame_pump_say(&p->give_up);
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
	if (frame_pump_is(&p->file_failed)) {
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
