/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside a recording that was opened for reading; for lib/record only. Each file calls only those above it:
 *
 *     database.c        the file of SQLite; of one that is being written, a copy
 *     recalibration.c   the active calibration
 *     source.c          batches of a stream
 *     ../old/           those of an older format
 *     recording.c       one recording, and its streams, found once
 *     rows.c            rows, and their best times
 *     session.c         recordings of several machines as one
 *     open.c            either, by its path
 */
#ifndef INCISE_RECORDING_PRIVATE_H
#define INCISE_RECORDING_PRIVATE_H

#include <sqlite3.h>
#include <incise/recording.h>
#include "range.h"
#include "../ledger.h"
#include "../../signal/timeline.h"

struct incise_old;
struct incise_recalibrated;
struct incise_session;
struct incise_session_map;

/* A stream with all that its readers need. */
struct incise_stream_source {
	int stream;			      /* INCISE_LEDGER_* */
	struct incise_recording *file;	      /* with the rows */
	const struct incise_session_map *map; /* to the clock of a session, or NULL */
	bool known; /* the rest; else a table is damaged: incise_stream_resolve() says which */
	/* Subtracted while recording, NAN: not known; and of times without a line. */
	double delay_ns, delay_sd_ns, offset_sd_ns;
	/* The active calibration changes times by this, with this variance. */
	int64_t shift_ns;
	double variance_ns2;
	/* Its line; 0 knots: the times of the rows are the best. */
	int n_knots;
	struct incise_timeline_knot *knots;
	/* Rows may be off the line, see ../time/fit.h; 0: none is. */
	double period_ns, grain_ns;
};

/* Numbers of table meta; NAN: missing, NULL or no number. */
struct incise_recording_numbers {
	double force_hz, zero_sd_mV, zero_samples;
	double tracker_hz, tracker_latency_ns;
	double cuts, depth_max_mm, force_max_N; /* the recorder's summary */
};

enum incise_recording_how {
	INCISE_RECORDING_ACTIVE,   /* by the active calibration */
	INCISE_RECORDING_ORIGINAL, /* by that of its capture */
	INCISE_RECORDING_OLDER,	   /* the same, of a format too that is only converted */
};

struct incise_recording {
	sqlite3 *db; /* read-only, in one transaction: a snapshot, even of a live one */
	char *path;  /* of the folder that was opened */
	char *name;  /* "liver" of dir/liver.rec and of dir/liver.rec.part */
	int form;    /* of its tables; lib/record/old/ alone tells older ones apart */
	const struct incise_old *old;	   /* of an older format; NULL: of today's */
	struct incise_recording_info meta; /* the part that is in table meta */
	struct incise_recording_numbers numbers;
	/* Its own streams; those of a joined recording are of its members. */
	struct incise_stream_source own[INCISE_LEDGER_FORMS],
		*streams[INCISE_LEDGER_FORMS];
	/* Table streams; -1: it cannot be read. */
	struct incise_stream table[INCISE_STREAMS_MAX];
	int n_table;
	/* The calibration that it is read by, if not that of its capture; see recalibration.h. */
	struct incise_recalibrated *recalibrated;
	struct incise_recording_range range; /* of rows that are opened */
	/* A joined recording's members; then db has the events only, and path the choice too. */
	struct incise_session *session;
};

/* --- one recording --------------------------------------------------------------------- */

/* Make a recording with this folder, without anything read; NULL: no memory. */
struct incise_recording *incise_recording_new(char *folder);

/* Read it. Returns 0; 1: its database is that of a joined one, and open; -errno. */
int incise_recording_read(struct incise_recording *recording,
			  enum incise_recording_how how, struct incise_error *err);

/* NULL is accepted. */
void incise_recording_free(struct incise_recording *recording);

/*
 * Find what a source has of tables streams and knots, if that is not known. Returns 0, -EINVAL (an impossible row),
 * -EIO, -ENOMEM.
 */
int incise_stream_resolve(struct incise_stream_source *source, struct incise_error *err);

/* Table streams, by the active calibration. Returns their number, -EINVAL (an impossible row). */
int incise_recording_streams(struct incise_recording *recording,
			     struct incise_stream streams[INCISE_STREAMS_MAX],
			     struct incise_error *err);

/* The converter's codes as forces: code · n_per_code - zero_N. */
struct incise_recording_force {
	double n_per_code, zero_N; /* zero NAN: not known */
	int32_t top;		   /* largest code */
};

/* By the recording's own calibration, or by @given if that is not NULL. */
void incise_recording_force(const struct incise_recording *recording,
			    const struct incise_calibration *given,
			    struct incise_recording_force *force);

/* Whether it had a force channel: a tracker alone has none. */
bool incise_recording_has_force(const struct incise_recording *recording);

/* Returns 0; -EINVAL: the zero is not known; -ENODATA: no force channel. */
int incise_recording_need_zero(const struct incise_recording *recording,
			       const struct incise_recording_force *force,
			       struct incise_error *err);

/* --- open.c -------------------------------------------------------------------------- */

/*
 * The same as incise_recording_open(), and a session without a choice: of any of its members. These are always read by
 * their active calibration.
 */
struct incise_recording *incise_recording_open_as(const char *path,
						  enum incise_recording_how how,
						  struct incise_error *err);

/* Whether it can be opened: 0 or -errno. Nothing else gets a final name. */
int incise_recording_try(const char *path, struct incise_error *err);

/*
 * Convert the recording in a folder, which is a copy, to today's format, if it has an older one; @path is that
 * which was copied. Returns as incise_recording_recover().
 */
int incise_recording_convert(const char *folder, const char *path, bool damaged,
			     struct incise_recovered *made, struct incise_error *err);

#endif
