// SPDX-License-Identifier: GPL-2.0-only
/*
 * The hard timer of a motor: ticks, and the edges between them. It fires in hard
 * interrupt on PREEMPT_RT too. One thing per firing, the one that is due first;
 * the timer is set again for the next.
 *
 *          tick k                          tick k+1
 *   timer ──╫──────┬────┬─────┬─────┬────────╫──
 *   dir   ─────────╥────────────────────────────     set_up, hold
 *   step  ______________┌─────┐_____┌─────┐_____     high, low
 *                       ◀── interval ──▶
 *
 * Due times come from the profile's time line, never from now: lateness does not
 * add up. But high, low, set-up, hold and the interval at the largest velocity
 * count from the actual times of edges, taken after the write, when the line has
 * changed for sure. So a late edge shortens nothing but the interval, by what a firing costs and
 * an eighth of it (catch_ns): the usual lateness of a timer (lag_ns) is caught up, or a motor would
 * never reach its largest velocity; where it is more, the time line is put off. There is never a
 * burst, and no acceleration that the profile does not know of.
 */
#include <linux/delay.h>
#include <linux/hrtimer.h>
#include <linux/kernel.h>
#include <linux/ktime.h>
#include <linux/math64.h>
#include <linux/minmax.h>
#include <linux/percpu.h>

#include "compat.h"
#include "stepper.h"
#include "trace.h"

/* Intervals may be 1/2^CATCH_UP shorter than the profile has them. */
#define CATCH_UP 3

/*
 * A motion whose time line is put off by more than 1/64 in each of so many windows in a row does
 * not recover.
 */
#define LAG_WINDOW_NS (128 * NSEC_PER_MSEC)
#define LAG_SHARE 64
#define LAG_WINDOWS 8

/* Timers of other motors that expired with this one wait for their pulses too: so much in all. */
#define WAIT_SUM_NS 10000

struct stepper_waited {
	const struct stepper_motor *first;
	s64 since_ns;
	s64 sum_ns;
};

static DEFINE_PER_CPU(struct stepper_waited, stepper_waited);

/* The next action and its time: only from the state of the motor, so that it may be asked
 * for as often as one likes, after whatever has come between.
 */
static enum stepper_next stepper_motor_move(const struct stepper_motor *motor, s64 *due,
					    s64 *want)
{
	const struct incise_stepper_config *config = &motor->config;
	s64 tick = motor->base_ns + config->tick_ns;
	s64 trail = motor->lead_ns + config->high_ns;
	bool steps = motor->given < motor->slot.n;
	s64 gap;

	if (!motor->powered && !motor->high)
		return STEPPER_NEXT_NONE;
	if (motor->high && (!motor->powered || steps || trail <= tick)) {
		*due = trail;
		return STEPPER_NEXT_TRAIL;
	}
	if (!steps) {
		*due = tick;
		return STEPPER_NEXT_TICK;
	}

	*want = motor->base_ns + incise_profile_step_ns(&motor->slot, motor->given);
	if (motor->direction != motor->slot.dir) {
		*due = max3(*want - config->setup_ns, motor->lead_ns + config->hold_ns,
			    motor->trail_ns);
		return STEPPER_NEXT_DIR;
	}
	gap = *want - motor->lead_due_ns;
	gap = max(gap - max(gap >> CATCH_UP, motor->catch_ns),
		  motor->interval_ns - motor->catch_ns);
	*due = max3(*want, motor->lead_ns + gap, motor->trail_ns + config->low_ns);
	*due = max3(*due, motor->dir_ns + config->setup_ns, motor->powered_ns);
	return STEPPER_NEXT_LEAD;
}

/* The same, with the ticks of a plan between: an edge that is due with a tick comes before it. */
static enum stepper_next stepper_motor_next(const struct stepper_motor *motor, s64 *due,
					    s64 *want)
{
	enum stepper_next next = stepper_motor_move(motor, due, want);
	s64 plan = stepper_plan_due(motor);

	if (next == STEPPER_NEXT_NONE || plan > *due)
		return next;
	*due = plan;
	return STEPPER_NEXT_PLAN;
}

static s64 stepper_motor_write(struct stepper_motor *motor, enum stepper_output output,
			       struct gpio_desc *line, bool value, s64 due)
{
	int ret = compat_gpiod_set_value(line, value);
	s64 now = ktime_get_ns();

	motor->edges++;
	trace_incise_stepper_edge(motor->stepper->id, motor->index, output, value, due,
				  now);
	if (ret < 0)
		stepper_stop_fault(motor, INCISE_STEPPER_FAULT_LINE, now);
	return now;
}

/* An edge that is late by more than its shortest time; too many in a row are a fault. */
static void stepper_motor_late(struct stepper_motor *motor, s64 late, u32 shortest,
			       s64 now)
{
	if (late <= shortest) {
		motor->late_row = 0;
		return;
	}
	motor->late++;
	if (++motor->late_row >= motor->config.late_max)
		stepper_stop_late(motor, now);
}

static void stepper_motor_trail(struct stepper_motor *motor, s64 now, s64 due)
{
	motor->high = false;
	motor->trail_ns =
		stepper_motor_write(motor, STEPPER_STEP, motor->lines.step, false, due);
	if (motor->powered)
		stepper_motor_late(motor, now - due, motor->config.high_ns,
				   motor->trail_ns);
}

/*
 * End a short pulse here, which costs less than another interrupt. A sum ends when the motor
 * that began it has another step, which is of another interrupt, or after a pause.
 */
static void stepper_motor_wait(struct stepper_motor *motor)
{
	struct stepper_waited *waited = this_cpu_ptr(&stepper_waited);
	u32 high_ns = motor->config.high_ns;
	s64 end = motor->lead_ns + high_ns;
	s64 now;

	if (!motor->high || high_ns > INCISE_STEPPER_WAIT_MAX_NS ||
	    motor->config.flags & INCISE_STEPPER_CONFIG_NO_WAIT)
		return;
	if (waited->first == motor || motor->lead_ns - waited->since_ns > WAIT_SUM_NS) {
		waited->first = motor;
		waited->sum_ns = 0;
	}
	if (waited->sum_ns + high_ns > WAIT_SUM_NS)
		return;
	do {
		cpu_relax();
		now = ktime_get_ns();
	} while (now < end);
	waited->sum_ns += high_ns;
	waited->since_ns = now;
	motor->waits++;
	stepper_motor_trail(motor, now, end);
}

static void stepper_motor_lead(struct stepper_motor *motor, s64 now, s64 due, s64 want)
{
	int direction = motor->slot.dir;
	s64 lag;

	/* The last look at the inputs that forbid this step. It may halt the motor. */
	stepper_inputs_one(motor, direction > 0 ? STEPPER_LIMIT_MAX : STEPPER_LIMIT_MIN,
			   now, false);
	stepper_inputs_one(motor, STEPPER_ESTOP, now, false);
	if (!motor->lines.irq[STEPPER_HOME].irq)
		stepper_inputs_one(motor, STEPPER_HOME, now, false);
	if (!motor->powered)
		return;

	/* Counted first: a reader that sees the edge finds it counted. */
	motor->given++;
	motor->high = true;
	motor->position += direction;
	if (direction > 0)
		motor->steps_up++;
	else
		motor->steps_down++;
	motor->lead_ns =
		stepper_motor_write(motor, STEPPER_STEP, motor->lines.step, true, due);
	motor->lead_due_ns = want;

	lag = motor->lead_ns - want;
	if (lag > motor->lag_ns) {
		motor->base_ns += lag;
		motor->lead_due_ns += lag;
		motor->shifted_ns += lag;
	}
	stepper_motor_late(motor, now - due, motor->config.low_ns, motor->lead_ns);
	stepper_motor_wait(motor);
}

static void stepper_motor_dir(struct stepper_motor *motor, s64 due)
{
	bool up = motor->slot.dir > 0;
	bool invert = motor->config.flags & INCISE_STEPPER_CONFIG_INVERT;

	motor->direction = motor->slot.dir;
	motor->dir_ns = stepper_motor_write(motor, STEPPER_DIR, motor->lines.dir,
					    up != invert, due);
}

/* Go there, within the limits; motor->setpoint says in which mode. */
void stepper_motor_want(struct stepper_motor *motor, s64 target)
{
	motor->setpoint.target = target;
	motor->target = stepper_page_clamp(&motor->setpoint, &motor->config);
	motor->flags &= ~INCISE_STEPPER_FLAG_HELD;
	if (motor->target != target)
		motor->flags |= INCISE_STEPPER_FLAG_HELD;
	motor->asked = true;
}

/* Take a new set-point, if there is one. @due: of the tick that does. */
void stepper_motor_take(struct stepper_motor *motor, s64 now, s64 due)
{
	struct stepper *stepper = motor->stepper;

	switch (stepper_page_take(&stepper->setpoints[motor->index], &motor->setpoint)) {
	case STEPPER_PAGE_TAKEN:
		if (motor->setpoint.mode == INCISE_STEPPER_MODE_POSE) {
			stepper_plan_pose(motor, now, due);
			break;
		}
		stepper_plan_end(motor, now);
		motor->seen_ns = now;
		stepper_motor_want(motor, motor->setpoint.target);
		break;
	case STEPPER_PAGE_GARBAGE:
		stepper_stop_fault(motor, INCISE_STEPPER_FAULT_SETPOINT, now);
		break;
	case STEPPER_PAGE_NOTHING:
		break;
	}
}

/* A set-point, of the owner or of the plan, where it is still asked for. */
static void stepper_motor_listen(struct stepper_motor *motor, s64 now, s64 due)
{
	if (motor->disabling)
		return;
	if (!stepper_plan_reads(motor))
		stepper_motor_take(motor, now, due);
	stepper_plan_follow(motor, now);
	if (now - motor->seen_ns > (s64)motor->config.deadman_ns)
		stepper_stop_fault(motor, INCISE_STEPPER_FAULT_DEADMAN, now);
}

/* Hand the target to the profile, once the power stage is ready for steps. */
static void stepper_motor_aim(struct stepper_motor *motor, s64 now)
{
	enum incise_profile_mode mode = INCISE_PROFILE_POSITION;

	if (!motor->asked || motor->disabling || now < motor->powered_ns)
		return;
	if (motor->setpoint.mode == INCISE_STEPPER_MODE_VELOCITY)
		mode = INCISE_PROFILE_VELOCITY;
	incise_profile_target(&motor->profile, mode, motor->target);
	motor->asked = false;
}

/* A motion that falls behind for good is a fault, where single edges are in time as well. */
static void stepper_motor_lag(struct stepper_motor *motor, s64 now)
{
	s64 window = now - motor->window_ns;

	if (window < LAG_WINDOW_NS)
		return;
	if (motor->shifted_ns - motor->shifted_then_ns > div_s64(window, LAG_SHARE))
		motor->lagging++;
	else
		motor->lagging = 0;
	motor->window_ns = now;
	motor->shifted_then_ns = motor->shifted_ns;
	if (motor->lagging >= LAG_WINDOWS)
		stepper_stop_late(motor, now);
}

static void stepper_motor_tick(struct stepper_motor *motor, s64 now, s64 due)
{
	bool resting;

	stepper_inputs_sample(motor, now);
	if (motor->powered)
		stepper_motor_listen(motor, now, due);
	if (motor->powered)
		stepper_motor_lag(motor, now);
	if (!motor->powered)
		return;

	stepper_motor_aim(motor, now);
	resting = incise_profile_resting(&motor->profile);
	if (resting && motor->disabling) {
		stepper_stop_off(motor, now);
		return;
	}
	motor->base_ns = due;
	if (now - due > motor->config.tick_ns) {
		motor->base_ns = now;
		if (!resting)
			motor->shifted_ns += now - due;
	}
	incise_profile_tick(&motor->profile, &motor->slot);
	motor->given = 0;
	resting = incise_profile_resting(&motor->profile);
	if (!motor->disabling)
		stepper_status_state(motor,
				     resting ? INCISE_STEPPER_STATE_READY
					     : INCISE_STEPPER_STATE_MOVING,
				     now);
	stepper_status_publish(motor, now);
}

static enum hrtimer_restart stepper_motor_fire(struct hrtimer *timer)
{
	struct stepper_motor *motor = container_of(timer, struct stepper_motor, timer);
	enum hrtimer_restart restart = HRTIMER_RESTART;
	s64 now = ktime_get_ns();
	s64 due, want = 0;
	unsigned long flags;
	enum stepper_next next;

	raw_spin_lock_irqsave(&motor->lock, flags);
	/* An interrupt may have halted the motor: ask again what is due. */
	next = stepper_motor_next(motor, &due, &want);
	if (next != STEPPER_NEXT_NONE && due <= now) {
		stepper_histogram_add(&motor->lateness, now - due);
		switch (next) {
		case STEPPER_NEXT_PLAN:
			stepper_plan_tick(motor, now);
			break;
		case STEPPER_NEXT_TICK:
			stepper_motor_tick(motor, now, due);
			stepper_histogram_add(&motor->tick_cost, ktime_get_ns() - now);
			break;
		case STEPPER_NEXT_DIR:
			stepper_motor_dir(motor, due);
			break;
		case STEPPER_NEXT_LEAD:
			stepper_motor_lead(motor, now, due, want);
			break;
		case STEPPER_NEXT_TRAIL:
			stepper_motor_trail(motor, now, due);
			break;
		case STEPPER_NEXT_NONE:
			break;
		}
		next = stepper_motor_next(motor, &due, &want);
	}
	if (next == STEPPER_NEXT_NONE) {
		motor->timing = false;
		restart = HRTIMER_NORESTART;
	} else {
		hrtimer_set_expires(timer, ns_to_ktime(due));
	}
	stepper_histogram_add(&motor->cost, ktime_get_ns() - now);
	raw_spin_unlock_irqrestore(&motor->lock, flags);
	return restart;
}

/* For the self-test: what a firing does besides its edge, on a motor that seems to move. */
void stepper_motor_compute(struct stepper_motor *motor)
{
	unsigned long flags;
	s64 due, want = 0;
	unsigned int i;

	raw_spin_lock_irqsave(&motor->lock, flags);
	motor->powered = true;
	motor->direction = 1;
	motor->slot.dir = 1;
	motor->slot.n = 1000;
	motor->slot.to = S64_MAX >> 16;
	motor->given = 0;
	for (i = 0; i < 2; i++) {
		stepper_motor_next(motor, &due, &want);
		stepper_histogram_add(&motor->lateness, ktime_get_ns() - due);
	}
	motor->powered = false;
	memset(&motor->slot, 0, sizeof(motor->slot));
	memset(&motor->lateness, 0, sizeof(motor->lateness));
	motor->direction = 0;
	raw_spin_unlock_irqrestore(&motor->lock, flags);
}

/* Begin to fire; motor->lock held. */
void stepper_motor_start(struct stepper_motor *motor)
{
	s64 due, want;

	if (motor->timing || stepper_motor_next(motor, &due, &want) == STEPPER_NEXT_NONE)
		return;
	motor->timing = true;
	hrtimer_start(&motor->timer, ns_to_ktime(due), HRTIMER_MODE_ABS_PINNED_HARD);
}

void stepper_motor_init(struct stepper_motor *motor)
{
	raw_spin_lock_init(&motor->lock);
	hrtimer_setup(&motor->timer, stepper_motor_fire, CLOCK_MONOTONIC,
		      HRTIMER_MODE_ABS_PINNED_HARD);
}

/* No firing any more; the motor was halted before. Sleeps. */
void stepper_motor_end(struct stepper_motor *motor)
{
	unsigned int waited;
	unsigned long flags;

	/* It ends by itself, with the pulse that is out, within a tick. */
	for (waited = 0; waited < 20 && READ_ONCE(motor->timing); waited++)
		usleep_range(1000, 2000);
	hrtimer_cancel(&motor->timer);
	raw_spin_lock_irqsave(&motor->lock, flags);
	motor->timing = false;
	if (motor->high) {
		motor->high = false;
		compat_gpiod_set_value(motor->lines.step, 0);
	}
	raw_spin_unlock_irqrestore(&motor->lock, flags);
}
