// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Data of a calibration of depth; see depth.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <incise/board.h>
#include <incise/dataset.h>
#include <incise/recording.h>
#include <incise/rig.h>
#include "../cli/file_kind.h"
#include "../cli/image.h"
#include "../cli/recording.h"
#include "depth.h"

/* --- frames --------------------------------------------------------------------------- */

/* Returns false if the frame is of no use; @name: "3", or the file's. */
typedef bool handle_frame(struct depth *depth, const struct incise_camera_frame *frame,
			  const char *name);

#define WAIT_NS 2000000	       /* between two reads of the camera */
#define PATIENCE_NS 5000000000 /* until a frame comes */

static void wait_ns(struct incise_clock *clock, int64_t ns)
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
		calibrate_check_stop();
		if (incise_clock_now(clock) > until)
			cli_fail("no frames arrive from the camera; check its cable");
		wait_ns(clock, WAIT_NS);
	}
	if (rc > 0)
		return;
	incise_camera_cause(camera, cause, sizeof(cause));
	cli_fail("camera: %s", *cause ? cause : strerror(-rc));
}

/* Drop the frame from before the user was asked. */
static void drop_old_frame(struct incise_rig *rig)
{
	struct incise_camera_frame frame;

	incise_camera_newest(incise_rig_camera(rig), &frame);
}

static void take_frames(struct depth *depth, int frames, const char *prompt,
			handle_frame *handle)
{
	const bool is_board = depth->method == DEPTH_BOARD;
	struct incise_rig *rig = cli_open_rig(depth->common.rig, INCISE_RIG_CAMERA);
	struct incise_camera_info info;
	int tries = 0;

	incise_camera_info(incise_rig_camera(rig), &info);
	calibrate_words(depth->common.record.device, "%.63s", info.name);
	for (int taken = 0; taken < frames;) {
		struct incise_camera_frame frame;
		char name[20];

		/* A board moves between two frames. */
		if (depth->guided && (is_board || !taken)) {
			fprintf(stderr, prompt, taken + 1);
			fprintf(stderr, " [Enter] ");
			calibrate_await_enter();
			drop_old_frame(rig);
		} else if (is_board && taken && depth->every_s > 0) {
			wait_ns(incise_rig_clock(rig), (int64_t)(depth->every_s * 1e9));
			drop_old_frame(rig);
		}
		next_frame(rig, &frame);
		calibrate_words(name, "%d", taken + 1);
		/* On a terminal ask again for a frame of no use. */
		if (handle(depth, &frame, name) || !depth->guided || ++tries > 100)
			taken++;
		cli_progress("%d of %d frames", taken, frames);
	}
	cli_progress_end();
	incise_rig_close(rig);
}

static void handle_frames(struct depth *depth, int frames, const char *prompt,
			  handle_frame *handle)
{
	if (!depth->n_paths) {
		take_frames(depth, depth->pictures ? depth->pictures : frames, prompt,
			    handle);
		return;
	}
	calibrate_words(depth->common.record.device, "pictures");
	for (int i = 0; i < depth->n_paths; i++) {
		struct incise_camera_frame frame;

		calibrate_check_stop();
		image_read(depth->path[i], &frame);
		handle(depth, &frame, depth->path[i]);
		free((void *)frame.data);
	}
}

/* --- lengths -------------------------------------------------------------------------- */

#define AIR_MM 0.5 /* beyond it the blade is surely above or below the surface */
#define VISION_PX 0.03
#define U_CLICKS_PX 0.7 /* two ends, half a pixel each */
#define LENGTH_FRAMES 50

bool depth_is_recording(const char *path)
{
	struct stat st;

	/* A recording that is not there fails by its name. */
	return cli_ends_with(path, ".rec") || (!stat(path, &st) && S_ISDIR(st.st_mode));
}

bool depth_is_csv(const char *path)
{
	return !strcmp(path, "-") || cli_ends_with(path, ".csv");
}

static void add_length(struct depth_lengths *l, double px, double mm, const char *name)
{
	l->px = cli_grow(l->px, l->n, sizeof(*l->px));
	l->mm = cli_grow(l->mm, l->n, sizeof(*l->mm));
	l->name = cli_grow(l->name, l->n, sizeof(*l->name));
	l->px[l->n] = px;
	l->mm[l->n] = mm;
	l->name[l->n++] = cli_text("%s", name);
}

static void add_given_lengths(struct depth *depth)
{
	char *items[DEPTH_FILES_MAX], name[30];
	int n = cli_list("pixels", (char *)depth->pixels, items, DEPTH_FILES_MAX);

	for (int i = 0; i < n; i++) {
		calibrate_words(name, "--pixels %d", i + 1);
		add_length(&depth->lengths, cli_number("pixels", items[i], 1e-3, 1e5),
			   NAN, name);
	}
	depth->lengths.vision_px = U_CLICKS_PX;
	calibrate_words(depth->common.record.device, "given");
}

static void read_lengths(struct depth_lengths *lengths, const char *path, bool line)
{
	static const char *const columns[] = {"length_px", "depth_mm"};
	struct incise_error err = {0};
	struct incise_dataset *data;
	char name[40];

	lengths->vision_px = U_CLICKS_PX;
	file_expect(path, FILE_TABLE);
	data = cli_require(incise_dataset_read(path, columns, line ? 2 : 1, NULL, &err),
			   &err);
	if (incise_dataset_rows(data) > 1000000)
		cli_fail("%s: more than a million rows; keep every tenth", path);
	for (size_t i = 0; i < incise_dataset_rows(data); i++) {
		const double *row = incise_dataset_row(data, i);

		snprintf(name, sizeof(name), "row %zu", i + 1);
		add_length(lengths, row[0], line ? row[1] : NAN, name);
	}
	incise_dataset_free(data);
}

static void read_recording(struct depth_lengths *lengths, const char *path, bool line)
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
		add_length(lengths, rows[i].length_px, rows[i].depth_mm, name);
	}
	if (!lengths->n)
		cli_fail("%s: no frame shows the blade in the %s; record one that does",
			 path, line ? "tissue" : "air");
	free(rows);
	incise_recording_close(recording);
}

static void learn_colour(struct depth *depth, const struct incise_camera_frame *frame)
{
	struct incise_vision_box box = {.width = 1, .height = 1};
	struct incise_error err = {0};
	char rest;

	if (sscanf(depth->pick, "%d,%d%c", &box.x, &box.y, &rest) != 2)
		cli_usage("--pick: expected a pixel of the handle, X,Y, found '%s'",
			  depth->pick);
	if (incise_vision_learn(frame, &box, &depth->setup, &err))
		cli_fail_with(&err);
	depth->found_setup = true;
}

static bool measure_length(struct depth *depth, const struct incise_camera_frame *frame,
			   const char *name)
{
	struct incise_vision_result result;
	struct incise_error err = {0};
	int rc;

	if (!depth->vision) {
		if (depth->pick)
			learn_colour(depth, frame);
		depth->vision = cli_require(incise_vision_new(&depth->setup, &err), &err);
	}
	rc = incise_vision_measure(depth->vision, frame, &result);
	if (rc)
		cli_fail("image %s: %s", name, strerror(-rc));
	if (!result.found) {
		cli_warn("image %s: no scalpel: %s", name, result.why);
		return false;
	}
	add_length(&depth->lengths, result.length_px, NAN, name);
	return true;
}

/* The handle as of rig.conf, without the lengths, which are measured. */
static void find_setup(struct depth *depth)
{
	struct incise_rig *rig;

	if (depth->n_paths && !depth->common.rig && !depth->pick)
		cli_usage("missing --pick X,Y (a pixel of the handle, for its colour), "
			  "or --rig");
	if (depth->n_paths && !depth->common.rig)
		return;
	rig = cli_open_rig(depth->common.rig, 0);
	if (incise_rig_vision(rig, &depth->setup)) {
		if (!depth->pick)
			cli_fail("%s: it has no group vision; give --pick X,Y, a pixel "
				 "of the handle",
				 incise_rig_spec(rig));
	} else {
		depth->found_setup = true;
	}
	depth->setup.full_px = depth->setup.depth_mm_px = 0;
	incise_rig_close(rig);
}

static void measure_lengths(struct depth *depth)
{
	find_setup(depth);
	depth->lengths.vision_px = VISION_PX;
	handle_frames(
		depth, LENGTH_FRAMES,
		"Hold the scalpel where it cuts, with all of its handle in the frame",
		measure_length);
	incise_vision_free(depth->vision);
	if (!depth->lengths.n)
		cli_fail("no scalpel was found in any image; give --pick X,Y, a pixel "
			 "of its handle, to learn its colour");
}

static void write_lengths(const struct depth_lengths *lengths, bool line, FILE *out)
{
	fprintf(out, line ? "depth_mm,length_px\n" : "length_px\n");
	for (int i = 0; i < lengths->n; i++) {
		if (line)
			fprintf(out, "%.6f,", lengths->mm[i]);
		fprintf(out, "%.5f\n", lengths->px[i]);
	}
}

/* --- corners -------------------------------------------------------------------------- */

#define CORNER_FRAMES 8

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

static bool find_corners(struct depth *depth, const struct incise_camera_frame *frame,
			 const char *name)
{
	struct depth_corners *c = &depth->corners;
	size_t size = (size_t)2 * c->columns * c->rows * sizeof(*c->px);
	struct incise_error err = {0};
	double *px = cli_alloc(1, size);
	int rc;

	rc = incise_board_find(frame, c->columns, c->rows, px, &err);
	if (rc && rc != -ENODATA)
		cli_fail_with(&err);
	/* The first one must show the plane. */
	if (rc && !c->n && !depth->guided)
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

static void read_corners(struct depth_corners *c, const char *path)
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

static void write_corners(const struct depth_corners *c, FILE *out)
{
	fprintf(out, "view,row,column,x_px,y_px,width_px,height_px\n");
	for (int i = 0; i < c->n * c->columns * c->rows; i++)
		fprintf(out, "%d,%d,%d,%.5f,%.5f,%d,%d\n", i / c->columns / c->rows + 1,
			i / c->columns % c->rows + 1, i % c->columns + 1, c->px[2 * i],
			c->px[2 * i + 1], c->width, c->height);
}

/* --- the sources ---------------------------------------------------------------------- */

static void use_frames(struct depth *depth)
{
	if (depth->method == DEPTH_LINE)
		cli_usage("line: missing --from pairs.csv or --from NAME.rec");
	if (depth->method == DEPTH_TWO_POINT)
		measure_lengths(depth);
	else
		handle_frames(
			depth, CORNER_FRAMES,
			"View %d: hold the board in the cutting plane first, then tilted "
			"by 20 to 45 degrees, each time in another direction",
			find_corners);
}

void depth_read(void *run, const char *path)
{
	struct depth *depth = run;
	bool line = depth->method == DEPTH_LINE, board = depth->method == DEPTH_BOARD;
	bool single = depth->n_paths == 1, csv = single && depth_is_csv(path);

	if (!csv || !strcmp(path, "-"))
		depth->common.raw = depth->common.keep;
	if (csv) {
		if (board)
			read_corners(&depth->corners, path);
		else
			read_lengths(&depth->lengths, path, line);
		calibrate_words(depth->common.record.device, "CSV");
	} else if (single && depth_is_recording(path)) {
		if (board)
			cli_usage("board: a recording does not show a board; give images "
				  "or a CSV of corners with --from");
		read_recording(&depth->lengths, path, line);
		calibrate_words(depth->common.record.device, "recording");
	} else {
		use_frames(depth);
	}
}

void depth_measure(void *run)
{
	struct depth *depth = run;
	bool board = depth->method == DEPTH_BOARD;

	if (depth->pixels) {
		add_given_lengths(depth);
		return;
	}
	if (depth->method != DEPTH_LINE && !depth->guided &&
	    (!depth->pictures || (board && !(depth->every_s > 0))))
		cli_usage("missing --from, or --images%s of the camera (needed without "
			  "a terminal)",
			  board ? " and --every" : "");
	use_frames(depth);
}

void depth_write(const void *run, FILE *out)
{
	const struct depth *depth = run;

	if (depth->method == DEPTH_BOARD)
		write_corners(&depth->corners, out);
	else
		write_lengths(&depth->lengths, depth->method == DEPTH_LINE, out);
}
