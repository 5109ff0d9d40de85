/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The actuators that a plan renders its force through, one to three, each along its direction.
 *
 *   force ─▶ f[i] = dual[i] · force ─▶ nut[i] = handle[i] + f[i] / spring[i]
 *
 *   felt = Σ f[i] direction[i]: the force's projection on the span of the directions. The rest,
 *   force - felt, cannot be felt on this rig.
 *
 * A device that fails ends the ticks: then all nuts go to rest, and the reason names the failed
 * device.
 */
#ifndef INCISE_ACTUATE_H
#define INCISE_ACTUATE_H

#include <incise/plan.h>

struct incise_axis {
	struct incise_stepper *stepper;
	struct incise_stepper_info info;
	double direction[3], dual[3]; /* see device/axes.h */
	double handle_mm;	      /* where the handle was along it when last asked */
	bool handle_seen;	      /* by a pose */
};

struct incise_axes {
	struct incise_axis axis[INCISE_RIG_AXES_MAX];
	int n;
	const struct incise_axis *failed; /* or NULL */
	unsigned int faults; /* why it does not move; incise_stepper_fault bits */
	bool off;	     /* it has no power */
};

/* All actuators that the rig has open. */
void incise_axes_take(struct incise_axes *axes, struct incise_rig *rig);

/*
 * Give each actuator the target that renders its part of @force_N, from where the handle is, and
 * fill in the tick's actuated_N, rendered_N and unfelt_N. The status of all is read before the
 * first target is set.
 *
 * Returns 0, or the negative errno of the first actuator that fails.
 */
int incise_axes_render(struct incise_axes *axes, const double force_N[3],
		       struct incise_tick *tick) INCISE_REALTIME;

/* Read all actuators of a plan that the kernel runs, and fill in rendered_N; as incise_axes_render(). */
int incise_axes_watch(struct incise_axes *axes, struct incise_tick *tick) INCISE_REALTIME;

/* Fill in unfelt_N, from actuated_N. */
void incise_axes_rest(const struct incise_axes *axes, const double force_N[3],
		      struct incise_tick *tick) INCISE_REALTIME;

/*
 * Send all nuts to rest, also when some do not go any more. Returns 0 or the negative errno of
 * the first that fails; *axes remembers that actuator, unless @keep.
 */
int incise_axes_release(struct incise_axes *axes, bool keep) INCISE_REALTIME;

/* The reason why an actuator failed, in a few words; NULL: all have power and no faults. */
const char *incise_axes_fault(const struct incise_axes *axes);

/*
 * The reason of the errno @rc in one line, with the device's own words and, if there are several
 * actuators, the name of the failed one. Returns the length of the line; 0: no actuator failed,
 * or the only one does not say why.
 */
int incise_axes_cause(const struct incise_axes *axes, int rc, char *text, size_t size);

#endif
