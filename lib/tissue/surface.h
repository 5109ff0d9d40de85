/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What is behind struct incise_surface. A sphere is kept as a capsule, a height field as
 * a mesh.
 */
#ifndef INCISE_TISSUE_SURFACE_H
#define INCISE_TISSUE_SURFACE_H

#include "mesh.h"
#include "shape.h"

struct incise_surface {
	enum incise_surface_kind kind;
	struct plane plane;
	struct capsule capsule;
	struct mesh *mesh; /* or NULL */
};

#endif
