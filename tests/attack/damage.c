// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Attacks on a recording that lies on a disk: some bytes of it are changed at random places,
 * a place at a time.
 *
 *     damage NAME.rec FILE COUNT SEED        FILE: recording.db or camera.mkv
 *
 * Verification must find it, unless the byte is in nothing that is read: then all rows and
 * frames are as before. In one process, so that a bad access under a sanitizer ends it.
 * Works in the current folder; prints a line at the end.
 */
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <sqlite3.h>
#include <incise/recording.h>
#include <incise/verify.h>
#include "../../lib/base/crc32c.h"
#include "../../lib/record/frames.h"

#define BYTES_MAX 8

static uint64_t random_state;

static uint64_t draw(uint64_t below)
{
	random_state ^= random_state << 13;
	random_state ^= random_state >> 7;
	random_state ^= random_state << 17;
	return random_state % below;
}

/* --- what can be read ------------------------------------------------------------- */

static int add_row(void *user, int n, char **values, char **names)
{
	uint32_t *crc = user;

	(void)names;
	for (int i = 0; i < n; i++)
		*crc = incise_crc32c(*crc, values[i] ? values[i] : "\1",
				     values[i] ? strlen(values[i]) + 1 : 1);
	return 0;
}

/* All rows, as the program sqlite3 would show them. False when one cannot be read. */
static bool read_rows(const char *folder, uint32_t *crc)
{
	static const char *const sql[] = {
		"PRAGMA application_id",
		"PRAGMA user_version",
		"SELECT type, name, tbl_name, sql FROM sqlite_master",
		"SELECT key, typeof(value), quote(value) FROM meta ORDER BY key",
		"SELECT stream, block, first_seq, last_seq, first_ns, last_ns, count, lost, crc, "
		"hex(sha256), hex(data) FROM blocks ORDER BY stream, block",
		"SELECT * FROM events ORDER BY rowid",
		"SELECT * FROM streams ORDER BY rowid",
		"SELECT * FROM knots ORDER BY stream, knot",
		"SELECT * FROM ledger ORDER BY stream, block",
		"SELECT number, t_ns, force, tracker, camera, wall, hex(head) FROM seal ORDER BY number",
	};
	char file[200];
	sqlite3 *db;
	bool good;

	*crc = 0;
	snprintf(file, sizeof(file), "%s/recording.db", folder);
	good = sqlite3_open_v2(file, &db, SQLITE_OPEN_READONLY, NULL) == SQLITE_OK;
	for (size_t i = 0; i < sizeof(sql) / sizeof(*sql) && good; i++)
		good = sqlite3_exec(db, sql[i], add_row, crc, NULL) == SQLITE_OK;
	sqlite3_close(db);
	return good;
}

static bool read_frames(const char *folder, uint32_t *crc)
{
	struct incise_frames_stored stored;
	struct incise_frames_reader *reader;
	struct incise_camera_frame frame;
	struct incise_error err = {0};
	char file[200];
	int rc;

	*crc = 0;
	snprintf(file, sizeof(file), "%s/" INCISE_FRAMES_FILE, folder);
	if (access(file, F_OK))
		return true;
	reader = incise_frames_reader_new(file, &err);
	if (!reader)
		return false;
	while ((rc = incise_frames_next(reader, &frame, &stored, &err)) == 1) {
		*crc = incise_crc32c(*crc, &frame.t_ns, sizeof(frame.t_ns));
		*crc = incise_crc32c(*crc, &frame.seq, sizeof(frame.seq));
		*crc = incise_crc32c(*crc, &frame.width, sizeof(frame.width));
		*crc = incise_crc32c(*crc, &frame.height, sizeof(frame.height));
		*crc = incise_crc32c(*crc, &frame.pixels, sizeof(frame.pixels));
		*crc = incise_crc32c(*crc, frame.data, frame.size);
		*crc = incise_crc32c(*crc, &stored.pts_ms, sizeof(stored.pts_ms));
		*crc = incise_crc32c(*crc, &stored.bytes, sizeof(stored.bytes));
		*crc = incise_crc32c(*crc, &stored.crc, sizeof(stored.crc));
	}
	incise_frames_reader_close(reader);
	return !rc;
}

/* --- attacks ---------------------------------------------------------------------- */

/* Somewhere: anywhere, in the first pages, or where a page says what it is. */
static off_t choose_in_database(off_t size)
{
	switch (draw(4)) {
	case 0:
		return draw(size < 8 * 4096 ? size : 8 * 4096);
	case 1:
		return draw(size / 4096) * 4096 + draw(12);
	default:
		return draw(size);
	}
}

/*
 * Somewhere: anywhere, in the file's head, or where one frame ends with its note and the
 * next starts with its number and time.
 */
static off_t choose_in_film(const uint8_t *bytes, off_t size)
{
	static const uint8_t cluster[] = {0x1f, 0x43, 0xb6, 0x75}; /* of Matroska */
	off_t from = draw(size);
	const uint8_t *at = memmem(bytes + from, size - from, cluster, sizeof(cluster));

	switch (draw(4)) {
	case 0:
		return draw(size < 600 ? size : 600);
	case 1:
		return from;
	default:
		from = at ? at - bytes : size;
		from += (off_t)draw(140) - 80;
		return from < 0 ? 0 : from < size ? from : size - 1;
	}
}

static uint8_t *load(const char *path, off_t *size)
{
	FILE *file = fopen(path, "r");
	uint8_t *bytes;
	struct stat st;

	if (!file || fstat(fileno(file), &st) || !st.st_size) {
		fprintf(stderr, "%s: %s\n", path, strerror(errno));
		exit(1);
	}
	*size = st.st_size;
	bytes = malloc(*size);
	if (!bytes || fread(bytes, 1, *size, file) != (size_t)*size) {
		fprintf(stderr, "%s cannot be read\n", path);
		exit(1);
	}
	fclose(file);
	return bytes;
}

static void save(const char *path, const uint8_t *bytes, off_t size)
{
	FILE *file = fopen(path, "w");

	if (!file || fwrite(bytes, 1, size, file) != (size_t)size || fclose(file)) {
		fprintf(stderr, "%s cannot be written\n", path);
		exit(1);
	}
}

static void run(const char *fmt, const char *name)
{
	char command[300];

	snprintf(command, sizeof(command), fmt, name);
	if (system(command)) {
		fprintf(stderr, "%s failed\n", command);
		exit(1);
	}
}

int main(int argc, char **argv)
{
	uint32_t rows, frames;
	int count, found = 0, unopened = 0, unused = 0;
	char path[200];
	uint8_t *good, *bytes;
	bool is_film;
	off_t size;

	if (argc != 5) {
		fprintf(stderr, "usage: damage NAME.rec FILE COUNT SEED\n");
		return 2;
	}
	count = atoi(argv[3]);
	random_state = strtoull(argv[4], NULL, 10) * 0x9e3779b97f4a7c15 | 1;
	fprintf(stderr, "damage %s %s %d, seed %s\n", argv[1], argv[2], count, argv[4]);
	if (!read_rows(argv[1], &rows) || !read_frames(argv[1], &frames)) {
		fprintf(stderr, "%s cannot be read\n", argv[1]);
		return 1;
	}
	run("rm -rf damaged.rec && cp -r %s damaged.rec", argv[1]);
	snprintf(path, sizeof(path), "damaged.rec/%s", argv[2]);
	good = load(path, &size);
	is_film = !strcmp(argv[2], INCISE_FRAMES_FILE);
	bytes = malloc(size);
	for (int i = 1; i <= count && bytes; i++) {
		off_t at =
			is_film ? choose_in_film(good, size) : choose_in_database(size);
		int n = 1 + (int)draw(BYTES_MAX), rc;
		struct incise_verify_report report;
		struct incise_error err = {0};
		struct incise_recording_info info;
		struct incise_recording *recording;
		uint32_t new_rows = 0, new_frames = 0;

		memcpy(bytes, good, size);
		for (int j = 0; j < n && at + j < size; j++)
			bytes[at + j] ^= 1 + draw(255);
		save(path, bytes, size);
		rc = incise_verify("damaged.rec", NULL, &report, &err);
		unopened += rc < 0;
		found += !rc && !report.complete;
		if (!rc && report.complete) {
			if (!read_rows("damaged.rec", &new_rows) ||
			    !read_frames("damaged.rec", &new_frames) ||
			    new_rows != rows || new_frames != frames) {
				fprintf(stderr,
					"place %d: %d bytes of %s at %lld are changed, and "
					"verify finds all complete: rows %08" PRIx32
					" %08" PRIx32 ", pictures %08" PRIx32
					" %08" PRIx32 "\n",
					i, n, argv[2], (long long)at, rows, new_rows,
					frames, new_frames);
				return 1;
			}
			unused++;
		}
		/* Reading it without verification must not crash either. */
		recording = incise_recording_open("damaged.rec", &err);
		if (recording)
			incise_recording_info(recording, &info, &err);
		incise_recording_close(recording);
		/* of a header that says that there is a log */
		run("cd %s && rm -f *-wal *-shm *-journal", "damaged.rec");
	}
	free(good);
	free(bytes);
	printf("%s: %d places, %d found, %d so that it does not open, %d in bytes that nobody "
	       "reads\n",
	       argv[2], count, found, unopened, unused);
	/* a short recording is half of pages that are not full */
	if (found + unopened < count / 4) {
		fprintf(stderr, "so few were found: were they changed at all?\n");
		return 1;
	}
	return 0;
}
