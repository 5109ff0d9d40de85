/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Requests to chronyd and ptp4l, and their answers. No input and output; answers are untrusted. All
 * integers are big-endian.
 *
 *     chrony 6   version 6 │ type 1, 2 │ 0 0 │ command 33 │ attempt; reply 5 │ … │ data
 *     PTP 2      header 34 │ target 10 │ hops 2 │ action │ 0 │ TLV: type 1, length, id │ data
 */
#ifndef INCISE_WALL_PACKETS_H
#define INCISE_WALL_PACKETS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* --- chronyd: REQ_TRACKING ------------------------------------------------------------- */

/* A request is as long as its reply. */
#define INCISE_CHRONY_BYTES 104

struct incise_chrony_tracking {
	bool synchronised;   /* to another clock than its own */
	int64_t ref_ns;	     /* UTC of its last measurement */
	double correction_s; /* UTC less CLOCK_REALTIME */
	double skew_ppm,
		rate_ppm; /* of its frequency: bound of the error; its residual */
	double delay_s, dispersion_s;
};

void incise_chrony_request(uint8_t bytes[INCISE_CHRONY_BYTES], uint32_t sequence);

/* False: not a whole answer to that request, or with impossible values. */
bool incise_chrony_read(struct incise_chrony_tracking *tracking, const uint8_t *bytes,
			size_t n, uint32_t sequence);

/* --- ptp4l: management messages -------------------------------------------------------- */

#define INCISE_PTP_REQUEST_BYTES 54

enum incise_ptp_id {
	INCISE_PTP_CURRENT_DATA_SET = 0x2001,
	INCISE_PTP_TIME_PROPERTIES = 0x2003,
	INCISE_PTP_PORT_DATA_SET = 0x2004,
	INCISE_PTP_TIME_STATUS_NP = 0xc000,
	INCISE_PTP_PORT_PROPERTIES_NP = 0xc004,
};

/* Gathered from several answers; each reads its part. */
struct incise_ptp_state {
	bool has_status, has_current, has_properties;
	int64_t offset_ns;  /* local clock less the master's, at the last sync */
	int64_t ingress_ns; /* of that, by the local clock; 0: none */
	bool gm_present;    /* the grandmaster is another clock */
	uint8_t gm[8];
	double path_delay_ns;
	int utc_offset_s;
	bool utc_valid, ptp_timescale, traceable;
	bool hardware;	    /* a port's timestamps are not of CLOCK_REALTIME */
	bool slave, master; /* one port follows a master, or is one */
};

void incise_ptp_request(uint8_t bytes[INCISE_PTP_REQUEST_BYTES], enum incise_ptp_id id,
			uint8_t domain, uint16_t sequence);

/* False: not an answer to any of these requests, or with impossible values. */
bool incise_ptp_read(struct incise_ptp_state *state, const uint8_t *bytes, size_t n,
		     uint8_t domain, uint16_t sequence);

#endif
