// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Pixels into a PNG file; see png_file.h.
 */
#include <errno.h>
#include <stdio.h>
#include <incise/outfile.h>
#include "png_file.h"

#ifdef HAVE_PNG
#include <png.h>

int png_file_write(const char *path, const uint8_t *rgb, int width, int height,
		   struct incise_error *err)
{
	png_image image = {.version = PNG_IMAGE_VERSION,
			   .width = (png_uint_32)width,
			   .height = (png_uint_32)height,
			   .format = PNG_FORMAT_RGB};
	struct incise_outfile *file = incise_outfile_open(path, err);

	if (!file)
		return -errno;
	if (!png_image_write_to_stdio(&image, incise_outfile_stream(file), 0, rgb, 0,
				      NULL)) {
		incise_outfile_abort(file);
		return incise_error_set(err, EIO, "%s: %s", path, image.message);
	}
	return incise_outfile_commit(file, err);
}
#else
int png_file_write(const char *path, const uint8_t *rgb, int width, int height,
		   struct incise_error *err)
{
	(void)rgb, (void)width, (void)height;
	return incise_error_set(err, ENOTSUP,
				"%s: built without PNG: install libpng-dev, build again",
				path);
}
#endif
