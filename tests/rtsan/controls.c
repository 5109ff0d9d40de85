// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * That RealtimeSanitizer is awake: each thing that no tick may do is done in one, in a
 * child, which must come to its end by that and name it; and a child that does none of them
 * must not.
 */
#include <fcntl.h>
#include <pthread.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <incise/loop.h>
#include "hands.h"

#define SINNED_AT 100 /* tick */

/* Exit code of a program that the sanitizer ends. */
#define CAUGHT 43

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static void *volatile memory;

static void allocate(void)
{
	memory = malloc(100);
}

static void give_back(void)
{
	free(memory);
}

static void take_lock(void)
{
	pthread_mutex_lock(&lock);
}

static void log_line(void)
{
	fwrite("tick\n", 5, 1, stdout);
}

static void write_file(void)
{
	if (write(STDOUT_FILENO, "", 0))
		return;
}

static void open_file(void)
{
	close(open("/dev/null", O_RDONLY | O_CLOEXEC));
}

static void doze(void)
{
	nanosleep(&(struct timespec){.tv_nsec = 1}, NULL);
}

static const struct sin {
	const char *name;
	void (*act)(void);
} sins[] = {
	{"malloc", allocate}, {"free", give_back},   {"pthread_mutex_lock", take_lock},
	{"fwrite", log_line}, {"write", write_file}, {"open", open_file},
	{"nanosleep", doze},  {NULL, NULL},
};

static const struct sin *sin;

static int sinful_poses(struct incise_tracker_sample *samples, int n)
{
	(void)samples;
	if (hands.reads == SINNED_AT && sin->act)
		sin->act();
	return n;
}

static int sinful_set(int rc)
{
	if (sin->act)
		sin->act();
	return rc;
}

static void in_loop(void)
{
	static struct incise_loop_stats stats;
	struct incise_loop_options options = {.rate_hz = 1000,
					      .duration_ns = INCISE_NS_PER_S};

	hands.poses = sinful_poses;
	incise_loop_run(hands.plan, incise_rig_clock(hands.rig), &options, &stats, NULL);
}

static void in_tick(void)
{
	struct incise_clock *clock = incise_rig_clock(hands.rig);
	struct incise_tick tick;

	hands.poses = sinful_poses;
	for (int i = 1; i <= 2 * SINNED_AT; i++) {
		incise_clock_wait_until(clock, i * 1000000LL);
		incise_plan_tick(hands.plan, incise_clock_now(clock), &tick);
	}
}

static void in_stepper(void)
{
	hands.set = sinful_set;
	incise_stepper_set(hands.stepper, 1);
}

static const struct {
	const char *name;
	void (*run)(void);
} places[] = {
	{"the loop", in_loop},
	{"a tick", in_tick},
	{"a stepper's target", in_stepper},
};

/* Returns the child's exit status, with what it said. */
static int run_child(void (*run)(void), char *said, size_t size)
{
	int ends[2], status;
	size_t length = 0;
	ssize_t n;
	pid_t child;

	if (pipe(ends))
		hands_fail("controls", "no pipe");
	child = fork();
	if (!child) {
		dup2(ends[1], STDERR_FILENO);
		dup2(ends[1], STDOUT_FILENO);
		close(ends[0]);
		run();
		_exit(0);
	}
	close(ends[1]);
	while (length < size - 1 &&
	       (n = read(ends[0], said + length, size - 1 - length)) > 0)
		length += (size_t)n;
	said[length] = 0;
	close(ends[0]);
	if (waitpid(child, &status, 0) != child || !WIFEXITED(status))
		hands_fail("controls", "a child was killed");
	return WEXITSTATUS(status);
}

int main(void)
{
	char said[16384], call[64];
	int caught = 0;

	/* What free() gives back was taken before. */
	allocate();
	hands_begin("scenes/wall.scene", "fixed", false,
		    INCISE_RIG_TRACKER | INCISE_RIG_STEPPER);
	for (size_t p = 0; p < sizeof(places) / sizeof(*places); p++)
		for (sin = sins;; sin++) {
			int status = run_child(places[p].run, said, sizeof(said));

			if (!sin->name) {
				if (status)
					hands_fail(places[p].name,
						   "ended though it did nothing wrong");
				break;
			}
			snprintf(call, sizeof(call), "`%s`", sin->name);
			if (status != CAUGHT || !strstr(said, call)) {
				fprintf(stderr,
					"FAIL  rtsan: %s in %s: status %d, said: %s\n",
					sin->name, places[p].name, status, said);
				return 1;
			}
			caught++;
		}
	hands_end();
	free(memory);
	printf("ok    rtsan: %d of %d things that no tick may do were caught\n", caught,
	       caught);
	return 0;
}
