// SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only
/*
 * Surfaces in integers, and the proxy on them; see shape.h.
 */
#include "shape.h"
#include "vector.h"

/* Looks for the place at which a way enters, within half an LSB of the surface or nearly so. */
#define ENTRY_STEPS 12

bool incise_fixed_shape_good(const struct incise_fixed_shape *shape)
{
	for (int i = 0; i < 3; i++)
		if (shape->point[i] > INCISE_FX_AWAY_MAX / 2 ||
		    shape->point[i] < -INCISE_FX_AWAY_MAX / 2)
			return false;
	if (shape->reserved)
		return false;
	if (shape->kind == INCISE_FIXED_GRID)
		return true;
	if (!incise_fx_is_unit(shape->normal, 3))
		return false;
	if (shape->kind == INCISE_FIXED_PLANE)
		return true;
	return shape->kind == INCISE_FIXED_CAPSULE && shape->length >= 0 &&
	       shape->length <= INCISE_FX_AWAY_MAX / 2 && shape->radius >= 1 &&
	       shape->radius <= INCISE_FX_AWAY_MAX / 2;
}

static void plane_nearest(const struct incise_fixed_shape *plane, const int32_t p[3],
			  struct incise_fixed_touch *touch)
{
	int32_t off[3];

	incise_fx_sub(off, p, plane->point);
	touch->depth = -incise_fx_along(off, plane->normal);
	incise_fx_copy(touch->normal, plane->normal);
	incise_fx_add(touch->point, p, touch->depth, plane->normal);
}

static void capsule_nearest(const struct incise_fixed_shape *capsule, const int32_t p[3],
			    const int32_t last[3], struct incise_fixed_touch *touch)
{
	int32_t off[3], on[3], along, normal[3];
	int64_t out[3];

	incise_fx_sub(off, p, capsule->point);
	along = (int32_t)incise_fx_within(incise_fx_along(off, capsule->normal), 0,
					  capsule->length);
	incise_fx_add(on, capsule->point, along, capsule->normal);
	incise_fx_sub(off, p, on);
	for (int i = 0; i < 3; i++)
		out[i] = off[i];
	incise_fx_copy(normal, last);
	incise_fx_unit(normal, out, 3, 0);
	touch->depth = (int32_t)incise_fx_hold(
		(int64_t)capsule->radius - incise_fx_along(off, normal), INT32_MAX);
	incise_fx_copy(touch->normal, normal);
	incise_fx_add(touch->point, on, capsule->radius, normal);
}

bool incise_fixed_shape_nearest(const struct incise_fixed_shape *shape,
				const struct incise_fixed_grid *grid, const int32_t p[3],
				const int32_t last[3], struct incise_fixed_touch *touch)
{
	struct incise_fixed_spot spot;

	switch (shape->kind) {
	case INCISE_FIXED_PLANE:
		plane_nearest(shape, p, touch);
		return true;
	case INCISE_FIXED_CAPSULE:
		capsule_nearest(shape, p, last, touch);
		return true;
	default:
		if (!incise_fixed_grid_nearest(grid, p, &spot))
			return false;
		incise_fx_copy(touch->point, spot.point);
		incise_fx_copy(touch->normal, spot.normal);
		touch->depth = spot.depth;
		return true;
	}
}

/* The first normal on a capsule's axis. */
static const int32_t up[3] = {0, 0, INCISE_FIXED_UNIT};

/* Where the way from outside to inside enters, by false position. */
static void find_entry(struct incise_fixed_touch *entry,
		       const struct incise_fixed_shape *shape,
		       const struct incise_fixed_grid *grid, const int32_t from[3],
		       const int32_t to[3], const struct incise_fixed_touch *inside)
{
	bool was_outer = false;
	struct incise_fixed_touch at;
	int32_t outer[3], inner[3], p[3];
	int64_t above, below = inside->depth;

	*entry = *inside;
	if (!incise_fixed_shape_nearest(shape, grid, from, inside->normal, &at) ||
	    at.depth >= 0)
		return;
	above = -(int64_t)at.depth;
	incise_fx_copy(outer, from);
	incise_fx_copy(inner, to);
	for (int k = 0; k < ENTRY_STEPS && above + below > 0; k++) {
		/* 2^32 << 30 */
		int64_t share = div64_s64(above << 30, above + below);

		for (int i = 0; i < 3; i++) {
			/* 2^32 · 2^30 */
			int64_t way = (int64_t)inner[i] - outer[i];

			p[i] = (int32_t)(outer[i] + incise_fx_rounded(way * share, 30));
		}
		if (!incise_fixed_shape_nearest(shape, grid, p, inside->normal, &at))
			return;
		*entry = at;
		/* An end that stays counts by half next time, so that both come nearer. */
		if (at.depth < 0) {
			above = -(int64_t)at.depth;
			below = was_outer ? (below + 1) / 2 : below;
			incise_fx_copy(outer, p);
		} else {
			below = at.depth;
			above = k && !was_outer ? (above + 1) / 2 : above;
			incise_fx_copy(inner, p);
		}
		was_outer = at.depth < 0;
		if (at.depth <= 1 && at.depth >= -1)
			break;
	}
	entry->depth = 0;
}

void incise_fixed_proxy_move(struct incise_fixed_proxy *proxy,
			     const struct incise_fixed_shape *shape,
			     const struct incise_fixed_grid *grid, int32_t leave,
			     const int32_t tool[3])
{
	struct incise_fixed_touch touch = proxy->touch;
	bool there = incise_fixed_shape_nearest(
		shape, grid, tool, proxy->touching ? proxy->touch.normal : up, &touch);

	proxy->began = false;
	if (proxy->touching) {
		proxy->touching = there && touch.depth >= -leave;
	} else if (there && touch.depth >= 0) {
		proxy->touching = proxy->began = true;
		proxy->first = touch;
		if (proxy->placed)
			find_entry(&proxy->first, shape, grid, proxy->tool, tool, &touch);
	}
	if (there)
		proxy->touch = touch;
	incise_fx_copy(proxy->tool, tool);
	proxy->placed = true;
}
