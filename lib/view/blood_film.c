// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The film of blood on the surface: spots that are added, and its draining and drying; see
 * blood_film.h.
 */
#include <math.h>
#include <stdlib.h>
#include "blood_film.h"
#include "noise.h"

/* Numbers of blood: kg/mm³, and mm/s². */
#define RHO 1.06e-6
#define GRAVITY_MM_S2 9810.0
/* No spot is wider, texels. */
#define FILM_SPOT_PX 320
/* A spot ignores differences below this part of its height. */
#define UNSEEN 0.03

static bool film_inside(const struct film *film, int x, int y)
{
	return x >= 0 && y >= 0 && x < film->size && y < film->size;
}

bool film_init(struct film *film, const struct uv_map *map,
	       const struct incise_scene_picture *picture)
{
	size_t texels = (size_t)map->size * map->size;
	size_t tiles = texels / FILM_TEXELS;

	*film = (struct film){.map = map, .size = map->size};
	for (int i = 0; i < 3; i++)
		film->gravity[i] = picture->gravity[i];
	/* mPa s are 1e-6 kg/(mm s). */
	film->drain = RHO * GRAVITY_MM_S2 / (3 * picture->viscosity_mPa_s * 1e-6);
	/* From calloc: unwritten pages take no memory. */
	film->volume = calloc(texels, sizeof(*film->volume));
	film->dry = calloc(texels, sizeof(*film->dry));
	film->tile = calloc(tiles, sizeof(*film->tile));
	film->height = malloc(FILM_SPOT_PX * FILM_SPOT_PX * sizeof(*film->height));
	return film->height && film->volume && film->dry && film->tile &&
	       canvas_tiles_init(&film->tiles, film->size);
}

void film_free(struct film *film)
{
	free(film->volume);
	free(film->dry);
	free(film->tile);
	free(film->tiles.dirty);
	free(film->height);
}

static void learn_tile(struct film *film, struct film_tile *tile, int number)
{
	double px[2] = {(number % film->tiles.side + 0.5) * CANVAS_TILE,
			(number / film->tiles.side + 0.5) * CANVAS_TILE};
	struct ground ground;
	double length;

	tile->known = true;
	tile->area_mm2 = 0.01f;
	tile->texel_mm = 0.1f;
	tile->there = ground_at(film->map, film->gravity, px, &ground);
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
	int number = y / CANVAS_TILE * film->tiles.side + x / CANVAS_TILE;
	struct film_tile *tile = &film->tile[number];

	if (!tile->known)
		learn_tile(film, tile, number);
	return tile;
}

double film_thickness_mm(struct film *film, double x, double y)
{
	/* NaN is outside, too. */
	if (!(x >= 0 && y >= 0 && x < film->size && y < film->size))
		return 0;
	return film->volume[film_index(film, (int)x, (int)y)] * BLOOD_UNIT_UL /
	       film_tile(film, (int)x, (int)y)->area_mm2;
}

/* Steps in which each busy tile is visited once. */
#define FILM_ROUND_STEPS 8

static uint32_t film_round(const struct film *film)
{
	return (uint32_t)(film->step / FILM_ROUND_STEPS);
}

/* Something changed at a texel: its tile is to be painted and visited. */
static struct film_tile *film_wake(struct film *film, int x, int y)
{
	int number = y / CANVAS_TILE * film->tiles.side + x / CANVAS_TILE;
	struct film_tile *tile = &film->tile[number];

	if (!tile->awake) {
		tile->awake = true;
		tile->period = 1;
		tile->last = film_round(film);
	}
	canvas_tiles_mark(&film->tiles, number);
	return tile;
}

/* Fresh blood on old wets it again. */
static void film_put(struct film *film, size_t at, uint32_t units)
{
	uint32_t was = film->volume[at];

	film->dry[at] =
		(uint8_t)(film->dry[at] * (uint64_t)was / ((uint64_t)was + units + 1));
	film->volume[at] = was + units;
}

/* A round spot on the surface, as rows of texels; their heights are in film->height. */
struct spot {
	struct ground_metric metric;
	double area_mm2; /* of a texel */
	double x, y, inverse_mm2;
	int left, top, w, h; /* may lie outside of the texture */
	double sum;	     /* of the heights */
};

/*
 * 1 in the middle, 0 at the edge and outside. The edge follows the skin's roughness.
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

	if (!ground_metric(film->map, px, m))
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

/* The change of a texel, for @units in the spot's middle. */
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

		/* The rounded sum so far: no unit is lost. */
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

/* --- Draining and drying --- */

/*
 * A round is so many steps; in each step some of the tiles are due. A tile with much flow is
 * visited in each round, others every fourth or tenth, for a longer time.
 */
#define ROUND_S (FILM_ROUND_STEPS * 0.01)
#define ROUNDS_MOST 10
/* Per step, which bounds its time for any amount of blood. */
#define VISITS_MOST 14
/* A texel gives at most this part of itself per visit: the scheme is explicit. */
#define FLOW_MOST 0.4
/* Flow per round for visits in each round, and in every fourth: no more than FLOW_MOST in a visit. */
#define FLOW_MUCH 0.1
#define FLOW_SOME 0.04
/* Slower flow is invisible. */
#define FLOW_LEAST 0.0002
/* The target may become this many times thicker than the source. */
#define PILES_UP 1.06
#define EDGE_MM 0.012
/* Less than this part of a texel does not move: it would be invisible. */
#define FLOW_UNSEEN 0.01
/* Sideways levelling, by this part of the difference, of films thicker than this. */
#define LEVELS 0.12
#define LEVELS_MM 0.02
/* Films thinner than these, mm, dry three times and twice as fast. */
#define THIN_MM 0.02
#define MEDIUM_MM 0.06

/* Next to dry skin a film is thin, as it meets the skin at a small angle. */
static bool at_edge(const struct film *film, int x, int y)
{
	return (x > 0 && !film->volume[film_index(film, x - 1, y)]) ||
	       (x + 1 < film->size && !film->volume[film_index(film, x + 1, y)]) ||
	       (y > 0 && !film->volume[film_index(film, x, y - 1)]) ||
	       (y + 1 < film->size && !film->volume[film_index(film, x, y + 1)]);
}

/* Move some of a texel to its neighbour if that is wet; else the edge is pinned. */
static bool flow(struct film *film, size_t from, int x, int y, double units)
{
	double most;
	size_t to;

	if (!(units >= 1))
		return false;
	if (!film_inside(film, x, y)) {
		film->volume[from] -= (uint32_t)units;
		film->units -= (uint32_t)units;
		film->off_units += (uint32_t)units;
		return true;
	}
	to = film_index(film, x, y);
	most = PILES_UP * film->volume[from] - film->volume[to];
	units = fmin(units, 0.5 * most);
	if (at_edge(film, x, y))
		units = fmin(units,
			     EDGE_MM * film_tile(film, x, y)->area_mm2 / BLOOD_UNIT_UL -
				     (double)film->volume[to]);
	if (!film->volume[to] || !(units >= 1 + FLOW_UNSEEN * film->volume[from]))
		return false;
	film->volume[from] -= (uint32_t)units;
	/* A running film is as dry as the wetter of the two. */
	if (film->dry[from] < film->dry[to])
		film_put(film, to, (uint32_t)units);
	else
		film->volume[to] += (uint32_t)units;
	film_wake(film, x, y);
	return true;
}

/* Surface tension levels a film towards a thinner neighbour. */
static bool level(struct film *film, size_t from, int x, int y)
{
	size_t to;

	if (!film_inside(film, x, y))
		return false;
	to = film_index(film, x, y);
	if (film->volume[to] >= film->volume[from])
		return false;
	return flow(film, from, x, y, LEVELS * (film->volume[from] - film->volume[to]));
}

/* Downhill direction in the corners of a tile, interpolated between them. */
struct fall {
	float x[2][2], y[2][2]; /* texels, sine of the slope long; [down][right] */
};

/* The mean of the tiles around a corner, so that neighbours agree. */
static void fall_at(struct film *film, int column, int row, float *x, float *y)
{
	int n = 0;

	*x = *y = 0;
	for (int i = 0; i < 4; i++) {
		int c = column - 1 + i % 2, r = row - 1 + i / 2;
		const struct film_tile *tile;

		if (c < 0 || r < 0 || c >= film->tiles.side || r >= film->tiles.side)
			continue;
		tile = film_tile(film, c * CANVAS_TILE, r * CANVAS_TILE);
		*x += tile->down_px[0] * tile->slope;
		*y += tile->down_px[1] * tile->slope;
		n++;
	}
	*x /= (float)n;
	*y /= (float)n;
}

static void fall_of(struct film *film, int number, struct fall *fall)
{
	for (int i = 0; i < 4; i++)
		fall_at(film, number % film->tiles.side + i % 2,
			number / film->tiles.side + i / 2, &fall->x[i / 2][i % 2],
			&fall->y[i / 2][i % 2]);
}

static float between_blood_film(const float corner[2][2], float u, float v)
{
	float top = corner[0][0] + u * (corner[0][1] - corner[0][0]);
	float bottom = corner[1][0] + u * (corner[1][1] - corner[1][0]);

	return top + v * (bottom - top);
}

/* A visit to a tile. */
struct visit {
	struct film *film;
	const struct film_tile *tile;
	struct fall fall;
	double rounds;	/* since the last */
	double fastest; /* part of a texel that flowed, in a round */
	bool changed;
};

/* From a texel to its neighbours, @ax of it along the row. Returns whether it changed. */
static bool spill(struct film *film, const float down[2], int x, int y, size_t at,
		  double part, double thick)
{
	float ax = fabsf(down[0]) / (fabsf(down[0]) + fabsf(down[1]));
	bool changed;

	changed = flow(film, at, down[0] > 0 ? x + 1 : x - 1, y, part * ax);
	changed |= flow(film, at, x, down[1] > 0 ? y + 1 : y - 1, part * (1 - ax));
	if (thick < LEVELS_MM)
		return changed;
	if (ax < 0.5f) {
		changed |= level(film, at, x + 1, y);
		changed |= level(film, at, x - 1, y);
	} else {
		changed |= level(film, at, x, y + 1);
		changed |= level(film, at, x, y - 1);
	}
	return changed;
}

static void drain_texel(struct visit *visit, int x, int y, size_t at)
{
	struct film *film = visit->film;
	float u = ((float)(x % CANVAS_TILE) + 0.5f) / CANVAS_TILE;
	float v = ((float)(y % CANVAS_TILE) + 0.5f) / CANVAS_TILE;
	float down[2];
	double thick, speed, part, clot;

	if (film->dry[at] >= FILM_CLOT)
		return;
	down[0] = between_blood_film(visit->fall.x, u, v);
	down[1] = between_blood_film(visit->fall.y, u, v);
	thick = film->volume[at] * BLOOD_UNIT_UL / visit->tile->area_mm2;
	clot = 1 - (double)film->dry[at] / FILM_CLOT;
	speed = film->drain * thick * thick * clot * clot *
		sqrtf(down[0] * down[0] + down[1] * down[1]);
	part = fmin(speed * ROUND_S / visit->tile->texel_mm, 1);
	if (!(part > FLOW_LEAST))
		return;
	part = fmin(part * visit->rounds, FLOW_MOST) * film->volume[at];
	visit->fastest = fmax(visit->fastest, part / (film->volume[at] + 1));
	visit->changed |= spill(film, down, x, y, at, part, thick);
}

/* Returns whether a texel is still drying. times: 0.8 s each. */
static bool dry_texel(struct film *film, const struct film_tile *tile, size_t at,
		      unsigned int times)
{
	unsigned int dry;
	double thick;

	if (!film->volume[at] || film->dry[at] == FILM_DRY)
		return false;
	thick = film->volume[at] * BLOOD_UNIT_UL / tile->area_mm2;
	dry = film->dry[at] + times * (thick < THIN_MM ? 6 : thick < MEDIUM_MM ? 4 : 2);
	film->dry[at] = (uint8_t)(dry < FILM_DRY ? dry : FILM_DRY);
	return true;
}

/* Downhill texels first, so that blood does not cross a whole tile at once. */
static void visit_tile(struct film *film, int number, uint32_t round)
{
	int x0 = number % film->tiles.side * CANVAS_TILE,
	    y0 = number / film->tiles.side * CANVAS_TILE;
	struct film_tile *own = &film->tile[number];
	const struct film_tile *tile = film_tile(film, x0, y0);
	bool left = tile->down_px[0] < 0, up = tile->down_px[1] < 0, drying = false;
	unsigned int dries = round / ROUNDS_MOST - own->last / ROUNDS_MOST;
	struct visit visit = {.film = film, .tile = tile, .rounds = round - own->last};

	if (dries > ROUNDS_MOST)
		dries = ROUNDS_MOST;
	fall_of(film, number, &visit.fall);
	for (int i = 0; i < FILM_TEXELS; i++) {
		int x = i % CANVAS_TILE, y = i / CANVAS_TILE;
		size_t at;

		x = left ? x : CANVAS_TILE - 1 - x;
		y = up ? y : CANVAS_TILE - 1 - y;
		at = (size_t)number * FILM_TEXELS + (size_t)(y * CANVAS_TILE + x);
		if (!film->volume[at])
			continue;
		drain_texel(&visit, x0 + x, y0 + y, at);
		if (dries)
			drying |= dry_texel(film, tile, at, dries);
	}
	visit.fastest /= visit.rounds;
	own->period = visit.fastest > FLOW_MUCH	  ? 1
		      : visit.fastest > FLOW_SOME ? 4
						  : ROUNDS_MOST;
	own->last = round;
	if (visit.changed || drying)
		film_wake(film, x0, y0);
	else if (dries)
		own->awake = false;
}

/* Its turn has come or has passed. */
static bool due(const struct film *film, int number, uint32_t round, int turn)
{
	const struct film_tile *tile = &film->tile[number];
	uint32_t since = round - tile->last;

	if (!tile->awake || since < tile->period)
		return false;
	return since > tile->period ||
	       (number + number / film->tiles.side * 2) % FILM_ROUND_STEPS == turn;
}

void film_step(struct film *film)
{
	int n = film->tiles.side * film->tiles.side,
	    turn = (int)(film->step % FILM_ROUND_STEPS);
	int at = film->next, visits = 0;
	uint32_t round = film_round(film);

	/* Skipped tiles wait, and then drain for a longer time. */
	for (int i = 0; i < n && visits < VISITS_MOST; i++, at++) {
		at = at < n ? at : 0;
		if (!due(film, at, round, turn))
			continue;
		visit_tile(film, at, round);
		visits++;
	}
	film->next = visits < VISITS_MOST ? 0 : at;
	film->step++;
}
