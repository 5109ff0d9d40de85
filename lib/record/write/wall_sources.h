/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Sources of wall time; see wall_sampler.h. Each call blocks for at most some 0.1 s, and none
 * needs more privileges than to open the socket of its program.
 */
#ifndef INCISE_WALL_SOURCES_H
#define INCISE_WALL_SOURCES_H

#include <stdint.h>
#include "../../signal/wall_follow.h"
#include "wall_packets.h"

/*
 * Read all clocks within a short time. Of some tries the shortest counts, as one can be
 * interrupted.
 */
void incise_wall_read_clocks(struct incise_wall_clocks *clocks);

/*
 * A source's statement: the reading with its time at a CLOCK_MONOTONIC_RAW, or of CLOCK_REALTIME.
 * With clocks that are read after it, the sampler finds tai_ns from either.
 */
struct incise_wall_statement {
	struct incise_wall_reading reading;
	bool answered;	    /* its program, by a time or without */
	bool of_card;	    /* the time is that of a network card, and not used */
	int64_t tai_raw_ns; /* 0: it states the offset */
	double offset_ns;   /* CLOCK_REALTIME less UTC */
};

/* --- wall_kernel.c: the kernel's own state, which programs such as ntpd and chronyd set ----- */

struct incise_wall_kernel {
	int64_t updated;
	double last_ns; /* maximum error */
};

/*
 * Two statements: "kernel", which is good if the clock is synchronised, and "plain", whose error
 * is unknown. Sets TAI less UTC in the clocks.
 */
void incise_wall_kernel_read(struct incise_wall_kernel *kernel,
			     struct incise_wall_clocks *clocks,
			     struct incise_wall_statement *statements);

/* --- wall_peers.c: the programs that set the clock ------------------------------------------ */

/* A sync of ptp4l. */
struct incise_wall_sync {
	int64_t raw_ns, tai_ns;
};

struct incise_wall_peer {
	int fd;		     /* -1: closed */
	int64_t patience_ns; /* with one request */
	uint32_t sequence;
	int64_t updated;
	int port;	/* chronyd: of 127.0.0.1 */
	char path[108]; /* ptp4l: its socket; empty: the usual ones */
	int domain;	/* ptp4l */
	/* ptp4l: the last syncs, and what the clocks did since the reading before. */
	uint8_t gm[8];
	int n;
	struct incise_wall_sync syncs[16];
	struct incise_wall_clocks clocks;
	double real_per_raw;
	bool stepped;
};

void incise_wall_peer_init(struct incise_wall_peer *peer);
void incise_wall_peer_close(struct incise_wall_peer *peer);

/* @clocks: read just before, with TAI less UTC. */
void incise_wall_chrony_read(struct incise_wall_peer *peer,
			     const struct incise_wall_clocks *clocks,
			     struct incise_wall_statement *statement);
void incise_wall_ptp_read(struct incise_wall_peer *peer,
			  const struct incise_wall_clocks *clocks,
			  struct incise_wall_statement *statement);

/* --- wall_kernel.c: a list of leap seconds in the form of IERS, with its end ---------------- */

struct incise_leap_list {
	int64_t expires_s; /* UTC since 1970 */
	int n;
	struct {
		int64_t from_s;
		int offset_s;
	} leaps[100];
};

/* Returns false for a text that is no such list. */
bool incise_leap_list_read(struct incise_leap_list *list, char *text);

#endif
