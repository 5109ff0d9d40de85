/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Images of tests: a context or a skip, PNG files by cairo, and similarity of two. */
#ifndef INCISE_TEST_LOOK_H
#define INCISE_TEST_LOOK_H

#include <cairo.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/error.h>
#include "../../../lib/view/egl.h"

/* NULL, with a message: skip the test. */
static inline struct incise_egl *look_context(void)
{
	struct incise_error err = {0};
	struct incise_egl *egl = incise_egl_new(&err);

	if (!egl)
		printf("skipped: %s\n", err.text);
	return egl;
}

static inline bool look_write(const char *path, const uint8_t *rgb, int w, int h)
{
	cairo_surface_t *s = cairo_image_surface_create(CAIRO_FORMAT_RGB24, w, h);
	bool good;

	cairo_surface_flush(s);
	for (int y = 0; y < h; y++) {
		uint32_t *row = (uint32_t *)(cairo_image_surface_get_data(s) +
					     y * cairo_image_surface_get_stride(s));

		for (int x = 0; x < w; x++) {
			const uint8_t *p = rgb + 3 * (y * w + x);

			row[x] = (uint32_t)p[0] << 16 | (uint32_t)p[1] << 8 | p[2];
		}
	}
	cairo_surface_mark_dirty(s);
	good = cairo_surface_write_to_png(s, path) == CAIRO_STATUS_SUCCESS;
	cairo_surface_destroy(s);
	return good;
}

/* NULL: no such file, or another size. */
static inline uint8_t *look_read(const char *path, int w, int h)
{
	cairo_surface_t *s = cairo_image_surface_create_from_png(path);
	uint8_t *rgb = NULL;

	if (cairo_surface_status(s) == CAIRO_STATUS_SUCCESS &&
	    cairo_image_surface_get_width(s) == w &&
	    cairo_image_surface_get_height(s) == h) {
		rgb = malloc((size_t)w * h * 3);
		for (int y = 0; rgb && y < h; y++) {
			const uint32_t *row =
				(const uint32_t *)(cairo_image_surface_get_data(s) +
						   y * cairo_image_surface_get_stride(s));

			for (int x = 0; x < w; x++)
				for (int k = 0; k < 3; k++)
					rgb[3 * (y * w + x) + k] =
						(uint8_t)(row[x] >> (16 - 8 * k));
		}
	}
	cairo_surface_destroy(s);
	return rgb;
}

/*
 * Structural similarity of brightness (Wang, Bovik, Sheikh, Simoncelli 2004, eq. 13), the
 * mean over windows of 8 × 8 pixels, each 4 from the next; 1: the same.
 */
static inline double look_alike(const uint8_t *a, const uint8_t *b, int w, int h)
{
	const double c1 = 0.01 * 0.01 * 255 * 255, c2 = 0.03 * 0.03 * 255 * 255;
	double sum = 0;
	int n = 0;

	for (int y = 0; y + 8 <= h; y += 4)
		for (int x = 0; x + 8 <= w; x += 4) {
			double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;

			for (int i = 0; i < 64; i++) {
				size_t at = 3 * ((size_t)(y + i / 8) * w + x + i % 8);
				double p =
					0.3 * a[at] + 0.59 * a[at + 1] + 0.11 * a[at + 2];
				double q =
					0.3 * b[at] + 0.59 * b[at + 1] + 0.11 * b[at + 2];

				ma += p / 64;
				mb += q / 64;
				aa += p * p / 64;
				bb += q * q / 64;
				ab += p * q / 64;
			}
			sum += (2 * ma * mb + c1) * (2 * (ab - ma * mb) + c2) /
			       ((ma * ma + mb * mb + c1) *
				(aa - ma * ma + bb - mb * mb + c2));
			n++;
		}
	return sum / n;
}

#endif
