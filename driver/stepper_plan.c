// SPDX-License-Identifier: GPL-2.0-only
/*
 * Ticks of a plan: lib/fixed's tick with the poses of the page. The timer of the
 * plan's first motor, its leader, runs them between that motor's own ticks and edges; the other
 * motors of the plan, its followers, read their targets at their ticks, on whatever processor.
 *
 *   due      k                          k + 1                    by the plan's own time line
 *   leader ──╫─ pose ─▶ plan ─▶ aim[] ──╫──────────
 *                                │
 *   ticks  ────┬─────────────────┴─┬──────────────┬──           of each motor: aim ─▶ profile
 *
 * A tick computes with the time at which it was due, never with now: its result depends on poses
 * and on nothing else, and a program that is given the same gets the same bits. A tick that is late
 * by a period or more is left out and counted.
 *
 * Data of the leader's timer alone are under the leader's lock; followers read single words. A
 * motor that stops leaves the run, and by a fault it ends the run for all.
 */
#include <linux/crc32c.h>
#include <linux/delay.h>
#include <linux/ktime.h>
#include <linux/math64.h>
#include <linux/seq_file.h>

#include "stepper_plan.h"
#include "trace.h"

/* These stop every motor by themselves. */
#define STOPS_ALL                                                    \
	(INCISE_STEPPER_FAULT_OWNER | INCISE_STEPPER_FAULT_SUSPEND | \
	 INCISE_STEPPER_FAULT_GONE)

#define STATUS_WORDS (sizeof(struct incise_stepper_plan_status) / sizeof(u64))

static bool stepper_plan_leads(const struct stepper_motor *motor)
{
	return motor->plan && motor->plan->leader == motor;
}

/* --- status ----------------------------------------------------------------------------- */

/* Show plan->status, in a state; leader->lock held. */
void stepper_plan_publish(struct stepper_plan *plan, u32 state, s64 t_ns)
{
	struct incise_stepper_plan_status *page =
		(void *)&plan->stepper->status[INCISE_STEPPER_SLOT_PLAN];
	const u64 *from = (const u64 *)&plan->status;
	struct incise_stepper_event event = {
		.t_ns = t_ns,
		.position = plan->status.ticks,
		.type = INCISE_STEPPER_EVENT_PLAN,
		.motor = plan->leader->index,
		.value = state,
	};
	u32 before = page->state, seq = page->seq;
	unsigned int i;

	plan->status.state = state;
	plan->status.digest = ~plan->digest;
	WRITE_ONCE(page->seq, seq + 1);
	smp_wmb(); /* seq before the fields */
	WRITE_ONCE(page->state, state);
	for (i = 1; i < STATUS_WORDS; i++)
		WRITE_ONCE(((u64 *)page)[i], from[i]);
	smp_wmb(); /* the fields before seq */
	WRITE_ONCE(page->seq, seq + 2);
	if (before != state)
		stepper_event_put(plan->stepper, &event);
}

static void stepper_plan_fill(struct incise_stepper_plan_status *status,
			      const struct incise_fixed_tick *tick)
{
	status->t_ns = tick->t_ns;
	status->age_ns = tick->age_ns;
	status->flags = tick->flags;
	status->phase = tick->phase;
	status->held = tick->held;
	memcpy(status->tool, tick->tool, sizeof(status->tool));
	memcpy(status->proxy, tick->proxy, sizeof(status->proxy));
	memcpy(status->normal, tick->normal, sizeof(status->normal));
	memcpy(status->quaternion, tick->attitude, sizeof(status->quaternion));
	status->depth = tick->depth;
	status->speed = tick->speed;
	memcpy(status->command, tick->command, sizeof(status->command));
	memcpy(status->along, tick->along, sizeof(status->along));
	memcpy(status->target, tick->target, sizeof(status->target));
}

/* See digest in uapi/incise_stepper.h. */
static void stepper_plan_digest(struct stepper_plan *plan)
{
	const struct incise_fixed_tick *tick = &plan->tick;
	__le32 words[3 + INCISE_FIXED_AXES_MAX + 1];
	unsigned int n = 0, i;

	for (i = 0; i < 3; i++)
		words[n++] = cpu_to_le32(tick->command[i]);
	for (i = 0; i < plan->view.numbers.n_axes; i++)
		words[n++] = cpu_to_le32(tick->target[i]);
	words[n++] = cpu_to_le32(tick->flags);
	plan->digest = crc32c(plan->digest, words, n * sizeof(*words));
}

/* --- begin and end ---------------------------------------------------------------------- */

/* The leader's set-point says mode POSE from this tick on. */
static void stepper_plan_start(struct stepper_plan *plan, s64 due)
{
	s32 punctured = plan->state.membrane.punctured;

	/* Tissue does not heal: cuts, and the way through a membrane, stay until the next load. */
	memcpy(&plan->state, plan->begin, sizeof(plan->begin));
	plan->state.membrane.punctured = punctured;
	incise_fixed_incision_leave(&plan->state.incision);
	plan->status = (struct incise_stepper_plan_status){
		.motors = plan->load.motors,
		.plan = plan->crc,
		.t_ns = due,
		.age_ns = S64_MAX,
	};
	plan->running = true;
	WRITE_ONCE(plan->quiet, true);
	WRITE_ONCE(plan->leaving, 0);
	plan->tube = (struct stepper_setpoint){.seq = 0};
	plan->due_ns = due;
	plan->late_row = 0;
	plan->digest = ~0U;
}

/* A motor comes to rest, or its set-point says another mode. */
void stepper_plan_end(struct stepper_motor *motor, s64 now)
{
	struct stepper_plan *plan = motor->plan;
	struct incise_stepper_plan_status *status;
	unsigned int i;

	if (!motor->following)
		return;
	motor->following = false;
	if (!stepper_plan_leads(motor))
		return;
	plan->running = false;
	WRITE_ONCE(plan->quiet, true);
	for (i = 0; i < INCISE_FIXED_AXES_MAX; i++)
		WRITE_ONCE(plan->aim[i], STEPPER_PLAN_NO_AIM);
	/* Nothing is rendered any more; the counts stay to be read. */
	status = &plan->status;
	memset(status->command, 0, sizeof(status->command));
	memset(status->along, 0, sizeof(status->along));
	status->flags = 0;
	stepper_plan_publish(plan, INCISE_STEPPER_PLAN_LOADED, now);
}

/* All motors of the run get a fault at their next ticks. */
static void stepper_plan_stop(struct stepper_plan *plan, u32 fault)
{
	unsigned long flags;

	raw_spin_lock_irqsave(&plan->lock, flags);
	plan->stop_fault = fault;
	/* Pairs with the acquire in stepper_plan_follow(). */
	smp_store_release(&plan->stops, plan->stops + 1);
	raw_spin_unlock_irqrestore(&plan->lock, flags);
}

/* A motor of the run gets a fault, before it stops. */
void stepper_plan_fault(struct stepper_motor *motor, u32 fault)
{
	struct stepper_plan *plan = motor->plan;

	if (!motor->following || fault & STOPS_ALL)
		return;
	if (stepper_plan_leads(motor))
		plan->status.reasons |= INCISE_STEPPER_PLAN_STOPPED;
	if (fault != INCISE_STEPPER_FAULT_PLAN)
		stepper_plan_stop(plan, INCISE_STEPPER_FAULT_PLAN);
}

/* DISABLE took some of the motors away: the others alone do not render the plan's force. */
void stepper_plan_disabled(struct stepper *stepper, u32 motors)
{
	if (stepper->plan && stepper->plan->load.motors & motors)
		stepper_plan_stop(stepper->plan, INCISE_STEPPER_FAULT_PLAN);
}

/* --- motors ----------------------------------------------------------------------------- */

/* When the timer of this motor has a tick of a plan to run. */
s64 stepper_plan_due(const struct stepper_motor *motor)
{
	return stepper_plan_leads(motor) && motor->plan->running ? motor->plan->due_ns
								 : S64_MAX;
}

/* A set-point of mode POSE was taken, in a tick that was due. */
void stepper_plan_pose(struct stepper_motor *motor, s64 now, s64 due)
{
	struct stepper_plan *plan = motor->plan;

	if (!plan) {
		stepper_stop_fault(motor, INCISE_STEPPER_FAULT_SETPOINT, now);
		return;
	}
	if (!motor->following) {
		motor->following = true;
		motor->stops =
			smp_load_acquire(&plan->stops); /* see stepper_plan_stop() */
		motor->seen_ns = now;
		if (stepper_plan_leads(motor))
			stepper_plan_start(plan, due);
	}
	if (stepper_plan_leads(motor))
		plan->fresh = true;
}

/*
 * Whether the motor's own ticks leave its set-point alone: the plan's ticks take the leader's, and
 * no tick takes the set-point of an owner who has left.
 */
bool stepper_plan_reads(const struct stepper_motor *motor)
{
	const struct stepper_plan *plan = motor->plan;

	return motor->following && (stepper_plan_leads(motor) ||
				    READ_ONCE(plan->leaving) & INCISE_STEPPER_PLAN_LEFT);
}

/* At a tick of the motor: its target, and whether the run goes on. */
void stepper_plan_follow(struct stepper_motor *motor, s64 now)
{
	struct stepper_plan *plan = motor->plan;
	s64 aim;

	if (!motor->following)
		return;
	/* Pairs with the release in stepper_plan_stop(). */
	if (smp_load_acquire(&plan->stops) != motor->stops) {
		stepper_stop_fault(motor, READ_ONCE(plan->stop_fault), now);
		return;
	}
	if (!stepper_plan_leads(motor))
		motor->seen_ns = max(motor->seen_ns, READ_ONCE(plan->life_ns));
	aim = READ_ONCE(plan->aim[motor->axis]);
	if (aim != STEPPER_PLAN_NO_AIM)
		stepper_motor_want(motor, aim);
}

/* --- a tick ----------------------------------------------------------------------------- */

/* Hand a pose of a seq to the plan. A refused pose is no sign of life. */
static void stepper_plan_give(struct stepper_plan *plan,
			      const struct incise_fixed_pose *pose, u32 seq, s64 now,
			      s64 due)
{
	struct incise_stepper_plan_status *status = &plan->status;

	switch (incise_fixed_plan_pose(&plan->view, &plan->state, pose, due)) {
	case INCISE_FIXED_POSE_TAKEN:
		if (pose->tool & INCISE_FIXED_POSE_TUBE)
			status->tube_seq = seq;
		else
			status->pose_seq = seq;
		status->poses++;
		status->pose_tick = status->ticks + 1;
		fallthrough;
	case INCISE_FIXED_POSE_NONE:
		plan->leader->seen_ns = now;
		WRITE_ONCE(plan->life_ns, now);
		break;
	case INCISE_FIXED_POSE_OLD:
	case INCISE_FIXED_POSE_FAR:
		status->refused++;
		status->reasons |= INCISE_STEPPER_PLAN_REFUSED;
		break;
	case INCISE_FIXED_POSE_UNKNOWN:
		stepper_stop_fault(plan->leader, INCISE_STEPPER_FAULT_SETPOINT, now);
		break;
	}
}

static struct incise_fixed_pose stepper_plan_pose_of(const struct stepper_setpoint *from)
{
	struct incise_fixed_pose pose = {.t_ns = from->t_ns, .tool = from->pose.tool};

	memcpy(pose.position, from->pose.position, sizeof(pose.position));
	memcpy(pose.quaternion, from->pose.quaternion, sizeof(pose.quaternion));
	return pose;
}

/* The tube's pose. The scalpel's last set-point gives its tool, and whether to fade. */
static void stepper_plan_take_tube(struct stepper_plan *plan, s64 now, s64 due)
{
	struct stepper_motor *leader = plan->leader;
	struct incise_fixed_pose pose;

	switch (stepper_page_take(&plan->stepper->setpoints[INCISE_STEPPER_SLOT_TUBE],
				  &plan->tube)) {
	case STEPPER_PAGE_TAKEN:
		if (plan->tube.mode != INCISE_STEPPER_MODE_POSE || plan->tube.pose.tool)
			break;
		pose = stepper_plan_pose_of(&plan->tube);
		pose.tool = leader->setpoint.pose.tool | INCISE_FIXED_POSE_TUBE;
		stepper_plan_give(plan, &pose, plan->tube.seq, now, due);
		return;
	case STEPPER_PAGE_NOTHING:
		return;
	case STEPPER_PAGE_GARBAGE:
		break;
	}
	stepper_stop_fault(leader, INCISE_STEPPER_FAULT_SETPOINT, now);
}

/* All that came since the last tick: the scalpel's pose, then the tube's. */
static void stepper_plan_take(struct stepper_plan *plan, s64 now, s64 due)
{
	const struct stepper_setpoint *setpoint = &plan->leader->setpoint;
	bool left = plan->leaving & INCISE_STEPPER_PLAN_LEFT;
	struct incise_fixed_pose pose;

	if (plan->fresh) {
		pose = stepper_plan_pose_of(setpoint);
		stepper_plan_give(plan, &pose, setpoint->seq, now, due);
	}
	plan->fresh = false;
	if (plan->running && plan->view.numbers.tube && !left)
		stepper_plan_take_tube(plan, now, due);
}

static bool stepper_plan_is_quiet(const struct stepper_plan *plan)
{
	const s32 *command = plan->tick.command;

	return plan->state.gain <= 0 && !command[0] && !command[1] && !command[2];
}

/* Why the force goes, if it does. */
static u32 stepper_plan_reasons(const struct stepper_plan *plan)
{
	u32 reasons = plan->leaving;

	if (plan->tick.flags & INCISE_TICK_STALE && plan->status.poses)
		reasons |= INCISE_STEPPER_PLAN_SILENT;
	if (plan->leader->setpoint.pose.tool & INCISE_STEPPER_POSE_FADE)
		reasons |= INCISE_STEPPER_PLAN_ASKED;
	return reasons;
}

static u32 stepper_plan_state(const struct stepper_plan *plan)
{
	const struct incise_fixed_state *state = &plan->state;

	if (!state->released)
		return INCISE_STEPPER_PLAN_WAIT;
	if (plan->tick.flags & INCISE_TICK_STALE || state->fading || state->changing)
		return INCISE_STEPPER_PLAN_FADE;
	return plan->tick.flags & INCISE_TICK_STARTING ? INCISE_STEPPER_PLAN_RISE
						       : INCISE_STEPPER_PLAN_FELT;
}

/*
 * A tick that comes a period too late, or more, takes the place of those it missed. Returns whether
 * it was in time.
 */
static bool stepper_plan_catch_up(struct stepper_plan *plan, s64 now)
{
	u32 period = plan->view.numbers.tick_ns;
	s64 late = now - plan->due_ns;
	struct incise_stepper_event event = {
		.t_ns = now,
		.position = plan->status.ticks + 1,
		.type = INCISE_STEPPER_EVENT_MISSED,
		.motor = plan->leader->index,
	};
	u64 missed;

	stepper_histogram_add(&plan->lateness, late);
	if (late < period)
		return true;
	missed = div_u64(late, period);
	plan->due_ns += missed * period;
	plan->status.missed += missed;
	event.value = min_t(u64, missed, U32_MAX);
	stepper_event_put(plan->stepper, &event);
	return false;
}

/*
 * Cuts and contacts make ticks dearer than those that were measured at load. Ticks that leave
 * too little of the processor end as edges do that come too late.
 */
static void stepper_plan_load(struct stepper_plan *plan, bool in_time, s64 cost, s64 now)
{
	struct stepper_motor *leader = plan->leader;

	if (in_time && cost <= plan->view.numbers.tick_ns / 2)
		plan->late_row = 0;
	else if (++plan->late_row >= leader->config.late_max)
		stepper_stop_late(leader, now);
}

static void stepper_plan_render(struct stepper_plan *plan, s64 due)
{
	int i;

	if (plan->leaving)
		plan->state.fading = true;
	incise_fixed_plan_tick(&plan->view, &plan->state, due, &plan->tick);
	plan->status.ticks++;
	stepper_plan_digest(plan);
	stepper_plan_fill(&plan->status, &plan->tick);
	plan->status.reasons |= stepper_plan_reasons(plan);
	for (i = 0; i < plan->view.numbers.n_axes; i++)
		WRITE_ONCE(plan->aim[i], (s64)plan->tick.target[i]);
	WRITE_ONCE(plan->quiet, stepper_plan_is_quiet(plan));
	stepper_plan_publish(plan, stepper_plan_state(plan), due);
}

/* The leader's timer fired for the plan. */
void stepper_plan_tick(struct stepper_motor *motor, s64 now)
{
	struct stepper_plan *plan = motor->plan;
	bool in_time = stepper_plan_catch_up(plan, now);
	s64 due, cost;

	due = plan->due_ns;
	plan->due_ns = due + plan->view.numbers.tick_ns;
	if (!(plan->leaving & INCISE_STEPPER_PLAN_LEFT))
		stepper_motor_take(motor, now, due);
	if (plan->running)
		stepper_plan_take(plan, now, due);
	/* Another mode, or a fault. */
	if (!plan->running)
		return;
	stepper_plan_render(plan, due);
	cost = ktime_get_ns() - now;
	stepper_histogram_add(&plan->cost, cost);
	trace_incise_stepper_plan(plan->stepper->id, plan->status.ticks, due, now, cost);
	if (plan->leaving & INCISE_STEPPER_PLAN_LEFT && plan->quiet) {
		stepper_plan_stop(plan, INCISE_STEPPER_FAULT_OWNER);
		stepper_stop_fault(motor, INCISE_STEPPER_FAULT_OWNER, now);
	}
	stepper_plan_load(plan, in_time, cost, now);
}

/* --- from outside; stepper.mutex held --------------------------------------------------- */

/**
 * stepper_plan_let_go() - let the force of a running plan fade
 * @stepper:	the controller
 * @reason:	INCISE_STEPPER_PLAN_LEFT: its motors get the fault OWNER then, by themselves;
 *		INCISE_STEPPER_PLAN_AWAY: the caller waits, stepper_plan_wait()
 *
 * Return: mask of the motors that do.
 */
u32 stepper_plan_let_go(struct stepper *stepper, u32 reason)
{
	struct stepper_plan *plan = stepper->plan;
	unsigned long flags;
	unsigned int i;
	bool running;
	u32 motors = 0;

	if (!plan)
		return 0;
	raw_spin_lock_irqsave(&plan->leader->lock, flags);
	running = plan->running;
	if (running)
		WRITE_ONCE(plan->leaving, plan->leaving | reason);
	raw_spin_unlock_irqrestore(&plan->leader->lock, flags);
	for (i = 0; running && i < stepper->n_motors; i++) {
		struct stepper_motor *motor = &stepper->motor[i];

		raw_spin_lock_irqsave(&motor->lock, flags);
		if (motor->following)
			motors |= BIT(i);
		raw_spin_unlock_irqrestore(&motor->lock, flags);
	}
	return motors;
}

/* Whether motors still render the plan of an owner who has left. */
bool stepper_plan_leaving(const struct stepper *stepper)
{
	const struct stepper_plan *plan = stepper->plan;

	return plan && READ_ONCE(plan->running) &&
	       READ_ONCE(plan->leaving) & INCISE_STEPPER_PLAN_LEFT;
}

/* Until there is no force, and not for longer than that may take. Sleeps. */
void stepper_plan_wait(struct stepper *stepper, unsigned int most_ms)
{
	struct stepper_plan *plan = stepper->plan;
	unsigned int waited;
	u64 fade_ms;

	if (!plan)
		return;
	fade_ms = div_u64(incise_fixed_plan_fade_ns(&plan->view.numbers), NSEC_PER_MSEC);
	for (waited = 0; waited < min_t(u64, most_ms, fade_ms + 4); waited += 2) {
		if (READ_ONCE(plan->quiet))
			break;
		usleep_range(2000, 3000);
	}
}

/* For debugfs: cost and lateness of a tick. */
void stepper_plan_show(struct stepper *stepper, struct seq_file *file)
{
	struct stepper_histogram lateness, cost;
	struct stepper_plan *plan = stepper->plan;
	unsigned long flags;
	unsigned int bin;
	u64 n = 0;

	if (!plan)
		return;
	raw_spin_lock_irqsave(&plan->leader->lock, flags);
	lateness = plan->lateness;
	cost = plan->cost;
	raw_spin_unlock_irqrestore(&plan->leader->lock, flags);
	seq_puts(file, "from_us lateness cost\n");
	for (bin = 0; bin < STEPPER_BINS; bin++) {
		n += cost.count[bin];
		seq_printf(file, "%u %llu %llu\n", bin ? 1U << (bin - 1) : 0,
			   lateness.count[bin], cost.count[bin]);
	}
	seq_printf(file, "mean_ns %llu %llu\n", n ? div64_u64(lateness.sum_ns, n) : 0,
		   n ? div64_u64(cost.sum_ns, n) : 0);
	seq_printf(file, "max_ns %llu %llu\n", lateness.max_ns, cost.max_ns);
	seq_printf(file, "load_ns 0 %u\n", plan->cost_ns);
}

void stepper_plan_reset(struct stepper *stepper)
{
	struct stepper_plan *plan = stepper->plan;
	unsigned long flags;

	if (!plan)
		return;
	raw_spin_lock_irqsave(&plan->leader->lock, flags);
	memset(&plan->lateness, 0, sizeof(plan->lateness));
	memset(&plan->cost, 0, sizeof(plan->cost));
	raw_spin_unlock_irqrestore(&plan->leader->lock, flags);
}
