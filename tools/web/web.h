/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A file as the viewer in a browser shows it (viewer.html, .css, .js): of a server, or as one page.
 *
 *     NAME.rec ─────┐            ┌── head: panels, tracks, cuts, events, facts ──┐
 *     NAME.session ─┼─ web_file ─┼── part: tracks from .. to, in columns ────────┼─▶ JSON
 *     MODEL.fis ────┘            └── frame: pixels ──────────────────────────────┘
 *
 * A recording is read once into least and largest values of 2^18 spans, so that any part of it is at
 * hand whatever its length; below two spans a column, its rows themselves are read. web_read() is for
 * a thread of its own; web_head() and web_part() may run beside it, and web_frame() in one thread.
 */
#ifndef INCISE_TOOLS_WEB_H
#define INCISE_TOOLS_WEB_H

#include <jansson.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <incise/error.h>
#include "../cli/pixels.h"

#define WEB_COLUMNS_MAX 4000
#define WEB_FRAME_WIDTH 480 /* pixels; wider ones are reduced */

struct web_file;

/* Open a file by its kind, or fail the program. web_close(). */
struct web_file *web_open(const char *path);

/* Read what it holds; a recording in so many spans. 0, -ECANCELED (@stop), or -errno. */
int web_read(struct web_file *file, int spans, const volatile sig_atomic_t *stop,
	     struct incise_error *err);

/* Share that is read, 0 to 1. */
double web_done(struct web_file *file);

/* The head: all that the page has to know once, and again when the file is read. */
json_t *web_head(struct web_file *file);

/* An object of JSON: each track in columns, or in samples where they are fewer. 0 or -errno. */
int web_part(struct web_file *file, double from, double to, int columns, FILE *out,
	     struct incise_error *err);

/* The frame nearest to a time, reduced, and its time. 0, -ENODATA: there are none; -errno. */
int web_frame(struct web_file *file, double *t_s, struct pixels *pixels,
	      struct incise_error *err);

void web_close(struct web_file *file);

/* Drop rows and columns of pixels until the width is at most WEB_FRAME_WIDTH. */
void web_reduce(struct pixels *pixels);

/* The page: @file's data within it, or NULL: of a server. free(3). */
char *web_page(struct web_file *file, size_t *size, struct incise_error *err);

/* --- inside: kinds of files ---------------------------------------------------------------- */

struct web_kind {
	int (*read)(struct web_file *file, int spans, const volatile sig_atomic_t *stop,
		    struct incise_error *err);
	double (*done)(struct web_file *file);
	json_t *(*head)(struct web_file *file);
	int (*part)(struct web_file *file, double from, double to, int columns, FILE *out,
		    struct incise_error *err);
	int (*frame)(struct web_file *file, double *t_s, struct pixels *pixels,
		     struct incise_error *err);
	void (*close)(struct web_file *file);
};

struct web_file {
	const struct web_kind *kind;
	const char *path;
};

struct web_file *web_recording_open(const char *path);
struct web_file *web_session_open(const char *path);
struct web_file *web_model_open(const char *path);

/* Start an object of a head: kind, title, axis and its ends. */
json_t *web_head_new(const char *kind, const char *path, const char *axis,
		     const char *unit, double from, double to);

/* Add a panel with the next tracks, whose names are in @labels with '|' between. */
void web_head_panel(json_t *head, const char *label, const char *unit,
		    const char *labels);

/* --- inside: values over an axis ----------------------------------------------------------- */

/* Least and largest values of equal spans; and the first samples as they are. */
struct web_series {
	double from, to;
	int n;		   /* spans */
	float *low, *high; /* low > high: no value */
	int samples, room; /* of the next; samples > room: there were more */
	double *x;
	float *y; /* NAN: a gap */
};

void web_series_init(struct web_series *series, double from, double to, int n, int room);
/* A value, of a time that may be out of the range; NAN: a gap. */
void web_series_add(struct web_series *series, double x, double y);
void web_series_free(struct web_series *series);

/* The standard uncertainty of a value; NAN: not known. */
typedef double web_u(const void *of, double y);

/*
 * An object of JSON for the values from .. to: samples if they are no more than @columns, else columns. @u may be
 * NULL.
 */
void web_series_put(const struct web_series *series, double from, double to, int columns,
		    web_u *u, const void *of, FILE *out);

#endif
