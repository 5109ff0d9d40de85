// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Ticks of a running loop; see live.h.
 */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "live.h"

#define BATCH 512

struct view_live {
	struct incise_state *state;
	uint64_t cursor, lost;
	struct incise_state_now now;
	struct incise_tick ticks[BATCH];

	/* A loop of this program. */
	bool own, started;
	bool looked;	      /* the page was, once */
	uint64_t lost_before; /* ticks, up to the first look */
	uint64_t reloads;     /* then */
	char page[64];
	pthread_t thread;
	struct incise_plan *plan;
	struct incise_clock *clock;
	struct incise_realtime *realtime; /* or NULL */
	struct incise_loop_options options;
	struct incise_loop_stats stats;
	struct incise_error err;
	volatile sig_atomic_t stop;
	atomic_int tool, rc;
	atomic_bool ended;
};

struct view_live *view_live_open(const char *page, struct incise_error *err)
{
	struct view_live *live = calloc(1, sizeof(*live));

	if (!live) {
		incise_error_set(err, ENOMEM, "out of memory");
		errno = ENOMEM;
		return NULL;
	}
	live->state = incise_state_open(page, err);
	if (!live->state) {
		free(live);
		return NULL;
	}
	return live;
}

static int take_tool(void *context, const struct incise_tick *tick)
{
	struct view_live *live = context;

	(void)tick;
	incise_plan_set_tool(live->plan, (enum incise_tool)atomic_load_explicit(
						 &live->tool, memory_order_relaxed));
	return 0;
}

static void *run(void *argument)
{
	struct view_live *live = argument;
	int rc = live->realtime ? incise_realtime_enter(live->realtime, &live->err) : 0;

	if (!rc)
		rc = incise_loop_run(live->plan, live->clock, &live->options,
				     &live->stats, &live->err);
	atomic_store(&live->rc, rc);
	atomic_store(&live->ended, true);
	return NULL;
}

static int start_live(struct view_live *live, struct incise_error *err)
{
	sigset_t all, before;
	int rc;

	sigfillset(&all);
	pthread_sigmask(SIG_SETMASK, &all, &before);
	rc = pthread_create(&live->thread, NULL, run, live);
	pthread_sigmask(SIG_SETMASK, &before, NULL);
	live->started = !rc;
	return rc ? incise_error_set(err, rc, "the loop's thread: %s", strerror(rc)) : 0;
}

struct view_live *view_live_begin(struct incise_plan *plan, struct incise_rig *rig,
				  double rate_hz, struct incise_realtime *realtime,
				  struct incise_error *err)
{
	struct incise_state_setup setup = {.rate_hz = rate_hz,
					   .rig = incise_rig_spec(rig)};
	struct view_live *live = calloc(1, sizeof(*live));
	int rc = -ENOMEM;

	if (!live)
		return NULL;
	live->own = true;
	live->plan = plan;
	live->clock = incise_rig_clock(rig);
	live->realtime = realtime;
	live->options = (struct incise_loop_options){.rate_hz = rate_hz,
						     .stop = &live->stop,
						     .ticked = take_tool,
						     .context = live};
	snprintf(live->page, sizeof(live->page), "/dev/shm/incise-view-%d.state",
		 (int)getpid());
	live->options.state = incise_state_new(live->page, &setup, err);
	if (live->options.state) {
		incise_state_run(live->options.state, INCISE_RUN_RUNNING, "");
		live->state = incise_state_open(live->page, err);
		rc = live->state ? start_live(live, err) : -errno;
		/* Not for other programs. */
		unlink(live->page);
	} else {
		rc = -errno;
	}
	if (!rc)
		return live;
	view_live_close(live);
	errno = -rc;
	return NULL;
}

void view_live_tool(struct view_live *live, enum incise_tool tool)
{
	atomic_store_explicit(&live->tool, (int)tool, memory_order_relaxed);
}

static void set_status(const struct view_live *live, struct incise_view_status *status)
{
	const struct incise_state_now *now = &live->now;

	*status = (struct incise_view_status){
		.state = now->alive ? incise_run_name(now->run) : "ended",
		.rate_hz = now->rate_hz,
		.lateness_median_us = NAN,
		.lateness_999_us = NAN,
		.lost = live->lost,
	};
	if (!now->ticks)
		return;
	status->lateness_median_us = incise_state_quantile(&now->lateness, 0.5) * 1e-3;
	status->lateness_999_us = incise_state_quantile(&now->lateness, 0.999) * 1e-3;
}

int view_live_take(struct view_live *live, struct incise_view *view,
		   struct session_log *log, struct incise_view_status *status,
		   struct incise_error *err)
{
	int n = BATCH, rc = incise_state_read(live->state, &live->now);

	if (rc && rc != -EAGAIN)
		return incise_error_set(err, -rc,
					"the status file of the loop cannot "
					"be read: %s",
					strerror(-rc));
	while (n == BATCH) {
		n = incise_state_ticks(live->state, &live->cursor, live->ticks, BATCH,
				       &live->lost);
		/* Cut off by others, and written anew just now. */
		if (n == -EAGAIN)
			break;
		if (n < 0)
			return incise_error_set(err, -n,
						"the status file of the loop cannot be "
						"read: %s",
						strerror(-n));
		incise_view_ticks(view, live->ticks, n);
		for (int i = 0; i < n && (live->own || live->looked); i++)
			session_log_tick(log, &live->ticks[i]);
	}
	/* The frame has the ticks of the page, a session the ticks since. */
	if (!live->own && !live->looked) {
		live->lost_before = live->lost;
		live->reloads = live->now.reloads;
	}
	live->looked = true;
	session_log_lost(log, live->lost - live->lost_before);
	set_status(live, status);
	if (log && live->now.reloads != live->reloads)
		return incise_error_set(
			err, EBUSY,
			"the loop started another scene, but a session has one; start "
			"the view again");
	if (live->own && atomic_load(&live->ended)) {
		rc = atomic_load(&live->rc);
		if (rc)
			*err = live->err;
		return rc ? rc : 1;
	}
	return !live->own && !live->now.alive;
}

const char *view_live_fault(const struct view_live *live)
{
	if (live->own || live->now.alive)
		return NULL;
	if (live->now.run == INCISE_RUN_FAULT)
		return live->now.reason;
	return live->now.run == INCISE_RUN_STOPPED ? NULL
						   : "the loop exited without cleanup";
}

void view_live_close(struct view_live *live)
{
	if (!live)
		return;
	live->stop = 1;
	if (live->started)
		pthread_join(live->thread, NULL);
	incise_state_close(live->state);
	incise_state_free(live->options.state);
	free(live);
}
