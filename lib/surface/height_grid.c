// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading an ESRI ASCII grid as a height field: values are heights in mm at the middles
 * of cells, the first row has the largest y. Four neighbouring middles are a square
 * of two triangles.
 *
 *      y ▲   row 0     ●──●──●     xllcenter, yllcenter: the middle ● of the lower left
 *        │             │╲ │╲ │     cell; xllcorner, yllcorner: half a cell less
 *        │             │ ╲│ ╲│
 *        │  last row   ●──●──●
 *        └───────▶ x
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include "../base/text.h"
#include "mesh.h"

enum key { NCOLS, NROWS, XLL_CORNER, XLL_CENTER, YLL_CORNER, YLL_CENTER, CELL, NODATA };

static const char *const keys[] = {
	[NCOLS] = "ncols",	    [NROWS] = "nrows",
	[XLL_CORNER] = "xllcorner", [XLL_CENTER] = "xllcenter",
	[YLL_CORNER] = "yllcorner", [YLL_CENTER] = "yllcenter",
	[CELL] = "cellsize",	    [NODATA] = "nodata_value",
};
#define N_KEYS (sizeof(keys) / sizeof(*keys))

struct height_grid {
	struct text text;
	struct incise_error *err;
	double value[N_KEYS];
	bool given[N_KEYS];
	size_t columns, rows;
	struct mesh_draft draft;
};

/* The header's lines, up to the first that does not begin with a letter. */
static int read_header(struct height_grid *grid)
{
	const char *word;
	size_t length;

	while (text_next_word(&grid->text, &word, &length)) {
		size_t key = 0;

		/* A height may not be a number either; but then it is no key. */
		if (!((*word >= 'a' && *word <= 'z') || (*word >= 'A' && *word <= 'Z')) ||
		    (length == 3 && !strncasecmp(word, "nan", 3))) {
			grid->text.at = word;
			break;
		}
		while (key < N_KEYS && (strlen(keys[key]) != length ||
					strncasecmp(word, keys[key], length)))
			key++;
		if (key == N_KEYS || grid->given[key])
			return text_error(&grid->text, grid->err,
					  "'%.*s' is %s: expected ncols, nrows, "
					  "xllcorner|xllcenter, yllcorner|yllcenter, "
					  "cellsize, NODATA_value, each once",
					  (int)(length < 40 ? length : 40), word,
					  key == N_KEYS ? "not a known key"
							: "there already");
		length = text_word(&grid->text, &word);
		if (!text_number(word, length, grid->value + key))
			return text_error(&grid->text, grid->err,
					  "%s: '%.*s' is not a number", keys[key],
					  (int)(length < 40 ? length : 40), word);
		grid->given[key] = true;
		if (text_word(&grid->text, &word))
			return text_error(&grid->text, grid->err,
					  "%s has more than one value", keys[key]);
	}
	return 0;
}

static int check_header(struct height_grid *grid)
{
	const double *value = grid->value;
	const bool *given = grid->given;

	if (!given[NCOLS] || !given[NROWS] || !given[CELL] ||
	    given[XLL_CORNER] == given[XLL_CENTER] ||
	    given[YLL_CORNER] == given[YLL_CENTER])
		return text_error(&grid->text, grid->err,
				  "the header ends: expected ncols, nrows, one of "
				  "xllcorner and xllcenter, one of yllcorner and "
				  "yllcenter, and cellsize before the heights");
	for (int key = NCOLS; key <= NROWS; key++)
		if (!(value[key] >= 2 && value[key] <= INCISE_SURFACE_TRIANGLES_MAX) ||
		    value[key] != floor(value[key]))
			return text_error(&grid->text, grid->err,
					  "%s is %g: expected a whole number of at "
					  "least 2",
					  keys[key], value[key]);
	if (!(value[CELL] >= 1e-6 && value[CELL] <= MESH_COORDINATE_MAX_MM))
		return text_error(&grid->text, grid->err,
				  "cellsize is %g: expected from 1e-6 to %g mm",
				  value[CELL], MESH_COORDINATE_MAX_MM);
	grid->columns = (size_t)value[NCOLS];
	grid->rows = (size_t)value[NROWS];
	if (2 * (double)(grid->columns - 1) * (double)(grid->rows - 1) >
	    INCISE_SURFACE_TRIANGLES_MAX)
		return incise_error_set(
			grid->err, E2BIG,
			"%s: %zu × %zu heights are more than %d triangles",
			grid->text.path, grid->columns, grid->rows,
			INCISE_SURFACE_TRIANGLES_MAX);
	return 0;
}

static int read_height(struct height_grid *grid, size_t column, size_t row,
		       double *height)
{
	const char *word;
	size_t length;

	if (!text_next_word(&grid->text, &word, &length))
		return text_error(&grid->text, grid->err,
				  "the file ends before height %zu of row %zu of %zu",
				  column + 1, row + 1, grid->rows);
	if (!text_number(word, length, height))
		return text_error(&grid->text, grid->err,
				  "'%.*s' is not a height (column %zu, row %zu)",
				  (int)(length < 40 ? length : 40), word, column + 1,
				  row + 1);
	if (grid->given[NODATA] && *height == grid->value[NODATA])
		return text_error(&grid->text, grid->err,
				  "a hole (NODATA) in column %zu, row %zu; fill it",
				  column + 1, row + 1);
	return 0;
}

static int read_heights(struct height_grid *grid, const double at_mm[3])
{
	const double *value = grid->value, cell = value[CELL];
	double x0 = grid->given[XLL_CENTER] ? value[XLL_CENTER]
					    : value[XLL_CORNER] + cell / 2;
	double y0 = grid->given[YLL_CENTER] ? value[YLL_CENTER]
					    : value[YLL_CORNER] + cell / 2;
	struct mesh_draft *draft = &grid->draft;
	const char *word;
	size_t length;

	draft->point = malloc(grid->columns * grid->rows * sizeof(*draft->point));
	if (!draft->point)
		return incise_error_set(grid->err, ENOMEM, "%s: no memory to read it",
					grid->text.path);
	for (size_t row = 0; row < grid->rows; row++) {
		for (size_t column = 0; column < grid->columns; column++) {
			double *p = draft->point[draft->n_points++];
			int rc = read_height(grid, column, row, &p[2]);

			if (rc)
				return rc;
			p[0] = x0 + (double)column * cell;
			p[1] = y0 + (double)(grid->rows - 1 - row) * cell;
			for (int i = 0; i < 3; i++) {
				p[i] += at_mm[i];
				if (!(fabs(p[i]) <= MESH_COORDINATE_MAX_MM))
					return text_error(
						&grid->text, grid->err,
						"%g mm is farther than %g mm from the "
						"origin; check that its unit is mm",
						p[i], MESH_COORDINATE_MAX_MM);
			}
		}
	}
	if (text_next_word(&grid->text, &word, &length))
		return text_error(&grid->text, grid->err,
				  "'%.*s' after the last of %zu × %zu heights",
				  (int)(length < 40 ? length : 40), word, grid->columns,
				  grid->rows);
	return 0;
}

static int make_triangles(struct height_grid *grid)
{
	struct mesh_draft *draft = &grid->draft;
	size_t n = 2 * (grid->columns - 1) * (grid->rows - 1);

	draft->corner = malloc(n * sizeof(*draft->corner));
	if (!draft->corner)
		return incise_error_set(grid->err, ENOMEM, "%s: no memory to read it",
					grid->text.path);
	for (size_t row = 0; row + 1 < grid->rows; row++) {
		for (size_t column = 0; column + 1 < grid->columns; column++) {
			uint32_t nw = (uint32_t)(row * grid->columns + column);
			uint32_t ne = nw + 1, sw = nw + (uint32_t)grid->columns;
			uint32_t corner[2][3] = {{nw, sw, sw + 1}, {nw, sw + 1, ne}};

			memcpy(draft->corner[draft->n_triangles], corner, sizeof(corner));
			draft->n_triangles += 2;
		}
	}
	return 0;
}

struct mesh *height_grid_load(const char *path, const double at_mm[3],
			      struct incise_error *err)
{
	struct height_grid grid = {.err = err, .draft.path = path};
	struct mesh *mesh = NULL;
	int rc = text_open(&grid.text, path, err);

	if (!rc)
		rc = read_header(&grid);
	if (!rc)
		rc = check_header(&grid);
	if (!rc)
		rc = read_heights(&grid, at_mm);
	text_close(&grid.text);
	if (!rc)
		rc = make_triangles(&grid);
	if (!rc) {
		mesh = mesh_new(&grid.draft, err);
		rc = mesh ? 0 : -errno;
	}
	free(grid.draft.point);
	free(grid.draft.corner);
	if (rc)
		errno = -rc;
	return mesh;
}
