/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The interface between a running loop and the rest of its program: new plans go in, events come
 * out, and neither side waits for the other.
 *
 *     another thread                          the loop's thread
 *     offer(new plan) ──▶ [ one place ] ──▶   fades its force out, then ticks the new plan,
 *     retired()  ◀──────  [ one place ]  ◀──  which starts like any other: without a force
 *     events()   ◀──────  [   ring    ]  ◀──  until it requests a small one
 *     take()     ◀──────  [   ring    ]  ◀──  each tick, where keep() made a ring for them
 *     ticks(), tool()  ◀──  [ counters  ]
 *     set_tool() ──────▶  [ one place ] ──▶   takes it at its next tick
 *
 * Unless stated otherwise, functions belong to one thread, which is not the loop's; none waits.
 */
#ifndef INCISE_LOOP_CONTROL_H
#define INCISE_LOOP_CONTROL_H

#include <stddef.h>
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

/** Does not free plans. */
INCISE_API void incise_loop_control_free(struct incise_loop_control *control);

/**
 * Give the loop another plan, on the same rig and for the same rate. It is in force when
 * incise_loop_control_retired() returns the old one: within incise_plan_fade_ns() of the old
 * one, as long as the loop ticks.
 *
 * @return 0; -EBUSY (another one waits, or nobody took the retired one)
 */
INCISE_API int incise_loop_control_offer(struct incise_loop_control *control,
					 struct incise_plan *plan);

/** Take back an offered plan that is not in force; NULL when there is none. */
INCISE_API struct incise_plan *incise_loop_control_withdraw(
	struct incise_loop_control *control);

/** The plan that the offered one replaced, once; else NULL. */
INCISE_API struct incise_plan *incise_loop_control_retired(
	struct incise_loop_control *control);

/** Number of ticks so far: a living loop raises it. For any thread. */
INCISE_API uint64_t incise_loop_control_ticks(const struct incise_loop_control *control);

/**
 * Set the tool that the hand holds, as with incise_plan_set_tool(): the loop takes it at its next
 * tick, for its plan and for each that replaces it. The last one counts. Without this call each
 * plan keeps its own. For any thread; never waits.
 *
 * @return 0, -EINVAL
 */
INCISE_API int incise_loop_control_set_tool(struct incise_loop_control *control,
					    enum incise_tool tool) INCISE_REALTIME;

/** The tool held at the last tick; INCISE_TOOL_AUTO before the first. For any thread. */
INCISE_API enum incise_tool incise_loop_control_tool(
	const struct incise_loop_control *control);

/** Kinds of events, and the meaning of their value. */
enum incise_loop_event_kind {
	INCISE_LOOP_OVERRUN,	/**< late by a period or more: value ticks were skipped */
	INCISE_LOOP_STALE,	/**< no fresh pose from here on: the force fades */
	INCISE_LOOP_FRESH,	/**< fresh poses again, after value ms */
	INCISE_LOOP_NOT_FINITE, /**< forces from here on were not finite, and are set to 0 */
	INCISE_LOOP_PLAN,	/**< the offered plan is in force */
	INCISE_LOOP_FLAGGED, /**< the tracker flags poses: value is another character */
	INCISE_LOOP_TOOL, /**< another tool is held from here on: value is enum incise_tool */
};

/** An event for the log. */
struct incise_loop_event {
	int64_t t_ns;  /**< of the tick */
	uint64_t tick; /**< that tick, from 0 */
	double value;  /**< see the kind */
	enum incise_loop_event_kind kind;
};

/** Take events, oldest first. @return their number, at most @n. */
INCISE_API int incise_loop_control_events(struct incise_loop_control *control,
					  struct incise_loop_event *events, int n);

/**
 * Keep ticks for incise_loop_control_take(), before the loop runs: the memory is allocated and
 * touched here.
 *
 * @param n how many wait at least; one that finds no place is lost
 * @return 0; -EINVAL (0, or more than memory can hold), -EEXIST (they are kept already), -ENOMEM
 */
INCISE_API int incise_loop_control_keep(struct incise_loop_control *control, size_t n);

/**
 * Take the ticks that are kept, each once and oldest first; all but one that a device failed in.
 *
 * @param n    capacity of @ticks
 * @param lost set to the number of ticks that found no place so far; or NULL
 * @return how many ticks. Never waits.
 */
INCISE_API int incise_loop_control_take(struct incise_loop_control *control,
					struct incise_tick *ticks, int n, uint64_t *lost);

INCISE_END_DECLS
#endif
