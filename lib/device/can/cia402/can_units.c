// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * rig.conf in the units of a drive; see can_fit.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include "../../motor.h"
#include "../bus/bus_load.h"
#include "can_units.h"

#define MS 1000000LL
#define COUNTS_MOST 2e9 /* of a position: 32 bits, and something for its neighbourhood */
#define CYCLE_MOST_US 2000    /* of rig.conf */
#define DEADMAN_LEAST_S 0.02  /* heartbeats are in whole ms, and four must fit */
#define MARGIN 1.25	      /* of the drive's limits, so that ours come first */
#define FINEST_STEPS_S 150000 /* of the profile: below its largest */

/* Steps as fine as the drive's counts, or as fine as the profile can take them. */
void can_fit_steps(struct can_link *link)
{
	struct incise_actuator *a = &link->actuator;
	double most = fmin(FINEST_STEPS_S * a->lead_mm / a->velocity_mm_s,
			   INCISE_PROFILE_POSITION_MAX * a->lead_mm / a->travel_mm);

	a->steps_per_turn = (int)fmax(
		1, floor(fmin(fmin(link->units.counts_per_turn, most), INT32_MAX)));
	a->microsteps = 1;
	a->tick_ns = a->can.cycle_ns;
}

uint32_t can_fit_units(double value)
{
	return (uint32_t)fmax(1, fmin(UINT32_MAX, ceil(value)));
}

static int32_t counts_of(double value)
{
	return (int32_t)fmax(INT32_MIN, fmin(INT32_MAX, round(value)));
}

/* The range of positions in counts, with what it may be off. */
void can_fit_range(struct can_link *link)
{
	const struct incise_actuator *a = &link->actuator;
	double per_mm = link->axis.setup.counts_per_step / incise_actuator_step_mm(a);
	double low = link->axis.zero_counts +
		     per_mm * (fmin(0, a->home_mm) - a->can.following_mm);
	double high =
		link->axis.zero_counts + per_mm * (a->travel_mm + a->can.following_mm);

	link->in_range = fmin(low, high) > -COUNTS_MOST && fmax(low, high) < COUNTS_MOST;
	link->setup.limited = link->is_homed;
	link->setup.position_min = counts_of(fmin(low, high));
	link->setup.position_max = counts_of(fmax(low, high));
}

void can_fit_setup(struct can_link *link)
{
	const struct incise_actuator *a = &link->actuator;
	const struct incise_actuator_can *can = &a->can;
	static const enum cia402_mode modes[] = {
		[INCISE_ACTUATOR_CSP] = CIA402_CSP,
		[INCISE_ACTUATOR_CSV] = CIA402_CSV,
		[INCISE_ACTUATOR_CST] = CIA402_CST,
	};
	uint32_t deadman_ms = (uint32_t)ceil(a->deadman_s * 1e3 - 1e-9);
	uint32_t heartbeat_ms = deadman_ms / 4 < 250 ? deadman_ms / 4 : 250;

	link->setup = (struct cia402_setup){
		.mode = modes[can->mode],
		.cycle_ns = can->cycle_ns,
		.deadman_ms = deadman_ms,
		.master = (uint8_t)can->master,
		.heartbeat_ms = heartbeat_ms,
		.velocity = can_fit_units(MARGIN * a->velocity_mm_s / a->lead_mm *
					  link->units.velocity_per_turn_s),
		.acceleration =
			can_fit_units(MARGIN * a->acceleration_mm_s2 / a->lead_mm *
				      link->units.acceleration_per_turn_s2),
		.following = can_fit_units(can->following_mm / a->lead_mm *
					   link->units.counts_per_turn),
		.following_ms = (uint16_t)fmin(65535, ceil(can->following_s * 1e3)),
		.torque_permille = can->mode == INCISE_ACTUATOR_CST
					   ? (uint16_t)can->torque_max_permille
					   : 0,
	};
	link->master.own = (uint8_t)can->master;
	link->master.heartbeat_ns = heartbeat_ms * MS;
}

int can_fit_axis(struct can_link *link, const char *where, struct incise_error *err)
{
	const struct incise_actuator *a = &link->actuator;
	double step_mm = incise_actuator_step_mm(a), sign = a->invert ? -1 : 1;
	double turns = sign / a->steps_per_turn; /* per step */
	struct can_axis_setup setup = {
		.step_mm = step_mm,
		.mode = link->setup.mode,
		.counts_per_step = turns * link->units.counts_per_turn,
		.units_per_step_s = turns * link->units.velocity_per_turn_s,
		.gain_1_s = a->can.position_gain_1_s,
		.torque_per_step = sign * a->can.stiffness_permille_mm * step_mm,
		.torque_s_per_step = sign * a->can.damping_permille_s_mm * step_mm,
		.torque_most = a->can.torque_max_permille,
		.silence_ns =
			(link->setup.deadman_ms + 2 * link->setup.heartbeat_ms) * MS,
		.following = (int32_t)ceil(a->can.following_mm / step_mm),
		.following_ns = (int64_t)(a->can.following_s * INCISE_NS_PER_S),
	};
	int rc;

	incise_motor_config(a, 0, &setup.config);
	/* Room for where homing ends; targets lie within the travel all the same. */
	if (a->home_mm < 0)
		setup.config.position_min = (int64_t)floor(a->home_mm / step_mm);
	rc = can_axis_init(&link->axis, &setup);
	link->axis.master = &link->master;
	if (rc)
		return incise_error_set(
			err, -rc,
			"%s: velocity_mm_s = %g, acceleration_mm_s2 = %g or jerk_mm_s3 = %g "
			"is nothing that cycles of %g us can make; correct it",
			where, a->velocity_mm_s, a->acceleration_mm_s2, a->jerk_mm_s3,
			a->can.cycle_ns / 1e3);
	return 0;
}

int can_fit_load(struct can_link *link, const char *where, struct incise_error *err)
{
	uint32_t cycle_ns = link->actuator.can.cycle_ns, bitrate = link->bus->bitrate;
	unsigned int rpdo = link->setup.mode == CIA402_CST ? 4 : 6;
	uint32_t load = bus_load_of(cycle_ns, rpdo, 6, link->master.heartbeat_ns);
	/* What does not come in cycles is there with any. */
	uint32_t fixed = bus_load_of(UINT32_MAX, rpdo, 6, link->master.heartbeat_ns);
	double room = bitrate * (BUS_LOAD_MOST / 100.0) - fixed, least_us;
	char slower[60] = "";

	if (!bitrate)
		return 0;
	link->load_percent = (uint32_t)ceil(100.0 * load / bitrate);
	if (link->load_percent <= BUS_LOAD_MOST)
		return 0;
	least_us =
		room > 0 ? 10 * ceil(cycle_ns / 1e4 * (load - fixed) / room) : INFINITY;
	if (least_us <= CYCLE_MOST_US)
		snprintf(slower, sizeof(slower), ", or cycle_us = %g", least_us);
	return incise_error_set(
		err, ERANGE,
		"%s: a cycle each %g us takes %u kbit/s, %u %% of the %u kbit/s of %s, and "
		"may take %d %%; give a bit rate of at least %u kbit/s%s",
		where, cycle_ns / 1e3, (load + 999) / 1000, link->load_percent,
		bitrate / 1000, link->bus->name, BUS_LOAD_MOST,
		(load * 100 / BUS_LOAD_MOST + 999) / 1000, slower);
}

int can_fit_deadman(const struct incise_actuator *a, const char *where,
		    struct incise_error *err)
{
	if (a->deadman_s >= DEADMAN_LEAST_S * (1 - 1e-9) &&
	    a->deadman_s * 1e9 >= 5.0 * a->can.cycle_ns)
		return 0;
	return incise_error_set(
		err, EINVAL,
		"%s: actuator.deadman_ms: expected at least %g for a drive on CAN, as its "
		"heartbeats are in whole ms, found %g; correct it",
		where, fmax(DEADMAN_LEAST_S * 1e3, 5e-6 * a->can.cycle_ns),
		a->deadman_s * 1e3);
}
