/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The simulated drive's CiA 402 half: states, and how it moves. Counts and counts/s; a tick
 * is DRIVE_TICK_NS.
 *
 *   targets     t0 ────── t1 ────── t2    one per SYNC
 *   demand         ╲__straight__╲         over 60C2, within 607D
 *   position         follows it           within 607F and 60C5
 */
#ifndef INCISE_TEST_DRIVE_MOTION_H
#define INCISE_TEST_DRIVE_MOTION_H

#include <math.h>
#include "drive_state.h"

static inline double drive_speed_limit(const struct drive *d)
{
	uint32_t most = d->od[OD_MOST_VELOCITY].value;

	return most && d->od[OD_MOST_VELOCITY].size ? most * d->velocity_scale : 1e12;
}

static inline double drive_ramp(const struct drive *d, enum drive_object_name name)
{
	uint32_t most = d->od[name].value;

	return most && d->od[name].size ? most * d->acceleration_scale : 1e15;
}

static inline void drive_settle(struct drive *d)
{
	d->demand = d->target_from = d->target_to = d->position;
	d->target_ns = d->now_ns;
	d->off_ms = 0;
}

static inline void drive_enter(struct drive *d, enum cia402_state state)
{
	if (state == d->state)
		return;
	if (state == CIA402_ENABLED) {
		d->enables++;
		d->enabled_unasked += d->tripped;
		drive_settle(d);
		d->od[OD_TARGET].value = (uint32_t)(int32_t)lrint(d->position);
		d->od[OD_TARGET_VELOCITY].value = d->od[OD_TORQUE].value = 0;
	}
	if (state == CIA402_QUICK_STOP)
		d->quick_stops++;
	if (state != CIA402_ENABLED) {
		d->homing = false;
		d->enabling = false;
	}
	d->state = state;
	if (!drive_powered(d))
		d->velocity = 0; /* a screw does not coast */
}

/* Fault with an EMCY; power goes away at once. */
static inline void drive_fault(struct drive *d, uint16_t code)
{
	d->faults++;
	d->tripped = true;
	drive_enter(d, CIA402_FAULT);
	drive_emcy(d, code);
}

/* React as 605A says: the line is dead. */
static inline void drive_quick_stop(struct drive *d, bool by_itself)
{
	d->tripped |= by_itself;
	d->own_stop = by_itself;
	if (d->state == CIA402_ENABLED && d->od[OD_QUICK_STOP_OPTION].value)
		drive_enter(d, CIA402_QUICK_STOP);
	else if (d->state != CIA402_FAULT && d->state != CIA402_QUICK_STOP)
		drive_enter(d, CIA402_DISABLED);
}

/* 6007: the reaction to a missing master. */
static inline void drive_connection_lost(struct drive *d, uint16_t code)
{
	drive_emcy(d, code);
	if (!drive_powered(d) && d->state != CIA402_READY)
		return;
	switch (drive_signed(d, OD_ABORT_OPTION)) {
	case 1:
		d->faults++;
		d->tripped = true;
		drive_enter(d, CIA402_FAULT);
		break;
	case 2:
		d->tripped = true;
		drive_enter(d, CIA402_DISABLED);
		break;
	case 3:
		drive_quick_stop(d, true);
		break;
	default: /* it goes on */
		break;
	}
}

static inline void drive_control(struct drive *d, uint16_t word)
{
	bool reset = word & 0x80 && !d->had_reset_bit;

	d->had_reset_bit = word & 0x80;
	d->od[OD_CONTROLWORD].value = word;
	if (d->state == CIA402_FAULT) {
		if (reset && !d->fault_stays) {
			drive_enter(d, CIA402_DISABLED);
			drive_emcy(d, 0);
			d->od[OD_ERROR_CODE].value = 0;
		}
		return;
	}
	if (d->state == CIA402_NOT_READY || d->state == CIA402_FAULT_REACTION ||
	    word & 0x80)
		return;
	if (!(word & 0x02)) { /* disable voltage */
		drive_enter(d, CIA402_DISABLED);
	} else if (!(word & 0x04)) {
		drive_quick_stop(d, false);
	} else if ((word & 0x07) == 0x06) { /* shutdown */
		if (d->state != CIA402_QUICK_STOP)
			drive_enter(d, CIA402_READY);
	} else if ((word & 0x0f) == 0x07) {
		if (d->state == CIA402_READY || d->state == CIA402_ENABLED)
			drive_enter(d, CIA402_SWITCHED_ON);
	} else if (d->state == CIA402_READY || d->state == CIA402_SWITCHED_ON) {
		if (!d->enabling)
			d->enabled_at_ns = d->now_ns + d->enable_ns;
		d->state = CIA402_SWITCHED_ON;
		d->enabling = true;
	} else if (d->state == CIA402_QUICK_STOP && !d->own_stop &&
		   drive_signed(d, OD_QUICK_STOP_OPTION) >= 5) {
		drive_enter(d, CIA402_ENABLED);
	}
}

static inline uint16_t drive_statusword(const struct drive *d)
{
	static const uint16_t bits[] = {
		[CIA402_NOT_READY] = 0x00,	[CIA402_DISABLED] = 0x40,
		[CIA402_READY] = 0x21,		[CIA402_SWITCHED_ON] = 0x23,
		[CIA402_ENABLED] = 0x27,	[CIA402_QUICK_STOP] = 0x07,
		[CIA402_FAULT_REACTION] = 0x0f, [CIA402_FAULT] = 0x08,
	};
	int mode = drive_signed(d, OD_MODE_NOW);
	unsigned int word = bits[d->state] | 0x10 | CIA402_REMOTE;

	if (mode == CIA402_HOMING) {
		word |= d->homing ? 0 : CIA402_TARGET_REACHED;
		word |= d->homed ? CIA402_HOMED : 0;
		word |= d->homing_error ? CIA402_FOLLOWING_ERROR : 0;
	} else if (mode >= CIA402_CSP && d->state == CIA402_ENABLED) {
		word |= CIA402_HOMED; /* follows its targets */
		word |= d->off_ms > 0 ? CIA402_FOLLOWING_ERROR : 0;
	}
	return (uint16_t)(word | (d->limit_active ? CIA402_LIMIT_ACTIVE : 0));
}

static inline void drive_refresh(struct drive *d)
{
	d->od[OD_STATUSWORD].value = drive_statusword(d);
	d->od[OD_POSITION].value =
		(uint32_t)(int32_t)lrint(fmax(INT32_MIN, fmin(INT32_MAX, d->position)));
	d->od[OD_VELOCITY].value = (uint32_t)(int32_t)lrint(
		fmax(INT32_MIN, fmin(INT32_MAX, d->velocity / d->velocity_scale)));
	d->od[OD_INPUTS].value = d->inputs;
}

/* A new target was latched: the way there takes an interpolation period. */
static inline void drive_latch(struct drive *d)
{
	int mode = drive_signed(d, OD_MODE_NOW);
	int32_t target = drive_signed(d, mode == CIA402_CSV   ? OD_TARGET_VELOCITY
					 : mode == CIA402_CST ? OD_TORQUE
							      : OD_TARGET);

	d->rpdos++;
	d->last_rpdo_ns = d->now_ns;
	if (d->state != CIA402_ENABLED)
		return;
	if (d->targets && d->targets_n < d->targets_capacity)
		d->targets[d->targets_n] = target;
	if (!d->targets_n || target < d->least_target)
		d->least_target = target;
	if (!d->targets_n || target > d->most_target)
		d->most_target = target;
	d->targets_n++;
	d->target_from = d->demand;
	d->target_to = drive_signed(d, OD_TARGET);
	/* Its ticks are locked to SYNC: jitter of less than a tick does not show. */
	d->target_ns = d->tick_ns - DRIVE_TICK_NS;
}

static inline double drive_period_ns(const struct drive *d)
{
	return d->od[OD_CYCLE].value * pow(10, drive_signed(d, OD_CYCLE_POWER)) * 1e9;
}

static inline double drive_in_range(struct drive *d, double position)
{
	double min = drive_signed(d, OD_RANGE_MIN), max = drive_signed(d, OD_RANGE_MAX);

	d->limit_active = false;
	if (!d->od[OD_RANGE_MIN].size || min >= max)
		return position;
	d->limit_active = position < min || position > max;
	return fmax(min, fmin(max, position));
}

/* The velocity of this tick that a mode asks for. */
static inline double drive_csp(struct drive *d, double dt)
{
	double before = d->demand, period = drive_period_ns(d), ramp, e, corr, vd;
	double part = period > 0 ? (double)(d->now_ns - d->target_ns) / period : 1;
	double want = d->target_from + (d->target_to - d->target_from) * fmin(part, 1);

	d->demand = drive_in_range(d, want);
	vd = (d->demand - before) / dt;
	e = before - d->position;
	ramp = drive_ramp(d, OD_MOST_ACCELERATION);
	corr = fmin(fabs(e) / fmax(dt, d->lag_s), sqrt(2 * ramp * fabs(e)));
	return (d->lag_s > 0 ? 0 : vd) + copysign(corr, e);
}

static inline double drive_homing(struct drive *d, double dt)
{
	double raw = d->position + d->origin, off = d->home_raw - raw;
	double step = d->od[OD_HOMING_SPEED].value * d->velocity_scale * dt;
	int method = drive_signed(d, OD_HOMING_METHOD);

	if (!d->homing)
		return 0;
	if (d->homing_fails) {
		d->homing = false;
		d->homing_error = true;
		return 0;
	}
	if (method == 35 || method == 37 || fabs(off) <= step) {
		d->homing = false;
		d->homed = true;
		d->position = drive_signed(d, OD_HOME_OFFSET);
		d->origin = raw - d->position;
		d->velocity = 0;
		drive_settle(d);
		return 0;
	}
	return copysign(step / dt, off);
}

static inline double drive_wanted(struct drive *d, double dt)
{
	double v = 0;

	if (d->state != CIA402_ENABLED)
		return 0;
	d->limit_active = false;
	switch (drive_signed(d, OD_MODE_NOW)) {
	case CIA402_CSP:
		return drive_csp(d, dt);
	case CIA402_CSV:
		v = drive_signed(d, OD_TARGET_VELOCITY) * d->velocity_scale;
		break;
	case CIA402_CST:
		v = drive_signed(d, OD_TORQUE);
		v = fmax(-(double)d->od[OD_MOST_TORQUE].value,
			 fmin(d->od[OD_MOST_TORQUE].value, v));
		v -= d->torque_per_count * d->position;
		v = d->velocity +
		    (v * d->torque_counts_s2 - d->velocity * d->damping_1_s) * dt;
		break;
	case CIA402_HOMING:
		return drive_homing(d, dt);
	default:
		break;
	}
	/* Speed and torque end at the end of the range. */
	if (drive_in_range(d, d->position + v * dt) != d->position + v * dt)
		return (drive_in_range(d, d->position + v * dt) - d->position) / dt;
	return v;
}

static inline void drive_watch_following(struct drive *d)
{
	if (d->state != CIA402_ENABLED || drive_signed(d, OD_MODE_NOW) != CIA402_CSP ||
	    !d->od[OD_FOLLOWING].size || d->od[OD_FOLLOWING].value == 0xffffffff ||
	    fabs(d->demand - d->position) <= d->od[OD_FOLLOWING].value) {
		d->off_ms = 0;
		return;
	}
	d->off_ms += DRIVE_TICK_NS / 1e6;
	if (d->off_ms > d->od[OD_FOLLOWING_TIME].value)
		drive_fault(d, 0x8611);
}

static inline void drive_move(struct drive *d)
{
	double dt = DRIVE_TICK_NS / 1e9, before = d->velocity, v, most, step;
	bool stopping = d->state == CIA402_QUICK_STOP;

	if (d->enabling && d->now_ns >= d->enabled_at_ns) {
		d->enabling = false;
		drive_enter(d, CIA402_ENABLED);
	}
	if (d->od[OD_MODE].value != d->od[OD_MODE_NOW].value) {
		d->od[OD_MODE_NOW].value = d->od[OD_MODE].value;
		d->homing = d->homing_error = false;
		drive_settle(d);
	}
	if (drive_signed(d, OD_MODE_NOW) == CIA402_HOMING && d->state == CIA402_ENABLED &&
	    d->od[OD_CONTROLWORD].value & 0x10 && !d->had_home_bit) {
		d->homing = true;
		d->homed = d->homing_error = false;
	}
	d->had_home_bit = d->od[OD_CONTROLWORD].value & 0x10;
	if (!drive_powered(d))
		return;
	v = drive_wanted(d, dt);
	before = d->velocity; /* at its home it stops at once */
	most = drive_speed_limit(d);
	v = fmax(-most, fmin(most, v));
	step = drive_ramp(d, stopping ? OD_QUICK_STOP_RAMP : OD_MOST_ACCELERATION) * dt;
	if (drive_signed(d, OD_MODE_NOW) != CIA402_CST || stopping)
		v = fmax(before - step, fmin(before + step, v));
	if (d->blocked)
		v = 0;
	d->velocity = v;
	d->position += v * dt;
	d->fastest = fmax(d->fastest, fabs(v));
	if (!d->blocked)
		d->hardest = fmax(d->hardest, fabs(v - before) / dt);
	if (stopping && v == 0 && drive_signed(d, OD_QUICK_STOP_OPTION) < 5)
		drive_enter(d, CIA402_DISABLED);
	drive_watch_following(d);
}

#endif
