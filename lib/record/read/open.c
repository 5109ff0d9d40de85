// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Opening a recording, or a joined one with the choice of its streams; see incise/recording.h.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../schema.h"
#include "database.h"
#include "recording.h"
#include "session.h"

/* The choice behind a session's name, "session.rec:CHOICE"; NULL: there is none. */
static const char *choice_of(const char *path)
{
	const char *slash = strrchr(path, '/'),
		   *colon = strrchr(slash ? slash : path, ':');

	return colon && colon > path ? colon + 1 : NULL;
}

/* The folder of a recording, or of a session with a choice behind its name: to be freed; NULL with errno. */
static char *find_any_folder(const char *path, const char **choice,
			     struct incise_error *err)
{
	char *start, *folder;

	*choice = choice_of(path);
	folder = incise_recording_folder(path, *choice ? NULL : err);
	if (folder || !*choice) {
		*choice = NULL;
		return folder;
	}
	start = strndup(path, (size_t)(*choice - 1 - path));
	folder = start ? incise_recording_folder(start, NULL) : NULL;
	free(start);
	/* Neither is there: the name is what was given. */
	return folder ? folder : incise_recording_folder(path, err);
}

/* Open the members; the path is then that under which the same is opened again. */
static int open_session(struct incise_recording *rec, const char *choice,
			struct incise_error *err)
{
	int rc = incise_session_open(rec, rec->path, choice ? choice : "", err);
	char *path;

	if (rc || !choice)
		return rc;
	if (asprintf(&path, "%s:%s", rec->path, choice) < 0)
		return incise_schema_no_memory(rec->path, err);
	free(rec->path);
	rec->path = path;
	return 0;
}

static struct incise_recording *open_path(const char *path, bool any,
					  enum incise_recording_how how,
					  struct incise_error *err)
{
	const char *choice;
	char *folder = find_any_folder(path, &choice, err);
	struct incise_recording *rec = folder ? incise_recording_new(folder) : NULL;
	int rc;

	if (folder && !rec)
		incise_schema_no_memory(path, err);
	if (!rec)
		return NULL;
	rc = incise_recording_read(rec, how, err);
	if (rc == 1)
		rc = open_session(rec, choice || !any ? choice : "*", err);
	else if (!rc && choice)
		rc = incise_error_set(err, EINVAL,
				      "%s: is one recording, not a joined one; give it "
				      "without ':%s'",
				      rec->path, choice);
	if (!rc)
		return rec;
	incise_recording_close(rec);
	errno = -rc;
	return NULL;
}

struct incise_recording *incise_recording_open(const char *path, struct incise_error *err)
{
	return open_path(path, false, INCISE_RECORDING_ACTIVE, err);
}

struct incise_recording *incise_recording_open_as(const char *path,
						  enum incise_recording_how how,
						  struct incise_error *err)
{
	return open_path(path, true, how, err);
}

int incise_recording_try(const char *path, struct incise_error *err)
{
	struct incise_recording *rec =
		open_path(path, true, INCISE_RECORDING_ACTIVE, err);

	if (!rec)
		return -errno;
	incise_recording_close(rec);
	return 0;
}

const char *incise_recording_name(const struct incise_recording *rec)
{
	return rec->name;
}

void incise_recording_close(struct incise_recording *rec)
{
	if (!rec)
		return;
	incise_session_close(rec->session);
	incise_recording_free(rec);
}
