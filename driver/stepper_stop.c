// SPDX-License-Identifier: GPL-2.0-only
/*
 * Stopping a motor when something is wrong. A fault is latched with its
 * cause; what it does depends on the fault:
 *
 *   at once    limit, e-stop, driver, late, line     no further step, power off
 *   brake      set-point, suspend, gone, steps       within the limits, then power off
 *   retract    deadman, owner, plan                  to safe_position if it is homed and
 *                                                    the config says so, else brake
 *
 *   READY/MOVING ──▶ STOPPING ──▶ FAULT ──(clear)──▶ DISABLED
 *        └───────── at once ───────▲
 *
 * HOMED goes with e-stop, driver and suspend, with or without power before, with lost steps, and
 * with each power off where the config says so.
 *
 * All under motor->lock, in any context.
 */
#include <linux/moduleparam.h>

#include "compat.h"
#include "stepper.h"
#include "trace.h"

#define AT_ONCE                                                            \
	(INCISE_STEPPER_FAULT_LIMIT_MIN | INCISE_STEPPER_FAULT_LIMIT_MAX | \
	 INCISE_STEPPER_FAULT_ESTOP | INCISE_STEPPER_FAULT_ALARM |         \
	 INCISE_STEPPER_FAULT_LATE | INCISE_STEPPER_FAULT_LINE)
/* The power stage loses its supply, and the rotor may turn unseen; or it is elsewhere already. */
#define UNHOME                                                     \
	(INCISE_STEPPER_FAULT_ESTOP | INCISE_STEPPER_FAULT_ALARM | \
	 INCISE_STEPPER_FAULT_SUSPEND | INCISE_STEPPER_FAULT_STEPS)
#define RETRACT                                                      \
	(INCISE_STEPPER_FAULT_DEADMAN | INCISE_STEPPER_FAULT_OWNER | \
	 INCISE_STEPPER_FAULT_PLAN)

/*
 * An emulated machine is late whenever its host is busy: tests that are not about time take the
 * fault away.
 */
static bool late_faults = true;
#ifdef CONFIG_INCISE_SIM
module_param(late_faults, bool, 0444);
MODULE_PARM_DESC(late_faults, "Stop a motor whose edges or ticks are late for too long");
#endif

/* Take power away. A pulse that is out is ended by the timer, at its time. */
void stepper_stop_off(struct stepper_motor *motor, s64 now)
{
	motor->powered = false;
	motor->disabling = false;
	stepper_setup_unload(motor);
	if (motor->config.flags & INCISE_STEPPER_CONFIG_VOLATILE_HOME)
		motor->flags &= ~INCISE_STEPPER_FLAG_HOMED;
	compat_gpiod_set_value(motor->lines.enable, 0);
	trace_incise_stepper_edge(motor->stepper->id, motor->index, STEPPER_ENABLE, 0,
				  now, now);
	stepper_status_state(motor,
			     motor->faults ? INCISE_STEPPER_STATE_FAULT
					   : INCISE_STEPPER_STATE_DISABLED,
			     now);
	stepper_status_publish(motor, now);
}

/* No further step. Steps that were halted leave the rotor anywhere near. */
void stepper_stop_halt(struct stepper_motor *motor, s64 now)
{
	if (motor->given < motor->slot.n || !incise_profile_resting(&motor->profile))
		motor->flags &= ~INCISE_STEPPER_FLAG_HOMED;
	stepper_plan_end(motor, now);
	motor->slot.n = 0;
	motor->given = 0;
	incise_profile_halt(&motor->profile, motor->position);
	motor->target = motor->position;
	stepper_stop_off(motor, now);
}

static void stepper_stop_gently(struct stepper_motor *motor, u32 fault, s64 now)
{
	bool retract = fault & RETRACT &&
		       motor->config.flags & INCISE_STEPPER_CONFIG_RETRACT &&
		       motor->flags & INCISE_STEPPER_FLAG_HOMED;

	/* A motor that retracts continues, but a machine that sleeps will not wait. */
	if (motor->disabling && fault & RETRACT)
		return;
	stepper_plan_end(motor, now);
	motor->disabling = true;
	if (retract) {
		motor->target = motor->config.safe_position;
		motor->setpoint.mode = INCISE_STEPPER_MODE_POSITION;
		incise_profile_target(&motor->profile, INCISE_PROFILE_POSITION,
				      motor->target);
	} else {
		incise_profile_stop(&motor->profile);
	}
	stepper_status_state(motor, INCISE_STEPPER_STATE_STOPPING, now);
	stepper_status_publish(motor, now);
}

/* Latch a fault of a motor that has power, and stop it as the fault asks for. */
void stepper_stop_fault(struct stepper_motor *motor, u32 fault, s64 now)
{
	if (fault & UNHOME && motor->flags & INCISE_STEPPER_FLAG_HOMED) {
		motor->flags &= ~INCISE_STEPPER_FLAG_HOMED;
		if (!motor->powered)
			stepper_status_publish(motor, now);
	}
	if (!motor->powered)
		return;
	/* It was disabled before the file was closed. */
	if (fault == INCISE_STEPPER_FAULT_OWNER && motor->disabling && !motor->faults)
		return;
	if (fault & ~motor->faults) {
		struct incise_stepper_event event = {
			.t_ns = now,
			.position = motor->position,
			.type = INCISE_STEPPER_EVENT_FAULT,
			.motor = motor->index,
			.value = fault & ~motor->faults,
		};

		motor->faults |= fault;
		stepper_event_put(motor->stepper, &event);
		trace_incise_stepper_fault(motor->stepper->id, motor->index, event.value,
					   motor->position, now);
	}
	stepper_plan_fault(motor, fault);
	if (fault & AT_ONCE)
		stepper_stop_halt(motor, now);
	else
		stepper_stop_gently(motor, fault, now);
}

/* Edges, ticks or a time line that are late for too long. */
void stepper_stop_late(struct stepper_motor *motor, s64 now)
{
	if (late_faults)
		stepper_stop_fault(motor, INCISE_STEPPER_FAULT_LATE, now);
}

/* For DISABLE: to rest within the limits, then power off; no fault. */
void stepper_stop_disable(struct stepper_motor *motor, s64 now)
{
	if (motor->powered && !motor->disabling)
		stepper_stop_gently(motor, 0, now);
}
