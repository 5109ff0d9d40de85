// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A motor behind pages, in mm; see motor.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/clock.h>
#include "motor.h"
#include "page.h"

#define LEAST_PULSE_NS 5000 /* default: enough for most power stages */
#define UNREAD_MAX 100	    /* failed reads until -EIO */
#define POLL_NS INCISE_NS_PER_S / 1000
#define DISABLE_NS (2 * INCISE_NS_PER_S) /* more than a drive is given to stop */
#define BESIDE_LIMIT_MM 0.5		 /* home, where that is a limit */
#define LATE_MAX 20			 /* edges in a row */
#define TICK_MOST_S 0.002		 /* between writes of a status with power */
/* Homing: the second approach, and the way off the input before it. */
#define EDGE_SLOW 0.1 /* of home_mm_s */
#define CLEARANCE_MM 0.2
#define STALL_STEPS 20 /* at full speed before StallGuard's value is right */

double incise_actuator_step_mm(const struct incise_actuator *actuator)
{
	return actuator->lead_mm /
	       ((double)actuator->steps_per_turn * actuator->microsteps);
}

/* Whole microsteps in the travel; rounding must not lose one. */
static double travel_steps(const struct incise_actuator *actuator)
{
	return floor(actuator->travel_mm / incise_actuator_step_mm(actuator) *
		     (1 + 1e-12));
}

int32_t incise_actuator_steps(const struct incise_actuator *actuator, double position_mm)
{
	double steps = position_mm / incise_actuator_step_mm(actuator);

	if (isnan(steps))
		return 0;
	return (int32_t)fmax(0, fmin(travel_steps(actuator), round(steps)));
}

int64_t incise_actuator_rate(const struct incise_actuator *actuator, double velocity_mm_s)
{
	double most = actuator->velocity_mm_s;

	if (isnan(velocity_mm_s))
		return 0;
	velocity_mm_s = fmax(-most, fmin(most, velocity_mm_s));
	return llround(velocity_mm_s / incise_actuator_step_mm(actuator));
}

static double whole(double value)
{
	return fmin(INCISE_MOTOR_STEPS_MAX, floor(value * (1 + 1e-12)));
}

void incise_actuator_limits(const struct incise_actuator *actuator,
			    struct incise_profile_limits *limits)
{
	double step_mm = incise_actuator_step_mm(actuator);

	*limits = (struct incise_profile_limits){
		.tick_ns = actuator->tick_ns,
		.velocity = (uint32_t)whole(actuator->velocity_mm_s / step_mm),
		.acceleration = (uint32_t)whole(actuator->acceleration_mm_s2 / step_mm),
		.position_max = (int32_t)travel_steps(actuator),
		.jerk = (uint64_t)floor(actuator->jerk_mm_s3 / step_mm),
	};
}

static struct incise_motor *motor_of(const struct incise_stepper *stepper)
{
	return (struct incise_motor *)stepper;
}

static double to_mm(const struct incise_motor *motor, int64_t steps)
{
	return (double)steps * incise_actuator_step_mm(&motor->actuator);
}

/*
 * Age of a status with power that is older than the deadman, else 0: its writer was stopped with this
 * program, and stops the motor as soon as it runs again. Found here, so that nothing depends
 * on which of the two threads runs first.
 */
static int64_t stood_still(struct incise_motor *motor)
{
	double most_ns = (motor->actuator.deadman_s + TICK_MOST_S) * INCISE_NS_PER_S;
	int64_t age_ns;

	if (!motor->in_process || motor->watches ||
	    motor->last.state == INCISE_STEPPER_STATE_DISABLED ||
	    motor->last.state == INCISE_STEPPER_STATE_FAULT)
		return 0;
	age_ns = motor->ops->now(motor) - motor->last.t_ns;
	return (double)age_ns > most_ns ? age_ns : 0;
}

static INCISE_REALTIME uint32_t driver_faults(const struct incise_motor *motor)
{
	uint32_t faults = 0;

	for (struct incise_driver *d = motor->driver; d; d = d->next)
		faults |= d->ops->faults(d);
	return faults;
}

/* Faults of chip and encoder are in no status: the writer of it cannot ask them. */
static void add_driver_faults(struct incise_motor *motor)
{
	uint32_t faults = driver_faults(motor);

	if (!faults)
		return;
	motor->last.faults |= faults;
	motor->last.flags &= ~INCISE_STEPPER_FLAG_HOMED;
	motor->last.state =
		motor->last.state == INCISE_STEPPER_STATE_DISABLED ||
				motor->last.state == INCISE_STEPPER_STATE_FAULT
			? INCISE_STEPPER_STATE_FAULT
			: INCISE_STEPPER_STATE_STOPPING;
}

/*
 * Read the status. While a writer is interrupted the last one stays valid, but not for
 * more than UNREAD_MAX reads.
 */
static int look_motor(struct incise_motor *motor)
{
	int rc = incise_page_get_status(motor->slot, &motor->last);

	if (rc != -EAGAIN) {
		motor->unread = 0;
		motor->still_ns = rc ? 0 : stood_still(motor);
		if (motor->still_ns) {
			motor->last.faults |= INCISE_STEPPER_FAULT_DEADMAN;
			motor->last.state = INCISE_STEPPER_STATE_STOPPING;
		}
		if (!rc)
			add_driver_faults(motor);
		return rc;
	}
	if (motor->unread >= UNREAD_MAX)
		return -EIO;
	motor->unread++;
	return 0;
}

INCISE_REALTIME int incise_motor_drivable(struct incise_motor *motor)
{
	int rc = motor->watches ? -EPERM : look_motor(motor);

	if (rc)
		return rc;
	if (motor->last.faults & INCISE_STEPPER_FAULT_GONE)
		return -ENODEV;
	if (motor->last.faults || (motor->last.state != INCISE_STEPPER_STATE_READY &&
				   motor->last.state != INCISE_STEPPER_STATE_MOVING))
		return -EIO;
	return 0;
}

static INCISE_REALTIME int motor_set(struct incise_stepper *stepper, double position_mm)
{
	struct incise_motor *motor = motor_of(stepper);
	int rc;

	if (!isfinite(position_mm))
		return -EDOM;
	rc = incise_motor_drivable(motor);
	if (rc)
		return rc;
	motor->beyond = position_mm < 0 || position_mm > motor->actuator.travel_mm;
	incise_page_put_setpoint(motor->setpoint, INCISE_STEPPER_MODE_POSITION,
				 incise_actuator_steps(&motor->actuator, position_mm),
				 motor->ops->now(motor));
	return 0;
}

static int motor_jog(struct incise_stepper *stepper, double velocity_mm_s)
{
	struct incise_motor *motor = motor_of(stepper);
	int rc;

	if (!isfinite(velocity_mm_s))
		return -EDOM;
	rc = incise_motor_drivable(motor);
	if (rc)
		return rc;
	motor->beyond = false;
	incise_page_put_setpoint(motor->setpoint, INCISE_STEPPER_MODE_VELOCITY,
				 incise_actuator_rate(&motor->actuator, velocity_mm_s),
				 motor->ops->now(motor));
	return 0;
}

static INCISE_REALTIME int motor_status(struct incise_stepper *stepper,
					struct incise_stepper_status *status)
{
	struct incise_motor *motor = motor_of(stepper);
	const struct incise_stepper_motor_status *last = &motor->last;
	int rc = look_motor(motor);

	*status = (struct incise_stepper_status){
		.t_ns = last->t_ns,
		.position_mm = to_mm(motor, last->position),
		.velocity_mm_s = (double)last->velocity / 65536 *
				 incise_actuator_step_mm(&motor->actuator),
		.handle_mm = NAN,
		.force_N = NAN,
		.faults =
			last->faults | (motor->beyond ? INCISE_STEPPER_FAULT_TRAVEL : 0),
		.state = (enum incise_stepper_state)last->state,
		.inputs = last->inputs,
		.homed = last->flags & INCISE_STEPPER_FLAG_HOMED,
		.late = last->late,
	};
	if (!rc && last->faults & INCISE_STEPPER_FAULT_GONE)
		rc = -ENODEV;
	return rc;
}

/* The first latched fault in words. */
static const char *fault_text(const struct incise_motor *motor)
{
	unsigned int faults = motor->last.faults;

	return incise_stepper_fault_text((enum incise_stepper_fault)(faults & -faults));
}

/* Report @rc with the message of the ops, or with the cause that the status shows. */
static int reported(struct incise_motor *motor, int rc, const char *what,
		    const struct incise_error *said, struct incise_error *err)
{
	const char *why = NULL;

	if (!rc)
		return 0;
	if (said->code)
		return incise_error_set(err, -rc, "%s", said->text);
	look_motor(motor);
	if (rc == -EPERM && motor->watches)
		why = "it was opened only to watch; use the program that drives it";
	else if (motor->last.faults & INCISE_STEPPER_FAULT_GONE || rc == -ENODEV)
		why = incise_stepper_fault_text(INCISE_STEPPER_FAULT_GONE);
	else if (rc == -EBUSY && motor->last.inputs & INCISE_STEPPER_LINE_ESTOP)
		why = "the e-stop is active; release it";
	else if (rc == -EBUSY && motor->last.inputs & INCISE_STEPPER_LINE_ALARM)
		why = "the power stage reports a fault; see its display, switch it off "
		      "and on";
	else if (rc == -EBUSY)
		why = "it still moves; wait until it is at rest";
	else if (motor->last.faults)
		why = fault_text(motor);
	return incise_error_set(err, -rc, "%s: %s: %s", motor->name, what,
				why ? why : strerror(-rc));
}

/* A motor without power has lost its currents for a while: its count means nothing. */
static int forget_home(struct incise_motor *motor)
{
	int rc = look_motor(motor);

	return rc ? rc : motor->ops->origin(motor, motor->last.position, false);
}

static int driver_cause(const struct incise_motor *motor, char *text, size_t size)
{
	int length = 0;

	for (struct incise_driver *d = motor->driver; d && length <= 0; d = d->next)
		length = d->ops->cause(d, text, size);
	return length;
}

/* -EPERM with a latched fault of chip or encoder. */
static int refuse_by_driver(const struct incise_motor *motor, struct incise_error *why)
{
	char cause[240];

	if (driver_cause(motor, cause, sizeof(cause)) <= 0)
		return 0;
	return incise_error_set(why, EPERM, "%s: cannot be enabled: %s", motor->name,
				cause);
}

static int motor_enable(struct incise_stepper *stepper, struct incise_error *err)
{
	struct incise_motor *motor = motor_of(stepper);
	struct incise_error why = {0};
	int rc = motor->watches ? -EPERM : refuse_by_driver(motor, &why);

	if (!rc)
		rc = motor->ops->enable(motor, &why);
	motor->beyond = false;
	return reported(motor, rc, "cannot be enabled", &why, err);
}

static int clear_driver(struct incise_motor *motor, struct incise_error *why)
{
	int rc = look_motor(motor);

	if (rc || !driver_faults(motor))
		return rc;
	if (motor->last.state != INCISE_STEPPER_STATE_FAULT)
		return -EBUSY;
	rc = forget_home(motor);
	for (struct incise_driver *d = motor->driver; d && !rc; d = d->next)
		if (d->ops->faults(d))
			rc = d->ops->clear(d, why);
	return rc;
}

static int motor_clear(struct incise_stepper *stepper, struct incise_error *err)
{
	struct incise_motor *motor = motor_of(stepper);
	struct incise_error why = {0};
	int rc = motor->watches ? -EPERM : motor->ops->clear(motor, &why);

	if (!rc && motor->driver)
		rc = clear_driver(motor, &why);
	return reported(motor, rc, "cannot be cleared", &why, err);
}

static int motor_wait(struct incise_stepper *stepper, int64_t ns)
{
	struct incise_motor *motor = motor_of(stepper);
	struct timespec wait = {ns / INCISE_NS_PER_S, ns % INCISE_NS_PER_S};

	if (motor->ops->wait)
		return motor->ops->wait(motor, ns);
	/* Interrupted by a signal: the caller polls again. */
	clock_nanosleep(CLOCK_MONOTONIC, 0, &wait, NULL);
	return 0;
}

static int motor_disable(struct incise_stepper *stepper, struct incise_error *err)
{
	struct incise_motor *motor = motor_of(stepper);
	int rc = motor->ops->disable(motor);
	struct incise_profile_limits limits;
	int64_t left_ns;

	incise_actuator_limits(&motor->actuator, &limits);
	/* A drive that is off the bus may use up its deadman first. */
	left_ns = DISABLE_NS + (int64_t)(motor->actuator.deadman_s * INCISE_NS_PER_S) +
		  (int64_t)incise_profile_stopping_ns(&limits, UINT32_MAX);
	/* A retract may take the whole travel. */
	if (motor->actuator.retract)
		left_ns += (int64_t)(motor->actuator.travel_mm /
				     motor->actuator.velocity_mm_s * INCISE_NS_PER_S);
	while (!rc) {
		rc = look_motor(motor);
		if (rc || motor->last.state == INCISE_STEPPER_STATE_DISABLED ||
		    motor->last.state == INCISE_STEPPER_STATE_FAULT)
			break;
		motor_wait(stepper, POLL_NS);
		left_ns -= POLL_NS;
		if (left_ns <= 0)
			return incise_error_set(err, ETIMEDOUT,
						"%s: did not come to rest in time; "
						"switch its power off",
						motor->name);
	}
	/* The module would keep it for the next program. */
	if (!rc && !motor->watches && driver_faults(motor))
		rc = forget_home(motor);
	return reported(motor, rc, "cannot be disabled", &(struct incise_error){0}, err);
}

static void motor_info(const struct incise_stepper *stepper,
		       struct incise_stepper_info *info)
{
	const struct incise_motor *motor = motor_of(stepper);
	const struct incise_actuator *actuator = &motor->actuator;

	*info = (struct incise_stepper_info){
		.spring_N_mm = actuator->spring_N_mm,
		.travel_mm = actuator->travel_mm,
		.step_mm = incise_actuator_step_mm(actuator),
		.velocity_mm_s = actuator->velocity_mm_s,
		.acceleration_mm_s2 = actuator->acceleration_mm_s2,
		.jerk_mm_s3 = actuator->jerk_mm_s3,
		.deadman_s = actuator->deadman_s,
		.rate_max_hz = motor->rate_max_hz,
		/* The count of steps is exact. */
		.within_mm = incise_actuator_step_mm(actuator) / 2,
		.can_home = incise_motor_home_line(motor),
		.origin_mm = actuator->origin_mm,
		.rest_mm = actuator->rest_mm,
		.late_s = actuator->late_s,
		.inputs = motor->lines & ((1U << INCISE_STEPPER_INPUTS) - 1),
	};
	snprintf(info->name, sizeof(info->name), "%s", motor->name);
}

static void motor_close(struct incise_stepper *stepper)
{
	motor_of(stepper)->ops->close(motor_of(stepper));
}

unsigned int incise_motor_home_line(const struct incise_motor *motor)
{
	return motor->lines & INCISE_STEPPER_LINE_HOME
		       ? INCISE_STEPPER_LINE_HOME
		       : motor->lines & INCISE_STEPPER_LINE_LIMIT_MIN;
}

static int motor_homing(struct incise_stepper *stepper,
			struct incise_stepper_homing *homing)
{
	const struct incise_motor *motor = motor_of(stepper);
	const struct incise_actuator *actuator = &motor->actuator;
	double speed_mm_s = actuator->home_mm_s;

	homing->speed_mm_s = speed_mm_s;
	homing->edge_mm_s = EDGE_SLOW * speed_mm_s;
	homing->clearance_mm = CLEARANCE_MM;
	/* A stall is found at speed only. */
	if (motor->driver && actuator->tmc.stall_home) {
		homing->edge_mm_s = speed_mm_s;
		homing->clearance_mm =
			speed_mm_s * speed_mm_s / actuator->acceleration_mm_s2 +
			STALL_STEPS * actuator->lead_mm / actuator->steps_per_turn;
	}
	homing->home_mm = motor->actuator.home_mm;
	homing->home_at = incise_motor_home_line(motor);
	if (!homing->home_at)
		return -EOPNOTSUPP;
	/* Rest beside the switch, not on it. */
	if (homing->home_at == INCISE_STEPPER_LINE_LIMIT_MIN && !motor->actuator.has_home)
		homing->home_mm = -fmin(BESIDE_LIMIT_MM, motor->actuator.travel_mm / 4);
	return 0;
}

/* Only edges of the home input are stored; the edge of a limit is where it halts. */
static int motor_edge(struct incise_stepper *stepper, struct incise_stepper_edge *edge)
{
	struct incise_motor *motor = motor_of(stepper);
	int rc = look_motor(motor);

	edge->seen = motor->lines & INCISE_STEPPER_LINE_HOME &&
		     motor->last.flags & INCISE_STEPPER_FLAG_HOME_SEEN;
	edge->position_mm = to_mm(motor, motor->last.home_position);
	return rc;
}

static int motor_origin(struct incise_stepper *stepper, double position_mm, bool homed)
{
	struct incise_motor *motor = motor_of(stepper);
	int32_t steps = incise_actuator_steps(&motor->actuator, position_mm);
	int rc = incise_motor_drivable(motor);

	return rc ? rc : motor->ops->origin(motor, steps, homed);
}

static int motor_cause(struct incise_stepper *stepper, char *text, size_t size)
{
	struct incise_motor *motor = motor_of(stepper);
	int length = driver_cause(motor, text, size);

	if (length <= 0 && !look_motor(motor) &&
	    motor->last.faults & INCISE_STEPPER_FAULT_STEPS)
		length = snprintf(text, size, "%s: %lld %s", motor->name,
				  llabs(motor->last.lost_steps),
				  incise_stepper_fault_text(INCISE_STEPPER_FAULT_STEPS));
	return length;
}

static int motor_counter(struct incise_stepper *stepper, int i,
			 struct incise_stepper_counter *counter)
{
	struct incise_motor *motor = motor_of(stepper);

	if (!i && incise_motor_home_line(motor)) {
		look_motor(motor);
		*counter = (struct incise_stepper_counter){
			"lost_steps", "steps missing at the last pass of the home edge",
			(uint64_t)llabs(motor->last.lost_steps), false};
		return 0;
	}
	i -= !!incise_motor_home_line(motor);
	for (struct incise_driver *d = motor->driver; d; d = d->next)
		for (int k = 0; d->ops->counter && !d->ops->counter(d, k, counter); k++)
			if (!i--)
				return 0;
	return -ENOENT;
}

static int motor_attach(struct incise_stepper *stepper, struct incise_driver *driver)
{
	struct incise_motor *motor = motor_of(stepper);

	driver->next = motor->driver;
	motor->driver = driver;
	return driver->restarted && !motor->watches ? forget_home(motor) : 0;
}

static int motor_chip(struct incise_stepper *stepper, struct incise_stepper_chip *chip)
{
	for (struct incise_driver *d = motor_of(stepper)->driver; d; d = d->next)
		if (d->ops->read)
			return d->ops->read(d, chip);
	return -EOPNOTSUPP;
}

void incise_motor_init(struct incise_motor *motor)
{
	static const struct incise_stepper_ops ops = {
		.set = motor_set,
		.jog = motor_jog,
		.status = motor_status,
		.enable = motor_enable,
		.disable = motor_disable,
		.clear = motor_clear,
		.info = motor_info,
		.close = motor_close,
		.homing = motor_homing,
		.edge = motor_edge,
		.origin = motor_origin,
		.wait = motor_wait,
		.cause = motor_cause,
		.counter = motor_counter,
		.attach = motor_attach,
		.chip = motor_chip,
	};

	motor->stepper.ops = &ops;
}

void incise_motor_config(const struct incise_actuator *actuator, unsigned int index,
			 struct incise_stepper_config *config)
{
	struct incise_profile_limits limits;

	incise_actuator_limits(actuator, &limits);
	*config = (struct incise_stepper_config){
		.motor = index,
		.flags = (actuator->invert ? INCISE_STEPPER_CONFIG_INVERT : 0) |
			 (actuator->retract ? INCISE_STEPPER_CONFIG_RETRACT : 0) |
			 (actuator->volatile_home ? INCISE_STEPPER_CONFIG_VOLATILE_HOME
						  : 0),
		.tick_ns = limits.tick_ns,
		.velocity = limits.velocity,
		.acceleration = limits.acceleration,
		.late_max = LATE_MAX,
		.lost_steps_max = (__u64)actuator->lost_steps_max,
		.jerk = limits.jerk,
		.position_max = limits.position_max,
		.safe_position = incise_actuator_steps(actuator, actuator->rest_mm),
		.deadman_ns = (__u64)llround(actuator->deadman_s * INCISE_NS_PER_S),
		.high_ns = actuator->high_ns,
		.low_ns = actuator->low_ns,
		.setup_ns = actuator->setup_ns,
		.hold_ns = actuator->hold_ns,
		.enable_ns = actuator->enable_ns,
	};
}

int incise_motor_fit(struct incise_actuator *actuator, const char *where,
		     uint32_t rate_max, uint32_t pulse_ns, uint32_t step_ns,
		     struct incise_error *err)
{
	double step_mm = incise_actuator_step_mm(actuator);
	double rate = actuator->velocity_mm_s / step_mm, most = rate_max, own;
	uint32_t least = pulse_ns > LEAST_PULSE_NS ? pulse_ns : LEAST_PULSE_NS;

	if (!actuator->high_ns)
		actuator->high_ns = least;
	if (!actuator->low_ns)
		actuator->low_ns = least;
	if (actuator->high_ns < pulse_ns || actuator->low_ns < pulse_ns)
		return incise_error_set(
			err, ERANGE,
			"%s: high_us and low_us are %g and %g, but this machine needs "
			"at least %g; correct or remove them in rig.conf",
			where, actuator->high_ns / 1e3, actuator->low_ns / 1e3,
			pulse_ns / 1e3);
	own = 1e9 / ((double)actuator->high_ns + actuator->low_ns + step_ns);
	most = fmin(most, own);
	if (rate <= most * (1 + 1e-9))
		return 0;
	return incise_error_set(
		err, ERANGE,
		"%s: velocity_mm_s = %g needs %.0f steps/s, but this machine reaches "
		"at most %.0f (by its self-test and the pulse times); give at most %g "
		"mm/s in rig.conf, or fewer microsteps",
		where, actuator->velocity_mm_s, rate, floor(most),
		floor(most * step_mm * 1e4) / 1e4);
}
