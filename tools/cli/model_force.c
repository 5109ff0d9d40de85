// SPDX-License-Identifier: GPL-2.0-or-later
/* The force of a scene's model; see model_force.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "cli.h"
#include "json.h"
#include "model_force.h"

/* Depth and speed in the order of the model's inputs; false: it has others. */
static bool inputs(const struct incise_model *model, const struct model_force *at,
		   double *x)
{
	const struct incise_model_info *info = incise_model_info(model);

	for (int i = 0; i < info->n_inputs; i++)
		if (!strcmp(info->input[i].name, "depth_mm"))
			x[i] = at->depth_mm;
		else if (!strcmp(info->input[i].name, "velocity_mm_s"))
			x[i] = at->velocity_mm_s;
		else
			return false;
	return true;
}

static bool find_model_force(const char *path, struct model_force *force)
{
	struct incise_model *model = incise_model_load(path, NULL);
	char *sd = cli_text("%s.sd", path);
	struct incise_uncertainty *uncertainty =
		model ? incise_uncertainty_load(sd, model, NULL) : NULL;
	double x[INCISE_MODEL_INPUTS_MAX];
	bool found = uncertainty && inputs(model, force, x);

	if (found) {
		force->force_N = incise_model_eval(model, x, NULL);
		incise_uncertainty_parts(uncertainty, model, x, &force->u);
	}
	incise_uncertainty_free(uncertainty);
	incise_model_free(model);
	free(sd);
	return found;
}

bool model_force_at(const struct incise_scene *scene, double depth_mm,
		    double velocity_mm_s, struct model_force *force)
{
	const char *path;

	*force = (struct model_force){.depth_mm = depth_mm,
				      .velocity_mm_s = velocity_mm_s};
	for (int i = 0; (path = incise_scene_file(scene, i)); i++)
		if (cli_ends_with(path, ".fis"))
			return find_model_force(path, force);
	return false;
}

void model_force_print(FILE *out, const struct model_force *force)
{
	const struct incise_uncertainty_parts *u = &force->u;

	fprintf(out,
		"%.3f N at %.1f mm and %.3g mm/s, u = %.2g N of a new cut (data %.2g, model "
		"%.2g, calibration %.2g)",
		force->force_N, force->depth_mm, force->velocity_mm_s, u->total, u->data,
		u->model, hypot(u->calibration, u->rig));
	if (!isnan(u->mean))
		fprintf(out, ", %.2g N of the mean of all cuts", u->mean);
	fputc('\n', out);
}

json_t *model_force_json(const struct model_force *force)
{
	if (!force)
		return json_null();
	return json_pack("{sf sf sf sf sf sf sf so}", "depth_mm", force->depth_mm,
			 "velocity_mm_s", force->velocity_mm_s, "force_N", force->force_N,
			 "sd_N", force->u.total, "sd_data_N", force->u.data, "sd_model_N",
			 force->u.model, "sd_calibration_N",
			 hypot(force->u.calibration, force->u.rig), "sd_mean_N",
			 json_number(force->u.mean));
}
