// SPDX-License-Identifier: GPL-2.0-only
/*
 * The SYNC line: pulses at a fixed period for a camera's trigger, a tracker's external
 * sync or a lamp. Each is timestamped and counted, and is an event: the hardware way to one
 * time line.
 *
 *          first_ns        + period        + 2 period
 *   sync ______┌───┐___________┌───┐___________┌───┐___
 *              ◀──▶ width
 *
 * Pulse k is due at first + k·period for ever: lateness does not add up. Pulses that a
 * timer was too late for are left out and counted as missed, so that time and count
 * stay together: due = first + (pulses + missed - 1)·period.
 */
#include <linux/hrtimer.h>
#include <linux/ktime.h>
#include <linux/math64.h>

#include "compat.h"
#include "stepper.h"
#include "trace.h"

/* From SET_SYNC to the first pulse, unless the request names it. */
#define FIRST_NS 100000

static void stepper_sync_lead(struct stepper *stepper, s64 now)
{
	struct stepper_sync_line *line = &stepper->sync;
	struct incise_stepper_event event = {.type = INCISE_STEPPER_EVENT_SYNC};
	s64 late = now - line->due_ns;
	u64 skip = 0;

	if (late >= (s64)line->sync.period_ns) {
		skip = div64_u64(late, line->sync.period_ns);
		line->sync.missed += skip;
		line->due_ns += skip * line->sync.period_ns;
	}
	line->high = true;
	compat_gpiod_set_value(line->line, 1);
	line->sync.last_ns = ktime_get_ns();
	line->sync.pulses++;
	trace_incise_stepper_edge(stepper->id, 0, STEPPER_SYNC, true, line->due_ns,
				  line->sync.last_ns);
	event.t_ns = line->sync.last_ns;
	event.position = line->sync.pulses;
	stepper_event_put(stepper, &event);
}

static void stepper_sync_trail(struct stepper *stepper, s64 due)
{
	struct stepper_sync_line *line = &stepper->sync;

	line->high = false;
	compat_gpiod_set_value(line->line, 0);
	trace_incise_stepper_edge(stepper->id, 0, STEPPER_SYNC, false, due,
				  ktime_get_ns());
	line->due_ns += line->sync.period_ns;
}

static enum hrtimer_restart stepper_sync_fire(struct hrtimer *timer)
{
	struct stepper *stepper = container_of(timer, struct stepper, sync.timer);
	struct stepper_sync_line *line = &stepper->sync;
	enum hrtimer_restart restart = HRTIMER_NORESTART;
	unsigned long flags;
	s64 due;

	raw_spin_lock_irqsave(&line->lock, flags);
	if (line->running) {
		if (line->high)
			stepper_sync_trail(stepper,
					   ktime_to_ns(hrtimer_get_expires(timer)));
		else
			stepper_sync_lead(stepper, ktime_get_ns());
		/* The width counts from the actual edge. */
		due = line->high ? line->sync.last_ns + line->sync.width_ns
				 : line->due_ns;
		hrtimer_set_expires(timer, ns_to_ktime(due));
		restart = HRTIMER_RESTART;
	}
	raw_spin_unlock_irqrestore(&line->lock, flags);
	return restart;
}

void stepper_sync_init(struct stepper *stepper)
{
	raw_spin_lock_init(&stepper->sync.lock);
	hrtimer_setup(&stepper->sync.timer, stepper_sync_fire, CLOCK_MONOTONIC,
		      HRTIMER_MODE_ABS_PINNED_HARD);
}

/* Line inactive, nothing running. Sleeps; stepper.mutex held, or no other user exists. */
void stepper_sync_off(struct stepper *stepper)
{
	struct stepper_sync_line *line = &stepper->sync;
	unsigned long flags;

	raw_spin_lock_irqsave(&line->lock, flags);
	line->running = false;
	raw_spin_unlock_irqrestore(&line->lock, flags);
	hrtimer_cancel(&line->timer);
	if (line->high)
		stepper_sync_trail(stepper, ktime_get_ns());
}

/* Goes on in its beat after stepper_sync_off(); pulses of meanwhile are missed. */
void stepper_sync_resume(struct stepper *stepper)
{
	struct stepper_sync_line *line = &stepper->sync;
	unsigned long flags;

	raw_spin_lock_irqsave(&line->lock, flags);
	if (line->sync.period_ns && !line->running) {
		line->running = true;
		hrtimer_start(&line->timer, ns_to_ktime(line->due_ns),
			      HRTIMER_MODE_ABS_PINNED_HARD);
	}
	raw_spin_unlock_irqrestore(&line->lock, flags);
}

/**
 * stepper_sync_set() - other pulses, or none
 * @stepper:	the controller; its mutex held
 * @sync:	from a user
 *
 * Return: 0; -EOPNOTSUPP there is no SYNC line; -EINVAL.
 */
int stepper_sync_set(struct stepper *stepper, const struct incise_stepper_sync *sync)
{
	struct stepper_sync_line *line = &stepper->sync;
	unsigned long flags;
	s64 now;

	if (!line->line)
		return -EOPNOTSUPP;
	if (sync->reserved0 || sync->reserved[0] || sync->reserved[1] || sync->pulses ||
	    sync->last_ns || sync->missed || sync->first_ns < 0)
		return -EINVAL;
	if (sync->period_ns &&
	    (sync->period_ns < 100000 || sync->period_ns > 10000000000ULL ||
	     sync->width_ns < 1000 || sync->width_ns > sync->period_ns / 2))
		return -EINVAL;
	now = ktime_get_ns();
	/* A first pulse in the far future is a mistake of units, not a plan. */
	if (sync->first_ns > now + 3600LL * NSEC_PER_SEC)
		return -EINVAL;

	stepper_sync_off(stepper);
	raw_spin_lock_irqsave(&line->lock, flags);
	line->sync = *sync;
	if (sync->period_ns) {
		/* If that is over already: the next that fits its beat. */
		if (!sync->first_ns)
			line->sync.first_ns = now + FIRST_NS;
		else if (sync->first_ns < now)
			line->sync.first_ns +=
				sync->period_ns *
				(div64_u64(now - sync->first_ns, sync->period_ns) + 1);
		line->due_ns = line->sync.first_ns;
		line->running = true;
		hrtimer_start(&line->timer, ns_to_ktime(line->due_ns),
			      HRTIMER_MODE_ABS_PINNED_HARD);
	}
	raw_spin_unlock_irqrestore(&line->lock, flags);
	return 0;
}

void stepper_sync_get(struct stepper *stepper, struct incise_stepper_sync *sync)
{
	struct stepper_sync_line *line = &stepper->sync;
	unsigned long flags;

	raw_spin_lock_irqsave(&line->lock, flags);
	*sync = line->sync;
	raw_spin_unlock_irqrestore(&line->lock, flags);
}
