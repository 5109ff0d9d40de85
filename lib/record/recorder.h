/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside a recorder; for lib/record/recorder*.c only.
 *
 *     recorder.c           samples, beginning and end
 *     recorder_database.c  opening, commits
 *     recorder_ledger.c    table ledger
 *     recorder_folder.c    NAME.rec.part, its lock and its name
 *     recorder_meta.c      tables meta and events
 *     recorder_zero.c      the zero of the force channel
 */
#ifndef INCISE_RECORDER_PRIVATE_H
#define INCISE_RECORDER_PRIVATE_H

#include <stdbool.h>
#include <stdint.h>
#include <sqlite3.h>
#include <incise/recorder.h>
#include "depth.h"
#include "ledger.h"
#include "timeline.h"

/* Prepared once; see recorder_database.c. */
enum {
	INSERT_FORCE,
	INSERT_TRACKER,
	INSERT_DEPTH,
	INSERT_EVENT,
	INSERT_LEDGER,
	SET_META,
	STATEMENTS
};

/* One stream's numbers and times. */
struct incise_recorder_stream {
	struct incise_timeline timeline;
	struct incise_ledger ledger;
	bool begun;
	int64_t first_ns;
	uint64_t next;		/* sequence number expected */
	uint64_t lost;		/* gaps */
	uint64_t lost_at_start; /* by the device, before this recording */
};

/* Codes of the force channel while the tool is free. */
struct incise_recorder_zero {
	int64_t n, sum, sum2;
	bool clipped;
	double depth_max_mm;
	int64_t tracker_ns; /* last record */
};

struct incise_recorder {
	char *path;	    /* as given, without trailing slashes */
	char *part;	    /* path.part */
	const char *name;   /* last component of path */
	int parent, folder; /* open; folder is locked while it is written */
	sqlite3 *db;
	sqlite3_stmt *stmt[STATEMENTS];

	struct incise_rig *rig;
	struct incise_calibration calibration;
	struct incise_force_info force_info;
	struct incise_tracker_info tracker_info;

	struct incise_recorder_stream force, tracker;
	struct incise_depth depth;
	struct incise_recorder_zero zero;
	struct incise_recorder_stats stats;
	int64_t commit_ns; /* up to when samples are safe */
	int failed;	   /* negative errno of the failure that ended it, or 0 */
	bool worthless;	   /* failed before there was anything to keep */
};

/* Report a failed write; what was committed stays. Returns -errno. */
int incise_recorder_fail(struct incise_recorder *rec, struct incise_error *err);

/* Make the database in the folder, with what is known at the start. Returns 0 or -errno. */
int incise_recorder_open_database(struct incise_recorder *rec, struct incise_error *err);

/* Make what came so far safe, with its counts and its ledger. Returns 0 or -errno. */
int incise_recorder_commit(struct incise_recorder *rec, int64_t now_ns,
			   struct incise_error *err);

void incise_recorder_close_database(struct incise_recorder *rec);

/* Run a bound statement. Returns an SQLite code. */
int incise_recorder_run(sqlite3_stmt *stmt);

/* A pair in table meta; a real that is NaN becomes NULL: not known. SQLite codes. */
int incise_recorder_set_text(struct incise_recorder *rec, const char *key,
			     const char *value);
int incise_recorder_set_integer(struct incise_recorder *rec, const char *key,
				int64_t value);
int incise_recorder_set_real(struct incise_recorder *rec, const char *key, double value);

/* All that is known at the start. Returns SQLite codes, or'ed. */
int incise_recorder_write_meta(struct incise_recorder *rec);

/* What is known of the streams at the start. Returns an SQLite code. */
int incise_recorder_write_streams(struct incise_recorder *rec);

/* A block of the ledger for each stream that has rows since the last. SQLite code. */
int incise_recorder_ledger(struct incise_recorder *rec);

/* The last blocks, and the end of the ledger of each stream. Returns an SQLite code. */
int incise_recorder_ledger_close(struct incise_recorder *rec);

/* A line in the table of events. Returns an SQLite code. */
int incise_recorder_note(struct incise_recorder *rec, const char *kind, const char *fmt,
			 ...) INCISE_PRINTF(3, 4);

/* Split the path into its folder, kept open, and its name. Returns 0 or -errno. */
int incise_recorder_take_path(struct incise_recorder *rec, const char *path,
			      struct incise_error *err);

/* Make NAME.rec.part and lock it, so that nobody takes it for a leftover. */
int incise_recorder_make_folder(struct incise_recorder *rec, struct incise_error *err);

/* fsync(2) the folder that holds the name. Returns 0 or -errno. */
int incise_recorder_sync_parent(struct incise_recorder *rec);

/* Remove NAME.rec.part; only files that a recorder makes. */
void incise_recorder_remove_folder(struct incise_recorder *rec);

/* NAME.rec.part, whole and synced, becomes NAME.rec. Returns 0 or -errno. */
int incise_recorder_give_name(struct incise_recorder *rec, struct incise_error *err);

/* What the codes of the force channel are in mV. */
double incise_recorder_code_mV(const struct incise_recorder *rec, double code);

/* A code while the zero is not known; taken into it in the first 0.5 s. */
void incise_recorder_zero_force(struct incise_recorder *rec, int64_t t_ns, int32_t code,
				bool clipped);

/* A depth likewise: a blade in the tissue is not free. */
void incise_recorder_zero_depth(struct incise_recorder *rec, int64_t t_ns,
				double depth_mm);

/* The tracker's records come later than the force's: wait until it has had its say. */
bool incise_recorder_zero_due(const struct incise_recorder *rec);

/* The mean is the zero. Returns 0, -EBUSY (the tool was not free), -errno. */
int incise_recorder_settle_zero(struct incise_recorder *rec, struct incise_error *err);

#endif
