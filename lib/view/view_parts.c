// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The parts of a view are made here, in the order in which they need each other.
 */
#include <errno.h>
#include <stdlib.h>
#include "skin.h"
#include "view_parts.h"

static int make_context(struct incise_view *view, const struct incise_view_setup *setup,
			struct incise_error *err)
{
	if (setup->window)
		view->window =
			incise_window_new(setup->title, setup->width, setup->height, err);
	else
		view->egl = incise_egl_new(err);
	return view->window || view->egl ? 0 : -errno;
}

/* What is painted before anything is drawn. @normals: to be freed by the caller. */
static int make_texture(struct incise_view *view, uint8_t **normals,
			struct incise_error *err)
{
	size_t texels;
	int rc;

	view->chart = incise_chart_new(view->surface, &view->picture, err);
	if (!view->chart)
		return -errno;
	texels = (size_t)view->chart->size * view->chart->size;
	view->base = malloc(texels * 4);
	*normals = malloc(texels * 3);
	if (!view->base || !*normals)
		return incise_error_set(err, ENOMEM,
					"picture: no memory for %d² texels: make "
					"picture.texture_px of the scene smaller",
					view->chart->size);
	rc = incise_skin_paint(view->chart, view->picture.skin,
			       (uint64_t)view->picture.seed, view->base, *normals);
	if (rc)
		return incise_error_set(err, -rc, "picture: no memory for the skin");
	view->canvas = incise_canvas_new(view->chart->size, view->base, err);
	if (!view->canvas)
		return -errno;
	view->effects =
		incise_effects_new(&view->picture, view->chart, view->canvas, err);
	return view->effects ? 0 : -errno;
}

static int make_draw(struct incise_view *view, const uint8_t *normals, int samples,
		     struct incise_error *err)
{
	struct incise_upload uploads[VIEW_UPLOADS];
	struct incise_draw_setup setup = {
		.chart = view->chart,
		.canvas = view->canvas,
		.normal_rgb = view->picture.skin == INCISE_SKIN_PLAIN ? NULL : normals,
		.look = view->picture.skin,
		.scalpel = view->scalpel,
		.samples = samples,
	};

	/* All of it is sent at first, so what is dirty need not be. */
	while (incise_canvas_compose(view->canvas, uploads, VIEW_UPLOADS) > 0)
		;
	view->draw = incise_draw_new(&setup, err);
	return view->draw ? 0 : -errno;
}

static void look_home(struct incise_view *view, const struct incise_plan *plan)
{
	struct incise_touch top;
	double middle[2] = {view->chart->size / 2.0, view->chart->size / 2.0};
	double right[3], down[3], target[3], centre[3], reach;

	incise_plan_top(plan, &top);
	incise_chart_metric(view->chart, middle, right, down);
	incise_draw_bounds(view->draw, centre, &reach);
	/* Between what is cut and the middle of all that is seen. */
	for (int i = 0; i < 3; i++)
		target[i] = 0.75 * top.point_mm[i] + 0.25 * centre[i];
	incise_orbit_home(&view->orbit, target, right, reach);
}

int incise_view_make(struct incise_view *view, const struct incise_plan *plan,
		     const struct incise_view_setup *setup, struct incise_error *err)
{
	uint8_t *normals = NULL;
	int rc = make_context(view, setup, err);

	if (!rc)
		rc = make_texture(view, &normals, err);
	if (!rc)
		rc = make_draw(view, normals, setup->samples, err);
	free(normals);
	if (rc)
		return rc;
	view->overlay = incise_overlay_new(err);
	if (!view->overlay || incise_view_keys(view, NULL, 0))
		return -ENOMEM;
	look_home(view, plan);
	return 0;
}
