/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Made-up pictures of every format, each known from its number, and a folder for files.
 */
#ifndef TESTS_FRAMES_FILM_H
#define TESTS_FRAMES_FILM_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../../../lib/record/frames.h"

#define FILM_FROM_NS 5000000000LL /* of the clock, when the first is taken */
#define FILM_STEP_NS 16666667LL

/* The same bytes for the same number: smooth in places, noise in others. */
static inline uint8_t film_byte(uint64_t n, size_t i)
{
	uint64_t x = (n + 1) * 0x9e3779b97f4a7c15ULL + i * 0xbf58476d1ce4e5b9ULL;

	x ^= x >> 29;
	x *= 0x94d049bb133111ebULL;
	return (uint8_t)(i / 64 % 2 ? x >> 56 : i / 7 + n);
}

/*
 * Picture @n. Rows are @pad bytes longer than their pixels. An "MJPEG" one is of any length
 * and of bytes that no decoder would take: they must come back all the same.
 */
static inline struct incise_camera_frame film_frame(const struct incise_frames_shape *s,
						    uint64_t n, int pad, uint8_t *bytes)
{
	struct incise_camera_frame frame = {
		.t_ns = FILM_FROM_NS + (int64_t)n * FILM_STEP_NS,
		.seq = n,
		.width = s->width,
		.height = s->height,
		.pixels = s->pixels,
		.data = bytes,
	};

	if (s->pixels == INCISE_PIXELS_MJPEG) {
		frame.size = 1 + (n * 977) % 5000;
	} else {
		frame.stride = (int)incise_frames_row(s->pixels, s->width) + pad;
		frame.size = (size_t)frame.stride * (size_t)s->height;
	}
	for (size_t i = 0; i < frame.size; i++)
		bytes[i] = film_byte(n, i);
	return frame;
}

/* A new folder; the path of the file in it. */
static inline void film_path(char *path, size_t size)
{
	char folder[] = "/tmp/incise-film-XXXXXX";

	if (!mkdtemp(folder))
		abort();
	snprintf(path, size, "%s/camera.mkv", folder);
}

static inline void film_remove(char *path)
{
	unlink(path);
	*strrchr(path, '/') = '\0';
	rmdir(path);
}

#endif
