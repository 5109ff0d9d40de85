// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * An encoder compared with the steps given; see encoder.h.
 *
 *   steps given, before ─┐
 *   count ───────────────┼─▶ the steps given when it was read lie between the two
 *   steps given, after ──┘
 *
 * So a late thread is no difference. The status is a tick old at most. Differences count from the
 * moment at which the motor got power or was homed: without both, a hand may turn it.
 */
#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/monotonic.h"
#include "encoder.h"
#include "page.h"
#include "thread.h"

#define PERIOD_NS 2000000

struct encoder {
	struct incise_driver driver;
	struct incise_motor *motor;
	char folder[PATH_MAX - 10], cause[240];
	double counts_per_step;
	double slack; /* steps in the tick before a status */
	double range; /* of counts, after which it begins again */
	pthread_t thread;
	bool runs;
	atomic_bool stop;
	atomic_uint faults;
	/* The thread's. */
	uint64_t count;
	double way;    /* sum of its differences */
	double offset; /* steps */
	bool homed, compares;
};

static struct encoder *encoder_of(struct incise_driver *driver)
{
	return (struct encoder *)driver;
}

/* Read a number of the count: 0 or a negative errno. */
static int read_number(const struct encoder *e, const char *name, uint64_t *number)
{
	char path[PATH_MAX];
	FILE *file;
	int n;

	snprintf(path, sizeof(path), "%s/%s", e->folder, name);
	file = fopen(path, "re");
	if (!file)
		return -errno;
	errno = EPROTO;
	n = fscanf(file, "%" SCNu64, number);
	fclose(file);
	return n == 1 ? 0 : -errno;
}

static int read_way(struct encoder *e)
{
	uint64_t before = e->count;
	double by;
	int rc = read_number(e, "count", &e->count);

	by = (double)(int64_t)(e->count - before);
	/* The shorter way round. */
	if (!rc)
		e->way += by - e->range * round(by / e->range);
	return rc;
}

/* Compare with the steps given before and after the count was read. */
static void compare_way(struct encoder *e, double before, double after)
{
	double steps = e->way / e->counts_per_step + e->offset;
	double lost = fmax(steps - fmax(before, after), fmin(before, after) - steps);

	if (lost <= e->motor->actuator.lost_steps_max + e->slack)
		return;
	snprintf(e->cause, sizeof(e->cause), "encoder: %.0f %s", lost,
		 incise_stepper_fault_text(INCISE_STEPPER_FAULT_STEPS));
	atomic_store(&e->faults, INCISE_STEPPER_FAULT_STEPS);
}

static double given_steps(const struct incise_stepper_motor_status *status)
{
	return (double)(int64_t)(status->steps_up - status->steps_down);
}

void incise_encoder_look(struct incise_driver *driver)
{
	struct encoder *e = encoder_of(driver);
	struct incise_stepper_motor_status before, after;
	bool homed, powered;
	int rc;

	if (atomic_load(&e->faults) || incise_page_get_status(e->motor->slot, &before))
		return;
	rc = read_way(e);
	if (rc) {
		snprintf(e->cause, sizeof(e->cause),
			 "encoder: its count cannot be read: %s; check it, then clear",
			 strerror(-rc));
		atomic_store(&e->faults, INCISE_STEPPER_FAULT_LINE);
	}
	if (rc || incise_page_get_status(e->motor->slot, &after))
		return;
	homed = after.flags & INCISE_STEPPER_FLAG_HOMED;
	powered = after.state != INCISE_STEPPER_STATE_DISABLED &&
		  after.state != INCISE_STEPPER_STATE_FAULT;
	if (!e->compares || homed != e->homed)
		e->offset = given_steps(&after) - e->way / e->counts_per_step;
	/* Homing by a stall loses steps. */
	e->compares = homed || (powered && !e->motor->actuator.tmc.stall_home);
	e->homed = homed;
	if (e->compares)
		compare_way(e, given_steps(&before), given_steps(&after));
}

static void *watch_encoder(void *argument)
{
	struct encoder *e = argument;

	while (!atomic_load(&e->stop)) {
		incise_encoder_look(&e->driver);
		incise_monotonic_sleep_until(incise_monotonic_ns() + PERIOD_NS);
	}
	return NULL;
}

int incise_encoder_start(struct incise_driver *encoder)
{
	struct encoder *e = encoder_of(encoder);
	int rc = incise_thread_start(&e->thread, watch_encoder, e, NULL);

	e->runs = !rc;
	return rc;
}

static INCISE_REALTIME unsigned int encoder_faults(struct incise_driver *driver)
{
	return atomic_load(&encoder_of(driver)->faults);
}

static int encoder_cause(struct incise_driver *driver, char *text, size_t size)
{
	return encoder_faults(driver)
		       ? snprintf(text, size, "%s", encoder_of(driver)->cause)
		       : 0;
}

/* Until then the thread looks at nothing. A count that cannot be read is a fault again at once. */
static int encoder_clear(struct incise_driver *driver, struct incise_error *err)
{
	(void)err;
	encoder_of(driver)->compares = false;
	atomic_store(&encoder_of(driver)->faults, 0);
	return 0;
}

static void encoder_close(struct incise_driver *driver)
{
	struct encoder *e = encoder_of(driver);
	struct incise_driver **link = &e->motor->driver;

	atomic_store(&e->stop, true);
	if (e->runs)
		pthread_join(e->thread, NULL);
	/* A fault takes the home away, as long as it is attached. */
	while (*link && *link != driver)
		link = &(*link)->next;
	if (*link) {
		e->motor->stepper.ops->disable(&e->motor->stepper, NULL);
		*link = driver->next;
	}
	free(e);
}

struct incise_driver *incise_encoder_open(struct incise_motor *motor, const char *folder,
					  const char *where, struct incise_error *err)
{
	static const struct incise_driver_ops ops = {
		.faults = encoder_faults,
		.cause = encoder_cause,
		.clear = encoder_clear,
		.close = encoder_close,
	};
	const struct incise_actuator *actuator = &motor->actuator;
	double step_mm = incise_actuator_step_mm(actuator);
	uint64_t ceiling;
	struct encoder *e = calloc(1, sizeof(*e));
	int rc = e ? 0 : -ENOMEM;

	if (e) {
		e->driver.ops = &ops;
		e->motor = motor;
		e->counts_per_step = actuator->encoder_counts_per_mm * step_mm;
		e->slack = actuator->velocity_mm_s / step_mm * actuator->tick_ns / 1e9;
		snprintf(e->folder, sizeof(e->folder), "%s/%s", folder,
			 actuator->encoder);
		rc = read_number(e, "count", &e->count);
		/* Not every counter has a ceiling. */
		e->range = read_number(e, "ceiling", &ceiling) ? 0x1p64
							       : (double)ceiling + 1;
	}
	if (!rc)
		return &e->driver;
	incise_error_set(err, -rc,
			 "%s: encoder: %.200s/%s: %s; load the counter's module, or "
			 "correct encoder in rig.conf",
			 where, folder, actuator->encoder, strerror(-rc));
	free(e);
	errno = -rc;
	return NULL;
}
