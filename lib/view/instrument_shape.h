/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Meshes of the instruments: scalpel, with its handle, and tube. In mm, in a frame of their own:
 *
 *      z ▲ ▓ end of the handle, z = handle_mm      z ▲  █ connector
 *        │ ▓                                         │ ▄█▄▄▄▄▄▄ flange, wide along ±y,
 *        │ ▓ flat side to ±y                         │  ┃       bent down to the neck
 *        │ ▌╲ edge of the blade to +x                │  ┃ inserted part
 *        ○───▶ x, tip at 0                           ○───▶ x, end at 0
 */
#ifndef INCISE_VIEW_INSTRUMENT_SHAPE_H
#define INCISE_VIEW_INSTRUMENT_SHAPE_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/plan.h>

struct instrument_vertex {
	float position_mm[3], normal[3];
	float rgb[3]; /* sRGB 0 … 1 */
	float metal;  /* 0 plastic … 1 steel */
};

struct instrument_mesh {
	int n_vertices, n_indices;
	struct instrument_vertex *vertices;
	uint32_t *indices; /* triangles, counter-clockwise from outside */
};

/* The lower side of a tube's flange from its end. */
#define INSTRUMENT_FLANGE_MM 20.0

/* A few hundred triangles; to be freed. 0, -ENOMEM with an empty mesh. */
int instrument_scalpel(const struct incise_scene_scalpel *scalpel,
		       struct instrument_mesh *mesh);

/* tube_mm: diameter of the inserted part, up to the connector's, 15 mm. */
int instrument_tube(double tube_mm, struct instrument_mesh *mesh);
void instrument_free(struct instrument_mesh *mesh);

/* The frame of an instrument: columns x, y, z, origin. */
struct instrument_place {
	double x[3], y[3], z[3], origin_mm[3];
	bool tube; /* else the scalpel */
};

/*
 * From a tick: the scalpel's tip and attitude are the pose's; the tube's end is the tool's place.
 * False: no attitude yet, or values that are not finite or too large.
 */
bool instrument_place(const struct incise_scene_scalpel *scalpel,
		      const struct incise_tick *tick, struct instrument_place *place);

#endif
