// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Attacks on a recording while `incise capture` writes it, from outside of its process:
 *
 *     storage kill COUNT SEED [camera]   kill -9 at random moments, in real time
 *     storage eio|sync|short|enospc …    writes that fail, in simulated time; see watch.c
 *     storage die COUNT SEED             kill -9 before a write or a sync, the last ones too
 *
 * After each one, what is left must open and verify, and what SQLite said is committed must be
 * in it. Works in the current folder; INCISE_BUILD is where the programs are. Prints a line
 * at the end; exits with 1 at the first recording that fails, which stays there.
 */
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <sqlite3.h>
#include <incise/verify.h>
#include "watch.h"

#define MS 1000000LL
/* The figure; two commits of 100 ms. */
#define LOST_MAX_NS (200 * MS)
/* A machine, or a disk, that stands still so long is not measured. */
#define STALL_NS (40 * MS)

struct round {
	int number;
	uint64_t seed;
	char what[120]; /* for a report */
	bool camera;
	struct watch_page *page;
};

static uint64_t random_state;

static uint64_t draw(uint64_t below)
{
	random_state ^= random_state << 13;
	random_state ^= random_state >> 7;
	random_state ^= random_state << 17;
	return random_state % below;
}

static int64_t now_ns(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return now.tv_sec * 1000000000LL + now.tv_nsec;
}

static void nap(int64_t ns)
{
	struct timespec time = {ns / (1000 * MS), ns % (1000 * MS)};

	nanosleep(&time, NULL);
}

static void fail(const struct round *round, const char *fmt, ...)
	__attribute__((format(printf, 2, 3), noreturn));
static void fail(const struct round *round, const char *fmt, ...)
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

static pid_t start(const struct round *round, const char *rig, const char *duration)
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
	alarm(60); /* one that hangs ends by a signal */
	if (!freopen("out", "w", stdout) || !freopen("err", "w", stderr))
		_exit(126);
	if (duration) {
		arguments[n++] = "--duration";
		arguments[n++] = duration;
	}
	if (round->camera) {
		arguments[n++] = "--camera";
		arguments[n++] = "pictures";
	}
	execv(program, (char *const *)arguments);
	_exit(127);
}

static void clear(struct round *round)
{
	if (system("rm -rf a.rec a.rec.part"))
		fail(round, "cannot clear up");
	memset((void *)round->page, 0, sizeof(*round->page));
	for (int i = 0; i < WATCH_TABLES; i++)
		round->page->seq[i] = -1;
}

/* Up to 16 kB of a file; nothing where there is none. */
static char *text_of(const char *path)
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

static const char *recording(void)
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

static int64_t ask(const struct round *round, const char *file, const char *sql)
{
	sqlite3_stmt *stmt;
	int64_t value = -1;
	sqlite3 *db;

	if (sqlite3_open_v2(file, &db, SQLITE_OPEN_READONLY, NULL) != SQLITE_OK ||
	    sqlite3_prepare_v2(db, sql, -1, &stmt, NULL) != SQLITE_OK)
		fail(round, "%s: %s", sql, sqlite3_errmsg(db));
	if (sqlite3_step(stmt) == SQLITE_ROW &&
	    sqlite3_column_type(stmt, 0) == SQLITE_INTEGER)
		value = sqlite3_column_int64(stmt, 0);
	sqlite3_finalize(stmt);
	sqlite3_close(db);
	return value;
}

/*
 * It verifies, and holds what was committed. One that was closed may still be called .part,
 * when something was in the way of its name. @whole: nothing was lost at all.
 */
static void check_recording(struct round *round, bool whole)
{
	static const char *const max[WATCH_TABLES] = {
		[WATCH_FORCE] = "SELECT max(seq) FROM force",
		[WATCH_TRACKER] = "SELECT max(seq) FROM tracker",
		[WATCH_FRAMES] = "SELECT max(seq) FROM frames",
	};
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
	if (!report.intact || (report.interrupted && (has_name || report.complete)) ||
	    (whole && !report.complete))
		fail(round,
		     "intact %d, interrupted %d, complete %d: %s; capture said: %s",
		     report.intact, report.interrupted, report.complete, findings.text,
		     text_of("err"));
	for (int i = 0; i < WATCH_TABLES; i++) {
		int64_t there = ask(round, file, max[i]);

		if (there < round->page->seq[i])
			fail(round, "%s is %lld, and %lld was committed", max[i],
			     (long long)there, (long long)round->page->seq[i]);
	}
}

/* Before the first commit there is nothing to lose, and that is said. */
static void check_unbegun(const struct round *round)
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

/* --- kill -9 ---------------------------------------------------------------------- */

static struct {
	_Atomic int64_t late_ns; /* most, since it was cleared */
	_Atomic bool stop;
} canary;

/* How long a program that wants to run every 5 ms has to wait. */
static void *watch_machine(void *unused)
{
	int64_t next = now_ns();

	while (!canary.stop) {
		int64_t late_ns;

		next += 5 * MS;
		nap(next > now_ns() ? next - now_ns() : 0);
		late_ns = now_ns() - next;
		if (late_ns > canary.late_ns)
			canary.late_ns = late_ns;
		if (late_ns > 5 * MS)
			next = now_ns();
	}
	return unused;
}

static void attack_by_kill(struct round *round, int count)
{
	int64_t lost_most_ns = 0, lost_sum_ns = 0;
	int timed = 0, unbegun = 0, stalled = 0, with_rows = 0;
	pthread_t thread;

	pthread_create(&thread, NULL, watch_machine, NULL);
	for (round->number = 1; round->number <= count; round->number++) {
		int64_t delay_ns = draw(1200 * MS), killed_ns, last_ns, lost_ns, took_ns;
		struct stat st;
		pid_t pid;

		snprintf(round->what, sizeof(round->what), "killed after %.4f s",
			 delay_ns * 1e-9);
		clear(round);
		pid = start(round, "sim:clock=real", NULL);
		for (int i = 0; stat("a.rec.part", &st) && i < 20000; i++)
			nap(MS / 2);
		if (stat("a.rec.part", &st))
			fail(round, "does not begin: %s", text_of("err"));
		canary.late_ns = 0;
		nap(delay_ns);
		took_ns = round->page->took_ns;
		if (round->page->began_ns && now_ns() - round->page->began_ns > took_ns)
			took_ns = now_ns() - round->page->began_ns;
		killed_ns = now_ns();
		kill(pid, SIGKILL);
		waitpid(pid, NULL, 0);
		if (!round->page->commits) {
			/* There was no recording yet, and nothing to lose. */
			if (delay_ns > LOST_MAX_NS && took_ns < STALL_NS &&
			    canary.late_ns < STALL_NS)
				fail(round, "there was no commit yet");
			check_unbegun(round);
			unbegun++;
			continue;
		}
		check_recording(round, false);
		last_ns = ask(round, recording(), "SELECT max(t_ns) FROM force");
		with_rows += last_ns >= 0;
		if (last_ns < 0)
			last_ns = ask(round, recording(), "SELECT max(t_ns) FROM events");
		lost_ns = killed_ns - last_ns;
		if (took_ns > STALL_NS || canary.late_ns > STALL_NS) {
			stalled++;
			continue;
		}
		if (lost_ns > LOST_MAX_NS)
			fail(round,
			     "%.1f ms lost; the last commit took %.1f ms, a program that "
			     "wants to run waits up to %.1f ms",
			     lost_ns * 1e-6, took_ns * 1e-6, canary.late_ns * 1e-6);
		if (lost_ns > lost_most_ns)
			lost_most_ns = lost_ns;
		lost_sum_ns += lost_ns;
		timed++;
	}
	canary.stop = true;
	pthread_join(thread, NULL);
	if (!with_rows) {
		fprintf(stderr, "not one of %d recordings had rows\n", count);
		exit(1);
	}
	printf("kill: %d times, %d before the first commit; all others open, are intact and "
	       "have what was committed; lost at most %.1f ms, %.1f ms on average, by %d of "
	       "them (%d while the machine or its disk stood still)\n",
	       count, unbegun, lost_most_ns * 1e-6,
	       timed ? lost_sum_ns * 1e-6 / timed : 0, timed, stalled);
}

/* --- writes that fail ------------------------------------------------------------- */

static void set(const char *name, long long value)
{
	char text[40];

	snprintf(text, sizeof(text), "%lld", value);
	setenv(name, text, 1);
}

/* A message of one line that names the verb. */
static void check_message(const struct round *round)
{
	char *text = text_of("err"), *end = strchr(text, '\n');

	if (strncmp(text, "incise capture: ", 16) || !end || end[1])
		fail(round, "not one clear line: %s", text);
}

static void attack_by_errors(struct round *round, const char *kind, int count)
{
	bool is_short = !strcmp(kind, "short"), is_full = !strcmp(kind, "enospc");
	bool dies = !strcmp(kind, "die");
	int hit = 0, failed = 0, unbegun = 0, calls = 0;
	int64_t bytes = 0;

	setenv("ATTACK_KIND", kind, 1);
	for (round->number = 0; round->number <= count; round->number++) {
		/* round 0 finds out how many calls there are; nothing fails */
		long long after = round->number && !is_short ? draw(calls) : 0;
		long long every = is_short ? 1 + draw(20) : 1 + draw(4) * 5;
		int lasting = draw(2), status;
		bool killed;
		struct stat st;
		pid_t pid;

		/* while it is closed, every second time */
		if (dies && calls && draw(2))
			after = calls - 1 - (long long)draw(30);
		set("ATTACK_SEED", draw(1000000));
		set("ATTACK_AFTER", round->number ? (is_full ? 0 : after) : 1LL << 60);
		set("ATTACK_EVERY", every);
		set("ATTACK_LASTING", lasting);
		set("ATTACK_BYTES", bytes ? (long long)draw(bytes) : 0);
		snprintf(round->what, sizeof(round->what),
			 "%s, seed %s, after %s, every %lld, lasting %d, bytes %s", kind,
			 getenv("ATTACK_SEED"), getenv("ATTACK_AFTER"), every, lasting,
			 getenv("ATTACK_BYTES"));
		clear(round);
		pid = start(round, "sim:clock=simulated,seed=7",
			    round->camera ? "200ms" : "1s");
		if (waitpid(pid, &status, 0) != pid)
			fail(round, "%s", strerror(errno));
		killed = WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
		if (!WIFEXITED(status) && !(dies && killed))
			fail(round, "ended by signal %d: %s", WTERMSIG(status),
			     text_of("err"));
		if (!round->number) {
			calls = (int)round->page->calls;
			if (WEXITSTATUS(status) || calls < 20)
				fail(round, "%d calls, exit %d: %s", calls,
				     WEXITSTATUS(status), text_of("err"));
			/* the log is written twice: once into the log */
			if (stat("a.rec/recording.db", &st))
				fail(round, "there is no recording");
			bytes = 2 * st.st_size;
			if (!stat("a.rec/camera.mkv", &st))
				bytes += st.st_size;
		}
		hit += round->page->faults > 0 || killed;
		if (killed) {
			if (round->page->commits) {
				check_recording(round, false);
			} else {
				check_unbegun(round);
				unbegun++;
			}
			continue;
		}
		if (!WEXITSTATUS(status)) {
			if (*text_of("err"))
				fail(round, "exit 0, and: %s", text_of("err"));
			if (access("a.rec", F_OK))
				fail(round, "exit 0, and there is no a.rec");
			check_recording(round, true);
			continue;
		}
		if (WEXITSTATUS(status) != 1)
			fail(round, "exit %d: %s", WEXITSTATUS(status), text_of("err"));
		if (is_short || !round->page->faults)
			fail(round, "nothing failed, and yet: %s", text_of("err"));
		check_message(round);
		failed++;
		if (!round->page->commits) {
			/* What has not begun is cleared away. */
			if (!access("a.rec.part", F_OK) || !access("a.rec", F_OK))
				fail(round, "left a folder without a recording: %s",
				     text_of("err"));
			unbegun++;
		} else {
			check_recording(round, false);
		}
	}
	if (!hit) {
		fprintf(stderr, "%s: no fault in %d recordings\n", kind, count);
		exit(1);
	}
	printf("%s: %d recordings, %d met %s, %d failed with exit 1 and one line, %d ended "
	       "before there was anything; all others open, are intact and have what was "
	       "committed\n",
	       kind, count, hit, dies ? "it" : "faults", failed, unbegun);
}

int main(int argc, char **argv)
{
	struct round round = {0};
	int fd, count;

	if (argc < 4 || argc > 5 || !getenv("INCISE_BUILD")) {
		fprintf(stderr, "usage: INCISE_BUILD=… storage KIND COUNT SEED "
				"[camera]\n");
		return 2;
	}
	round.camera = argc == 5;
	count = atoi(argv[2]);
	round.seed = strtoull(argv[3], NULL, 10);
	random_state = round.seed * 0x9e3779b97f4a7c15 | 1;
	for (int i = 0; i < 10; i++)
		draw(2);
	fprintf(stderr, "storage %s %d, seed %llu\n", argv[1], count,
		(unsigned long long)round.seed);
	fd = open("page", O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
	if (fd < 0 || ftruncate(fd, sizeof(*round.page))) {
		perror("page");
		return 1;
	}
	round.page = mmap(NULL, sizeof(*round.page), PROT_READ | PROT_WRITE, MAP_SHARED,
			  fd, 0);
	if (round.page == MAP_FAILED) {
		perror("page");
		return 1;
	}
	if (!strcmp(argv[1], "kill"))
		attack_by_kill(&round, count);
	else
		attack_by_errors(&round, argv[1], count);
	return 0;
}
