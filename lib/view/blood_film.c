// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The film of blood on the surface; see blood_film.h.
 */
#include <math.h>
#include <stdlib.h>
#include "blood_film.h"
#include "grain.h"

/* Of blood: kg/mm³, and mm/s². */
#define RHO 1.06e-6
#define GRAVITY_MM_S2 9810.0
/* A spot leaves alone what lacks no more than that part of its height. */
#define UNSEEN 0.03

bool film_init(struct film *film, const struct incise_chart *chart,
	       const struct incise_scene_picture *picture)
{
	size_t texels = (size_t)chart->size * chart->size;
	size_t tiles;

	*film = (struct film){.chart = chart, .size = chart->size};
	film->tiles = chart->size / CANVAS_TILE;
	tiles = (size_t)film->tiles * film->tiles;
	for (int i = 0; i < 3; i++)
		film->gravity[i] = picture->gravity[i];
	/* mPa s are 1e-6 kg/(mm s). */
	film->drain = RHO * GRAVITY_MM_S2 / (3 * picture->viscosity_mPa_s * 1e-6);
	/* From calloc: pages that nobody writes are not there. */
	film->volume = calloc(texels, sizeof(*film->volume));
	film->dry = calloc(texels, sizeof(*film->dry));
	film->tile = calloc(tiles, sizeof(*film->tile));
	film->dirty = calloc(tiles, 1);
	film->height = malloc(FILM_SPOT_PX * FILM_SPOT_PX * sizeof(*film->height));
	return film->height && film->volume && film->dry && film->tile && film->dirty;
}

void film_free(struct film *film)
{
	free(film->volume);
	free(film->dry);
	free(film->tile);
	free(film->dirty);
	free(film->height);
}

size_t film_memory(const struct film *film)
{
	size_t texels = (size_t)film->size * film->size;

	return texels * (sizeof(*film->volume) + sizeof(*film->dry)) +
	       texels / FILM_TEXELS * (sizeof(*film->tile) + 1) +
	       FILM_SPOT_PX * FILM_SPOT_PX * sizeof(*film->height);
}

static void learn_tile(struct film *film, struct film_tile *tile, int number)
{
	double px[2] = {(number % film->tiles + 0.5) * CANVAS_TILE,
			(number / film->tiles + 0.5) * CANVAS_TILE};
	struct ground ground;
	double length;

	tile->known = true;
	tile->area_mm2 = 0.01f;
	tile->texel_mm = 0.1f;
	tile->there = ground_at(film->chart, film->gravity, px, &ground);
	if (!tile->there)
		return;
	tile->area_mm2 = (float)ground.area_mm2;
	tile->texel_mm = (float)sqrt(ground.area_mm2);
	tile->slope = (float)ground.slope;
	length = hypot(ground.down_px[0], ground.down_px[1]);
	for (int i = 0; i < 2 && length > 0; i++)
		tile->down_px[i] = (float)(ground.down_px[i] / length);
}

const struct film_tile *film_tile(struct film *film, int x, int y)
{
	int number = y / CANVAS_TILE * film->tiles + x / CANVAS_TILE;
	struct film_tile *tile = &film->tile[number];

	if (!tile->known)
		learn_tile(film, tile, number);
	return tile;
}

double film_thickness_mm(struct film *film, double x, double y)
{
	/* Also what is not a number is outside. */
	if (!(x >= 0 && y >= 0 && x < film->size && y < film->size))
		return 0;
	return film->volume[film_index(film, (int)x, (int)y)] * BLOOD_UNIT_UL /
	       film_tile(film, (int)x, (int)y)->area_mm2;
}

uint32_t film_round(const struct film *film)
{
	return (uint32_t)(film->step / FILM_ROUND_STEPS);
}

struct film_tile *film_wake(struct film *film, int x, int y)
{
	int number = y / CANVAS_TILE * film->tiles + x / CANVAS_TILE;
	struct film_tile *tile = &film->tile[number];

	if (!tile->awake) {
		tile->awake = true;
		tile->period = 1;
		tile->last = film_round(film);
	}
	film->n_dirty += !film->dirty[number];
	film->dirty[number] = 1;
	return tile;
}

void film_mark(struct film *film, int left, int top, int right, int bottom)
{
	left = (left < 0 ? 0 : left) / CANVAS_TILE;
	top = (top < 0 ? 0 : top) / CANVAS_TILE;
	right = (right >= film->size ? film->size - 1 : right) / CANVAS_TILE;
	bottom = (bottom >= film->size ? film->size - 1 : bottom) / CANVAS_TILE;
	for (int y = top; y <= bottom; y++)
		for (int x = left; x <= right; x++) {
			uint8_t *dirty = &film->dirty[y * film->tiles + x];

			film->n_dirty += !*dirty;
			*dirty = 1;
		}
}

/* Fresh blood on old wets it again. */
void film_put(struct film *film, size_t at, uint32_t units)
{
	uint32_t was = film->volume[at];

	film->dry[at] =
		(uint8_t)(film->dry[at] * (uint64_t)was / ((uint64_t)was + units + 1));
	film->volume[at] = was + units;
}

/* A round spot on the surface, as rows of texels with their heights in film->height. */
struct spot {
	struct ground_metric metric;
	double area_mm2; /* of a texel */
	double x, y, inverse_mm2;
	int left, top, w, h; /* may lie outside of the texture */
	double sum;	     /* of the heights */
};

/*
 * 1 in the middle, 0 at the edge and outside. The edge follows the roughness of the skin.
 */
static float spot_height(const struct spot *spot, float grain, int x, int y)
{
	double dx = x + 0.5 - spot->x, dy = y + 0.5 - spot->y;
	double u = spot->metric.a * dx + spot->metric.b * dy, v = spot->metric.c * dy;
	float r2 = (float)((u * u + v * v) * spot->inverse_mm2);

	if (r2 > 1.5f)
		return 0;
	r2 *= 1 + FILM_ROUGH * noise_smooth(FILM_ROUGH_KEY, (float)x * grain,
					    (float)y * grain);
	return fmaxf(1 - r2, 0);
}

static bool spot_at(struct film *film, const double px[2], double radius_mm,
		    struct spot *spot)
{
	struct ground_metric *m = &spot->metric;
	double rx, ry, most;

	if (!ground_metric(film->chart, px, m))
		return false;
	spot->area_mm2 = (double)m->a * m->c;
	radius_mm = fmax(radius_mm, 0.75 * fmax(m->a, m->c));
	ry = 1.25 * radius_mm / m->c;
	rx = 1.25 * radius_mm * (1 + fabs(m->b) / m->c) / m->a;
	most = fmin(1, (FILM_SPOT_PX / 2 - 1) / fmax(rx, ry));
	radius_mm *= most;
	spot->x = px[0];
	spot->y = px[1];
	spot->inverse_mm2 = 1 / (radius_mm * radius_mm);
	spot->left = (int)floor(px[0] - rx * most);
	spot->top = (int)floor(px[1] - ry * most);
	spot->w = (int)floor(px[0] + rx * most) + 1 - spot->left;
	spot->h = (int)floor(px[1] + ry * most) + 1 - spot->top;
	spot->sum = 0;
	for (int i = 0; i < spot->w * spot->h; i++) {
		film->height[i] =
			spot_height(spot, m->a / FILM_ROUGH_MM, spot->left + i % spot->w,
				    spot->top + i / spot->w);
		spot->sum += film->height[i];
	}
	return spot->sum > 0;
}

/* By how much a texel is to change that should be so thick in the spot's middle. */
static double lacks(const struct film *film, size_t at, float high, double units,
		    double share)
{
	double to = units * high;

	if (fabs(to - film->volume[at]) < UNSEEN * units)
		return 0;
	if (to > film->volume[at])
		return (to - film->volume[at]) * share;
	if (film->dry[at] >= FILM_CLOT / 2)
		return 0;
	return (to - film->volume[at]) * share * high;
}

/* The texel of the film that is the i-th of a spot; false: it is not on the texture. */
static bool texel_of(const struct film *film, const struct spot *spot, int i, size_t *at)
{
	int x = spot->left + i % spot->w, y = spot->top + i / spot->w;

	if (!(film->height[i] > 0) || !film_inside(film, x, y))
		return false;
	*at = film_index(film, x, y);
	return true;
}

int64_t film_level(struct film *film, const double px[2], double radius_mm,
		   double thickness_mm, double share, int64_t most)
{
	double units, adds = 0;
	struct spot spot;
	int64_t more = 0;
	size_t at;

	if (!spot_at(film, px, radius_mm, &spot))
		return 0;
	units = thickness_mm * spot.area_mm2 / BLOOD_UNIT_UL;
	for (int i = 0; i < spot.w * spot.h; i++)
		if (texel_of(film, &spot, i, &at))
			adds += fmax(lacks(film, at, film->height[i], units, share), 0);
	if (adds > (double)most)
		share *= fmax((double)most, 0) / adds;
	for (int i = 0; i < spot.w * spot.h; i++) {
		int32_t d;

		if (!texel_of(film, &spot, i, &at))
			continue;
		d = (int32_t)fmax(
			fmin(lacks(film, at, film->height[i], units, share), 1e9), -1e9);
		if (!d)
			continue;
		if (d > 0)
			film_put(film, at, (uint32_t)d);
		else
			film->volume[at] -= (uint32_t)-d;
		film_wake(film, spot.left + i % spot.w, spot.top + i / spot.w)->period =
			1;
		more += d;
	}
	film->units += more;
	return more;
}

void film_add(struct film *film, const double px[2], double radius_mm, int64_t units)
{
	struct spot spot;
	double sum = 0;
	int64_t given = 0;

	if (!spot_at(film, px, radius_mm, &spot)) {
		film->off_units += units;
		return;
	}
	for (int i = 0; i < spot.w * spot.h; i++) {
		int64_t part;
		size_t at;

		/* What has been given so far, rounded: no unit is lost. */
		sum += film->height[i];
		part = (int64_t)((double)units * fmin(sum / spot.sum, 1)) - given;
		if (part <= 0)
			continue;
		given += part;
		if (!texel_of(film, &spot, i, &at) || part > UINT32_MAX / 2 ||
		    film->volume[at] > UINT32_MAX / 2) {
			film->off_units += part;
			continue;
		}
		film_put(film, at, (uint32_t)part);
		film_wake(film, spot.left + i % spot.w, spot.top + i / spot.w)->period =
			1;
		film->units += part;
	}
	film->off_units += units - given;
}
