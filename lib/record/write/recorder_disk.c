// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Room on the disk of a recording that is written: enough at the start for the planned time,
 * and always enough to end in; see recorder.h.
 *
 *     |◄──────────────── free ────────────────►|
 *     |◄── may be written ──►|◄─── kept back ─►|    log of the database, pictures in memory
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include "recorder.h"
#include "../schema.h"

/* The log that is folded in at the end, and a margin for who else writes there. */
#define KEPT_BYTES 16e6
/* Pictures that wait in memory, and what comes until it is noticed. */
#define KEPT_S 5.0
#define LOOK_NS 1000000000LL
/* Files grow by leaps: a rate of them is told no sooner. */
#define RATE_NS 2000000000LL

/* Bytes of a row in the file, with its part of the pages; tests/unit/record/recorder_disk.c. */
#define FORCE_BYTES 18.0
#define TRACKER_BYTES 180.0 /* and of its row in table depth */
#define FRAME_BYTES 110.0
/* Of the bytes of a picture, as it is in camera.mkv; generous. */
#define FFV1_SHARE 0.75
#define JPEG_BYTES_PIXEL 0.35

static int free_bytes(const struct incise_recorder *rec, double *bytes)
{
	struct statvfs disk;

	if (fstatvfs(rec->folder, &disk))
		return -errno;
	*bytes = (double)disk.f_bavail * (double)disk.f_frsize;
	return 0;
}

/* What the devices will fill in a second, by what they say of themselves. */
static double expected(const struct incise_recorder *rec)
{
	const struct incise_camera_info *camera = &rec->camera_info;
	double bytes_s = rec->force_info.rate_hz * FORCE_BYTES +
			 rec->tracker_info.rate_hz * TRACKER_BYTES;
	double pixels = (double)camera->width * camera->height;
	double row = (double)incise_frames_row(camera->pixels, camera->width);

	if (rec->streams[INCISE_LEDGER_CAMERA].there)
		bytes_s += camera->rate_hz *
			   (FRAME_BYTES + (row > 0 ? row * camera->height * FFV1_SHARE
						   : pixels * JPEG_BYTES_PIXEL));
	return isfinite(bytes_s) && bytes_s > 0 ? bytes_s : 0;
}

static double kept(double bytes_s)
{
	return KEPT_BYTES + KEPT_S * bytes_s;
}

int incise_recorder_preflight(struct incise_recorder *rec, double planned_s,
			      struct incise_error *err)
{
	double bytes_s = expected(rec), usable;
	int rc = free_bytes(rec, &rec->disk.free_bytes);

	if (rc)
		return incise_error_set(err, -rc, "%s: %s", rec->part, strerror(-rc));
	usable = rec->disk.free_bytes - kept(bytes_s);
	rec->stats.bytes_per_s = bytes_s;
	rec->stats.disk_s = bytes_s > 0 ? fmax(0, usable / bytes_s) : INFINITY;
	if (usable >= planned_s * bytes_s)
		return 0;
	if (usable <= 0)
		return incise_error_set(
			err, ENOSPC,
			"%s: the disk has %.0f MB free, and %.0f MB are kept back to end "
			"a recording in; make room, or record to another disk",
			rec->path, rec->disk.free_bytes / 1e6, kept(bytes_s) / 1e6);
	return incise_error_set(
		err, ENOSPC,
		"%s: %.0f s of this rig take some %.0f MB, and the disk has %.0f MB for "
		"it: enough for %.0f s; make room, or record for a shorter time",
		rec->path, planned_s, planned_s * bytes_s / 1e6, usable / 1e6,
		usable / bytes_s);
}

/* Bytes of the files of this recording. */
static double written(const struct incise_recorder *rec)
{
	static const char *const files[] = {INCISE_SCHEMA_DB, INCISE_SCHEMA_DB "-wal",
					    INCISE_FRAMES_FILE};
	double bytes = 0;
	struct stat st;

	for (size_t i = 0; i < sizeof(files) / sizeof(*files); i++)
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
	if (!rec->stats.armed && !disk->begun_ns)
		disk->begun_ns = now_ns;
	else if (disk->begun_ns && now_ns - disk->begun_ns >= RATE_NS)
		rec->stats.bytes_per_s =
			written(rec) / ((double)(now_ns - disk->begun_ns) * 1e-9);
	usable = disk->free_bytes - kept(rec->stats.bytes_per_s);
	rec->stats.disk_s = rec->stats.bytes_per_s > 0
				    ? fmax(0, usable / rec->stats.bytes_per_s)
				    : INFINITY;
	return usable <= 0;
}
