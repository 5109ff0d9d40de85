/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A film for viewing, H.264 by libavcodec's libx264: MP4, or Matroska, which without that encoder
 * has MJPEG. Compression is lossy: keep measurements in recordings. Part of libincise-view; the
 * first call loads a module on libavformat, incise/film_mkv.so.
 */
#ifndef INCISE_FILM_H
#define INCISE_FILM_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

struct incise_film;

/** Largest width and height, pixels. */
#define INCISE_FILM_SIDE_MAX 8192

/**
 * Start a film at PATH.part; PATH is unchanged until incise_film_close().
 *
 * @param path          ends with .mp4: MP4; else Matroska
 * @param width, height even, 16 … INCISE_FILM_SIDE_MAX
 * @param rate_hz       frames per second, 1 … 1000; whole
 * @return film; NULL with errno EINVAL, ENOENT, ENOEXEC (the module), ENOTSUP (no encoder for it),
 *         ENOMEM, errno of open(2)
 */
INCISE_API struct incise_film *incise_film_new(const char *path, int width, int height,
					       int rate_hz, struct incise_error *err);

/**
 * Add a frame.
 * @param rgb rows from the top, 3 bytes a pixel, without padding
 * @return 0; -EIO, -ENOSPC: no more frames can be added
 */
INCISE_API int incise_film_add(struct incise_film *film, const uint8_t *rgb,
			       struct incise_error *err);

/**
 * End the film, rename it to PATH, replacing a file there, and free it. Without a frame, or
 * after an error, no file remains.
 *
 * @param film NULL is accepted
 * @return 0; the error that ended it, or of writing the remaining frames
 */
INCISE_API int incise_film_close(struct incise_film *film, struct incise_error *err);

/** Discard and free the film; no file remains. */
INCISE_API void incise_film_drop(struct incise_film *film);

INCISE_END_DECLS
#endif
