// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Calibrations of a recording after the fact; see incise/recalibration.h and recalibration.h. The
 * files are untrusted. Names that are not of their form are no calibrations.
 */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <incise/infile.h>
#include <incise/outfile.h>
#include "../../base/crypto/sha256.h"
#include "../schema.h"
#include "recalibration.h"
#include "session.h"

#define FOLDER "calibration"
#define NUMBER_MAX 9999

/* As the recorder keeps of one: with the history of years. */
static const struct incise_infile_kind file_kind = {
	.name = "a calibration of a recording",
	.advice = "give a calibration.conf of incise calibrate",
	.size_max = 1 << 20,
	.regular = true,
};

/* --- names --------------------------------------------------------------------------- */

static bool has_form(const char *text, const char *form)
{
	for (; *form; form++, text++)
		if (*form == 'd' ? *text < '0' || *text > '9' : *text != *form)
			return false;
	return true;
}

/* "0001-20261127T054012Z.conf"; false: no calibration. */
static bool parse_name(const char *name, struct incise_recalibration *entry)
{
	const char *end = name + strlen("0001-20261127T054012Z"), *d = name + 5;

	if (!has_form(name, "dddd-ddddddddTddddddZ.") ||
	    (strcmp(end, ".conf") && strcmp(end, ".original")))
		return false;
	*entry = (struct incise_recalibration){.original = !strcmp(end, ".original")};
	snprintf(entry->file, sizeof(entry->file), FOLDER "/%s", name);
	snprintf(entry->date, sizeof(entry->date), "%.4s-%.2s-%.2sT%.2s:%.2s:%.2sZ", d,
		 d + 4, d + 6, d + 9, d + 11, d + 13);
	return true;
}

static int number_of(const struct incise_recalibration *entry)
{
	return *entry->file ? atoi(entry->file + strlen(FOLDER "/")) : 0;
}

static int compare(const void *a, const void *b)
{
	return strcmp(((const struct incise_recalibration *)a)->file,
		      ((const struct incise_recalibration *)b)->file);
}

/* --- the folder ---------------------------------------------------------------------- */

static int no_memory(const char *path, struct incise_error *err)
{
	return incise_error_set(err, ENOMEM, "%s: out of memory", path);
}

/* A link would lead out of the recording. -ENOENT is no error. */
static int open_folder(const char *folder, struct incise_error *err)
{
	char *path;
	int fd;

	if (asprintf(&path, "%s/" FOLDER, folder) < 0)
		return no_memory(folder, err);
	fd = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
	if (fd < 0 && errno != ENOENT)
		incise_error_set(err, errno, "%s: %s", path,
				 errno == ENOTDIR ? "a link or file, which no recorder "
						    "makes; remove it"
						  : strerror(errno));
	free(path);
	return fd < 0 ? -errno : fd;
}

/* The entries of the folder behind that of the capture, in order; returns how many there are. */
static int read_folder(const char *folder, struct incise_recalibration **list,
		       struct incise_error *err)
{
	int fd = open_folder(folder, err), n = fd < 0 && fd != -ENOENT ? fd : 1;
	struct dirent *found;
	DIR *dir = fd < 0 ? NULL : fdopendir(fd);

	*list = calloc(1, sizeof(**list));
	if (!*list || (fd >= 0 && !dir))
		n = no_memory(folder, err);
	while (dir && n > 0 && (found = readdir(dir))) {
		struct incise_recalibration entry, *more;

		if (!parse_name(found->d_name, &entry))
			continue;
		more = realloc(*list, (size_t)(n + 1) * sizeof(*more));
		if (!more) {
			n = no_memory(folder, err);
			break;
		}
		*list = more;
		more[n++] = entry;
	}
	if (dir)
		closedir(dir);
	else if (fd >= 0)
		close(fd);
	if (n <= 0)
		return n;
	/* The name of the first one is empty. */
	qsort(*list, (size_t)n, sizeof(**list), compare);
	(*list)[(*list)[n - 1].original ? 0 : n - 1].active = true;
	return n;
}

/* The text of a calibration in a recording, with its digest; to be freed; NULL with errno. */
static char *read_text(const char *folder, struct incise_recalibration *entry,
		       struct incise_error *err)
{
	char *path, *text;
	size_t size;

	if (asprintf(&path, "%s/%s", folder, entry->file) < 0) {
		no_memory(folder, err);
		return NULL;
	}
	text = incise_infile_read(path, &file_kind, &size, err);
	free(path);
	if (text && incise_sha256_text(text, size, entry->sha256)) {
		free(text);
		no_memory(folder, err);
		return NULL;
	}
	return text;
}

int incise_recalibrations(const char *path, struct incise_recalibration **list,
			  struct incise_error *err)
{
	char *folder = incise_recording_folder(path, err);
	int n;

	*list = NULL;
	if (!folder)
		return -errno;
	n = read_folder(folder, list, err);
	for (int i = 1; i < n; i++)
		if (!(*list)[i].original) {
			char *text = read_text(folder, &(*list)[i], err);

			if (!text)
				n = -errno;
			free(text);
		}
	free(folder);
	if (n > 0)
		return n;
	free(*list);
	*list = NULL;
	errno = -n;
	return n;
}

/* --- reading by the active one -------------------------------------------------------- */

/* Returns 0 or -errno. */
static int run(struct incise_recording *rec, char *sql, struct incise_error *err)
{
	int rc = SQLITE_NOMEM;

	if (sql)
		rc = sqlite3_exec(rec->db, sql, NULL, NULL, NULL);
	sqlite3_free(sql);
	if (rc == SQLITE_OK)
		return 0;
	return sql ? incise_schema_fail(rec->db, rec->path, err)
		   : no_memory(rec->path, err);
}

static int put_number(struct incise_recording *rec, const char *key, double value,
		      struct incise_error *err)
{
	if (isnan(value))
		return 0;
	return run(rec,
		   sqlite3_mprintf("INSERT OR REPLACE INTO temp.meta VALUES(%Q, %!.17g)",
				   key, value),
		   err);
}

/* Make table meta of this connection, which comes before that of recording.db. */
static int put_meta(struct incise_recording *rec,
		    const struct incise_calibration *calibration, const char *text,
		    struct incise_error *err)
{
	const struct {
		const char *key;
		double value;
	} numbers[] = {
		{"force_mV_N", calibration->force_mV_N},
		{"force_zero_mV", calibration->force_zero_mV},
		{"depth_mm_px", calibration->depth_mm_px},
		{"tip_x_mm", calibration->tip_mm[0]},
		{"tip_y_mm", calibration->tip_mm[1]},
		{"tip_z_mm", calibration->tip_mm[2]},
	};
	int rc = run(rec,
		     sqlite3_mprintf("CREATE TEMP TABLE meta(key TEXT PRIMARY KEY NOT "
				     "NULL, value); "
				     "INSERT INTO temp.meta SELECT key, value FROM "
				     "main.meta; "
				     "INSERT OR REPLACE INTO temp.meta "
				     "VALUES('calibration_conf', %Q)",
				     text),
		     err);

	for (size_t i = 0; i < sizeof(numbers) / sizeof(*numbers) && !rc; i++)
		rc = put_number(rec, numbers[i].key, numbers[i].value, err);
	return rc;
}

/* The values of the capture; delays that are NAN are in table streams. */
static struct incise_calibration own_calibration(const struct incise_recording_info *meta)
{
	struct incise_calibration own;

	incise_calibration_nominal(&own);
	own.force_mV_N = meta->force_mV_N;
	own.force_zero_mV = meta->zero_mV;
	own.depth_mm_px = meta->depth_mm_px;
	memcpy(own.tip_mm, meta->tip_mm, sizeof(own.tip_mm));
	return own;
}

/* The values of a calibration in the folder, over those of the capture. */
static int load(struct incise_recording *rec, struct incise_recalibrated *to,
		struct incise_error *err)
{
	struct incise_error why = {0};
	char *path;
	int rc;

	to->calibration = own_calibration(&rec->meta);
	if (asprintf(&path, "%s/%s", rec->path, to->entry.file) < 0)
		return no_memory(rec->path, err);
	rc = incise_calibration_update(path, &to->calibration, &why);
	free(path);
	if (rc)
		return incise_error_set(
			err, -rc,
			"%s; `incise recalibrate %s --original` goes back "
			"to the calibration of the capture",
			why.text, rec->path);
	/* A device in newtons was not calibrated in mV/N. */
	if (rec->meta.newtons) {
		to->calibration.force_mV_N = rec->meta.force_mV_N;
		to->calibration.force_zero_mV = rec->meta.zero_mV;
	}
	/* Depth is a difference of two lengths in pixels: linear in the scale. */
	to->depth_scale = to->calibration.depth_mm_px / rec->meta.depth_mm_px;
	if (!isfinite(to->depth_scale))
		to->depth_scale = 1;
	return 0;
}

int incise_recalibration_apply(struct incise_recording *rec, struct incise_error *err)
{
	struct incise_recalibration *list = NULL;
	int n = read_folder(rec->path, &list, err), rc = n < 0 ? n : 0;
	char *text = NULL;

	if (rc || list[0].active)
		goto out;
	rec->recalibrated = calloc(1, sizeof(*rec->recalibrated));
	if (!rec->recalibrated) {
		rc = no_memory(rec->path, err);
		goto out;
	}
	rec->recalibrated->entry = list[n - 1];
	text = read_text(rec->path, &rec->recalibrated->entry, err);
	rc = text ? load(rec, rec->recalibrated, err) : -errno;
	if (!rc)
		rc = put_meta(rec, &rec->recalibrated->calibration, text, err);
out:
	free(text);
	free(list);
	return rc;
}

void incise_recalibration_stream(const struct incise_recording *rec,
				 struct incise_stream *stream)
{
	const struct incise_calibration *c;
	double ms, sd_ms,
		old_sd_ms = isnan(stream->delay_sd_ms) ? 0 : stream->delay_sd_ms;

	if (!rec->recalibrated)
		return;
	c = &rec->recalibrated->calibration;
	if (!strcmp(stream->name, "force"))
		ms = c->force_delay_ms, sd_ms = c->force_delay_sd_ms;
	else if (!strcmp(stream->name, "tracker"))
		ms = c->tracker_delay_ms, sd_ms = c->tracker_delay_sd_ms;
	else
		ms = c->camera_delay_ms, sd_ms = c->camera_delay_sd_ms;
	if (isnan(ms))
		return;
	stream->offset_ms += ms - stream->delay_ms;
	stream->delay_ms = ms;
	if (isnan(sd_ms))
		return;
	stream->offset_sd_ms = sqrt(fmax(stream->offset_sd_ms * stream->offset_sd_ms -
						 old_sd_ms * old_sd_ms + sd_ms * sd_ms,
					 0));
	stream->delay_sd_ms = sd_ms;
}

char *incise_recalibration_text(const struct incise_recording *rec)
{
	const struct incise_recalibration *entry;
	char *text;

	if (!rec->recalibrated)
		return strdup("of the recording");
	entry = &rec->recalibrated->entry;
	return asprintf(&text, "recalibrated %s by %s, SHA-256 %s", entry->date,
			entry->file, entry->sha256) < 0
		       ? NULL
		       : text;
}

void incise_recording_recalibration(const struct incise_recording *rec,
				    struct incise_recalibration *active)
{
	const struct incise_session *session = rec->session;

	*active = (struct incise_recalibration){.active = true};
	if (rec->recalibrated)
		*active = rec->recalibrated->entry;
	for (int i = 0; session && i < session->n && !*active->file; i++) {
		const struct incise_recalibrated *of = session->members[i]->recalibrated;

		if (!of)
			continue;
		*active = of->entry;
		snprintf(active->file, sizeof(active->file), "%.63s/%.90s",
			 session->info[i].name, of->entry.file);
	}
}

/* --- recalibrating -------------------------------------------------------------------- */

/* A recording that can be recalibrated. Returns 0 or -errno. */
static int check(const char *path, struct incise_error *err)
{
	struct incise_recording *rec = incise_recording_open_original(path, err);
	int rc = 0;

	if (!rec)
		return -errno;
	if (rec->session)
		rc = incise_error_set(err, EINVAL,
				      "%s: is a joined recording, whose members have "
				      "calibrations of their own; give one of them, for "
				      "example %s",
				      path, rec->session->members[0]->path);
	else if (!rec->meta.complete && incise_recording_is_written(rec->path))
		rc = incise_error_set(
			err, EBUSY, "%s: is being recorded; wait for its end", rec->path);
	incise_recording_close(rec);
	return rc;
}

/* The name of the next entry; @list has at least one. */
static int next_name(const char *path, const struct incise_recalibration *last,
		     bool original, struct incise_recalibration *made,
		     struct incise_error *err)
{
	const time_t now = time(NULL);
	char date[32], name[64];
	struct tm utc;
	int number = number_of(last) + 1;

	if (number > NUMBER_MAX)
		return incise_error_set(err, E2BIG,
					"%s: has %d calibrations, the most that a "
					"recording can have",
					path, NUMBER_MAX);
	strftime(date, sizeof(date), "%Y%m%dT%H%M%SZ", gmtime_r(&now, &utc));
	snprintf(name, sizeof(name), "%04d-%.16s.%s", number, date,
		 original ? "original" : "conf");
	if (!parse_name(name, made))
		return incise_error_set(
			err, EINVAL, "%s: the wall clock is at %s; set it", path, date);
	made->active = true;
	return 0;
}

static int write_entry(const char *folder, const struct incise_recalibration *entry,
		       const char *text, size_t size, struct incise_error *err)
{
	struct incise_outfile *out;
	char *path;

	if (asprintf(&path, "%s/%s", folder, entry->file) < 0)
		return no_memory(folder, err);
	out = incise_outfile_open(path, err);
	free(path);
	if (!out)
		return -errno;
	/* A failed write is found by the commit. */
	fwrite(text, 1, size, incise_outfile_stream(out));
	return incise_outfile_commit(out, err);
}

/* Two that add at once would take one number; the lock ends with the file that is returned. */
static int lock_folder(const char *folder, bool make, struct incise_error *err)
{
	char *path;
	int fd;

	if (asprintf(&path, "%s/" FOLDER, folder) < 0)
		return no_memory(folder, err);
	if (make && mkdir(path, 0777) && errno != EEXIST)
		fd = incise_error_set(err, errno, "%s: %s", path, strerror(errno));
	else
		fd = open_folder(folder, err);
	free(path);
	if (fd >= 0)
		flock(fd, LOCK_EX); /* some file systems have no locks */
	return fd;
}

static int add(const char *folder, const char *calibration,
	       struct incise_recalibration *made, struct incise_error *err)
{
	struct incise_recalibration *list = NULL;
	size_t size = 0;
	char *text = calibration ? incise_infile_read(calibration, &file_kind, &size, err)
				 : NULL;
	int fd, n = 0, rc = calibration && !text ? -errno : 0;

	if (rc)
		return rc;
	fd = lock_folder(folder, text, err);
	if (fd >= 0 || fd == -ENOENT)
		n = read_folder(folder, &list, err);
	rc = n > 0 ? 0 : n < 0 ? n : fd;
	if (!rc && !calibration && list[0].active)
		rc = incise_error_set(err, EALREADY,
				      "%s: the calibration of the capture is active "
				      "already; give -c FILE for another",
				      folder);
	if (!rc)
		rc = next_name(folder, &list[n - 1], !calibration, made, err);
	if (!rc && text && incise_sha256_text(text, size, made->sha256))
		rc = no_memory(folder, err);
	if (!rc)
		rc = write_entry(folder, made, text ? text : "", size, err);
	if (fd >= 0)
		close(fd);
	free(text);
	free(list);
	return rc;
}

int incise_recalibrate(const char *path, const char *calibration,
		       struct incise_recalibration *made, struct incise_error *err)
{
	struct incise_recalibration entry;
	struct incise_calibration values;
	char *folder;
	int rc = calibration ? incise_calibration_load(calibration, &values, err) : 0;

	if (!rc)
		rc = check(path, err);
	if (rc)
		return rc;
	folder = incise_recording_folder(path, err);
	if (!folder)
		return -errno;
	rc = add(folder, calibration, &entry, err);
	free(folder);
	if (!rc && made)
		*made = entry;
	errno = rc ? -rc : errno;
	return rc;
}
