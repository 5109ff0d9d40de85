/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The door between a running loop and the rest of its program: new plans go in, events come
 * out, and neither waits for the other.
 *
 *     another thread                          the loop's thread
 *     offer(new plan) ──▶ [ one place ] ──▶   fades its force out, ticks the new plan from
 *     retired()  ◀──────  [ one place ]  ◀──  there on, which begins as each does: without
 *     events()   ◀──────  [   ring    ]  ◀──  a force until one that is small is asked for
 *     ticks()    ◀──────  [  counter  ]
 *
 * All functions but those that say so belong to one thread, which is not the loop's; none
 * of them waits.
 */
#ifndef INCISE_LOOP_CONTROL_H
#define INCISE_LOOP_CONTROL_H

#include <stdint.h>
#include <incise/export.h>
#include <incise/plan.h>

INCISE_BEGIN_DECLS

struct incise_loop_control;

/**
 * @return control, to be freed with incise_loop_control_free() when no loop runs with it;
 *         NULL with errno ENOMEM.
 */
INCISE_API struct incise_loop_control *incise_loop_control_new(void);

/** Plans are not freed: they are their owner's. */
INCISE_API void incise_loop_control_free(struct incise_loop_control *control);

/**
 * Give the loop another plan, on the same rig and for the same rate. It is in force when
 * incise_loop_control_retired() gives the old one back, at the latest after what
 * incise_plan_fade_ns() of the old one says, as long as the loop ticks.
 *
 * @return 0; -EBUSY (another one waits, or a retired one was not taken)
 */
INCISE_API int incise_loop_control_offer(struct incise_loop_control *control,
					 struct incise_plan *plan);

/** Take back what was offered and is not in force; NULL when there is none. */
INCISE_API struct incise_plan *incise_loop_control_withdraw(
	struct incise_loop_control *control);

/** The plan that the one offered has taken the place of, once; else NULL. */
INCISE_API struct incise_plan *incise_loop_control_retired(
	struct incise_loop_control *control);

/** Ticks that have run, so far: what does not grow does not live. Any thread's. */
INCISE_API uint64_t incise_loop_control_ticks(const struct incise_loop_control *control);

/** What a loop tells of, and what its value then is. */
enum incise_loop_event_kind {
	INCISE_LOOP_OVERRUN,	/**< late by a period or more: value ticks were skipped */
	INCISE_LOOP_STALE,	/**< no fresh pose from here on: the force fades */
	INCISE_LOOP_FRESH,	/**< poses come again, after value ms */
	INCISE_LOOP_NOT_FINITE, /**< forces from here on were no numbers, and are none */
	INCISE_LOOP_PLAN,	/**< the plan that was offered is in force */
};

/** Something that a log is for. */
struct incise_loop_event {
	int64_t t_ns;  /**< of the tick */
	uint64_t tick; /**< that tick, from 0 */
	double value;  /**< see the kind */
	enum incise_loop_event_kind kind;
};

/** Take events that have happened, oldest first. @return how many of at most @n. */
INCISE_API int incise_loop_control_events(struct incise_loop_control *control,
					  struct incise_loop_event *events, int n);

/** Events that were not kept, as nobody had taken the ones before. */
INCISE_API uint64_t
incise_loop_control_events_lost(const struct incise_loop_control *control);

INCISE_END_DECLS
#endif
