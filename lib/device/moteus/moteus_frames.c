// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Frames of moteus drives; see moteus.h.
 */
#include <endian.h>
#include <string.h>
#include "moteus.h"

#define ANSWER 0x8000
#define REFUSED_WRITE 0x30
#define REFUSED_READ 0x31
#define PADDING 0x50
#define ANSWER_BYTES 22
#define VOLTAGE_LSB 0.5 /* V, of an int8 */

/* --- out ----------------------------------------------------------------------------- */

#define QUERY 0x11, 0x00, 0x1f, 0x01, 0x13, 0x0d

/* Lengths are those of CAN FD. */
static const uint8_t query[] = {QUERY};
static const uint8_t stop[12] = {0x01,	  0x00,	   MOTEUS_STOPPED, QUERY,
				 PADDING, PADDING, PADDING};
/* clang-format off */
static const uint8_t torque[48] = {
	0x01, 0x00, MOTEUS_POSITION,
	0x0f, 0x20, 0x00, 0x00, 0xc0, 0x7f, 0, 0, 0, 0, 0, 0, 0, 0,
	0x02, 0x23, 0x00, 0x00,
	0x0d, 0x25, 0, 0, 0, 0,
	0x0d, 0x27, 0, 0, 0, 0,
	0x01, 0x2b, 0x00,
	QUERY, PADDING, PADDING, PADDING, PADDING, PADDING, PADDING,
};
/* clang-format on */
enum { TORQUE_AT = 13, MOST_AT = 23, WATCHDOG_AT = 29 };

static void pack_frame(struct canfd_frame *frame, int id, const uint8_t *data, size_t n)
{
	*frame = (struct canfd_frame){
		.can_id = (canid_t)(ANSWER | id) | CAN_EFF_FLAG,
		.len = (uint8_t)n,
		.flags = CANFD_BRS,
	};
	memcpy(frame->data, data, n);
}

static void put_float(uint8_t *at, double value)
{
	float single = (float)value;
	uint32_t bits;

	memcpy(&bits, &single, sizeof(bits));
	bits = htole32(bits);
	memcpy(at, &bits, sizeof(bits));
}

void moteus_pack_query(struct canfd_frame *frame, int id)
{
	pack_frame(frame, id, query, sizeof(query));
}

void moteus_pack_stop(struct canfd_frame *frame, int id)
{
	pack_frame(frame, id, stop, sizeof(stop));
}

void moteus_pack_torque(struct canfd_frame *frame, int id, double torque_N_m,
			double most_N_m, double watchdog_s)
{
	pack_frame(frame, id, torque, sizeof(torque));
	put_float(frame->data + TORQUE_AT, torque_N_m);
	put_float(frame->data + MOST_AT, most_N_m);
	put_float(frame->data + WATCHDOG_AT, watchdog_s);
}

/* --- in ------------------------------------------------------------------------------ */

static double get_float(const uint8_t *at)
{
	uint32_t bits;
	float single;

	memcpy(&bits, at, sizeof(bits));
	bits = le32toh(bits);
	memcpy(&single, &bits, sizeof(single));
	return (double)single;
}

/* A drive answers a query's subframes in their order, and ends at one that it refuses. */
static bool check_heads(const struct canfd_frame *frame, int *refused)
{
	static const uint8_t heads[][3] = {
		{0, 0x21, 0x00}, {3, 0x2f, 0x01}, {17, 0x23, 0x0d}};

	for (int i = 0; i < 3; i++) {
		const uint8_t *head = frame->data + heads[i][0];

		if (heads[i][0] + 2 > frame->len)
			return false;
		if (*head == REFUSED_WRITE || *head == REFUSED_READ) {
			*refused = head[1];
			return true;
		}
		if (head[0] != heads[i][1] || head[1] != heads[i][2])
			return false;
	}
	return frame->len >= ANSWER_BYTES;
}

int moteus_parse(const struct canfd_frame *frame, struct moteus_reply *reply)
{
	const int8_t *bytes = (const int8_t *)frame->data;
	canid_t id = frame->can_id & ~CAN_EFF_FLAG;

	*reply = (struct moteus_reply){
		.mode = bytes[2],
		.position_turns = get_float(frame->data + 5),
		.velocity_turns_s = get_float(frame->data + 9),
		.torque_N_m = get_float(frame->data + 13),
		.voltage_V = bytes[19] * VOLTAGE_LSB,
		.temperature_C = bytes[20],
		.fault = bytes[21],
		.refused = -1,
	};
	if (!check_heads(frame, &reply->refused) || id & 0xff || id >> 8 > MOTEUS_ID_MAX)
		return 0;
	return (int)(id >> 8);
}

const char *moteus_fault_text(int fault)
{
	static const char *const texts[] = {
		[0] = "no fault",
		[32] = "the calibration saw no magnet",
		[33] = "motor driver fault, as by too little voltage",
		[34] = "over voltage",
		[35] = "encoder fault",
		[36] = "motor not calibrated",
		[37] = "PWM cycle overrun",
		[38] = "over temperature",
		[39] = "outside servopos.position_min and position_max",
		[40] = "under voltage",
		[41] = "its settings were changed",
		[42] = "no valid encoder for commutation",
		[43] = "no valid encoder of the output",
		[44] = "motor driver not enabled",
		[46] = "timing violation",
		[48] = "invalid position limits",
	};
	const int n = sizeof(texts) / sizeof(*texts);
	const char *text = fault >= 0 && fault < n ? texts[fault] : NULL;

	return text ? text : "see the codes of register 0x00f";
}
