// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The actuator before and after a loop; see haptic_actuator.h.
 */
#include <errno.h>
#include <string.h>
#include "../cli/cli.h"
#include "haptic_actuator.h"

/* What says nothing of the machine, only of the program before. */
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
 * Poses that came while one was busy are old. To take them in the first tick would keep the
 * actuator waiting, longer than its deadman does.
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
	cli_note("%s: cleared what was left behind (%s)", name, cause);
	rc = incise_stepper_status(stepper, status);
	/* Where clearing is enough, what is latched is no error. */
	return rc == -EIO ? 0 : rc;
}

int haptic_take_hold(struct incise_rig *rig, bool home, bool recover,
		     struct incise_error *err)
{
	struct incise_stepper *stepper = incise_rig_stepper(rig);
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
		/* Homing, too, is refused before that is cleared. */
		if (status.faults & ~(unsigned int)INCISE_STEPPER_FAULT_TRAVEL) {
			incise_stepper_cause(stepper, cause, sizeof(cause));
			return incise_error_set(err, EPERM, "%s: %s", info.name, cause);
		}
		if (info.can_home)
			return incise_error_set(
				err, EPERM,
				"%s is not homed; run `incise stepper home --rig %s`, or "
				"give --home",
				info.name, incise_rig_spec(rig));
		cli_warn("%s cannot be homed: its 0 is where it stands", info.name);
	}
	if (!status.homed && home)
		rc = home_it(stepper, err);
	if (!rc)
		drop_poses(incise_rig_tracker(rig));
	return rc ? rc : incise_stepper_enable(stepper, err);
}

void haptic_let_go(struct incise_rig *rig)
{
	struct incise_stepper *stepper = incise_rig_stepper(rig);
	struct incise_clock *clock = incise_rig_clock(rig);
	struct incise_stepper_status status;
	struct incise_stepper_info info;
	struct incise_error err = {0};
	int64_t now = incise_clock_now(clock), end;

	incise_stepper_info(stepper, &info);
	/* The virtual one has no power to lose: it goes there by itself. */
	end = info.measures_handle
		      ? now
		      : now + (int64_t)((1 + info.travel_mm / info.velocity_mm_s) *
					INCISE_NS_PER_S);
	while (now < end && !incise_stepper_set(stepper, 0) &&
	       !incise_stepper_status(stepper, &status) &&
	       (status.position_mm > info.step_mm / 2 ||
		status.state == INCISE_STEPPER_STATE_MOVING)) {
		incise_clock_wait_until(clock, now + 2000000);
		now = incise_clock_now(clock);
	}
	if (incise_stepper_disable(stepper, &err))
		cli_warn("%s", err.text);
}
