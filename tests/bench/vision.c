// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * error of the exposed length against run time per frame. Frames whose
 * truth is known, of VGA's size and others, are measured one after the other on one core;
 * with a region of interest that follows, and with each frame searched as a whole.
 */
#include <stdio.h>
#include <stdlib.h>
#include <incise/vision.h>
#include "program.h"
#include "../../tools/cli/stopwatch.h"
#include "../vision/scalpel_picture.h"

#define FRAMES 40
#define ROUNDS 10
#define QUICK_FRAMES 10
#define QUICK_ROUNDS 2

static const struct kind {
	const char *name;
	enum incise_pixels pixels;
	int value; /* threshold */
	double noise, blur_px, gradient, light;
	int spots;
	double size; /* of 640 x 480 */
} kinds[] = {
	{"rgb", INCISE_PIXELS_RGB, 60, 2, 0.7, 0, 0, 0, 1},
	{"rgb_noise_8", INCISE_PIXELS_RGB, 60, 8, 1, 0, 0, 0, 1},
	{"rgb_blur_2", INCISE_PIXELS_RGB, 60, 2, 2, 0, 0, 0, 1},
	{"rgb_spots", INCISE_PIXELS_RGB, 60, 2, 1, 0, 0, 12, 1},
	{"rgb_light", INCISE_PIXELS_RGB, 60, 2, 1, 0.4, 0.2, 0, 1},
	{"yuyv", INCISE_PIXELS_YUYV, 60, 2, 0.7, 0, 0, 0, 1},
	{"grey", INCISE_PIXELS_GREY, 45, 2, 0.7, 0, 0, 0, 1},
	{"rgb_320", INCISE_PIXELS_RGB, 60, 2, 0.7, 0, 0, 0, 0.5},
	{"rgb_1280", INCISE_PIXELS_RGB, 60, 2, 0.7, 0, 0, 0, 2},
};

enum region { FOLLOWS, WHOLE, REGIONS };
static const char *const regions[REGIONS] = {"follows", "whole"};

struct frames {
	int n;
	struct incise_camera_frame frame[FRAMES], empty;
	double length_px[FRAMES];
};

struct row {
	const char *name, *region;
	int width, height, frames, found;
	double bias_px, sd_px, rms_px, max_px, stated_px, us, us_p99;
	struct harness_time time; /* of a frame, processor time */
	char failed[60];
};

/* Measurements of a region, in rounds that take turns. */
struct measurements {
	struct incise_vision *vision;
	double ns[FRAMES * ROUNDS], sum, square, stated, max;
	int n, found;
};

static struct row rows[N(kinds) * REGIONS];

/* A hand that moves by some pixels from frame to frame, and leans. */
static void draw_all(struct frames *f, int k, int n)
{
	const struct kind *kind = &kinds[k];
	double size = kind->size;
	uint64_t random = k;
	struct scalpel_picture s;

	scalpel_picture_init(&s);
	s.width = (int)(s.width * size);
	s.height = (int)(s.height * size);
	s.width_px *= size;
	s.pixels = kind->pixels;
	s.noise = kind->noise;
	s.blur_px = kind->blur_px;
	s.gradient = kind->gradient;
	s.spots = kind->spots;
	f->n = n;
	for (int i = 0; i < n; i++) {
		/* Of a few the same hand, not a faster one. */
		double turn = 2 * M_PI * i / FRAMES;

		s.x = size * (320 + 30 * sin(turn)) + scalpel_picture_random(&random);
		s.y = size * 440 + scalpel_picture_random(&random);
		s.angle_deg = 10 * sin(2 * turn);
		s.length_px =
			size * (330 + 50 * cos(turn)) + scalpel_picture_random(&random);
		s.light = 1 + kind->light * (2 * scalpel_picture_random(&random) - 1);
		s.seed = 1000 * k + i;
		f->length_px[i] = s.length_px;
		if (scalpel_picture_draw(&s, &f->frame[i]))
			cli_fail("out of memory");
	}
	s.length_px = 0;
	if (scalpel_picture_draw(&s, &f->empty))
		cli_fail("out of memory");
}

static void free_all(struct frames *f)
{
	for (int i = 0; i < f->n; i++)
		free((void *)f->frame[i].data);
	free((void *)f->empty.data);
}

static struct incise_vision_result look(struct incise_vision *vision,
					const struct incise_camera_frame *frame)
{
	struct incise_vision_result result;

	if (incise_vision_measure(vision, frame, &result))
		cli_fail("a frame cannot be measured");
	return result;
}

static struct incise_vision *vision_of(const struct kind *kind)
{
	struct incise_vision_setup setup = {
		.hue = {0, 179}, .saturation = {0, 255}, .value = {0, kind->value}};
	struct incise_error err = {0};

	return cli_require(incise_vision_new(&setup, &err), &err);
}

/* All frames once. */
static void look_at_all(const struct frames *f, enum region region,
			struct measurements *s)
{
	for (int i = 0; i < f->n; i++) {
		bool first = s->n < f->n;
		struct incise_vision_result result;
		double t, error;

		if (region == WHOLE) /* it forgets where the handle was */
			look(s->vision, &f->empty);
		/* Of this thread: a moment in which others have the core is not the frame's. */
		t = stopwatch_of(CLOCK_THREAD_CPUTIME_ID);
		result = look(s->vision, &f->frame[i]);
		s->ns[s->n++] = stopwatch_of(CLOCK_THREAD_CPUTIME_ID) - t;
		if (!first || !result.found)
			continue;
		error = result.length_px - f->length_px[i];
		s->sum += error;
		s->square += error * error;
		s->max = fmax(s->max, fabs(error));
		s->stated += result.sd_px * result.sd_px;
		s->found++;
	}
}

static void set_row(struct row *row, struct measurements *s)
{
	double n = s->found ? s->found : NAN;

	row->found = s->found;
	row->bias_px = s->sum / n;
	row->sd_px = sqrt(fmax(0, s->square / n - row->bias_px * row->bias_px));
	row->rms_px = sqrt(s->square / n);
	row->max_px = s->found ? s->max : NAN;
	row->stated_px = sqrt(s->stated / n);
	if (!s->found)
		snprintf(row->failed, sizeof(row->failed), "nothing found");
	harness_time_of(s->ns, s->n, &row->time);
	stopwatch_sort(s->ns, s->n);
	row->us = 1e-3 * stopwatch_quantile(s->ns, s->n, 0.5);
	row->us_p99 = 1e-3 * stopwatch_quantile(s->ns, s->n, 0.99);
}

static void measure(const struct kind *kind, const struct frames *f, int rounds,
		    struct row *row)
{
	static struct measurements each[REGIONS];

	for (int region = 0; region < REGIONS; region++) {
		each[region] = (struct measurements){.vision = vision_of(kind)};
		look(each[region].vision, &f->frame[f->n - 1]); /* warms up */
	}
	for (int r = 0; r < rounds; r++)
		for (int region = REGIONS - 1; region >= 0; region--)
			look_at_all(f, (enum region)region, &each[region]);
	for (int region = 0; region < REGIONS; region++, row++) {
		*row = (struct row){.name = kind->name,
				    .region = regions[region],
				    .width = f->frame[0].width,
				    .height = f->frame[0].height,
				    .frames = f->n};
		set_row(row, &each[region]);
		incise_vision_free(each[region].vision);
	}
}

static const struct bench_table rows_table = {
	.key = "rows",
	.row_bytes = sizeof(struct row),
	.columns = {COLUMN(row, "name", name), COLUMN(row, "region", region),
		    COLUMN(row, "width", width), COLUMN(row, "height", height),
		    COLUMN(row, "pictures", frames), COLUMN(row, "found", found),
		    COLUMN(row, "bias_px", bias_px), COLUMN(row, "sd_px", sd_px),
		    COLUMN(row, "rms_error_px", rms_px),
		    COLUMN(row, "max_error_px", max_px),
		    COLUMN(row, "said_sd_px", stated_px), COLUMN(row, "us", us),
		    COLUMN(row, "us_p99", us_p99),
		    COLUMN(row, "us_low", time.ns.low, .scale = 1e-3),
		    COLUMN(row, "us_high", time.ns.high, .scale = 1e-3),
		    COLUMN(row, "failed", failed)},
	.metrics = {METRIC(TIME, row, time, "us", "{name}, {region}"),
		    METRIC(EXACT, row, rms_px, "px", "{name}, {region}, error")},
};

static void run(struct bench_run *run)
{
	static struct frames frames;
	int rounds = run->quick ? QUICK_ROUNDS : ROUNDS;

	incise_vision_free(vision_of(&kinds[0])); /* fails before anything is drawn */
	for (int k = 0; k < N(kinds); k++) {
		cli_progress("vision: %s", kinds[k].name);
		draw_all(&frames, k, run->quick ? QUICK_FRAMES : FRAMES);
		measure(&kinds[k], &frames, rounds, &rows[k * REGIONS]);
		free_all(&frames);
	}
	cli_progress_end();
	bench_values(run, "{si si si}", "width", 640, "height", 480, "rounds", rounds);
	bench_rows(run, &rows_table, rows, N(kinds) * REGIONS);
}

const struct bench bench_program = {
	.name = "vision",
	.summary = "error of the exposed length over the time per frame",
	.run = run,
};
