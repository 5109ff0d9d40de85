// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The wound in the texture: its fields, the line of its points, its lips and its colour; see
 * wound.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "ground.h"
#include "noise.h"
#include "wound.h"

/* --- The fields, and the stretches of the line that raise them --- */

#define FIELD_TEXELS (CANVAS_TILE * CANVAS_TILE)
/* Distances to the lips are kept up to this far outside, mm. */
#define FIELD_INSIDE_MIN_MM -1.0f
#define FIELD_STEPS_MM 4096.0f /* per mm */
#define FIELD_BIAS_MM 8.0f

/* All 0: there is no wound. */
struct field_texel {
	uint16_t inside; /* (mm inside of the lips + BIAS) · STEPS; 0: far */
	uint16_t depth;	 /* of its floor, mm · STEPS */
	uint16_t halo;	 /* 0 … 65535 */
	uint8_t half;	 /* from its middle to its lips, mm · HALF_STEPS */
	int8_t lean;	 /* of the wall towards the lamp: -127 … 127 */
};

#define HALF_STEPS_MM 30.0f

/* An end of a stretch, as drawn. */
struct field_end {
	float px[2], half_mm, depth_mm;
};

/* A stretch, prepared; from_px … to_px: the texels that it can touch. */
struct field_stretch {
	struct ground_metric metric;
	float x, y;		     /* one end, texels */
	float along[2], inverse_mm2; /* to the other, mm; 1 / length², or 0 */
	float half_mm, half_more_mm; /* at this end; increase to the other */
	float depth_mm, depth_more_mm;
	float reach_mm;
	float lamp[2];	   /* unit, towards it in the surface, mm */
	float first, last; /* parts of the way beyond which other stretches count */
	int from_px[2], to_px[2]; /* to_px is exclusive */
};

#define FIELD_INSIDE_MAX_MM 7.9f
#define FIELD_DEPTH_MAX_MM 15.9f

static float field_inside_mm(const struct field_texel *texel)
{
	return (float)texel->inside * (1 / FIELD_STEPS_MM) - FIELD_BIAS_MM;
}

/* fminf() and fmaxf() are calls. */
static inline float least_wound(float a, float b)
{
	return a < b ? a : b;
}

static inline float most(float a, float b)
{
	return a > b ? a : b;
}

/* Width of the reddened skin along a cut: mm, more along a deep one. */
static float halo_mm(float depth_mm)
{
	return least_wound(0.7f + 0.35f * depth_mm, 2.5f);
}

/* The texels within a reach of others, clipped to the texture. */
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

/* Returns false if it touches no texel of size × size. */
static bool field_prepare(struct field_stretch *s, const struct field_end *a,
			  const struct field_end *b, const struct ground_metric *m,
			  const float lamp[2], int size)
{
	float dx = b->px[0] - a->px[0], dy = b->px[1] - a->px[1], length2;
	float half = fmaxf(a->half_mm, b->half_mm);

	*s = (struct field_stretch){.metric = *m,
				    .x = a->px[0],
				    .y = a->px[1],
				    .lamp = {lamp[0], lamp[1]},
				    .first = -INFINITY,
				    .last = INFINITY};
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

static bool raise_to(uint16_t *field, float value)
{
	uint16_t v = (uint16_t)(value + 0.5f);

	if (v <= *field)
		return false;
	*field = v;
	return true;
}

static void raise_texel(struct field_texel *texel, const struct field_stretch *s, float u,
			float v)
{
	float t = (u * s->along[0] + v * s->along[1]) * s->inverse_mm2;
	float half, depth, inside, off, off2, red;

	t = t > 0 ? t < 1 ? t : 1 : 0;
	u -= t * s->along[0];
	v -= t * s->along[1];
	off2 = u * u + v * v;
	if (off2 >= s->reach_mm * s->reach_mm)
		return;
	half = s->half_mm + t * s->half_more_mm;
	depth = s->depth_mm + t * s->depth_more_mm;
	off = sqrtf(off2);
	inside = half - off;
	if (inside > FIELD_INSIDE_MIN_MM &&
	    raise_to(&texel->inside,
		     (least_wound(inside, FIELD_INSIDE_MAX_MM) + FIELD_BIAS_MM) *
			     FIELD_STEPS_MM)) {
		/* The wall faces the middle. */
		float lit = u * s->lamp[0] + v * s->lamp[1];

		texel->half =
			(uint8_t)(least_wound(half, FIELD_INSIDE_MAX_MM) * HALF_STEPS_MM);
		texel->lean = (int8_t)(-127 * lit / (off + 0.05f));
	}
	red = least_wound(depth * (1 / 1.5f), 1) * 65535;
	if (inside > 0) {
		off /= half; /* 0 in the middle, 1 at the lips */
		raise_to(&texel->depth, least_wound(depth, FIELD_DEPTH_MAX_MM) *
						(1 - off * off) * FIELD_STEPS_MM);
		raise_to(&texel->halo, red);
	} else {
		float out = 1 + inside / halo_mm(depth);

		if (out > 0)
			raise_to(&texel->halo, out * out * red);
	}
}

/* Raise the fields of the tile that starts at this texel, where the stretch is. */
static void field_raise(struct field_texel *tile, int x, int y,
			const struct field_stretch *s)
{
	int left = s->from_px[0] > x ? s->from_px[0] : x;
	int right = s->to_px[0] < x + CANVAS_TILE ? s->to_px[0] : x + CANVAS_TILE;
	int top = s->from_px[1] > y ? s->from_px[1] : y;
	int bottom = s->to_px[1] < y + CANVAS_TILE ? s->to_px[1] : y + CANVAS_TILE;

	for (int j = top; j < bottom; j++) {
		struct field_texel *row = tile + (j - y) * CANVAS_TILE;
		float dy = (float)j + 0.5f - s->y, v = s->metric.c * dy;
		/* At texel 0. */
		float u = s->metric.a * (0.5f - s->x) + s->metric.b * dy;
		int from = left, to = right;

		if (s->inverse_mm2 > 0)
			canvas_clip_row((u * s->along[0] + v * s->along[1]) *
						s->inverse_mm2,
					s->metric.a * s->along[0] * s->inverse_mm2,
					s->first, s->last, &from, &to);
		for (int i = from; i < to; i++) {
			float dx = (float)i + 0.5f - s->x;

			raise_texel(&row[i - x], s, s->metric.a * dx + s->metric.b * dy,
				    v);
		}
	}
}

/* A colour with alpha over premultiplied ones. */
static void over(float to[4], float r, float g, float b, float alpha)
{
	const float colour[4] = {r, g, b, 1};

	for (int i = 0; i < 4; i++)
		to[i] = to[i] * (1 - alpha) + colour[i] * alpha;
}

static float smooth(float from, float to, float x)
{
	x = least_wound(most((x - from) / (to - from), 0), 1);
	return x * x * (3 - 2 * x);
}

static float mix_wound(float a, float b, float t)
{
	return a + (b - a) * t;
}

/* No colour may exceed its alpha, rounding included. */
static void put_colour(uint8_t rgba[4], const float colour[4])
{
	rgba[3] = (uint8_t)(least_wound(colour[3], 1) * 255 + 0.5f);
	for (int i = 0; i < 3; i++)
		rgba[i] = (uint8_t)(least_wound(most(colour[i], 0), colour[3]) * 255 +
				    0.5f);
}

/* Skin along the cut: reddened, and its rim pale, risen, lit from one side. */
static void colour_skin(const struct field_texel *texel, float inside, float grain,
			uint8_t rgba[4])
{
	float halo = (float)texel->halo * (1 / 65535.0f), colour[4] = {0};
	float lit = (float)texel->lean * (1 / 127.0f);
	float lip = 1 - fabsf(inside + 0.2f) / 0.26f;

	over(colour, 0.70f, 0.20f, 0.16f, halo * (0.40f + 0.10f * grain));
	if (lip > 0) {
		over(colour, 0.93f, 0.66f, 0.58f, 0.55f * lip * halo);
		/* Outside of its ridge the rim falls away from the cut. */
		lit = (inside < -0.2f ? -lit : lit) * lip * halo;
		if (lit > 0)
			over(colour, 1, 0.90f, 0.84f, 0.4f * lit);
		else
			over(colour, 0.25f, 0.05f, 0.04f, -0.4f * lit);
	}
	put_colour(rgba, colour);
}

/* Layers of tissue in the wall of an open cut, mm below the skin. */
#define DERMIS_MM 1.0f
#define FAT_MM 2.8f
/* Steepness of a wall; a cut as wide as this shows its layers. */
#define WALL_STEEP 2.2f
#define OPEN_FROM_MM 0.9f
#define OPEN_MM 1.8f
/* The airway begins so deep, and so far inside. */
#define AIRWAY_MM 6.0f
#define AIRWAY_INSIDE_MM 1.6f

/*
 * Flesh between the lips, as deep as it looks: walls in layers, one in the light and one in the
 * shade, a floor that is the darker the deeper and narrower the cut is.
 *
 *     lip ▔╲             ╱▔ dermis, pale
 *           ╲           ╱   fat, yellow
 *            ╲         ╱    muscle, red
 *             ╲▁▁███▁▁╱     airway, dark
 */
static void colour_flesh(const struct field_texel *texel, float inside, float core,
			 float grain, float fine, uint8_t rgba[4])
{
	float floor = (float)texel->depth * (1 / FIELD_STEPS_MM), colour[4] = {0};
	float half = most((float)texel->half * (1 / HALF_STEPS_MM), 0.05f);
	float off = least_wound(most(1 - inside / half, 0), 1);
	float wall =
		least_wound(WALL_STEEP * most(inside, 0) * (1 + 0.25f * grain), floor);
	float open = smooth(OPEN_FROM_MM, OPEN_MM, half), narrow = 0.30f * floor / half;
	float lit = (float)texel->lean * (1 / 127.0f) * smooth(0, 0.5f, off);
	float fat = smooth(0.7f * DERMIS_MM, 1.2f * DERMIS_MM, wall);
	float red = smooth(0.8f * FAT_MM, 1.15f * FAT_MM, wall + 0.3f * fine);
	float rgb[3] = {0.50f, 0.085f, 0.075f}; /* muscle */
	const float dermis_rgb[3] = {0.86f, 0.47f, 0.41f},
		    fat_rgb[3] = {0.80f, 0.50f, 0.31f},
		    raw_rgb[3] = {0.50f, 0.035f, 0.035f};
	float light = (1 + 0.38f * lit) * (0.5f + 0.5f / (1 + narrow * narrow)) *
		      (1 + 0.07f * grain + 0.08f * fine);
	float hole = smooth(AIRWAY_MM, AIRWAY_MM + 1.2f, floor) *
		     smooth(AIRWAY_INSIDE_MM, AIRWAY_INSIDE_MM + 0.9f, inside);

	for (int i = 0; i < 3; i++) {
		float layer = mix_wound(dermis_rgb[i], fat_rgb[i], fat);

		layer = mix_wound(raw_rgb[i], mix_wound(layer, rgb[i], red), open);
		/* Blood colours all of it. */
		layer = mix_wound(layer, raw_rgb[i], 0.30f + 0.12f * grain);
		rgb[i] = layer * light * (1 - 0.93f * hole);
	}
	over(colour, rgb[0], rgb[1], rgb[2], core * 0.98f);
	put_colour(rgba, colour);
}

/* Cells of the grain of skin and flesh per mm. */
#define GRAIN_PER_MM 1.6f
#define FINE_PER_MM 5.0f

/* The two colours of a texel: of skin, and of flesh, which is above blood on the skin. */
static void colour_texel(const struct field_texel *texel, float grain, float fine,
			 float soft, uint8_t skin[4], uint8_t flesh[4])
{
	float inside = field_inside_mm(texel) + 0.04f * grain + 0.015f * fine;
	float core = smooth(-soft, soft, inside);

	memset(flesh, 0, 4);
	memset(skin, 0, 4);
	if (core < 1)
		colour_skin(texel, inside, grain, skin);
	if (core > 0)
		colour_flesh(texel, inside, core, grain, fine, flesh);
}

/* Colours of a row of a tile; texel_mm: size of a texel, for the grain. */
static void colour_row(const struct field_texel *row, int x, int y, float texel_mm,
		       uint8_t *skin, uint8_t *flesh)
{
	float grain[CANVAS_TILE], fine[CANVAS_TILE], soft = most(0.06f, texel_mm);

	noise_smooth_row(7, GRAIN_PER_MM * texel_mm, x,
			 GRAIN_PER_MM * texel_mm * (float)y, CANVAS_TILE, grain);
	noise_smooth_row(8, FINE_PER_MM * texel_mm, x, FINE_PER_MM * texel_mm * (float)y,
			 CANVAS_TILE, fine);
	for (int i = 0; i < CANVAS_TILE; i++, skin += 4, flesh += 4)
		if (row[i].inside || row[i].halo) {
			colour_texel(&row[i], grain[i], fine[i], soft, skin, flesh);
		} else {
			memset(skin, 0, 4);
			memset(flesh, 0, 4);
		}
}

static void field_colour(const struct field_texel *tile, int x, int y, float texel_mm,
			 uint8_t *skin, uint8_t *flesh, int stride)
{
	for (int j = 0; j < CANVAS_TILE; j++, tile += CANVAS_TILE) {
		size_t at = (size_t)j * stride;
		unsigned int any = 0;

		for (int i = 0; i < CANVAS_TILE; i++)
			any |= tile[i].inside | tile[i].halo;
		if (any) {
			colour_row(tile, x, y + j, texel_mm, skin + at, flesh + at);
		} else {
			memset(skin + at, 0, CANVAS_TILE * 4);
			memset(flesh + at, 0, CANVAS_TILE * 4);
		}
	}
}

/* --- The line of its points --- */

/* A cut tapers over this length at both ends, down to this part of its width. */
#define LINE_TAPER_MM 3.0f
#define TAPER_LEAST 0.12f

/* A point of the line. */
struct wound_point {
	float px[2];
	float mm[3]; /* on the surface */
	float depth_mm;
	float half_mm;	/* half-width at rest, if never opened */
	float open_mm;	/* present opening */
	float wider_mm; /* lasting widening */
	float kept_mm;	/* opening that is in the fields */
	float arc_mm;	/* from the cut's start */
	bool joined;	/* to the point before it */
	bool settled;	/* its width and depth are final, and in the fields */
	struct ground_metric metric;
};

struct wound {
	const struct uv_map *map;
	struct incise_scene_scalpel scalpel;
	struct incise_incision *incision; /* or NULL */
	int size;			  /* texels */
	float texel_mm;
	float lamp[2];		   /* unit, towards it, mm along rows and across */
	struct field_texel *field; /* tile after tile */
	struct canvas_tiles tiles; /* to be painted */

	/* Points have numbers, from @first to before @end. */
	uint64_t first, end;
	uint64_t settled; /* all before are settled */
	struct wound_point *points;

	bool cutting; /* @tip is the blade, joined to the last point */
	struct wound_point tip;
	double tip_mm[3]; /* on the surface */
	int64_t tip_ns;

	bool inserted, moving; /* moving: lips are not at rest */
	bool loose;	       /* some are farther apart than in the fields */
	double tool_px[2], tool_depth_mm;
	/* Half-widths of the tool: along a unit vector of the surface, and across it. */
	double tool_along[2], tool_wide_mm, tool_thick_mm;

	double cut_mm;
	uint64_t stamps;
	struct field_stretch
		*over; /* buffer for painting: WOUND_POINTS and the blade's */
};

static struct wound_point *line_point(const struct wound *wound, uint64_t number)
{
	return &wound->points[number % WOUND_POINTS];
}

/* 0 … 1 over the end of a cut. */
static float taper(float from_end_mm)
{
	float t = fminf(fmaxf(from_end_mm / LINE_TAPER_MM, 0), 1);

	return fmaxf(t * (2 - t), TAPER_LEAST);
}

/* A point as drawn when the cut ends at this arc. */
static struct field_end line_end(const struct wound_point *p, float end_mm)
{
	float thin = p->settled ? 1 : taper(fminf(p->arc_mm, end_mm - p->arc_mm));

	return (struct field_end){
		.px = {p->px[0], p->px[1]},
		.half_mm = p->half_mm * thin + fmaxf(p->open_mm, p->wider_mm),
		.depth_mm = p->depth_mm * sqrtf(thin),
	};
}

/* The stretch is to be painted. */
static void line_mark(struct wound *wound, const struct field_stretch *s)
{
	canvas_tiles_mark_texels(&wound->tiles, s->from_px[0], s->from_px[1],
				 s->to_px[0] - 1, s->to_px[1] - 1);
}

static void line_raise(struct wound *wound, const struct field_stretch *s)
{
	int right = (s->to_px[0] - 1) / CANVAS_TILE,
	    bottom = (s->to_px[1] - 1) / CANVAS_TILE;

	for (int y = s->from_px[1] / CANVAS_TILE; y <= bottom; y++)
		for (int x = s->from_px[0] / CANVAS_TILE; x <= right; x++)
			field_raise(wound->field + ((size_t)y * wound->tiles.side + x) *
							   FIELD_TEXELS,
				    x * CANVAS_TILE, y * CANVAS_TILE, s);
}

/* The stretch that ends at a point, likewise; false when it touches no texel. */
static bool line_stretch(const struct wound *wound, const struct wound_point *before,
			 const struct wound_point *p, float end_mm,
			 struct field_stretch *stretch)
{
	struct field_end b = line_end(p, end_mm), a = b;

	if (p->joined && before)
		a = line_end(before, end_mm);
	return field_prepare(stretch, &a, &b, &p->metric, wound->lamp, wound->size);
}

/* The point before, or NULL. */
static const struct wound_point *line_before(const struct wound *wound, uint64_t number)
{
	return number > wound->first ? line_point(wound, number - 1) : NULL;
}

/* Points up to an arc are final, as the blade's taper no longer reaches them. */
static void line_settle(struct wound *wound, float end_mm, float until_mm)
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

/* The lips are farther apart than in the fields. */
static bool line_loose(const struct wound_point *p)
{
	return fmaxf(p->open_mm, p->wider_mm) > p->kept_mm;
}

/* --- Cutting --- */

/* At a smaller depth the blade touches the skin without cutting it. */
#define CUTS_FROM_MM 0.05
#define DEPTH_MAX_MM 15.0
/* Faster motion, or a longer gap, is a discontinuity. */
#define SPEED_MAX_MM_S 5000.0
#define GAP_MAX_NS 500000000
#define JUMP_MIN_MM 1.0
/* Ways between ticks are divided into pieces of at most this length, mm. */
#define WAY_MM 0.6
#define WAYS_MAX 500
/* A prick without length bleeds like this much of a cut. */
#define PRICK_MM 0.3

/* A vector of space in the surface, mm along the rows of the texture and across. */
static void in_surface(const struct uv_map *map, const double px[2], const double v[3],
		       double to[2])
{
	double right[3], down[3];

	uv_map_metric(map, px, right, down);
	to[0] = v3_unit(right, right, 0) ? v3_dot(v, right) : 0;
	v3_add(down, down, -v3_dot(down, right), right);
	to[1] = v3_unit(down, down, 0) ? v3_dot(v, down) : 0;
}

struct wound *wound_new(const struct uv_map *map,
			const struct incise_scene_scalpel *scalpel,
			struct incise_incision *incision, struct incise_error *err)
{
	const double middle[2] = {map->size * 0.5, map->size * 0.5}, key[3] = UV_MAP_LAMP;
	struct wound *wound = calloc(1, sizeof(*wound));
	struct ground_metric metric;
	double lamp[2], length;

	if (!wound)
		goto no_memory;
	in_surface(map, middle, key, lamp);
	length = fmax(hypot(lamp[0], lamp[1]), 1e-6);
	for (int i = 0; i < 2; i++)
		wound->lamp[i] = (float)(lamp[i] / length);
	wound->map = map;
	wound->scalpel = *scalpel;
	wound->incision = incision;
	wound->size = map->size;
	wound->texel_mm = 0.1f;
	if (ground_metric(map, middle, &metric))
		wound->texel_mm = sqrtf(metric.a * metric.c);
	/* From calloc: unwritten pages take no memory. */
	wound->field = calloc((size_t)map->size * map->size, sizeof(*wound->field));
	wound->points = calloc(WOUND_POINTS, sizeof(*wound->points));
	wound->over = calloc(WOUND_POINTS + 1, sizeof(*wound->over));
	if (wound->field && wound->points && wound->over &&
	    canvas_tiles_init(&wound->tiles, wound->size))
		return wound;
no_memory:
	wound_free(wound);
	return INCISE_ERROR_NULL(err, ENOMEM, "view: no memory for the wound");
}

void wound_free(struct wound *wound)
{
	if (!wound)
		return;
	free(wound->field);
	free(wound->tiles.dirty);
	free(wound->points);
	free(wound->over);
	free(wound);
}

/* The fields at a texel; 0 outside of the texture. */
static struct field_texel field_at(const struct wound *wound, int x, int y)
{
	size_t tile = (size_t)(y / CANVAS_TILE) * wound->tiles.side + x / CANVAS_TILE;

	if (x < 0 || y < 0 || x >= wound->size || y >= wound->size)
		return (struct field_texel){0};
	return wound->field[tile * FIELD_TEXELS + y % CANVAS_TILE * CANVAS_TILE +
			    x % CANVAS_TILE];
}

/* The previous depth, halfway along a stretch. */
static double cut_before_mm(const struct wound *wound, const struct wound_point *a,
			    const struct wound_point *b)
{
	return field_at(wound, (int)((a->px[0] + b->px[0]) / 2),
			(int)((a->px[1] + b->px[1]) / 2))
		       .depth /
	       (double)FIELD_STEPS_MM;
}

/* The tip becomes a point of the line. */
static void push(struct wound *wound, struct wound_stroke *stroke)
{
	const struct wound_point *last = NULL;

	if (wound->tip.joined)
		last = line_point(wound, wound->end - 1);
	*stroke = (struct wound_stroke){
		.from_px = {wound->tip.px[0], wound->tip.px[1]},
		.to_px = {wound->tip.px[0], wound->tip.px[1]},
	};
	if (last) {
		stroke->begins = !last->joined;
		stroke->from_px[0] = last->px[0];
		stroke->from_px[1] = last->px[1];
		stroke->length_mm = wound->tip.arc_mm - last->arc_mm;
	}
	stroke->fresh_mm =
		fmax(wound->tip.depth_mm -
			     cut_before_mm(wound, last ? last : &wound->tip, &wound->tip),
		     0);
	if (wound->end - wound->first == WOUND_POINTS) {
		wound->first++;
		if (wound->settled < wound->first)
			wound->settled = wound->first;
	}
	*line_point(wound, wound->end++) = wound->tip;
	wound->tip.joined = true;
	wound->tip.depth_mm = 0;
	wound->stamps++;
	line_settle(wound, INFINITY, wound->tip.arc_mm - LINE_TAPER_MM);
}

/* The stretches that are not yet in the fields have changed. */
static void mark_tail(struct wound *wound)
{
	struct field_stretch stretch;

	for (uint64_t i = wound->settled; i < wound->end; i++)
		if (line_stretch(wound, line_before(wound, i), line_point(wound, i),
				 wound->tip.arc_mm, &stretch))
			line_mark(wound, &stretch);
	if (wound->cutting && line_stretch(wound, line_before(wound, wound->end),
					   &wound->tip, wound->tip.arc_mm, &stretch))
		line_mark(wound, &stretch);
}

static bool lift(struct wound *wound, struct wound_stroke *stroke)
{
	bool added = false;

	if (!wound->cutting)
		return false;
	mark_tail(wound);
	/* The rest of the way since the last point, or a prick. */
	if (wound->tip.depth_mm > 0) {
		bool prick = wound->tip.arc_mm < PRICK_MM;

		push(wound, stroke);
		if (prick)
			stroke->length_mm = PRICK_MM;
		added = true;
	}
	wound->cutting = false;
	line_settle(wound, wound->tip.arc_mm, INFINITY);
	return added;
}

/* Skin is under tension: a cut gapes, the deeper the wider, as far as skin is loose below. */
#define GAPES_TO_MM 6.0

static float half_mm(double depth_mm)
{
	return (float)(0.20 + 0.13 * fmin(depth_mm, GAPES_TO_MM));
}

/* The blade is in the tissue at this place. */
struct blade {
	double px[2], point_mm[3], depth_mm;
	int64_t t_ns;
	struct ground_metric metric;
};

/* Whether the blade cannot have moved there through the tissue. */
static bool is_discontinuity(const struct wound *wound, const struct blade *blade,
			     double *way_mm)
{
	double off[3], dt_s, along_mm;
	int64_t dt_ns;

	if (__builtin_sub_overflow(blade->t_ns, wound->tip_ns, &dt_ns) ||
	    dt_ns > GAP_MAX_NS || dt_ns < 0)
		return true;
	dt_s = (double)dt_ns * 1e-9;
	v3_sub(off, blade->point_mm, wound->tip_mm);
	*way_mm = v3_length(off);
	if (!(*way_mm <= JUMP_MIN_MM + SPEED_MAX_MM_S * dt_s))
		return true;
	/* Across a seam of the texture a short way is a long one in texels. */
	along_mm = ground_length_mm(&blade->metric, blade->px[0] - wound->tip.px[0],
				    blade->px[1] - wound->tip.px[1]);
	return along_mm > JUMP_MIN_MM + 3 * *way_mm;
}

static void place_wound_blade(struct wound *wound, const struct blade *blade)
{
	struct wound_point *tip = &wound->tip;

	tip->px[0] = (float)blade->px[0];
	tip->px[1] = (float)blade->px[1];
	tip->metric = blade->metric;
	tip->depth_mm = fmaxf(tip->depth_mm, (float)blade->depth_mm);
	tip->half_mm = half_mm(tip->depth_mm);
	for (int i = 0; i < 3; i++)
		tip->mm[i] = (float)blade->point_mm[i];
	v3_copy(wound->tip_mm, blade->point_mm);
	wound->tip_ns = blade->t_ns;
}

static void begin_wound(struct wound *wound, const struct blade *blade)
{
	struct wound_stroke none;

	wound->cutting = true;
	wound->tip = (struct wound_point){0};
	place_wound_blade(wound, blade);
	push(wound, &none);
}

/* Add the tip to the line, with points between if it is far, as the taper needs them. */
static void push_way(struct wound *wound, double since_mm, struct wound_stroke *stroke)
{
	const struct wound_point from = *line_point(wound, wound->end - 1),
				 to = wound->tip;
	int n = 1 + (int)fmin(since_mm / WAY_MM, WAYS_MAX);
	struct wound_stroke all = {0};

	for (int i = 1; i <= n; i++) {
		float t = (float)i / (float)n;

		wound->tip = to;
		wound->tip.joined = true;
		for (int k = 0; k < 2; k++)
			wound->tip.px[k] = from.px[k] + t * (to.px[k] - from.px[k]);
		for (int k = 0; k < 3; k++)
			wound->tip.mm[k] = from.mm[k] + t * (to.mm[k] - from.mm[k]);
		wound->tip.depth_mm = from.depth_mm + t * (to.depth_mm - from.depth_mm);
		wound->tip.half_mm = half_mm(wound->tip.depth_mm);
		wound->tip.arc_mm = from.arc_mm + t * (to.arc_mm - from.arc_mm);
		/* The depth of a tapered point is no longer its own. */
		if (i == n || from.settled) {
			wound->tip.depth_mm = to.depth_mm;
			wound->tip.half_mm = to.half_mm;
		}
		push(wound, stroke);
		if (i == 1)
			all = *stroke;
		else
			all.length_mm += stroke->length_mm;
		all.fresh_mm += (stroke->fresh_mm - all.fresh_mm) / i;
	}
	all.to_px[0] = to.px[0];
	all.to_px[1] = to.px[1];
	*stroke = all;
}

static bool cut_wound(struct wound *wound, const struct blade *blade,
		      struct wound_stroke *stroke)
{
	const struct wound_point *last;
	double way_mm = 0, since_mm;
	bool added = false;

	if (!wound->cutting || is_discontinuity(wound, blade, &way_mm)) {
		added = lift(wound, stroke);
		begin_wound(wound, blade);
		mark_tail(wound);
		return added;
	}
	wound->cut_mm += way_mm;
	mark_tail(wound);
	place_wound_blade(wound, blade);
	last = line_point(wound, wound->end - 1);
	since_mm = ground_length_mm(&wound->tip.metric, wound->tip.px[0] - last->px[0],
				    wound->tip.px[1] - last->px[1]);
	wound->tip.arc_mm = last->arc_mm + (float)since_mm;
	if (since_mm >= WOUND_SPACING_MM) {
		push_way(wound, since_mm, stroke);
		added = true;
	}
	mark_tail(wound);
	return added;
}

static bool read_blade(const struct wound *wound, const struct incise_tick *tick,
		       struct blade *blade)
{
	if (!(tick->depth_mm >= CUTS_FROM_MM) || !isfinite(tick->depth_mm) ||
	    !v3_finite(tick->proxy_mm) ||
	    !uv_map_px(wound->map, tick->proxy_mm, blade->px) ||
	    !ground_metric(wound->map, blade->px, &blade->metric))
		return false;
	v3_copy(blade->point_mm, tick->proxy_mm);
	blade->depth_mm = fmin(tick->depth_mm, DEPTH_MAX_MM);
	blade->t_ns = tick->t_ns;
	return true;
}

static void insert(struct wound *wound, const struct incise_tick *tick)
{
	bool tube = tick->tool == INCISE_TOOL_TUBE;
	const struct incise_scene_scalpel *scalpel = &wound->scalpel;
	double flat[3], across[2], length;

	wound->inserted = v3_finite(tick->proxy_mm) && isfinite(tick->depth_mm) &&
			  uv_map_px(wound->map, tick->proxy_mm, wound->tool_px);
	if (!wound->inserted)
		return;
	wound->tool_wide_mm = 0.5 * (tube ? scalpel->tube_mm : scalpel->handle_width_mm);
	wound->tool_thick_mm =
		0.5 * (tube ? scalpel->tube_mm : scalpel->handle_thickness_mm);
	wound->tool_depth_mm = fmin(fmax(tick->depth_mm, 0), DEPTH_MAX_MM);
	v3_rotate(flat, tick->quaternion, scalpel->side);
	in_surface(wound->map, wound->tool_px, flat, across);
	length = hypot(across[0], across[1]);
	/* A handle that lies on its flat side, or has no attitude, is as wide as it can be. */
	if (!(length > 1e-6 && length < 4))
		wound->tool_thick_mm = wound->tool_wide_mm;
	wound->tool_along[0] = length > 1e-6 && length < 4 ? across[1] / length : 1;
	wound->tool_along[1] = length > 1e-6 && length < 4 ? -across[0] / length : 0;
}

bool wound_tick(struct wound *wound, const struct incise_tick *tick,
		struct wound_stroke *stroke)
{
	bool in = (tick->flags & INCISE_TICK_CONTACT) &&
		  !(tick->flags & (INCISE_TICK_STALE | INCISE_TICK_FAULT));
	struct blade blade;

	wound->inserted = false;
	if (wound->incision)
		incise_incision_tick(wound->incision, tick);
	if (in && tick->phase == INCISE_PHASE_INSERTION)
		insert(wound, tick);
	if (in && tick->phase == INCISE_PHASE_CUTTING &&
	    tick->tool == INCISE_TOOL_BLADE && read_blade(wound, tick, &blade))
		return cut_wound(wound, &blade, stroke);
	return lift(wound, stroke);
}

/* --- Lips: they open around an instrument, and close --- */

/* A tool that is farther from the line is not in it. */
#define BESIDE_MM 3.0
/* A cut is a point's own within this distance of its line, and 30° of its direction: cosine. */
#define OWN_MM 1.5
#define OWN_ALONG 0.866
/* Reach of the opening along the cut: half-widths, and mm more. */
#define SHOULDER_HALVES 3.0
#define SHOULDER_MM 2.0
/* Length over which a slit opens from its corner. */
#define CORNER_MM 9.0f
/* Opening per length from the corner, which stays one. */
#define CORNER 0.7f
/* An insertion changes no opening farther away than a cut is long. */
#define FAR_MM 70.0
/* Part of the way per step: opened in 60 ms, closed to 2 % in 1 s. */
#define OPENING 0.15f
#define CLOSING 0.036f
#define AT_REST_MM 0.004f

/* The line's direction at a point, unit, mm along rows and across. */
static void direction(const struct wound *wound, uint64_t number, double to[2])
{
	const struct wound_point *p = line_point(wound, number), *a = p, *b = p;
	double u, v, length;

	if (p->joined && number > wound->first)
		a = line_point(wound, number - 1);
	if (number + 1 < wound->end && line_point(wound, number + 1)->joined)
		b = line_point(wound, number + 1);
	u = p->metric.a * (b->px[0] - a->px[0]) + p->metric.b * (b->px[1] - a->px[1]);
	v = p->metric.c * (b->px[1] - a->px[1]);
	length = hypot(u, v);
	to[0] = length > 0 ? u / length : 1;
	to[1] = length > 0 ? v / length : 0;
}

/* The half-width that the tool requires at a point. */
static float required_mm(const struct wound *wound, uint64_t number, float end_mm)
{
	const struct wound_point *p = line_point(wound, number);
	double dx = wound->tool_px[0] - p->px[0], dy = wound->tool_px[1] - p->px[1];
	double u, v, along[2], half, off, corner, turned;

	if (!wound->inserted)
		return 0;
	u = p->metric.a * dx + p->metric.b * dy;
	v = p->metric.c * dy;
	if (!(u * u + v * v < 30 * 30))
		return 0;
	direction(wound, number, along);
	if (fabs(u * along[1] - v * along[0]) > BESIDE_MM)
		return 0;
	turned = fabs(along[0] * wound->tool_along[1] - along[1] * wound->tool_along[0]);
	half = fmin(turned * wound->tool_wide_mm +
			    sqrt(fmax(1 - turned * turned, 0)) * wound->tool_thick_mm,
		    0.5 * wound->tool_depth_mm);
	off = (u * along[0] + v * along[1]) / (half * SHOULDER_HALVES + SHOULDER_MM);
	if (!(fabs(off) < 1))
		return 0;
	corner = fmin(fmin(p->arc_mm, end_mm - p->arc_mm) /
			      fmin(0.5f * end_mm + 0.01f, CORNER_MM),
		      1);
	off = 1 - off * off;
	return (float)(half * off * fmax(corner * (2 - corner), 0));
}

static double tool_off_mm(const struct wound *wound, const struct wound_point *p)
{
	return ground_length_mm(&p->metric, wound->tool_px[0] - p->px[0],
				wound->tool_px[1] - p->px[1]);
}

/* The lasting opening of a point's cut, mm; 0: the point is on no cut. */
static float stays_mm(const struct wound *wound, uint64_t number, float end_mm)
{
	const struct wound_point *p = line_point(wound, number), *other;
	double mm[3] = {p->mm[0], p->mm[1], p->mm[2]}, way[3], open_mm = 0;
	int cuts = wound->incision ? incise_incision_cuts(wound->incision) : 0;

	other = p;
	if (p->joined && number > wound->first)
		other = line_point(wound, number - 1);
	else if (number + 1 < wound->end && line_point(wound, number + 1)->joined)
		other = line_point(wound, number + 1);
	for (int i = 0; i < 3; i++)
		way[i] = p->mm[i] - other->mm[i];
	for (int i = 0; i < cuts; i++) {
		const struct incise_cut *cut = incise_incision_cut(wound->incision, i);
		double off[3], along_mm;

		v3_sub(off, mm, cut->at_mm);
		along_mm = v3_dot(off, cut->along);
		if (fabs(v3_dot(off, cut->side)) > OWN_MM ||
		    along_mm < cut->from_mm - OWN_MM || along_mm > cut->to_mm + OWN_MM ||
		    fabs(v3_dot(way, cut->along)) < OWN_ALONG * v3_length(way))
			continue;
		open_mm = fmax(open_mm, cut->place[incise_cut_place(along_mm)].open_mm);
	}
	return least_wound(0.5f * (float)open_mm,
			   CORNER * fmaxf(least_wound(p->arc_mm, end_mm - p->arc_mm), 0));
}

/* The stretches on both sides of a point are to be painted. */
static void mark_point(struct wound *wound, uint64_t number)
{
	for (uint64_t i = number; i <= number + 1 && i < wound->settled; i++) {
		struct field_stretch stretch;

		if (i > number && !line_point(wound, i)->joined)
			break;
		if (line_stretch(wound, line_before(wound, i), line_point(wound, i), 0,
				 &stretch))
			line_mark(wound, &stretch);
	}
}

static void step_point(struct wound *wound, uint64_t number, float end_mm)
{
	struct wound_point *p = line_point(wound, number);
	float to, was = p->open_mm;

	if (wound->inserted && tool_off_mm(wound, p) < FAR_MM)
		p->wider_mm =
			fmaxf(p->wider_mm, stays_mm(wound, number, end_mm) - p->half_mm);
	to = fmaxf(required_mm(wound, number, end_mm) - p->half_mm, p->wider_mm);
	if (to == was)
		return;
	mark_point(wound, number);
	p->open_mm += (to - was) * (to > was ? OPENING : CLOSING);
	if (fabsf(to - p->open_mm) < AT_REST_MM)
		p->open_mm = to;

	mark_point(wound, number);
}

/* Longest stretch that is drawn as one, in parts of its opening and mm; points aside of it, mm. */
#define TOGETHER 0.6f
#define TOGETHER_MM 0.75f
#define STRAIGHT_MM 0.12f

/* From one point of the line to another, mm along rows and across. */
static void way(const struct wound *wound, uint64_t from, uint64_t to, float mm[2])
{
	const struct wound_point *a = line_point(wound, from), *b = line_point(wound, to);
	float x = b->px[0] - a->px[0], y = b->px[1] - a->px[1];

	mm[0] = b->metric.a * x + b->metric.b * y;
	mm[1] = b->metric.c * y;
}

/* Whether the line is straight from one point to another. */
static bool straight(const struct wound *wound, uint64_t from, uint64_t to)
{
	float all[2], length;

	way(wound, from, to, all);
	length = sqrtf(all[0] * all[0] + all[1] * all[1]);
	for (uint64_t i = from + 1; i < to; i++) {
		float part[2], along, aside;

		way(wound, from, i, part);
		along = part[0] * all[0] + part[1] * all[1];
		aside = part[0] * all[1] - part[1] * all[0];
		if (!(along > 0 && fabsf(aside) < STRAIGHT_MM * length))
			return false;
	}
	return true;
}

/*
 * The last of the stretches that can be drawn as one: open lips are wide, and single stretches
 * would overlap.
 */
static uint64_t together(const struct wound *wound, uint64_t from)
{
	const struct wound_point *before = line_before(wound, from);
	uint64_t to = from;

	if (!before || !line_point(wound, from)->joined)
		return to;
	for (; to + 1 < wound->settled; to++) {
		const struct wound_point *p = line_point(wound, to);
		const struct wound_point *next = line_point(wound, to + 1);

		if (!next->joined || !line_loose(p) || !line_loose(next) ||
		    next->arc_mm - before->arc_mm >
			    fmaxf(TOGETHER * fmaxf(p->open_mm, p->wider_mm),
				  TOGETHER_MM) ||
		    !straight(wound, from - 1, to + 1))
			break;
	}
	return to;
}

/* The texels of a clipped stretch, or of a rectangle around it, if they are fewer. */
static void bound_stretch(struct field_stretch *s)
{
	const float along_mm = 1 / sqrtf(s->inverse_mm2), reach = s->reach_mm / along_mm;
	const float ends[2] = {most(s->first, -reach), least_wound(s->last, 1 + reach)};
	float low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};

	for (int i = 0; i < 4; i++) {
		float t = ends[i / 2], aside = i % 2 ? reach : -reach;
		float u = t * s->along[0] - aside * s->along[1];
		float y = (t * s->along[1] + aside * s->along[0]) / s->metric.c;
		float px[2] = {s->x + (u - s->metric.b * y) / s->metric.a, s->y + y};

		for (int k = 0; k < 2; k++) {
			low[k] = least_wound(low[k], px[k]);
			high[k] = most(high[k], px[k]);
		}
	}
	for (int k = 0; k < 2; k++) {
		s->from_px[k] = (int)most((float)s->from_px[k], floorf(low[k]) - 1);
		s->to_px[k] = (int)least_wound((float)s->to_px[k], ceilf(high[k]) + 1);
	}
}

/* Clipped stretches overlap by so much, mm. */
#define OVERLAP_MM 0.05f

/* A walk along loose lips: points of the last stretch, and the number to go on from. */
struct loose_walk {
	uint64_t from, to, next;
};

/*
 * A stretch ends where the next loose one begins, which does its own beginning, round the joint as
 * far as the line turns there: a wide cut is not painted over and over.
 */
static void clip_stretch(const struct wound *wound, const struct loose_walk *before,
			 const struct loose_walk *walk, struct field_stretch *s)
{
	float last[2], length, turn, along_mm = 1 / sqrtf(s->inverse_mm2);

	if (walk->to + 1 < wound->settled && line_point(wound, walk->to + 1)->joined &&
	    line_loose(line_point(wound, walk->to)))
		s->last = 1;
	/* No stretch before it was drawn. */
	if (before->to != walk->from || before->from == before->to)
		return;
	way(wound, before->from, before->to, last);
	length = sqrtf(last[0] * last[0] + last[1] * last[1]);
	if (!(last[0] * s->along[0] + last[1] * s->along[1] > 0.5f * length * along_mm))
		return;
	turn = fabsf(last[0] * s->along[1] - last[1] * s->along[0]) / (length * along_mm);
	s->first = -(turn * s->reach_mm + OVERLAP_MM) / along_mm;
}

/* The next stretch of loose lips. */
static bool loose_stretch(const struct wound *wound, struct loose_walk *walk,
			  struct field_stretch *stretch)
{
	for (; walk->next < wound->settled; walk->next++) {
		const struct loose_walk last = *walk;
		const struct wound_point *p = line_point(wound, last.next);
		const struct wound_point *before = line_before(wound, last.next);

		if (!line_loose(p) && !(p->joined && before && line_loose(before)))
			continue;
		walk->to = walk->next = together(wound, last.next);
		walk->from = p->joined && before ? last.next - 1 : walk->to;
		if (!line_stretch(wound, before, line_point(wound, walk->to), 0, stretch))
			continue;
		if (stretch->inverse_mm2 > 0) {
			clip_stretch(wound, &last, walk, stretch);
			bound_stretch(stretch);
		}
		walk->next++;
		return true;
	}
	return false;
}

/* Lips that are at rest are put into the fields. */
static void keep_open(struct wound *wound)
{
	struct loose_walk walk = {UINT64_MAX, UINT64_MAX, wound->first};
	struct field_stretch stretch;

	while (loose_stretch(wound, &walk, &stretch))
		line_raise(wound, &stretch);
	for (uint64_t i = wound->first; i < wound->settled; i++) {
		struct wound_point *p = line_point(wound, i);

		p->kept_mm = fmaxf(fmaxf(p->open_mm, p->wider_mm), p->kept_mm);
	}
	wound->loose = false;
}

void wound_step(struct wound *wound)
{
	float end_mm = 0;

	if (!wound->inserted && !wound->moving)
		return;
	wound->moving = wound->loose = false;
	for (uint64_t i = wound->settled; i-- > wound->first;) {
		const struct wound_point *p = line_point(wound, i);

		if (i + 1 == wound->settled || !line_point(wound, i + 1)->joined)
			end_mm = p->arc_mm;
		step_point(wound, i, end_mm);
		wound->moving = wound->moving || p->open_mm > p->wider_mm;
		wound->loose = wound->loose || line_loose(p);
	}
	if (!wound->moving && wound->loose)
		keep_open(wound);
}

/* --- The layer --- */

/* Paint a tile: its fields, and the stretches over them. */
static void paint_tile(struct wound *wound, const struct field_stretch *over, int n,
		       int tile, uint8_t *skin, uint8_t *flesh)
{
	int x = tile % wound->tiles.side * CANVAS_TILE,
	    y = tile / wound->tiles.side * CANVAS_TILE;
	size_t at = ((size_t)y * wound->size + x) * 4;
	struct field_texel texels[FIELD_TEXELS];

	memcpy(texels, wound->field + (size_t)tile * FIELD_TEXELS, sizeof(texels));
	for (int i = 0; i < n; i++)
		field_raise(texels, x, y, &over[i]);
	field_colour(texels, x, y, wound->texel_mm, skin + at, flesh + at,
		     wound->size * 4);
}

/* Loose lips, and the stretches behind the blade. Returns their number. */
static int laid_over(const struct wound *wound, struct field_stretch *over)
{
	struct loose_walk walk = {UINT64_MAX, UINT64_MAX, wound->first};
	int n = 0;

	while (wound->loose && loose_stretch(wound, &walk, &over[n]))
		n++;
	for (uint64_t i = wound->settled; i < wound->end; i++)
		n += line_stretch(wound, line_before(wound, i), line_point(wound, i),
				  wound->tip.arc_mm, &over[n]);
	if (wound->cutting)
		n += line_stretch(wound, line_before(wound, wound->end), &wound->tip,
				  wound->tip.arc_mm, &over[n]);
	return n;
}

void wound_paint(struct wound *wound, struct incise_canvas *canvas, int skin_layer,
		 int flesh_layer)
{
	uint8_t *skin = incise_canvas_layer(canvas, skin_layer);
	uint8_t *flesh = incise_canvas_layer(canvas, flesh_layer);
	int n;

	if (!wound->tiles.n_dirty || !skin || !flesh)
		return;
	n = laid_over(wound, wound->over);
	for (int tile = 0; (tile = canvas_tiles_next(&wound->tiles, tile)) >= 0;) {
		paint_tile(wound, wound->over, n, tile, skin, flesh);
		incise_canvas_dirty(canvas, canvas_tile_rect(&wound->tiles, tile));
	}
}

bool wound_inserted(const struct wound *wound, double px[2], double *depth_mm)
{
	if (!wound->inserted)
		return false;
	px[0] = wound->tool_px[0];
	px[1] = wound->tool_px[1];
	*depth_mm = wound->tool_depth_mm;
	return true;
}

double wound_inside_mm(const struct wound *wound, int x, int y)
{
	struct field_texel texel = field_at(wound, x, y);

	return field_inside_mm(&texel);
}

double wound_cut_mm(const struct wound *wound)
{
	return wound->cut_mm;
}

uint64_t wound_stamps(const struct wound *wound)
{
	return wound->stamps;
}

int wound_points(const struct wound *wound)
{
	return (int)(wound->end - wound->first);
}
