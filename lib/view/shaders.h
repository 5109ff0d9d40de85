/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The programs of the graphics. Their colours are linear light: sRGB of 8 bits is squared on the way
 * in and its root taken on the way out, which is close to sRGB's own curve, at a tenth of the cost
 * where a CPU draws.
 */
#ifndef INCISE_VIEW_SHADERS_H
#define INCISE_VIEW_SHADERS_H

#include <incise/error.h>

/* Maximum number of pieces of an instrument that cast a shadow. */
#define SHADERS_CASTERS 4

enum shader { SHADER_SURFACE, SHADER_INSTRUMENT, SHADER_GROUND, SHADER_IMAGE, SHADERS };

/* A program whose attributes in_0, in_1 … have these numbers. 0 and errno EIO when it fails. */
unsigned shader_program(enum shader shader, struct incise_error *err);

#endif
