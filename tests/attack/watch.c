// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Loaded into a recording program by LD_PRELOAD: it notes what SQLite says is committed, and
 * lets writes to files below a folder *.rec* fail.
 *
 *     recorder ─ sqlite3_exec("COMMIT…") ─► noted in a page ─► attacker
 *     SQLite, libavformat ─ write, fsync ─► may fail ─► kernel
 *
 * ATTACK_PAGE is the file of struct watch_page. ATTACK_KIND is eio (an error, now and then),
 * sync (the same of fsync and its kin only), short (writes that do less than they were asked
 * for, and no error), enospc (a disk of ATTACK_BYTES), die (kill -9 before such a call).
 * ATTACK_AFTER calls go well first, then one of ATTACK_EVERY fails; ATTACK_LASTING 1: all
 * that follow as well. ATTACK_SEED chooses.
 */
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>
#include <sqlite3.h>
#include "../clock.h"
#include "watch.h"

static struct {
	pthread_mutex_t lock;
	struct watch_page *page;
	char kind[16];
	long long after, every, bytes;
	bool lasting, failing;
	uint64_t random;
} attack = {.lock = PTHREAD_MUTEX_INITIALIZER};

static long long number(const char *name, long long otherwise)
{
	const char *text = getenv(name);

	return text ? atoll(text) : otherwise;
}

__attribute__((constructor)) static void begin(void)
{
	const char *path = getenv("ATTACK_PAGE"), *kind = getenv("ATTACK_KIND");
	int fd = path ? open(path, O_RDWR | O_CLOEXEC) : -1;
	void *page = MAP_FAILED;

	if (fd >= 0) {
		page = mmap(NULL, sizeof(struct watch_page), PROT_READ | PROT_WRITE,
			    MAP_SHARED, fd, 0);
		close(fd);
	}
	if (page == MAP_FAILED)
		return;
	attack.page = page;
	snprintf(attack.kind, sizeof(attack.kind), "%s", kind ? kind : "");
	attack.after = number("ATTACK_AFTER", 0);
	attack.every = number("ATTACK_EVERY", 1);
	attack.bytes = number("ATTACK_BYTES", 0);
	attack.lasting = number("ATTACK_LASTING", 0);
	attack.random = (uint64_t)number("ATTACK_SEED", 1) * 0x9e3779b97f4a7c15 | 1;
}

/* --- what is committed ------------------------------------------------------------ */

static int64_t greatest(sqlite3 *db, const char *sql)
{
	sqlite3_stmt *stmt;
	int64_t seq = -1;

	if (sqlite3_prepare_v2(db, sql, -1, &stmt, NULL) != SQLITE_OK)
		return -1;
	if (sqlite3_step(stmt) == SQLITE_ROW &&
	    sqlite3_column_type(stmt, 0) == SQLITE_INTEGER)
		seq = sqlite3_column_int64(stmt, 0);
	sqlite3_finalize(stmt);
	return seq;
}

__attribute__((visibility("default"))) int sqlite3_exec(sqlite3 *db, const char *sql,
							int (*row)(void *, int, char **,
								   char **),
							void *user, char **text)
{
	int (*exec)(sqlite3 *, const char *, int (*)(void *, int, char **, char **),
		    void *, char **) = dlsym(RTLD_NEXT, "sqlite3_exec");
	int64_t seq[WATCH_TABLES], began_ns = now_ns();
	int rc;

	if (!attack.page || strncmp(sql, "COMMIT", 6))
		return exec(db, sql, row, user, text);
	for (int i = 0; i < WATCH_TABLES; i++)
		seq[i] = greatest(db, watch_greatest[i]);
	attack.page->began_ns = began_ns;
	rc = exec(db, sql, row, user, text);
	attack.page->began_ns = 0;
	attack.page->took_ns = now_ns() - began_ns;
	if (rc != SQLITE_OK)
		return rc;
	for (int i = 0; i < WATCH_TABLES; i++)
		attack.page->seq[i] = seq[i];
	attack.page->commits++;
	return rc;
}

/* --- what fails ------------------------------------------------------------------- */

static uint64_t draw(uint64_t below)
{
	attack.random ^= attack.random << 13;
	attack.random ^= attack.random >> 7;
	attack.random ^= attack.random << 17;
	return attack.random % below;
}

static bool is_of_recording(int fd)
{
	char name[40], path[4096];
	ssize_t n;

	snprintf(name, sizeof(name), "/proc/self/fd/%d", fd);
	n = readlink(name, path, sizeof(path) - 1);
	if (n < 0)
		return false;
	path[n] = 0;
	return strstr(path, ".rec");
}

/*
 * The result of a write of *size bytes, or of a sync if size is NULL: 0, or an error;
 * fewer bytes are written when *size is less.
 */
static int fate(int fd, size_t *size)
{
	int code = 0;

	if (!attack.page || !is_of_recording(fd))
		return 0;
	pthread_mutex_lock(&attack.lock);
	attack.page->calls++;
	if (attack.page->calls <= attack.after) {
	} else if (!strcmp(attack.kind, "die")) {
		kill(getpid(), SIGKILL);
	} else if (!strcmp(attack.kind, "enospc")) {
		if (size && (long long)*size > attack.bytes) {
			*size = attack.bytes; /* as a disk does: what still fits */
			if (!*size)
				code = ENOSPC;
			attack.page->faults++;
		}
		attack.bytes -= size ? *size : 0;
	} else if (!strcmp(attack.kind, "short")) {
		if (size && *size > 1 && !draw(attack.every)) {
			*size = 1 + draw(*size - 1);
			attack.page->faults++;
		}
	} else if ((!strcmp(attack.kind, "eio") ||
		    (!strcmp(attack.kind, "sync") && !size)) &&
		   (attack.failing || !draw(attack.every))) {
		attack.failing = attack.lasting;
		attack.page->faults++;
		code = EIO;
		/* some of it may have come to the disk */
		if (size && *size > 1 && draw(2)) {
			*size = 1 + draw(*size - 1);
			code = 0;
			attack.failing = true; /* SQLite asks again for the rest */
		}
	}
	pthread_mutex_unlock(&attack.lock);
	return code;
}

#define REAL(name, ...) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))(__VA_ARGS__)
#define EXPORT __attribute__((visibility("default")))

#define FAIL(fd, size)                      \
	do {                                \
		int code_ = fate(fd, size); \
		if (code_) {                \
			errno = code_;      \
			return -1;          \
		}                           \
	} while (0)

EXPORT ssize_t write(int fd, const void *data, size_t size)
{
	FAIL(fd, &size);
	return REAL(write, fd, data, size);
}

EXPORT ssize_t pwrite(int fd, const void *data, size_t size, off_t at)
{
	FAIL(fd, &size);
	return REAL(pwrite, fd, data, size, at);
}

EXPORT ssize_t pwrite64(int fd, const void *data, size_t size, off64_t at)
{
	FAIL(fd, &size);
	return REAL(pwrite64, fd, data, size, at);
}

EXPORT int fsync(int fd)
{
	FAIL(fd, NULL);
	return REAL(fsync, fd);
}

EXPORT int fdatasync(int fd)
{
	FAIL(fd, NULL);
	return REAL(fdatasync, fd);
}

EXPORT int ftruncate(int fd, off_t size)
{
	FAIL(fd, NULL);
	return REAL(ftruncate, fd, size);
}

EXPORT int ftruncate64(int fd, off64_t size)
{
	FAIL(fd, NULL);
	return REAL(ftruncate64, fd, size);
}
