// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The line of a wound; see wound_line.h.
 */
#include <math.h>
#include "wound_line.h"

/* As thin it is at its very end. */
#define TAPER_LEAST 0.12f

struct wound_point *line_point(const struct wound *wound, uint64_t number)
{
	return &wound->points[number % WOUND_POINTS];
}

/* 0 … 1 over the end of a cut. */
static float taper(float from_end_mm)
{
	return fminf(fmaxf(from_end_mm / LINE_TAPER_MM, TAPER_LEAST), 1);
}

/* How a point is to be drawn when the cut ends at this arc. */
static struct field_end line_end(const struct wound_point *p, float end_mm)
{
	float thin = p->settled ? 1 : taper(fminf(p->arc_mm, end_mm - p->arc_mm));

	return (struct field_end){
		.px = {p->px[0], p->px[1]},
		.half_mm = p->half_mm * thin + fmaxf(p->open_mm, p->wider_mm),
		.depth_mm = p->depth_mm * sqrtf(thin),
	};
}

void line_mark(struct wound *wound, const struct field_stretch *s)
{
	int right = (s->to_px[0] - 1) / CANVAS_TILE,
	    bottom = (s->to_px[1] - 1) / CANVAS_TILE;

	for (int y = s->from_px[1] / CANVAS_TILE; y <= bottom; y++)
		for (int x = s->from_px[0] / CANVAS_TILE; x <= right; x++) {
			uint8_t *dirty = &wound->dirty[y * wound->tiles + x];

			wound->n_dirty += !*dirty;
			*dirty = 1;
		}
}

void line_raise(struct wound *wound, const struct field_stretch *s)
{
	int right = (s->to_px[0] - 1) / CANVAS_TILE,
	    bottom = (s->to_px[1] - 1) / CANVAS_TILE;

	for (int y = s->from_px[1] / CANVAS_TILE; y <= bottom; y++)
		for (int x = s->from_px[0] / CANVAS_TILE; x <= right; x++)
			field_raise(wound->field +
					    ((size_t)y * wound->tiles + x) * FIELD_TEXELS,
				    x * CANVAS_TILE, y * CANVAS_TILE, s);
}

/* The stretch that ends at a point, drawn so. */
bool line_stretch(const struct wound *wound, const struct wound_point *before,
		  const struct wound_point *p, float end_mm,
		  struct field_stretch *stretch)
{
	struct field_end b = line_end(p, end_mm), a = b;

	if (p->joined && before)
		a = line_end(before, end_mm);
	return field_prepare(stretch, &a, &b, &p->metric, wound->size);
}

const struct wound_point *line_before(const struct wound *wound, uint64_t number)
{
	return number > wound->first ? line_point(wound, number - 1) : NULL;
}

/* Points are final up to where the blade cannot thin them any more. */
void line_settle(struct wound *wound, float end_mm, float until_mm)
{
	while (wound->settled < wound->end) {
		uint64_t number = wound->settled;
		struct wound_point *p = line_point(wound, number);
		struct field_stretch stretch;
		struct field_end final;

		if (p->arc_mm > until_mm)
			break;
		final = line_end(p, end_mm);
		p->half_mm = final.half_mm - fmaxf(p->open_mm, p->wider_mm);
		p->depth_mm = final.depth_mm;
		p->settled = true;
		wound->settled++;
		if (line_stretch(wound, line_before(wound, number), p, end_mm,
				 &stretch)) {
			line_raise(wound, &stretch);
			line_mark(wound, &stretch);
		}
	}
}

bool line_open(const struct wound_point *p)
{
	return p->open_mm > p->wider_mm;
}
