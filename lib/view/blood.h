/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Blood from fresh cuts: sources along them, drops, films.
 *
 *     strokes of the blade ─▶ sources ─▶ wet the cut, then drops ─▶ films ─▶ dry
 *                                        run downhill, merge
 *
 * A stretch of a cut that is L long and D deep in what was whole bleeds k L D µl/s; that falls
 * to a third in BLOOD_CLOT_S as it clots. Where an instrument is put in, it opens again. Each
 * source stands for some mm of a cut, and its drop hangs at a random place of them.
 *
 * All of it moves in steps of 10 ms, by the steps alone. Volumes are whole units
 * (blood_film.h): what was emitted is in drops, in films or off the texture, exactly.
 */
#ifndef INCISE_VIEW_BLOOD_H
#define INCISE_VIEW_BLOOD_H

#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/scene.h>
#include "canvas.h"
#include "uv_map.h"
#include "wound.h"

#define BLOOD_CLOT_S 18.0
#define BLOOD_SOURCES_MAX 256

struct blood;

struct blood *blood_new(const struct uv_map *map,
			const struct incise_scene_picture *picture,
			struct incise_error *err);

/* A cut got longer. */
void blood_stroke(struct blood *blood, const struct wound_stroke *stroke);

/* An instrument is in the tissue: for each step in which it is. */
void blood_reopen(struct blood *blood, const double px[2], double depth_mm);

void blood_step(struct blood *blood);
void blood_paint(struct blood *blood, struct incise_canvas *canvas, int layer);

struct blood_volumes {
	int64_t emitted, drops, films, off; /* units */
	int n_drops;
};
void blood_volumes(const struct blood *blood, struct blood_volumes *volumes);

/* Where drop @index is, texels, and its volume, µl; false: there is none. For tests. */
bool blood_drop(const struct blood *blood, int index, double px[2], double *ul);

size_t blood_memory(const struct blood *blood);
void blood_free(struct blood *blood);

#endif
