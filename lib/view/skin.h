/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The look of intact tissue: its colour and the fine shape of its surface.
 */
#ifndef INCISE_SKIN_H
#define INCISE_SKIN_H

#include <incise/scene.h>
#include "uv_map.h"

/*
 * Paint a texture of map->size² texels, rows from the top. Sizes (pores, lobules) are in mm by the
 * map's metric; patterns finer than two texels fade away.
 *
 * @rgba        sRGB of 8 bits, opaque
 * @normal_rgb  unit normal (128 + 127 n): red along the vertex's tangent (+px[0]), green
 *              along +px[1], blue outwards; on plain tissue 128, 128, 255
 *
 * The same seed gives the same bytes on one type of machine. Returns 0 or -ENOMEM.
 */
int incise_skin_paint(const struct uv_map *map, enum incise_skin skin, uint64_t seed,
		      uint8_t *rgba, uint8_t *normal_rgb);

#endif
