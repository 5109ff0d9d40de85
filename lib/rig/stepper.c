// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * An actuator in front of its backend, and the homing of those whose drive does not home
 * by itself; mm of the nut. See incise/stepper.h.
 */
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <incise/backend.h>
#include <incise/clock.h>

#define POLL_NS 1000000
#define LEAST_POLL_NS 100000
#define REST_NS (2 * INCISE_NS_PER_S)

/*
 * Homing:
 *
 *   input  ■■■■■■■■■■■■■┐__________________________  position ─▶
 *                       ◀───── 1 at home_mm_s
 *                       ├──▶   2 off it again
 *                       ◀──    3 at a tenth: the edge
 *                       ●      4 this is home_mm
 *
 * Until then a position is only a count. The backend holds it within the travel, so each
 * move starts with a count that leaves enough travel for it.
 */
struct home {
	struct incise_stepper *stepper;
	const volatile int *stop;
	struct incise_error *err;
	struct incise_stepper_info info;
	struct incise_stepper_homing homing;
	struct incise_stepper_status status; /* the last one */
	int64_t poll_ns, left_ns;
	double renamed_mm; /* count now less count at the start, of the same place */
	double edge_mm;	   /* in the count at the start */
};

static const char *input_name(const struct home *h)
{
	return h->homing.home_at == INCISE_STEPPER_LINE_HOME ? "home input"
							     : "limit switch at 0";
}

static bool at_home(const struct home *h)
{
	return h->status.inputs & h->homing.home_at;
}

/* Without a home input, homing looks for the limit switch at 0. */
static bool hit_limit(const struct home *h)
{
	return h->homing.home_at == INCISE_STEPPER_LINE_LIMIT_MIN &&
	       h->status.faults & INCISE_STEPPER_FAULT_LIMIT_MIN;
}

static int sleep_ns(struct incise_stepper *stepper, int64_t ns)
{
	struct timespec wait = {ns / INCISE_NS_PER_S, ns % INCISE_NS_PER_S};

	if (stepper->ops->wait)
		return stepper->ops->wait(stepper, ns);
	/* Cut short by a signal: the next poll looks at @stop. */
	clock_nanosleep(CLOCK_MONOTONIC, 0, &wait, NULL);
	return 0;
}

/* Report an error of the backend in one line. */
static int refused_stepper(const struct home *h, int rc)
{
	return rc ? incise_error_set(h->err, -rc,
				     "homing %s: %s; see `incise stepper "
				     "status`",
				     h->info.name, strerror(-rc))
		  : 0;
}

static int fault_error(const struct home *h)
{
	unsigned int faults = h->status.faults & ~INCISE_STEPPER_FAULT_TRAVEL;
	char cause[300];

	if (faults & INCISE_STEPPER_FAULT_GONE)
		return incise_error_set(
			h->err, ENODEV, "homing %s: %s", h->info.name,
			incise_stepper_fault_text(INCISE_STEPPER_FAULT_GONE));
	if (!faults)
		return incise_error_set(h->err, EIO,
					"homing %s: it is off; enable it first",
					h->info.name);
	/* The fault may have been cleared since; homing failed all the same. */
	if (incise_stepper_cause(h->stepper, cause, sizeof(cause)) <= 0)
		snprintf(cause, sizeof(cause), "%s",
			 incise_stepper_fault_text(
				 (enum incise_stepper_fault)(faults & -faults)));
	return incise_error_set(h->err, EIO, "homing %s: %s", h->info.name, cause);
}

/*
 * Wait for one poll, then read the status. The limit that homing looks for is no fault.
 */
static int look_stepper(struct home *h)
{
	int rc;

	if (h->stop && *h->stop)
		return incise_error_set(h->err, EINTR,
					"homing %s: stopped; its position is unknown: "
					"home again",
					h->info.name);
	if (h->left_ns <= 0)
		return incise_error_set(h->err, ETIMEDOUT,
					"homing %s: not done in time; check that it "
					"moves, and home_mm_s in rig.conf",
					h->info.name);
	rc = sleep_ns(h->stepper, h->poll_ns);
	h->left_ns -= h->poll_ns;
	if (!rc || rc == -EINTR)
		rc = incise_stepper_status(h->stepper, &h->status);
	if (rc)
		return refused_stepper(h, rc);
	if (hit_limit(h))
		return 0;
	if (h->status.faults & ~INCISE_STEPPER_FAULT_TRAVEL ||
	    (h->status.state != INCISE_STEPPER_STATE_READY &&
	     h->status.state != INCISE_STEPPER_STATE_MOVING))
		return fault_error(h);
	return 0;
}

static bool at_rest(const struct home *h)
{
	return h->status.state == INCISE_STEPPER_STATE_READY && !h->status.velocity_mm_s;
}

/* Power it again after the limit switch switched it off. */
static int recover(struct home *h)
{
	int rc = 0;

	while (!rc && h->status.state == INCISE_STEPPER_STATE_STOPPING)
		rc = look_stepper(h);
	if (!rc && h->status.state == INCISE_STEPPER_STATE_FAULT)
		rc = incise_stepper_clear(h->stepper, h->err);
	if (!rc)
		rc = incise_stepper_enable(h->stepper, h->err);
	if (!rc)
		rc = refused_stepper(h, incise_stepper_status(h->stepper, &h->status));
	return rc;
}

/* Come to rest with power on. */
static int rest(struct home *h)
{
	int rc;

	do {
		if (hit_limit(h))
			rc = recover(h);
		else
			rc = refused_stepper(h, incise_stepper_jog(h->stepper, 0));
		if (!rc)
			rc = look_stepper(h);
	} while (!rc && (hit_limit(h) || !at_rest(h)));
	return rc;
}

/* Name the place where it stands. */
static int name_place(struct home *h, double position_mm, bool homed)
{
	int rc = refused_stepper(h,
				 h->stepper->ops->origin(h->stepper, position_mm, homed));

	if (rc)
		return rc;
	h->renamed_mm += position_mm - h->status.position_mm;
	h->status.position_mm = position_mm;
	return 0;
}

static int go_to(struct home *h, double position_mm)
{
	/* Half a step, and the rounding of a count in mm. */
	double near_mm = 0.501 * h->info.step_mm;
	int rc;

	do {
		rc = refused_stepper(h, incise_stepper_set(h->stepper, position_mm));
		if (!rc)
			rc = look_stepper(h);
		if (!rc && hit_limit(h))
			rc = fault_error(h);
	} while (!rc &&
		 !(at_rest(h) && fabs(h->status.position_mm - position_mm) <= near_mm));
	return rc;
}

/*
 * Move until the input becomes active (@until) or inactive, then come to rest.
 *
 * @from_mm the count at the start: the move ends at 0 or at the end of the travel
 * @edge_mm where the input changed, in that count
 * Returns 1 when the move ended first.
 */
static int seek(struct home *h, double mm_s, double from_mm, bool until, double *edge_mm)
{
	double end_mm = mm_s > 0 ? h->info.travel_mm : 0;
	struct incise_stepper_edge before = {0}, edge = {0};
	bool found = false, passed = false, ended = false;
	int rc = name_place(h, from_mm, false);

	if (!rc)
		rc = refused_stepper(h, h->stepper->ops->edge(h->stepper, &before));
	while (!rc && !found && !ended) {
		rc = refused_stepper(h, incise_stepper_jog(h->stepper, mm_s));
		if (!rc)
			rc = look_stepper(h);
		if (!rc)
			rc = refused_stepper(h, h->stepper->ops->edge(h->stepper, &edge));
		if (rc)
			return rc;
		/* A narrow mark may pass between two polls. */
		passed = until && edge.seen &&
			 (!before.seen || edge.position_mm != before.position_mm);
		found = passed || at_home(h) == until || hit_limit(h);
		ended = at_rest(h) &&
			fabs(h->status.position_mm - end_mm) < h->info.step_mm;
	}
	*edge_mm = passed ? edge.position_mm : h->status.position_mm;
	if (!rc)
		rc = rest(h);
	return rc ? rc : !found;
}

/* Leave the input: no switch is longer than a quarter of the travel. */
static int back_off(struct home *h)
{
	double travel_mm = h->info.travel_mm, edge_mm;
	int rc = 0;

	if (at_home(h)) {
		rc = seek(h, h->homing.speed_mm_s, 0.75 * travel_mm, false, &edge_mm);
		if (rc > 0)
			return incise_error_set(
				h->err, EIO,
				"homing %s: the %s stays active over a quarter of the "
				"travel; check its wiring and polarity",
				h->info.name, input_name(h));
	}
	if (!rc)
		rc = name_place(h, 0, false);
	if (!rc)
		rc = go_to(h, fmin(h->homing.clearance_mm, travel_mm / 4));
	return rc;
}

/* Towards the input, for 1.25 times the travel: where the nut stands is not known. */
static int approach(struct home *h)
{
	double travel_mm = h->info.travel_mm, edge_mm;
	int rc = seek(h, -h->homing.speed_mm_s, travel_mm, true, &edge_mm);

	if (rc > 0)
		rc = seek(h, -h->homing.speed_mm_s, travel_mm / 4, true, &edge_mm);
	if (rc > 0)
		return incise_error_set(
			h->err, EIO,
			"homing %s: no edge of the %s within the travel; check its "
			"wiring, and invert in rig.conf",
			h->info.name, input_name(h));
	return rc;
}

static int find_stepper(struct home *h)
{
	double rest_mm = fmax(h->homing.home_mm, 0), edge_mm = 0;
	int rc = 0;

	if (!at_home(h))
		rc = approach(h);
	if (!rc)
		rc = back_off(h);
	if (!rc)
		/* From the middle of the count: it can move to both sides of the edge. */
		rc = seek(h, -h->homing.edge_mm_s, h->info.travel_mm / 2, true, &edge_mm);
	if (rc > 0)
		return incise_error_set(h->err, EIO,
					"homing %s: no edge of the %s on the way back; "
					"check that it is mounted firmly",
					h->info.name, input_name(h));
	h->edge_mm = edge_mm - h->renamed_mm;
	/* To the edge, or from it to where the travel starts. */
	if (!rc)
		rc = go_to(h, edge_mm + rest_mm - h->homing.home_mm);
	if (!rc)
		rc = name_place(h, rest_mm, true);
	if (!rc)
		rc = go_to(h, rest_mm);
	return rc;
}

/* After an error nothing may move; the message of the first error stays. */
static void halt(struct home *h)
{
	h->err = NULL;
	h->stop = NULL;
	h->left_ns = REST_NS;
	rest(h);
}

/* For a stepper with jog, homing, edge and origin; @edge may be NULL. */
static int home_by_edge(struct incise_stepper *stepper, const volatile int *stop,
			struct incise_stepper_edge_found *edge, struct incise_error *err)
{
	struct home h = {.stepper = stepper, .stop = stop, .err = err};
	int rc;

	incise_stepper_info(stepper, &h.info);
	rc = stepper->ops->homing(stepper, &h.homing);
	if (rc == -EOPNOTSUPP)
		return incise_error_set(err, EOPNOTSUPP,
					"homing %s: neither a home input nor a limit "
					"switch at 0 is wired; wire one",
					h.info.name);
	if (rc)
		return refused_stepper(&h, rc);
	/* Poll four times within the deadman time. */
	h.poll_ns = (int64_t)fmax(LEAST_POLL_NS,
				  fmin(POLL_NS, h.info.deadman_s / 4 * INCISE_NS_PER_S));
	h.left_ns = (int64_t)(INCISE_NS_PER_S *
			      (60 + h.info.travel_mm / h.homing.speed_mm_s));
	rc = look_stepper(&h);
	if (!rc)
		rc = rest(&h);
	if (!rc)
		rc = find_stepper(&h);
	if (rc && rc != -ENODEV)
		halt(&h);
	if (!rc && edge)
		*edge = (struct incise_stepper_edge_found){h.edge_mm, h.homing.home_mm};
	return rc;
}

/* The backend has no function for it. */
static int cannot(const struct incise_stepper *stepper, const char *what,
		  struct incise_error *err)
{
	struct incise_stepper_info info = {0};

	stepper->ops->info(stepper, &info);
	return incise_error_set(
		err, EOPNOTSUPP, "%s does not support being %s%s", info.name, what,
		strchr(what, ':') ? "" : "; name another backend in rig.conf");
}

int incise_stepper_set(struct incise_stepper *stepper, double position_mm)
{
	return stepper->ops->set(stepper, position_mm);
}

int incise_stepper_jog(struct incise_stepper *stepper, double velocity_mm_s)
{
	return stepper->ops->jog ? stepper->ops->jog(stepper, velocity_mm_s)
				 : -EOPNOTSUPP;
}

int incise_stepper_status(struct incise_stepper *stepper,
			  struct incise_stepper_status *status)
{
	return stepper->ops->status(stepper, status);
}

int incise_stepper_enable(struct incise_stepper *stepper, struct incise_error *err)
{
	return stepper->ops->enable ? stepper->ops->enable(stepper, err)
				    : cannot(stepper, "enabled", err);
}

int incise_stepper_disable(struct incise_stepper *stepper, struct incise_error *err)
{
	return stepper->ops->disable ? stepper->ops->disable(stepper, err)
				     : cannot(stepper, "disabled", err);
}

int incise_stepper_clear(struct incise_stepper *stepper, struct incise_error *err)
{
	return stepper->ops->clear ? stepper->ops->clear(stepper, err)
				   : cannot(stepper, "cleared", err);
}

int incise_stepper_home(struct incise_stepper *stepper, const volatile int *stop,
			struct incise_stepper_edge_found *edge, struct incise_error *err)
{
	const struct incise_stepper_ops *ops = stepper->ops;

	if (ops->home)
		return ops->home(stepper, stop, edge, err);
	if (!ops->jog || !ops->homing || !ops->edge || !ops->origin)
		return cannot(stepper, "homed, and needs none: its position is absolute",
			      err);
	return home_by_edge(stepper, stop, edge, err);
}

void incise_stepper_info(const struct incise_stepper *stepper,
			 struct incise_stepper_info *info)
{
	stepper->ops->info(stepper, info);
}

int incise_stepper_cause(struct incise_stepper *stepper, char *text, size_t size)
{
	struct incise_stepper_status status = {0};
	unsigned int faults;
	int length = 0;

	if (stepper->ops->cause)
		length = stepper->ops->cause(stepper, text, size);
	if (length > 0)
		return length;
	stepper->ops->status(stepper, &status);
	/* A target that was held stops nothing. */
	faults = status.faults & ~INCISE_STEPPER_FAULT_TRAVEL
			 ? status.faults & ~INCISE_STEPPER_FAULT_TRAVEL
			 : status.faults;
	return snprintf(text, size, "%s",
			faults ? incise_stepper_fault_text(
					 (enum incise_stepper_fault)(faults & -faults))
			       : "");
}

int incise_stepper_counter(struct incise_stepper *stepper, int i,
			   struct incise_stepper_counter *counter)
{
	return stepper->ops->counter && i >= 0
		       ? stepper->ops->counter(stepper, i, counter)
		       : -ENOENT;
}

int incise_stepper_chip(struct incise_stepper *stepper, struct incise_stepper_chip *chip)
{
	return stepper->ops->chip ? stepper->ops->chip(stepper, chip) : -EOPNOTSUPP;
}

const char *incise_stepper_state_name(enum incise_stepper_state state)
{
	switch (state) {
	case INCISE_STEPPER_STATE_DISABLED:
		return "disabled";
	case INCISE_STEPPER_STATE_READY:
		return "ready";
	case INCISE_STEPPER_STATE_MOVING:
		return "moving";
	case INCISE_STEPPER_STATE_STOPPING:
		return "stopping";
	case INCISE_STEPPER_STATE_FAULT:
		return "fault";
	}
	return "unknown";
}

const char *incise_stepper_fault_text(enum incise_stepper_fault fault)
{
	switch (fault) {
	case INCISE_STEPPER_FAULT_DEADMAN:
		return "deadman: no more targets arrived; check the program that "
		       "drives it, then clear";
	case INCISE_STEPPER_FAULT_TRAVEL:
		return "travel: a target was outside and was clamped";
	case INCISE_STEPPER_FAULT_LIMIT_MIN:
		return "limit switch at 0: clear, enable and home";
	case INCISE_STEPPER_FAULT_LIMIT_MAX:
		return "limit switch at the end of the travel: clear, enable and home";
	case INCISE_STEPPER_FAULT_ESTOP:
		return "e-stop: release it, then clear";
	case INCISE_STEPPER_FAULT_ALARM:
		return "alarm of the power stage: see its display, switch it off and "
		       "on, then clear";
	case INCISE_STEPPER_FAULT_LATE:
		return "late: this machine could not hold the step times; give a "
		       "smaller velocity_mm_s or a real-time kernel, then clear";
	case INCISE_STEPPER_FAULT_SETPOINT:
		return "invalid setpoint: two programs drive it, or one is faulty; end "
		       "it, then clear";
	case INCISE_STEPPER_FAULT_OWNER:
		return "the program that drove it ended while it was on: clear";
	case INCISE_STEPPER_FAULT_SUSPEND:
		return "the machine was suspended: clear, enable and home";
	case INCISE_STEPPER_FAULT_GONE:
		return "the device was removed: plug it in, or load its module again";
	case INCISE_STEPPER_FAULT_LINE:
		return "a GPIO line cannot be written or read: check its wiring and "
		       "the kernel's log, then clear";
	case INCISE_STEPPER_FAULT_BUS:
		return "the bus to the drive fails: check its cable, termination and "
		       "`ip -details link show`, then clear";
	case INCISE_STEPPER_FAULT_LOST:
		return "the drive does not answer any more, or restarted: check its "
		       "power and cable, then clear, enable and home";
	case INCISE_STEPPER_FAULT_FOLLOWING:
		return "it does not follow its targets: check that nothing blocks it, "
		       "or give a smaller acceleration_mm_s2, then clear";
	case INCISE_STEPPER_FAULT_PLAN:
		return "another motor of the same plan was stopped: check that one, "
		       "then clear both";
	case INCISE_STEPPER_FAULT_STEPS:
		return "steps are missing: check that nothing blocks it, or give a "
		       "smaller velocity_mm_s or acceleration_mm_s2, then clear, enable "
		       "and home";
	}
	return "unknown fault: see incise/stepper.h of the version in use";
}

/* --- plans ------------------------------------------------------------------------------ */

int incise_stepper_load_plan(struct incise_stepper *const *steppers, int n,
			     const void *bytes, size_t size, struct incise_error *err)
{
	const struct incise_stepper_plan_ops *plan =
		n > 0 ? steppers[0]->ops->plan : NULL;

	return plan ? plan->load(steppers, n, bytes, size, err)
		    : incise_error_set(
			      err, EOPNOTSUPP,
			      "the rig has no stepper of the kernel module, which is "
			      "required for plans; name its device in rig.conf, for "
			      "example kernel:/dev/incise-stepper0");
}

int incise_stepper_follow_plan(struct incise_stepper *stepper)
{
	return stepper->ops->plan ? stepper->ops->plan->follow(stepper) : -EOPNOTSUPP;
}

int incise_stepper_pose(struct incise_stepper *first,
			const struct incise_stepper_pose_given *pose)
{
	return first->ops->plan ? first->ops->plan->pose(first, pose) : -EOPNOTSUPP;
}

int incise_stepper_rendered(struct incise_stepper *stepper,
			    struct incise_stepper_rendered *rendered)
{
	return stepper->ops->plan ? stepper->ops->plan->rendered(stepper, rendered)
				  : -EOPNOTSUPP;
}

const char *incise_stepper_plan_state_name(enum incise_stepper_plan_state state)
{
	switch (state) {
	case INCISE_STEPPER_PLAN_EMPTY:
		return "no plan";
	case INCISE_STEPPER_PLAN_LOADED:
		return "loaded";
	case INCISE_STEPPER_PLAN_WAIT:
		return "waits";
	case INCISE_STEPPER_PLAN_RISE:
		return "rises";
	case INCISE_STEPPER_PLAN_FELT:
		return "felt";
	case INCISE_STEPPER_PLAN_FADE:
		return "faded";
	}
	return "unknown";
}

const char *incise_stepper_plan_reason_text(enum incise_stepper_plan_reason reason)
{
	switch (reason) {
	case INCISE_STEPPER_PLAN_SILENT:
		return "no fresh pose arrived";
	case INCISE_STEPPER_PLAN_ASKED:
		return "its feeder released it";
	case INCISE_STEPPER_PLAN_LEFT:
		return "its feeder ended";
	case INCISE_STEPPER_PLAN_AWAY:
		return "the machine was suspended, or its device removed";
	case INCISE_STEPPER_PLAN_STOPPED:
		return "a motor was stopped by a fault";
	case INCISE_STEPPER_PLAN_REFUSED:
		return "invalid poses, or poses in wrong order";
	}
	return "unknown";
}
