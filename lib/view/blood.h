/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Blood from fresh cuts: sources along them, drops, films.
 *
 *     strokes of the blade ─▶ sources ─▶ wet the cut, then drops ─▶ films ─▶ dry
 *                                        run downhill, merge
 *
 * A fresh stretch of a cut, L long and D deep, bleeds k L D µl/s, which falls to a third in
 * BLOOD_CLOT_S as it clots; an inserted instrument reopens it. Each source represents some mm of a
 * cut, and its drop hangs at a random place of them.
 *
 * Blood moves in steps of 10 ms only. Volumes are whole units (blood_film.h): all emitted blood is
 * in drops, in films or off the texture, exactly.
 */
#ifndef INCISE_VIEW_BLOOD_H
#define INCISE_VIEW_BLOOD_H

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

/* A cut became longer. */
void blood_stroke(struct blood *blood, const struct wound_stroke *stroke);

/* For each step in which an instrument is in the tissue. */
void blood_reopen(struct blood *blood, const double px[2], double depth_mm);

void blood_step(struct blood *blood);
void blood_paint(struct blood *blood, struct incise_canvas *canvas, int layer);

struct blood_volumes {
	int64_t emitted, drops, films, off; /* units */
	int n_drops;
};
void blood_volumes(const struct blood *blood, struct blood_volumes *volumes);

/* Place of drop @index, texels, and its volume, µl; false: no such drop. For tests. */
bool blood_drop(const struct blood *blood, int index, double px[2], double *ul);

void blood_free(struct blood *blood);

#endif
