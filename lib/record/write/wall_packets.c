// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Packets of chronyd and ptp4l; see wall_packets.h.
 */
#include <math.h>
#include <string.h>
#include "wall_packets.h"

static void put_wall_packets(uint8_t *to, uint64_t value, int n)
{
	while (n--) {
		to[n] = value & 0xff;
		value >>= 8;
	}
}

static uint64_t get(const uint8_t *from, int n)
{
	uint64_t value = 0;

	while (n--)
		value = value << 8 | *from++;
	return value;
}

/* --- chronyd --------------------------------------------------------------------------- */

#define CHRONY_VERSION 6
#define CHRONY_REQUEST 1
#define CHRONY_REPLY 2
#define CHRONY_TRACKING 33
#define CHRONY_TRACKING_REPLY 5
#define CHRONY_DATA 28 /* offset in a reply */
#define CHRONY_LOCAL 0x7f7f0101
#define CHRONY_UNSYNCHRONISED 3
/* In the upper half of the seconds of a computer with 32 bits. */
#define CHRONY_NO_HIGH 0x7fffffff

void incise_chrony_request(uint8_t bytes[INCISE_CHRONY_BYTES], uint32_t sequence)
{
	memset(bytes, 0, INCISE_CHRONY_BYTES);
	bytes[0] = CHRONY_VERSION;
	bytes[1] = CHRONY_REQUEST;
	put_wall_packets(bytes + 4, CHRONY_TRACKING, 2);
	put_wall_packets(bytes + 8, sequence, 4);
}

/* 7 bits of exponent, 25 of coefficient, both in two's complement. */
static double chrony_float(const uint8_t *bytes)
{
	uint32_t bits = (uint32_t)get(bytes, 4);
	int exponent = (int)(bits >> 25), coefficient = (int)(bits & 0x1ffffff);

	if (exponent >= 64)
		exponent -= 128;
	if (coefficient >= 1 << 24)
		coefficient -= 1 << 25;
	return ldexp(coefficient, exponent - 25);
}

bool incise_chrony_read(struct incise_chrony_tracking *tracking, const uint8_t *bytes,
			size_t n, uint32_t sequence)
{
	const uint8_t *data = bytes + CHRONY_DATA;
	const uint8_t *floats = data + 40;
	uint64_t high, low, ns;
	int stratum, leap;

	if (n < INCISE_CHRONY_BYTES || bytes[0] != CHRONY_VERSION ||
	    bytes[1] != CHRONY_REPLY || get(bytes + 4, 2) != CHRONY_TRACKING ||
	    get(bytes + 6, 2) != CHRONY_TRACKING_REPLY || get(bytes + 8, 2) ||
	    get(bytes + 16, 4) != sequence)
		return false;
	stratum = (int)get(data + 24, 2);
	leap = (int)get(data + 26, 2);
	high = get(data + 28, 4);
	low = get(data + 32, 4);
	ns = get(data + 36, 4);
	if (high == CHRONY_NO_HIGH)
		high = 0;
	/* Beyond the year 2514 ns do not fit. */
	if (high > 3 || ns >= 1000000000)
		return false;
	*tracking = (struct incise_chrony_tracking){
		.synchronised = stratum > 0 && stratum < 16 &&
				leap < CHRONY_UNSYNCHRONISED &&
				get(data, 4) != CHRONY_LOCAL,
		.ref_ns = (int64_t)((high << 32 | low) * 1000000000 + ns),
		.correction_s = chrony_float(floats),
		.rate_ppm = chrony_float(floats + 16),
		.skew_ppm = chrony_float(floats + 20),
		.delay_s = chrony_float(floats + 24),
		.dispersion_s = chrony_float(floats + 28),
	};
	return tracking->ref_ns >= 0 && fabs(tracking->correction_s) < 1e9 &&
	       tracking->skew_ppm >= 0 && tracking->delay_s >= 0 &&
	       tracking->dispersion_s >= 0;
}

/* --- ptp4l ------------------------------------------------------------------------------ */

#define PTP_HEADER 34
#define PTP_TLV 48
#define PTP_DATA 54
#define PTP_MANAGEMENT 0xd
#define PTP_VERSION 2
#define PTP_GET 0
#define PTP_RESPONSE 2
#define PTP_TLV_MANAGEMENT 1
#define PTP_MASTER 6
#define PTP_SOFTWARE 0 /* timestamping */
#define PTP_UNCALIBRATED 8
#define PTP_SLAVE 9
/* Longer than any path of a network; more than any number of leap seconds. */
#define PTP_DELAY_MAX_NS 1e9
#define PTP_UTC_MAX_S 1000

void incise_ptp_request(uint8_t bytes[INCISE_PTP_REQUEST_BYTES], enum incise_ptp_id id,
			uint8_t domain, uint16_t sequence)
{
	memset(bytes, 0, INCISE_PTP_REQUEST_BYTES);
	bytes[0] = PTP_MANAGEMENT;
	bytes[1] = PTP_VERSION;
	put_wall_packets(bytes + 2, INCISE_PTP_REQUEST_BYTES, 2);
	bytes[4] = domain;
	put_wall_packets(bytes + 30, sequence, 2);
	bytes[32] = 4; /* control of management messages */
	bytes[33] = 0x7f;
	memset(bytes + PTP_HEADER, 0xff, 10); /* all ports */
	/* No hops: the daemon sends the request no further. */
	bytes[46] = PTP_GET;
	put_wall_packets(bytes + PTP_TLV, PTP_TLV_MANAGEMENT, 2);
	put_wall_packets(bytes + PTP_TLV + 2, 2, 2);
	put_wall_packets(bytes + PTP_TLV + 4, (unsigned int)id, 2);
}

static bool read_status(struct incise_ptp_state *state, const uint8_t *data)
{
	state->offset_ns = (int64_t)get(data, 8);
	state->ingress_ns = (int64_t)get(data + 8, 8);
	state->gm_present = get(data + 38, 4) != 0;
	memcpy(state->gm, data + 42, 8);
	state->has_status = state->ingress_ns >= 0 && state->ingress_ns < INT64_MAX / 2 &&
			    state->offset_ns > -INT64_MAX / 4 &&
			    state->offset_ns < INT64_MAX / 4;
	return state->has_status;
}

static bool read_current(struct incise_ptp_state *state, const uint8_t *data)
{
	/* in 2^-16 ns */
	state->path_delay_ns = (double)(int64_t)get(data + 10, 8) / 65536;
	state->has_current = fabs(state->path_delay_ns) < PTP_DELAY_MAX_NS;
	return state->has_current;
}

static bool read_properties(struct incise_ptp_state *state, const uint8_t *data)
{
	state->utc_offset_s = (int16_t)get(data, 2);
	state->utc_valid = data[2] & 1 << 2;
	state->ptp_timescale = data[2] & 1 << 3;
	state->traceable = data[2] & 1 << 4;
	state->has_properties =
		state->utc_offset_s >= 0 && state->utc_offset_s <= PTP_UTC_MAX_S;
	return state->has_properties;
}

static bool read_port(struct incise_ptp_state *state, const uint8_t *data)
{
	/* A daemon that runs free never becomes more than uncalibrated, as it sets no clock. */
	state->slave |= data[10] == PTP_SLAVE || data[10] == PTP_UNCALIBRATED;
	state->master |= data[10] == PTP_MASTER;
	return true;
}

static bool read_port_properties(struct incise_ptp_state *state, const uint8_t *data)
{
	state->hardware |= data[11] != PTP_SOFTWARE;
	return true;
}

bool incise_ptp_read(struct incise_ptp_state *state, const uint8_t *bytes, size_t n,
		     uint8_t domain, uint16_t sequence)
{
	static const struct {
		enum incise_ptp_id id;
		size_t size;
		bool (*read)(struct incise_ptp_state *state, const uint8_t *data);
	} sets[] = {
		{INCISE_PTP_TIME_STATUS_NP, 50, read_status},
		{INCISE_PTP_CURRENT_DATA_SET, 18, read_current},
		{INCISE_PTP_TIME_PROPERTIES, 4, read_properties},
		{INCISE_PTP_PORT_DATA_SET, 26, read_port},
		/* and the name of its interface */
		{INCISE_PTP_PORT_PROPERTIES_NP, 13, read_port_properties},
	};
	size_t length;

	if (n < PTP_DATA || (bytes[0] & 0xf) != PTP_MANAGEMENT ||
	    (bytes[1] & 0xf) != PTP_VERSION || get(bytes + 2, 2) > n ||
	    bytes[4] != domain || get(bytes + 30, 2) != sequence ||
	    (bytes[46] & 0xf) != PTP_RESPONSE ||
	    get(bytes + PTP_TLV, 2) != PTP_TLV_MANAGEMENT)
		return false;
	length = get(bytes + PTP_TLV + 2, 2);
	for (size_t i = 0; i < sizeof(sets) / sizeof(*sets); i++)
		if (get(bytes + PTP_TLV + 4, 2) == sets[i].id)
			return (length == sets[i].size + 2 ||
				(sets[i].id == INCISE_PTP_PORT_PROPERTIES_NP &&
				 length > sets[i].size + 2)) &&
			       n >= PTP_DATA + sets[i].size &&
			       sets[i].read(state, bytes + PTP_DATA);
	return false;
}
