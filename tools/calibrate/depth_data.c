// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Data of a calibration of depth; see depth.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <incise/board.h>
#include <incise/calibrate_depth.h>
#include <incise/dataset.h>
#include <incise/recording.h>
#include "../cli/cli.h"
#include "../cli/file.h"
#include "../cli/file_kind.h"
#include "../cli/image.h"
#include "../cli/recording.h"
#include "depth.h"

/* --- pictures ------------------------------------------------------------------------- */

/* Returns false if the picture is of no use; @name: "3", or the file's. */
typedef bool handle_picture(void *context, const struct incise_camera_frame *frame,
			    const char *name);

#define WAIT_NS 2000000	       /* between two reads of the camera */
#define PATIENCE_NS 5000000000 /* until a picture comes */

static void wait_for(struct incise_clock *clock, int64_t ns)
{
	incise_clock_wait_until(clock, incise_clock_now(clock) + ns);
}

static void next_frame(struct incise_rig *rig, struct incise_camera_frame *frame)
{
	struct incise_clock *clock = incise_rig_clock(rig);
	struct incise_camera *camera = incise_rig_camera(rig);
	int64_t until = incise_clock_now(clock) + PATIENCE_NS;
	char cause[400];
	int rc;

	while (!(rc = incise_camera_read(camera, frame))) {
		if (cli_stop)
			cli_fail("stopped; the previous calibration stays active");
		if (incise_clock_now(clock) > until)
			cli_fail("no frames arrive from the camera; check its cable");
		wait_for(clock, WAIT_NS);
	}
	if (rc > 0)
		return;
	incise_camera_cause(camera, cause, sizeof(cause));
	cli_fail("camera: %s", *cause ? cause : strerror(-rc));
}

/* Drop the picture from before the user was asked. */
static void drop_old(struct incise_rig *rig)
{
	struct incise_camera_frame frame;

	incise_camera_newest(incise_rig_camera(rig), &frame);
}

static void ask(const char *prompt, int n)
{
	char line[100];

	fprintf(stderr, prompt, n);
	fprintf(stderr, " [Enter] ");
	if (!fgets(line, sizeof(line), stdin) || cli_stop)
		cli_fail("stopped; the previous calibration stays active");
}

static void from_camera(struct depth_source *source, int pictures, const char *prompt,
			handle_picture *handle, void *context)
{
	struct incise_rig *rig = cli_open_rig(source->rig, INCISE_RIG_CAMERA);
	struct incise_camera_info info;
	int tries = 0;

	incise_camera_info(incise_rig_camera(rig), &info);
	snprintf(source->device, sizeof(source->device), "%.63s", info.name);
	for (int taken = 0; taken < pictures;) {
		struct incise_camera_frame frame;
		char name[20];

		if (source->guided && (source->each || !taken)) {
			ask(prompt, taken + 1);
			drop_old(rig);
		} else if (taken && source->every_s > 0) {
			wait_for(incise_rig_clock(rig), (int64_t)(source->every_s * 1e9));
			drop_old(rig);
		}
		next_frame(rig, &frame);
		snprintf(name, sizeof(name), "%d", taken + 1);
		/* On a terminal ask again for a picture of no use. */
		if (handle(context, &frame, name) || !source->guided || ++tries > 100)
			taken++;
		cli_progress("%d of %d frames", taken, pictures);
	}
	cli_progress_end();
	incise_rig_close(rig);
}

static void for_each_picture(struct depth_source *source, int pictures,
			     const char *prompt, handle_picture *handle, void *context)
{
	if (!source->n_paths) {
		from_camera(source, pictures, prompt, handle, context);
		return;
	}
	snprintf(source->device, sizeof(source->device), "pictures");
	for (int i = 0; i < source->n_paths; i++) {
		struct incise_camera_frame frame;

		if (cli_stop)
			cli_fail("stopped; the previous calibration stays active");
		image_read(source->path[i], &frame);
		handle(context, &frame, source->path[i]);
		free((void *)frame.data);
	}
}

/* --- lengths -------------------------------------------------------------------------- */

#define AIR_MM 0.5 /* beyond it the blade is surely above or below the surface */
#define VISION_PX 0.03
#define LENGTH_PICTURES 50

bool depth_is_recording(const char *path)
{
	struct stat st;

	/* One that is not there fails by its name. */
	return cli_ends_with(path, ".rec") || (!stat(path, &st) && S_ISDIR(st.st_mode));
}

bool depth_is_csv(const char *path)
{
	return !strcmp(path, "-") || cli_ends_with(path, ".csv");
}

void depth_lengths_add(struct depth_lengths *l, double px, double mm, const char *name)
{
	if (l->n == l->capacity) {
		l->capacity = l->capacity ? 2 * l->capacity : 64;
		l->px = cli_resize(l->px, l->capacity, sizeof(*l->px));
		l->mm = cli_resize(l->mm, l->capacity, sizeof(*l->mm));
		l->name = cli_resize(l->name, l->capacity, sizeof(*l->name));
	}
	l->px[l->n] = px;
	l->mm[l->n] = mm;
	l->name[l->n++] = cli_text("%s", name);
}

void depth_lengths_read(struct depth_lengths *lengths, const char *path, bool line)
{
	static const char *const columns[] = {"length_px", "depth_mm"};
	struct incise_error err = {0};
	struct incise_dataset *data;
	char name[40];

	file_expect(path, FILE_TABLE);
	data = cli_require(incise_dataset_read(path, columns, line ? 2 : 1, NULL, &err),
			   &err);
	if (incise_dataset_rows(data) > 1000000)
		cli_fail("%s: more than a million rows; keep every tenth", path);
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
	struct incise_recording *recording = recording_open(path);
	char name[40];
	int n;

	n = incise_recording_lengths(recording, &rows, &err);
	if (n < 0)
		cli_fail_with(&err);
	if (!n)
		cli_fail("%s: the scalpel was not found in any frame; record with a "
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
		cli_fail("%s: no frame shows the blade in the %s; record one that does",
			 path, line ? "tissue" : "air");
	free(rows);
	incise_recording_close(recording);
}

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
		cli_usage("--pick: expected a pixel of the handle, X,Y, found '%s'",
			  source->pick);
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
		m->vision = cli_require(incise_vision_new(&m->source->setup, &err), &err);
	}
	rc = incise_vision_measure(m->vision, frame, &result);
	if (rc)
		cli_fail("image %s: %s", name, strerror(-rc));
	if (!result.found) {
		cli_warn("image %s: no scalpel: %s", name, result.why);
		return false;
	}
	depth_lengths_add(m->lengths, result.length_px, NAN, name);
	return true;
}

/* The handle as of rig.conf, without the lengths, which are measured. */
static void find_setup(struct depth_source *source)
{
	struct incise_rig *rig;

	if (source->n_paths && !source->rig && !source->pick)
		cli_usage("missing --pick X,Y (a pixel of the handle, for its colour), "
			  "or --rig");
	if (source->n_paths && !source->rig)
		return;
	rig = cli_open_rig(source->rig, 0);
	if (incise_rig_vision(rig, &source->setup)) {
		if (!source->pick)
			cli_fail("%s: it has no group vision; give --pick X,Y, a pixel "
				 "of the handle",
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

	find_setup(source);
	source->every_s = 0;
	lengths->vision_px = VISION_PX;
	for_each_picture(
		source, source->pictures ? source->pictures : LENGTH_PICTURES,
		"Hold the scalpel where it cuts, with all of its handle in the frame",
		measure, &m);
	incise_vision_free(m.vision);
	if (!lengths->n)
		cli_fail("no scalpel was found in any image; give --pick X,Y, a pixel "
			 "of its handle, to learn its colour");
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

/* --- corners -------------------------------------------------------------------------- */

#define CORNER_PICTURES 8

struct finding {
	struct depth_corners *corners;
	bool again; /* a person can show the board again */
};

static double *add_view(struct depth_corners *c, const char *name)
{
	size_t of_view = (size_t)2 * c->columns * c->rows;

	if (c->n == INCISE_BOARD_VIEWS)
		cli_fail("more than %d views; give fewer images", INCISE_BOARD_VIEWS);
	c->px = cli_resize(c->px, (c->n + 1) * of_view, sizeof(*c->px));
	c->name = cli_resize(c->name, c->n + 1, sizeof(*c->name));
	c->name[c->n] = cli_text("%s", name);
	return c->px + of_view * c->n++;
}

static bool find(void *context, const struct incise_camera_frame *frame, const char *name)
{
	struct finding *finding = context;
	struct depth_corners *c = finding->corners;
	size_t size = (size_t)2 * c->columns * c->rows * sizeof(*c->px);
	struct incise_error err = {0};
	double *px = cli_alloc(1, size);
	int rc;

	rc = incise_board_find(frame, c->columns, c->rows, px, &err);
	if (rc && rc != -ENODATA)
		cli_fail_with(&err);
	/* The first one must show the plane. */
	if (rc && !c->n && !finding->again)
		cli_fail("image %s, which must show the cutting plane: %s", name,
			 err.text);
	if (rc)
		cli_warn("image %s: %s", name, err.text);
	else if (c->n && (frame->width != c->width || frame->height != c->height))
		cli_fail("image %s: %d x %d pixels, but the images before have %d x "
			 "%d; give images of one size",
			 name, frame->width, frame->height, c->width, c->height);
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

	for_each_picture(
		source, source->pictures ? source->pictures : CORNER_PICTURES,
		"View %d: hold the board in the cutting plane first, then tilted by 20 "
		"to 45 degrees, each time in another direction",
		find, &finding);
}

void depth_corners_read(struct depth_corners *c, const char *path)
{
	static const char *const names[] = {"view", "row",	"column",   "x_px",
					    "y_px", "width_px", "height_px"};
	struct incise_error err = {0};
	struct incise_dataset *data =
		cli_require(incise_dataset_read(path, names, 7, NULL, &err), &err);
	int of_view = c->columns * c->rows;
	double *px = NULL;
	char name[30];

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
			cli_fail("%s: row %zu: an image of %g x %g pixels; expected 16 "
				 "to 8192",
				 path, i + 1, row[5], row[6]);
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
		cli_fail("%s: the last view is incomplete: %zu rows, expected %d; add "
			 "the missing corners",
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
