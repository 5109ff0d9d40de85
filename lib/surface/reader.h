/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Readers of mesh files.
 */
#ifndef INCISE_READER_H
#define INCISE_READER_H

#include "mesh.h"

/* NULL with errno as in incise_surface_load_mesh(). */
struct mesh *obj_load(const char *path, const double at_mm[3], struct incise_error *err);
struct mesh *height_grid_load(const char *path, const double at_mm[3],
			      struct incise_error *err);

#endif
