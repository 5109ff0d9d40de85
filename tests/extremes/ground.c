// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Scenes on each kind of ground; see ground.h.
 */
#include <math.h>
#include <string.h>
#include "all_forces.h"
#include "../../tools/cli/cli.h"
#include "../../lib/scene/scene.h"
#include "../../tools/cli/file.h"
#include "ground.h"

void ground_write_model(FILE *out)
{
	fputs("[System]\nName='extremes'\nType='sugeno'\nVersion=2.0\nNumInputs=2\n"
	      "NumOutputs=1\nNumRules=4\nAndMethod='prod'\nOrMethod='probor'\n"
	      "ImpMethod='prod'\nAggMethod='sum'\nDefuzzMethod='wtaver'\n\n",
	      out);
	fputs("[Input1]\nName='depth_mm'\nRange=[0 20]\nNumMFs=2\n"
	      "MF1='a':'gaussmf',[8.5 0]\nMF2='b':'gaussmf',[8.5 20]\n\n"
	      "[Input2]\nName='velocity_mm_s'\nRange=[0 50]\nNumMFs=2\n"
	      "MF1='a':'gaussmf',[21 0]\nMF2='b':'gaussmf',[21 50]\n\n"
	      "[Output1]\nName='force_N'\nRange=[0 4]\nNumMFs=4\n"
	      "MF1='a':'linear',[0.1 0.001 0]\nMF2='b':'linear',[0.1 0.002 0.02]\n"
	      "MF3='c':'linear',[0.1 0.001 0.04]\nMF4='d':'linear',[0.1 0.001 0]\n\n"
	      "[Rules]\n1 1, 1 (1) : 1\n1 2, 2 (1) : 1\n2 1, 3 (1) : 1\n2 2, 4 (1) : 1\n",
	      out);
}

/* Slices from pole to pole; turned inside out with a radius below 0. */
static void write_ball(FILE *out, double radius_mm, int slices, int stacks)
{
	const int last = 2 + slices * (stacks - 1);

	fprintf(out, "v 0 0 %.17g\n", radius_mm);
	for (int i = 1; i < stacks; i++)
		for (int k = 0; k < slices; k++) {
			double across = fabs(radius_mm) * sin(M_PI * i / stacks);

			fprintf(out, "v %.17g %.17g %.17g\n",
				across * cos(2 * M_PI * k / slices),
				across * sin(2 * M_PI * k / slices),
				radius_mm * cos(M_PI * i / stacks));
		}
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
}

static void write_solid(FILE *out)
{
	write_ball(out, 40, 16, 9);
}

static void write_cavity(FILE *out)
{
	write_ball(out, -60, 16, 9);
}

/* Of 5000 triangles. */
static void write_large(FILE *out)
{
	write_ball(out, 40, 50, 51);
}

static void write_waves(FILE *out)
{
	fputs("ncols 25\nnrows 25\nxllcenter -60\nyllcenter -60\ncellsize 5\n", out);
	for (int j = 0; j < 25; j++)
		for (int i = 0; i < 25; i++)
			fprintf(out, "%.17g%c",
				2 * cos(0.5 * (i - 12)) * cos(0.5 * (j - 12)),
				i < 24 ? ' ' : '\n');
}

const struct ground grounds[GROUNDS] = {
	{"plane", "kind = \"plane\";", 80, NULL,
	 "[0.0, 0.0, -3.0]; normal = [0.0, 0.0, 1.0]"},
	{"turned plane", "kind = \"plane\"; normal = [0.0, 0.0, -1.0];", 80, NULL,
	 "[0.0, 0.0, 3.0]; normal = [0.0, 0.0, -1.0]"},
	{"sphere", "kind = \"sphere\"; centre_mm = [0.0, 0.0, -40.0]; radius_mm = 40.0;",
	 80, NULL, "[0.0, 0.0, -3.0]; normal = [0.0, 0.0, 1.0]"},
	{"capsule",
	 "kind = \"capsule\"; from_mm = [-60.0, 0.0, -55.0]; to_mm = [160.0, 0.0, "
	 "-55.0]; radius_mm = 55.0;",
	 80, NULL, "[0.0, 0.0, -3.0]; normal = [0.0, 0.0, 1.0]"},
	{"heights", "kind = \"heights\"; file = \"%s\";", 80, write_waves,
	 "[0.0, 0.0, -3.0]; normal = [0.0, 0.0, 1.0]"},
	{"mesh", "kind = \"mesh\"; file = \"%s\"; at_mm = [0.0, 0.0, -40.0];", 80,
	 write_solid, "[0.0, 0.0, -3.0]; normal = [0.0, 0.0, 1.0]"},
	/* A mesh with all its normals reversed: tissue around a cavity. */
	{"cavity", "kind = \"mesh\"; cavity = true; file = \"%s\";", 50, write_cavity,
	 "[0.0, 0.0, -63.0]; normal = [0.0, 0.0, 1.0]"},
	{"large mesh", "kind = \"mesh\"; file = \"%s\";", 80, write_large,
	 "[0.0, 0.0, 37.0]; normal = [0.0, 0.0, 1.0]"},
};

const struct ground *ground_of(const char *name)
{
	for (int i = 0; i < GROUNDS; i++)
		if (!strcmp(grounds[i].name, name))
			return &grounds[i];
	cli_fail("there is no ground '%s'", name);
}

struct incise_scene *ground_scene(const struct ground *ground, bool fixed, bool model)
{
	struct memory_file scene = memory_file_begin("scene"),
			   surface = memory_file_begin("ground"),
			   force = memory_file_begin("model");
	struct incise_error err = {0};
	char tissue[1000], more[100];
	struct incise_scene *made;

	snprintf(more, sizeof(more), "leave_mm = %.17g;%s", GROUND_LEAVE_MM,
		 model ? " unloading_N_mm = 1.0;" : "");
	if (ground->write)
		ground->write(surface.file);
	ground_write_model(force.file);
	fprintf(scene.file, "arithmetic = \"%s\";\nsurface = { ",
		fixed ? "fixed" : "double");
	fprintf(scene.file, ground->surface, surface.path);
	if (model)
		fprintf(scene.file, " };\nmodel = \"%s\";\n", force.path);
	else
		fputs(" };\n", scene.file);
	all_forces(tissue, sizeof(tissue), 2, model ? "reaction" : NULL, more);
	fputs(tissue, scene.file);
	fprintf(scene.file,
		"membrane = { point_mm = %s; radius_mm = 20.0; thickness_mm = 4.0;\n"
		"  puncture_N = 0.8; back_wall_mm = 10.0; };\n",
		ground->membrane);
	fprintf(scene.file,
		"effects = { average_ticks = 8; };\n"
		"tool = { handle_mm = %.1f; };\n"
		"device = { damping_N_s_mm = 0.03; delay_ticks = 12; };\n"
		"limits = { force_N = %.1f; slew_N_s = %.1f; pose_age_ms = 50.0;\n"
		"  ramp_ms = 50.0; fade_ms = 20.0; };\n",
		GROUND_HANDLE_MM, GROUND_FORCE_N, GROUND_SLEW_N * 1000);
	memory_file_written(&surface);
	memory_file_written(&force);
	memory_file_written(&scene);
	made = incise_scene_load(scene.path, model ? force.path : NULL, &err);
	if (!made)
		cli_fail_with(&err);
	/* Whether it is stable is not asked here, and the search takes longer than all else; see scene.h. */
	made->unchecked = true;
	fclose(scene.file);
	fclose(surface.file);
	fclose(force.file);
	return made;
}

struct incise_plan *ground_plan(const struct incise_scene *scene)
{
	struct incise_error err = {0};
	struct incise_plan *plan = incise_plan_new(scene, NULL, &err);

	if (!plan)
		cli_fail_with(&err);
	return plan;
}
