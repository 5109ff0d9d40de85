// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The map between a scene's surface and its texture: what all kinds share.
 */
#include <errno.h>
#include <stdlib.h>
#include "../base/vector.h"
#include "../surface/surface.h"
#include "chart_kind.h"
#include "larynx.h"

/* Which kind suits the surface; its numbers and its triangles. */
static int init(struct incise_chart *chart)
{
	const struct incise_surface *surface = chart->surface;

	if (surface->kind == INCISE_SURFACE_MESH && surface->mesh->uv) {
		int rc = chart_atlas_init(chart);

		/* Texture coordinates that cover nothing are none. */
		if (rc)
			return rc;
		if (chart->kind == CHART_ATLAS)
			return chart_atlas_mesh(chart);
	}
	if (surface->kind != INCISE_SURFACE_CAPSULE || !chart_unrolled_init(chart))
		chart_above_init(chart);
	return chart_grid_init(chart);
}

struct incise_chart *incise_chart_new(const struct incise_surface *surface,
				      const struct incise_scene_picture *picture,
				      struct incise_error *err)
{
	int size = picture->texture_px, rc;
	struct incise_chart *chart;

	if (size < 16 || size > 16384 || (size & (size - 1))) {
		incise_error_set(err, EINVAL,
				 "a texture of %d texels: expected 256, 512 … 4096",
				 size);
		return NULL;
	}
	chart = calloc(1, sizeof(*chart));
	if (chart) {
		chart->surface = surface;
		chart->size = size;
		chart->larynx = picture->larynx;
		rc = init(chart);
		if (!rc)
			return chart;
		incise_chart_free(chart);
	}
	incise_error_set(err, ENOMEM, "no memory for the picture's surface");
	return NULL;
}

void incise_chart_free(struct incise_chart *chart)
{
	if (!chart)
		return;
	chart_atlas_free(chart->atlas);
	free(chart->vertices);
	free(chart->indices);
	free(chart);
}

static bool on_texture(const struct incise_chart *chart, const double px[2])
{
	return px[0] >= 0 && px[0] <= chart->size && px[1] >= 0 && px[1] <= chart->size;
}

bool incise_chart_px(const struct incise_chart *chart, const double point_mm[3],
		     double px[2])
{
	/* Farther away no surface lies, and squares would overflow. */
	for (int i = 0; i < 3; i++)
		if (!(fabs(point_mm[i]) <= 1e9))
			return false;
	switch (chart->kind) {
	case CHART_ATLAS:
		return chart_atlas_px(chart, point_mm, px);
	case CHART_UNROLLED:
		return chart_unrolled_px(chart, point_mm, px);
	default:
		return chart_above_px(chart, point_mm, px);
	}
}

bool incise_chart_point(const struct incise_chart *chart, const double px[2],
			double point_mm[3], double normal[3])
{
	if (!on_texture(chart, px))
		return false;
	switch (chart->kind) {
	case CHART_ATLAS:
		return chart_atlas_point(chart, px, point_mm, normal);
	case CHART_UNROLLED:
		chart_unrolled_point(chart, px, point_mm, normal);
		return true;
	default:
		return chart_above_point(chart, px, point_mm, normal);
	}
}

void incise_chart_metric(const struct incise_chart *chart, const double px[2],
			 double right_mm[3], double down_mm[3])
{
	double at[2];

	/* fmax() takes what is not a number for 0. */
	for (int i = 0; i < 2; i++)
		at[i] = fmin(fmax(px[i], 0), chart->size);
	if (chart->kind == CHART_UNROLLED) {
		chart_unrolled_metric(chart, at, right_mm, down_mm);
		return;
	}
	if (chart->kind == CHART_ATLAS ? chart_atlas_metric(chart, at, right_mm, down_mm)
				       : chart_above_metric(chart, at, right_mm, down_mm))
		return;
	for (int i = 0; i < 3; i++) {
		right_mm[i] = chart->wide_mm / chart->size * chart->right[i];
		down_mm[i] = chart->high_mm / chart->size * chart->down[i];
	}
}

double incise_chart_relief_mm(const struct incise_chart *chart, const double px[2])
{
	if (!chart->larynx || chart->kind == CHART_ATLAS || !on_texture(chart, px) ||
	    !(chart->wide_mm >= LARYNX_SIDE_MM && chart->high_mm >= LARYNX_SIDE_MM))
		return 0;
	return larynx_height_mm(
		(px[0] / chart->size - 0.5) * chart->wide_mm - chart->top_mm[0],
		(px[1] / chart->size - 0.5) * chart->high_mm - chart->top_mm[1]);
}
