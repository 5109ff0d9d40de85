// SPDX-License-Identifier: GPL-2.0-only
/*
 * No idle states while a motor has power, and in the self-test: leaving one costs a timer
 * tens to hundreds of microseconds, more than all else that makes it late.
 *
 *   ENABLE ── hold ═══════════ power off ── event ── work ── release
 *
 * Power may go off in a hard interrupt, where the request cannot be given back: each
 * change of a state is an event, whose wake-up looks whether there is power left.
 */
#include <linux/pm_qos.h>
#include <linux/workqueue.h>

#include "stepper.h"

/* stepper.mutex held, or no other user exists. Sleeps. */
void stepper_latency_hold(struct stepper *stepper)
{
	if (!cpu_latency_qos_request_active(&stepper->latency))
		cpu_latency_qos_add_request(&stepper->latency, 0);
	WRITE_ONCE(stepper->awake, true);
}

/* Likewise. */
void stepper_latency_release(struct stepper *stepper)
{
	WRITE_ONCE(stepper->awake, false);
	if (cpu_latency_qos_request_active(&stepper->latency))
		cpu_latency_qos_remove_request(&stepper->latency);
}

static void stepper_latency_look(struct work_struct *work)
{
	struct stepper *stepper = container_of(work, struct stepper, look);

	mutex_lock(&stepper->mutex);
	stepper_plan_sweep(stepper);
	if (!stepper_setup_any_powered(stepper))
		stepper_latency_release(stepper);
	mutex_unlock(&stepper->mutex);
}

void stepper_latency_init(struct stepper *stepper)
{
	INIT_WORK(&stepper->look, stepper_latency_look);
}

/* An event came: from the herald. */
void stepper_latency_event(struct stepper *stepper)
{
	if (READ_ONCE(stepper->awake))
		schedule_work(&stepper->look);
}

/* Nothing has power any more. Sleeps; without stepper.mutex. */
void stepper_latency_end(struct stepper *stepper)
{
	cancel_work_sync(&stepper->look);
	stepper_latency_release(stepper);
}
