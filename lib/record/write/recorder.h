/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside a recorder; for capture.c and recorder*.c of this folder only. Each file calls only those
 * below it.
 *
 *     capture.c             a whole capture
 *     recorder.c            start, poll, commits and end; the camera
 *     recorder_rows.c       streams: from samples to blocks; zero; pretrigger
 *     recorder_summary.c    cuts, largest depth and force
 *     block_writer.c        blocks and seals, see block_writer.h
 *     recorder_database.c   the database and its tables meta and events
 *     recorder_folder.c     NAME.rec.part, its lock and its name; free space
 */
#ifndef INCISE_RECORDER_PRIVATE_H
#define INCISE_RECORDER_PRIVATE_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>
#include <sqlite3.h>
#include <incise/recorder.h>
#include "../../base/ring.h"
#include "../read/cut.h"
#include "../read/depth.h"
#include "../../signal/timeline.h"
#include "block_writer.h"
#include "frame_pump.h"
#include "wall_sampler.h"

/* Statements, prepared once; see recorder_database.c. */
enum { INSERT_EVENT, SET_META, SET_STREAM, DROP_KNOTS, INSERT_KNOT, STATEMENTS };

/* One stream's numbers and times. */
struct incise_recorder_stream {
	const char *name; /* in the tables */
	char device[64];
	bool exists; /* the rig has it */
	struct incise_timeline timeline;
	double delay_sd_ms; /* NAN: not known */
	struct incise_ledger ledger;
	uint64_t rows;
	bool started;
	int64_t first_ns; /* of all samples */
	int64_t first_row_ns;
	uint64_t next;		/* sequence number expected */
	uint64_t gaps;		/* samples missing by the numbers */
	uint64_t gaps_held;	/* of them, from before the trigger */
	uint64_t lost_at_start; /* by the device, before this recording */
	uint64_t device_lost;	/* since then */
	uint64_t silent; /* samples that did not come at the start and at the end */
	char ended[200]; /* cause of the end; empty: it has not ended */
};

/* Windows of the tracker's records, by which its rate is compared with what it says. */
struct incise_recorder_pace {
	int64_t from_ns; /* arrival of the last record of the window before */
	int64_t last_ns;
	int n, together, close; /* in this window */
	int odd;		/* windows in a row of another rate; */
	double odd_ns;		/* of that, time of all */
	bool even;		/* there was a window of the right rate */
	bool noted;		/* there is an event for the present one */
};

/* Codes of the force channel while the tool is free. */
struct incise_recorder_zero {
	int64_t n;
	int32_t base; /* the first code; the sums are of differences from it */
	double sum, sum2;
	bool clipped;
	double depth_max_mm;
	int64_t tracker_ns; /* last record */
};

/* The summary of all samples, for info: force waits for the depths around it. */
struct incise_recorder_summary {
	struct incise_cut_follow follow;
	struct incise_recorder_force {
		int64_t t_ns;
		int32_t code;
	} * waiting;
	size_t n, capacity;
	double depth_max_mm; /* in a cut */
	/* Cuts by the depths alone, and when each ended, for readers of a part. */
	struct incise_cut_count by_depth;
	int64_t *ends_ns;
	size_t n_ends, ends_capacity;
	bool no_ends;		       /* out of memory: readers look for them */
	int32_t code_least, code_most; /* in cuts; least above most: none */
};

/* Rows of the last second before the trigger. */
struct incise_recorder_pretrigger {
	struct incise_ring force, tracker;
	double force_N; /* triggers; 0: no force does */
	bool button;	/* triggers */
	bool triggered; /* the next poll writes the rows */
};

struct incise_recorder_camera {
	struct incise_frames_writer *writer; /* until the pump owns it */
	struct incise_vision *vision;
	struct incise_frame_pump *pump;
	int64_t began_ns; /* frames of before are not kept */
	/* Frames that were never shot leave no gap in the numbers, but in time. */
	uint64_t seen;	   /* frames, at the last check */
	int64_t looked_ns; /* time of that check */
	int64_t silent_ns; /* time without a new frame, counted between checks */
	bool silent;	   /* there is an event for it */
	bool given_up;	   /* its file is not closed: the disk hangs */
};

/* Wall time. Before the trigger the newest points are kept. */
struct incise_recorder_wall {
	struct incise_wall_sampler *sampler; /* NULL: without wall time */
	struct incise_ledger ledger;
	uint64_t rows;
	bool known;
	struct incise_wall_point newest;
	int n_kept;
	struct incise_wall_point kept[3];
};

struct incise_recorder_disk {
	int64_t asked_ns; /* last look */
	int64_t started_ns;
	double free_bytes;
};

/* The files of a recording that grow: database, its log, camera.mkv. */
#define INCISE_RECORDER_GROWING 3
#define INCISE_RECORDER_LOG 1 /* the second of them */

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
	struct incise_batch batches[INCISE_LEDGER_FORMS]; /* since the last commit */
	struct incise_block_writer blocks;
	struct incise_depth depth;
	struct incise_cut_count cut;
	struct incise_recorder_summary summary;
	struct incise_recorder_zero zero;
	struct incise_recorder_pace pace;
	struct incise_recorder_pretrigger pretrigger;
	struct incise_recorder_camera camera;
	struct incise_recorder_wall wall;
	struct incise_recorder_disk disk;
	struct incise_recorder_stats stats;
	struct {
		bool is;
		ino_t inode;
		off_t size;
	} seen[INCISE_RECORDER_GROWING]; /* after the last commit */
	int64_t commit_ns;		 /* all that was read until then is committed */
	int64_t polled_ns;		 /* last poll */
	int64_t started_ns;		 /* its streams, by the rig's clock */
	int64_t began_ns;		 /* its rows: first poll, or before the trigger */
	int64_t takes_ns;		 /* a commit, lately at most */
	int commits;
	bool ended;	     /* reads no more samples */
	bool cuts;	     /* write events for their starts and ends */
	uint64_t not_finite; /* records of the tracker, which count as lost */
	int failed;	     /* negative errno of the failure that ended it, or 0 */
	bool worthless;	     /* failed before there was anything to keep */
};

/* --- recorder.c -------------------------------------------------------------------- */

/* Free a recorder; unless it failed, remove what it wrote. */
void incise_recorder_discard(struct incise_recorder *rec);

/* --- recorder_rows.c --------------------------------------------------------------- */

/* Count the losses of the devices from here on. */
void incise_recorder_count_losses(struct incise_recorder *rec);

/* Set up the streams of the rig's devices. */
void incise_recorder_start_streams(struct incise_recorder *rec);

/* Losses by the numbers, or by the device's own count, which includes the last ones. */
uint64_t incise_recorder_lost(const struct incise_recorder *rec, int stream);
/* Whether that count may lack some, as the device says. */
bool incise_recorder_unsure(const struct incise_recorder *rec, int stream);

/*
 * Losses that no later sample shows: of force and tracker, where the recording is longer than their
 * rows by more than they may be apart. Returns 0 or a disk error.
 */
int incise_recorder_find_silence(struct incise_recorder *rec, struct incise_error *err);

/* Returns the number of streams. */
int incise_recorder_describe_streams(const struct incise_recorder *rec,
				     struct incise_stream streams[INCISE_STREAMS_MAX]);

/* A device has ended: write an event; the others continue. Returns 0 or a disk error. */
int incise_recorder_end_stream(struct incise_recorder *rec, int stream, const char *why,
			       struct incise_error *err);

/*
 * Add a sample of a device. An invalid one ends its stream. Before the trigger it is kept for
 * one second instead of written. Returns 0 or a disk error.
 */
int incise_recorder_put_force(struct incise_recorder *rec,
			      const struct incise_force_sample *sample,
			      struct incise_error *err);
int incise_recorder_put_tracker(struct incise_recorder *rec,
				const struct incise_tracker_sample *sample,
				struct incise_error *err);
int incise_recorder_put_frame(struct incise_recorder *rec,
			      const struct incise_frame_record *frame,
			      struct incise_error *err);

/* Write the points of wall time since the last call. Returns 0 or a disk error. */
int incise_recorder_put_wall(struct incise_recorder *rec, struct incise_error *err);

/* Count the depths whose windows are still open. Returns 0 or a disk error. */
int incise_recorder_flush_depth(struct incise_recorder *rec, struct incise_error *err);

/* Start armed. Returns 0 or -ENOMEM. */
int incise_recorder_arm(struct incise_recorder *rec);

/* The trigger has come: write the last second. Returns 0 or a disk error. */
int incise_recorder_release(struct incise_recorder *rec, struct incise_error *err);

/* Free the memory of arm(). */
void incise_recorder_disarm(struct incise_recorder *rec);

/* Whether the zero can be settled: the tracker's records come later than those of force. */
bool incise_recorder_zero_due(const struct incise_recorder *rec);

/* The mean is the zero. Returns 0, -EBUSY (the tool was not free), -errno. */
int incise_recorder_settle_zero(struct incise_recorder *rec, struct incise_error *err);

/* Write tables streams and, with @knots, knots. Returns an SQLite code. */
int incise_recorder_write_streams(struct incise_recorder *rec, bool knots);

/*
 * Write a block of the ledger for each stream with new rows, and with @last the ends; then the
 * head of the seal at this commit, whose time is @t_ns. Returns an SQLite code.
 */
int incise_recorder_write_ledger(struct incise_recorder *rec, int64_t t_ns, bool last);

/* --- recorder_summary.c ------------------------------------------------------------- */

void incise_recorder_start_summary(struct incise_recorder_summary *summary);

/* A sample of force, and a depth, by their times as they are recorded. */
void incise_recorder_follow_force(struct incise_recorder *rec, int64_t t_ns,
				  int32_t code);
void incise_recorder_follow_depth(struct incise_recorder *rec,
				  const struct incise_depth_row *row);

/* Write it to table meta, at the end. Returns an SQLite code. */
int incise_recorder_write_summary(struct incise_recorder *rec);

/* --- recorder_database.c ----------------------------------------------------------- */

/* Report a failed write; all commits stay. Returns -errno. */
int incise_recorder_fail(struct incise_recorder *rec, struct incise_error *err);
/* The same if @code is not SQLITE_OK; else 0. */
int incise_recorder_check(struct incise_recorder *rec, int code,
			  struct incise_error *err);

/* Create the database in the folder, with what is known at the start. Returns 0 or -errno. */
int incise_recorder_open_database(struct incise_recorder *rec,
				  const char *calibration_path, struct incise_error *err);
void incise_recorder_close_database(struct incise_recorder *rec);

/* Set a value in table meta; NaN becomes NULL: not known. Returns an SQLite code. */
int incise_recorder_set_text(struct incise_recorder *rec, const char *key,
			     const char *value);
int incise_recorder_set_integer(struct incise_recorder *rec, const char *key,
				int64_t value);
int incise_recorder_set_real(struct incise_recorder *rec, const char *key, double value);
int incise_recorder_set_bytes(struct incise_recorder *rec, const char *key,
			      const void *bytes, size_t n);

/* Add a row to table events, at a time or now. Returns an SQLite code. */
int incise_recorder_note_at(struct incise_recorder *rec, int64_t t_ns, const char *kind,
			    const char *fmt, ...) INCISE_PRINTF(4, 5);
int incise_recorder_note(struct incise_recorder *rec, const char *kind, const char *fmt,
			 ...) INCISE_PRINTF(3, 4);

/* --- recorder_folder.c ------------------------------------------------------------- */

/* Split the path into its folder, kept open, and its name. Returns 0 or -errno. */
int incise_recorder_split_path(struct incise_recorder *rec, const char *path,
			       struct incise_error *err);

/* Make NAME.rec.part and lock it, which shows that it is in use. Returns 0 or -errno. */
int incise_recorder_make_folder(struct incise_recorder *rec, struct incise_error *err);

/* fsync(2) the folder that holds the name. Returns 0 or -errno. */
int incise_recorder_sync_parent(struct incise_recorder *rec);

/* Remove NAME.rec.part; only files that a recorder makes. */
void incise_recorder_remove_folder(struct incise_recorder *rec);

/* NAME.rec.part, complete and synced, becomes NAME.rec. Returns 0 or -errno. */
int incise_recorder_rename_folder(struct incise_recorder *rec, struct incise_error *err);

/* Check the free space for @planned_s (0: not known). Returns 0, -ENOSPC or -errno. */
int incise_recorder_check_space(struct incise_recorder *rec, double planned_s,
				struct incise_error *err);

/*
 * Whether the files have what was written: since the last commit none was cut off, removed or
 * replaced by another program. Returns 0 or -EIO.
 */
int incise_recorder_check_files(const struct incise_recorder *rec,
				struct incise_error *err);

/* Remember them, after a commit. */
void incise_recorder_see_files(struct incise_recorder *rec);

/* Look at the free space once a second. True: the recording must end now. */
bool incise_recorder_disk_full(struct incise_recorder *rec);

#endif
