/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Scenes with every effect on, on each kind of ground; their files are in memory. Plans have no
 * rig: poses are fed.
 *
 *        away    ○ away_mm along the normal: in free air
 *                ┆
 *      ──────────●────────── top of the surface, incise_plan_top()
 */
#ifndef INCISE_TEST_GROUND_H
#define INCISE_TEST_GROUND_H

#include <stdbool.h>
#include <stdio.h>
#include <incise/plan.h>
#include <incise/scene.h>

/* Limits of every such scene. LEAVE_MM is exact in binary. */
#define GROUND_FORCE_N 2.0
#define GROUND_SLEW_N 0.4 /* in a tick, as 400 N/s */
#define GROUND_AGE_NS 50000000
#define GROUND_LEAVE_MM 0.25
#define GROUND_HANDLE_MM 120.0

struct ground {
	const char *name, *surface; /* as the scene has it; %s: its file */
	double away_mm;
	void (*write)(FILE *out); /* its file, or NULL */
	const char *membrane;	  /* its point and normal */
};

#define GROUNDS 8
extern const struct ground grounds[GROUNDS];

/* By name. */
const struct ground *ground_of(const char *name);

/* Both fail the program when that cannot be. @fixed: in integers. @model: by a model. */
struct incise_scene *ground_scene(const struct ground *ground, bool fixed, bool model);
struct incise_plan *ground_plan(const struct incise_scene *scene);

/* A small model of the force, about 0.1 N/mm, as a .fis file. */
void ground_write_model(FILE *out);

#endif
