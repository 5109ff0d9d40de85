// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The fields of a wound; see wound_field.h and wound.h.
 */
#include <math.h>
#include "grain.h"
#include "wound_field.h"

#define INSIDE_MAX_MM 7.9f
#define DEPTH_MAX_MM 15.9f

/* The reddened skin beside a cut: mm, more beside a deep one. */
static float halo_mm(float depth_mm)
{
	return fminf(0.7f + 0.35f * depth_mm, 2.5f);
}

/* Texels that a span of mm around some can touch, cut to the texture. */
static bool span(float low, float high, float reach, int size, int *from, int *to)
{
	low = fmaxf(floorf(low - reach) - 1, 0);
	high = fminf(ceilf(high + reach) + 1, (float)size);
	if (!(low < high))
		return false;
	*from = (int)low;
	*to = (int)high;
	return true;
}

bool field_prepare(struct field_stretch *s, const struct field_end *a,
		   const struct field_end *b, const struct ground_metric *m, int size)
{
	float dx = b->px[0] - a->px[0], dy = b->px[1] - a->px[1], length2;
	float half = fmaxf(a->half_mm, b->half_mm);

	*s = (struct field_stretch){.metric = *m, .x = a->px[0], .y = a->px[1]};
	s->along[0] = m->a * dx + m->b * dy;
	s->along[1] = m->c * dy;
	length2 = s->along[0] * s->along[0] + s->along[1] * s->along[1];
	s->inverse_mm2 = length2 > 1e-12f ? 1 / length2 : 0;
	s->half_mm = a->half_mm;
	s->half_more_mm = b->half_mm - a->half_mm;
	s->depth_mm = a->depth_mm;
	s->depth_more_mm = b->depth_mm - a->depth_mm;
	s->reach_mm = half + fmaxf(halo_mm(fmaxf(a->depth_mm, b->depth_mm)),
				   -FIELD_INSIDE_MIN_MM);
	return span(fminf(a->px[0], b->px[0]), fmaxf(a->px[0], b->px[0]),
		    s->reach_mm * (1 + fabsf(m->b) / m->c) / m->a, size, &s->from_px[0],
		    &s->to_px[0]) &&
	       span(fminf(a->px[1], b->px[1]), fmaxf(a->px[1], b->px[1]),
		    s->reach_mm / m->c, size, &s->from_px[1], &s->to_px[1]);
}

static void raise_to(uint16_t *field, float value)
{
	uint16_t v = (uint16_t)(value + 0.5f);

	if (v > *field)
		*field = v;
}

static void raise_texel(struct field_texel *texel, const struct field_stretch *s, float u,
			float v)
{
	float t = (u * s->along[0] + v * s->along[1]) * s->inverse_mm2;
	float half, depth, inside, out, off2;

	t = fminf(fmaxf(t, 0), 1);
	u -= t * s->along[0];
	v -= t * s->along[1];
	off2 = u * u + v * v;
	if (off2 >= s->reach_mm * s->reach_mm)
		return;
	half = s->half_mm + t * s->half_more_mm;
	depth = s->depth_mm + t * s->depth_more_mm;
	inside = half - sqrtf(off2);
	if (inside > FIELD_INSIDE_MIN_MM)
		raise_to(&texel->inside,
			 (fminf(inside, INSIDE_MAX_MM) + FIELD_BIAS_MM) * FIELD_STEPS_MM);
	if (inside > 0) {
		float off = 1 - inside / half; /* 0 in the middle, 1 at the lips */

		raise_to(&texel->depth,
			 fminf(depth, DEPTH_MAX_MM) * (1 - off * off) * FIELD_STEPS_MM);
	}
	out = 1 + fminf(inside, 0) / halo_mm(depth);
	if (out > 0)
		raise_to(&texel->halo, out * out * fminf(depth / 1.5f, 1) * 65535);
}

void field_raise(struct field_texel *tile, int x, int y, const struct field_stretch *s)
{
	int left = s->from_px[0] > x ? s->from_px[0] : x;
	int right = s->to_px[0] < x + CANVAS_TILE ? s->to_px[0] : x + CANVAS_TILE;
	int top = s->from_px[1] > y ? s->from_px[1] : y;
	int bottom = s->to_px[1] < y + CANVAS_TILE ? s->to_px[1] : y + CANVAS_TILE;

	for (int j = top; j < bottom; j++) {
		struct field_texel *row = tile + (j - y) * CANVAS_TILE;
		float dy = (float)j + 0.5f - s->y;

		for (int i = left; i < right; i++) {
			float dx = (float)i + 0.5f - s->x;

			raise_texel(&row[i - x], s, s->metric.a * dx + s->metric.b * dy,
				    s->metric.c * dy);
		}
	}
}

/* A colour of some strength over premultiplied ones. */
static void over(float to[4], float r, float g, float b, float alpha)
{
	const float colour[4] = {r, g, b, 1};

	for (int i = 0; i < 4; i++)
		to[i] = to[i] * (1 - alpha) + colour[i] * alpha;
}

static float smooth(float from, float to, float x)
{
	x = fminf(fmaxf((x - from) / (to - from), 0), 1);
	return x * x * (3 - 2 * x);
}

static float mix(float a, float b, float t)
{
	return a + (b - a) * t;
}

static void colour_texel(const struct field_texel *texel, float x_mm, float y_mm,
			 float texel_mm, uint8_t rgba[4])
{
	float grain = noise_smooth(7, x_mm * 2.2f, y_mm * 2.2f);
	float fine = noise_smooth(8, x_mm * 6.0f, y_mm * 6.0f);
	float inside = field_inside_mm(texel) + 0.045f * grain + 0.02f * fine;
	float halo = (float)texel->halo * (1 / 65535.0f);
	float depth = (float)texel->depth * (1 / FIELD_STEPS_MM);
	float soft = fmaxf(0.06f, texel_mm), colour[4] = {0}, lip, core, deep, wet;

	over(colour, 0.68f, 0.15f, 0.12f, halo * (0.48f + 0.10f * grain));
	/* The rim of the skin stands up a little and is pale. */
	lip = 1 - fabsf(inside + 0.17f) / 0.2f;
	if (lip > 0)
		over(colour, 0.93f, 0.66f, 0.58f, 0.6f * lip * halo);
	core = smooth(-soft, soft, inside);
	if (core > 0) {
		deep = powf(fminf(depth / 4.5f, 1), 0.6f);
		wet = 1 + 0.16f * fine * (1 - 0.6f * deep);
		over(colour, mix(0.70f, 0.19f, deep) * wet,
		     mix(0.20f, 0.012f, deep) * wet, mix(0.15f, 0.02f, deep) * wet,
		     core * 0.97f);
	}
	/* Rounded together, so that no colour is above its alpha. */
	rgba[3] = (uint8_t)(fminf(colour[3], 1) * 255 + 0.5f);
	for (int i = 0; i < 3; i++)
		rgba[i] = (uint8_t)(fminf(colour[i], colour[3]) * 255 + 0.5f);
}

void field_colour(const struct field_texel *tile, int x, int y, float texel_mm,
		  uint8_t *rgba, int stride)
{
	for (int j = 0; j < CANVAS_TILE; j++) {
		uint8_t *to = rgba + (size_t)j * stride;

		for (int i = 0; i < CANVAS_TILE; i++, to += 4, tile++)
			if (tile->inside || tile->halo)
				colour_texel(tile, (float)(x + i) * texel_mm,
					     (float)(y + j) * texel_mm, texel_mm, to);
			else
				to[0] = to[1] = to[2] = to[3] = 0;
	}
}
