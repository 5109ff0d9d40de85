// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Writing a recording; see incise/recorder.h.
 *
 *     force ────► timeline ─────────────────► table force      one transaction
 *       └► zero: mean of the first 0.5 s ───► table meta    ──► per 100 ms of
 *     tracker ──► timeline ┬────────────────► table tracker     the rig's clock
 *                          └► depth, speed ─► table depth
 *
 * On a real clock each commit is synced, so a power cut costs no more than a kill: the
 * last 100 ms. A device's own buffer bridges the time that syncing takes.
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/utsname.h>
#include <time.h>
#include <unistd.h>
#include <sqlite3.h>
#include <incise/recorder.h>
#include <incise/version.h>
#include "cut.h"
#include "depth.h"
#include "schema.h"
#include "timeline.h"

#define COMMIT_NS 100000000LL
/* How long a reader may keep the recorder from writing. */
#define BUSY_MS 1000
#define BATCH 1024

/* The tool is to be held free for so long, for the zero of the force channel. */
#define ZERO_NS 500000000LL
/* A tracker that says nothing for twice that time has no say in it. */
#define ZERO_PATIENCE_NS (2 * ZERO_NS)
/* A free tool shows the noise of the channel, some mN; a touch shows tenths of N. */
#define ZERO_SD_MAX_N 0.03

enum { INSERT_FORCE, INSERT_TRACKER, INSERT_DEPTH, INSERT_EVENT, SET_META, STATEMENTS };

static const char *const sql[STATEMENTS] = {
	[INSERT_FORCE] = "INSERT INTO force VALUES(?,?,?)",
	[INSERT_TRACKER] = "INSERT INTO tracker VALUES(?,?,?,?,?,?,?,?,?,?,?)",
	[INSERT_DEPTH] = "INSERT INTO depth VALUES(?,?,?,?)",
	[INSERT_EVENT] = "INSERT INTO events VALUES(?,?,?)",
	[SET_META] = "INSERT OR REPLACE INTO meta VALUES(?,?)",
};

/* One stream's numbers and times. */
struct stream {
	struct incise_timeline timeline;
	bool begun;
	int64_t first_ns;
	uint64_t next;		/* sequence number expected */
	uint64_t lost;		/* gaps */
	uint64_t lost_at_start; /* by the device, before this recording */
};

/* Codes of the force channel while the tool is free. */
struct zero {
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

	struct stream force, tracker;
	struct incise_depth depth;
	struct zero zero;
	struct incise_recorder_stats stats;
	int64_t commit_ns; /* up to when samples are safe */
	int failed;	   /* negative errno of the failure that ended it, or 0 */
	bool worthless;	   /* failed before there was anything to keep */
};

/* --- database ------------------------------------------------------------------- */

static int fail_write(struct incise_recorder *rec, struct incise_error *err)
{
	int code = incise_schema_errno(rec->db);
	const char *text = sqlite3_errmsg(rec->db);

	if (code == ENOSPC)
		return incise_error_set(
			err, code,
			"%s: disk full (or a quota or limit on files); make room "
			"and record again; what was committed is in %s: `incise "
			"info` reads it",
			rec->path, rec->part);
	return incise_error_set(err, code == EINVAL ? EIO : code,
				"%s: cannot be written: %s; what was committed is in %s: "
				"`incise info` reads it",
				rec->path, text, rec->part);
}

/* Run a bound statement. Returns an SQLite code. */
static int run(sqlite3_stmt *stmt)
{
	sqlite3_step(stmt);
	return sqlite3_reset(stmt);
}

static int set_text(struct incise_recorder *rec, const char *key, const char *value)
{
	sqlite3_stmt *stmt = rec->stmt[SET_META];

	sqlite3_bind_text(stmt, 1, key, -1, SQLITE_STATIC);
	sqlite3_bind_text(stmt, 2, value, -1, SQLITE_TRANSIENT);
	return run(stmt);
}

static int set_integer(struct incise_recorder *rec, const char *key, int64_t value)
{
	sqlite3_stmt *stmt = rec->stmt[SET_META];

	sqlite3_bind_text(stmt, 1, key, -1, SQLITE_STATIC);
	sqlite3_bind_int64(stmt, 2, value);
	return run(stmt);
}

/* SQLite keeps NaN as NULL: not known. */
static int set_real(struct incise_recorder *rec, const char *key, double value)
{
	sqlite3_stmt *stmt = rec->stmt[SET_META];

	sqlite3_bind_text(stmt, 1, key, -1, SQLITE_STATIC);
	sqlite3_bind_double(stmt, 2, value);
	return run(stmt);
}

static int note(struct incise_recorder *rec, const char *kind, const char *fmt, ...)
	INCISE_PRINTF(3, 4);

/* A line in the table of events. Returns an SQLite code. */
static int note(struct incise_recorder *rec, const char *kind, const char *fmt, ...)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_EVENT];
	char text[200];
	va_list args;

	va_start(args, fmt);
	vsnprintf(text, sizeof(text), fmt, args);
	va_end(args);
	sqlite3_bind_int64(stmt, 1, incise_clock_now(incise_rig_clock(rec->rig)));
	sqlite3_bind_text(stmt, 2, kind, -1, SQLITE_STATIC);
	sqlite3_bind_text(stmt, 3, text, -1, SQLITE_TRANSIENT);
	return run(stmt);
}

/* Counts go with the rows they count, so that an interrupted recording knows its losses. */
static int commit(struct incise_recorder *rec, int64_t now_ns, struct incise_error *err)
{
	const struct {
		const char *key;
		uint64_t value;
	} counts[] = {
		{"force_rows", rec->stats.force},
		{"tracker_rows", rec->stats.tracker},
		{"depth_rows", rec->stats.depth},
		{"force_lost", rec->stats.force_lost},
		{"tracker_lost", rec->stats.tracker_lost},
		{"force_clipped", rec->stats.force_clipped},
	};

	for (size_t i = 0; i < sizeof(counts) / sizeof(*counts); i++)
		if (set_integer(rec, counts[i].key, counts[i].value) != SQLITE_OK)
			return fail_write(rec, err);
	if (sqlite3_exec(rec->db, "COMMIT; BEGIN", NULL, NULL, NULL) != SQLITE_OK)
		return fail_write(rec, err);
	rec->commit_ns = now_ns;
	return 0;
}

/* --- beginning ------------------------------------------------------------------- */

static int write_meta(struct incise_recorder *rec)
{
	const char *const axes[] = {"x", "y", "z"};
	char started[32];
	struct utsname host;
	struct timespec now;
	struct tm utc;
	int bad = 0;

	clock_gettime(CLOCK_REALTIME, &now);
	strftime(started, sizeof(started), "%Y-%m-%dT%H:%M:%SZ",
		 gmtime_r(&now.tv_sec, &utc));
	uname(&host);
	bad |= set_integer(rec, "complete", 0);
	bad |= set_text(rec, "incise", incise_version());
	bad |= set_text(rec, "host", host.nodename);
	bad |= set_text(rec, "kernel", host.release);
	bad |= set_text(rec, "started", started);
	bad |= set_text(rec, "rig", incise_rig_spec(rec->rig));
	bad |= set_text(rec, "clock",
			incise_clock_is_real(incise_rig_clock(rec->rig)) ? "real"
									 : "simulated");
	bad |= set_text(rec, "tracker_name", rec->tracker_info.name);
	bad |= set_real(rec, "tracker_hz", rec->tracker_info.rate_hz);
	bad |= set_integer(rec, "tracker_latency_ns", rec->tracker_info.latency_ns);
	bad |= set_text(rec, "force_name", rec->force_info.name);
	bad |= set_real(rec, "force_hz", rec->force_info.rate_hz);
	bad |= set_integer(rec, "force_bits", rec->force_info.bits);
	bad |= set_real(rec, "force_full_scale_V", rec->force_info.full_scale_V);
	bad |= set_real(rec, "force_offset_V", rec->force_info.offset_V);
	bad |= set_real(rec, "force_mV_N", rec->calibration.force_mV_N);
	bad |= set_real(rec, "force_zero_mV", rec->stats.zero_mV);
	bad |= set_real(rec, "depth_mm_px", rec->calibration.depth_mm_px);
	for (int i = 0; i < 3; i++) {
		char key[32];

		snprintf(key, sizeof(key), "surface_point_%s_mm", axes[i]);
		bad |= set_real(rec, key, rec->depth.point_mm[i]);
		snprintf(key, sizeof(key), "surface_normal_%s", axes[i]);
		bad |= set_real(rec, key, rec->depth.normal[i]);
	}
	return bad | note(rec, "start", "recording started");
}

static int open_database(struct incise_recorder *rec, struct incise_error *err)
{
	bool real = incise_clock_is_real(incise_rig_clock(rec->rig));
	char *file = NULL;
	int rc;

	if (asprintf(&file, "%s/%s", rec->part, INCISE_SCHEMA_DB) < 0)
		return incise_error_set(err, ENOMEM, "%s: out of memory", rec->path);
	rc = sqlite3_open_v2(
		file, &rec->db,
		SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, NULL);
	free(file);
	/*
	 * Someone may read the recording as it grows, and SQLite keeps the writer out for
	 * a moment: until the file has its log, and when a log is folded in. What comes
	 * meanwhile waits in the sources' rings.
	 */
	if (rc == SQLITE_OK)
		rc = sqlite3_busy_timeout(rec->db, BUSY_MS);
	if (rc == SQLITE_OK)
		rc = sqlite3_exec(
			rec->db,
			real ? "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL"
			     : "PRAGMA journal_mode=WAL; PRAGMA synchronous=NORMAL",
			NULL, NULL, NULL);
	if (rc == SQLITE_OK)
		rc = sqlite3_exec(rec->db, "BEGIN", NULL, NULL, NULL);
	if (rc == SQLITE_OK)
		rc = incise_schema_create(rec->db);
	for (int i = 0; i < STATEMENTS && rc == SQLITE_OK; i++)
		rc = sqlite3_prepare_v3(rec->db, sql[i], -1, SQLITE_PREPARE_PERSISTENT,
					&rec->stmt[i], NULL);
	if (rc == SQLITE_OK)
		rc = write_meta(rec);
	if (rc != SQLITE_OK)
		return fail_write(rec, err);
	return commit(rec, incise_clock_now(incise_rig_clock(rec->rig)), err);
}

/* Split the path into its folder, kept open, and its name. */
static int take_path(struct incise_recorder *rec, const char *path,
		     struct incise_error *err)
{
	size_t length = strlen(path);
	char *slash, *parent;

	while (length > 1 && path[length - 1] == '/')
		length--;
	rec->path = strndup(path, length);
	if (!rec->path || asprintf(&rec->part, "%s.part", rec->path) < 0) {
		rec->part = NULL;
		return incise_error_set(err, ENOMEM, "%s: out of memory", path);
	}
	slash = strrchr(rec->path, '/');
	rec->name = slash ? slash + 1 : rec->path;
	if (!*rec->name || !strcmp(rec->name, ".") || !strcmp(rec->name, ".."))
		return incise_error_set(err, EINVAL, "'%s': is no name for a recording",
					path);
	parent = slash ? strndup(rec->path, slash - rec->path + 1) : strdup(".");
	rec->parent = parent ? open(parent, O_PATH | O_DIRECTORY | O_CLOEXEC) : -1;
	if (rec->parent < 0)
		incise_error_set(err, errno, "%s: the folder %s: %s", rec->path,
				 parent ? parent : "", strerror(errno));
	free(parent);
	return rec->parent < 0 ? -errno : 0;
}

/* Make NAME.rec.part and lock it, so that nobody takes it for a leftover. */
static int make_folder(struct incise_recorder *rec, struct incise_error *err)
{
	const char *part = rec->part + (rec->name - rec->path);
	struct stat st;

	if (!fstatat(rec->parent, rec->name, &st, AT_SYMLINK_NOFOLLOW))
		return incise_error_set(
			err, EEXIST,
			"%s: exists already; record under another name, or "
			"replace it with `incise capture --force`",
			rec->path);
	if (mkdirat(rec->parent, part, 0777)) {
		if (errno == EEXIST)
			return incise_error_set(
				err, EEXIST,
				"%s: left by an interrupted recording, or being written; `incise "
				"info` reads it; rename it, or drop it with `incise capture "
				"--force`",
				rec->part);
		return incise_error_set(err, errno, "%s: cannot be made: %s", rec->part,
					strerror(errno));
	}
	rec->folder = openat(rec->parent, part, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	if (rec->folder < 0)
		return incise_error_set(err, errno, "%s: %s", rec->part, strerror(errno));
	flock(rec->folder, LOCK_EX | LOCK_NB); /* where the file system cannot: no lock */
	return 0;
}

/* fsync(2) the folder that holds the name; O_PATH descriptors cannot be. */
static int sync_parent(struct incise_recorder *rec)
{
	int fd = openat(rec->parent, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	int rc = fd < 0 || fsync(fd) ? -errno : 0;

	if (fd >= 0)
		close(fd);
	/* A folder that may be written but not listed, or one that cannot be synced. */
	return rc == -EACCES || rc == -EINVAL ? 0 : rc;
}

/* Remove NAME.rec.part; only files that a recorder makes. */
static void remove_folder(struct incise_recorder *rec)
{
	static const char *const files[] = {INCISE_SCHEMA_DB, INCISE_SCHEMA_DB "-wal",
					    INCISE_SCHEMA_DB "-shm",
					    INCISE_SCHEMA_DB "-journal"};

	for (size_t i = 0; i < sizeof(files) / sizeof(*files); i++)
		unlinkat(rec->folder, files[i], 0);
	unlinkat(rec->parent, rec->part + (rec->name - rec->path), AT_REMOVEDIR);
}

static void close_database(struct incise_recorder *rec)
{
	for (int i = 0; i < STATEMENTS; i++) {
		sqlite3_finalize(rec->stmt[i]);
		rec->stmt[i] = NULL;
	}
	sqlite3_close(rec->db);
	rec->db = NULL;
}

static void recorder_free(struct incise_recorder *rec)
{
	close_database(rec);
	if (rec->folder >= 0)
		close(rec->folder);
	if (rec->parent >= 0)
		close(rec->parent);
	free(rec->path);
	free(rec->part);
	free(rec);
}

struct incise_recorder *incise_recorder_new(const char *path, struct incise_rig *rig,
					    const struct incise_calibration *calibration,
					    struct incise_error *err)
{
	struct incise_tracker_info tracker;
	struct incise_recorder *rec;
	double point_mm[3], normal[3];
	int rc;

	if (!incise_rig_tracker(rig) || !incise_rig_force(rig)) {
		incise_error_set(
			err, ENODEV,
			"%s: a recording needs a tracker and a force channel; the rig "
			"%s was opened without",
			path, incise_rig_spec(rig));
		return NULL;
	}
	incise_tracker_info(incise_rig_tracker(rig), &tracker);
	/* Rows of two sensors in one table would be one that jumps to and fro. */
	if (tracker.stations > 1) {
		incise_error_set(
			err, EOPNOTSUPP,
			"%s: a recording holds one sensor, and the tracker of %s "
			"reads %d; name the scalpel's alone in "
			"tracker_setup.stations",
			path, incise_rig_spec(rig), tracker.stations);
		return NULL;
	}
	rec = calloc(1, sizeof(*rec));
	if (!rec) {
		incise_error_set(err, ENOMEM, "%s: out of memory", path);
		return NULL;
	}
	rec->parent = rec->folder = -1;
	rec->rig = rig;
	rec->calibration = *calibration;
	rec->stats.zero_mV = calibration->force_zero_mV;
	rec->zero.depth_max_mm = -INFINITY;
	incise_force_info(incise_rig_force(rig), &rec->force_info);
	rec->tracker_info = tracker;
	incise_rig_surface(rig, point_mm, normal);
	incise_depth_init(&rec->depth, point_mm, normal);
	incise_timeline_init(&rec->force.timeline, 0); /* stamped at acquisition */
	incise_timeline_init(&rec->tracker.timeline, rec->tracker_info.latency_ns);
	rec->force.lost_at_start = incise_force_lost(incise_rig_force(rig));
	rec->tracker.lost_at_start = incise_tracker_lost(incise_rig_tracker(rig));
	rc = take_path(rec, path, err);
	if (!rc)
		rc = make_folder(rec, err);
	if (!rc) {
		rc = open_database(rec, err);
		if (rc) {
			close_database(rec);
			remove_folder(rec);
		}
	}
	if (rc) {
		recorder_free(rec);
		errno = -rc;
		return NULL;
	}
	/* A power cut must not take the folder's name; where this fails, nothing is worse. */
	if (incise_clock_is_real(incise_rig_clock(rig)) && !fsync(rec->folder))
		sync_parent(rec);
	return rec;
}

/* --- samples --------------------------------------------------------------------- */

/*
 * Whether a sample is the next of its stream; counts those missing before it. A number
 * that was there before is a fault of the backend.
 */
static int take_number(struct incise_recorder *rec, struct stream *stream,
		       const char *name, uint64_t seq, struct incise_error *err)
{
	if (seq > INT64_MAX || (stream->begun && seq < stream->next))
		return incise_error_set(err, EIO,
					"%s: sample %llu came after %llu; the driver of "
					"this device is at fault",
					name, (unsigned long long)seq,
					(unsigned long long)stream->next - 1);
	if (stream->begun && seq > stream->next) {
		stream->lost += seq - stream->next;
		if (note(rec, "lost", "%s: %llu samples before number %llu", name,
			 (unsigned long long)(seq - stream->next),
			 (unsigned long long)seq) != SQLITE_OK)
			return fail_write(rec, err);
	}
	stream->next = seq + 1;
	return 0;
}

/* Losses by the numbers, or by the device's own count, which sees the last ones too. */
static uint64_t lost(const struct stream *stream, uint64_t device)
{
	device -= stream->lost_at_start;
	return stream->lost > device ? stream->lost : device;
}

/* So many codes are so many mV. */
static double span_mV(const struct incise_recorder *rec, double codes)
{
	return codes * rec->force_info.full_scale_V * 1e3 / (1LL << rec->force_info.bits);
}

static double code_mV(const struct incise_recorder *rec, double code)
{
	return rec->force_info.offset_V * 1e3 + span_mV(rec, code);
}

static int put_force(struct incise_recorder *rec,
		     const struct incise_force_sample *sample, struct incise_error *err)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_FORCE];
	int64_t t_ns = incise_timeline_acquired(&rec->force.timeline, sample->t_ns);
	int64_t top = (1LL << rec->force_info.bits) - 1;
	int rc = take_number(rec, &rec->force, rec->force_info.name, sample->seq, err);

	if (rc)
		return rc;
	if (sample->code < 0 || sample->code > top)
		return incise_error_set(err, EIO,
					"%s: code %d is not within 0 to %lld; the driver "
					"of this device is at fault",
					rec->force_info.name, sample->code,
					(long long)top);
	if (!rec->force.begun) {
		rec->force.begun = true;
		rec->force.first_ns = t_ns;
	}
	sqlite3_bind_int64(stmt, 1, sample->seq);
	sqlite3_bind_int64(stmt, 2, t_ns);
	sqlite3_bind_int(stmt, 3, sample->code);
	if (run(stmt) != SQLITE_OK)
		return fail_write(rec, err);
	rec->stats.force++;
	if (sample->code == 0 || sample->code == top)
		rec->stats.force_clipped++;
	if (!isnan(rec->stats.zero_mV)) {
		rec->stats.force_N = (code_mV(rec, sample->code) - rec->stats.zero_mV) /
				     rec->calibration.force_mV_N;
	} else if (t_ns - rec->force.first_ns < ZERO_NS) {
		rec->zero.n++;
		rec->zero.sum += sample->code;
		rec->zero.sum2 += (int64_t)sample->code * sample->code;
		rec->zero.clipped |= sample->code == 0 || sample->code == top;
	}
	return 0;
}

static int put_depth(struct incise_recorder *rec, const struct incise_depth_row *row,
		     struct incise_error *err)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_DEPTH];

	sqlite3_bind_int64(stmt, 1, row->seq);
	sqlite3_bind_int64(stmt, 2, row->t_ns);
	sqlite3_bind_double(stmt, 3, row->depth_mm);
	sqlite3_bind_double(stmt, 4, row->velocity_mm_s);
	if (run(stmt) != SQLITE_OK)
		return fail_write(rec, err);
	rec->stats.depth++;
	return 0;
}

static bool finite_record(const struct incise_tracker_sample *sample)
{
	for (int i = 0; i < 3; i++)
		if (!isfinite(sample->position_mm[i]))
			return false;
	for (int i = 0; i < 4; i++)
		if (!isfinite(sample->quaternion[i]))
			return false;
	return true;
}

static int put_tracker(struct incise_recorder *rec,
		       const struct incise_tracker_sample *sample,
		       struct incise_error *err)
{
	sqlite3_stmt *stmt = rec->stmt[INSERT_TRACKER];
	int64_t t_ns = incise_timeline_acquired(&rec->tracker.timeline, sample->t_ns);
	struct incise_depth_row row;
	int rc =
		take_number(rec, &rec->tracker, rec->tracker_info.name, sample->seq, err);

	if (rc)
		return rc;
	if (!rec->tracker.begun) {
		rec->tracker.begun = true;
		rec->tracker.first_ns = t_ns;
	}
	rec->zero.tracker_ns = t_ns;
	if (!finite_record(sample)) { /* no place in the table: as good as lost */
		rec->tracker.lost++;
		return note(rec, "lost", "%s: record %llu is not finite",
			    rec->tracker_info.name,
			    (unsigned long long)sample->seq) == SQLITE_OK
			       ? 0
			       : fail_write(rec, err);
	}
	sqlite3_bind_int64(stmt, 1, sample->seq);
	sqlite3_bind_int64(stmt, 2, t_ns);
	sqlite3_bind_int64(stmt, 3, sample->t_ns);
	for (int i = 0; i < 3; i++)
		sqlite3_bind_double(stmt, 4 + i, sample->position_mm[i]);
	for (int i = 0; i < 4; i++)
		sqlite3_bind_double(stmt, 7 + i, sample->quaternion[i]);
	sqlite3_bind_text(stmt, 11, &sample->status, 1, SQLITE_TRANSIENT);
	if (run(stmt) != SQLITE_OK)
		return fail_write(rec, err);
	rec->stats.tracker++;
	/* A record that the tracker itself doubts is kept, but not believed. */
	if (sample->status != ' ')
		return 0;
	rec->stats.depth_mm = incise_depth_of(&rec->depth, sample->position_mm);
	if (isnan(rec->stats.zero_mV) && rec->force.begun &&
	    t_ns - rec->force.first_ns < ZERO_NS)
		rec->zero.depth_max_mm =
			fmax(rec->zero.depth_max_mm, rec->stats.depth_mm);
	if (incise_depth_push(&rec->depth, sample->seq, t_ns, sample->position_mm, &row))
		return put_depth(rec, &row, err);
	return 0;
}

/* @cause: what the device itself tells of it, if anything. */
static int fail_device(struct incise_recorder *rec, const char *name, const char *cause,
		       int rc, struct incise_error *err)
{
	struct incise_error ignored = {0};

	if (note(rec, "failed", "%s: %s", name, *cause ? cause : strerror(-rc)) ==
	    SQLITE_OK)
		commit(rec, rec->commit_ns,
		       &ignored); /* what came before is worth keeping */
	if (*cause)
		return incise_error_set(
			err, -rc,
			"%s; what was recorded before is in %s: `incise info` reads it",
			cause, rec->part);
	return incise_error_set(
		err, -rc,
		"%s: %s; check its cable and power; what was recorded before is "
		"in %s: `incise info` reads it",
		name, rc == -ENODEV ? "is gone" : strerror(-rc), rec->part);
}

static int take_force(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_force *force = incise_rig_force(rec->rig);
	struct incise_force_sample samples[BATCH];
	char cause[200];
	int n = BATCH;

	while (n == BATCH) {
		n = incise_force_read(force, samples, BATCH);
		if (n < 0) {
			incise_force_cause(force, cause, sizeof(cause));
			return fail_device(rec, rec->force_info.name, cause, n, err);
		}
		for (int i = 0; i < n; i++) {
			int rc = put_force(rec, &samples[i], err);

			if (rc)
				return rc;
		}
	}
	rec->stats.force_lost = lost(&rec->force, incise_force_lost(force));
	return 0;
}

static int take_tracker(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_tracker *tracker = incise_rig_tracker(rec->rig);
	struct incise_tracker_sample samples[BATCH / 16];
	char cause[200];
	int n = BATCH / 16;

	while (n == BATCH / 16) {
		n = incise_tracker_read(tracker, samples, BATCH / 16);
		if (n < 0) {
			incise_tracker_cause(tracker, cause, sizeof(cause));
			return fail_device(rec, rec->tracker_info.name, cause, n, err);
		}
		for (int i = 0; i < n; i++) {
			int rc = put_tracker(rec, &samples[i], err);

			if (rc)
				return rc;
		}
	}
	rec->stats.tracker_lost = lost(&rec->tracker, incise_tracker_lost(tracker));
	return 0;
}

/* --- zero of the force channel ---------------------------------------------------- */

static int settle_zero(struct incise_recorder *rec, struct incise_error *err)
{
	const struct zero *zero = &rec->zero;
	const char *remedy =
		"hold the tool free for the first 0.5 s, or give force_zero_mV in "
		"the calibration";
	double mean = (double)zero->sum / zero->n;
	double var = fmax(0, (double)zero->sum2 / zero->n - mean * mean);
	double sd_mV = span_mV(rec, sqrt(var));
	double sd_N = sd_mV / fabs(rec->calibration.force_mV_N);

	rec->worthless = true;
	if (zero->depth_max_mm > INCISE_CUT_END_MM)
		return incise_error_set(
			err, EBUSY,
			"%s: the blade was %.1f mm deep while the zero of the "
			"force channel was measured; %s",
			rec->path, zero->depth_max_mm, remedy);
	if (zero->clipped)
		return incise_error_set(
			err, EBUSY,
			"%s: the force channel was at the end of its range while "
			"its zero was measured; check the amplifier; %s",
			rec->path, remedy);
	if (sd_N > ZERO_SD_MAX_N)
		return incise_error_set(
			err, EBUSY,
			"%s: the force varied by %.3f N (sd; up to %.2f is rest) "
			"while its zero was measured; %s",
			rec->path, sd_N, ZERO_SD_MAX_N, remedy);
	rec->worthless = false;
	rec->stats.zero_mV = code_mV(rec, mean);
	if (set_real(rec, "force_zero_mV", rec->stats.zero_mV) != SQLITE_OK ||
	    set_real(rec, "force_zero_sd_mV", sd_mV) != SQLITE_OK ||
	    set_integer(rec, "force_zero_samples", zero->n) != SQLITE_OK ||
	    note(rec, "zero", "force zero %.2f mV, sd %.2f mV over %lld samples",
		 rec->stats.zero_mV, sd_mV, (long long)zero->n) != SQLITE_OK)
		return fail_write(rec, err);
	return 0;
}

/* The tracker's records come later than the force's: wait until it has had its say. */
static bool zero_due(const struct incise_recorder *rec)
{
	int64_t end_ns = rec->force.first_ns + ZERO_NS;

	return isnan(rec->stats.zero_mV) && rec->force.begun &&
	       rec->force.timeline.last_ns >= end_ns &&
	       (rec->zero.tracker_ns >= end_ns ||
		rec->force.timeline.last_ns >= rec->force.first_ns + ZERO_PATIENCE_NS);
}

int incise_recorder_poll(struct incise_recorder *rec, struct incise_error *err)
{
	int64_t now = incise_clock_now(incise_rig_clock(rec->rig));
	int rc;

	if (rec->failed)
		return incise_error_set(err, -rec->failed, "%s: has failed before",
					rec->path);
	rc = take_force(rec, err);
	if (!rc)
		rc = take_tracker(rec, err);
	if (!rc && zero_due(rec))
		rc = settle_zero(rec, err);
	if (!rc && now - rec->commit_ns >= COMMIT_NS)
		rc = commit(rec, now, err);
	rec->failed = rc;
	return rc;
}

void incise_recorder_stats(const struct incise_recorder *rec,
			   struct incise_recorder_stats *stats)
{
	*stats = rec->stats;
	/* Rows whose window is still open are as good as written: closing writes them. */
	stats->depth += rec->depth.n - rec->depth.done;
}

/* --- end -------------------------------------------------------------------------- */

/* Write what is still held back, and that nothing is missing. */
static int complete(struct incise_recorder *rec, struct incise_error *err)
{
	struct incise_depth_row row;
	int rc = 0;

	/* A recording shorter than the time for the zero makes do with what it has. */
	if (isnan(rec->stats.zero_mV) && rec->force.begun)
		rc = settle_zero(rec, err);
	while (!rc && incise_depth_flush(&rec->depth, &row))
		rc = put_depth(rec, &row, err);
	if (!rc && (note(rec, "end", "recording ended") != SQLITE_OK ||
		    set_integer(rec, "complete", 1) != SQLITE_OK))
		rc = fail_write(rec, err);
	if (!rc)
		rc = commit(rec, rec->commit_ns, err);
	if (rc)
		return rc;
	/*
	 * One file that stands alone. Someone who is reading it now keeps SQLite from
	 * folding the log in; then the log stays beside it, which is as good.
	 */
	if (sqlite3_exec(rec->db,
			 "COMMIT; PRAGMA synchronous=FULL; PRAGMA journal_mode=DELETE",
			 NULL, NULL, NULL) != SQLITE_OK &&
	    sqlite3_errcode(rec->db) != SQLITE_BUSY &&
	    sqlite3_errcode(rec->db) != SQLITE_LOCKED)
		return fail_write(rec, err);
	return 0;
}

static int give_name(struct incise_recorder *rec, struct incise_error *err)
{
	const char *part = rec->part + (rec->name - rec->path);
	int rc = fsync(rec->folder) && errno != EINVAL ? -errno : 0;

	if (!rc &&
	    renameat2(rec->parent, part, rec->parent, rec->name, RENAME_NOREPLACE)) {
		rc = -errno;
		/* File systems without that flag; rename(2) too replaces no full folder. */
		if (rc == -EINVAL || rc == -ENOSYS)
			rc = renameat(rec->parent, part, rec->parent, rec->name) ? -errno
										 : 0;
	}
	if (!rc)
		rc = sync_parent(rec);
	if (rc)
		return incise_error_set(
			err, -rc,
			"%s: %s; the recording is complete but stays under the "
			"name %s",
			rec->path, strerror(-rc), rec->part);
	return 0;
}

int incise_recorder_close(struct incise_recorder *rec, struct incise_error *err)
{
	int rc;

	if (!rec)
		return 0;
	rc = rec->failed;
	if (rc)
		incise_error_set(
			err, -rc, "%s: not completed: %s; %s%s", rec->path, strerror(-rc),
			rec->worthless ? "nothing was kept" : "what was committed is in ",
			rec->worthless ? "" : rec->part);
	else
		rc = complete(rec, err);
	close_database(rec);
	if (!rc)
		rc = give_name(rec, err);
	if (rec->worthless)
		remove_folder(rec);
	recorder_free(rec);
	if (rc)
		errno = -rc;
	return rc;
}
