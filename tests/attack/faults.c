// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Writes of `incise capture` that fail, in simulated time: faults KIND COUNT SEED [camera]. KIND
 * is eio, sync, short, enospc or die, see watch.c.
 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include "round.h"

static void set(const char *name, long long value)
{
	char text[40];

	snprintf(text, sizeof(text), "%lld", value);
	setenv(name, text, 1);
}

/* A message of one line that names the command. */
static void check_message(const struct round *round)
{
	char *text = text_of("err"), *end = strchr(text, '\n');

	if (strncmp(text, "incise capture: ", 16) || !end || end[1])
		fail(round, "not one clear line: %s", text);
}

static bool has_no_sample(const struct watch_page *page)
{
	for (int i = 0; i < WATCH_TABLES; i++)
		if (page->seq[i] >= 0)
			return false;
	return true;
}

static void attack(struct round *round, const char *kind, int count)
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
		/* A recording that did not start leaves nothing. */
		if (has_no_sample(round->page) && access("a.rec.part", F_OK) &&
		    access("a.rec", F_OK)) {
			unbegun++;
			continue;
		}
		if (!round->page->commits)
			fail(round, "left a folder without a recording: %s",
			     text_of("err"));
		check_recording(round, false);
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
	struct round round;
	int count = round_begin(&round, argc, argv, 2);

	attack(&round, argv[1], count);
	return 0;
}
