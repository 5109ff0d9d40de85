/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The state of the simulated drive (can_drive.h): its object dictionary, faults that a test may
 * inject, and results. Positions are counts, times ns of the simulated clock.
 */
#ifndef INCISE_TEST_DRIVE_STATE_H
#define INCISE_TEST_DRIVE_STATE_H

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
	X(CONSUMERS, 0x1016, 0, 1, R_, 1)                                         \
	X(CONSUMER, 0x1016, 1, 4, RW, 0)                                          \
	X(HEARTBEAT, 0x1017, 0, 2, RW, 0)                                         \
	X(IDENTITY, 0x1018, 0, 1, R_, 4)                                          \
	X(VENDOR, 0x1018, 1, 4, R_, 0x286)                                        \
	X(PRODUCT, 0x1018, 2, 4, R_, 1270)                                        \
	X(REVISION, 0x1018, 3, 4, R_, 0x00030012)                                 \
	X(SERIAL, 0x1018, 4, 4, R_, 4711)                                         \
	X(ERROR_BEHAVIOURS, 0x1029, 0, 1, R_, 1)                                  \
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
	X(FAULT_OPTION, 0x605e, 0, 2, RW, 2)                                      \
	X(MODE, 0x6060, 0, 1, RW | MAPPED, 0)                                     \
	X(MODE_NOW, 0x6061, 0, 1, R_ | MAPPED, 0)                                 \
	X(POSITION, 0x6064, 0, 4, R_ | MAPPED, 0)                                 \
	X(FOLLOWING, 0x6065, 0, 4, RW, 0xffffffff)                                \
	X(FOLLOWING_TIME, 0x6066, 0, 2, RW, 0)                                    \
	X(VELOCITY, 0x606c, 0, 4, R_ | MAPPED, 0)                                 \
	X(TORQUE, 0x6071, 0, 2, RW | MAPPED, 0)                                   \
	X(MOST_TORQUE, 0x6072, 0, 2, RW, 1000)                                    \
	X(TARGET, 0x607a, 0, 4, RW | MAPPED, 0)                                   \
	X(HOME_OFFSET, 0x607c, 0, 4, RW, 0)                                       \
	X(RANGES, 0x607d, 0, 1, R_, 2)                                            \
	X(RANGE_MIN, 0x607d, 1, 4, RW, 0)                                         \
	X(RANGE_MAX, 0x607d, 2, 4, RW, 0)                                         \
	X(MOST_VELOCITY, 0x607f, 0, 4, RW, 0)                                     \
	X(QUICK_STOP_RAMP, 0x6085, 0, 4, RW, 1000)                                \
	X(ENCODERS, 0x608f, 0, 1, R_, 2)                                          \
	X(ENCODER, 0x608f, 1, 4, RW, 51200)                                       \
	X(ENCODER_TURNS, 0x608f, 2, 4, RW, 1)                                     \
	X(GEARS, 0x6091, 0, 1, R_, 2)                                             \
	X(GEAR_MOTOR, 0x6091, 1, 4, RW, 1)                                        \
	X(GEAR_SHAFT, 0x6091, 2, 4, RW, 1)                                        \
	X(FEEDS, 0x6092, 0, 1, R_, 2)                                             \
	X(FEED, 0x6092, 1, 4, RW, 51200)                                          \
	X(FEED_TURNS, 0x6092, 2, 4, RW, 1)                                        \
	X(HOMING_METHOD, 0x6098, 0, 1, RW, 35)                                    \
	X(HOMING_SPEEDS, 0x6099, 0, 1, R_, 2)                                     \
	X(HOMING_SPEED, 0x6099, 1, 4, RW, 1000)                                   \
	X(HOMING_SLOW, 0x6099, 2, 4, RW, 100)                                     \
	X(HOMING_RAMP, 0x609a, 0, 4, RW, 1000)                                    \
	X(POSITION_UNIT, 0x60a8, 0, 0, RW, 0)                                     \
	X(VELOCITY_UNIT, 0x60a9, 0, 4, RW, 0x00b50300)                            \
	X(ACCELERATION_UNIT, 0x60aa, 0, 4, RW, 0x00b55700)                        \
	X(CYCLES, 0x60c2, 0, 1, R_, 2)                                            \
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

struct drive_queue {
	struct drive_frame frame[DRIVE_QUEUE];
	unsigned int head, n;
	uint64_t lost; /* did not fit */
};

struct drive {
	struct can_bus bus; /* the bus for the tested code */
	int64_t now_ns;
	uint8_t node;

	/* Properties; drive_init() sets usual ones, a test may change them. */
	const char *name;      /* 1008; NULL: it has none */
	int64_t latency_ns;    /* delay of a frame, either way */
	int64_t look_ns;       /* duration of reading the clock */
	int64_t enable_ns;     /* from "enable" to operation enabled: a brake */
	double velocity_scale; /* counts/s per velocity unit */
	double acceleration_scale;
	double lag_s;		 /* of position behind demand; 0: none */
	double torque_counts_s2; /* CST: acceleration per ‰ … */
	double torque_per_count; /* … less the spring's ‰ … */
	double damping_1_s;	 /* … and friction, of the velocity */
	double home_raw;	 /* where its own home switch is */
	bool absolute;		 /* it is homed from power-on on */
	bool open_mapping;	 /* mapping may be written while the PDO is on */
	uint32_t mapping_abort;	 /* what it says otherwise */

	/* What goes wrong. */
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
	bool no_tpdo;	      /* TPDO1 is not sent */
	bool twice;	      /* each frame of it comes twice */
	int send_error;	      /* of bus->ops->send, such as -ENOBUFS … */
	uint32_t send_first;  /* so many frames are sent well before it starts */
	uint32_t send_errors; /* … for so many frames; 0: until it is taken back */
	int receive_error, wait_error; /* of the bus */
	int can_state;		       /* of bus->ops->state */
	uint32_t inputs;	       /* 60FD */

	/* Results for a test. */
	enum cia402_state state;
	enum canopen_state nmt;
	uint64_t syncs, rpdos; /* rpdos: set-points that were applied, at a SYNC */
	uint64_t tpdos, requests, emcys, boots;
	uint64_t enables; /* times that it came to operation enabled */
	uint64_t quick_stops, faults;
	/*
	 * Set when it faults, quick-stops by itself or boots; a test clears it when the
	 * user asks for motion. Enabling meanwhile is counted.
	 */
	bool tripped;
	uint64_t enabled_unasked;
	double position, velocity; /* counts, counts/s */
	double fastest, hardest;   /* largest |velocity|, |acceleration| that it made */
	int32_t least_target,
		most_target; /* of set-points that were applied while enabled */
	int32_t *targets;    /* a test's own room for set-points … */
	size_t targets_capacity, targets_n; /* … and how many there were */
	uint32_t master_abort;		    /* code of the last SDO abort by the master */
	uint16_t aborted; /* index of the last object whose SDO was aborted */
	uint64_t master_beats, refused; /* refused: SDO aborts by it */
	int64_t last_rpdo_ns, last_sync_ns;

	/* private */
	struct drive_object od[OD_N];
	struct drive_queue to_master, to_drive;
	struct can_filter filters[16];
	int filters_n; /* 0: all */
	int64_t tick_ns, heartbeat_ns, consumer_ns, deadline_ns, inhibit_ns, timer_ns;
	int64_t enabled_at_ns;
	bool watching, deadline_runs, enabling, rpdo_waits, own_stop, homed, homing,
		homing_error, limit_active, had_reset_bit, had_home_bit;
	uint8_t rpdo[8], rpdo_size;
	uint32_t sent_inputs;
	double origin; /* raw position less position */
	double demand, target_from, target_to, off_ms;
	int64_t target_ns;
	size_t segment_at;
	bool segmented, segment_toggle;
};

static inline int32_t drive_signed(const struct drive *d, enum drive_object_name name)
{
	uint32_t value = d->od[name].value;

	return d->od[name].size == 2   ? (int16_t)value
	       : d->od[name].size == 1 ? (int8_t)value
				       : (int32_t)value;
}

static inline bool drive_powered(const struct drive *d)
{
	return d->state == CIA402_ENABLED || d->state == CIA402_QUICK_STOP ||
	       d->state == CIA402_FAULT_REACTION || d->state == CIA402_SWITCHED_ON;
}

static inline void drive_queue_put(struct drive_queue *q, const struct can_frame *frame,
				   int64_t at_ns)
{
	if (q->n == DRIVE_QUEUE) {
		q->lost++;
		return;
	}
	/* One wire: frames stay in order. */
	if (q->n) {
		int64_t last = q->frame[(q->head + q->n - 1) % DRIVE_QUEUE].at_ns;

		at_ns = at_ns > last ? at_ns : last;
	}
	q->frame[(q->head + q->n++) % DRIVE_QUEUE] = (struct drive_frame){*frame, at_ns};
}

static inline bool drive_queue_take(struct drive_queue *q, int64_t now_ns,
				    struct can_frame *frame, int64_t *at_ns)
{
	if (!q->n || q->frame[q->head].at_ns > now_ns)
		return false;
	*frame = q->frame[q->head].frame;
	if (at_ns)
		*at_ns = q->frame[q->head].at_ns;
	q->head = (q->head + 1) % DRIVE_QUEUE;
	q->n--;
	return true;
}

/* Any frame, to the master: foreign, truncated, an error frame … */
static inline void drive_say(struct drive *d, const struct can_frame *frame)
{
	bool received = !d->filters_n || (frame->can_id & CAN_ERR_FLAG);

	for (int i = 0; i < d->filters_n; i++)
		received |= (frame->can_id & d->filters[i].can_mask) ==
			    (d->filters[i].can_id & d->filters[i].can_mask);
	if (!received)
		return;
	drive_queue_put(&d->to_master, frame, d->now_ns + d->latency_ns);
	if (d->twice)
		drive_queue_put(&d->to_master, frame, d->now_ns + d->latency_ns);
}

static inline void drive_say_bytes(struct drive *d, uint32_t id, const void *bytes,
				   size_t size)
{
	struct can_frame frame = {.can_id = id, .len = (uint8_t)size};

	if (d->unplugged)
		return;
	memcpy(frame.data, bytes, size);
	drive_say(d, &frame);
}

static inline void drive_emcy(struct drive *d, uint16_t code)
{
	uint8_t bytes[8] = {(uint8_t)code, (uint8_t)(code >> 8)};

	d->od[OD_ERROR_REGISTER].value = code ? 1 : 0;
	bytes[2] = (uint8_t)d->od[OD_ERROR_REGISTER].value;
	if (code)
		d->od[OD_ERROR_CODE].value = code;
	if (d->nmt == CANOPEN_STOPPED || d->od[OD_EMCY_ID].value & 0x80000000)
		return;
	d->emcys++;
	drive_say_bytes(d, d->od[OD_EMCY_ID].value & CAN_SFF_MASK, bytes, sizeof(bytes));
}

#endif
