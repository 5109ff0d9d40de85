/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The interface between a running loop and the rest of its program: it passes new plans in and
 * events out, and neither side waits for the other.
 *
 *     another thread                          the loop's thread
 *     offer(new plan) ──▶ [ one place ] ──▶   ramps its force to 0, then ticks the new plan,
 *     retired()  ◀──────  [ one place ]  ◀──  which starts like any other: without a force
 *     events()   ◀──────  [   ring    ]  ◀──  until it requests a small one
 *     take()     ◀──────  [   ring    ]  ◀──  each tick, where keep() made a ring for them
 *     ticks(), tool()  ◀──  [ counters  ]
 *     set_tool() ──────▶  [ one place ] ──▶   takes it at its next tick
 *
 * Unless stated otherwise, call these functions from one thread other than the loop's; none
 * waits.
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
 * Offer another plan to the loop, on the same rig and for the same rate. It is active when
 * incise_loop_control_retired() returns the old one: within incise_plan_fade_ns() of the old
 * one, as long as the loop ticks.
 *
 * @return 0; -EBUSY (another plan waits, or the retired one was not taken)
 */
INCISE_API int incise_loop_control_offer(struct incise_loop_control *control,
					 struct incise_plan *plan);

/** Take back an offered plan that is not active; NULL without such a plan. */
INCISE_API struct incise_plan *incise_loop_control_withdraw(
	struct incise_loop_control *control);

/** The plan that the offered one replaced, returned once; else NULL. */
INCISE_API struct incise_plan *incise_loop_control_retired(
	struct incise_loop_control *control);

/** Number of ticks so far. For any thread. */
INCISE_API uint64_t incise_loop_control_ticks(const struct incise_loop_control *control);

/**
 * Set the tool in the hand, as incise_plan_set_tool() does. The loop applies the last setting
 * at its next tick, to its plan and to those that replace it. Without this call each plan
 * keeps its own. For any thread; never waits.
 *
 * @return 0, -EINVAL
 */
INCISE_API int incise_loop_control_set_tool(struct incise_loop_control *control,
					    enum incise_tool tool) INCISE_REALTIME;

/** The tool at the last tick; INCISE_TOOL_AUTO before the first. For any thread. */
INCISE_API enum incise_tool incise_loop_control_tool(
	const struct incise_loop_control *control);

/** Kinds of events, and the meaning of their value. */
enum incise_loop_event_kind {
	/** late by at least a period: value ticks were skipped */
	INCISE_LOOP_OVERRUN,
	INCISE_LOOP_STALE,	/**< no fresh pose from now on: the force ramps to 0 */
	INCISE_LOOP_FRESH,	/**< fresh poses again, after value ms */
	INCISE_LOOP_NOT_FINITE, /**< forces from now on are not finite, and set to 0 */
	INCISE_LOOP_PLAN,	/**< the offered plan is active */
	INCISE_LOOP_FLAGGED,	/**< flags of poses changed: value is the character */
	INCISE_LOOP_TOOL,	/**< the tool changed: value is enum incise_tool */
	INCISE_LOOP_HAPTIC, /**< the device takes a force or none: enum incise_haptic_off */
};

/** An event for the log. */
struct incise_loop_event {
	int64_t t_ns;  /**< time of the tick */
	uint64_t tick; /**< number of the tick, from 0 */
	double value;  /**< meaning depends on the kind */
	enum incise_loop_event_kind kind;
};

/** Take events, oldest first. @return their number, at most @n. */
INCISE_API int incise_loop_control_events(struct incise_loop_control *control,
					  struct incise_loop_event *events, int n);

/**
 * Keep ticks for incise_loop_control_take(). Call it before the loop runs; it allocates and
 * touches the memory.
 *
 * @param n smallest capacity; a tick without space is lost
 * @return 0; -EINVAL (0, or too many), -EEXIST (called before), -ENOMEM
 */
INCISE_API int incise_loop_control_keep(struct incise_loop_control *control, size_t n);

/**
 * Take the kept ticks, each once and oldest first, except a tick in which a device failed.
 *
 * @param n    capacity of @ticks
 * @param lost set to the number of lost ticks so far; or NULL
 * @return number of ticks. Never waits.
 */
INCISE_API int incise_loop_control_take(struct incise_loop_control *control,
					struct incise_tick *ticks, int n, uint64_t *lost);

INCISE_END_DECLS
#endif
