/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The force of a scene's model at a depth and a speed, with its standard uncertainty, for reports:
 * of the first model that has MODEL.fis.sd next to it.
 */
#ifndef INCISE_TOOLS_MODEL_FORCE_H
#define INCISE_TOOLS_MODEL_FORCE_H

#include <stdbool.h>
#include <stdio.h>
#include <jansson.h>
#include <incise/scene.h>
#include <incise/uncertainty.h>

struct model_force {
	double depth_mm, velocity_mm_s, force_N;
	struct incise_uncertainty_parts u;
};

/* False: no model of depth and speed with an uncertainty. */
bool model_force_at(const struct incise_scene *scene, double depth_mm,
		    double velocity_mm_s, struct model_force *force);

/* "1.234 N at 12.3 mm and 0 mm/s, u = 0.08 N (data …, model …, calibration …)", and a newline. */
void model_force_print(FILE *out, const struct model_force *force);

/* The same; null for NULL. */
json_t *model_force_json(const struct model_force *force);

#endif
