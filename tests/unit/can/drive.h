/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A simulated CiA 402 drive on a CAN bus, with a clock that advances only in waits and in
 * drive_advance(). It does what SDOs configured, and refuses what CiA 301 forbids; it stands
 * where it was told at each SYNC, as tests/can has a drive that shares no code with incise for
 * the rest. Counts, counts/s; times are ns of the simulated clock.
 *
 *   tested code ──▶ drive.bus ──▶ SDO, NMT, PDO ──▶ state machine, motion
 *               ◀── queue, latency ◀──╯
 *
 *	struct drive drive;
 *
 *	drive_init(&drive);
 *	cia402_configure(&master_of(&drive.bus) …);	the clock advances in its waits
 *	drive_advance(&drive, 5 * DRIVE_MS);		the clock advances
 *	drive.blocked = true;				a fault
 *	assert_int_equal(drive.state, CIA402_FAULT);
 */
#ifndef INCISE_TEST_CAN_DRIVE_H
#define INCISE_TEST_CAN_DRIVE_H

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <linux/can/error.h>
#include <linux/can/netlink.h>
#include "../../../lib/device/can/cia402/cia402.h"

#define DRIVE_MS 1000000LL
#define DRIVE_TICK_NS 250000 /* of its motion and of its timers */
#define DRIVE_NODE 0x10
#define DRIVE_QUEUE 256
#define DRIVE_LATENCY_NS 200000 /* of an answer */

#define ABORT_TIMEOUT 0x05040000
#define ABORT_ACCESS 0x06010000
#define ABORT_READ_ONLY 0x06010002
#define ABORT_NO_OBJECT 0x06020000
#define ABORT_NOT_MAPPED 0x06040041
#define ABORT_LONG 0x06070012
#define ABORT_SHORT 0x06070013
#define ABORT_NO_SUB 0x06090011
#define ABORT_VALUE 0x06090030
#define ABORT_RANGE 0x06090036

/* Access to an object. */
enum { R_ = 1, W_ = 2, RW = 3, MAPPED = 4, OF_NODE = 8 /* its id is added */ };

/* Rows of one PDO: its parameters (1400 …) and its mapping (1600 …). */
#define PDO_ROWS(X, NAME, index, cob, type, inhibit, n, first, second) \
	X(NAME##_SUBS, index, 0, 1, R_, 5)                             \
	X(NAME##_COB, index, 1, 4, RW | OF_NODE, cob)                  \
	X(NAME##_TYPE, index, 2, 1, RW, type)                          \
	X(NAME##_INHIBIT, index, 3, inhibit, RW, 0)                    \
	X(NAME##_TIMER, index, 5, 2, RW, 0)                            \
	X(NAME##_COUNT, index + 0x200, 0, 1, RW, n)                    \
	X(NAME##_MAP1, index + 0x200, 1, 4, RW, first)                 \
	X(NAME##_MAP2, index + 0x200, 2, 4, RW, second)                \
	X(NAME##_MAP3, index + 0x200, 3, 4, RW, 0)                     \
	X(NAME##_MAP4, index + 0x200, 4, 4, RW, 0)

/* X(name, index, sub, bytes (0: it has none), access, value after power-on) */
#define DRIVE_OBJECTS(X)                                                          \
	X(TYPE, 0x1000, 0, 4, R_, 0x00040192)                                     \
	X(ERROR_REGISTER, 0x1001, 0, 1, R_ | MAPPED, 0)                           \
	X(SYNC_ID, 0x1005, 0, 4, RW, 0x80)                                        \
	X(SYNC_PERIOD, 0x1006, 0, 4, RW, 0)                                       \
	X(SYNC_WINDOW, 0x1007, 0, 4, RW, 0)                                       \
	X(EMCY_ID, 0x1014, 0, 4, RW | OF_NODE, 0x80)                              \
	X(NAME, 0x1008, 0, 4, R_, 0x314d4953)                                     \
	X(CONSUMER, 0x1016, 1, 4, RW, 0)                                          \
	X(HEARTBEAT, 0x1017, 0, 2, RW, 0)                                         \
	X(VENDOR, 0x1018, 1, 4, R_, 0x286)                                        \
	X(PRODUCT, 0x1018, 2, 4, R_, 1270)                                        \
	X(REVISION, 0x1018, 3, 4, R_, 0x00030012)                                 \
	X(SERIAL, 0x1018, 4, 4, R_, 4711)                                         \
	X(ERROR_BEHAVIOUR, 0x1029, 1, 1, RW, 0)                                   \
	PDO_ROWS(X, RPDO1, 0x1400, 0x200, 255, 0, 1, 0x60400010, 0)               \
	PDO_ROWS(X, RPDO2, 0x1401, 0x300, 255, 0, 2, 0x60400010, 0x60600008)      \
	PDO_ROWS(X, TPDO1, 0x1800, 0x40000180, 255, 2, 1, 0x60410010, 0)          \
	PDO_ROWS(X, TPDO2, 0x1801, 0x40000280, 255, 2, 2, 0x60410010, 0x60610008) \
	PDO_ROWS(X, TPDO3, 0x1802, 0x40000380, 1, 2, 2, 0x60410010, 0x60640020)   \
	X(ABORT_OPTION, 0x6007, 0, 2, RW, 1)                                      \
	X(ERROR_CODE, 0x603f, 0, 2, R_ | MAPPED, 0)                               \
	X(CONTROLWORD, 0x6040, 0, 2, RW | MAPPED, 0)                              \
	X(STATUSWORD, 0x6041, 0, 2, R_ | MAPPED, 0)                               \
	X(QUICK_STOP_OPTION, 0x605a, 0, 2, RW, 6)                                 \
	X(MODE, 0x6060, 0, 1, RW | MAPPED, 0)                                     \
	X(MODE_NOW, 0x6061, 0, 1, R_ | MAPPED, 0)                                 \
	X(POSITION, 0x6064, 0, 4, R_ | MAPPED, 0)                                 \
	X(FOLLOWING, 0x6065, 0, 4, RW, 0xffffffff)                                \
	X(FOLLOWING_TIME, 0x6066, 0, 2, RW, 0)                                    \
	X(TORQUE, 0x6071, 0, 2, RW | MAPPED, 0)                                   \
	X(MOST_TORQUE, 0x6072, 0, 2, RW, 1000)                                    \
	X(TARGET, 0x607a, 0, 4, RW | MAPPED, 0)                                   \
	X(HOME_OFFSET, 0x607c, 0, 4, RW, 0)                                       \
	X(RANGE_MIN, 0x607d, 1, 4, RW, 0)                                         \
	X(RANGE_MAX, 0x607d, 2, 4, RW, 0)                                         \
	X(MOST_VELOCITY, 0x607f, 0, 4, RW, 0)                                     \
	X(QUICK_STOP_RAMP, 0x6085, 0, 4, RW, 1000)                                \
	X(ENCODER, 0x608f, 1, 4, RW, 51200)                                       \
	X(ENCODER_TURNS, 0x608f, 2, 4, RW, 1)                                     \
	X(GEAR_MOTOR, 0x6091, 1, 4, RW, 1)                                        \
	X(GEAR_SHAFT, 0x6091, 2, 4, RW, 1)                                        \
	X(FEED, 0x6092, 1, 4, RW, 51200)                                          \
	X(FEED_TURNS, 0x6092, 2, 4, RW, 1)                                        \
	X(HOMING_METHOD, 0x6098, 0, 1, RW, 35)                                    \
	X(HOMING_SPEED, 0x6099, 1, 4, RW, 1000)                                   \
	X(HOMING_SLOW, 0x6099, 2, 4, RW, 100)                                     \
	X(HOMING_RAMP, 0x609a, 0, 4, RW, 1000)                                    \
	X(POSITION_UNIT, 0x60a8, 0, 0, RW, 0)                                     \
	X(VELOCITY_UNIT, 0x60a9, 0, 4, RW, 0x00b50300)                            \
	X(ACCELERATION_UNIT, 0x60aa, 0, 4, RW, 0x00b55700)                        \
	X(CYCLE, 0x60c2, 1, 1, RW, 1)                                             \
	X(CYCLE_POWER, 0x60c2, 2, 1, RW, 0xfd)                                    \
	X(MOST_ACCELERATION, 0x60c5, 0, 4, RW, 0)                                 \
	X(MOST_DECELERATION, 0x60c6, 0, 4, RW, 0)                                 \
	X(INPUTS, 0x60fd, 0, 4, R_ | MAPPED, 0)                                   \
	X(TARGET_VELOCITY, 0x60ff, 0, 4, RW | MAPPED, 0)                          \
	X(MODES, 0x6502, 0, 4, R_, 0x3a5)

enum drive_object_name {
#define X(name, index, sub, size, access, value) OD_##name,
	DRIVE_OBJECTS(X)
#undef X
		OD_N
};

/* From the row of its parameters: rows of a PDO. */
enum { PDO_SUBS, PDO_COB, PDO_TYPE, PDO_INHIBIT, PDO_TIMER, PDO_COUNT, PDO_MAP };

struct drive_object {
	uint16_t index;
	uint8_t sub;
	uint8_t size; /* 0: the drive lacks it */
	uint8_t access;
	uint32_t value, initial;
	bool deaf; /* a write is answered well, but not kept */
	bool lost; /* an SDO of it is not answered */
};

struct drive_frame {
	struct can_frame frame;
	int64_t at_ns;
};

struct drive {
	struct can_bus bus; /* the bus for the tested code */
	int64_t now_ns;
	uint8_t node;
	struct drive_object od[OD_N];

	/* Properties; drive_init() sets usual ones, a test may change them. */
	int64_t latency_ns;	 /* of what it sends */
	int64_t enable_ns;	 /* from "enable" to operation enabled: a brake */
	double torque_counts_s2; /* CST: acceleration per ‰ … */
	bool absolute;		 /* it is homed from power-on on */

	/* Faults. */
	bool mute;	      /* SDOs are not answered */
	int64_t answer_ns;    /* later than usual, each SDO */
	uint32_t abort_at;    /* the k-th SDO request, counted from 1, is aborted … */
	uint32_t abort_code;  /* … with this; 0: 08000000h */
	uint16_t abort_index; /* each of this object … */
	int abort_sub;	      /* … and sub; -1: any */
	uint32_t drop_at;     /* the k-th SDO request is lost */
	bool no_heartbeat;    /* it goes on, but is silent about it */
	bool unplugged;	      /* no frame either way; it goes on by itself */
	bool blocked;	      /* the shaft does not turn */
	bool fault_stays;     /* a fault cannot be reset */
	bool homing_fails;
	int64_t homing_late_ns; /* homing begins so late; until then its old bits stay … */
	bool homing_keeps;	/* … and never fall: it does not begin */
	bool homing_no_reached; /* bit 10 is never set in homing mode */
	bool homing_no_count;	/* the count is not set at the switch … */
	double homing_own;	/* … or to a position of its own, counts */
	bool echoes;		/* its adapter sends back what it is sent */
	bool mode_late;		/* 6061 is 0 until operation is enabled … */
	bool mode_never;	/* … and then, too */
	double speed_factor;	/* its unit of velocity is so many of what it reports */
	double gives_way;	/* counts that its shaft jumps when its brake opens */
	bool no_tpdo;		/* TPDO1 is not sent */
	bool twice;		/* each frame of it comes twice */
	int send_error;		/* of bus->ops->send, such as -ENOBUFS … */
	uint32_t send_first;	/* so many frames are sent well before it starts */
	uint32_t send_errors;	/* … for so many frames; 0: until it is taken back */
	int sync_error;		/* likewise, of SYNCs alone */
	int receive_error, wait_error; /* of the bus */
	int can_state;		       /* of bus->ops->state */
	uint32_t inputs;	       /* 60FD */

	/* Results for a test. */
	enum cia402_state state;
	enum canopen_state nmt;
	uint64_t syncs, rpdos; /* rpdos: set-points that were applied, at a SYNC */
	uint64_t requests, emcys, enables, quick_stops;
	/*
	 * Set when it faults, quick-stops by itself or boots; a test clears it when the
	 * user asks for motion. Enabling meanwhile is counted.
	 */
	bool tripped;
	uint64_t enabled_unasked;
	double position, velocity;
	double fastest; /* largest |velocity| that it made */
	/* Of set-points that were applied while enabled. */
	int32_t least_target, most_target;
	uint32_t master_abort; /* code of the last SDO abort by the master */
	uint8_t command;       /* of the last SDO request */
	uint16_t aborted;      /* index of the last object whose SDO was aborted */
	uint64_t master_beats;

	/* private */
	struct drive_frame queue[DRIVE_QUEUE];
	unsigned int head, queued;
	struct can_filter filters[16];
	int filters_n; /* 0: all */
	int64_t tick_ns, heartbeat_ns, consumer_ns, inhibit_ns, timer_ns, enabled_at_ns;
	int64_t homing_at_ns; /* 0: not */
	bool watching, enabling, homed, homing, homing_error;
	bool had_reset_bit, had_home_bit, booted;
	struct can_frame rpdo; /* waits for a SYNC; of length 0: none */
	uint32_t sent_inputs;
	double origin; /* of the position, in the machine */
	double target;
};

/* --- objects --- */

/* NULL: the drive lacks it. */
static inline struct drive_object *drive_object(struct drive *d, uint16_t index,
						uint8_t sub)
{
	for (int i = 0; i < OD_N; i++)
		if (d->od[i].index == index && d->od[i].sub == sub && d->od[i].size)
			return &d->od[i];
	return NULL;
}

/* Set the value after power-on. */
static inline void drive_set(struct drive *d, uint16_t index, uint8_t sub, uint32_t value)
{
	struct drive_object *o = drive_object(d, index, sub);

	o->value = o->initial = value;
}

/* Add an object that it lacks by default, of so many bytes. */
static inline void drive_has(struct drive *d, uint16_t index, uint8_t sub, uint8_t size,
			     uint32_t value)
{
	for (int i = 0; i < OD_N; i++)
		if (d->od[i].index == index && d->od[i].sub == sub) {
			d->od[i].size = size;
			drive_set(d, index, sub, value);
		}
}

/* Remove an object; @sub -1: with all subs. */
static inline void drive_lacks(struct drive *d, uint16_t index, int sub)
{
	for (int i = 0; i < OD_N; i++)
		if (d->od[i].index == index && (sub < 0 || d->od[i].sub == sub))
			d->od[i].size = 0;
}

static inline int32_t drive_signed(const struct drive *d, enum drive_object_name name)
{
	uint32_t value = d->od[name].value;

	return d->od[name].size == 2   ? (int16_t)value
	       : d->od[name].size == 1 ? (int8_t)value
				       : (int32_t)value;
}

/* --- frames of the drive --- */

/* Any frame, to the master: foreign, truncated, an error frame … */
static inline void drive_say(struct drive *d, const struct can_frame *frame)
{
	bool received = !d->filters_n || (frame->can_id & CAN_ERR_FLAG);
	int64_t at_ns = d->now_ns + d->latency_ns;

	for (int i = 0; i < d->filters_n; i++)
		received |= (frame->can_id & d->filters[i].can_mask) ==
			    (d->filters[i].can_id & d->filters[i].can_mask);
	for (int i = 0; received && i < 1 + d->twice && d->queued < DRIVE_QUEUE; i++) {
		unsigned int last = (d->head + d->queued - 1) % DRIVE_QUEUE;

		/* One wire: frames stay in order. */
		if (d->queued && d->queue[last].at_ns > at_ns)
			at_ns = d->queue[last].at_ns;
		d->queue[(d->head + d->queued++) % DRIVE_QUEUE] =
			(struct drive_frame){*frame, at_ns};
	}
}

static inline void drive_say_bytes(struct drive *d, uint32_t id, const void *bytes,
				   size_t size)
{
	struct can_frame frame = {.can_id = id & CAN_SFF_MASK, .len = (uint8_t)size};

	memcpy(frame.data, bytes, size);
	if (!d->unplugged)
		drive_say(d, &frame);
}

static inline void drive_emcy(struct drive *d, uint16_t code)
{
	uint8_t bytes[8] = {(uint8_t)code, (uint8_t)(code >> 8), code ? 1 : 0};

	if (code)
		d->od[OD_ERROR_CODE].value = code;
	if (d->nmt == CANOPEN_STOPPED || d->od[OD_EMCY_ID].value & 0x80000000)
		return;
	d->emcys++;
	drive_say_bytes(d, d->od[OD_EMCY_ID].value, bytes, sizeof(bytes));
}

/* --- state machine --- */

static inline bool drive_powered(const struct drive *d)
{
	return d->state == CIA402_ENABLED || d->state == CIA402_QUICK_STOP ||
	       d->state == CIA402_FAULT_REACTION || d->state == CIA402_SWITCHED_ON;
}

static inline void drive_enter(struct drive *d, enum cia402_state state)
{
	if (state == d->state)
		return;
	if (state == CIA402_ENABLED) {
		d->enables++;
		d->enabled_unasked += d->tripped;
		d->least_target = INT32_MAX;
		d->most_target = INT32_MIN;
		d->target = d->position;
		d->od[OD_TARGET_VELOCITY].value = d->od[OD_TORQUE].value = 0;
	} else {
		d->homing = d->enabling = false;
		d->homing_at_ns = 0;
	}
	d->quick_stops += state == CIA402_QUICK_STOP;
	d->state = state;
	if (!drive_powered(d))
		d->velocity = 0; /* a screw does not coast */
}

/* Fault with an EMCY; power goes away at once. */
static inline void drive_fault(struct drive *d, uint16_t code)
{
	d->tripped = true;
	drive_enter(d, CIA402_FAULT);
	drive_emcy(d, code);
}

static inline void drive_quick_stop(struct drive *d, bool by_itself)
{
	d->tripped |= by_itself;
	if (d->state == CIA402_ENABLED && d->od[OD_QUICK_STOP_OPTION].value)
		drive_enter(d, CIA402_QUICK_STOP);
	else if (d->state != CIA402_FAULT && d->state != CIA402_QUICK_STOP)
		drive_enter(d, CIA402_DISABLED);
}

static inline void drive_control(struct drive *d, uint16_t word)
{
	bool reset = word & 0x80 && !d->had_reset_bit;

	d->had_reset_bit = word & 0x80;
	if (d->state == CIA402_FAULT && reset && !d->fault_stays) {
		drive_enter(d, CIA402_DISABLED);
		drive_emcy(d, 0);
		d->od[OD_ERROR_CODE].value = 0;
	}
	if (d->state == CIA402_FAULT || d->state == CIA402_NOT_READY ||
	    d->state == CIA402_FAULT_REACTION || word & 0x80)
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
	unsigned int word = bits[d->state] | 0x10 | CIA402_REMOTE;

	if (d->od[OD_MODE_NOW].value == CIA402_HOMING) {
		word |= d->homing || d->homing_no_reached ? 0 : CIA402_TARGET_REACHED;
		word |= d->homed ? CIA402_HOMED : 0;
		word |= d->homing_error ? CIA402_FOLLOWING_ERROR : 0;
	} else if (d->state == CIA402_ENABLED) {
		word |= CIA402_HOMED; /* follows its targets */
	}
	return (uint16_t)word;
}

static inline void drive_refresh(struct drive *d)
{
	double most = fmax(INT32_MIN, fmin(INT32_MAX, d->position));

	d->od[OD_STATUSWORD].value = drive_statusword(d);
	d->od[OD_POSITION].value = (uint32_t)(int32_t)lrint(most);
	d->od[OD_INPUTS].value = d->inputs;
}

/* The value that it reports of an object. */
static inline uint32_t drive_shown(const struct drive *d, const struct drive_object *o)
{
	bool hidden = d->mode_never || (d->mode_late && d->state != CIA402_ENABLED);

	return o == &d->od[OD_MODE_NOW] && hidden ? 0 : o->value;
}

/* --- motion --- */

static inline double drive_in_range(const struct drive *d, double position)
{
	double min = drive_signed(d, OD_RANGE_MIN), max = drive_signed(d, OD_RANGE_MAX);

	if (!d->od[OD_RANGE_MIN].size || min >= max)
		return position;
	return fmax(min, fmin(max, position));
}

/* A new target was latched. */
static inline void drive_latch(struct drive *d)
{
	int mode = drive_signed(d, OD_MODE_NOW);
	int32_t target = drive_signed(d, mode == CIA402_CSV   ? OD_TARGET_VELOCITY
					 : mode == CIA402_CST ? OD_TORQUE
							      : OD_TARGET);

	d->rpdos++;
	if (d->state != CIA402_ENABLED)
		return;
	d->least_target = target < d->least_target ? target : d->least_target;
	d->most_target = target > d->most_target ? target : d->most_target;
	if (mode == CIA402_CSP)
		d->target = drive_in_range(d, target);
}

/* To its home at -5000 counts of the machine, where it was switched on. */
static inline double drive_homing(struct drive *d, double dt)
{
	double off = -5000 - (d->position + d->origin);
	double step = d->od[OD_HOMING_SPEED].value * d->speed_factor * dt;

	if (!d->homing)
		return 0;
	if (!d->homing_fails && fabs(off) > step)
		return copysign(step / dt, off);
	d->homing = false;
	d->homing_error = d->homing_fails;
	d->homed = !d->homing_fails;
	if (d->homed && !d->homing_no_count) {
		double count = drive_signed(d, OD_HOME_OFFSET) + d->homing_own;

		d->origin += d->position - count;
		d->position = count;
	}
	return 0;
}

/* The velocity of this tick. */
static inline double drive_wanted(struct drive *d, double dt)
{
	double most = d->od[OD_MOST_TORQUE].value, v, to;
	double period = d->od[OD_CYCLE].value * pow(10, drive_signed(d, OD_CYCLE_POWER));

	switch (drive_signed(d, OD_MODE_NOW)) {
	case CIA402_CSP:
		/* Straight there within an interpolation period. */
		v = fabs(d->target - d->position) / fmax(period, dt);
		v = fmax(v, fabs(d->velocity));
		v = fmin(v, fabs(d->target - d->position) / dt);
		return copysign(v, d->target - d->position);
	case CIA402_CSV:
		v = drive_signed(d, OD_TARGET_VELOCITY);
		break;
	case CIA402_CST:
		v = fmax(-most, fmin(most, drive_signed(d, OD_TORQUE)));
		/* A mass with friction. */
		v = d->velocity + (v * d->torque_counts_s2 - d->velocity * 10) * dt;
		break;
	default:
		return drive_homing(d, dt);
	}
	/* Speed and torque end at the end of the range. */
	to = drive_in_range(d, d->position + v * dt);
	return to == d->position + v * dt ? v : (to - d->position) / dt;
}

static inline void drive_turn(struct drive *d)
{
	double dt = DRIVE_TICK_NS / 1e9, before = d->velocity, v = 0, most;

	if (d->state == CIA402_QUICK_STOP) {
		most = d->od[OD_QUICK_STOP_RAMP].size ? d->od[OD_QUICK_STOP_RAMP].value
						      : 1e15;
		v = copysign(fmax(0, fabs(before) - most * dt), before);
	} else if (d->state == CIA402_ENABLED) {
		most = d->od[OD_MOST_VELOCITY].size ? d->od[OD_MOST_VELOCITY].value : 0;
		v = drive_wanted(d, dt);
		v = most > 0 ? fmax(-most, fmin(most, v)) : v;
	}
	d->velocity = d->blocked ? 0 : v;
	d->position += d->velocity * dt;
	d->fastest = fmax(d->fastest, fabs(v));
	if (d->state == CIA402_QUICK_STOP && v == 0 &&
	    drive_signed(d, OD_QUICK_STOP_OPTION) < 5)
		drive_enter(d, CIA402_DISABLED);
}

static inline void drive_move(struct drive *d)
{
	if (d->enabling && d->enabled_at_ns - d->now_ns < 25 * DRIVE_MS) {
		d->position += d->gives_way;
		d->gives_way = 0;
	}
	if (d->enabling && d->now_ns >= d->enabled_at_ns) {
		d->enabling = false;
		drive_enter(d, CIA402_ENABLED);
	}
	if (d->od[OD_MODE].value != d->od[OD_MODE_NOW].value) {
		d->od[OD_MODE_NOW].value = d->od[OD_MODE].value;
		d->homing = false;
		d->homing_at_ns = 0;
		d->target = d->position;
	}
	if (d->od[OD_MODE_NOW].value == CIA402_HOMING && d->state == CIA402_ENABLED &&
	    d->od[OD_CONTROLWORD].value & 0x10 && !d->had_home_bit)
		d->homing_at_ns = d->now_ns + d->homing_late_ns;
	if (d->homing_at_ns && d->now_ns >= d->homing_at_ns) {
		d->homing_at_ns = 0;
		if (!d->homing_keeps) {
			d->homing = true;
			d->homed = d->homing_error = false;
		}
	}
	d->had_home_bit = d->od[OD_CONTROLWORD].value & 0x10;
	if (drive_powered(d))
		drive_turn(d);
}

/* --- PDOs --- */

static const enum drive_object_name drive_pdos[] = {
	OD_RPDO1_SUBS, OD_RPDO2_SUBS, OD_TPDO1_SUBS, OD_TPDO2_SUBS, OD_TPDO3_SUBS,
};
#define DRIVE_PDOS 5

static inline bool drive_pdo_on(const struct drive_object *pdo)
{
	return !(pdo[PDO_COB].value & 0x80000000);
}

static inline struct drive_object *drive_mapped(struct drive *d, uint32_t map)
{
	struct drive_object *o =
		drive_object(d, (uint16_t)(map >> 16), (uint8_t)(map >> 8));

	return o && o->access & MAPPED && (map & 0xff) == 8u * o->size ? o : NULL;
}

/* The rules of CiA 301 for a write to a row of a PDO: 0 or an abort code. */
static inline uint32_t drive_write_pdo(struct drive *d, const struct drive_object *pdo,
				       int row, uint32_t value)
{
	uint32_t changed = pdo[PDO_COB].value ^ value;

	switch (row) {
	case PDO_COB:
		/* Bit 30 of a TPDO is the drive's; an id does not change while it is on. */
		return changed & 0x40000000 || (drive_pdo_on(pdo) &&
						!(value & 0x80000000) && changed)
			       ? ABORT_VALUE
			       : 0;
	case PDO_TYPE:
		return value > 240 && value < 254 ? ABORT_VALUE : 0;
	case PDO_INHIBIT:
		return drive_pdo_on(pdo) ? ABORT_VALUE : 0;
	case PDO_TIMER:
		return 0;
	case PDO_COUNT:
		for (uint32_t i = 0; i < value; i++)
			if (i >= 4 || !drive_mapped(d, pdo[PDO_MAP + i].value))
				return ABORT_NOT_MAPPED;
		return drive_pdo_on(pdo) ? ABORT_ACCESS : 0;
	default:
		if (drive_pdo_on(pdo) || pdo[PDO_COUNT].value)
			return ABORT_ACCESS;
		return drive_object(d, (uint16_t)(value >> 16), (uint8_t)(value >> 8))
			       ? 0
			       : ABORT_NO_OBJECT;
	}
}

static inline void drive_apply(struct drive *d)
{
	const struct drive_object *pdo = &d->od[OD_RPDO1_SUBS];
	bool controlled = false;
	unsigned int at = 0;

	for (uint32_t i = 0; i < pdo[PDO_COUNT].value; i++) {
		struct drive_object *o = drive_mapped(d, pdo[PDO_MAP + i].value);

		if (at + o->size > d->rpdo.len) {
			drive_emcy(d, 0x8210); /* PDO not processed: length */
			return;
		}
		o->value = 0;
		memcpy(&o->value, d->rpdo.data + at, o->size);
		at += o->size;
		controlled |= o == &d->od[OD_CONTROLWORD];
	}
	if (controlled)
		drive_control(d, (uint16_t)d->od[OD_CONTROLWORD].value);
	drive_latch(d);
	d->rpdo.len = 0;
}

static inline void drive_send_tpdo(struct drive *d, const struct drive_object *pdo)
{
	unsigned int at = 0;
	uint8_t bytes[8] = {0};
	uint32_t value;

	drive_refresh(d);
	for (uint32_t i = 0; i < pdo[PDO_COUNT].value; i++) {
		const struct drive_object *o = drive_mapped(d, pdo[PDO_MAP + i].value);

		value = drive_shown(d, o);
		memcpy(bytes + at, &value, o->size);
		at += o->size;
	}
	drive_say_bytes(d, pdo[PDO_COB].value, bytes, at);
}

static inline void drive_sync(struct drive *d)
{
	d->syncs++;
	if (d->rpdo.len)
		drive_apply(d);
	for (int i = 2; i < DRIVE_PDOS; i++) {
		const struct drive_object *pdo = &d->od[drive_pdos[i]];
		uint32_t type = pdo[PDO_TYPE].value;

		if (drive_pdo_on(pdo) && type && type <= 240 && d->syncs % type == 0 &&
		    !(d->no_tpdo && i == 2))
			drive_send_tpdo(d, pdo);
	}
}

/* Inputs, at a change and at times. */
static inline void drive_event_pdo(struct drive *d)
{
	const struct drive_object *pdo = &d->od[OD_TPDO2_SUBS];
	int64_t timer = pdo[PDO_TIMER].value * DRIVE_MS;

	if (d->nmt != CANOPEN_OPERATIONAL || !drive_pdo_on(pdo) ||
	    pdo[PDO_TYPE].value < 254 || d->now_ns < d->inhibit_ns ||
	    (d->inputs == d->sent_inputs && !(timer && d->now_ns >= d->timer_ns)))
		return;
	d->sent_inputs = d->inputs;
	d->inhibit_ns = d->now_ns + pdo[PDO_INHIBIT].value * 100000LL;
	d->timer_ns = d->now_ns + timer;
	drive_send_tpdo(d, pdo);
}

/* --- SDOs --- */

/* 0, or why not. */
static inline uint32_t drive_write(struct drive *d, struct drive_object *o,
				   uint32_t value)
{
	int at = (int)(o - d->od);
	uint32_t rc = 0;

	for (int i = 0; i < DRIVE_PDOS && !rc; i++)
		if (at > (int)drive_pdos[i] && at < (int)drive_pdos[i] + 10)
			rc = drive_write_pdo(d, &d->od[drive_pdos[i]],
					     at - (int)drive_pdos[i], value);
	if (at == OD_MODE && !(d->od[OD_MODES].value & 1u << (value - 1)))
		rc = ABORT_VALUE;
	if ((at == OD_RANGE_MIN && (int32_t)value > drive_signed(d, OD_RANGE_MAX)) ||
	    (at == OD_RANGE_MAX && (int32_t)value < drive_signed(d, OD_RANGE_MIN)))
		rc = ABORT_RANGE;
	if (rc || o->deaf)
		return rc;
	o->value = value;
	if (at == OD_CONTROLWORD)
		drive_control(d, (uint16_t)value);
	if (at == OD_CONSUMER)
		d->watching = false;
	if (at == OD_HEARTBEAT)
		d->heartbeat_ns = d->now_ns + value * DRIVE_MS;
	return 0;
}

static inline void drive_answer(struct drive *d, const uint8_t bytes[8])
{
	d->latency_ns += d->answer_ns;
	if (!d->mute)
		drive_say_bytes(d, (uint32_t)CANOPEN_SDO_ANSWER + d->node, bytes, 8);
	d->latency_ns -= d->answer_ns;
}

static inline void drive_abort(struct drive *d, const uint8_t request[8], uint32_t code)
{
	uint8_t bytes[8] = {0x80, request[1], request[2], request[3]};

	d->aborted = (uint16_t)(request[1] | request[2] << 8);
	memcpy(bytes + 4, &code, 4);
	drive_answer(d, bytes);
}

static inline void drive_upload(struct drive *d, const struct drive_object *o,
				const uint8_t request[8])
{
	uint8_t bytes[8] = {0, request[1], request[2], request[3]};
	uint32_t value;

	drive_refresh(d);
	value = drive_shown(d, o);
	bytes[0] = (uint8_t)(0x43 | (4 - o->size) << 2);
	memcpy(bytes + 4, &value, o->size); /* little-endian, as here */
	drive_answer(d, bytes);
}

static inline void drive_download(struct drive *d, struct drive_object *o,
				  const uint8_t request[8])
{
	uint8_t bytes[8] = {0x60, request[1], request[2], request[3]};
	int size = 4 - (request[0] >> 2 & 3);
	uint32_t value = 0, code;

	memcpy(&value, request + 4, o->size);
	if (!(o->access & W_))
		code = ABORT_READ_ONLY;
	else if (size != o->size)
		code = size > o->size ? ABORT_LONG : ABORT_SHORT;
	else
		code = drive_write(d, o, value);
	if (code)
		drive_abort(d, request, code);
	else
		drive_answer(d, bytes);
}

static inline void drive_sdo(struct drive *d, const uint8_t request[8])
{
	uint16_t index = (uint16_t)(request[1] | request[2] << 8);
	struct drive_object *o = drive_object(d, index, request[3]);
	uint32_t code = ABORT_NO_OBJECT;

	if (request[0] == 0x80) {
		memcpy(&d->master_abort, request + 4, 4);
		return;
	}
	d->requests++;
	d->command = request[0];
	if (d->requests == d->drop_at || (o && o->lost))
		return;
	for (int i = 0; i < OD_N; i++)
		if (d->od[i].index == index && d->od[i].size)
			code = ABORT_NO_SUB;
	if (d->requests == d->abort_at ||
	    (d->abort_index && index == d->abort_index &&
	     (d->abort_sub < 0 || request[3] == d->abort_sub)))
		drive_abort(d, request, d->abort_code ? d->abort_code : 0x08000000);
	else if (request[0] == 0x40 && o)
		drive_upload(d, o, request);
	else if ((request[0] & 0xf3) == 0x23 && o)
		drive_download(d, o, request);
	else
		drive_abort(d, request, code);
}

/* --- NMT, timers --- */

/* Power-on, or a reboot of its own: all configuration is lost. */
static inline void drive_reboot(struct drive *d)
{
	uint8_t boot = 0;

	d->tripped = d->booted;
	d->booted = true;
	for (int i = 0; i < OD_N; i++)
		d->od[i].value = d->od[i].initial;
	drive_enter(d, CIA402_DISABLED);
	d->watching = false;
	d->homed = d->absolute;
	d->homing = d->homing_error = d->had_reset_bit = d->had_home_bit = false;
	d->rpdo.len = 0;
	if (!d->absolute) {
		d->origin += d->position;
		d->position = 0;
	}
	d->nmt = CANOPEN_PRE_OPERATIONAL;
	drive_say_bytes(d, (uint32_t)CANOPEN_HEARTBEAT + d->node, &boot, 1);
}

static inline void drive_nmt(struct drive *d, const struct can_frame *frame)
{
	if (frame->len < 2 || (frame->data[1] && frame->data[1] != d->node))
		return;
	switch (frame->data[0]) {
	case CANOPEN_START:
		d->nmt = CANOPEN_OPERATIONAL;
		d->timer_ns = d->now_ns;
		d->sent_inputs = ~d->inputs;
		break;
	case CANOPEN_STOP:
		d->nmt = CANOPEN_STOPPED;
		if (drive_powered(d))
			drive_quick_stop(d, true);
		break;
	case CANOPEN_PREPARE:
		d->nmt = CANOPEN_PRE_OPERATIONAL;
		break;
	default:
		drive_reboot(d);
	}
}

/* A frame reached it. */
static inline void drive_process(struct drive *d, const struct can_frame *frame)
{
	uint32_t consumer = d->od[OD_CONSUMER].value, id = frame->can_id;

	if (d->unplugged)
		return;
	if (id == 0) {
		drive_nmt(d, frame);
	} else if (id == CANOPEN_HEARTBEAT + (consumer >> 16 & 0x7f) && frame->len == 1) {
		d->master_beats++;
		d->watching = consumer & 0xffff && d->od[OD_CONSUMER].size;
		d->consumer_ns = d->now_ns + (consumer & 0xffff) * DRIVE_MS;
	} else if (d->nmt == CANOPEN_STOPPED) {
		return;
	} else if (id == (uint32_t)CANOPEN_SDO_REQUEST + d->node && frame->len == 8) {
		drive_sdo(d, frame->data);
	} else if (d->nmt == CANOPEN_OPERATIONAL && id == d->od[OD_SYNC_ID].value) {
		drive_sync(d);
	} else if (d->nmt == CANOPEN_OPERATIONAL && drive_pdo_on(&d->od[OD_RPDO1_SUBS]) &&
		   id == (d->od[OD_RPDO1_COB].value & CAN_SFF_MASK)) {
		d->rpdo = *frame;
		if (d->od[OD_RPDO1_TYPE].value > 240)
			drive_apply(d);
	}
}

/* The master's heartbeat did not come in time: what 6007 asks for. */
static inline void drive_watch_master(struct drive *d)
{
	if (!d->watching || d->now_ns <= d->consumer_ns)
		return;
	d->watching = false;
	if (d->nmt == CANOPEN_OPERATIONAL && !d->od[OD_ERROR_BEHAVIOUR].value)
		d->nmt = CANOPEN_PRE_OPERATIONAL;
	drive_emcy(d, 0x8130);
	if (d->od[OD_ABORT_OPTION].value == 3 &&
	    (drive_powered(d) || d->state == CIA402_READY))
		drive_quick_stop(d, true);
}

static inline void drive_tick(struct drive *d)
{
	int64_t beat = d->od[OD_HEARTBEAT].value * DRIVE_MS;
	uint8_t state = (uint8_t)d->nmt;

	drive_watch_master(d);
	if (beat && d->now_ns >= d->heartbeat_ns) {
		d->heartbeat_ns += beat;
		if (!d->no_heartbeat)
			drive_say_bytes(d, (uint32_t)CANOPEN_HEARTBEAT + d->node, &state,
					1);
	}
	drive_move(d);
	drive_event_pdo(d);
}

/* Advance the clock to @until; with @frame only until a frame for the master arrives. */
static inline void drive_run(struct drive *d, int64_t until, bool frame)
{
	while (d->now_ns < until) {
		int64_t next = d->tick_ns < until ? d->tick_ns : until;

		if (frame && d->queued) {
			if (d->queue[d->head].at_ns <= d->now_ns)
				return;
			if (d->queue[d->head].at_ns < next)
				next = d->queue[d->head].at_ns;
		}
		d->now_ns = next > d->now_ns ? next : d->now_ns;
		if (d->now_ns >= d->tick_ns) {
			d->tick_ns += DRIVE_TICK_NS;
			drive_tick(d);
		}
	}
}

/* Advance the clock. */
static inline void drive_advance(struct drive *d, int64_t ns)
{
	drive_run(d, d->now_ns + ns, false);
}

/* --- the bus --- */

/* The master's controller is off the bus: sending fails, nothing arrives. */
static inline void drive_bus_off(struct drive *d)
{
	const struct can_frame frame = {.can_id = CAN_ERR_FLAG | CAN_ERR_BUSOFF,
					.len = CAN_ERR_DLC};

	drive_say(d, &frame);
	d->unplugged = true;
	d->can_state = CAN_STATE_BUS_OFF;
	d->send_error = -ENETDOWN;
	d->send_errors = 0;
}

static inline int64_t drive_now(struct can_bus *bus)
{
	return ((struct drive *)bus)->now_ns;
}

static inline int drive_send(struct can_bus *bus, const struct can_frame *frame)
{
	struct drive *d = (struct drive *)bus;
	int rc = d->send_error;

	if (frame->can_id == CANOPEN_SYNC && d->sync_error)
		rc = d->sync_error;
	if (rc && d->send_first) {
		d->send_first--;
		rc = 0;
	}
	if (rc && d->send_errors && !--d->send_errors)
		d->send_error = 0;
	bus->counts.full += rc == -ENOBUFS;
	bus->counts.sent += !rc;
	if (!rc && d->echoes)
		drive_say(d, frame);
	if (!rc)
		drive_process(d, frame);
	return rc;
}

static inline int drive_receive(struct can_bus *bus, struct can_frame *frame,
				int64_t *t_ns)
{
	struct drive *d = (struct drive *)bus;
	const struct drive_frame *next = &d->queue[d->head];

	if (d->receive_error)
		return d->receive_error;
	if (!d->queued || next->at_ns > d->now_ns)
		return 0;
	*frame = next->frame;
	*t_ns = next->at_ns;
	d->head = (d->head + 1) % DRIVE_QUEUE;
	d->queued--;
	bus->counts.received++;
	bus->counts.errors += !!(frame->can_id & CAN_ERR_FLAG);
	return 1;
}

static inline int drive_wait(struct can_bus *bus, int64_t until_ns)
{
	struct drive *d = (struct drive *)bus;

	if (!d->wait_error)
		drive_run(d, until_ns, true);
	return d->wait_error;
}

static inline int drive_filter(struct can_bus *bus, const struct can_filter *filter,
			       int n)
{
	struct drive *d = (struct drive *)bus;

	if (n > 16)
		return -EINVAL;
	d->filters_n = n;
	memcpy(d->filters, filter, (size_t)n * sizeof(*filter));
	return 0;
}

static inline int drive_can_state(struct can_bus *bus)
{
	return ((struct drive *)bus)->can_state;
}

static inline void drive_close(struct can_bus *bus)
{
	((struct drive *)bus)->filters_n = 0;
}

/* The factory state, one second after power-on of the logic. */
static inline void drive_init(struct drive *d)
{
	static const struct can_bus_ops ops = {
		.now = drive_now,
		.send = drive_send,
		.receive = drive_receive,
		.wait = drive_wait,
		.filter = drive_filter,
		.state = drive_can_state,
		.close = drive_close,
	};
	static const struct drive_object objects[] = {
#define X(name, index, sub, size, access, value) \
	{index, sub, size, access, value, value, false, false},
		DRIVE_OBJECTS(X)
#undef X
	};

	memset(d, 0, sizeof(*d));
	d->bus = (struct can_bus){.ops = &ops, .name = "can-test", .bitrate = 1000000};
	d->now_ns = 1000000000;
	d->tick_ns = d->now_ns + DRIVE_TICK_NS;
	d->node = DRIVE_NODE;
	d->latency_ns = DRIVE_LATENCY_NS;
	d->enable_ns = 5 * DRIVE_MS;
	d->torque_counts_s2 = 100;
	d->speed_factor = 1;
	memcpy(d->od, objects, sizeof(objects));
	for (int i = 0; i < OD_N; i++)
		if (d->od[i].access & OF_NODE)
			d->od[i].initial += d->node;
	drive_reboot(d);
	drive_advance(d, 2 * DRIVE_MS);
}

#endif
