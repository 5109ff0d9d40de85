/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A scene of the paper's model on the virtual rig in simulated time, whose devices a
 * test can replace by its own.
 */
#ifndef INCISE_TEST_FELT_H
#define INCISE_TEST_FELT_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/fixed.h>
#include <incise/plan.h>
#include <incise/rig.h>
#include <incise/scene.h>
#include <incise/backend.h>
#include "../../../lib/scene/scene.h"
#include "../model/paper_model.h"

#define FELT_LIMIT_N 3.0
#define FELT_SLEW_N_S 300.0

struct felt {
	char dir[40], scene_path[64], model_path[64], fixed_path[64];
	struct incise_scene *scene;
	struct incise_rig *rig;
	struct incise_plan *plan;
	const struct incise_tracker_ops *tracker_ops;
	const struct incise_stepper_ops *stepper_ops;
};

/* A model with about 0.1 N/mm and 0.01 N·s/mm. */
static inline void felt_write_model(const char *path)
{
	struct incise_model *model = paper_model(INCISE_MF_GAUSS, 1, 0.1);

	for (int r = 0; r < 20; r++) {
		double p[] = {0.02 * (r % 3), 0.1, 0.01};

		incise_model_set_consequent(model, r, p);
	}
	if (incise_model_save(model, path, NULL))
		abort();
	incise_model_free(model);
}

/* Its fixed point, compiled once by a process: that would take most of the time of a plan's start. */
static inline void felt_write_fixed(const char *model_path, const char *path)
{
	static struct incise_fixed *fx;

	if (!fx) {
		struct incise_model *model = incise_model_load(model_path, NULL);

		fx = incise_fixed_compile(model, NULL, NULL);
		incise_model_free(model);
	}
	if (!fx || incise_fixed_save(fx, path, NULL))
		abort();
}

/*
 * A scene that is not checked to be stable, which takes longer than a test; the check would find the stiffness with which
 * the model's tissue unloads.
 */
static inline struct incise_scene *felt_scene(const char *path)
{
	struct incise_scene *scene = incise_scene_load(path, NULL, NULL);

	if (!scene)
		abort();
	scene->unchecked = true;
	scene->tissue.force[0][INCISE_REACTION_UNLOADING] = 0.1331;
	return scene;
}

static inline void felt_start(struct felt *f, const char *arithmetic,
			      unsigned int devices)
{
	FILE *out;

	memset(f, 0, sizeof(*f));
	strcpy(f->dir, "/tmp/incise-felt-XXXXXX");
	if (!mkdtemp(f->dir))
		abort();
	snprintf(f->scene_path, sizeof(f->scene_path), "%s/x.scene", f->dir);
	snprintf(f->model_path, sizeof(f->model_path), "%s/x.fis", f->dir);
	snprintf(f->fixed_path, sizeof(f->fixed_path), "%s/x.fx", f->dir);
	felt_write_model(f->model_path);
	felt_write_fixed(f->model_path, f->fixed_path);
	out = fopen(f->scene_path, "w");
	fprintf(out,
		"model = \"%s\"; arithmetic = \"%s\";\n"
		"limits = { force_N = %g; slew_N_s = %g; pose_age_ms = 50.0; };\n",
		strcmp(arithmetic, "fixed") ? "x.fis" : "x.fx", arithmetic, FELT_LIMIT_N,
		FELT_SLEW_N_S);
	fclose(out);
	f->scene = felt_scene(f->scene_path);
	f->rig = incise_rig_open("sim:clock=simulated,depth_mm=5,times=1", devices, NULL);
	if (!f->rig)
		abort();
	f->plan = incise_plan_new(f->scene, f->rig, NULL);
	if (!f->plan)
		abort();
	f->tracker_ops = incise_rig_tracker(f->rig)->ops;
	if (incise_rig_stepper(f->rig))
		f->stepper_ops = incise_rig_stepper(f->rig)->ops;
}

static inline void felt_end(struct felt *f)
{
	/* The rig closes its devices with their own functions. */
	incise_rig_tracker(f->rig)->ops = f->tracker_ops;
	if (f->stepper_ops)
		incise_rig_stepper(f->rig)->ops = f->stepper_ops;
	incise_plan_free(f->plan);
	incise_rig_close(f->rig);
	incise_scene_free(f->scene);
	unlink(f->scene_path);
	unlink(f->model_path);
	unlink(f->fixed_path);
	rmdir(f->dir);
}

#endif
