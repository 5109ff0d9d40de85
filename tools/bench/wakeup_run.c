// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * One measurement of how late the loop wakes; see wakeup_run.h.
 *
 * The loop runs a scene on the virtual rig in a thread of its own, and cyclictest runs beside
 * it, on the same processor, with the same policy and interval, half a period apart:
 *
 *   cyclictest      |               |               |
 *   loop                    |█              |█              |█
 *   of a second |               |               |               |
 *               0  T/4     3T/4
 *
 * So both meet the same host, interrupts and load, in the same minute; neither is ever ready
 * while the other has work to do, as long as a tick costs less than T/2. One after the other
 * they would meet different minutes, which on a shared machine differ by more than the
 * programs do. That each finds the processor a little less deeply asleep than alone is the
 * same for both. Neither wakes at full milliseconds, where the kernel has its own tick to do.
 *
 * Who is to blame for an overrun? cyclictest's priority is one above the loop's, so that no
 * tick, however long, holds it up. Where cyclictest was waiting in vain for half of the time
 * that the loop was late, or longer, the machine stood still: the host of a virtual one,
 * mostly. What cannot be told is the program's.
 *
 *   loop        |█      |█      :       :       :    |█     left out: 3
 *   cyclictest      |       |........................|      late: the machine's
 *
 */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/loop.h>
#include "../cli/cli.h"
#include "cyclictest.h"
#include "wakeup_run.h"

#define STALLS_MAX 65536

/* A gap between two ticks in which others were left out. */
struct stall {
	int64_t from_ns, to_ns;
	uint64_t skipped;
};

struct run {
	const struct wakeup_setup *setup;
	struct incise_scene *scene;
	struct incise_rig *rig;
	struct incise_plan *plan;
	int64_t period_ns, due_ns; /* of the first tick */
	struct incise_loop_stats stats;
	struct incise_error err;
	int rc;
	/* of the tick before */
	int64_t index, t_ns;
	struct stall stall[STALLS_MAX];
	int stalls;
	uint64_t found; /* ticks skipped in all of these */
};

static int64_t clock_ns(clockid_t clock)
{
	struct timespec t;

	clock_gettime(clock, &t);
	return t.tv_sec * INCISE_NS_PER_S + t.tv_nsec;
}

static void sleep_until(int64_t t_ns)
{
	struct timespec t = {t_ns / INCISE_NS_PER_S, t_ns % INCISE_NS_PER_S};

	while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR)
		;
}

static void add_stall(struct run *run, int64_t to_ns, uint64_t skipped)
{
	if (!skipped || run->stalls == STALLS_MAX)
		return;
	run->stall[run->stalls++] = (struct stall){run->t_ns, to_ns, skipped};
	run->found += skipped;
}

static int ticked(void *context, const struct incise_tick *tick)
{
	struct run *run = context;
	int64_t index = (tick->t_ns - run->due_ns) / run->period_ns;

	if (index > run->index + 1)
		add_stall(run, tick->t_ns, (uint64_t)(index - run->index - 1));
	run->index = index;
	run->t_ns = tick->t_ns;
	return 0;
}

/*
 * Three quarters of a period after a full second, half a period after cyclictest. Not much
 * later, or the two would be ready together.
 */
static void wait_for_phase(const struct run *run)
{
	int64_t now = clock_ns(CLOCK_MONOTONIC);
	int64_t begin =
		(now / INCISE_NS_PER_S + 1) * INCISE_NS_PER_S + run->period_ns / 4 * 3;

	for (int i = 0; i < 1000; i++, begin += run->period_ns) {
		sleep_until(begin);
		if (clock_ns(CLOCK_MONOTONIC) - begin < run->period_ns / 8)
			return;
	}
}

static void run_loop(struct run *run)
{
	struct incise_clock *clock = incise_rig_clock(run->rig);
	struct incise_loop_options options = {
		.rate_hz = run->setup->rate_hz,
		.duration_ns = (int64_t)(run->setup->seconds * 1e9),
		.stop = &cli_stop,
		.ticked = ticked,
		.context = run,
	};

	if (run->setup->beside)
		wait_for_phase(run);
	run->due_ns = incise_clock_now(clock) + run->period_ns;
	run->t_ns = run->due_ns - run->period_ns;
	run->index = -1;
	run->rc = incise_loop_run(run->plan, clock, &options, &run->stats, &run->err);
	/* No tick comes after a gap over the end. */
	if (run->stats.skipped > run->found)
		add_stall(run, incise_clock_now(clock), run->stats.skipped - run->found);
}

static void *loop_thread(void *context)
{
	struct run *run = context;
	const struct wakeup_setup *setup = run->setup;
	cpu_set_t cpus;

	if (setup->realtime) {
		run->rc = incise_realtime_enter(setup->realtime, &run->err);
	} else {
		CPU_ZERO(&cpus);
		CPU_SET(setup->cpu, &cpus);
		pthread_setaffinity_np(pthread_self(), sizeof(cpus), &cpus);
	}
	if (!run->rc)
		run_loop(run);
	return NULL;
}

static struct lateness lateness_of(const uint64_t *bins, double max_us)
{
	struct lateness l = {
		.median = incise_loop_quantile(bins, 0.5),
		.p99 = incise_loop_quantile(bins, 0.99),
		.p999 = incise_loop_quantile(bins, 0.999),
		.p9999 = incise_loop_quantile(bins, 0.9999),
		.max = max_us,
		.bins = malloc(INCISE_LOOP_BINS * sizeof(*bins)),
	};

	if (!l.bins)
		cli_fail("no memory");
	memcpy(l.bins, bins, INCISE_LOOP_BINS * sizeof(*bins));
	while (l.min < INCISE_LOOP_BINS - 1 && !bins[(int)l.min])
		l.min++;
	for (int i = 0; i < INCISE_LOOP_BINS; i++)
		l.ticks += bins[i];
	return l;
}

static bool held_up(const struct cyclictest_result *theirs, const struct stall *stall,
		    int64_t period_ns)
{
	int64_t gap_ns = stall->to_ns - stall->from_ns, both_ns = 0;

	for (int i = 0; i < theirs->spikes; i++) {
		const struct cyclictest_spike *spike = &theirs->spike[i];
		int64_t from =
			spike->from_ns > stall->from_ns ? spike->from_ns : stall->from_ns;
		int64_t to = spike->to_ns < stall->to_ns ? spike->to_ns : stall->to_ns;

		if (to > from)
			both_ns += to - from;
	}
	return both_ns >= (gap_ns - period_ns) / 2;
}

static void blame(const struct run *run, const struct cyclictest_result *theirs,
		  struct wakeup *wakeup)
{
	wakeup->skipped = run->stats.skipped;
	for (int i = 0; i < run->stalls; i++)
		if (held_up(theirs, &run->stall[i], run->period_ns))
			wakeup->machine += run->stall[i].skipped;
	if (wakeup->machine > wakeup->skipped)
		wakeup->machine = wakeup->skipped;
}

/* Early in a second: both begin with the next one. */
static void begin_beside(const struct wakeup_setup *setup, struct cyclictest *cyclictest)
{
	int64_t now = clock_ns(CLOCK_MONOTONIC);

	if (now % INCISE_NS_PER_S > INCISE_NS_PER_S / 4)
		sleep_until((now / INCISE_NS_PER_S + 1) * INCISE_NS_PER_S);
	cyclictest_begin(cyclictest, setup->rate_hz, INCISE_REALTIME_PRIORITY + 1,
			 setup->cpu, (uint64_t)llrint(setup->seconds * setup->rate_hz),
			 0.25e6 / setup->rate_hz);
}

static void run_thread(struct run *run)
{
	pthread_t thread;
	int rc = pthread_create(&thread, NULL, loop_thread, run);

	if (rc)
		cli_fail("no thread for the loop: %s", strerror(rc));
	pthread_join(thread, NULL);
}

static void open_run(struct run *run)
{
	run->scene = incise_scene_load(run->setup->scene, NULL, &run->err);
	if (run->scene)
		run->rig = incise_rig_open(
			"sim:", INCISE_RIG_TRACKER | INCISE_RIG_STEPPER, &run->err);
	if (run->rig)
		run->plan = incise_plan_new(run->scene, run->rig, &run->err);
	if (!run->plan)
		cli_fail_with(&run->err);
}

static void close_run(struct run *run)
{
	incise_plan_free(run->plan);
	incise_rig_close(run->rig);
	incise_scene_free(run->scene);
	free(run);
}

void wakeup_run(const struct wakeup_setup *setup, struct wakeup *wakeup)
{
	struct run *run = calloc(1, sizeof(*run));
	struct cyclictest_result theirs = {0};
	struct cyclictest cyclictest;

	if (!run)
		cli_fail("no memory");
	*wakeup = (struct wakeup){.ratio = NAN};
	run->setup = setup;
	run->period_ns = llrint(INCISE_NS_PER_S / setup->rate_hz);
	open_run(run);
	if (setup->beside)
		begin_beside(setup, &cyclictest);
	run_thread(run);
	if (setup->beside)
		wakeup->no_cyclictest = cyclictest_end(&cyclictest, &theirs);
	if (run->rc && !cli_stop)
		cli_fail_with(&run->err);
	wakeup->loop =
		lateness_of(run->stats.lateness_us, run->stats.lateness_max_ns * 1e-3);
	wakeup->loop.ticks = run->stats.ticks;
	wakeup->tick_max_us = run->stats.tick_max_ns * 1e-3;
	if (theirs.late_us) {
		wakeup->cyclictest = lateness_of(theirs.late_us, theirs.max_us);
		wakeup->ratio = wakeup->loop.p999 / wakeup->cyclictest.p999;
	}
	blame(run, &theirs, wakeup);
	cyclictest_free(&theirs);
	close_run(run);
}
