/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The interface of a module for films, exported as the symbol `incise_film_module`.
 */
#ifndef INCISE_VIEW_FILM_H
#define INCISE_VIEW_FILM_H

#include <stdbool.h>
#include <incise/film.h>

#define INCISE_FILM_ABI 2
#define INCISE_FILM_SYMBOL "incise_film_module"

struct incise_film_coder;

struct incise_film_module {
	int abi;
	/* As in incise/film.h, but writes to the path itself, MP4 if @mp4. */
	struct incise_film_coder *(*open)(const char *path, bool mp4, int width,
					  int height, int rate_hz,
					  struct incise_error *err);
	int (*add)(struct incise_film_coder *coder, const uint8_t *rgb,
		   struct incise_error *err);
	/* Frees it. */
	int (*close)(struct incise_film_coder *coder, struct incise_error *err);
};

#endif
