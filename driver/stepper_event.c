// SPDX-License-Identifier: GPL-2.0-only
/*
 * The ring of events. Written from hard interrupts, read by each open file at its
 * own place; a slow reader finds a gap in seq and never stops the writer.
 *
 *      ring   │ 5 │ 6 │ 7 │ 4 │        seq of the last: 7
 *                   ▲
 *                   a file that has read up to 5
 */
#include <linux/irq_work.h>
#include <linux/wait.h>

#include "stepper.h"

static void stepper_event_wake(struct irq_work *work)
{
	struct stepper *stepper = container_of(work, struct stepper, wake);

	wake_up_interruptible_all(&stepper->wait);
	stepper_latency_event(stepper);
}

void stepper_event_init(struct stepper *stepper)
{
	raw_spin_lock_init(&stepper->events.lock);
	init_waitqueue_head(&stepper->wait);
	init_irq_work(&stepper->wake, stepper_event_wake);
}

/* From any context: a wake-up is not for hard interrupts, so it is left to irq_work. */
void stepper_event_put(struct stepper *stepper, const struct incise_stepper_event *event)
{
	struct stepper_events *events = &stepper->events;
	struct incise_stepper_event *to;
	unsigned long flags;

	raw_spin_lock_irqsave(&events->lock, flags);
	events->seq++;
	to = &events->ring[events->seq % STEPPER_EVENTS];
	*to = *event;
	to->seq = events->seq;
	raw_spin_unlock_irqrestore(&events->lock, flags);
	irq_work_queue(&stepper->wake);
}

u64 stepper_event_last(struct stepper *stepper)
{
	unsigned long flags;
	u64 seq;

	raw_spin_lock_irqsave(&stepper->events.lock, flags);
	seq = stepper->events.seq;
	raw_spin_unlock_irqrestore(&stepper->events.lock, flags);
	return seq;
}

/**
 * stepper_event_take() - copy events out of the ring
 * @stepper:	the controller
 * @after:	seq of the last one taken; moved on
 * @to:		where
 * @n:		capacity, small: interrupts are off meanwhile
 *
 * Return: how many.
 */
unsigned int stepper_event_take(struct stepper *stepper, u64 *after,
				struct incise_stepper_event *to, unsigned int n)
{
	struct stepper_events *events = &stepper->events;
	unsigned long flags;
	unsigned int i;

	raw_spin_lock_irqsave(&events->lock, flags);
	if (events->seq - *after > STEPPER_EVENTS)
		*after = events->seq - STEPPER_EVENTS;
	for (i = 0; i < n && *after < events->seq; i++)
		to[i] = events->ring[++*after % STEPPER_EVENTS];
	raw_spin_unlock_irqrestore(&events->lock, flags);
	return i;
}
