/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A session: recordings of several machines on one timeline, for lib/record only; see
 * incise/session.h.
 *
 *     session.rec/recording.db     members, and the map of each one's clock
 *     session.rec/NAME/            a member: a recording as it was
 *
 * A session opened is a recording whose streams are each of one member.
 */
#ifndef INCISE_SESSION_PRIVATE_H
#define INCISE_SESSION_PRIVATE_H

#include <stdint.h>
#include <incise/session.h>
#include <incise/wall.h>
#include "rows.h"

#define INCISE_SESSION_VERSION 1 /* SQLite's user_version */
#define INCISE_SESSION_KNOTS_MAX 1000000

struct incise_session {
	int n;
	struct incise_session_info *info;  /* of each member … */
	struct incise_recording **members; /* … its recording */
	struct incise_session_map *maps;   /* … its clock */
	int of[INCISE_STREAMS_MAX];	   /* member of force, tracker, camera */
};

/* Names of the tables, in the form of schema.c; ends with NULL. */
extern const char *const incise_session_tables[];

/*
 * Find the identity of a recording: the last checksums of its ledger, which sum up everything.
 * To be freed; NULL: no memory, or it cannot be read.
 */
char *incise_session_identity(struct incise_recording *recording);

/* The checksum of a session's tables. Returns an SQLite code. */
int incise_session_seal(sqlite3 *db, uint32_t *crc);

/*
 * Open the members of rec, whose database is open, by the choice behind its name ("b",
 * "force=a,tracker=b", or ""). Returns 0 or -errno; closing rec closes them.
 */
int incise_session_open(struct incise_recording *rec, const char *folder,
			const char *choice, struct incise_error *err);
void incise_session_close(struct incise_session *session);

/*
 * The distance from its points of wall time up to which the first member's clock goes on at its own
 * rate; beyond, the session's goes on as TAI does.
 */
#define INCISE_SESSION_FAR_NS 59000000000LL

/* Extend the wall time of the first member to the session's ends; it is freed. NULL with errno. */
struct incise_wall *incise_session_extend(const struct incise_session *session,
					  struct incise_wall *wall);

#endif
