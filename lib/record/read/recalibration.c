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
#include <unistd.h>
#include <incise/infile.h>
#include "../../base/crypto/sha256.h"
#include "../schema.h"
#include "database.h"
#include "recalibration.h"
#include "session.h"

#define DELAY_MAX_NS 1e12 /* a quarter of an hour; shifts do not overflow */

const struct incise_infile_kind incise_recalibration_kind = {
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

bool incise_recalibration_parse(const char *name, struct incise_recalibration *entry)
{
	const char *end = name + strlen("0001-20261127T054012Z"), *d = name + 5;

	if (!has_form(name, "dddd-ddddddddTddddddZ.") ||
	    (strcmp(end, ".conf") && strcmp(end, ".original")))
		return false;
	*entry = (struct incise_recalibration){.original = !strcmp(end, ".original")};
	snprintf(entry->file, sizeof(entry->file), INCISE_RECALIBRATION_FOLDER "/%s",
		 name);
	snprintf(entry->date, sizeof(entry->date), "%.4s-%.2s-%.2sT%.2s:%.2s:%.2sZ", d,
		 d + 4, d + 6, d + 9, d + 11, d + 13);
	return true;
}

static int compare_recalibration(const void *a, const void *b)
{
	return strcmp(((const struct incise_recalibration *)a)->file,
		      ((const struct incise_recalibration *)b)->file);
}

/* --- the folder ---------------------------------------------------------------------- */

/* A link would lead out of the recording. */
int incise_recalibration_folder(const char *folder, struct incise_error *err)
{
	char *path;
	int fd;

	if (asprintf(&path, "%s/" INCISE_RECALIBRATION_FOLDER, folder) < 0)
		return incise_schema_no_memory(folder, err);
	fd = open(path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
	if (fd < 0 && errno != ENOENT)
		incise_error_set(err, errno, "%s: %s", path,
				 errno == ENOTDIR ? "a link or file, which no recorder "
						    "makes; remove it"
						  : strerror(errno));
	free(path);
	return fd < 0 ? -errno : fd;
}

int incise_recalibration_list(const char *folder, struct incise_recalibration **list,
			      struct incise_error *err)
{
	int fd = incise_recalibration_folder(folder, err),
	    n = fd < 0 && fd != -ENOENT ? fd : 1;
	struct dirent *found;
	DIR *dir = fd < 0 ? NULL : fdopendir(fd);

	*list = calloc(1, sizeof(**list));
	if (!*list || (fd >= 0 && !dir))
		n = incise_schema_no_memory(folder, err);
	while (dir && n > 0 && (found = readdir(dir))) {
		struct incise_recalibration entry, *more;

		if (!incise_recalibration_parse(found->d_name, &entry))
			continue;
		more = realloc(*list, (size_t)(n + 1) * sizeof(*more));
		if (!more) {
			n = incise_schema_no_memory(folder, err);
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
	qsort(*list, (size_t)n, sizeof(**list), compare_recalibration);
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
		incise_schema_no_memory(folder, err);
		return NULL;
	}
	text = incise_infile_read(path, &incise_recalibration_kind, &size, err);
	free(path);
	if (text && incise_sha256_text(text, size, entry->sha256)) {
		free(text);
		incise_schema_no_memory(folder, err);
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
	n = incise_recalibration_list(folder, list, err);
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
static int run_recalibration(struct incise_recording *rec, char *sql,
			     struct incise_error *err)
{
	int rc = SQLITE_NOMEM;

	if (sql)
		rc = sqlite3_exec(rec->db, sql, NULL, NULL, NULL);
	sqlite3_free(sql);
	if (rc == SQLITE_OK)
		return 0;
	return sql ? incise_schema_fail(rec->db, rec->path, err)
		   : incise_schema_no_memory(rec->path, err);
}

static int put_recalibration_number(struct incise_recording *rec, const char *key,
				    double value, struct incise_error *err)
{
	if (isnan(value))
		return 0;
	return run_recalibration(
		rec,
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
	int rc = run_recalibration(
		rec,
		sqlite3_mprintf("CREATE TEMP TABLE meta(key TEXT PRIMARY KEY NOT "
				"NULL, value); "
				"INSERT INTO temp.meta SELECT key, value FROM "
				"main.meta; "
				"INSERT OR REPLACE INTO temp.meta "
				"VALUES('calibration_conf', %Q)",
				text),
		err);

	for (size_t i = 0; i < sizeof(numbers) / sizeof(*numbers) && !rc; i++)
		rc = put_recalibration_number(rec, numbers[i].key, numbers[i].value, err);
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
static int load_recalibration(struct incise_recording *rec,
			      struct incise_recalibrated *to, struct incise_error *err)
{
	struct incise_error why = {0};
	char *path;
	int rc;

	to->calibration = own_calibration(&rec->meta);
	if (asprintf(&path, "%s/%s", rec->path, to->entry.file) < 0)
		return incise_schema_no_memory(rec->path, err);
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
	int n = incise_recalibration_list(rec->path, &list, err), rc = n < 0 ? n : 0;
	char *text = NULL;

	if (rc || list[0].active)
		goto out;
	rec->recalibrated = calloc(1, sizeof(*rec->recalibrated));
	if (!rec->recalibrated) {
		rc = incise_schema_no_memory(rec->path, err);
		goto out;
	}
	rec->recalibrated->entry = list[n - 1];
	text = read_text(rec->path, &rec->recalibrated->entry, err);
	rc = text ? load_recalibration(rec, rec->recalibrated, err) : -errno;
	if (!rc)
		rc = put_meta(rec, &rec->recalibrated->calibration, text, err);
out:
	free(text);
	free(list);
	return rc;
}

/* The delay of a stream by a calibration, and its uncertainty; NAN: it has none. */
static void find_delay(const struct incise_calibration *c, int stream, double *ms,
		       double *sd_ms)
{
	const double delays[][2] = {
		[INCISE_LEDGER_FORCE] = {c->force_delay_ms, c->force_delay_sd_ms},
		[INCISE_LEDGER_TRACKER] = {c->tracker_delay_ms, c->tracker_delay_sd_ms},
		[INCISE_LEDGER_CAMERA] = {c->camera_delay_ms, c->camera_delay_sd_ms},
		[INCISE_LEDGER_WALL] = {NAN, NAN},
	};

	*ms = delays[stream][0];
	*sd_ms = delays[stream][1];
}

void incise_recalibration_shift(const struct incise_calibration *calibration,
				const struct incise_stream_source *source,
				int64_t *shift_ns, double *variance_ns2)
{
	double old_ns = isnan(source->delay_ns) ? 0 : source->delay_ns;
	double old_sd_ns = isnan(source->delay_sd_ns) ? 0 : source->delay_sd_ns;
	double ms, sd_ms;

	find_delay(calibration, source->stream, &ms, &sd_ms);
	if (isnan(ms))
		return;
	*shift_ns = (int64_t)fmax(fmin(old_ns - ms * 1e6, DELAY_MAX_NS), -DELAY_MAX_NS);
	if (!isnan(sd_ms))
		*variance_ns2 = sd_ms * 1e6 * sd_ms * 1e6 - old_sd_ns * old_sd_ns;
}

void incise_recalibration_stream(const struct incise_calibration *calibration,
				 struct incise_stream *stream)
{
	double ms = NAN, sd_ms = NAN,
	       old_sd_ms = isnan(stream->delay_sd_ms) ? 0 : stream->delay_sd_ms;

	for (int i = 0; i < INCISE_LEDGER_STREAMS; i++)
		if (!strcmp(stream->name, incise_ledger_forms[i].stream))
			find_delay(calibration, i, &ms, &sd_ms);
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
