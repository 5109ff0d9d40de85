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
#include "../sim/sim.h"
#include "backends.h"
#include "rig_plan.h"

#define SIM_START_NS INCISE_NS_PER_S /* of a simulated clock: 0 would pass for unset */

struct incise_rig {
	char *spec;
	struct incise_loaded loaded[N_KINDS]; /* modules of real devices */
	struct incise_clock *clock;
	struct incise_sim *sim;
	struct incise_tracker *tracker;
	struct incise_force *force;
	struct incise_camera *camera;
	struct incise_stepper *stepper;
	double point_mm[3], normal[3];
	struct incise_vision_setup vision;
	bool has_vision;
};

static void *rig_open_sim(struct incise_rig *rig, int kind)
{
	switch (kind) {
	case KIND_TRACKER:
		return rig->tracker = incise_sim_tracker_new(rig->sim);
	case KIND_FORCE:
		return rig->force = incise_sim_force_new(rig->sim);
	case KIND_CAMERA:
		return rig->camera = incise_sim_camera_new(rig->sim);
	default:
		return rig->stepper = incise_sim_stepper_new(rig->sim);
	}
}

static int rig_open_real(struct incise_rig *rig, const struct incise_rig_plan *plan,
			 int kind, struct incise_error *err)
{
	const struct rig_real *real = &plan->real[kind];
	struct incise_backend_request request = {
		.arguments = real->arguments,
		.where = real->where,
		.clock = rig->clock,
		.watch = plan->watch,
		.actuator = &plan->actuator,
		.tracker = &plan->tracker,
		.force = &plan->force,
		.camera = &plan->camera,
	};
	void *device;
	int rc = incise_backend_find(&rig->loaded[kind], incise_kind_name[kind],
				     real->name, real->where, err);

	if (rc)
		return rc;
	device = rig->loaded[kind].backend->open(&request, err);
	if (!device)
		return errno ? -errno : -EIO;
	if (kind == KIND_TRACKER)
		rig->tracker = device;
	else if (kind == KIND_FORCE)
		rig->force = device;
	else if (kind == KIND_CAMERA)
		rig->camera = device;
	else
		rig->stepper = device;
	return 0;
}

static int rig_devices(struct incise_rig *rig, const struct incise_rig_plan *plan,
		       struct incise_error *err)
{
	int rc = 0;

	for (int kind = 0; kind < N_KINDS && !rc; kind++) {
		if (!(plan->devices & kind_bit(kind)))
			continue;
		if (plan->real[kind].name)
			rc = rig_open_real(rig, plan, kind, err);
		else if (!rig_open_sim(rig, kind))
			rc = incise_error_set(err, ENOMEM, "%.200s: %s; free some memory",
					      rig->spec, strerror(ENOMEM));
	}
	return rc;
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
	rig->vision = plan->vision;
	rig->has_vision = plan->has_vision;
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
	if (rig->tracker)
		rig->tracker->ops->close(rig->tracker);
	if (rig->force)
		rig->force->ops->close(rig->force);
	if (rig->camera)
		rig->camera->ops->close(rig->camera);
	if (rig->stepper)
		rig->stepper->ops->close(rig->stepper);
	for (int kind = 0; kind < N_KINDS; kind++)
		incise_backend_unload(&rig->loaded[kind]);
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
	return rig->stepper;
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
