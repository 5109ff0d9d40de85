/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Blood as colour: by how thick it is and how dry.
 *
 * Light that goes through blood and back is absorbed by Beer and Lambert: a film lets
 * skin through, tinted, a drop nothing. Alpha is 1 - exp(-h / h0), the colour goes from a
 * light red to a dark one; as it dries to brown, which begins where it is thin: at edges.
 *
 * The height of a drop is added to that of the film below it, and goes to zero smoothly:
 * there is no seam between a drop and its trail.
 */
#ifndef INCISE_VIEW_BLOOD_PAINT_H
#define INCISE_VIEW_BLOOD_PAINT_H

#include "blood_drop.h"
#include "blood_film.h"
#include "canvas.h"

void blood_paint_layer(struct film *film, const struct drops *drops,
		       struct incise_canvas *canvas, int layer);

#endif
