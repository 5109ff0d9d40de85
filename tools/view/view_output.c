// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Where the frames of a view go; see view_output.h.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include "../cli/cli.h"
#include "../cli/image.h"
#include "view_output.h"

bool view_output_wanted(const struct view_output *output)
{
	return output->folder || output->film_path || output->strip_path;
}

void view_output_begin(struct view_output *output)
{
	size_t size = (size_t)output->width * output->height * 3;
	struct incise_error err = {0};

	if (!view_output_wanted(output))
		return;
	output->rgb = malloc(size);
	if (output->strip_path)
		output->strip = calloc(output->n_strip, size);
	if (!output->rgb || (output->strip_path && !output->strip))
		cli_fail("no memory for pictures of %d x %d", output->width,
			 output->height);
	if (output->folder && mkdir(output->folder, 0777) && errno != EEXIST)
		cli_fail("%s: %s", output->folder, strerror(errno));
	if (output->film_path)
		output->film = incise_film_new(output->film_path, output->width,
					       output->height, output->fps, &err);
	if (output->film_path && !output->film)
		cli_fail_with(&err);
}

/* Left of it are the ones before. */
static void add_to_strip(struct view_output *output)
{
	size_t row = (size_t)output->width * 3;

	for (int y = 0; y < output->height; y++)
		memcpy(output->strip +
			       (y * (size_t)output->n_strip + output->stripped) * row,
		       output->rgb + y * row, row);
	output->stripped++;
}

void view_output_frame(struct view_output *output, struct incise_view *view, double t_s)
{
	struct incise_error err = {0};
	char path[4200];
	int rc;

	if (!view_output_wanted(output))
		return;
	rc = incise_view_pixels(view, output->rgb);
	if (rc)
		cli_fail("the picture cannot be read: %s", strerror(-rc));
	if (output->folder) {
		snprintf(path, sizeof(path), "%s/frame-%06llu.png", output->folder,
			 (unsigned long long)output->frames);
		if (image_write_png(path, output->rgb, output->width, output->height,
				    &err))
			cli_fail_with(&err);
	}
	if (output->film && incise_film_add(output->film, output->rgb, &err)) {
		incise_film_drop(output->film);
		cli_fail_with(&err);
	}
	if (output->strip_path && output->stripped < output->n_strip &&
	    t_s >= output->strip_s[output->stripped])
		add_to_strip(output);
	output->frames++;
}

void view_output_end(struct view_output *output)
{
	struct incise_error err = {0};

	if (incise_film_close(output->film, &err))
		cli_fail_with(&err);
	if (output->strip_path && output->stripped < output->n_strip)
		cli_warn("%s: ends before its picture %d, at %g s", output->strip_path,
			 output->stripped + 1, output->strip_s[output->stripped]);
	if (output->strip_path && output->stripped &&
	    image_write_png(output->strip_path, output->strip,
			    output->width * output->n_strip, output->height, &err))
		cli_fail_with(&err);
	free(output->rgb);
	free(output->strip);
}
