/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Scenes with every effect on, on each kind of ground, in integers and in double; with a
 * model and without. Files are in memory.
 */
#ifndef INCISE_EXTREMES_GROUND_H
#define INCISE_EXTREMES_GROUND_H

#include <stdio.h>
#include <incise/scene.h>

#define GROUNDS_MAX 12

struct ground {
	const char *name;
	double away_mm; /* in free air, along the normal at its top */
};

struct grounds {
	struct ground ground[GROUNDS_MAX];
	struct incise_scene *scene[GROUNDS_MAX];
	int n;
};

/* Fails the program when that cannot be. */
void grounds_make(struct grounds *grounds);
void grounds_free(struct grounds *grounds);

/* A small model of the force, about 0.1 N/mm, as a .fis file. */
void ground_write_model(FILE *out);

#endif
