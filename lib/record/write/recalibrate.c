// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Giving a recording another calibration; see incise/recalibration.h.
 */
#include <errno.h>
#include <fcntl.h>
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
#include "../read/database.h"
#include "../read/recalibration.h"
#include "../read/session.h"
#include "../schema.h"

#define NUMBER_MAX 9999

static int number_of_recalibrate(const struct incise_recalibration *entry)
{
	return *entry->file ? atoi(entry->file + strlen(INCISE_RECALIBRATION_FOLDER "/"))
			    : 0;
}

/* A recording that can be recalibrated. Returns 0 or -errno. */
static int check_recalibrate(const char *path, struct incise_error *err)
{
	struct incise_recording *rec =
		incise_recording_open_as(path, INCISE_RECORDING_ORIGINAL, err);
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
	int number = number_of_recalibrate(last) + 1;

	if (number > NUMBER_MAX)
		return incise_error_set(err, E2BIG,
					"%s: has %d calibrations, the most that a "
					"recording can have",
					path, NUMBER_MAX);
	strftime(date, sizeof(date), "%Y%m%dT%H%M%SZ", gmtime_r(&now, &utc));
	snprintf(name, sizeof(name), "%04d-%.16s.%s", number, date,
		 original ? "original" : "conf");
	if (!incise_recalibration_parse(name, made))
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
		return incise_schema_no_memory(folder, err);
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

	if (asprintf(&path, "%s/" INCISE_RECALIBRATION_FOLDER, folder) < 0)
		return incise_schema_no_memory(folder, err);
	if (make && mkdir(path, 0777) && errno != EEXIST)
		fd = incise_error_set(err, errno, "%s: %s", path, strerror(errno));
	else
		fd = incise_recalibration_folder(folder, err);
	free(path);
	if (fd >= 0)
		flock(fd, LOCK_EX); /* some file systems have no locks */
	return fd;
}

static int add_recalibrate(const char *folder, const char *calibration,
			   struct incise_recalibration *made, struct incise_error *err)
{
	struct incise_recalibration *list = NULL;
	size_t size = 0;
	char *text = calibration
			     ? incise_infile_read(calibration, &incise_recalibration_kind,
						  &size, err)
			     : NULL;
	int fd, n = 0, rc = calibration && !text ? -errno : 0;

	if (rc)
		return rc;
	fd = lock_folder(folder, text, err);
	if (fd >= 0 || fd == -ENOENT)
		n = incise_recalibration_list(folder, &list, err);
	rc = n > 0 ? 0 : n < 0 ? n : fd;
	if (!rc && !calibration && list[0].active)
		rc = incise_error_set(err, EALREADY,
				      "%s: the calibration of the capture is active "
				      "already; give -c FILE for another",
				      folder);
	if (!rc)
		rc = next_name(folder, &list[n - 1], !calibration, made, err);
	if (!rc && text && incise_sha256_text(text, size, made->sha256))
		rc = incise_schema_no_memory(folder, err);
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
		rc = check_recalibrate(path, err);
	if (rc)
		return rc;
	folder = incise_recording_folder(path, err);
	if (!folder)
		return -errno;
	rc = add_recalibrate(folder, calibration, &entry, err);
	free(folder);
	if (!rc && made)
		*made = entry;
	errno = rc ? -rc : errno;
	return rc;
}
