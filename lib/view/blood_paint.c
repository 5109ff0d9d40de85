// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Blood as colour; see blood_paint.h.
 */
#include <math.h>
#include <string.h>
#include "blood_drop_shape.h"
#include "blood_paint.h"
#include "grain.h"

/* At this thickness, mm, a film hides two thirds of what is below. */
#define HIDES_MM 0.013f
/* From a thin film's colour half of the way to a thick one's. */
#define DARK_MM 0.16f
/* Thinner than this there is none to be seen, mm. */
#define NOTHING_MM 0.0004f

/* A drop, prepared; from … to is what it covers, texels. */
struct shape {
	struct ground_metric metric;
	float x, y, axis[2];	      /* axis: unit, mm, the way it runs */
	float before, behind, beside; /* 1/mm */
	float high_mm, grain;
	int from_px[2], to_px[2];
};

struct wet_texel {
	float thick, light; /* mm; of a highlight, 0 … 1 */
};

static bool shape_of(const struct film *film, const struct drop *drop,
		     struct shape *shape)
{
	struct drop_box box;

	if (!drop->units || !drop_box(film, drop, &box))
		return false;
	shape->metric = box.metric;
	shape->axis[0] = (float)box.axis[0];
	shape->axis[1] = (float)box.axis[1];
	shape->x = (float)drop->drawn_px[0];
	shape->y = (float)drop->drawn_px[1];
	shape->before = (float)(1 / (drop->drawn_mm * drop->before));
	shape->behind = (float)(1 / (drop->drawn_mm * drop->behind));
	shape->beside = (float)(1 / (drop->drawn_mm * drop->beside));
	/* Such that its volume is the drop's: the mean of (1 - r²)^1.5 over a disc is 0.4. */
	shape->high_mm = (float)(0.625 * drop->drawn_mm * 2 /
				 (drop->beside * (drop->before + drop->behind)));
	shape->grain = box.metric.a / FILM_ROUGH_MM;
	shape->from_px[0] = box.left;
	shape->from_px[1] = box.top;
	shape->to_px[0] = box.right + 1;
	shape->to_px[1] = box.bottom + 1;
	return true;
}

static void add_texel(struct wet_texel *to, int x, int y, const struct shape *shape)
{
	float dx = (float)x + 0.5f - shape->x, dy = (float)y + 0.5f - shape->y;
	float u = shape->metric.a * dx + shape->metric.b * dy, v = shape->metric.c * dy;
	float along = u * shape->axis[0] + v * shape->axis[1];
	float across = (v * shape->axis[0] - u * shape->axis[1]) * shape->beside;
	float r2, cap, lit;

	along *= along > 0 ? shape->before : shape->behind;
	r2 = along * along + across * across;
	if (r2 >= 1.6f)
		return;
	r2 *= 1 + FILM_ROUGH * noise_smooth(FILM_ROUGH_KEY, (float)x * shape->grain,
					    (float)y * shape->grain);
	if (r2 >= 1)
		return;
	cap = 1 - r2;
	to->thick += shape->high_mm * cap * sqrtf(cap);
	/* A window that shines on it, off the middle. */
	u = u * shape->beside + 0.3f;
	v = v * shape->beside + 0.34f;
	lit = 1 - (u * u + v * v) * 16;
	if (lit > to->light)
		to->light = lit;
}

static void add_shape(struct wet_texel *tile, int x0, int y0, const struct shape *shape)
{
	int left = shape->from_px[0] > x0 ? shape->from_px[0] : x0;
	int right =
		shape->to_px[0] < x0 + CANVAS_TILE ? shape->to_px[0] : x0 + CANVAS_TILE;
	int top = shape->from_px[1] > y0 ? shape->from_px[1] : y0;
	int bottom =
		shape->to_px[1] < y0 + CANVAS_TILE ? shape->to_px[1] : y0 + CANVAS_TILE;

	for (int y = top; y < bottom; y++)
		for (int x = left; x < right; x++)
			add_texel(&tile[(y - y0) * CANVAS_TILE + x - x0], x, y, shape);
}

static float mix(float a, float b, float t)
{
	return a + (b - a) * t;
}

static void colour(const struct wet_texel *texel, float dry, uint8_t rgba[4])
{
	float thick = texel->thick;
	float alpha = 1 - expf(-thick / HIDES_MM);
	float dark = thick / (thick + DARK_MM);
	float light = texel->light > 0 ? texel->light * texel->light * 0.14f *
						 fminf(thick / 0.3f, 1)
				       : 0;
	float rgb[3] = {
		mix(0.56f, 0.36f, dark),
		mix(0.025f, 0.01f, dark),
		mix(0.03f, 0.012f, dark),
	};
	const float brown[3] = {0.27f, 0.055f, 0.035f};

	alpha = fminf(alpha, 0.985f);
	for (int i = 0; i < 3; i++) {
		rgb[i] = mix(rgb[i], brown[i], dry * 0.75f);
		rgb[i] = mix(rgb[i], 1, light);
		rgba[i] = (uint8_t)(rgb[i] * alpha * 255 + 0.5f);
	}
	rgba[3] = (uint8_t)(alpha * 255 + 0.5f);
}

/* Whether a texel of it is another one now. */
static bool paint_tile(struct film *film, const struct shape *shapes, int n, int number,
		       uint8_t *rgba)
{
	int x0 = number % film->tiles * CANVAS_TILE,
	    y0 = number / film->tiles * CANVAS_TILE;
	const struct film_tile *tile = film_tile(film, x0, y0);
	size_t first = (size_t)number * FILM_TEXELS;
	struct wet_texel texels[FILM_TEXELS];
	bool changed = false;
	float unit = (float)(BLOOD_UNIT_UL / tile->area_mm2);

	for (int i = 0; i < FILM_TEXELS; i++)
		texels[i] = (struct wet_texel){(float)film->volume[first + i] * unit, 0};
	for (int i = 0; i < n; i++)
		add_shape(texels, x0, y0, &shapes[i]);
	for (int i = 0; i < FILM_TEXELS; i++) {
		uint8_t *to = rgba + ((size_t)(y0 + i / CANVAS_TILE) * film->size + x0 +
				      i % CANVAS_TILE) *
					     4;
		uint8_t is[4] = {0};

		if (texels[i].thick > NOTHING_MM)
			colour(&texels[i], film->dry[first + i] * (1.0f / FILM_DRY), is);
		changed |= memcmp(to, is, sizeof(is)) != 0;
		memcpy(to, is, sizeof(is));
	}
	return changed;
}

void blood_paint_layer(struct film *film, const struct drops *drops,
		       struct incise_canvas *canvas, int layer)
{
	uint8_t *rgba = incise_canvas_layer(canvas, layer);
	struct shape shapes[DROPS_MAX];
	int n = 0;

	if (!film->n_dirty || !rgba)
		return;
	for (int i = 0; i < DROPS_MAX; i++)
		n += shape_of(film, &drops->drop[i], &shapes[n]);
	for (int i = 0; film->n_dirty; i++) {
		if (!film->dirty[i])
			continue;
		film->dirty[i] = 0;
		film->n_dirty--;
		/* A film drains and dries by less than a step of colour, mostly. */
		if (paint_tile(film, shapes, n, i, rgba))
			incise_canvas_dirty(canvas, (struct incise_rect){
							    i % film->tiles * CANVAS_TILE,
							    i / film->tiles * CANVAS_TILE,
							    CANVAS_TILE, CANVAS_TILE});
	}
}
