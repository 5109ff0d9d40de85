// SPDX-License-Identifier: GPL-2.0-or-later
/* See plan_feed.h. */
#include <sched.h>
#include <signal.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "../../lib/fixed/vector.h"
#include "plan_feed.h"

#define POSE_NS 8333333
#define LOOK_NS 1000000

struct plan_feed *plan_feed_new(void)
{
	void *memory = mmap(NULL, sizeof(struct plan_feed), PROT_READ | PROT_WRITE,
			    MAP_SHARED | MAP_ANONYMOUS, -1, 0);

	return memory == MAP_FAILED ? NULL : memory;
}

void plan_fifo(int priority)
{
	mlockall(MCL_CURRENT | MCL_FUTURE);
	sched_setscheduler(0, SCHED_FIFO,
			   &(struct sched_param){.sched_priority = priority});
}

static void sleep_until(int64_t t_ns)
{
	const struct timespec at = {.tv_sec = t_ns / 1000000000,
				    .tv_nsec = t_ns % 1000000000};

	clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL);
}

static void feed_poses(const struct bench *bench, struct plan_feed *feed)
{
	int64_t next_ns = bench_now_ns();

	for (;;) {
		struct incise_fixed_pose pose = {
			.t_ns = bench_now_ns(),
			.position = {0, 0,
				     (50 << 16) - (int32_t)((int64_t)feed->depth_um *
							    65536 / 1000)},
			.quaternion = {INCISE_FIXED_UNIT},
			.tool = feed->tool,
		};

		plan_pose(bench, 0, &pose);
		feed->poses++;
		next_ns += POSE_NS;
		if (next_ns < bench_now_ns())
			next_ns = bench_now_ns();
		sleep_until(next_ns);
	}
}

static pid_t child(void)
{
	pid_t pid = fork();

	if (!pid)
		prctl(PR_SET_PDEATHSIG, SIGKILL);
	return pid;
}

pid_t plan_feeder(const struct bench *bench, struct plan_feed *feed)
{
	pid_t pid = child();

	if (pid)
		return pid;
	plan_fifo(85);
	feed_poses(bench, feed);
	_exit(0);
}

static int64_t length_of(const int32_t a[3], const int32_t b[3])
{
	int32_t off[3];

	for (int i = 0; i < 3; i++)
		off[i] = a[i] - b[i];
	return incise_fx_length(off);
}

static void look(struct plan_feed *feed, const struct incise_stepper_plan_status *last,
		 const struct incise_stepper_plan_status *now)
{
	static const int32_t none[3];
	int64_t force = length_of(now->command, none);
	int64_t ticks =
		now->ticks > last->ticks ? (int64_t)(now->ticks - last->ticks) : 1;
	/* Rounded up: a change of two ticks that is steeper than it may be shows. */
	int64_t steep = (length_of(now->command, last->command) + ticks - 1) / ticks;

	feed->states |= 1U << now->state;
	feed->reasons |= now->reasons;
	feed->state = now->state;
	if (steep > feed->steepest)
		feed->steepest = steep;
	if (force > feed->force_max)
		feed->force_max = force;
	if (force < feed->force_min)
		feed->force_min = force;
	if (!force && feed->force_max && !feed->quiet_age_ns)
		feed->quiet_age_ns = now->age_ns;
}

static void watch(const struct bench *bench, struct plan_feed *feed, int n_motors)
{
	struct incise_stepper_plan_status last = plan_look(bench), now;
	int64_t next_ns = bench_now_ns();

	for (;;) {
		now = plan_look(bench);
		if (feed->wanted != feed->done) {
			feed->states = feed->reasons = 0;
			feed->steepest = feed->force_max = feed->quiet_age_ns = 0;
			feed->force_min = INT64_MAX;
			last = now;
			feed->done = feed->wanted;
		}
		look(feed, &last, &now);
		last = now;
		for (int m = 0; m < n_motors; m++) {
			struct incise_stepper_motor_status motor = bench_look(bench, m);

			feed->motor_state[m] = motor.state;
			feed->motor_faults[m] = motor.faults;
		}
		next_ns += LOOK_NS;
		if (next_ns < bench_now_ns())
			next_ns = bench_now_ns();
		sleep_until(next_ns);
	}
}

pid_t plan_watcher(const struct bench *bench, struct plan_feed *feed, int n_motors)
{
	pid_t pid = child();

	if (pid)
		return pid;
	plan_fifo(95);
	watch(bench, feed, n_motors);
	_exit(0);
}

bool plan_watch_reset(struct plan_feed *feed)
{
	feed->wanted++;
	for (int i = 0; i < 1000 && feed->done != feed->wanted; i++)
		bench_nap(1000000);
	return feed->done == feed->wanted;
}

bool plan_until(const struct bench *bench, uint32_t state, int64_t ns)
{
	int64_t end_ns = bench_now_ns() + ns;

	while (plan_look(bench).state != state) {
		if (bench_now_ns() > end_ns)
			return false;
		bench_nap(500000);
	}
	return true;
}

void plan_kill(pid_t *child)
{
	if (*child <= 0)
		return;
	kill(*child, SIGKILL);
	waitpid(*child, NULL, 0);
	*child = -1;
}
