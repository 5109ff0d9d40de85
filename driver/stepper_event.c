// SPDX-License-Identifier: GPL-2.0-only
/*
 * The ring of events. Written from hard interrupts, read by each open file at its
 * own place; a slow reader finds a gap in seq and never stops the writer.
 *
 *      ring   │ 5 │ 6 │ 7 │ 4 │        seq of the last: 7
 *                   ▲
 *                   a file that has read up to 5
 */
#include <linux/kthread.h>
#include <linux/sched.h>
#include <linux/wait.h>

#include "stepper.h"

/*
 * The herald: a thread bound to no processor, as readers must hear of a stop while a program keeps
 * the timer's processor for itself. The waiting queue's lock sleeps on PREEMPT_RT, so that a
 * hard interrupt wakes the herald, and the herald the readers.
 */
static int stepper_event_tell(void *data)
{
	struct stepper *stepper = data;

	sched_set_fifo(current);
	for (;;) {
		set_current_state(TASK_IDLE);
		if (kthread_should_stop())
			break;
		if (!atomic_xchg(&stepper->news, 0)) {
			schedule();
			continue;
		}
		__set_current_state(TASK_RUNNING);
		wake_up_interruptible_all(&stepper->wait);
		stepper_latency_event(stepper);
	}
	__set_current_state(TASK_RUNNING);
	return 0;
}

int stepper_event_start(struct stepper *stepper)
{
	struct task_struct *herald;

	herald = kthread_run(stepper_event_tell, stepper, "%s", dev_name(&stepper->dev));
	if (IS_ERR(herald))
		return PTR_ERR(herald);
	stepper->herald = herald;
	return 0;
}

/* No event comes any more. Sleeps. */
void stepper_event_end(struct stepper *stepper)
{
	if (stepper->herald)
		kthread_stop(stepper->herald);
	stepper->herald = NULL;
}

/* From any context. */
void stepper_event_wake(struct stepper *stepper)
{
	atomic_inc(&stepper->news);
	if (stepper->herald)
		wake_up_process(stepper->herald);
}

void stepper_event_init(struct stepper *stepper)
{
	raw_spin_lock_init(&stepper->events.lock);
	init_waitqueue_head(&stepper->wait);
}

/* From any context. */
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
	stepper_event_wake(stepper);
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
