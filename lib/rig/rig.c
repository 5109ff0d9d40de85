// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A rig: opens the devices of a plan on one clock; see incise/rig.h. The plan is read
 * first, so that an error in the file opens nothing.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/rig.h>
#include "../base/vector.h"
#include "../sim/sim.h"
#include "backends.h"
#include "encoder.h"
#include "haptic_page.h"
#include "rig_plan.h"
#include "stylus.h"

#define SIM_START_NS INCISE_NS_PER_S /* of a simulated clock: 0 would pass for unset */

struct incise_rig {
	char *spec;
	struct incise_loaded loaded[N_SLOTS]; /* modules of real devices */
	struct incise_clock *clock;
	struct incise_sim *sim;
	struct incise_tracker *tracker;
	struct incise_force *force;
	struct incise_camera *camera;
	struct incise_stepper *stepper[INCISE_RIG_AXES_MAX];
	struct incise_loaded driver_loaded[INCISE_RIG_AXES_MAX];
	/* NULL: none */
	struct incise_driver *driver[INCISE_RIG_AXES_MAX], *encoder[INCISE_RIG_AXES_MAX];
	double direction[INCISE_RIG_AXES_MAX][3];
	int n_axes; /* that are open */
	struct incise_haptic *haptic;
	struct incise_stylus *stylus;
	double point_mm[3], normal[3];
	struct incise_vision_setup vision;
	bool has_vision;
	struct incise_foot_switch_setup foot_switch;
	bool has_foot_switch;
	char sign_key[INCISE_RIG_KEY_PATH_MAX];
};

static void *rig_open_sim(struct incise_rig *rig, int slot)
{
	switch (slot) {
	case KIND_TRACKER:
		return rig->tracker = incise_sim_tracker_new(rig->sim);
	case KIND_FORCE:
		return rig->force = incise_sim_force_new(rig->sim);
	case KIND_CAMERA:
		return rig->camera = incise_sim_camera_new(rig->sim);
	default:
		rig->stepper[rig->n_axes] =
			incise_sim_stepper_new(rig->sim, slot - KIND_STEPPER);
		return rig->stepper[rig->n_axes] ? rig->stepper[rig->n_axes++] : NULL;
	}
}

/* Find the steppers that the same backend opened before; returns their number. */
static int siblings(const struct incise_rig *rig, int slot, struct incise_stepper **to)
{
	int n = 0;

	for (int i = KIND_STEPPER; i < slot; i++)
		if (rig->loaded[i].backend == rig->loaded[slot].backend)
			to[n++] = rig->stepper[i - KIND_STEPPER];
	return n;
}

/* The encoder of the stepper that was opened last. A program that watches leaves it to the other. */
static int open_encoder(struct incise_rig *rig,
			const struct incise_backend_request *request,
			struct incise_error *err)
{
	struct incise_stepper *stepper = rig->stepper[rig->n_axes - 1];
	struct incise_driver **encoder = &rig->encoder[rig->n_axes - 1];
	int rc;

	if (!*request->actuator->encoder || request->watch)
		return 0;
	if (!stepper->ops->attach)
		return incise_error_set(err, EOPNOTSUPP,
					"%s: this stepper has an encoder of its own; "
					"remove the key encoder",
					request->where);
	*encoder = incise_encoder_open((struct incise_motor *)stepper,
				       "/sys/bus/counter/devices", request->where, err);
	if (!*encoder)
		return -errno;
	rc = stepper->ops->attach(stepper, *encoder);
	if (!rc)
		rc = incise_encoder_start(*encoder);
	return rc ? incise_error_set(err, -rc, "%s: encoder: %s", request->where,
				     strerror(-rc))
		  : 0;
}

/* The driver chip of the stepper that was opened last. */
static int open_driver(struct incise_rig *rig, struct incise_backend_request *request,
		       struct incise_error *err)
{
	int axis = rig->n_axes - 1, n = 0;
	const char *text = request->actuator->driver;
	struct incise_driver *others[INCISE_RIG_AXES_MAX];
	struct incise_loaded *loaded = &rig->driver_loaded[axis];
	char where[sizeof(((struct rig_real *)0)->where) + 10], name[32];
	int rc;

	if (!*text)
		return 0;
	snprintf(where, sizeof(where), "%s: driver", request->where);
	if (!rig->stepper[axis]->ops->attach)
		return incise_error_set(err, EOPNOTSUPP,
					"%s: this stepper has a power stage of its own; "
					"remove the key driver",
					where);
	snprintf(name, sizeof(name), "%.*s", (int)strcspn(text, ":"), text);
	rc = incise_backend_find(loaded, "driver", name, where, err);
	if (rc)
		return rc;
	for (int i = 0; i < axis; i++)
		if (rig->driver_loaded[i].backend == loaded->backend)
			others[n++] = rig->driver[i];
	request->where = where;
	request->arguments = strchr(text, ':') ? strchr(text, ':') + 1 : "";
	request->drivers = others;
	request->n_drivers = n;
	rig->driver[axis] = loaded->backend->open(request, err);
	if (!rig->driver[axis])
		return errno ? -errno : -EIO;
	rc = rig->stepper[axis]->ops->attach(rig->stepper[axis], rig->driver[axis]);
	return rc ? incise_error_set(err, -rc, "%s: the motor is not at rest: %s", where,
				     strerror(-rc))
		  : 0;
}

static int rig_open_real(struct incise_rig *rig, const struct incise_rig_plan *plan,
			 int slot, struct incise_error *err)
{
	int kind = slot_kind(slot), axis = kind == KIND_STEPPER ? slot - kind : 0;
	struct incise_stepper *others[INCISE_RIG_AXES_MAX];
	const struct rig_real *real = &plan->real[slot];
	struct incise_backend_request request = {
		.arguments = real->arguments,
		.where = real->where,
		.clock = rig->clock,
		.watch = plan->watch,
		.actuator = &plan->actuator[axis],
		.tracker = &plan->tracker,
		.force = &plan->force,
		.camera = &plan->camera,
		.siblings = others,
	};
	void *device;
	int rc = incise_backend_find(&rig->loaded[slot], incise_kind_name[kind],
				     real->name, real->where, err);

	if (rc)
		return rc;
	request.n_siblings = siblings(rig, slot, others);
	device = rig->loaded[slot].backend->open(&request, err);
	if (!device)
		return errno ? -errno : -EIO;
	if (kind == KIND_TRACKER)
		rig->tracker = device;
	else if (kind == KIND_FORCE)
		rig->force = device;
	else if (kind == KIND_CAMERA)
		rig->camera = device;
	else
		rig->stepper[rig->n_axes++] = device;
	if (kind != KIND_STEPPER)
		return 0;
	rc = open_encoder(rig, &request, err);
	return rc ? rc : open_driver(rig, &request, err);
}

static int rig_devices(struct incise_rig *rig, const struct incise_rig_plan *plan,
		       struct incise_error *err)
{
	int rc = 0;

	for (int slot = 0; slot < KIND_STEPPER + plan->n_axes && !rc; slot++) {
		if (!(plan->devices & kind_bit(slot_kind(slot))))
			continue;
		if (plan->real[slot].name)
			rc = rig_open_real(rig, plan, slot, err);
		else if (!rig_open_sim(rig, slot))
			rc = incise_error_set(err, ENOMEM, "%.200s: %s; free some memory",
					      rig->spec, strerror(ENOMEM));
	}
	return rc;
}

/* A real device has an owner: another process. */
static int rig_haptic(struct incise_rig *rig, const struct incise_rig_plan *plan,
		      struct incise_error *err)
{
	bool own = !strncmp(plan->haptic_device, "sim:", 4);

	rig->haptic = own ? incise_haptic_open(plan->haptic_device, plan->haptic_where,
					       &plan->haptic, rig->clock, err)
			  : incise_haptic_attach(rig->spec, plan->haptic_device,
						 plan->haptic_where, &plan->haptic,
						 rig->clock, err);
	if (!rig->haptic)
		return -errno;
	rig->stylus = incise_stylus_new(rig->haptic, &plan->haptic);
	if (!rig->stylus)
		return incise_error_set(err, ENOMEM, "%s: %s", plan->haptic_where,
					strerror(ENOMEM));
	rig->tracker = &rig->stylus->tracker;
	return 0;
}

static struct incise_rig *rig_new(const struct incise_rig_plan *plan, const char *spec,
				  struct incise_error *err)
{
	struct incise_rig *rig = calloc(1, sizeof(*rig));
	int rc;

	if (!rig)
		goto no_memory;
	memcpy(rig->point_mm, plan->point_mm, sizeof(rig->point_mm));
	memcpy(rig->normal, plan->normal, sizeof(rig->normal));
	memcpy(rig->direction, plan->direction, sizeof(rig->direction));
	rig->vision = plan->vision;
	rig->has_vision = plan->has_vision;
	rig->foot_switch = plan->foot_switch;
	rig->has_foot_switch = plan->has_foot_switch;
	strcpy(rig->sign_key, plan->sign_key);
	rig->spec = strdup(spec);
	rig->clock = plan->simulated ? incise_clock_new_simulated(SIM_START_NS)
				     : incise_clock_new_real();
	if (!rig->spec || !rig->clock)
		goto no_memory;
	if (plan->sim) {
		rig->sim = incise_sim_new(&plan->config, rig->clock, err);
		if (!rig->sim)
			goto close;
	}
	/* First: a program that waits for its owner opens nothing else. */
	rc = plan->haptic_device ? rig_haptic(rig, plan, err) : 0;
	if (!rc)
		rc = rig_devices(rig, plan, err);
	if (!rc)
		return rig;
	errno = -rc;
	goto close;
no_memory:
	incise_error_set(err, ENOMEM, "%.200s: %s; free some memory", spec,
			 strerror(ENOMEM));
close:
	rc = errno;
	incise_rig_close(rig);
	errno = rc;
	return NULL;
}

struct incise_rig *incise_rig_open(const char *spec, unsigned int devices,
				   struct incise_error *err)
{
	struct incise_rig *rig = NULL;
	struct incise_rig_plan plan;
	int rc = incise_rig_plan_read(&plan, spec, devices, err);

	if (!rc) {
		rig = rig_new(&plan, spec, err);
		rc = rig ? 0 : -errno;
	}
	incise_rig_plan_free(&plan);
	if (rc) {
		/* err->code is the errno of this function. */
		errno = -rc;
		if (err)
			err->code = errno;
	}
	return rig;
}

void incise_rig_close(struct incise_rig *rig)
{
	if (!rig)
		return;
	if (rig->tracker && !rig->stylus)
		rig->tracker->ops->close(rig->tracker);
	if (rig->force)
		rig->force->ops->close(rig->force);
	if (rig->camera)
		rig->camera->ops->close(rig->camera);
	for (int i = 0; i < rig->n_axes; i++)
		if (rig->encoder[i])
			rig->encoder[i]->ops->close(rig->encoder[i]);
	for (int i = 0; i < rig->n_axes; i++)
		rig->stepper[i]->ops->close(rig->stepper[i]);
	/* The first on a line has opened it. */
	for (int i = rig->n_axes - 1; i >= 0; i--) {
		if (rig->driver[i])
			rig->driver[i]->ops->close(rig->driver[i]);
		incise_backend_unload(&rig->driver_loaded[i]);
	}
	for (int slot = 0; slot < N_SLOTS; slot++)
		incise_backend_unload(&rig->loaded[slot]);
	free(rig->stylus);
	incise_haptic_close(rig->haptic);
	incise_sim_free(rig->sim);
	incise_clock_free(rig->clock);
	free(rig->spec);
	free(rig);
}

const char *incise_rig_spec(const struct incise_rig *rig)
{
	return rig->spec;
}

struct incise_clock *incise_rig_clock(struct incise_rig *rig)
{
	return rig->clock;
}

struct incise_tracker *incise_rig_tracker(struct incise_rig *rig)
{
	return rig->tracker;
}

struct incise_force *incise_rig_force(struct incise_rig *rig)
{
	return rig->force;
}

struct incise_camera *incise_rig_camera(struct incise_rig *rig)
{
	return rig->camera;
}

struct incise_stepper *incise_rig_stepper(struct incise_rig *rig)
{
	return rig->stepper[0];
}

struct incise_stepper *incise_rig_axis(struct incise_rig *rig, int i, double direction[3])
{
	if (i < 0 || i >= rig->n_axes)
		return NULL;
	if (direction)
		memcpy(direction, rig->direction[i], sizeof(rig->direction[i]));
	return rig->stepper[i];
}

struct incise_haptic *incise_rig_haptic(struct incise_rig *rig)
{
	return rig->haptic;
}

struct incise_stylus *incise_rig_stylus(struct incise_rig *rig)
{
	return rig->stylus;
}

void incise_rig_haptic_place(struct incise_rig *rig,
			     const struct incise_calibration *calibration)
{
	if (rig->stylus)
		incise_calibration_frame(calibration, rig->stylus->setup.turn,
					 rig->stylus->setup.origin_mm);
}

void incise_rig_haptic_assume(struct incise_rig *rig, int64_t latency_ns)
{
	if (rig->stylus)
		incise_stylus_assume(rig->stylus, latency_ns);
}

void incise_rig_haptic_ages(const struct incise_rig *rig, struct incise_haptic_ages *ages)
{
	*ages = (struct incise_haptic_ages){0};
	if (rig->stylus)
		incise_stylus_ages(rig->stylus, ages);
}

struct incise_sim *incise_rig_sim(struct incise_rig *rig)
{
	return rig->sim;
}

void incise_rig_surface(const struct incise_rig *rig, double point_mm[3],
			double normal[3])
{
	memcpy(point_mm, rig->point_mm, sizeof(rig->point_mm));
	memcpy(normal, rig->normal, sizeof(rig->normal));
}

int incise_rig_vision(const struct incise_rig *rig, struct incise_vision_setup *setup)
{
	if (!rig->has_vision)
		return -ENOENT;
	*setup = rig->vision;
	return 0;
}

const char *incise_rig_sign_key(const struct incise_rig *rig)
{
	return *rig->sign_key ? rig->sign_key : NULL;
}

int incise_rig_foot_switch(const struct incise_rig *rig,
			   struct incise_foot_switch_setup *setup)
{
	if (!rig->has_foot_switch)
		return -ENOENT;
	*setup = rig->foot_switch;
	return 0;
}
