/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Pixels into a PNG file, by libpng.
 */
#ifndef INCISE_PNG_FILE_H
#define INCISE_PNG_FILE_H

#include <stdint.h>
#include <incise/error.h>

/* Whole, or not under its name. @rgb: rows from the top. 0 or a negative errno. */
int png_file_write(const char *path, const uint8_t *rgb, int width, int height,
		   struct incise_error *err);

#endif
