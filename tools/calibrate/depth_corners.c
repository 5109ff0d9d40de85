// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Corners of a board; see depth_data.h.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/board.h>
#include <incise/calibrate_depth.h>
#include <incise/dataset.h>
#include "../cli/cli.h"
#include "depth_data.h"
#include "../cli/file.h"

#define PICTURES 8

struct finding {
	struct depth_corners *corners;
	bool again; /* whoever shows the board can show it again */
};

static double *add_view(struct depth_corners *c, const char *name)
{
	size_t of_view = (size_t)2 * c->columns * c->rows;

	if (c->n == INCISE_BOARD_VIEWS)
		cli_fail("more than %d views", INCISE_BOARD_VIEWS);
	c->px = realloc(c->px, (c->n + 1) * of_view * sizeof(*c->px));
	c->name = realloc(c->name, (c->n + 1) * sizeof(*c->name));
	if (!c->px || !c->name || !(c->name[c->n] = strdup(name)))
		cli_fail("no memory");
	return c->px + of_view * c->n++;
}

static bool find(void *context, const struct incise_camera_frame *frame, const char *name)
{
	struct finding *finding = context;
	struct depth_corners *c = finding->corners;
	size_t size = (size_t)2 * c->columns * c->rows * sizeof(*c->px);
	struct incise_error err = {0};
	double *px = malloc(size);
	int rc;

	if (!px)
		cli_fail("no memory");
	rc = incise_board_find(frame, c->columns, c->rows, px, &err);
	if (rc && rc != -ENODATA)
		cli_fail_with(&err);
	/* The first one lies in the plane: without it the others are for nothing. */
	if (rc && !c->n && !finding->again)
		cli_fail("picture %s, which is to show the cutting plane: %s", name,
			 err.text);
	if (rc)
		cli_warn("picture %s: %s", name, err.text);
	else if (c->n && (frame->width != c->width || frame->height != c->height))
		cli_fail("picture %s: %d x %d pixels, those before %d x %d", name,
			 frame->width, frame->height, c->width, c->height);
	else
		memcpy(add_view(c, name), px, size);
	c->width = frame->width;
	c->height = frame->height;
	free(px);
	return !rc;
}

void depth_corners_find(struct depth_corners *corners, struct depth_source *source)
{
	struct finding finding = {corners, source->guided};

	depth_pictures(
		source, source->pictures ? source->pictures : PICTURES,
		"View %d: the board in the cutting plane first, then tilted by 20 to "
		"45 degrees, each time another way",
		find, &finding);
}

void depth_corners_read(struct depth_corners *c, const char *path)
{
	static const char *const names[] = {"view", "row",	"column",   "x_px",
					    "y_px", "width_px", "height_px"};
	struct incise_error err = {0};
	struct incise_dataset *data = incise_dataset_read(path, names, 7, NULL, &err);
	int of_view = c->columns * c->rows;
	double *px = NULL;
	char name[30];

	if (!data)
		cli_fail_with(&err);
	for (size_t i = 0; i < incise_dataset_rows(data); i++) {
		const double *row = incise_dataset_row(data, i);
		int at = (int)(i % of_view);

		if (row[0] != i / of_view + 1 || row[1] != at / c->columns + 1 ||
		    row[2] != at % c->columns + 1)
			cli_fail(
				"%s: row %zu: view %.0f, row %.0f, column %.0f: expected "
				"%zu, %d, %d of a board of %d x %d",
				path, i + 1, row[0], row[1], row[2], i / of_view + 1,
				at / c->columns + 1, at % c->columns + 1, c->columns,
				c->rows);
		if (!(row[5] >= 16 && row[5] <= 8192 && row[6] >= 16 && row[6] <= 8192))
			cli_fail("%s: row %zu: a picture of %g x %g pixels", path, i + 1,
				 row[5], row[6]);
		if (!at) {
			snprintf(name, sizeof(name), "%zu", i / of_view + 1);
			px = add_view(c, name);
		}
		px[2 * at] = row[3];
		px[2 * at + 1] = row[4];
		c->width = (int)row[5];
		c->height = (int)row[6];
	}
	if (incise_dataset_rows(data) % of_view)
		cli_fail("%s: the last view is not whole: %zu rows of it, expected %d",
			 path, incise_dataset_rows(data) % of_view, of_view);
	incise_dataset_free(data);
}

void depth_corners_write(const struct depth_corners *c, const char *path)
{
	struct incise_outfile *file;
	FILE *out = whole_file_begin(path, &file);

	fprintf(out, "view,row,column,x_px,y_px,width_px,height_px\n");
	for (int i = 0; i < c->n * c->columns * c->rows; i++)
		fprintf(out, "%d,%d,%d,%.5f,%.5f,%d,%d\n", i / c->columns / c->rows + 1,
			i / c->columns % c->rows + 1, i % c->columns + 1, c->px[2 * i],
			c->px[2 * i + 1], c->width, c->height);
	whole_file_end(file);
}
