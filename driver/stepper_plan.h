/* SPDX-License-Identifier: GPL-2.0-only */
/*
 * A plan in the module: the state that its load and its ticks share; see stepper_plan.c.
 */
#ifndef INCISE_DRIVER_STEPPER_PLAN_H
#define INCISE_DRIVER_STEPPER_PLAN_H

#include "../lib/fixed/plan.h"
#include "stepper.h"

#define STEPPER_PLAN_NO_AIM S64_MIN

/* The state up to the cuts, which outlive a start of the same plan. */
#define STEPPER_PLAN_BEGIN offsetof(struct incise_fixed_state, incision)

/**
 * struct stepper_plan - a plan and its state
 * @stepper:	whose motors it moves
 * @leader:	of its motors the lowest, whose timer runs its ticks
 * @load:	what LOAD_PLAN said
 * @file:	the copy of the user's file that @view looks into
 * @crc:	of it
 * @view:	checked
 * @cost_ns:	cost of nine in ten ticks when it was loaded
 * @orphan:	goes when its motors have no power; stepper.mutex
 * @running:	the leader's set-point says mode POSE. From here on to @state: leader's lock, if
 *		nothing else is said
 * @quiet:	there is no force, and none comes by itself; read without a lock
 * @leaving:	INCISE_STEPPER_PLAN_LEFT, _AWAY: why it is to fade; read without a lock
 * @fresh:	the leader's set-point has a pose that the plan has not got
 * @tube:	last set-point of the tube's slot
 * @due_ns:	of the next tick
 * @late_row:	ticks in a row that came too late, or took too long
 * @digest:	register of the CRC, not inverted
 * @status:	as it was last published, but for seq
 * @lateness:	of its ticks
 * @cost:	of them
 * @tick:	the last one
 * @lock:	writers of @stops
 * @aim:	per axis, read by the motors on any processor: steps or STEPPER_PLAN_NO_AIM
 * @life_ns:	when the last pose was taken; read likewise
 * @stops:	counts what ends the run of all of its motors; read likewise
 * @stop_fault:	what they get; written before @stops
 * @begin:	@state at the begin, up to the cuts
 * @state:	of the plan
 */
struct stepper_plan {
	struct stepper *stepper;
	struct stepper_motor *leader;
	struct incise_stepper_plan load;
	void *file;
	u32 crc;
	struct incise_fixed_plan view;
	u32 cost_ns;
	bool orphan;

	bool running;
	bool quiet;
	u32 leaving;
	bool fresh;
	struct stepper_setpoint tube;
	s64 due_ns;
	u32 late_row;
	u32 digest;
	struct incise_stepper_plan_status status;
	struct stepper_histogram lateness, cost;
	struct incise_fixed_tick tick;

	raw_spinlock_t lock; /* see stops */
	s64 aim[INCISE_FIXED_AXES_MAX];
	s64 life_ns;
	u32 stops;
	u32 stop_fault;

	u8 begin[STEPPER_PLAN_BEGIN] __aligned(8);
	struct incise_fixed_state state;
};

/* stepper_plan.c: leader->lock held */
void stepper_plan_publish(struct stepper_plan *plan, u32 state, s64 t_ns);

#endif
