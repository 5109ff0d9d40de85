/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside a picture: what its parts are, and how they are drawn into the target.
 */
#ifndef INCISE_VIEW_DRAW_PARTS_H
#define INCISE_VIEW_DRAW_PARTS_H

#include "draw.h"
#include "eye.h"
#include "instrument.h"
#include "solid.h"
#include "target.h"
#include "texture.h"

#define DRAW_SLOTS 4

/* Towards the lamp: from the left and high, so that shadows and shine are seen from in front. */
static const double draw_key_way[3] = {-0.62, 0.12, 0.78};

struct incise_draw {
	struct incise_solid surface, scalpel, tube;
	unsigned skin, metal, ground, image; /* programs */
	struct incise_texture *texture;
	double way[2]; /* to the lamp, in texels */
	struct {
		unsigned texture;
		uint64_t version;
		int w, h;
	} slot[DRAW_SLOTS];
	unsigned nothing; /* array without attributes */
	struct incise_target target;
	struct incise_scene_scalpel tool;
	enum incise_skin look;
	double middle_mm[3], reach_mm; /* a ball round the surface */
	char renderer[128];
	bool drawn;
};

/* @place NULL: no instrument throws a shadow. */
void incise_draw_surface(struct incise_draw *draw, const struct incise_eye *eye,
			 const struct incise_instrument_place *place);
void incise_draw_instrument(struct incise_draw *draw, const struct incise_eye *eye,
			    const struct incise_instrument_place *place);

#endif
