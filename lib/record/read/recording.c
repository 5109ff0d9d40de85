// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading a recording; see incise/recording.h. Nothing in the file is trusted: it may be
 * cut short, altered or made to deceive.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "cut.h"
#include "recording.h"
#include "../schema.h"

#define COUNT_MAX (1LL << 53)

/* --- table meta ------------------------------------------------------------------- */

/*
 * Run @take on the value of a key. Returns 0, -EINVAL (absent and not @optional, or not
 * taken), -errno.
 */
static int meta(struct incise_recording *rec, const char *key,
		int (*take)(sqlite3_stmt *stmt, void *to), void *to, bool optional,
		struct incise_error *err)
{
	sqlite3_stmt *stmt;
	int rc;

	if (sqlite3_prepare_v2(rec->db, "SELECT value FROM meta WHERE key = ?", -1, &stmt,
			       NULL) != SQLITE_OK)
		return incise_schema_fail(rec->db, rec->path, err);
	sqlite3_bind_text(stmt, 1, key, -1, SQLITE_STATIC);
	rc = sqlite3_step(stmt);
	if (rc == SQLITE_ROW && !take(stmt, to))
		rc = 0;
	else if (rc == SQLITE_DONE && optional)
		rc = 0;
	else if (rc == SQLITE_ROW || rc == SQLITE_DONE)
		rc = incise_error_set(
			err, EINVAL, "%s: damaged: '%s' in table meta is %s", rec->path,
			key, rc == SQLITE_ROW ? "no value it can have" : "missing");
	else
		rc = incise_schema_fail(rec->db, rec->path, err);
	sqlite3_finalize(stmt);
	return rc;
}

/* As calibration.conf has it. */
#define TIP_MAX_MM 1e6

struct text {
	char *to;
	size_t size;
};

static int take_text(sqlite3_stmt *stmt, void *to)
{
	struct text *text = to;
	/* Before the text is asked for, which makes one of anything. */
	int type = sqlite3_column_type(stmt, 0);
	const char *value = (const char *)sqlite3_column_text(stmt, 0);
	size_t n;

	if (type != SQLITE_TEXT || !value)
		return -EINVAL;
	n = strnlen(value, text->size - 1);
	memcpy(text->to, value, n);
	text->to[n] = 0;
	for (char *c = text->to; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '?';
	return 0;
}

static int take_count(sqlite3_stmt *stmt, void *to)
{
	sqlite3_int64 value = sqlite3_column_int64(stmt, 0);

	if (sqlite3_column_type(stmt, 0) != SQLITE_INTEGER || value < 0 ||
	    value > COUNT_MAX)
		return -EINVAL;
	*(uint64_t *)to = value;
	return 0;
}

static int take_real(sqlite3_stmt *stmt, void *to)
{
	double value = sqlite3_column_double(stmt, 0);

	if (sqlite3_column_type(stmt, 0) != SQLITE_FLOAT || !isfinite(value))
		return -EINVAL;
	*(double *)to = value;
	return 0;
}

/* A number, or NULL for one that is not known. */
static int take_known(sqlite3_stmt *stmt, void *to)
{
	*(double *)to = NAN;
	return sqlite3_column_type(stmt, 0) == SQLITE_NULL ? 0 : take_real(stmt, to);
}

/* Recordings from before have none: the device's own tip is the blade's. */
static int read_tip(struct incise_recording *rec, struct incise_error *err)
{
	static const char *const keys[] = {"tip_x_mm", "tip_y_mm", "tip_z_mm"};
	int rc = 0;

	for (int i = 0; i < 3 && !rc; i++) {
		rc = meta(rec, keys[i], take_real, &rec->meta.tip_mm[i], true, err);
		if (!rc && !(fabs(rec->meta.tip_mm[i]) <= TIP_MAX_MM))
			rc = incise_error_set(err, EINVAL,
					      "%s: damaged: '%s' in table meta is %g, "
					      "which cannot be",
					      rec->path, keys[i], rec->meta.tip_mm[i]);
	}
	return rc;
}

static int read_meta(struct incise_recording *rec, struct incise_error *err)
{
	struct incise_recording_info *info = &rec->meta;
	struct text started = {info->started, sizeof(info->started)};
	struct text rig = {info->rig, sizeof(info->rig)};
	uint64_t complete = 0, bits = 0;
	const struct {
		const char *key;
		int (*take)(sqlite3_stmt *stmt, void *to);
		void *to;
	} items[] = {
		{"complete", take_count, &complete},
		{"started", take_text, &started},
		{"rig", take_text, &rig},
		{"force_bits", take_count, &bits},
		{"force_full_scale_V", take_real, &info->full_scale_V},
		{"force_mV_N", take_real, &info->force_mV_N},
		{"force_zero_mV", take_known, &info->zero_mV},
		{"depth_mm_px", take_real, &info->depth_mm_px},
		{"surface_point_x_mm", take_real, &info->surface_point_mm[0]},
		{"surface_point_y_mm", take_real, &info->surface_point_mm[1]},
		{"surface_point_z_mm", take_real, &info->surface_point_mm[2]},
		{"surface_normal_x", take_real, &info->surface_normal[0]},
		{"surface_normal_y", take_real, &info->surface_normal[1]},
		{"surface_normal_z", take_real, &info->surface_normal[2]},
		{"force_rows", take_count, &info->force},
		{"tracker_rows", take_count, &info->tracker},
		{"depth_rows", take_count, &rec->depth_rows},
		{"force_lost", take_count, &info->force_lost},
		{"tracker_lost", take_count, &info->tracker_lost},
		{"force_clipped", take_count, &info->force_clipped},
	};
	int rc = 0;

	for (size_t i = 0; i < sizeof(items) / sizeof(*items) && !rc; i++)
		rc = meta(rec, items[i].key, items[i].take, items[i].to, false, err);
	/* Recordings from before have none, and begin at 0 V. */
	if (!rc)
		rc = meta(rec, "force_offset_V", take_real, &info->offset_V, true, err);
	if (!rc)
		rc = read_tip(rec, err);
	if (rc)
		return rc;
	/* No converter has more than 31 bits; figures of 1e±9 keep all that follows finite. */
	if (bits < 1 || bits > 31 ||
	    !(info->full_scale_V > 1e-9 && info->full_scale_V < 1e9) ||
	    !(fabs(info->offset_V) < 1e9) ||
	    !(fabs(info->force_mV_N) > 1e-9 && fabs(info->force_mV_N) < 1e9) ||
	    fabs(info->zero_mV) > 1e12)
		return incise_error_set(
			err, EINVAL,
			"%s: damaged: the force channel in table meta has %llu "
			"bits, %g V from %g V, %g mV/N, zero %g mV, which cannot be",
			rec->path, (unsigned long long)bits, info->full_scale_V,
			info->offset_V, info->force_mV_N, info->zero_mV);
	info->bits = bits;
	info->depth = rec->depth_rows;
	info->complete = complete;
	return 0;
}

/* --- opening ----------------------------------------------------------------------- */

/* The folder that holds the recording: path, or path.part; no trailing slashes. */
static char *find_folder(const char *path, struct incise_error *err)
{
	size_t length = strlen(path);
	char *folder;
	struct stat st;

	while (length > 1 && path[length - 1] == '/')
		length--;
	if (asprintf(&folder, "%.*s.part", (int)length, path) < 0) {
		incise_error_set(err, ENOMEM, "%s: out of memory", path);
		return NULL;
	}
	folder[length] = 0;
	if (stat(folder, &st) && errno == ENOENT) {
		folder[length] = '.';
		if (stat(folder, &st) && errno == ENOENT) {
			incise_error_set(err, ENOENT, "%s: there is no such recording",
					 path);
			free(folder);
			return NULL;
		}
	}
	return folder;
}

static char *find_name(const char *folder)
{
	const char *slash = strrchr(folder, '/');
	char *name = strdup(slash && slash[1] ? slash + 1 : folder);
	static const char *const ends[] = {".part", ".rec"};

	for (int i = 0; i < 2 && name; i++) {
		size_t n = strlen(name), end = strlen(ends[i]);

		if (n > end && !strcmp(name + n - end, ends[i]))
			name[n - end] = 0;
	}
	return name;
}

/* Whether there is a log, which then has the newest pages, be the file as it may. */
static bool has_log(struct incise_recording *rec)
{
	const char *log = sqlite3_filename_wal(sqlite3_db_filename(rec->db, "main"));
	struct stat st;

	return log && !stat(log, &st) && st.st_size > 0;
}

/*
 * Whole pages: SQLite notices a missing page, but takes zeros for the missing end of the
 * last one. While the log is folded in, the end of the file may be in mid-page, as after a
 * disk that failed then.
 */
static int check_size(struct incise_recording *rec, struct incise_error *err)
{
	sqlite3_stmt *stmt = NULL;
	sqlite3_int64 page = 0;
	struct stat st;

	if (sqlite3_prepare_v2(rec->db, "PRAGMA page_size", -1, &stmt, NULL) ==
		    SQLITE_OK &&
	    sqlite3_step(stmt) == SQLITE_ROW)
		page = sqlite3_column_int64(stmt, 0);
	if (sqlite3_finalize(stmt) != SQLITE_OK || page < 1)
		return incise_schema_fail(rec->db, rec->path, err);
	if (!stat(sqlite3_db_filename(rec->db, "main"), &st) && st.st_size % page &&
	    !has_log(rec))
		return incise_error_set(
			err, EINVAL,
			"%s: damaged: its %s ends in mid-page: it was cut short, "
			"as by a copy that did not finish",
			rec->path, INCISE_SCHEMA_DB);
	return 0;
}

/* Until SQLite has read something it does not know what state a file was left in. */
static int read_something(sqlite3 *db)
{
	return sqlite3_exec(db, "SELECT 1 FROM sqlite_master", NULL, NULL, NULL);
}

/*
 * A recorder that was killed, or whose disk failed, in the moment when it gave up its log has
 * left a journal, and SQLite wants that rolled back by someone who may write.
 */
static void roll_back(const char *file)
{
	sqlite3 *db;

	if (sqlite3_open_v2(file, &db, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX,
			    NULL) == SQLITE_OK) {
		sqlite3_db_config(db, SQLITE_DBCONFIG_DEFENSIVE, 1, NULL);
		sqlite3_db_config(db, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, NULL);
		sqlite3_busy_timeout(db, 1000);
		read_something(db);
	}
	sqlite3_close(db);
}

static int open_read_only(const char *file, sqlite3 **db)
{
	int rc = sqlite3_open_v2(file, db, SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX,
				 NULL);

	if (rc == SQLITE_OK) {
		/* Nothing that stands in a file's schema is run. */
		sqlite3_db_config(*db, SQLITE_DBCONFIG_DEFENSIVE, 1, NULL);
		sqlite3_db_config(*db, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, NULL);
		sqlite3_busy_timeout(*db, 1000);
		sqlite3_extended_result_codes(*db, 1);
		rc = read_something(*db);
		sqlite3_extended_result_codes(*db, 0);
	}
	return rc;
}

static int open_database(struct incise_recording *rec, struct incise_error *err)
{
	char *file;
	struct stat st;
	int rc;

	if (asprintf(&file, "%s/%s", rec->path, INCISE_SCHEMA_DB) < 0)
		return incise_error_set(err, ENOMEM, "%s: out of memory", rec->path);
	if (stat(file, &st)) {
		rc = errno == ENOENT || errno == ENOTDIR ? EINVAL : errno;
		rc = incise_error_set(err, rc,
				      rc == EINVAL
					      ? "%s: no recording: it has no %s inside"
					      : "%s: its %s: %s",
				      rec->path, INCISE_SCHEMA_DB, strerror(errno));
	} else if (!S_ISREG(st.st_mode)) {
		rc = incise_error_set(err, EINVAL, "%s: no recording: its %s is no file",
				      rec->path, INCISE_SCHEMA_DB);
	} else if (access(file, R_OK)) {
		rc = incise_error_set(err, errno, "%s: %s", file, strerror(errno));
	} else {
		rc = open_read_only(file, &rec->db);
		if (rc == SQLITE_READONLY_ROLLBACK) {
			sqlite3_close(rec->db);
			rec->db = NULL;
			roll_back(file);
			rc = open_read_only(file, &rec->db);
		}
		if (rc != SQLITE_OK)
			rc = incise_schema_fail(rec->db, rec->path, err);
	}
	free(file);
	if (rc)
		return rc;
	/* Pages are checked as they are read. */
	if (sqlite3_exec(rec->db, "PRAGMA cell_size_check=ON; BEGIN", NULL, NULL, NULL))
		return incise_schema_fail(rec->db, rec->path, err);
	return 0;
}

struct incise_recording *incise_recording_open(const char *path, struct incise_error *err)
{
	struct incise_recording *rec = calloc(1, sizeof(*rec));
	int rc;

	if (!rec) {
		incise_error_set(err, ENOMEM, "%s: out of memory", path);
		return NULL;
	}
	rec->path = find_folder(path, err);
	rc = rec->path ? 0 : -errno;
	if (!rc) {
		rec->name = find_name(rec->path);
		if (!rec->name)
			rc = incise_error_set(err, ENOMEM, "%s: out of memory", path);
	}
	if (!rc)
		rc = open_database(rec, err);
	if (!rc)
		rc = incise_schema_check(rec->db, rec->path, &rec->form, err);
	if (!rc)
		rc = check_size(rec, err);
	if (!rc)
		rc = read_meta(rec, err);
	if (!rc)
		return rec;
	incise_recording_close(rec);
	errno = -rc;
	return NULL;
}

void incise_recording_close(struct incise_recording *rec)
{
	if (!rec)
		return;
	sqlite3_close(rec->db);
	free(rec->path);
	free(rec->name);
	free(rec);
}

/* --- info -------------------------------------------------------------------------- */

/* Rows of the tracker are not exported, so here is where they are checked. */
static int check_tracker(struct incise_recording *rec, struct incise_error *err)
{
	sqlite3_stmt *stmt;
	uint64_t rows = 0;
	int64_t last_ns = -1;
	int rc;

	if (sqlite3_prepare_v2(
		    rec->db,
		    "SELECT seq, t_ns, arrival_ns, status, x_mm, y_mm, z_mm, qw, qx, "
		    "qy, qz FROM tracker ORDER BY seq",
		    -1, &stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(rec->db, rec->path, err);
	while ((rc = sqlite3_step(stmt)) == SQLITE_ROW) {
		bool good = sqlite3_column_type(stmt, 1) == SQLITE_INTEGER &&
			    sqlite3_column_int64(stmt, 1) > last_ns &&
			    sqlite3_column_type(stmt, 2) == SQLITE_INTEGER &&
			    sqlite3_column_type(stmt, 3) == SQLITE_TEXT;

		for (int i = 4; i < 11; i++)
			good = good && sqlite3_column_type(stmt, i) == SQLITE_FLOAT &&
			       isfinite(sqlite3_column_double(stmt, i));
		if (!good) {
			rc = incise_error_set(
				err, EINVAL,
				"%s: damaged: table tracker, row %lld cannot be",
				rec->path, (long long)sqlite3_column_int64(stmt, 0));
			goto out;
		}
		last_ns = sqlite3_column_int64(stmt, 1);
		rows++;
	}
	if (rc != SQLITE_DONE)
		rc = incise_schema_fail(rec->db, rec->path, err);
	else if (rows != rec->meta.tracker)
		rc = incise_error_set(err, EINVAL,
				      "%s: damaged: table tracker has %llu rows of %llu",
				      rec->path, (unsigned long long)rows,
				      (unsigned long long)rec->meta.tracker);
	else
		rc = 0;
out:
	sqlite3_finalize(stmt);
	return rc;
}

int incise_recording_info(struct incise_recording *rec,
			  struct incise_recording_info *info, struct incise_error *err)
{
	struct incise_cut_sample sample;
	struct incise_cuts cuts;
	int rc = check_tracker(rec, err);

	*info = rec->meta;
	if (rc)
		return rc;
	rc = incise_recording_streams(rec, info->streams, err);
	if (rc < 0)
		return rc;
	info->n_streams = rc;
	rc = incise_cuts_open(&cuts, rec, err);
	if (rc)
		return rc;
	info->depth_max_mm = 0;
	info->force_max_N = 0;
	while ((rc = incise_cuts_next(&cuts, &sample, err)) > 0) {
		info->depth_max_mm = fmax(info->depth_max_mm, sample.depth_mm);
		info->force_max_N =
			fmax(info->force_max_N, sample.force_N); /* NaN: no zero */
	}
	info->cuts = cuts.cut.count;
	info->start_ns = cuts.first_ns;
	info->end_ns = cuts.last_ns;
	incise_cuts_close(&cuts);
	return rc;
}
