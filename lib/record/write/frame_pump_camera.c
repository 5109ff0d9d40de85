// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The pump's camera: each picture is copied to whoever is to have it; see
 * frame_pump_threads.h. A picture that finds no room is counted, and nobody waits for it but
 * in simulated time.
 */
#include <string.h>
#include <time.h>
#include "frame_pump_threads.h"

static void nap(int64_t ns)
{
	struct timespec time = {ns / INCISE_NS_PER_S, ns % INCISE_NS_PER_S};

	clock_nanosleep(CLOCK_MONOTONIC, 0, &time, NULL);
}

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

	while (wait && !incise_frame_slots_room(&p->slots) &&
	       !frame_pump_is(&p->file_failed))
		nap(FRAME_PUMP_NAP_NS);
	while (wait && p->vision_runs && !incise_frame_slots_room(&p->vision_slots))
		nap(FRAME_PUMP_NAP_NS);
	if (frame_pump_is(&p->file_failed)) {
		frame_pump_count(&p->unwritten);
		return;
	}
	if (!incise_frame_slots_room(&p->slots) || frame->size > p->slots.size) {
		frame_pump_count(&p->dropped);
		return;
	}
	if (p->vision_runs) {
		slot.looked_at = incise_frame_slots_put(&p->vision_slots, &slot);
		if (slot.looked_at)
			sem_post(&p->vision_filled);
		else
			frame_pump_count(&p->unlooked);
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

	if (frame_pump_is(&p->camera_ended))
		return -p->camera_error.code;
	rc = incise_camera_read(p->setup.camera, &frame);
	if (rc < 0) {
		incise_camera_cause(p->setup.camera, text, sizeof(text));
		incise_error_set(&p->camera_error, -rc, "%s",
				 *text ? text : strerror(-rc));
		frame_pump_say(&p->camera_ended);
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
	frame_pump_count(&p->read);
	hand_on(p, &frame, incise_clock_now(p->setup.clock), wait);
	atomic_store_explicit(&p->lost,
			      incise_camera_lost(p->setup.camera) - p->lost_before,
			      memory_order_relaxed);
	return 1;
}

void *incise_frame_pump_camera(void *pump)
{
	struct incise_frame_pump *p = pump;
	int rc = 0;

	while (rc >= 0 && !frame_pump_is(&p->stop)) {
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
