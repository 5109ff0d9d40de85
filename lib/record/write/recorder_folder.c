// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The folder of a recording that is written, NAME.rec.part, locked, which becomes NAME.rec when
 * the recording is complete; and the free space of its disk. See recorder.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>
#include "../schema.h"
#include "recorder.h"

/* Reserved for the log that is folded in at the end, and for other writers. */
#define RESERVED_BYTES 16e6
/* Reserved for frames in memory, and for data that arrive before the next look. */
#define RESERVED_S 5.0
#define LOOK_NS 1000000000LL
/* Files grow in steps: their rate is measured over this time at least. */
#define RATE_NS 2000000000LL

/* Bytes of a row in the file, and of the blocks of a stream each second; tests/unit/record/recorder.c. */
#define FORCE_BYTES 2.0
#define TRACKER_BYTES 84.0
#define BLOCKS_BYTES 3000.0
#define FRAME_BYTES 145.0
/* Size of a frame in camera.mkv, an upper estimate. */
#define LOSSLESS_SHARE 0.85
#define JPEG_BYTES_PIXEL 0.35

static const char *const files[] = {INCISE_SCHEMA_DB, INCISE_SCHEMA_DB "-wal",
				    INCISE_FRAMES_FILE, INCISE_SCHEMA_DB "-shm",
				    INCISE_SCHEMA_DB "-journal"};
/* The first INCISE_RECORDER_GROWING of them grow, and only that. */

/* --- folder -------------------------------------------------------------------------- */

int incise_recorder_split_path(struct incise_recorder *rec, const char *path,
			       struct incise_error *err)
{
	size_t length = strlen(path);
	char *slash, *parent;

	while (length > 1 && path[length - 1] == '/')
		length--;
	rec->path = strndup(path, length);
	if (!rec->path || asprintf(&rec->part, "%s.part", rec->path) < 0) {
		rec->part = NULL;
		return incise_schema_no_memory(path, err);
	}
	slash = strrchr(rec->path, '/');
	rec->name = slash ? slash + 1 : rec->path;
	if (!*rec->name || !strcmp(rec->name, ".") || !strcmp(rec->name, ".."))
		return incise_error_set(err, EINVAL, "'%s': not a name for a recording",
					path);
	parent = slash ? strndup(rec->path, slash - rec->path + 1) : strdup(".");
	rec->parent = parent ? open(parent, O_PATH | O_DIRECTORY | O_CLOEXEC) : -1;
	if (rec->parent < 0)
		incise_error_set(err, errno, "%s: %s; %s", parent ? parent : rec->path,
				 strerror(errno),
				 errno == ENOENT ? "make this folder first"
						 : "give another folder");
	free(parent);
	return rec->parent < 0 ? -errno : 0;
}

int incise_recorder_make_folder(struct incise_recorder *rec, struct incise_error *err)
{
	const char *part = rec->part + (rec->name - rec->path);
	struct stat st;

	if (!fstatat(rec->parent, rec->name, &st, AT_SYMLINK_NOFOLLOW))
		return incise_error_set(
			err, EEXIST,
			"%s: exists; record under another name, or replace it with "
			"--overwrite",
			rec->path);
	if (mkdirat(rec->parent, part, 0777)) {
		if (errno == EEXIST)
			return incise_error_set(
				err, EEXIST,
				"%s: left by an interrupted recording, or being "
				"written; `incise info` reads it; rename it, or "
				"replace it with --overwrite",
				rec->part);
		return incise_error_set(err, errno, "%s: cannot be made: %s", rec->part,
					strerror(errno));
	}
	rec->folder = openat(rec->parent, part, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	if (rec->folder < 0) {
		int code = errno;

		unlinkat(rec->parent, part, AT_REMOVEDIR); /* it is empty */
		return incise_error_set(err, code, "%s: %s", rec->part, strerror(code));
	}
	flock(rec->folder, LOCK_EX | LOCK_NB); /* some file systems have no locks */
	return 0;
}

/* A descriptor of O_PATH cannot be synced. */
int incise_recorder_sync_parent(struct incise_recorder *rec)
{
	int fd = openat(rec->parent, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	int rc = fd < 0 || fsync(fd) ? -errno : 0;

	if (fd >= 0)
		close(fd);
	/* Ignore a folder that may be written but not read, or one that cannot be synced. */
	return rc == -EACCES || rc == -EINVAL ? 0 : rc;
}

void incise_recorder_remove_folder(struct incise_recorder *rec)
{
	for (size_t i = 0; i < sizeof(files) / sizeof(*files); i++)
		unlinkat(rec->folder, files[i], 0);
	unlinkat(rec->parent, rec->part + (rec->name - rec->path), AT_REMOVEDIR);
}

int incise_recorder_rename_folder(struct incise_recorder *rec, struct incise_error *err)
{
	const char *part = rec->part + (rec->name - rec->path);
	int rc = fsync(rec->folder) && errno != EINVAL ? -errno : 0;

	if (!rc &&
	    renameat2(rec->parent, part, rec->parent, rec->name, RENAME_NOREPLACE)) {
		rc = -errno;
		/* Without that flag: rename(2) does not replace a folder with files either. */
		if (rc == -EINVAL || rc == -ENOSYS)
			rc = renameat(rec->parent, part, rec->parent, rec->name) ? -errno
										 : 0;
	}
	if (!rc)
		rc = incise_recorder_sync_parent(rec);
	if (rc)
		return incise_error_set(
			err, -rc,
			"%s: %s; the recording is complete but keeps the name %s",
			rec->path, strerror(-rc), rec->part);
	return 0;
}

/*
 * --- free space: enough at the start for the planned time, and always enough to end ----------
 *
 *     |◄──────────────── free ────────────────►|
 *     |◄── may be written ──►|◄─── reserved ──►|    log of the database, frames in memory
 */

static int free_bytes(const struct incise_recorder *rec, double *bytes)
{
	struct statvfs disk;

	if (fstatvfs(rec->folder, &disk))
		return -errno;
	*bytes = (double)disk.f_bavail * (double)disk.f_frsize;
	return 0;
}

/* Bytes per second, by the nominal rates of the devices, which may be NULL. */
static double rate_of(const struct incise_tracker_info *tracker,
		      const struct incise_force_info *force,
		      const struct incise_camera_info *camera)
{
	double bytes_s = (force ? force->rate_hz * FORCE_BYTES + BLOCKS_BYTES : 0) +
			 (tracker ? tracker->rate_hz * TRACKER_BYTES + BLOCKS_BYTES : 0);
	double row =
		camera ? (double)incise_frames_row(camera->pixels, camera->width) : 0;

	if (camera)
		bytes_s += camera->rate_hz *
			   (FRAME_BYTES +
			    (row > 0 ? row * LOSSLESS_SHARE
				     : (double)camera->width * JPEG_BYTES_PIXEL) *
				    camera->height);
	return isfinite(bytes_s) && bytes_s > 0 ? bytes_s : 0;
}

static double expected_rate(const struct incise_recorder *rec)
{
	return rate_of(&rec->tracker_info, &rec->force_info,
		       rec->streams[INCISE_LEDGER_CAMERA].exists ? &rec->camera_info
								 : NULL);
}

static double reserved(double bytes_s)
{
	return RESERVED_BYTES + RESERVED_S * bytes_s;
}

double incise_recorder_capacity_s(double free_bytes,
				  const struct incise_tracker_info *tracker,
				  const struct incise_force_info *force,
				  const struct incise_camera_info *camera)
{
	double bytes_s = rate_of(tracker, force, camera);

	return bytes_s > 0 ? fmax(0, (free_bytes - reserved(bytes_s)) / bytes_s)
			   : INFINITY;
}

int incise_recorder_check_space(struct incise_recorder *rec, double planned_s,
				struct incise_error *err)
{
	double bytes_s = expected_rate(rec), usable;
	int rc = free_bytes(rec, &rec->disk.free_bytes);

	if (rc)
		return incise_error_set(err, -rc, "%s: %s", rec->part, strerror(-rc));
	usable = rec->disk.free_bytes - reserved(bytes_s);
	rec->stats.bytes_per_s = bytes_s;
	rec->stats.disk_s = bytes_s > 0 ? fmax(0, usable / bytes_s) : INFINITY;
	if (usable >= planned_s * bytes_s)
		return 0;
	if (usable <= 0)
		return incise_error_set(
			err, ENOSPC,
			"%s: the disk has %.0f MB free, but %.0f MB are reserved to "
			"end a recording; free disk space, or record to another disk",
			rec->path, rec->disk.free_bytes / 1e6, reserved(bytes_s) / 1e6);
	return incise_error_set(
		err, ENOSPC,
		"%s: %.0f s of this rig take about %.0f MB, but the disk has %.0f MB, "
		"enough for %.0f s; free disk space, or record for a shorter time",
		rec->path, planned_s, planned_s * bytes_s / 1e6, usable / 1e6,
		usable / bytes_s);
}

/* --- what others do to the files ------------------------------------------------------- */

/* Written on where it was cut off, a file is as long as before, with a hole. */
static bool has_hole(const struct incise_recorder *rec, const char *file)
{
	int fd = openat(rec->folder, file, O_RDONLY | O_CLOEXEC);
	off_t hole = fd < 0 ? -1 : lseek(fd, 0, SEEK_HOLE);
	struct stat st;
	bool has = hole >= 0 && !fstat(fd, &st) && hole < st.st_size;

	if (fd >= 0)
		close(fd);
	return has;
}

int incise_recorder_check_files(const struct incise_recorder *rec,
				struct incise_error *err)
{
	const char *part = rec->part + (rec->name - rec->path);
	struct stat st;

	/* A folder that is removed has no links, one that is moved still has. */
	if (fstatat(rec->parent, part, &st, AT_SYMLINK_NOFOLLOW) && errno == ENOENT &&
	    !fstat(rec->folder, &st))
		return incise_error_set(
			err, EIO,
			"%s: was %s by another program during the recording: %s",
			rec->part, st.st_nlink ? "moved" : "removed",
			!st.st_nlink	 ? "no data remain of the recording"
			: rec->worthless ? "no data were kept"
					 : "the committed data are at its new place");
	for (int i = 0; i < INCISE_RECORDER_GROWING; i++) {
		const char *what = NULL;

		if (!rec->seen[i].is)
			continue;
		if (fstatat(rec->folder, files[i], &st, AT_SYMLINK_NOFOLLOW))
			what = "removed";
		else if (st.st_ino != rec->seen[i].inode)
			what = "replaced";
		else if (st.st_size < rec->seen[i].size ||
			 (i == INCISE_RECORDER_LOG && has_hole(rec, files[i])))
			what = "cut off";
		if (!what)
			continue;
		return incise_error_set(
			err, EIO,
			"%s/%s: was %s by another program during the recording: its "
			"rows are lost; `incise verify %s` lists the remaining data",
			rec->part, files[i], what, rec->part);
	}
	return 0;
}

void incise_recorder_see_files(struct incise_recorder *rec)
{
	struct stat st;

	for (int i = 0; i < INCISE_RECORDER_GROWING; i++) {
		rec->seen[i].is =
			!fstatat(rec->folder, files[i], &st, AT_SYMLINK_NOFOLLOW);
		if (!rec->seen[i].is)
			continue;
		rec->seen[i].inode = st.st_ino;
		rec->seen[i].size = st.st_size;
	}
}

/* Bytes of the files of this recording. */
static double written(const struct incise_recorder *rec)
{
	double bytes = 0;
	struct stat st;

	for (int i = 0; i < INCISE_RECORDER_GROWING; i++)
		if (!fstatat(rec->folder, files[i], &st, AT_SYMLINK_NOFOLLOW))
			bytes += (double)st.st_size;
	return bytes;
}

bool incise_recorder_disk_full(struct incise_recorder *rec)
{
	struct incise_recorder_disk *disk = &rec->disk;
	int64_t now_ns = incise_clock_now(incise_rig_clock(rec->rig));
	double usable;

	if (now_ns - disk->asked_ns < LOOK_NS || free_bytes(rec, &disk->free_bytes))
		return false;
	disk->asked_ns = now_ns;
	if (!rec->stats.armed && !disk->started_ns)
		disk->started_ns = now_ns;
	else if (disk->started_ns && now_ns - disk->started_ns >= RATE_NS)
		rec->stats.bytes_per_s =
			written(rec) / ((double)(now_ns - disk->started_ns) * 1e-9);
	usable = disk->free_bytes - reserved(rec->stats.bytes_per_s);
	rec->stats.disk_s = rec->stats.bytes_per_s > 0
				    ? fmax(0, usable / rec->stats.bytes_per_s)
				    : INFINITY;
	return usable <= 0;
}
