// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A plan's actuators: projection of the force, targets, faults; see actuate.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "../base/vector.h"
#include "../rig/axes.h"
#include "actuate.h"

void incise_axes_take(struct incise_axes *axes, struct incise_rig *rig)
{
	double direction[INCISE_RIG_AXES_MAX][3], dual[INCISE_RIG_AXES_MAX][3];
	struct incise_stepper *stepper;
	int n = 0;

	while (n < INCISE_RIG_AXES_MAX &&
	       (stepper = incise_rig_axis(rig, n, direction[n]))) {
		struct incise_axis *axis = &axes->axis[n++];

		*axis = (struct incise_axis){.stepper = stepper};
		incise_stepper_info(stepper, &axis->info);
	}
	incise_axes_dual(n, direction, dual);
	for (int i = 0; i < n; i++) {
		v3_copy(axes->axis[i].direction, direction[i]);
		v3_copy(axes->axis[i].dual, dual[i]);
	}
	axes->n = n;
}

/* An actuator that does not move any more: keep why. Returns @rc. */
static int refused_actuate(struct incise_axes *axes, int i,
			   const struct incise_stepper_status *status, int rc)
{
	axes->failed = &axes->axis[i];
	axes->faults = status->faults & ~(unsigned int)INCISE_STEPPER_FAULT_TRAVEL;
	axes->off = rc == -EIO && status->state == INCISE_STEPPER_STATE_DISABLED;
	return rc;
}

/*
 * The position of the handle: as the actuator measures it, else by the tracker's pose of
 * the tool in the hand, along the axis. Without a fresh pose it is where it was; before
 * the first one, where the spring is at rest.
 */
static void find_handle(struct incise_axis *axis, const struct incise_tick *tick,
			const struct incise_stepper_status *status)
{
	double mm = status->handle_mm;

	if (!axis->info.measures_handle) {
		if (!(tick->flags & INCISE_TICK_STALE))
			mm = v3_dot(tick->tool_mm, axis->direction) -
			     axis->info.origin_mm;
		else if (!axis->handle_seen)
			mm = status->position_mm;
	}
	if (!isfinite(mm))
		return;
	axis->handle_mm = mm;
	axis->handle_seen |= !(tick->flags & INCISE_TICK_STALE);
}

static double rendered(const struct incise_axis *axis,
		       const struct incise_stepper_status *status)
{
	double force_N = status->force_N;

	if (!axis->info.measures_handle)
		force_N =
			axis->info.spring_N_mm * (status->position_mm - axis->handle_mm);
	return isfinite(force_N) ? force_N : 0;
}

/* The nut goes where the spring would push with that force on the handle of the last tick. */
static int set_actuate(struct incise_axis *axis, double along_N, struct incise_tick *tick)
{
	double target_mm = axis->handle_mm + along_N / axis->info.spring_N_mm;
	double held_mm = fmax(0, fmin(axis->info.travel_mm, target_mm));

	/* Less than a step beyond is where its position is read to. */
	if (fabs(target_mm - held_mm) > axis->info.step_mm)
		tick->flags |= INCISE_TICK_TRAVEL;
	return incise_stepper_set(axis->stepper, held_mm);
}

void incise_axes_rest(const struct incise_axes *axes, const double force_N[3],
		      struct incise_tick *tick)
{
	double unfelt_N[3];

	v3_copy(unfelt_N, force_N);
	for (int i = 0; i < axes->n; i++)
		v3_add(unfelt_N, unfelt_N, -tick->actuated_N[i], axes->axis[i].direction);
	tick->unfelt_N = v3_length(unfelt_N);
}

int incise_axes_watch(struct incise_axes *axes, struct incise_tick *tick)
{
	for (int i = 0; i < axes->n; i++) {
		struct incise_stepper_status status = {0};
		int rc = incise_stepper_status(axes->axis[i].stepper, &status);

		if (!rc && (status.faults & ~(unsigned int)INCISE_STEPPER_FAULT_TRAVEL ||
			    status.state == INCISE_STEPPER_STATE_DISABLED))
			rc = -EIO;
		if (rc)
			return refused_actuate(axes, i, &status, rc);
		find_handle(&axes->axis[i], tick, &status);
		tick->rendered_N[i] = rendered(&axes->axis[i], &status);
	}
	return 0;
}

int incise_axes_render(struct incise_axes *axes, const double force_N[3],
		       struct incise_tick *tick)
{
	struct incise_stepper_status status[INCISE_RIG_AXES_MAX] = {0};
	int rc = 0;

	for (int i = 0; i < axes->n; i++) {
		rc = incise_stepper_status(axes->axis[i].stepper, &status[i]);
		if (rc)
			return refused_actuate(axes, i, &status[i], rc);
	}
	for (int i = 0; i < axes->n && !rc; i++) {
		struct incise_axis *axis = &axes->axis[i];

		tick->actuated_N[i] = v3_dot(force_N, axis->dual);
		find_handle(axis, tick, &status[i]);
		tick->rendered_N[i] = rendered(axis, &status[i]);
		rc = set_actuate(axis, tick->actuated_N[i], tick);
		if (rc) {
			incise_stepper_status(axis->stepper, &status[i]);
			refused_actuate(axes, i, &status[i], rc);
		}
	}
	incise_axes_rest(axes, force_N, tick);
	return rc;
}

int incise_axes_release(struct incise_axes *axes, bool keep)
{
	int first = 0;

	for (int i = 0; i < axes->n; i++) {
		struct incise_axis *axis = &axes->axis[i];
		struct incise_stepper_status status = {0};
		int rc = incise_stepper_set(axis->stepper, axis->info.rest_mm);

		if (!rc || first)
			continue;
		first = rc;
		if (keep)
			continue;
		incise_stepper_status(axis->stepper, &status);
		refused_actuate(axes, i, &status, rc);
	}
	return first;
}

const char *incise_axes_fault(const struct incise_axes *axes)
{
	unsigned int faults = axes->faults;

	if (faults)
		return incise_stepper_fault_text(
			(enum incise_stepper_fault)(faults & -faults));
	return axes->off ? "the actuator is off: enable it" : NULL;
}

int incise_axes_cause(const struct incise_axes *axes, int rc, char *text, size_t size)
{
	const char *fault = incise_axes_fault(axes);
	char own[300] = "";

	if (!axes->failed || (!fault && axes->n == 1))
		return 0;
	if (!fault)
		fault = strerror(-rc);
	/* It may have been cleared since, by someone else. */
	if (axes->faults &&
	    incise_stepper_cause(axes->failed->stepper, own, sizeof(own)) > 0)
		fault = own;
	return axes->n > 1
		       ? snprintf(text, size, "%s: %s", axes->failed->info.name, fault)
		       : snprintf(text, size, "%s", fault);
}
