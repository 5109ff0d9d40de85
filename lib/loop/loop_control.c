// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The interface between a running loop and the rest of its program; see incise/loop_control.h.
 */
#include <errno.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include "../base/ring.h"
#include "loop_control.h"

/* More than a second of a loop that overruns at each tick of 100 Hz … 500 Hz. */
#define EVENTS 512

struct incise_loop_control {
	_Atomic(struct incise_plan *) offered, retired;
	_Atomic uint64_t ticks;
	_Atomic int tool;   /* at the last tick */
	_Atomic int wanted; /* tool that was set, + 1; 0: not set */
	struct incise_ring events;
	struct incise_ring kept; /* ticks; without memory unless a caller wants them */
};

struct incise_loop_control *incise_loop_control_new(void)
{
	/* The two sides of the ring are on different cache lines. */
	struct incise_loop_control *control =
		aligned_alloc(_Alignof(struct incise_loop_control), sizeof(*control));

	if (!control)
		return NULL;
	*control = (struct incise_loop_control){.ticks = 0};
	if (!incise_ring_init(&control->events, sizeof(struct incise_loop_event), EVENTS))
		return control;
	free(control);
	errno = ENOMEM;
	return NULL;
}

void incise_loop_control_free(struct incise_loop_control *control)
{
	if (!control)
		return;
	incise_ring_free(&control->events);
	incise_ring_free(&control->kept);
	free(control);
}

int incise_loop_control_offer(struct incise_loop_control *control,
			      struct incise_plan *plan)
{
	struct incise_plan *none = NULL;

	/* There is one place for the retired plan. */
	if (atomic_load_explicit(&control->retired, memory_order_acquire))
		return -EBUSY;
	return atomic_compare_exchange_strong(&control->offered, &none, plan) ? 0
									      : -EBUSY;
}

struct incise_plan *incise_loop_control_withdraw(struct incise_loop_control *control)
{
	return atomic_exchange(&control->offered, NULL);
}

struct incise_plan *incise_loop_control_retired(struct incise_loop_control *control)
{
	return atomic_exchange(&control->retired, NULL);
}

uint64_t incise_loop_control_ticks(const struct incise_loop_control *control)
{
	return atomic_load_explicit(&control->ticks, memory_order_relaxed);
}

int incise_loop_control_set_tool(struct incise_loop_control *control,
				 enum incise_tool tool)
{
	if ((unsigned int)tool > INCISE_TOOL_TUBE)
		return -EINVAL;
	atomic_store_explicit(&control->wanted, (int)tool + 1, memory_order_relaxed);
	return 0;
}

enum incise_tool incise_loop_control_tool(const struct incise_loop_control *control)
{
	return (enum incise_tool)atomic_load_explicit(&control->tool,
						      memory_order_relaxed);
}

int incise_loop_control_events(struct incise_loop_control *control,
			       struct incise_loop_event *events, int n)
{
	return incise_ring_take(&control->events, events, n);
}

uint64_t incise_loop_control_events_lost(const struct incise_loop_control *control)
{
	return incise_ring_dropped(&control->events);
}

bool incise_loop_control_waiting(const struct incise_loop_control *control)
{
	return atomic_load_explicit(&control->offered, memory_order_acquire) &&
	       !atomic_load_explicit(&control->retired, memory_order_acquire);
}

struct incise_plan *incise_loop_control_next(struct incise_loop_control *control)
{
	return atomic_exchange(&control->offered, NULL);
}

void incise_loop_control_retire(struct incise_loop_control *control,
				struct incise_plan *old)
{
	atomic_store_explicit(&control->retired, old, memory_order_release);
}

void incise_loop_control_event(struct incise_loop_control *control,
			       const struct incise_loop_event *event)
{
	incise_ring_put(&control->events, event);
}

void incise_loop_control_ticked(struct incise_loop_control *control, uint64_t ticks,
				enum incise_tool tool)
{
	atomic_store_explicit(&control->tool, (int)tool, memory_order_relaxed);
	atomic_store_explicit(&control->ticks, ticks, memory_order_relaxed);
}

int incise_loop_control_keep(struct incise_loop_control *control, size_t n)
{
	int rc;

	if (control->kept.records)
		return -EEXIST;
	rc = incise_ring_init(&control->kept, sizeof(struct incise_tick), n);
	/* A page fault in the loop is a late tick. */
	if (!rc)
		memset(control->kept.records, 0xff,
		       control->kept.size * control->kept.capacity);
	return rc;
}

int incise_loop_control_take(struct incise_loop_control *control,
			     struct incise_tick *ticks, int n, uint64_t *lost)
{
	int taken =
		control->kept.records ? incise_ring_take(&control->kept, ticks, n) : 0;

	/* Behind the ticks: those lost since then follow them. */
	if (lost)
		*lost = incise_ring_dropped(&control->kept);
	return taken;
}

void incise_loop_control_tick(struct incise_loop_control *control,
			      const struct incise_tick *tick)
{
	if (control->kept.records)
		incise_ring_put(&control->kept, tick);
}

bool incise_loop_control_wanted_tool(const struct incise_loop_control *control,
				     enum incise_tool *tool)
{
	int wanted = atomic_load_explicit(&control->wanted, memory_order_relaxed);

	if (wanted)
		*tool = (enum incise_tool)(wanted - 1);
	return wanted;
}
