// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * How films drain and dry; see blood_film.h.
 */
#include <math.h>
#include "blood_film.h"

/*
 * A round is so many steps; in each step some of the tiles are due. A tile in which much
 * flows is visited in each round, others in each fourth or tenth, for as much longer.
 */
#define ROUND_S (FILM_ROUND_STEPS * 0.01)
#define ROUNDS_MOST 10
/* In a step, so that there is an end to its time however much blood there is. */
#define VISITS_MOST 24
/* No texel gives more than that part of itself in a visit: the scheme is explicit. */
#define FLOW_MOST 0.4
/* With less in a round it is not visited in each, or each fourth. */
#define FLOW_MUCH 0.05
#define FLOW_SOME 0.012
/* Slower than that it is not seen. */
#define FLOW_LEAST 0.0002
/* Where it flows to it may become so many times thicker than where it comes from. */
#define PILES_UP 1.06
#define EDGE_MM 0.012
/* Less than that part of a texel does not move: it would not be seen. */
#define FLOW_UNSEEN 0.01
/* Sideways it levels by this part of the difference, where it is thicker than that. */
#define LEVELS 0.12
#define LEVELS_MM 0.02
/* Thinner than this, mm, it dries three times as fast; than that, twice. */
#define THIN_MM 0.02
#define MEDIUM_MM 0.06

/* Beside dry skin: there a film is thin, as its angle to the skin is no right one. */
static bool at_edge(const struct film *film, int x, int y)
{
	return (x > 0 && !film->volume[film_index(film, x - 1, y)]) ||
	       (x + 1 < film->size && !film->volume[film_index(film, x + 1, y)]) ||
	       (y > 0 && !film->volume[film_index(film, x, y - 1)]) ||
	       (y + 1 < film->size && !film->volume[film_index(film, x, y + 1)]);
}

/* Give some of a texel to the one beside it, if that is wet: else its edge is pinned. */
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
	/* Where the film runs it is as dry as the wetter of the two. */
	if (film->dry[from] < film->dry[to])
		film_put(film, to, (uint32_t)units);
	else
		film->volume[to] += (uint32_t)units;
	film_wake(film, x, y);
	return true;
}

/* Surface tension levels what has run together: to a neighbour that is thinner. */
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

/* Which way is down over a tile: in its corners, and so between them. */
struct fall {
	float x[2][2], y[2][2]; /* texels, sine of the slope long; [down][right] */
};

/* A corner of tiles falls as the mean of those around it: what is beside it sees the same. */
static void fall_at(struct film *film, int column, int row, float *x, float *y)
{
	int n = 0;

	*x = *y = 0;
	for (int i = 0; i < 4; i++) {
		int c = column - 1 + i % 2, r = row - 1 + i / 2;
		const struct film_tile *tile;

		if (c < 0 || r < 0 || c >= film->tiles || r >= film->tiles)
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
		fall_at(film, number % film->tiles + i % 2, number / film->tiles + i / 2,
			&fall->x[i / 2][i % 2], &fall->y[i / 2][i % 2]);
}

static float between(const float corner[2][2], float u, float v)
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

static void drain_texel(struct visit *visit, int x, int y, size_t at)
{
	struct film *film = visit->film;
	float u = ((float)(x % CANVAS_TILE) + 0.5f) / CANVAS_TILE;
	float v = ((float)(y % CANVAS_TILE) + 0.5f) / CANVAS_TILE;
	float dx, dy, ax, ay;
	double thick, speed, part, clot;

	if (film->dry[at] >= FILM_CLOT)
		return;
	dx = between(visit->fall.x, u, v);
	dy = between(visit->fall.y, u, v);
	ax = fabsf(dx);
	ay = fabsf(dy);
	thick = film->volume[at] * BLOOD_UNIT_UL / visit->tile->area_mm2;
	clot = 1 - (double)film->dry[at] / FILM_CLOT;
	speed = film->drain * thick * thick * clot * clot * sqrtf(dx * dx + dy * dy);
	part = fmin(speed * ROUND_S / visit->tile->texel_mm, 1);
	if (!(part > FLOW_LEAST) || !(ax + ay > 0))
		return;
	part = fmin(part * visit->rounds, FLOW_MOST) * film->volume[at];
	ax /= ax + ay;
	visit->changed |= flow(film, at, dx > 0 ? x + 1 : x - 1, y, part * ax);
	visit->changed |= flow(film, at, x, dy > 0 ? y + 1 : y - 1, part * (1 - ax));
	visit->fastest = fmax(visit->fastest, part / (film->volume[at] + part + 1));
	if (thick < LEVELS_MM)
		return;
	if (ax < 0.5f) {
		visit->changed |= level(film, at, x + 1, y);
		visit->changed |= level(film, at, x - 1, y);
	} else {
		visit->changed |= level(film, at, x, y + 1);
		visit->changed |= level(film, at, x, y - 1);
	}
}

/* Returns whether a texel is still on its way to being dry. times: 0.8 s each. */
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

/* Downhill texels first, so that what flows is not carried through a whole tile at once. */
static void visit_tile(struct film *film, int number, uint32_t round)
{
	int x0 = number % film->tiles * CANVAS_TILE,
	    y0 = number / film->tiles * CANVAS_TILE;
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

/* Its turn has come, or has passed. */
static bool due(const struct film *film, int number, uint32_t round, int turn)
{
	const struct film_tile *tile = &film->tile[number];
	uint32_t since = round - tile->last;

	if (!tile->awake || since < tile->period)
		return false;
	return since > tile->period ||
	       (number + number / film->tiles * 2) % FILM_ROUND_STEPS == turn;
}

void film_step(struct film *film)
{
	int n = film->tiles * film->tiles, turn = (int)(film->step % FILM_ROUND_STEPS);
	int at = film->next, visits = 0;
	uint32_t round = film_round(film);

	/* Those for which there is no time wait, and are visited for as much longer. */
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
