// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Lengths in pixels; see depth_data.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <incise/dataset.h>
#include <incise/recording.h>
#include "../cli/cli.h"
#include "depth_data.h"
#include "../cli/file.h"

#define AIR_MM 0.5 /* so far off the surface there is no doubt which side it is */
#define VISION_PX 0.03
#define PICTURES 50

bool depth_is_recording(const char *path)
{
	struct stat st;

	return !stat(path, &st) && S_ISDIR(st.st_mode);
}

bool depth_is_csv(const char *path)
{
	size_t n = strlen(path);

	return !strcmp(path, "-") || (n > 4 && !strcmp(path + n - 4, ".csv"));
}

void depth_lengths_add(struct depth_lengths *l, double px, double mm, const char *name)
{
	if (l->n == l->room) {
		l->room = l->room ? 2 * l->room : 64;
		l->px = realloc(l->px, l->room * sizeof(*l->px));
		l->mm = realloc(l->mm, l->room * sizeof(*l->mm));
		l->name = realloc(l->name, l->room * sizeof(*l->name));
		if (!l->px || !l->mm || !l->name)
			cli_fail("no memory");
	}
	l->px[l->n] = px;
	l->mm[l->n] = mm;
	l->name[l->n] = strdup(name);
	if (!l->name[l->n++])
		cli_fail("no memory");
}

void depth_lengths_read(struct depth_lengths *lengths, const char *path, bool line)
{
	static const char *const columns[] = {"length_px", "depth_mm"};
	struct incise_error err = {0};
	struct incise_dataset *data =
		incise_dataset_read(path, columns, line ? 2 : 1, NULL, &err);
	char name[40];

	if (!data)
		cli_fail_with(&err);
	if (incise_dataset_rows(data) > 1000000)
		cli_fail("%s: more than a million rows", path);
	for (size_t i = 0; i < incise_dataset_rows(data); i++) {
		const double *row = incise_dataset_row(data, i);

		snprintf(name, sizeof(name), "row %zu", i + 1);
		depth_lengths_add(lengths, row[0], line ? row[1] : NAN, name);
	}
	incise_dataset_free(data);
}

void depth_lengths_recording(struct depth_lengths *lengths, const char *path, bool line)
{
	struct incise_recording_length *rows;
	struct incise_error err = {0};
	struct incise_recording *recording = incise_recording_open(path, &err);
	char name[40];
	int n;

	if (!recording)
		cli_fail_with(&err);
	n = incise_recording_lengths(recording, &rows, &err);
	if (n < 0)
		cli_fail_with(&err);
	if (!n)
		cli_fail("%s: no picture in which the scalpel was found; record with a "
			 "camera whose rig.conf has a group vision",
			 path);
	lengths->vision_px = VISION_PX;
	for (int i = 0; i < n; i++) {
		if (line ? rows[i].depth_mm < AIR_MM : rows[i].depth_mm > -AIR_MM)
			continue;
		snprintf(name, sizeof(name), "picture %d", i);
		depth_lengths_add(lengths, rows[i].length_px, rows[i].depth_mm, name);
	}
	if (!lengths->n)
		cli_fail("%s: no picture with the blade in the %s", path,
			 line ? "tissue" : "air");
	free(rows);
	incise_recording_close(recording);
}

/* --- by vision ----------------------------------------------------------------------- */

struct measuring {
	struct depth_lengths *lengths;
	struct depth_source *source;
	struct incise_vision *vision;
};

static void learn(struct depth_source *source, const struct incise_camera_frame *frame)
{
	struct incise_vision_box box = {.width = 1, .height = 1};
	struct incise_error err = {0};
	char rest;

	if (sscanf(source->pick, "%d,%d%c", &box.x, &box.y, &rest) != 2)
		cli_usage("--pick: '%s': a pixel of the handle, X,Y", source->pick);
	if (incise_vision_learn(frame, &box, &source->setup, &err))
		cli_fail_with(&err);
	source->found_setup = true;
}

static bool measure(void *context, const struct incise_camera_frame *frame,
		    const char *name)
{
	struct measuring *m = context;
	struct incise_vision_result result;
	struct incise_error err = {0};
	int rc;

	if (!m->vision) {
		if (m->source->pick)
			learn(m->source, frame);
		m->vision = incise_vision_new(&m->source->setup, &err);
		if (!m->vision)
			cli_fail_with(&err);
	}
	rc = incise_vision_measure(m->vision, frame, &result);
	if (rc)
		cli_fail("picture %s: %s", name, strerror(-rc));
	if (!result.found) {
		cli_warn("picture %s: no scalpel: %s", name, result.why);
		return false;
	}
	depth_lengths_add(m->lengths, result.length_px, NAN, name);
	return true;
}

/* What the handle looks like, by rig.conf; the length there is what is to be measured. */
static void take_setup(struct depth_source *source)
{
	struct incise_error err = {0};
	struct incise_rig *rig;

	if (source->n_paths && !source->rig && !source->pick)
		cli_usage(
			"what does the handle look like? give --pick X,Y, a pixel of it, "
			"or --rig");
	if (source->n_paths && !source->rig)
		return;
	rig = incise_rig_open(cli_rig(source->rig), 0, &err);
	if (!rig)
		cli_fail_with(&err);
	if (incise_rig_vision(rig, &source->setup)) {
		if (!source->pick)
			cli_fail(
				"%s: has no group vision: give --pick X,Y, a pixel of the "
				"handle",
				incise_rig_spec(rig));
	} else {
		source->found_setup = true;
	}
	source->setup.full_px = source->setup.depth_mm_px = 0;
	incise_rig_close(rig);
}

void depth_lengths_measure(struct depth_lengths *lengths, struct depth_source *source)
{
	struct measuring m = {.lengths = lengths, .source = source};

	take_setup(source);
	source->every_s = 0;
	lengths->vision_px = VISION_PX;
	depth_pictures(source, source->pictures ? source->pictures : PICTURES,
		       "Hold the scalpel where it cuts, all of its handle in the picture",
		       measure, &m);
	incise_vision_free(m.vision);
	if (!lengths->n)
		cli_fail(
			"no scalpel was found in any picture; --pick X,Y learns its colour "
			"from a pixel of it");
}

void depth_lengths_write(const struct depth_lengths *lengths, const char *path, bool line)
{
	struct incise_outfile *file;
	FILE *out = whole_file_begin(path, &file);

	fprintf(out, line ? "depth_mm,length_px\n" : "length_px\n");
	for (int i = 0; i < lengths->n; i++) {
		if (line)
			fprintf(out, "%.6f,", lengths->mm[i]);
		fprintf(out, "%.5f\n", lengths->px[i]);
	}
	whole_file_end(file);
}
