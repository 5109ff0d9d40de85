// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The image of a scene; see incise/view.h.
 *
 *     uv map ─┬─▶ skin ─▶ canvas ─▶ draw ─▶ window, pixels
 *             └─▶ injury ──▲         ▲
 *     ticks ───────╯  ╰──────────▶ overlay
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <incise/incision.h>
#include <incise/view.h>
#include "../base/monotonic.h"
#include "../base/vector.h"
#include "canvas.h"
#include "draw.h"
#include "egl.h"
#include "injury.h"
#include "overlay.h"
#include "skin.h"
#include "uv_map.h"
#include "view_camera.h"
#include "window.h"

#define FAR_MM 1e6 /* no tool is farther away */
#define MARGIN_PX 14
#define PANEL_LEAST_PX (800 * 450) /* smaller images have no panel */

enum { SLOT_PANEL, SLOT_KEYS };

#define VIEW_UPLOADS 256 /* per call */

/*
 * Texels of a live frame: more take so long to compose and send that frames would come late. The rest
 * follows with the next frames.
 */
#define LIVE_TEXELS (64 * CANVAS_TILE * CANVAS_TILE)

struct incise_view {
	const struct incise_surface *surface;
	struct incise_scene_picture picture;
	struct incise_scene_scalpel scalpel;
	struct incise_egl *egl; /* one of these */
	struct incise_window *window;
	uint8_t *base; /* the canvas's, size² texels */
	struct uv_map *map;
	struct incise_canvas *canvas;
	struct incise_incision *incision; /* or NULL */
	struct incise_injury *injury;
	struct incise_draw *draw;
	struct incise_overlay *overlay;
	struct view_orbit orbit;
	struct incise_tick tick; /* the last one with a valid place */
	bool ticked, drawn, panel, keys, live;
	int width, height;		  /* of frames */
	struct incise_view_report report; /* counts and times */
};

static double seconds(void)
{
	return (double)incise_monotonic_ns() * 1e-9;
}

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

/* The painting before the first frame. @normals: to be freed by the caller. */
static int make_texture(struct incise_view *view, uint8_t **normals,
			struct incise_error *err)
{
	size_t texels;
	int rc;

	view->map = uv_map_new(view->surface, &view->picture, err);
	if (!view->map)
		return -errno;
	texels = (size_t)view->map->size * view->map->size;
	view->base = malloc(texels * 4);
	*normals = malloc(texels * 3);
	if (!view->base || !*normals)
		return incise_error_set(err, ENOMEM,
					"image: no memory for %d² texels; reduce "
					"picture.texture_px of the scene",
					view->map->size);
	rc = incise_skin_paint(view->map, view->picture.skin,
			       (uint64_t)view->picture.seed, view->base, *normals);
	if (rc)
		return incise_error_set(err, -rc, "image: no memory for the skin");
	view->canvas = incise_canvas_new(view->map->size, view->base, err);
	if (!view->canvas)
		return -errno;
	view->injury = incise_injury_new(&view->picture, &view->scalpel, view->incision,
					 view->map, view->canvas, err);
	return view->injury ? 0 : -errno;
}

static int make_draw(struct incise_view *view, const uint8_t *normals, int samples,
		     struct incise_error *err)
{
	struct incise_upload uploads[VIEW_UPLOADS];
	struct incise_draw_setup setup = {
		.map = view->map,
		.canvas = view->canvas,
		.normal_rgb = view->picture.skin == INCISE_SKIN_PLAIN ? NULL : normals,
		.look = view->picture.skin,
		.scalpel = view->scalpel,
		.samples = samples,
	};

	/* incise_draw_new() sends all of it, so no tile need be dirty. */
	while (incise_canvas_compose(view->canvas, uploads, VIEW_UPLOADS, 0) > 0)
		;
	view->draw = incise_draw_new(&setup, err);
	return view->draw ? 0 : -errno;
}

static void look_home(struct incise_view *view, const struct incise_plan *plan)
{
	struct incise_touch top;
	double middle[2] = {view->map->size / 2.0, view->map->size / 2.0};
	double right[3], down[3], target[3];
	const struct incise_draw_info *info = incise_draw_info(view->draw);

	incise_plan_top(plan, &top);
	uv_map_metric(view->map, middle, right, down);
	/* Between the surface's top and the middle of the drawn surface. */
	for (int i = 0; i < 3; i++)
		target[i] = 0.75 * top.point_mm[i] + 0.25 * info->middle_mm[i];
	view_orbit_home(&view->orbit, target, right, info->reach_mm);
}

/* Parts that were made stay when it fails: incise_view_free(). */
static int make_parts(struct incise_view *view, const struct incise_plan *plan,
		      const struct incise_view_setup *setup, struct incise_error *err)
{
	uint8_t *normals = NULL;
	int rc = make_context(view, setup, err);

	view->live = setup->live;

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

struct incise_view *incise_view_new(const struct incise_scene *scene,
				    const struct incise_plan *plan,
				    const struct incise_view_setup *setup,
				    struct incise_error *err)
{
	struct incise_view *view;
	int rc;

	if (setup->width < 16 || setup->height < 16 ||
	    setup->width > INCISE_VIEW_SIDE_MAX || setup->height > INCISE_VIEW_SIDE_MAX)
		return INCISE_ERROR_NULL(err, EINVAL,
					 "image: %d × %d pixels; expected 16 to %d each",
					 setup->width, setup->height,
					 INCISE_VIEW_SIDE_MAX);
	view = calloc(1, sizeof(*view));
	if (!view)
		return INCISE_ERROR_NULL(err, ENOMEM, "image: no memory");
	view->surface = incise_plan_surface(plan);
	incise_scene_picture(scene, &view->picture);
	incise_scene_scalpel(scene, &view->scalpel);
	view->width = setup->width;
	view->height = setup->height;
	view->panel = true;
	if (view->picture.wound)
		view->incision = incise_incision_new(scene, err);
	rc = view->picture.wound && !view->incision ? -ENOMEM
						    : make_parts(view, plan, setup, err);
	if (rc) {
		incise_view_free(view);
		errno = -rc;
		return NULL;
	}
	return view;
}

static int current(struct incise_view *view, struct incise_error *err)
{
	return view->window ? incise_window_current(view->window, err)
			    : incise_egl_current(view->egl, err);
}

void incise_view_free(struct incise_view *view)
{
	if (!view)
		return;
	if (view->draw && !current(view, NULL))
		incise_draw_free(view->draw);
	incise_overlay_free(view->overlay);
	incise_injury_free(view->injury);
	incise_incision_free(view->incision);
	incise_canvas_free(view->canvas);
	uv_map_free(view->map);
	free(view->base);
	incise_window_free(view->window);
	incise_egl_free(view->egl);
	free(view);
}

static bool near(const double p[3])
{
	return fabs(p[0]) <= FAR_MM && fabs(p[1]) <= FAR_MM && fabs(p[2]) <= FAR_MM;
}

void incise_view_ticks(struct incise_view *view, const struct incise_tick *ticks, int n)
{
	double begin = seconds();

	for (int i = 0; i < n; i++) {
		const struct incise_tick *tick = &ticks[i];

		incise_overlay_tick(view->overlay, tick);
		if (!near(tick->position_mm) || !near(tick->tool_mm) ||
		    !near(tick->proxy_mm) || !near(tick->normal))
			continue;
		incise_injury_tick(view->injury, tick);
		view->tick = *tick;
		view->ticked = true;
	}
	view->report.ticks += n > 0 ? (uint64_t)n : 0;
	view->report.ticks_s += seconds() - begin;
}

/* The instrument rises with the relief, or it would be in the skin before it touches it. */
static void lift(const struct incise_view *view, struct incise_tick *tick)
{
	double normal[3] = {0};
	double mm = uv_map_relief_at_mm(view->map, tick->tool_mm, normal);

	v3_add(tick->position_mm, tick->position_mm, mm, normal);
	v3_add(tick->tool_mm, tick->tool_mm, mm, normal);
	v3_add(tick->proxy_mm, tick->proxy_mm, mm, normal);
}

static void send(struct incise_view *view)
{
	struct incise_upload uploads[VIEW_UPLOADS];
	int n, left = view->live ? LIVE_TEXELS : 0;

	incise_injury_paint(view->injury);
	while ((n = incise_canvas_compose(view->canvas, uploads, VIEW_UPLOADS, left)) >
	       0) {
		incise_draw_upload(view->draw, view->canvas, uploads, n);
		view->report.uploads += (uint64_t)n;
		for (int i = 0; i < n; i++) {
			int texels = uploads[i].rect.w * uploads[i].rect.h;

			view->report.uploaded_texels += (uint64_t)texels;
			left -= uploads[i].level ? 0 : texels;
		}
		if (view->live && left <= 0)
			break;
	}
}

static void lay_over(struct incise_view *view, const struct incise_view_status *status)
{
	const struct incise_overlay_image *image;

	/* In a small image the panel would hide too much. */
	if (view->panel && view->width * view->height >= PANEL_LEAST_PX &&
	    (image = incise_overlay_panel(view->overlay, status)))
		incise_draw_overlay(view->draw, SLOT_PANEL, image->pixels, image->width,
				    image->height, image->version, MARGIN_PX,
				    view->height - MARGIN_PX - image->height);
	if (view->keys && (image = incise_overlay_keys(view->overlay)))
		incise_draw_overlay(view->draw, SLOT_KEYS, image->pixels, image->width,
				    image->height, image->version,
				    view->width - MARGIN_PX - image->width, MARGIN_PX);
}

int incise_view_frame(struct incise_view *view, const struct incise_view_status *status,
		      struct incise_error *err)
{
	struct incise_tick pose = view->tick;
	int rc, width = view->width, height = view->height;
	double begin, sent;

	if (view->window)
		incise_window_size(view->window, &width, &height);
	if (width < 1 || height < 1)
		return 0;
	rc = current(view, err);
	if (rc)
		return rc;
	view->width = width;
	view->height = height;
	begin = seconds();
	send(view);
	sent = seconds();
	if (view->ticked)
		lift(view, &pose);
	rc = incise_draw_frame(view->draw, &view->orbit.camera,
			       view->ticked ? &pose : NULL, width, height, err);
	if (rc)
		return rc;
	lay_over(view, status);
	view->drawn = true;
	if (view->window) {
		incise_draw_show(view->draw);
		incise_window_show(view->window);
	} else {
		incise_draw_finish(view->draw);
	}
	view->report.texture_s += sent - begin;
	view->report.draw_s += seconds() - sent;
	view->report.frames++;
	return 0;
}

void incise_view_size(const struct incise_view *view, int *width, int *height)
{
	*width = view->width;
	*height = view->height;
}

int incise_view_pixels(struct incise_view *view, uint8_t *rgb)
{
	int rc;

	if (!view->drawn)
		return -ENODATA;
	rc = current(view, NULL);
	return rc ? rc : incise_draw_read(view->draw, rgb, view->width, view->height);
}

void incise_view_panel(struct incise_view *view, bool panel, bool keys)
{
	view->panel = panel;
	view->keys = keys;
}

int incise_view_keys(struct incise_view *view, const char *const *lines, int n)
{
	static const char *const own[] = {
		"right button\trotate the camera (or arrows)",
		"middle button\tmove the camera",
		"wheel\tnearer, farther (or page up, down)",
		"Home\treset the camera",
		"F1, h\tthis help",
		"g\tgraphs",
	};
	enum { OWN = sizeof(own) / sizeof(own[0]), MOST = 24 };
	const char *all[MOST];
	int count = 0;

	for (int i = 0; i < n && count < MOST - OWN; i++)
		all[count++] = lines[i];
	for (int i = 0; i < OWN; i++)
		all[count++] = own[i];
	return incise_overlay_set_keys(view->overlay, all, count);
}

void incise_view_camera(const struct incise_view *view, struct incise_view_camera *camera)
{
	*camera = view->orbit.camera;
}

void incise_view_set_camera(struct incise_view *view,
			    const struct incise_view_camera *camera)
{
	struct incise_view_camera held = *camera;

	if (view_camera_limit(&held))
		view->orbit.camera = held;
}

static void read_ray(const struct incise_view *view, double x_px, double y_px,
		     struct incise_view_ray *ray)
{
	const struct incise_view_camera *camera = &view->orbit.camera;
	struct view_projection projection;

	view_camera_project(camera, view->width, view->height, 1, &projection);
	v3_copy(ray->from_mm, projection.position_mm);
	view_camera_ray(&projection, view->width, view->height, x_px, y_px, ray->way);
	ray->met = uv_map_meet(view->map, ray->from_mm, ray->way,
			       2 * camera->distance_mm + 1e4, ray->point_mm, ray->normal);
}

int incise_view_event(struct incise_view *view, struct incise_view_event *event)
{
	if (!view->window || !incise_window_event(view->window, event))
		return 0;
	if (event->type == INCISE_VIEW_MOTION || event->type == INCISE_VIEW_BUTTON ||
	    event->type == INCISE_VIEW_WHEEL)
		read_ray(view, event->x_px, event->y_px, &event->ray);
	event->used = view_orbit_event(&view->orbit, event, view->height);
	if (event->type == INCISE_VIEW_KEY && event->pressed && !event->repeat) {
		bool help = event->key == INCISE_VIEW_F1 || event->key == 'h';

		view->keys ^= help;
		view->panel ^= event->key == 'g';
		event->used |= help || event->key == 'g';
	}
	return 1;
}

void incise_view_report(const struct incise_view *view, struct incise_view_report *report)
{
	*report = view->report;
	incise_injury_report(view->injury, report);
	report->triangles = view->map->n_indices / 3;
	report->texture_px = view->map->size;
	report->renderer = incise_draw_info(view->draw)->renderer;
	report->samples = incise_draw_info(view->draw)->samples;
}
