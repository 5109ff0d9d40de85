// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Opening an untrusted database without writing to it; see database.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <limits.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include "database.h"
#include "../frames.h"
#include "../schema.h"

#define COPIES 20
#define LOG_HEAD 32 /* bytes; they change when the log starts over */

/* --- what is there --- */

/* Beside the database: SQLite writes to them, maps them, or waits for them. */
enum beside { LOG, JOURNAL, INDEX, FRAMES, BESIDE };
static const char *const names[] = {INCISE_SCHEMA_DB "-wal", INCISE_SCHEMA_DB "-journal",
				    INCISE_SCHEMA_DB "-shm", INCISE_FRAMES_FILE};

struct found {
	char file[PATH_MAX];		 /* of the database */
	char beside[BESIDE][PATH_MAX];	 /* files, whether they are there or not */
	off_t size, beside_size[BESIDE]; /* 0: none */
	bool needs_log; /* by its head: SQLite makes one for it where there is none */
	bool cut;	/* it ends within a page */
};

/* A regular file, not by a link. A descriptor, or -errno. */
static int open_regular(const char *path)
{
	int fd = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
	struct stat st;

	if (fd < 0)
		return -errno;
	if (fstat(fd, &st) || !S_ISREG(st.st_mode)) {
		close(fd);
		return -EINVAL;
	}
	return fd;
}

static int find_beside(struct found *found, const char *path, struct incise_error *err)
{
	struct stat st;

	for (int i = 0; i < BESIDE; i++) {
		if (lstat(found->beside[i], &st)) {
			if (errno != ENOENT)
				return incise_error_set(err, errno, "%s: %s",
							found->beside[i],
							strerror(errno));
			continue;
		}
		if (!S_ISREG(st.st_mode))
			return incise_error_set(
				err, EINVAL,
				"%s: its %s is a %s, which no recorder makes; remove it",
				path, names[i],
				S_ISLNK(st.st_mode) ? "link" : "device, pipe or folder");
		found->beside_size[i] = st.st_size;
	}
	return 0;
}

static int find_files(struct found *found, const char *path, struct incise_error *err)
{
	static const char magic[16] = "SQLite format 3";
	unsigned char head[20];
	struct stat st;
	off_t page;
	int fd;

	*found = (struct found){.size = 0};
	if (snprintf(found->file, PATH_MAX, "%s/%s", path, INCISE_SCHEMA_DB) >= PATH_MAX)
		return incise_error_set(err, ENAMETOOLONG, "%s: %s", path,
					strerror(ENAMETOOLONG));
	for (int i = 0; i < BESIDE; i++)
		if (snprintf(found->beside[i], PATH_MAX, "%s/%s", path, names[i]) >=
		    PATH_MAX)
			return incise_error_set(err, ENAMETOOLONG, "%s: %s", path,
						strerror(ENAMETOOLONG));
	if (stat(found->file, &st))
		return errno == ENOENT || errno == ENOTDIR
			       ? incise_error_set(err, EINVAL,
						  "%s: not a recording: it has no %s "
						  "inside",
						  path, INCISE_SCHEMA_DB)
			       : incise_error_set(err, errno, "%s: its %s: %s", path,
						  INCISE_SCHEMA_DB, strerror(errno));
	if (!S_ISREG(st.st_mode))
		return incise_error_set(err, EINVAL,
					"%s: not a recording: its %s is not "
					"a file",
					path, INCISE_SCHEMA_DB);
	fd = open(found->file, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
	if (fd < 0)
		return incise_error_set(err, errno, "%s: %s", found->file,
					strerror(errno));
	found->size = st.st_size;
	if (pread(fd, head, sizeof(head), 0) == (ssize_t)sizeof(head) &&
	    !memcmp(head, magic, sizeof(magic))) {
		page = head[16] << 8 | head[17];
		page = page == 1 ? 65536 : page;
		found->cut = page && st.st_size % page;
		/* The versions that write and read it: 2 is one with a log. */
		found->needs_log = head[18] == 2 || head[19] == 2;
	}
	close(fd);
	return find_beside(found, path, err);
}

/* --- copies --- */

int incise_database_copy(int in, int out)
{
	char bytes[1 << 16];
	ssize_t n;

	while ((n = copy_file_range(in, NULL, out, NULL, 1 << 30, 0)) > 0)
		;
	if (!n)
		return 0;
	/* From one kind of file system to another the kernel does not copy. */
	if (errno != EXDEV && errno != EINVAL && errno != ENOSYS && errno != EOPNOTSUPP &&
	    errno != EINTR)
		return -errno;
	while ((n = read(in, bytes, sizeof(bytes))) != 0) {
		if (n < 0 && errno != EINTR)
			return -errno;
		for (ssize_t done = 0, put; done < n; done += put) {
			put = write(out, bytes + done, (size_t)(n - done));
			if (put < 0 && errno != EINTR)
				return -errno;
			put = put < 0 ? 0 : put;
		}
	}
	return 0;
}

/* Returns 0 or -errno. */
static int copy_file(int in, const char *to, mode_t mode)
{
	int out, rc;

	if (in < 0)
		return in;
	out = open(to, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, mode);
	rc = out < 0 ? -errno : incise_database_copy(in, out);
	if (out >= 0 && close(out) && !rc)
		rc = -errno;
	close(in);
	return rc;
}

int incise_database_bring(const char *from, const char *to)
{
	return copy_file(open_regular(from), to, 0666);
}

static void read_log_head(const char *log, char head[LOG_HEAD])
{
	int fd = open_regular(log);

	memset(head, 0, LOG_HEAD);
	if (fd < 0)
		return;
	if (pread(fd, head, LOG_HEAD, 0) != LOG_HEAD)
		memset(head, 0, LOG_HEAD);
	close(fd);
}

/*
 * A journal of SQLite may end in the name of a file that it removes when the journal is played. No recorder
 * writes one.
 */
static bool names_a_file(const char *journal)
{
	static const unsigned char magic[8] = {0xd9, 0xd5, 0x05, 0xf9,
					       0x20, 0xa1, 0x63, 0xd7};
	int fd = open_regular(journal);
	unsigned char end[8];
	struct stat st;
	bool does = true;

	if (fd < 0)
		return true;
	if (!fstat(fd, &st))
		does = st.st_size >= 16 &&
		       (pread(fd, end, sizeof(end), st.st_size - 8) != 8 ||
			!memcmp(end, magic, sizeof(end)));
	close(fd);
	return does;
}

/* Whether SQLite needs a file beside a database: of one that is being written its log alone. */
static bool needs(const struct found *found, enum beside with, bool written)
{
	return with == LOG ? written || found->beside_size[LOG]
			   : with == JOURNAL && !written && found->beside_size[JOURNAL];
}

/*
 * The database, and then what it needs. While the log has not started over, it has all pages that are
 * written to the database meanwhile. Returns 0, -EAGAIN (it did start over), -EPERM (a journal that is
 * none of a recorder's), -errno.
 */
static int try_copy(const struct found *from, const char *file, bool written)
{
	char before[LOG_HEAD], after[LOG_HEAD], copied[PATH_MAX + 20];
	int rc;

	read_log_head(from->beside[LOG], before);
	rc = copy_file(open(from->file, O_RDONLY | O_NONBLOCK | O_CLOEXEC), file, 0666);
	for (int i = LOG; i <= JOURNAL && !rc; i++) {
		if (!needs(from, i, written))
			continue;
		snprintf(copied, sizeof(copied), "%s%s", file,
			 names[i] + strlen(INCISE_SCHEMA_DB));
		rc = copy_file(open_regular(from->beside[i]), copied, 0666);
		if (!rc && i == JOURNAL && names_a_file(copied))
			rc = -EPERM;
	}
	read_log_head(from->beside[LOG], after);
	/* No log: the recording is just being closed, or does not have one yet. */
	if (rc == -ENOENT || (!rc && memcmp(before, after, LOG_HEAD)))
		return -EAGAIN;
	return rc;
}

/* SQLite detects the state of a file when it first reads from it. */
static int read_something(sqlite3 *db)
{
	return sqlite3_exec(db, "SELECT 1 FROM sqlite_master", NULL, NULL, NULL);
}

static int open_with(const char *file, sqlite3 **db, int flags, int busy_ms)
{
	int rc = sqlite3_open_v2(file, db, flags | SQLITE_OPEN_NOMUTEX, NULL);

	if (rc == SQLITE_OK) {
		/* No code of the file's schema is run. */
		sqlite3_db_config(*db, SQLITE_DBCONFIG_DEFENSIVE, 1, NULL);
		sqlite3_db_config(*db, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, NULL);
		sqlite3_busy_timeout(*db, busy_ms);
		sqlite3_extended_result_codes(*db, 1);
		rc = read_something(*db);
		sqlite3_extended_result_codes(*db, 0);
	}
	return rc;
}

static int open_read_only(const char *file, sqlite3 **db, int busy_ms)
{
	return open_with(file, db, SQLITE_OPEN_READONLY, busy_ms);
}

/* Fold the log in, or roll the journal back: a connection that may write does it when it first reads. */
static int close_copy(const char *file)
{
	sqlite3 *db;
	int rc = open_with(file, &db, SQLITE_OPEN_READWRITE, 0);

	if (rc == SQLITE_OK)
		rc = sqlite3_exec(db, "PRAGMA journal_mode=DELETE", NULL, NULL, NULL);
	sqlite3_close(db);
	return rc;
}

/* As often as the log starts over. 0 or -errno. */
static int copy_database(const struct found *from, const char *file, bool written)
{
	const struct timespec pause = {.tv_nsec = 10000000};
	int rc = -EAGAIN;

	for (int i = 0; i < COPIES && rc == -EAGAIN; i++) {
		if (i)
			nanosleep(&pause, NULL);
		rc = try_copy(from, file, written);
	}
	return rc;
}

/* Remove a copy, and what SQLite has made for it. */
static void remove_copy(const char *file)
{
	static const char *const ends[] = {"-wal", "-shm", "-journal", ""};
	char name[PATH_MAX + 20];

	for (int i = 0; i < 4; i++) {
		snprintf(name, sizeof(name), "%s%s", file, ends[i]);
		unlink(name);
	}
}

/*
 * Open a copy, which has no name then. An interrupt waits for that. Returns an SQLite code; SQLITE_BUSY
 * with a negative errno in @why: it cannot be copied.
 */
static int open_copy(const struct found *found, bool written, sqlite3 **db, int *why)
{
	const char *temporary = getenv("TMPDIR");
	char folder[PATH_MAX], copy[PATH_MAX + 20];
	int code = SQLITE_BUSY;
	sigset_t all, before;

	snprintf(folder, sizeof(folder), "%s/incise-read-XXXXXX",
		 temporary && *temporary ? temporary : "/tmp");
	sigfillset(&all);
	pthread_sigmask(SIG_BLOCK, &all, &before);
	*why = mkdtemp(folder) ? 0 : -errno;
	if (!*why) {
		snprintf(copy, sizeof(copy), "%s/copy.db", folder);
		*why = copy_database(found, copy, written);
		if (!*why && needs(found, JOURNAL, written))
			close_copy(copy);
		if (!*why)
			code = open_read_only(copy, db, 0);
		remove_copy(copy);
		rmdir(folder);
	}
	pthread_sigmask(SIG_SETMASK, &before, NULL);
	return code;
}

/* --- opening --- */

/* Without trailing slashes. */
char *incise_recording_folder(const char *path, struct incise_error *err)
{
	size_t length = strlen(path);
	char *folder;
	struct stat st;

	while (length > 1 && path[length - 1] == '/')
		length--;
	if (asprintf(&folder, "%.*s.part", (int)length, path) < 0) {
		incise_schema_no_memory(path, err);
		return NULL;
	}
	folder[length] = 0;
	if (stat(folder, &st) && errno == ENOENT) {
		folder[length] = '.';
		if (stat(folder, &st) && errno == ENOENT) {
			incise_error_set(err, ENOENT,
					 "%s: no such recording; check name and folder",
					 path);
			free(folder);
			return NULL;
		}
	}
	return folder;
}

bool incise_recording_is_written(const char *folder)
{
	int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
	bool is = fd >= 0 && flock(fd, LOCK_SH | LOCK_NB) && errno == EWOULDBLOCK;

	if (fd >= 0)
		close(fd);
	return is;
}

/* A line for a database that cannot be copied. */
static int say_why(const char *path, bool written, int why, struct incise_error *err)
{
	if (why == -EPERM)
		return incise_error_set(err, EINVAL,
					"%s: its " INCISE_SCHEMA_DB
					"-journal names another file, which none of a "
					"recorder does; it is not read",
					path);
	if (why == -EAGAIN)
		return incise_error_set(err, EBUSY,
					"%s: is being written faster than it can be "
					"copied for reading; wait for its end",
					path);
	return incise_error_set(
		err, -why,
		"%s: %s, and it cannot be copied for reading: %s; set "
		"TMPDIR to a folder with free space",
		path, written ? "is being written" : "its recorder was interrupted",
		strerror(-why));
}

int incise_database_open(const char *path, sqlite3 **db, struct incise_error *err)
{
	bool written = incise_recording_is_written(path);
	struct found found;
	int rc = find_files(&found, path, err), code = SQLITE_BUSY, why = 0;

	*db = NULL;
	if (rc)
		return rc;
	/* SQLite would read zeros for the missing end of the page. A log has it; a journal may. */
	if (found.cut && !written && !found.beside_size[LOG] &&
	    !found.beside_size[JOURNAL])
		return incise_error_set(
			err, EINVAL,
			"%s: damaged: its %s ends within a page: it was truncated, for "
			"example by an incomplete copy",
			path, INCISE_SCHEMA_DB);
	if (!written && !found.needs_log && !found.beside_size[LOG] &&
	    !found.beside_size[JOURNAL])
		code = open_read_only(found.file, db, 0);
	/* A recorder on a file system without locks of folders. */
	written = written || (*db && (code & 0xff) == SQLITE_BUSY);
	if (!written && !*db &&
	    found.size + found.beside_size[LOG] + found.beside_size[JOURNAL] >
		    INCISE_DATABASE_COPY_MAX)
		return incise_error_set(
			err, EFBIG,
			"%s: its recorder was interrupted, and it is too "
			"large to be copied for each reading: run 'incise "
			"recover %s -o NEW.rec'",
			path, path);
	if ((code & 0xff) == SQLITE_BUSY || code == SQLITE_READONLY_ROLLBACK) {
		sqlite3_close(*db);
		*db = NULL;
		code = open_copy(&found, written, db, &why);
		/* Held for a moment only, or just closed. */
		if (why == -EAGAIN && !find_files(&found, path, NULL) &&
		    !found.needs_log && !found.beside_size[LOG] &&
		    !found.beside_size[JOURNAL]) {
			why = 0;
			code = open_read_only(found.file, db, 1000);
		}
	}
	if (why || (code & 0xff) == SQLITE_BUSY)
		return say_why(path, written, why ? why : -EAGAIN, err);
	return code == SQLITE_OK ? 0 : incise_schema_fail(*db, path, err);
}

int incise_database_recover(const char *path, const char *file, struct incise_error *err)
{
	struct found found;
	int rc = find_files(&found, path, err), code = SQLITE_OK;

	if (rc)
		return rc;
	if (incise_recording_is_written(path))
		return incise_error_set(err, EBUSY,
					"%s: is being written; wait for its end", path);
	rc = copy_database(&found, file, false);
	if (!rc)
		code = close_copy(file);
	if (!rc && code == SQLITE_OK)
		return 0;
	remove_copy(file);
	return rc == -EPERM ? say_why(path, false, rc, err)
	       : rc	    ? incise_error_set(err, -rc, "%s: %s", file, strerror(-rc))
			    : incise_error_set(err, EINVAL, "%s: damaged: %s", path,
					       sqlite3_errstr(code));
}

static int remove_one(const char *path, const struct stat *st, int type, struct FTW *at)
{
	(void)st, (void)type, (void)at;
	return remove(path) && errno != ENOENT;
}

void incise_database_remove(const char *folder)
{
	nftw(folder, remove_one, 16, FTW_DEPTH | FTW_PHYS);
}
