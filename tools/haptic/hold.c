// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Power to the actuators of a force, and away again; see hold.h.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include "../cli/cli.h"
#include "hold.h"

/* Faults of the program before, not of the machine. */
#define LEFT_BEHIND                                                  \
	(INCISE_STEPPER_FAULT_DEADMAN | INCISE_STEPPER_FAULT_OWNER | \
	 INCISE_STEPPER_FAULT_SUSPEND)

static int home_it(struct incise_stepper *stepper, struct incise_error *err)
{
	int rc = incise_stepper_enable(stepper, err);

	if (!rc)
		rc = incise_stepper_home(stepper, &cli_stop, NULL, err);
	return rc ? rc : incise_stepper_disable(stepper, err);
}

/*
 * Drop the poses that arrived meanwhile: to feed them in the first tick could take longer than
 * the actuator's deadman waits.
 */
static void drop_poses(struct incise_tracker *tracker)
{
	struct incise_tracker_sample samples[64];

	while (incise_tracker_read(tracker, samples, 64) == 64)
		continue;
}

static int recover_it(struct incise_stepper *stepper, const char *name,
		      struct incise_stepper_status *status, struct incise_error *err)
{
	unsigned int latched =
		status->faults & ~(unsigned int)INCISE_STEPPER_FAULT_TRAVEL;
	char cause[300];
	int rc;

	if (!latched || (latched & ~(unsigned int)LEFT_BEHIND))
		return 0;
	incise_stepper_cause(stepper, cause, sizeof(cause));
	rc = incise_stepper_clear(stepper, err);
	if (rc)
		return rc;
	cli_note("%s: cleared the fault of an earlier program (%s)", name, cause);
	rc = incise_stepper_status(stepper, status);
	/* If clearing is enough, a latched fault is no error. */
	return rc == -EIO ? 0 : rc;
}

/*
 * Make an actuator ready for power: a target needs its 0, and a real machine must find its 0,
 * if it has a switch for that. Returns 0 or a negative errno.
 */
static int make_ready(struct incise_rig *rig, int axis, bool home, bool recover,
		      struct incise_error *err)
{
	struct incise_stepper *stepper = incise_rig_axis(rig, axis, NULL);
	struct incise_stepper_status status;
	struct incise_stepper_info info;
	char cause[300];
	int rc = incise_stepper_status(stepper, &status);

	incise_stepper_info(stepper, &info);
	if (rc)
		return incise_error_set(err, -rc, "%s: %s", info.name, strerror(-rc));
	if (recover)
		rc = recover_it(stepper, info.name, &status, err);
	if (rc)
		return rc;
	if (!status.homed && !home) {
		/* Until it is cleared, the actuator refuses homing as well. */
		if (status.faults & ~(unsigned int)INCISE_STEPPER_FAULT_TRAVEL) {
			incise_stepper_cause(stepper, cause, sizeof(cause));
			return incise_error_set(err, EPERM, "%s: %s", info.name, cause);
		}
		if (info.can_home)
			return incise_error_set(
				err, EPERM,
				"%s is not homed; run 'incise stepper home --rig "
				"%s%s', or give --home",
				info.name, incise_rig_spec(rig),
				axis == 0   ? ""
				: axis == 1 ? " --axis 2"
					    : " --axis 3");
		cli_warn("%s cannot be homed: its 0 is its present position", info.name);
	}
	return !status.homed && home ? home_it(stepper, err) : 0;
}

int hold_prepare(struct incise_rig *rig, bool home, bool recover,
		 struct incise_error *err)
{
	int rc = 0;

	for (int n = 0; !rc && incise_rig_axis(rig, n, NULL); n++)
		rc = make_ready(rig, n, home, recover, err);
	return rc;
}

int hold_take(struct incise_rig *rig, struct incise_error *err)
{
	struct incise_stepper *stepper;
	int rc = 0, n;

	drop_poses(incise_rig_tracker(rig));
	for (n = 0; !rc && (stepper = incise_rig_axis(rig, n, NULL)); n++)
		rc = incise_stepper_enable(stepper, err);
	while (rc && n-- > 0)
		incise_stepper_disable(incise_rig_axis(rig, n, NULL), NULL);
	return rc;
}

/* Whether an actuator is still on its way to a place without force. */
static bool returns(struct incise_stepper *stepper, int64_t gone_ns)
{
	struct incise_stepper_status status;
	struct incise_stepper_info info;

	incise_stepper_info(stepper, &info);
	/* The virtual one goes there by itself. */
	return !info.measures_handle &&
	       gone_ns < (int64_t)((1 + info.travel_mm / info.velocity_mm_s) *
				   INCISE_NS_PER_S) &&
	       !incise_stepper_set(stepper, info.rest_mm) &&
	       !incise_stepper_status(stepper, &status) &&
	       (fabs(status.position_mm - info.rest_mm) > info.step_mm / 2 ||
		status.state == INCISE_STEPPER_STATE_MOVING);
}

static int power_off(struct incise_rig *rig, int axis, struct incise_error *err)
{
	struct incise_stepper *stepper = incise_rig_axis(rig, axis, NULL);
	struct incise_stepper_status status;
	struct incise_stepper_info info;
	int rc = incise_stepper_disable(stepper, err);
	char cause[300];

	if (rc || incise_stepper_status(stepper, &status) ||
	    !(status.faults & ~(unsigned int)INCISE_STEPPER_FAULT_TRAVEL))
		return rc;
	incise_stepper_info(stepper, &info);
	incise_stepper_cause(stepper, cause, sizeof(cause));
	return incise_error_set(
		err, EIO, "%s stopped by itself: %s",
		incise_rig_axis(rig, 1, NULL) ? info.name : "the actuator", cause);
}

int hold_let_go(struct incise_rig *rig, struct incise_error *err)
{
	struct incise_clock *clock = incise_rig_clock(rig);
	int64_t begin = incise_clock_now(clock), now = begin;
	struct incise_stepper *stepper;
	int rc = 0;

	for (bool moving = true; moving;) {
		moving = false;
		for (int i = 0; (stepper = incise_rig_axis(rig, i, NULL)); i++)
			moving |= returns(stepper, now - begin);
		if (moving)
			incise_clock_wait_until(clock, now + 2000000);
		now = incise_clock_now(clock);
	}
	for (int i = 0; incise_rig_axis(rig, i, NULL); i++) {
		struct incise_error own = {0};
		int failed = power_off(rig, i, &own);

		if (failed && !rc) {
			rc = failed;
			*err = own;
		}
	}
	return rc;
}
