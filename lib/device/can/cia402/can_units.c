// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * From rig.conf to the units of a drive; see can_units.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include "../../../rig/motor.h"
#include "can_units.h"

#define MS 1000000LL
#define COUNTS_MOST 2e9	      /* of a position: 32 bits with a margin */
#define CYCLE_MOST_US 2000    /* of rig.conf */
#define DEADMAN_LEAST_S 0.02  /* heartbeats are in whole ms, and four must fit */
#define MARGIN 1.25	      /* of the drive's limits over the profile's */
#define FINEST_STEPS_S 150000 /* of the profile: below its largest */
#define COARSEST_MM 0.05      /* of a count: more is felt as steps */

int can_units_steps(struct can_session *s)
{
	struct incise_actuator *a = &s->actuator;
	double most = fmin(FINEST_STEPS_S * a->lead_mm / a->velocity_mm_s,
			   INCISE_PROFILE_POSITION_MAX * a->lead_mm / a->travel_mm);

	a->steps_per_turn = (int)fmax(
		1, floor(fmin(fmin(s->units.counts_per_turn, most), INT32_MAX)));
	a->microsteps = 1;
	a->tick_ns = a->can.cycle_ns;
	if (a->lead_mm / s->units.counts_per_turn <= COARSEST_MM)
		return 0;
	return cia402_error(&s->client, ERANGE,
			    "a count of the drive is %.3g mm, as a turn of the screw has "
			    "%g counts; at most %g mm are allowed; set finer units in "
			    "the drive (60A8, 6092), or, if it counts otherwise than it "
			    "reports, counts_per_turn in rig.conf",
			    a->lead_mm / s->units.counts_per_turn,
			    s->units.counts_per_turn, COARSEST_MM);
}

double can_units_per_mm(const struct can_session *s)
{
	return s->axis.setup.counts_per_step / incise_actuator_step_mm(&s->actuator);
}

uint32_t can_units_whole(double value)
{
	return (uint32_t)fmax(1, fmin(UINT32_MAX, ceil(value)));
}

static int32_t counts_of(double value)
{
	return (int32_t)fmax(INT32_MIN, fmin(INT32_MAX, round(value)));
}

/* In counts; following errors are within the range. */
void can_units_range(struct can_session *s)
{
	const struct incise_actuator *a = &s->actuator;
	double per_mm = can_units_per_mm(s);
	double low = s->axis.zero_counts +
		     per_mm * (fmin(0, a->home_mm) - a->can.following_mm);
	double high = s->axis.zero_counts + per_mm * (a->travel_mm + a->can.following_mm);

	s->in_range = fmin(low, high) > -COUNTS_MOST && fmax(low, high) < COUNTS_MOST;
	s->setup.position_min = s->is_homed ? counts_of(fmin(low, high)) : INT32_MIN;
	s->setup.position_max = s->is_homed ? counts_of(fmax(low, high)) : INT32_MAX;
}

void can_units_setup(struct can_session *s)
{
	const struct incise_actuator *a = &s->actuator;
	const struct incise_actuator_can *can = &a->can;
	static const enum cia402_mode modes[] = {
		[INCISE_ACTUATOR_CSP] = CIA402_CSP,
		[INCISE_ACTUATOR_CSV] = CIA402_CSV,
		[INCISE_ACTUATOR_CST] = CIA402_CST,
	};
	uint32_t deadman_ms = (uint32_t)ceil(a->deadman_s * 1e3 - 1e-9);
	uint32_t heartbeat_ms = deadman_ms / 4 < 250 ? deadman_ms / 4 : 250;

	s->setup = (struct cia402_setup){
		.mode = modes[can->mode],
		.cycle_ns = can->cycle_ns,
		.deadman_ms = deadman_ms,
		.master = (uint8_t)can->master,
		.heartbeat_ms = heartbeat_ms,
		.velocity = can_units_whole(MARGIN * a->velocity_mm_s / a->lead_mm *
					    s->units.velocity_per_turn_s),
		.acceleration =
			can_units_whole(MARGIN * a->acceleration_mm_s2 / a->lead_mm *
					s->units.acceleration_per_turn_s2),
		.following = can_units_whole(can->following_mm / a->lead_mm *
					     s->units.counts_per_turn),
		.following_ms = (uint16_t)fmin(65535, ceil(can->following_s * 1e3)),
		.torque_permille = can->mode == INCISE_ACTUATOR_CST
					   ? (uint16_t)can->torque_max_permille
					   : 0,
	};
	s->master.own = (uint8_t)can->master;
	s->master.heartbeat_ns = heartbeat_ms * MS;
}

int can_units_axis(struct can_session *s)
{
	const struct incise_actuator *a = &s->actuator;
	double step_mm = incise_actuator_step_mm(a), sign = a->invert ? -1 : 1;
	double turns = sign / a->steps_per_turn; /* per step */
	struct can_axis_setup setup = {
		.step_mm = step_mm,
		.mode = s->setup.mode,
		.counts_per_step = turns * s->units.counts_per_turn,
		.units_per_step_s = turns * s->units.velocity_per_turn_s,
		/* Methods 35 and 37 take the present position. */
		.home_steps_s = a->can.homing_method == 35 || a->can.homing_method == 37
					? 0
					: a->home_mm_s / step_mm,
		.gain_1_s = a->can.position_gain_1_s,
		.torque_per_step = sign * a->can.stiffness_permille_mm * step_mm,
		.torque_s_per_step = sign * a->can.damping_permille_s_mm * step_mm,
		.torque_most = a->can.torque_max_permille,
		.silence_ns = (s->setup.deadman_ms + 2 * s->setup.heartbeat_ms) * MS,
		.following = (int32_t)ceil(a->can.following_mm / step_mm),
		.following_ns = (int64_t)(a->can.following_s * INCISE_NS_PER_S),
		.start_ns = (int64_t)(a->can.start_s * INCISE_NS_PER_S),
	};
	int rc;

	incise_motor_config(a, 0, &setup.config);
	/* Including the end of homing; targets lie within the travel all the same. */
	if (a->home_mm < 0)
		setup.config.position_min = (int64_t)floor(a->home_mm / step_mm);
	rc = can_axis_init(&s->axis, &setup);
	s->axis.master = &s->master;
	if (rc)
		return cia402_error(&s->client, -rc,
				    "velocity_mm_s = %g, acceleration_mm_s2 = %g or "
				    "jerk_mm_s3 = %g cannot be rendered in cycles of "
				    "%g us; correct it",
				    a->velocity_mm_s, a->acceleration_mm_s2,
				    a->jerk_mm_s3, a->can.cycle_ns / 1e3);
	return 0;
}

/*
 * The load of the bus by one drive. A data frame with an 11-bit id:
 *
 *   SOF id RTR IDE r0 DLC data CRC │ CRC-delimiter ACK EOF gap
 *   ╰──── 34 + 8n: stuffed ────────╯ ╰──────── 13 ───────────╯
 *
 * A bit is stuffed after 5 equal ones and counts among the next 5: at most one in 4.
 */
#define NS_PER_S 1000000000ull
#define HEARTBEAT_BYTES 1
#define INPUT_BYTES 4
#define INPUT_NS 10000000 /* the inhibit time of TPDO2; see cia402_setup.c */

uint32_t bus_load_bits(unsigned int bytes)
{
	uint32_t stuffed = 34 + 8 * (bytes < 8 ? bytes : 8);

	return stuffed + (stuffed - 1) / 4 + 13;
}

static uint64_t per_second(uint64_t bits, uint64_t ns)
{
	return ns ? (bits * NS_PER_S + ns - 1) / ns : UINT32_MAX;
}

uint32_t bus_load_of(uint32_t cycle_ns, unsigned int rpdo_bytes, unsigned int tpdo_bytes,
		     int64_t heartbeat_ns)
{
	uint32_t cycle =
		bus_load_bits(0) + bus_load_bits(rpdo_bytes) + bus_load_bits(tpdo_bytes);
	uint64_t load = per_second(cycle, cycle_ns);

	load += per_second(bus_load_bits(INPUT_BYTES), INPUT_NS);
	if (heartbeat_ns > 0)
		load += per_second(2 * bus_load_bits(HEARTBEAT_BYTES),
				   (uint64_t)heartbeat_ns);
	return load < UINT32_MAX ? (uint32_t)load : UINT32_MAX;
}

int can_units_load(struct can_session *s)
{
	uint32_t cycle_ns = s->actuator.can.cycle_ns, bitrate = s->bus->bitrate;
	unsigned int rpdo = s->setup.mode == CIA402_CST ? 4 : 6;
	uint32_t load = bus_load_of(cycle_ns, rpdo, 6, s->master.heartbeat_ns);
	/* The part that does not depend on the cycle. */
	uint32_t fixed = bus_load_of(UINT32_MAX, rpdo, 6, s->master.heartbeat_ns);
	double free_bits = bitrate * (BUS_LOAD_MOST / 100.0) - fixed, least_us;
	char slower[60] = "";

	if (!bitrate)
		return 0;
	s->load_percent = (uint32_t)ceil(100.0 * load / bitrate);
	if (s->load_percent <= BUS_LOAD_MOST)
		return 0;
	least_us = free_bits > 0 ? 10 * ceil(cycle_ns / 1e4 * (load - fixed) / free_bits)
				 : INFINITY;
	if (least_us <= CYCLE_MOST_US)
		snprintf(slower, sizeof(slower), ", or cycle_us = %g", least_us);
	return cia402_error(&s->client, ERANGE,
			    "cycles of %g us need %u kbit/s, %u %% of the %u kbit/s of "
			    "%s; at most %d %% are allowed; give a bit rate of at "
			    "least %u kbit/s%s",
			    cycle_ns / 1e3, (load + 999) / 1000, s->load_percent,
			    bitrate / 1000, s->bus->name, BUS_LOAD_MOST,
			    (load * 100 / BUS_LOAD_MOST + 999) / 1000, slower);
}

int can_units_deadman(const struct can_session *s)
{
	const struct incise_actuator *a = &s->actuator;

	if (a->deadman_s >= DEADMAN_LEAST_S * (1 - 1e-9) &&
	    a->deadman_s * 1e9 >= 5.0 * a->can.cycle_ns)
		return 0;
	return cia402_error(&s->client, EINVAL,
			    "actuator.deadman_ms: expected at least %g for a drive on "
			    "CAN, as its heartbeats are in whole ms, found %g; correct "
			    "it",
			    fmax(DEADMAN_LEAST_S * 1e3, 5e-6 * a->can.cycle_ns),
			    a->deadman_s * 1e3);
}
