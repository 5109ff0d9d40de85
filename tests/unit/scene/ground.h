/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Scenes with every effect on, on each kind of ground, in a folder of their own; their
 * plans have no rig: poses are fed.
 *
 *        away    ○ away_mm along the normal: in free air
 *                ┆
 *      ──────────●────────── top of the surface, incise_plan_top()
 */
#ifndef INCISE_TEST_GROUND_H
#define INCISE_TEST_GROUND_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/plan.h>
#include <incise/scene.h>
#include "felt.h"

/* Limits of every such scene. LEAVE_MM is exact in binary. */
#define GROUND_FORCE_N 2.0
#define GROUND_SLEW_N 0.4 /* in a tick, as 400 N/s */
#define GROUND_AGE_NS 50000000
#define GROUND_LEAVE_MM 0.25
#define GROUND_HANDLE_MM 120.0

struct ground {
	const char *name;
	const char *surface; /* as the scene has it */
	double away_mm;
};

static const struct ground grounds[] = {
	{"plane", "kind = \"plane\";", 80},
	{"turned plane", "kind = \"plane\"; normal = [0.0, 0.0, -1.0];", 80},
	{"sphere", "kind = \"sphere\"; centre_mm = [0.0, 0.0, -40.0]; radius_mm = 40.0;",
	 80},
	{"capsule",
	 "kind = \"capsule\"; from_mm = [-60.0, 0.0, -55.0]; to_mm = [160.0, 0.0, "
	 "-55.0]; radius_mm = 55.0;",
	 80},
	{"heights", "kind = \"heights\"; file = \"waves.asc\";", 80},
	{"mesh", "kind = \"mesh\"; file = \"ball.obj\"; at_mm = [0.0, 0.0, -40.0];", 80},
	/* A mesh with all its normals reversed: tissue around a cavity. */
	{"cavity", "kind = \"mesh\"; file = \"cavity.obj\";", 50},
	/* Of 5000 triangles. */
	{"large mesh", "kind = \"mesh\"; file = \"large.obj\";", 80},
};
#define GROUNDS (sizeof(grounds) / sizeof(*grounds))

struct ground_folder {
	char dir[40];
};

static inline FILE *ground_open(const struct ground_folder *folder, const char *name)
{
	char path[80];
	FILE *out;

	snprintf(path, sizeof(path), "%s/%s", folder->dir, name);
	out = fopen(path, "w");
	if (!out)
		abort();
	return out;
}

/* A ball of 2 slices (stacks - 1) triangles; turned inside out with a radius below 0. */
static inline void ground_write_ball(const struct ground_folder *folder, const char *name,
				     double radius_mm, int slices, int stacks)
{
	FILE *out = ground_open(folder, name);
	int last = 2 + slices * (stacks - 1);

	fprintf(out, "v 0 0 %.17g\n", radius_mm);
	for (int i = 1; i < stacks; i++)
		for (int k = 0; k < slices; k++)
			fprintf(out, "v %.17g %.17g %.17g\n",
				fabs(radius_mm) * sin(M_PI * i / stacks) *
					cos(2 * M_PI * k / slices),
				fabs(radius_mm) * sin(M_PI * i / stacks) *
					sin(2 * M_PI * k / slices),
				radius_mm * cos(M_PI * i / stacks));
	fprintf(out, "v 0 0 %.17g\n", -radius_mm);
	for (int k = 0; k < slices; k++) {
		int next = (k + 1) % slices, bottom = 2 + slices * (stacks - 2);

		fprintf(out, "f 1 %d %d\n", 2 + k, 2 + next);
		for (int i = 0; i + 2 < stacks; i++)
			fprintf(out, "f %d %d %d %d\n", 2 + slices * i + k,
				2 + slices * (i + 1) + k, 2 + slices * (i + 1) + next,
				2 + slices * i + next);
		fprintf(out, "f %d %d %d\n", last, bottom + next, bottom + k);
	}
	fclose(out);
}

static inline void ground_write_waves(const struct ground_folder *folder)
{
	FILE *out = ground_open(folder, "waves.asc");

	fprintf(out, "ncols 25\nnrows 25\nxllcenter -60\nyllcenter -60\ncellsize 5\n");
	for (int j = 0; j < 25; j++)
		for (int i = 0; i < 25; i++)
			fprintf(out, "%.17g%c",
				2 * cos(0.5 * (i - 12)) * cos(0.5 * (j - 12)),
				i < 24 ? ' ' : '\n');
	fclose(out);
}

static inline void ground_folder_make(struct ground_folder *folder)
{
	char path[80];

	strcpy(folder->dir, "/tmp/incise-ground-XXXXXX");
	if (!mkdtemp(folder->dir))
		abort();
	snprintf(path, sizeof(path), "%s/m.fis", folder->dir);
	felt_write_model(path);
	ground_write_waves(folder);
	ground_write_ball(folder, "ball.obj", 40, 16, 9);
	ground_write_ball(folder, "cavity.obj", -60, 16, 9);
	ground_write_ball(folder, "large.obj", 40, 50, 51);
}

static inline void ground_folder_remove(const struct ground_folder *folder)
{
	static const char *const names[] = {"m.fis",	  "waves.asc", "ball.obj",
					    "cavity.obj", "large.obj", "x.scene"};
	char path[80];

	for (size_t i = 0; i < sizeof(names) / sizeof(*names); i++) {
		snprintf(path, sizeof(path), "%s/%s", folder->dir, names[i]);
		unlink(path);
	}
	rmdir(folder->dir);
}

static inline struct incise_scene *ground_scene(const struct ground_folder *folder,
						const struct ground *ground,
						const char *arithmetic, bool model)
{
	FILE *out = ground_open(folder, "x.scene");
	struct incise_error err = {0};
	struct incise_scene *scene;
	char path[80];

	fprintf(out,
		"arithmetic = \"%s\";\n"
		"surface = { %s };\n"
		"%s\n"
		"tissue = { %s plane_N_mm = 0.3; damping_N_s_mm = 0.001;\n"
		"  insertion_N_mm = 0.5; spread_N_mm = 0.4; leave_mm = %.17g; };\n"
		"effects = { average_ticks = 8; guard = true; };\n"
		"tool = { handle_mm = %.17g; };\n"
		"device = { damping_N_s_mm = 0.03; };\n"
		"limits = { force_N = %.17g; slew_N_s = %.17g; pose_age_ms = 50.0;\n"
		"  ramp_ms = 50.0; fade_ms = 20.0; };\n",
		arithmetic, ground->surface, model ? "model = \"m.fis\";" : "",
		model ? "" : "reaction_N_mm = 0.25;", GROUND_LEAVE_MM, GROUND_HANDLE_MM,
		GROUND_FORCE_N, GROUND_SLEW_N * 1000);
	fclose(out);
	snprintf(path, sizeof(path), "%s/x.scene", folder->dir);
	scene = incise_scene_load(path, NULL, &err);
	if (!scene) {
		fprintf(stderr, "%s: %s\n", ground->name, err.text);
		abort();
	}
	return scene;
}

static inline struct incise_plan *ground_plan(const struct incise_scene *scene)
{
	struct incise_error err = {0};
	struct incise_plan *plan = incise_plan_new(scene, NULL, &err);

	if (!plan) {
		fprintf(stderr, "%s\n", err.text);
		abort();
	}
	return plan;
}

#endif
