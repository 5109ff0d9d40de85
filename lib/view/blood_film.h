/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The film of blood on the surface: trails of drops, and the wet wound. Each texel has a volume
 * and a dryness.
 *
 * Volumes are whole units of BLOOD_UNIT_UL, so that rounding neither loses nor creates any: an
 * amount that is taken from one place is added to another.
 *
 * A film thins as it drains (Nusselt: on a slope of sine s a film of thickness h moves at
 * rho g h² s / (3 mu) on average) into wet texels: its edge on dry skin is pinned. As it dries and
 * clots mu grows, until it stands.
 *
 * Tiles without blood cost nothing; tiles without flow or drying sleep.
 */
#ifndef INCISE_VIEW_BLOOD_FILM_H
#define INCISE_VIEW_BLOOD_FILM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/scene.h>
#include "canvas.h"
#include "ground.h"
#include "uv_map.h"

#define BLOOD_UNIT_UL 1e-7
#define FILM_TEXELS (CANVAS_TILE * CANVAS_TILE)
#define FILM_DRY 255
#define FILM_CLOT 110 /* from this dryness on it stands */

/* Edges of drops and films follow the skin's roughness: its length, and the effect. */
#define FILM_ROUGH_KEY 0x736b696e
#define FILM_ROUGH_MM 2.4f
#define FILM_ROUGH 0.2f

/* Values of a tile's middle, for all of its texels. */
struct film_tile {
	bool known, there; /* the rest is set; there is a surface */
	bool awake;	   /* something flows or dries */
	uint8_t period;	   /* rounds between two visits: more where less flows */
	uint32_t last;	   /* round of the last one */
	float area_mm2, texel_mm, slope;
	float down_px[2]; /* unit, texels; 0 where level */
};

struct film {
	const struct uv_map *map;
	double gravity[3];
	double drain; /* rho g / (3 mu), 1/(mm s) */
	int size;
	uint32_t *volume; /* units, tile after tile */
	uint8_t *dry;	  /* 0 … FILM_DRY, the same */
	struct film_tile *tile;
	struct canvas_tiles tiles; /* to be painted */
	uint64_t step;
	int next;		  /* tile to begin with */
	float *height;		  /* of a spot */
	int64_t units, off_units; /* in the film; ran off the texture */
};

bool film_init(struct film *film, const struct uv_map *map,
	       const struct incise_scene_picture *picture);
void film_free(struct film *film);

/* The tile of a texel; never NULL within the texture. */
const struct film_tile *film_tile(struct film *film, int x, int y);

/* The place of a texel, tile after tile. */
static inline size_t film_index(const struct film *film, int x, int y)
{
	return ((size_t)(y / CANVAS_TILE) * film->tiles.side + x / CANVAS_TILE) *
		       FILM_TEXELS +
	       y % CANVAS_TILE * CANVAS_TILE + x % CANVAS_TILE;
}

/* Thickness, mm; 0 outside of the texture. */
double film_thickness_mm(struct film *film, double x, double y);

/*
 * Bring a round spot closer to a thickness, highest in its middle: by the part @share of the lack,
 * or of the excess that is still wet. Returns the change in units, at most @most.
 */
int64_t film_level(struct film *film, const double px[2], double radius_mm,
		   double thickness_mm, double share, int64_t most);

/* Put all of a volume into a round spot. */
void film_add(struct film *film, const double px[2], double radius_mm, int64_t units);

/* 10 ms: some of the tiles drain and dry. */
void film_step(struct film *film);

#endif
