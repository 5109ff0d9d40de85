// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Frames of moteus drives; see moteus.h.
 */
#include <endian.h>
#include <string.h>
#include "moteus.h"

#define ANSWER 0x8000
#define REPLY 0x20
#define REFUSED_WRITE 0x30
#define REFUSED_READ 0x31
#define PADDING 0x50
/* Bits of a kind: type of the values, and their number unless it is 0. */
#define TYPE 0x0c
#define INT8 0x00
#define FLOAT 0x0c
#define NUMBER 0x03
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

static double read_value(const uint8_t *at, int type)
{
	uint32_t bits;
	float single;

	if (type == INT8)
		return (int8_t)*at;
	memcpy(&bits, at, sizeof(bits));
	bits = le32toh(bits);
	memcpy(&single, &bits, sizeof(single));
	return (double)single;
}

/* Registers of a query, each with the type that it asks for. */
static const struct {
	uint8_t number, type;
} rows[] = {{0x00, INT8}, {0x01, FLOAT}, {0x02, FLOAT}, {0x03, FLOAT},
	    {0x0d, INT8}, {0x0e, INT8},	 {0x0f, INT8}};
#define ROWS (sizeof(rows) / sizeof(*rows))

static void set_value(double *values, unsigned int *seen, int number, int type,
		      double value)
{
	for (unsigned int i = 0; i < ROWS; i++)
		if (rows[i].number == number && rows[i].type == type) {
			values[i] = value;
			*seen |= 1U << i;
		}
}

/* Returns the end of a subframe at @at; NULL: not whole, or not of a query's answer. */
static const uint8_t *take_values(const uint8_t *at, const uint8_t *end, double *values,
				  unsigned int *seen)
{
	int kind = *at++, type = kind & TYPE, n = kind & NUMBER, first;
	int size = type == INT8 ? 1 : 4;

	if ((kind & ~(TYPE | NUMBER)) != REPLY || (type != INT8 && type != FLOAT) ||
	    end - at < 2)
		return NULL;
	if (!n)
		n = *at++;
	first = *at++;
	if (n * size > end - at)
		return NULL;
	for (int i = 0; i < n; i++, at += size)
		set_value(values, seen, first + i, type, read_value(at, type));
	return at;
}

int moteus_parse(const struct canfd_frame *frame, struct moteus_reply *reply)
{
	const uint8_t *at = frame->data, *end = at + frame->len;
	canid_t id = frame->can_id & ~CAN_EFF_FLAG;
	double v[ROWS] = {0};
	unsigned int seen = 0;
	int refused = -1;

	while (at && at < end) {
		if (*at == PADDING) {
			at++;
		} else if ((*at == REFUSED_WRITE || *at == REFUSED_READ) &&
			   end - at > 1) {
			refused = at[1];
			at = end;
		} else {
			at = take_values(at, end, v, &seen);
		}
	}
	*reply = (struct moteus_reply){(int)v[0],	   v[1], v[2],	    v[3],
				       v[4] * VOLTAGE_LSB, v[5], (int)v[6], refused};
	if (!at || (seen != (1U << ROWS) - 1 && refused < 0) || id & 0xff)
		return 0;
	return id >> 8 <= MOTEUS_ID_MAX ? (int)(id >> 8) : 0;
}

const char *moteus_fault_text(int fault)
{
	static const char *const texts[] = {
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
