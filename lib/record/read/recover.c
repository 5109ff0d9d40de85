// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A copy of an interrupted recording that is read like any other: its database without log and journal, and
 * all else that is in its folder, bit for bit; see incise/recording.h. One of an older format is then
 * converted in place, see ../write/convert.c.
 *
 *     OLD.rec.part/                                NEW.rec/
 *       recording.db, -wal or -journal   ──▶        recording.db
 *       camera.mkv, calibration/…, seal/…  ──▶      the same
 */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "database.h"
#include "recording.h"
#include "../schema.h"

static bool is_hidden(const char *name)
{
	return !strcmp(name, ".") || !strcmp(name, "..");
}

static int bring_folder(const char *from, const char *to, bool top,
			struct incise_error *err);

static int bring(const char *from, const char *to, bool top, struct incise_error *err)
{
	struct stat st;
	int rc;

	if (lstat(from, &st))
		return incise_error_set(err, errno, "%s: %s", from, strerror(errno));
	if (top && S_ISDIR(st.st_mode)) {
		if (mkdir(to, 0777))
			return incise_error_set(err, errno, "%s: cannot be made: %s", to,
						strerror(errno));
		return bring_folder(from, to, false, err);
	}
	if (!S_ISREG(st.st_mode))
		return incise_error_set(err, EINVAL,
					"%s: no file: no recorder makes it; remove it",
					from);
	rc = incise_database_bring(from, to);
	return rc ? incise_error_set(err, -rc, "%s: cannot be written: %s", to,
				     strerror(-rc))
		  : 0;
}

/* All but the database. A recording has folders of files, and these have none. */
static int bring_folder(const char *from, const char *to, bool top,
			struct incise_error *err)
{
	DIR *folder = opendir(from);
	struct dirent *entry;
	int rc = 0;

	if (!folder)
		return incise_error_set(err, errno, "%s: %s", from, strerror(errno));
	while (!rc && (entry = readdir(folder))) {
		const char *name = entry->d_name;
		char *old = NULL, *new = NULL;

		if (is_hidden(name) ||
		    (top && !strncmp(name, INCISE_SCHEMA_DB, strlen(INCISE_SCHEMA_DB))))
			continue;
		if (asprintf(&old, "%s/%s", from, name) < 0 ||
		    asprintf(&new, "%s/%s", to, name) < 0)
			rc = incise_schema_no_memory(from, err);
		else
			rc = bring(old, new, top, err);
		free(old);
		free(new);
	}
	closedir(folder);
	return rc;
}

static int recover_to(const char *from, const char *to, bool damaged,
		      struct incise_recovered *made, struct incise_error *err)
{
	char *file;
	int rc;

	if (asprintf(&file, "%s/%s", to, INCISE_SCHEMA_DB) < 0)
		return incise_schema_no_memory(to, err);
	rc = incise_database_recover(from, file, err);
	free(file);
	if (!rc)
		rc = bring_folder(from, to, true, err);
	if (!rc)
		rc = incise_recording_convert(to, from, damaged, made, err);
	return rc ? rc : incise_recording_try(to, err);
}

int incise_recording_recover(const char *path, const char *output, bool damaged,
			     struct incise_recovered *made, struct incise_error *err)
{
	char *folder, *part;
	int rc = 0;

	*made = (struct incise_recovered){0};
	if (!access(output, F_OK))
		return incise_error_set(err, EEXIST, "%s: exists; give another name",
					output);
	folder = incise_recording_folder(path, err);
	if (!folder)
		return -errno;
	if (asprintf(&part, "%s.part", output) < 0) {
		free(folder);
		return incise_schema_no_memory(output, err);
	}
	if (mkdir(part, 0777))
		rc = incise_error_set(err, errno,
				      "%s: cannot be made: %s; give another name", part,
				      strerror(errno));
	if (!rc) {
		rc = recover_to(folder, part, damaged, made, err);
		if (!rc && rename(part, output))
			rc = incise_error_set(err, errno, "%s: %s", output,
					      strerror(errno));
		if (rc)
			incise_database_remove(part);
	}
	free(part);
	free(folder);
	return rc;
}
