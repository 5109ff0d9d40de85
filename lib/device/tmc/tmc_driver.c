// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A driver chip and the thread that watches it; see tmc_driver.h. Sources: data sheets TMC2209 rev.
 * 1.09, chapter 5, and TMC5160 rev. 1.18, chapter 6.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../../base/monotonic.h"
#include "../../rig/backends.h"
#include "../../rig/thread.h"
#include "tmc_driver.h"

#define TSTEP 0x12
#define DRV_STATUS 0x6f
#define STANDSTILL (1u << 31) /* in DRV_STATUS of both */
#define GSTAT_RESET 1u
#define GSTAT_DRV_ERR 2u
#define GSTAT_UV_CP 4u
#define GSTAT_ALL 7u /* writing a 1 clears it */
#define MRES 24	     /* in CHOPCONF */
#define INTPOL (1u << 28)

#define CLOCK_HZ 12e6 /* the internal one */
#define TSTEP_MAX 0xfffff
#define HOLD_DELAY \
	(8u << 16) /* 2^18 clocks for each step of the current down to hold_A */

#define PAUSE_NS 20000000
#define PAUSES_PER_LOOK 10 /* five looks a second */
#define UNANSWERED_LOOKS 3
#define STALLED_LOOKS 2
#define OPEN_LOOKS 5
#define SLOW 0.25 /* of velocity_mm_s: in faster motion a coil may seem open */

/* --- settings ------------------------------------------------------------------------- */

double tmc_full_A(const struct tmc_driver *d, double sense_V)
{
	return sense_V * M_SQRT1_2 /
	       (d->actuator.tmc.sense_ohm + d->model->sense_extra_ohm);
}

/* 1/32 … 32/32 of @most_A as 0 … 31. */
static uint32_t current_bits(double A, double most_A)
{
	return (uint32_t)fmax(0, fmin(31, round(32 * A / most_A - 1)));
}

uint32_t tmc_currents(const struct tmc_driver *d, double most_A)
{
	return HOLD_DELAY | current_bits(d->actuator.tmc.run_A, most_A) << 8 |
	       current_bits(d->actuator.tmc.hold_A, most_A);
}

uint32_t tmc_microsteps(const struct tmc_driver *d)
{
	uint32_t bits = 8;

	for (int n = d->actuator.microsteps; n > 1; n /= 2)
		bits--;
	return bits << MRES | (d->actuator.tmc.interpolate ? INTPOL : 0);
}

/* Clocks between two of 256 microsteps; 0 for 0, which no speed reaches. */
uint32_t tmc_step_clocks(const struct tmc_driver *d, double mm_s)
{
	double steps_s = 256 * mm_s / d->actuator.lead_mm * d->actuator.steps_per_turn;

	return mm_s > 0 ? (uint32_t)fmin(TSTEP_MAX, CLOCK_HZ / steps_s) : 0;
}

static int check_settings(const struct tmc_driver *d, struct incise_error *err)
{
	const struct incise_actuator_tmc *tmc = &d->actuator.tmc;
	const struct tmc_model *m = d->model;
	bool stealth = tmc->stealthchop && (!tmc->stealthchop_mm_s ||
					    tmc->stall_mm_s < tmc->stealthchop_mm_s);

	if (tmc->run_A > tmc_full_A(d, TMC_SENSE_V))
		return incise_error_set(
			err, ERANGE,
			"%s: run_A is %g, but with sense_ohm = %g it gives at most %.3f; "
			"correct them in rig.conf",
			d->name, tmc->run_A, tmc->sense_ohm, tmc_full_A(d, TMC_SENSE_V));
	if (tmc->stall_threshold < m->threshold_least ||
	    tmc->stall_threshold > m->threshold_most)
		return incise_error_set(
			err, ERANGE,
			"%s: stall_threshold is %d, but a %s has %d to %d; correct it in "
			"rig.conf",
			d->name, tmc->stall_threshold, m->name, m->threshold_least,
			m->threshold_most);
	if (tmc->stall_mm_s > 0 && stealth != m->stall_in_stealthchop)
		return incise_error_set(
			err, ERANGE,
			"%s: StallGuard of a %s needs %s at stall_mm_s; correct "
			"stealthchop and stealthchop_mm_s in rig.conf",
			d->name, m->name,
			m->stall_in_stealthchop ? "StealthChop" : "SpreadCycle");
	return 0;
}

static int refuse_line(const struct tmc_driver *d, int rc, struct incise_error *err)
{
	return incise_error_set(
		err, ENODEV,
		"%s: no %s answers: %s; check the motor's supply, the wiring and the "
		"address",
		d->name, d->model->name, strerror(-rc));
}

static int check_version(struct tmc_driver *d, struct incise_error *err)
{
	uint32_t pins;
	int rc = d->model->read(d, d->model->inputs, &pins);

	if (rc)
		return refuse_line(d, rc, err);
	if (pins >> 24 != d->model->version)
		return incise_error_set(
			err, ENODEV,
			"%s: its version is 0x%02x, that of a %s is 0x%02x; correct driver "
			"in rig.conf, or check the wiring",
			d->name, pins >> 24, d->model->name, d->model->version);
	if (~pins & d->model->used_by_steps)
		return incise_error_set(err, ENODEV,
					"%s: its pin SD_MODE is low, so it ignores the "
					"step line; wire it high",
					d->name);
	return 0;
}

static int read_microsteps(uint32_t chopconf)
{
	return 256 >> (chopconf >> MRES & 15);
}

static int check_row(struct tmc_driver *d, const struct tmc_row *row,
		     struct incise_error *err)
{
	uint32_t value = row->value;
	int rc = row->readable ? d->model->read(d, row->reg, &value) : 0;

	if (rc)
		return refuse_line(d, rc, err);
	if (value == row->value)
		return 0;
	if (row->reg == TMC_CHOPCONF && read_microsteps(value) != d->actuator.microsteps)
		return incise_error_set(
			err, EIO,
			"%s: it makes %d microsteps, but rig.conf has microsteps = %d; "
			"end the program that also sets the chip up",
			d->name, read_microsteps(value), d->actuator.microsteps);
	return incise_error_set(
		err, EIO,
		"%s: register 0x%02x has 0x%08x after 0x%08x was written; end the program "
		"that also sets the chip up",
		d->name, row->reg, value, row->value);
}

/* Write all settings, read back those that can be read, and begin without a fault. */
static int set_up_chip(struct tmc_driver *d, struct incise_error *err)
{
	struct tmc_row rows[TMC_ROWS_MAX];
	uint32_t state;
	double most_A;
	int n = d->model->fill(d, rows, &most_A), rc = check_settings(d, err);

	if (!rc)
		rc = check_version(d, err);
	if (rc)
		return rc;
	rc = d->model->read(d, TMC_GSTAT, &state);
	d->driver.restarted = !rc && state & GSTAT_ALL;
	for (int i = 0; !rc && i < n; i++)
		rc = d->model->write(d, rows[i].reg, rows[i].value);
	if (!rc)
		rc = d->model->write(d, TMC_GSTAT, GSTAT_ALL);
	if (rc)
		return refuse_line(d, rc, err);
	for (int i = 0; !rc && i < n; i++)
		rc = check_row(d, &rows[i], err);
	d->unanswered = d->open = d->stalled = 0;
	if (!rc)
		atomic_store_explicit(&d->faults, 0, memory_order_release);
	return rc;
}

/* --- watching ------------------------------------------------------------------------- */

/* The first fault stays. */
static void latch_fault(struct tmc_driver *d, enum incise_stepper_fault fault,
			const char *cause)
{
	if (atomic_load_explicit(&d->faults, memory_order_relaxed))
		return;
	snprintf(d->cause, sizeof(d->cause), "%s: %s, then clear, enable and home",
		 d->name, cause);
	atomic_store_explicit(&d->faults, fault, memory_order_release);
}

/* In the order in which they are looked for. */
static void look_at_status(struct tmc_driver *d, uint32_t state, uint32_t status)
{
	const struct tmc_model *m = d->model;
	const struct {
		uint32_t set;
		enum incise_stepper_fault fault;
		const char *cause;
	} all[] = {
		{state & GSTAT_RESET, INCISE_STEPPER_FAULT_LOST,
		 "it restarted and lost its settings; check the motor's supply"},
		{status & m->shorted, INCISE_STEPPER_FAULT_ALARM,
		 "short circuit at a coil; switch the supply off, check motor and cable"},
		{status & m->hot, INCISE_STEPPER_FAULT_ALARM,
		 "too hot, it switched the motor off; cool it, or give a smaller run_A"},
		{state & GSTAT_UV_CP, INCISE_STEPPER_FAULT_ALARM,
		 "the motor's supply is too low; check it"},
		{state & GSTAT_DRV_ERR, INCISE_STEPPER_FAULT_ALARM,
		 "heat or a short circuit switched the motor off; check motor and cable"},
	};
	bool warm = status & m->warm;

	d->warnings += warm && !d->warm;
	d->warm = warm;
	for (size_t i = 0; i < sizeof(all) / sizeof(*all); i++)
		if (all[i].set)
			latch_fault(d, all[i].fault, all[i].cause);
}

/* Conditions that only a moving motor shows, and that must last. */
static int look_at_motion(struct tmc_driver *d, uint32_t status)
{
	const struct incise_actuator *a = &d->actuator;
	uint32_t clocks, load;
	int rc = d->model->read(d, TSTEP, &clocks);

	if (!rc)
		rc = d->model->read(d, d->model->load, &load);
	if (rc || status & STANDSTILL)
		return rc;
	d->stalled = clocks <= tmc_step_clocks(d, a->tmc.stall_mm_s) &&
				     (int)(load & 0x3ff) <= d->model->threshold_load *
								    a->tmc.stall_threshold
			     ? d->stalled + 1
			     : 0;
	if (clocks >= tmc_step_clocks(d, SLOW * a->velocity_mm_s))
		d->open = status & d->model->open ? d->open + 1 : 0;
	if (d->open >= OPEN_LOOKS)
		latch_fault(d, INCISE_STEPPER_FAULT_ALARM,
			    "a coil of the motor is open; check its plug and cable");
	if (d->stalled >= STALLED_LOOKS && !a->tmc.stall_home)
		latch_fault(
			d, INCISE_STEPPER_FAULT_FOLLOWING,
			"StallGuard reports a stall; remove what blocks it, or give a "
			"smaller stall_threshold");
	return 0;
}

void tmc_driver_look(struct tmc_driver *d)
{
	uint32_t state, status;
	int rc = d->model->read(d, TMC_GSTAT, &state);

	if (!rc)
		rc = d->model->read(d, DRV_STATUS, &status);
	if (!rc) {
		look_at_status(d, state, status);
		rc = look_at_motion(d, status);
	}
	d->unanswered = rc ? d->unanswered + 1 : 0;
	if (d->unanswered >= UNANSWERED_LOOKS)
		latch_fault(
			d, INCISE_STEPPER_FAULT_LOST,
			"it does not answer any more; check the motor's supply and the "
			"wiring");
}

static void *watch_chip(void *argument)
{
	struct tmc_driver *d = argument;

	for (int i = 0; !atomic_load(&d->stop); i++) {
		if (i % PAUSES_PER_LOOK == 0) {
			pthread_mutex_lock(&d->line->lock);
			tmc_driver_look(d);
			pthread_mutex_unlock(&d->line->lock);
		}
		incise_monotonic_sleep_until(incise_monotonic_ns() + PAUSE_NS);
	}
	return NULL;
}

/* --- functions of the driver ---------------------------------------------------------- */

static struct tmc_driver *tmc_of(struct incise_driver *driver)
{
	return (struct tmc_driver *)driver;
}

static INCISE_REALTIME unsigned int driver_faults(struct incise_driver *driver)
{
	return atomic_load_explicit(&tmc_of(driver)->faults, memory_order_acquire);
}

static int driver_cause(struct incise_driver *driver, char *text, size_t size)
{
	return driver_faults(driver) ? snprintf(text, size, "%s", tmc_of(driver)->cause)
				     : 0;
}

static int driver_clear(struct incise_driver *driver, struct incise_error *err)
{
	struct tmc_driver *d = tmc_of(driver);
	int rc;

	pthread_mutex_lock(&d->line->lock);
	rc = set_up_chip(d, err);
	/* A cause that persists is a fault again at once. */
	if (!rc)
		tmc_driver_look(d);
	pthread_mutex_unlock(&d->line->lock);
	return !rc && driver_faults(driver) ? incise_error_set(err, EBUSY, "%s", d->cause)
					    : rc;
}

static int read_chip(struct tmc_driver *d, struct incise_stepper_chip *chip)
{
	const struct tmc_model *m = d->model;
	const struct incise_actuator_tmc *tmc = &d->actuator.tmc;
	uint32_t chopconf, status, load;
	struct tmc_row rows[TMC_ROWS_MAX];
	double most_A;
	int rc = m->read(d, TMC_CHOPCONF, &chopconf);

	if (!rc)
		rc = m->read(d, DRV_STATUS, &status);
	if (!rc)
		rc = m->read(d, m->load, &load);
	if (rc)
		return rc;
	m->fill(d, rows, &most_A);
	*chip = (struct incise_stepper_chip){
		.run_A = (current_bits(tmc->run_A, most_A) + 1) * most_A / 32,
		.hold_A = (current_bits(tmc->hold_A, most_A) + 1) * most_A / 32,
		.microsteps = read_microsteps(chopconf),
		.stealthchop = status & m->stealth,
		.standstill = status & STANDSTILL,
		.warm = status & m->warm,
		.load = (int)(load & 0x3ff),
		.threshold_load = m->threshold_load,
		.threshold = tmc->stall_threshold,
	};
	snprintf(chip->name, sizeof(chip->name), "%s", d->actuator.driver);
	return 0;
}

static int driver_read(struct incise_driver *driver, struct incise_stepper_chip *chip)
{
	struct tmc_driver *d = tmc_of(driver);
	int rc;

	if (d->line->fd < 0)
		return -EBUSY;
	pthread_mutex_lock(&d->line->lock);
	rc = read_chip(d, chip);
	pthread_mutex_unlock(&d->line->lock);
	return rc;
}

static int driver_counter(struct incise_driver *driver, int i,
			  struct incise_stepper_counter *counter)
{
	struct tmc_driver *d = tmc_of(driver);

	pthread_mutex_lock(&d->line->lock);
	*counter = i ? (struct incise_stepper_counter){"chip_repeats",
						       "messages to the chip sent again",
						       d->repeats, false}
		     : (struct incise_stepper_counter){"chip_warnings",
						       "temperature warnings of the chip",
						       d->warnings, true};
	pthread_mutex_unlock(&d->line->lock);
	return i < 2 ? 0 : -ENOENT;
}

static void driver_close(struct incise_driver *driver)
{
	struct tmc_driver *d = tmc_of(driver);

	if (d->runs) {
		atomic_store(&d->stop, true);
		pthread_join(d->thread, NULL);
	}
	if (d->line == d && d->fd >= 0)
		close(d->fd);
	pthread_mutex_destroy(&d->lock);
	free(d);
}

static int start_tmc(struct tmc_driver *d, const struct incise_backend_request *request,
		     struct incise_error *err)
{
	int rc = d->model->connect(d, request, err);

	/* A program that only watches changes no setting; another may have the line. */
	if (request->watch)
		return rc == -EBUSY || rc == -EWOULDBLOCK ? 0 : rc;
	if (rc)
		return rc;
	pthread_mutex_lock(&d->line->lock);
	rc = set_up_chip(d, err);
	pthread_mutex_unlock(&d->line->lock);
	if (rc)
		return rc;
	rc = incise_thread_start(&d->thread, watch_chip, d, NULL);
	d->runs = !rc;
	return rc ? incise_error_set(err, -rc, "%s: %s", d->name, strerror(-rc)) : 0;
}

void *tmc_driver_open(const struct incise_backend_request *request,
		      const struct tmc_model *model, struct incise_error *err)
{
	static const struct incise_driver_ops ops = {
		.faults = driver_faults,
		.cause = driver_cause,
		.clear = driver_clear,
		.read = driver_read,
		.counter = driver_counter,
		.close = driver_close,
	};
	struct tmc_driver *d = incise_backend_alloc(sizeof(*d), request->where, err);
	int rc;

	if (!d)
		return NULL;
	d->driver.ops = &ops;
	d->model = model;
	d->actuator = *request->actuator;
	snprintf(d->name, sizeof(d->name), "driver %.70s", d->actuator.driver);
	d->fd = -1;
	d->line = d;
	pthread_mutex_init(&d->lock, NULL);
	rc = start_tmc(d, request, err);
	if (!rc)
		return d;
	driver_close(&d->driver);
	errno = -rc;
	return NULL;
}
