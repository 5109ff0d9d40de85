// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * One recording under attack; see round.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>
#include <sqlite3.h>
#include <incise/verify.h>
#include "round.h"

static uint64_t random_state;

uint64_t draw(uint64_t below)
{
	random_state ^= random_state << 13;
	random_state ^= random_state >> 7;
	random_state ^= random_state << 17;
	return random_state % below;
}

void nap(int64_t ns)
{
	struct timespec time = {ns / (1000 * MS), ns % (1000 * MS)};

	nanosleep(&time, NULL);
}

void fail(const struct round *round, const char *fmt, ...)
{
	va_list args;

	fprintf(stderr, "round %d, %s: ", round->number, round->what);
	va_start(args, fmt);
	vfprintf(stderr, fmt, args);
	va_end(args);
	fputc('\n', stderr);
	exit(1);
}

/* --- the recording program -------------------------------------------------------- */

pid_t start(const struct round *round, const char *rig, const char *duration)
{
	const char *arguments[10] = {"incise-capture", "-o", "a.rec", "--rig", rig};
	int n = 5;
	char program[4096], library[4096];
	const char *build = getenv("INCISE_BUILD");
	pid_t pid = fork();

	if (pid)
		return pid;
	snprintf(program, sizeof(program), "%s/bin/incise-capture", build);
	snprintf(library, sizeof(library), "%s/tests/attack/watch.so", build);
	setenv("ATTACK_PAGE", "page", 1);
	setenv("LD_PRELOAD", library, 1);
	alarm(300); /* one that hangs ends by a signal */
	if (!freopen("out", "w", stdout) || !freopen("err", "w", stderr))
		_exit(126);
	if (duration) {
		arguments[n++] = "--duration";
		arguments[n++] = duration;
	}
	if (round->camera) {
		arguments[n++] = "--camera";
		arguments[n++] = "frames";
	}
	execv(program, (char *const *)arguments);
	_exit(127);
}

void clear(struct round *round)
{
	if (system("rm -rf a.rec a.rec.part"))
		fail(round, "cannot clear up");
	memset((void *)round->page, 0, sizeof(*round->page));
	for (int i = 0; i < WATCH_TABLES; i++)
		round->page->seq[i] = -1;
}

char *text_of(const char *path)
{
	static char text[16384];
	FILE *file = fopen(path, "r");
	size_t n = file ? fread(text, 1, sizeof(text) - 1, file) : 0;

	if (file)
		fclose(file);
	text[n] = 0;
	return text;
}

/* --- what is left ----------------------------------------------------------------- */

const char *recording(void)
{
	return access("a.rec", F_OK) ? "a.rec.part/recording.db" : "a.rec/recording.db";
}

struct findings {
	char text[4000];
};

static void found(void *user, const struct incise_verify_finding *finding)
{
	struct findings *findings = user;
	size_t n = strlen(findings->text);

	snprintf(findings->text + n, sizeof(findings->text) - n, "%s\n", finding->text);
}

int64_t ask(const struct round *round, const char *sql)
{
	sqlite3_stmt *stmt;
	int64_t value = -1;
	sqlite3 *db;

	/* After incise has read it: SQLite takes back a journal where it is. */
	if (sqlite3_open_v2(recording(), &db, SQLITE_OPEN_READWRITE, NULL) != SQLITE_OK ||
	    sqlite3_prepare_v2(db, sql, -1, &stmt, NULL) != SQLITE_OK)
		fail(round, "%s: %s", sql, sqlite3_errmsg(db));
	if (sqlite3_step(stmt) == SQLITE_ROW &&
	    sqlite3_column_type(stmt, 0) == SQLITE_INTEGER)
		value = sqlite3_column_int64(stmt, 0);
	sqlite3_finalize(stmt);
	sqlite3_close(db);
	return value;
}

void check_recording(struct round *round, bool whole)
{
	const char *file = recording();
	bool has_name = !strncmp(file, "a.rec/", 6);
	struct incise_verify_report report;
	struct findings findings = {{0}};
	struct incise_error err = {0};

	if (access(file, F_OK))
		fail(round, "there is no %s; capture said: %s", file, text_of("err"));
	if (incise_verify("a.rec",
			  &(struct incise_verify_watch){.found = found,
							.user = &findings},
			  &report, &err))
		fail(round, "does not open: %s", err.text);
	/* The chain holds for all that is left. */
	if (!report.intact || !report.sealed ||
	    (report.interrupted && (has_name || report.complete)) ||
	    (whole && !report.complete))
		fail(round,
		     "intact %d, sealed %d, interrupted %d, complete %d: %s; capture "
		     "said: %s",
		     report.intact, report.sealed, report.interrupted, report.complete,
		     findings.text, text_of("err"));
	for (int i = 0; i < WATCH_TABLES; i++) {
		int64_t there = ask(round, watch_greatest[i]);

		if (there < round->page->seq[i])
			fail(round, "%s is %lld, and %lld was committed",
			     watch_greatest[i], (long long)there,
			     (long long)round->page->seq[i]);
	}
}

void check_unbegun(const struct round *round)
{
	struct incise_verify_report report;
	struct incise_error err = {0};

	if (access(recording(), F_OK))
		return;
	/* the first commit may have come to the disk, and its end not to the program */
	if (incise_verify("a.rec", NULL, &report, &err) ? !strstr(err.text, ": empty: ")
							: !report.intact)
		fail(round, "before the first commit: %s", err.text);
}

int round_begin(struct round *round, int argc, char **argv, int first)
{
	int fd;

	if (argc < first + 2 || argc > first + 3 || !getenv("INCISE_BUILD")) {
		fprintf(stderr, "usage: INCISE_BUILD=… %s%s COUNT SEED [camera]\n",
			argv[0], first > 1 ? " KIND" : "");
		exit(2);
	}
	*round = (struct round){.camera = argc == first + 3};
	random_state = strtoull(argv[first + 1], NULL, 10) * 0x9e3779b97f4a7c15 | 1;
	for (int i = 0; i < 10; i++)
		draw(2);
	for (int i = 1; i < argc; i++)
		fprintf(stderr, i == first + 1 ? " seed %s" : " %s", argv[i]);
	fputc('\n', stderr);
	fd = open("page", O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
	if (fd < 0 || ftruncate(fd, sizeof(*round->page))) {
		perror("page");
		exit(1);
	}
	round->page = mmap(NULL, sizeof(*round->page), PROT_READ | PROT_WRITE, MAP_SHARED,
			   fd, 0);
	if (round->page == MAP_FAILED) {
		perror("page");
		exit(1);
	}
	return atoi(argv[first]);
}
