/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside a recorder; for lib/record/recorder*.c only.
 *
 *     recorder.c           beginning, poll and end
 *     recorder_rows.c      a sample becomes a row, with its place in the ledger
 *     recorder_hold.c      armed: the last second, until the trigger
 *     recorder_camera.c    pictures: pump, vision, camera.mkv
 *     recorder_streams.c   times of each stream; tables streams and knots
 *     recorder_zero.c      the zero of the force channel
 *     recorder_database.c  opening, commits
 *     recorder_ledger.c    table ledger
 *     recorder_meta.c      tables meta and events
 *     recorder_folder.c    NAME.rec.part, its lock and its name
 *     recorder_disk.c      room on the disk
 */
#ifndef INCISE_RECORDER_PRIVATE_H
#define INCISE_RECORDER_PRIVATE_H

#include <stdbool.h>
#include <stdint.h>
#include <sqlite3.h>
#include <incise/recorder.h>
#include "../../base/ring.h"
#include "../read/cut.h"
#include "../read/depth.h"
#include "frame_pump.h"
#include "../ledger.h"
#include "../time/timeline.h"

#define INCISE_RECORDER_COMMIT_NS 100000000LL

/* Prepared once; see recorder_database.c. */
enum {
	INSERT_FORCE,
	INSERT_TRACKER,
	INSERT_DEPTH,
	INSERT_FRAME,
	INSERT_EVENT,
	INSERT_LEDGER,
	SET_META,
	SET_STREAM,
	DROP_KNOTS,
	INSERT_KNOT,
	STATEMENTS
};

/* One stream's numbers and times. */
struct incise_recorder_stream {
	const char *name; /* in the tables */
	char device[64];
	bool there; /* the rig has it */
	struct incise_timeline timeline;
	double delay_sd_ms; /* NAN: not known */
	struct incise_ledger ledger;
	uint64_t rows;
	bool begun;
	int64_t first_ns;
	uint64_t next;		/* sequence number expected */
	uint64_t gaps;		/* samples that the numbers show to be missing */
	uint64_t gaps_held;	/* of them, from before the trigger */
	uint64_t lost_at_start; /* by the device, before this recording */
	uint64_t device_lost;	/* since then */
	char ended[200];	/* why it died; empty: it has not */
};

/* Codes of the force channel while the tool is free. */
struct incise_recorder_zero {
	int64_t n, sum, sum2;
	bool clipped;
	double depth_max_mm;
	int64_t tracker_ns; /* last record */
};

/* A sample with its time, as it is held while the recorder is armed. */
struct incise_recorder_force_row {
	uint64_t seq;
	int64_t t_ns;
	int32_t code;
};

struct incise_recorder_tracker_row {
	int64_t t_ns;
	struct incise_tracker_sample sample;
};

struct incise_recorder_hold {
	struct incise_ring force, tracker;
	double force_N; /* that triggers; 0: none does */
	bool button;	/* triggers */
	bool triggered; /* what is held goes out with the next poll */
};

struct incise_recorder_camera {
	struct incise_frames_writer *writer; /* until the pump has it */
	struct incise_vision *vision;
	struct incise_frame_pump *pump;
	bool records; /* until the pump has given its last picture */
	/* Numbers do not tell of pictures that were never shot: time does. */
	uint64_t seen;	   /* pictures, when it was looked for them */
	int64_t looked_ns; /* that was then */
	int64_t silent_ns; /* without a new one, as long as it was looked for them */
	bool silent;	   /* there is an event of it */
};

struct incise_recorder_disk {
	int64_t asked_ns; /* last look */
	int64_t begun_ns;
	double free_bytes, bytes_per_s;
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
	struct incise_camera_info camera_info;

	struct incise_recorder_stream streams[INCISE_LEDGER_STREAMS];
	struct incise_depth depth;
	struct incise_cut cut;
	struct incise_recorder_zero zero;
	struct incise_recorder_hold hold;
	struct incise_recorder_camera camera;
	struct incise_recorder_disk disk;
	struct incise_recorder_stats stats;
	int64_t commit_ns; /* up to when samples are safe */
	int commits;
	bool ended;	     /* takes no more samples */
	bool cuts;	     /* mark their beginnings and ends */
	uint64_t not_finite; /* records of the tracker, as good as lost */
	int failed;	     /* negative errno of the failure that ended it, or 0 */
	bool worthless;	     /* failed before there was anything to keep */
};

/* --- recorder_rows.c --------------------------------------------------------------- */

/* A sample that came from its device; one that cannot be ends its stream. 0 or of the disk. */
int incise_recorder_put_force(struct incise_recorder *rec,
			      const struct incise_force_sample *sample,
			      struct incise_error *err);
int incise_recorder_put_tracker(struct incise_recorder *rec,
				const struct incise_tracker_sample *sample,
				struct incise_error *err);
int incise_recorder_put_frame(struct incise_recorder *rec,
			      const struct incise_frame_record *frame,
			      struct incise_error *err);

/* Write it, now that it is known what to write. Returns 0 or of the disk. */
int incise_recorder_write_force(struct incise_recorder *rec,
				const struct incise_recorder_force_row *row,
				struct incise_error *err);
int incise_recorder_write_tracker(struct incise_recorder *rec,
				  const struct incise_recorder_tracker_row *row,
				  struct incise_error *err);

/* The depth rows whose windows are still open. Returns 0 or of the disk. */
int incise_recorder_flush_depth(struct incise_recorder *rec, struct incise_error *err);

/* --- recorder_hold.c --------------------------------------------------------------- */

/* Begin armed. Returns 0 or -ENOMEM. */
int incise_recorder_hold(struct incise_recorder *rec);
void incise_recorder_hold_free(struct incise_recorder *rec);

/* Keep it; the oldest goes. */
void incise_recorder_hold_force(struct incise_recorder *rec,
				const struct incise_recorder_force_row *row);
void incise_recorder_hold_tracker(struct incise_recorder *rec,
				  const struct incise_recorder_tracker_row *row);

/* The trigger has come: write the last second. Returns 0 or of the disk. */
int incise_recorder_release(struct incise_recorder *rec, struct incise_error *err);

/* --- recorder_camera.c ------------------------------------------------------------- */

/* Make camera.mkv and what looks at pictures. Returns 0 or -errno. */
int incise_recorder_open_camera(struct incise_recorder *rec,
				const struct incise_vision_setup *vision,
				struct incise_error *err);

/* Pictures go into the file from now on. Returns 0 or -errno. */
int incise_recorder_start_camera(struct incise_recorder *rec, struct incise_error *err);

/* Rows of pictures that are in the file. Returns 0, of the disk, or -errno with *ended. */
int incise_recorder_take_camera(struct incise_recorder *rec, struct incise_error *err);

/* End the file, and take its last rows. Returns 0 or of the disk. */
int incise_recorder_end_camera(struct incise_recorder *rec, struct incise_error *err);

void incise_recorder_close_camera(struct incise_recorder *rec);

/* --- recorder_streams.c ------------------------------------------------------------ */

/* What is known of them at the start. */
void incise_recorder_begin_streams(struct incise_recorder *rec);

/* Lost by the numbers, or by the device's own count, which sees the last ones too. */
uint64_t incise_recorder_lost(const struct incise_recorder *rec, int stream);

/* A device is at its end: an event, and the others go on. Returns 0 or of the disk. */
int incise_recorder_end_stream(struct incise_recorder *rec, int stream, const char *why,
			       struct incise_error *err);

/* Tables streams and, with @knots, knots. Returns an SQLite code. */
int incise_recorder_write_streams(struct incise_recorder *rec, bool knots);

/* --- recorder_disk.c --------------------------------------------------------------- */

/* Whether there is room for @planned_s (0: not known). Returns 0, -ENOSPC or -errno. */
int incise_recorder_preflight(struct incise_recorder *rec, double planned_s,
			      struct incise_error *err);

/* Look at it now and then. True: it is to end, while there is room to end in. */
bool incise_recorder_disk_full(struct incise_recorder *rec);

/* --- the database ------------------------------------------------------------------ */

/* Report a failed write; what was committed stays. Returns -errno. */
int incise_recorder_fail(struct incise_recorder *rec, struct incise_error *err);

/* Make the database in the folder, with what is known at the start. Returns 0 or -errno. */
int incise_recorder_open_database(struct incise_recorder *rec,
				  const char *calibration_path, struct incise_error *err);

/* Make what came so far safe, with its counts and its ledger. Returns 0 or -errno. */
int incise_recorder_commit(struct incise_recorder *rec, int64_t now_ns, bool last,
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
int incise_recorder_write_meta(struct incise_recorder *rec, const char *calibration_path);

/* A block of the ledger for each stream that has rows since the last. SQLite code. */
int incise_recorder_ledger(struct incise_recorder *rec);

/* The last blocks, and the end of the ledger of each stream. Returns an SQLite code. */
int incise_recorder_ledger_close(struct incise_recorder *rec);

/*
 * Seal what is not in blocks; the last that is written, in the transaction in which table
 * meta says complete. Returns an SQLite code.
 */
int incise_recorder_seal(struct incise_recorder *rec);

/* A line in the table of events, at a time or now. Returns an SQLite code. */
int incise_recorder_note_at(struct incise_recorder *rec, int64_t t_ns, const char *kind,
			    const char *fmt, ...) INCISE_PRINTF(4, 5);
int incise_recorder_note(struct incise_recorder *rec, const char *kind, const char *fmt,
			 ...) INCISE_PRINTF(3, 4);

/* --- the folder -------------------------------------------------------------------- */

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

/* --- recorder_zero.c --------------------------------------------------------------- */

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
