// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A wound's fields, and what is laid over them, as a layer; see wound.h.
 */
#include <math.h>
#include <string.h>
#include "wound_line.h"

/* So many stretches at most are drawn as one, with no turn above this tangent. */
#define TOGETHER 3
#define STRAIGHT 0.1f

/* A tile with what is not in the fields laid over it. */
static void paint_tile(struct wound *wound, const struct field_stretch *over, int n,
		       int tile, uint8_t *rgba)
{
	int x = tile % wound->tiles * CANVAS_TILE, y = tile / wound->tiles * CANVAS_TILE;
	struct field_texel texels[FIELD_TEXELS];

	memcpy(texels, wound->field + (size_t)tile * FIELD_TEXELS, sizeof(texels));
	for (int i = 0; i < n; i++)
		field_raise(texels, x, y, &over[i]);
	field_colour(texels, x, y, wound->texel_mm,
		     rgba + ((size_t)y * wound->size + x) * 4, wound->size * 4);
}

/* Whether the line goes on at a point as it came. */
static bool straight(const struct wound *wound, uint64_t number)
{
	const float *a = line_point(wound, number - 1)->px;
	const float *b = line_point(wound, number)->px;
	const float *c = line_point(wound, number + 1)->px;
	float x = b[0] - a[0], y = b[1] - a[1], u = c[0] - b[0], v = c[1] - b[1];
	float along = x * u + y * v, across = x * v - y * u;

	return along > 0 && fabsf(across) < STRAIGHT * along;
}

/*
 * The last of some stretches that can be drawn as one: where lips are open they are wide,
 * and each would be drawn over much of the one before.
 */
static uint64_t together(const struct wound *wound, uint64_t from)
{
	uint64_t to = from;

	if (from == wound->first)
		return to;
	while (to + 1 < wound->settled && to - from + 1 < TOGETHER &&
	       line_point(wound, to + 1)->joined && line_open(line_point(wound, to)) &&
	       line_open(line_point(wound, to + 1)) && straight(wound, to))
		to++;
	return to;
}

/* Stretches that move, and those behind the blade. */
static int laid_over(const struct wound *wound, struct field_stretch *over)
{
	int n = 0;

	for (uint64_t i = wound->moving ? wound->first : wound->settled; i < wound->end;
	     i++) {
		const struct wound_point *p = line_point(wound, i);
		const struct wound_point *last = line_before(wound, i);

		if (i < wound->settled) {
			if (!line_open(p) && !(p->joined && last && line_open(last)))
				continue;
			if (p->joined)
				i = together(wound, i);
			p = line_point(wound, i);
		}
		n += line_stretch(wound, last, p, wound->tip.arc_mm, &over[n]);
	}
	if (wound->cutting)
		n += line_stretch(wound, line_before(wound, wound->end), &wound->tip,
				  wound->tip.arc_mm, &over[n]);
	return n;
}

void wound_paint(struct wound *wound, struct incise_canvas *canvas, int layer)
{
	uint8_t *rgba = incise_canvas_layer(canvas, layer);
	int n;

	if (!wound->n_dirty || !rgba)
		return;
	n = laid_over(wound, wound->over);
	for (int tile = 0; wound->n_dirty; tile++) {
		if (!wound->dirty[tile])
			continue;
		wound->dirty[tile] = 0;
		wound->n_dirty--;
		paint_tile(wound, wound->over, n, tile, rgba);
		incise_canvas_dirty(
			canvas, (struct incise_rect){tile % wound->tiles * CANVAS_TILE,
						     tile / wound->tiles * CANVAS_TILE,
						     CANVAS_TILE, CANVAS_TILE});
	}
}
