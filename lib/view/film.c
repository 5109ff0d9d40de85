// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A film: its module, and the name of its file; see incise/film.h.
 */
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "../base/module.h"
#include "film.h"

struct incise_film {
	const struct incise_film_module *module;
	struct incise_film_coder *coder;
	char *path;  /* where it leads, if it is a link */
	char *part;  /* of its name until it ends; the same as path if that is direct */
	bool direct; /* a pipe or a device: written in place */
	uint64_t frames;
	int failed;
};

/* The module stays loaded. */
static const struct incise_film_module *load_film(struct incise_error *err)
{
	return incise_module_load("film_mkv.so", INCISE_FILM_SYMBOL, INCISE_FILM_ABI,
				  "film", err);
}

/* Keeps errno. */
static void forget(struct incise_film *film)
{
	if (!film)
		return;
	free(film->path);
	free(film->part);
	free(film);
}

static int name_files(struct incise_film *film, const char *path)
{
	struct stat st;

	film->direct = !stat(path, &st) && !S_ISREG(st.st_mode) && !S_ISDIR(st.st_mode);
	film->path = realpath(path, NULL);
	if (!film->path || film->direct) {
		free(film->path);
		film->path = strdup(path);
	}
	if (film->path && film->direct)
		film->part = strdup(film->path);
	else if (film->path && asprintf(&film->part, "%s.part", film->path) < 0)
		film->part = NULL;
	return film->part ? 0 : -ENOMEM;
}

struct incise_film *incise_film_new(const char *path, int width, int height, int rate_hz,
				    struct incise_error *err)
{
	const char *dot = strrchr(path, '.');
	struct incise_film *film;

	if (width < 16 || height < 16 || width > INCISE_FILM_SIDE_MAX ||
	    height > INCISE_FILM_SIDE_MAX || width % 2 || height % 2 || rate_hz < 1 ||
	    rate_hz > 1000)
		return INCISE_ERROR_NULL(
			err, EINVAL,
			"%.300s: film of %d x %d at %d Hz: expected even sides from 16 "
			"to %d and 1 to 1000 Hz",
			path, width, height, rate_hz, INCISE_FILM_SIDE_MAX);
	film = calloc(1, sizeof(*film));
	if (!film)
		goto no_memory;
	if (name_files(film, path))
		goto no_memory;
	film->module = load_film(err);
	if (film->module)
		film->coder = film->module->open(film->part, dot && !strcmp(dot, ".mp4"),
						 width, height, rate_hz, err);
	if (film->coder)
		return film;
	forget(film);
	return NULL;
no_memory:
	forget(film);
	return INCISE_ERROR_NULL(err, ENOMEM, "no memory for a film");
}

int incise_film_add(struct incise_film *film, const uint8_t *rgb,
		    struct incise_error *err)
{
	if (film->failed)
		return incise_error_set(err, -film->failed,
					"%s: the film has ended with an error",
					film->path);
	film->failed = film->module->add(film->coder, rgb, err);
	film->frames += !film->failed;
	return film->failed;
}

int incise_film_close(struct incise_film *film, struct incise_error *err)
{
	int rc;

	if (!film)
		return 0;
	rc = film->module->close(film->coder, err);
	if (!rc && film->failed)
		rc = incise_error_set(err, -film->failed,
				      "%s: the film has ended with an error", film->path);
	if (!rc && !film->direct && film->frames && rename(film->part, film->path))
		rc = incise_error_set(err, errno, "%s: %s", film->path, strerror(errno));
	if (!film->direct && (rc || !film->frames))
		unlink(film->part);
	forget(film);
	return rc;
}

void incise_film_drop(struct incise_film *film)
{
	if (!film)
		return;
	film->module->close(film->coder, NULL);
	if (!film->direct)
		unlink(film->part);
	forget(film);
}
