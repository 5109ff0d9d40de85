// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The folder of a recording that is written: NAME.rec.part, locked, which becomes NAME.rec
 * when it is whole; see recorder.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include "recorder.h"
#include "../schema.h"

/* Split the path into its folder, kept open, and its name. */
int incise_recorder_take_path(struct incise_recorder *rec, const char *path,
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
int incise_recorder_make_folder(struct incise_recorder *rec, struct incise_error *err)
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
int incise_recorder_sync_parent(struct incise_recorder *rec)
{
	int fd = openat(rec->parent, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	int rc = fd < 0 || fsync(fd) ? -errno : 0;

	if (fd >= 0)
		close(fd);
	/* A folder that may be written but not listed, or one that cannot be synced. */
	return rc == -EACCES || rc == -EINVAL ? 0 : rc;
}

/* Remove NAME.rec.part; only files that a recorder makes. */
void incise_recorder_remove_folder(struct incise_recorder *rec)
{
	static const char *const files[] = {INCISE_SCHEMA_DB, INCISE_SCHEMA_DB "-wal",
					    INCISE_SCHEMA_DB "-shm",
					    INCISE_SCHEMA_DB "-journal",
					    INCISE_FRAMES_FILE};

	for (size_t i = 0; i < sizeof(files) / sizeof(*files); i++)
		unlinkat(rec->folder, files[i], 0);
	unlinkat(rec->parent, rec->part + (rec->name - rec->path), AT_REMOVEDIR);
}

int incise_recorder_give_name(struct incise_recorder *rec, struct incise_error *err)
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
		rc = incise_recorder_sync_parent(rec);
	if (rc)
		return incise_error_set(
			err, -rc,
			"%s: %s; the recording is complete but stays under the "
			"name %s",
			rec->path, strerror(-rc), rec->part);
	return 0;
}
