/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The shaders, as text, and programs of them. Colours are light in them: sRGB of 8 bits is
 * squared on the way in and its root taken on the way out, which is near enough to sRGB's
 * own curve, and a tenth of the cost where a CPU draws.
 */
#ifndef INCISE_VIEW_SHADERS_H
#define INCISE_VIEW_SHADERS_H

#include <incise/error.h>

/* How many pieces of an instrument throw a shadow. */
#define SHADERS_CASTERS 4

extern const char *const incise_shader_surface_vs;
extern const char *const incise_shader_surface_fs;
extern const char *const incise_shader_instrument_vs;
extern const char *const incise_shader_instrument_fs;
extern const char *const incise_shader_ground_vs;
extern const char *const incise_shader_ground_fs;
extern const char *const incise_shader_image_vs;
extern const char *const incise_shader_image_fs;

/* Attributes in_0, in_1 … are bound to these numbers. 0 and errno EIO when it fails. */
unsigned incise_shader_program(const char *what, const char *vs, const char *fs,
			       struct incise_error *err);

#endif
