// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Pictures of VGA's size whose truth is known, measured one after the other: how far off
 * the exposed length is, and how long a picture takes on one core; where the region of
 * interest follows, and where each picture is searched as a whole.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <incise/vision.h>
#include "bench_vision.h"
#include "cli.h"
#include "json.h"
#include "machine.h"
#include "scalpel_picture.h"
#include "stopwatch.h"

#define PICTURES 40
#define ROUNDS 10
#define QUICK_PICTURES 10
#define QUICK_ROUNDS 2

static const struct {
	const char *name;
	enum incise_pixels pixels;
	int value; /* threshold */
	double noise, blur_px, gradient, light;
	int spots;
} kinds[] = {
	{"rgb", INCISE_PIXELS_RGB, 60, 2, 0.7, 0, 0, 0},
	{"rgb_noise_8", INCISE_PIXELS_RGB, 60, 8, 1, 0, 0, 0},
	{"rgb_blur_2", INCISE_PIXELS_RGB, 60, 2, 2, 0, 0, 0},
	{"rgb_spots", INCISE_PIXELS_RGB, 60, 2, 1, 0, 0, 12},
	{"rgb_light", INCISE_PIXELS_RGB, 60, 2, 1, 0.4, 0.2, 0},
	{"yuyv", INCISE_PIXELS_YUYV, 60, 2, 0.7, 0, 0, 0},
	{"grey", INCISE_PIXELS_GREY, 45, 2, 0.7, 0, 0, 0},
};
#define KINDS (int)(sizeof(kinds) / sizeof(*kinds))

struct pictures {
	int n;
	struct incise_camera_frame frame[PICTURES], empty;
	double length_px[PICTURES];
};

struct row {
	int pictures, found;
	double bias_px, sd_px, said_px, us, us_p99;
};

static void draw(const struct scalpel_picture *picture, struct incise_camera_frame *frame)
{
	if (scalpel_picture_draw(picture, frame))
		cli_fail("out of memory");
}

/* A hand that moves by some pixels from picture to picture, and leans. */
static void draw_all(struct pictures *p, int kind, int n)
{
	uint64_t random = kind;
	struct scalpel_picture s;

	scalpel_picture_init(&s);
	s.pixels = kinds[kind].pixels;
	s.noise = kinds[kind].noise;
	s.blur_px = kinds[kind].blur_px;
	s.gradient = kinds[kind].gradient;
	s.spots = kinds[kind].spots;
	p->n = n;
	for (int i = 0; i < n; i++) {
		/* Of a few the same hand, not a faster one. */
		double turn = 2 * M_PI * i / PICTURES;

		s.x = 320 + 30 * sin(turn) + scalpel_picture_random(&random);
		s.y = 440 + scalpel_picture_random(&random);
		s.angle_deg = 10 * sin(2 * turn);
		s.length_px = 330 + 50 * cos(turn) + scalpel_picture_random(&random);
		s.light =
			1 + kinds[kind].light * (2 * scalpel_picture_random(&random) - 1);
		s.seed = 1000 * kind + i;
		p->length_px[i] = s.length_px;
		draw(&s, &p->frame[i]);
	}
	s.length_px = 0;
	draw(&s, &p->empty);
}

static void free_all(struct pictures *p)
{
	for (int i = 0; i < p->n; i++)
		free((void *)p->frame[i].data);
	free((void *)p->empty.data);
}

/* Of this thread: a moment in which others have the core is not the picture's. */
static double cpu_us(void)
{
	struct timespec t;

	clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
	return t.tv_sec * 1e6 + t.tv_nsec * 1e-3;
}

static void look(struct incise_vision *vision, const struct incise_camera_frame *frame,
		 struct incise_vision_result *result)
{
	if (incise_vision_measure(vision, frame, result))
		cli_fail("a picture cannot be measured");
}

static struct incise_vision *vision_of(int kind)
{
	struct incise_vision_setup setup = {
		.hue = {0, 179}, .saturation = {0, 255}, .value = {0, kinds[kind].value}};
	struct incise_error err = {0};
	struct incise_vision *vision = incise_vision_new(&setup, &err);

	if (!vision)
		cli_fail_with(&err);
	return vision;
}

static struct row measure(const struct pictures *p, int kind, bool follows, int rounds)
{
	struct incise_vision *vision = vision_of(kind);
	struct incise_vision_result result;
	double us[PICTURES * ROUNDS], sum = 0, square = 0, said = 0;
	struct row row = {.pictures = p->n};
	int n = 0;

	look(vision, &p->frame[p->n - 1], &result); /* warms up */
	for (int r = 0; r < rounds; r++)
		for (int i = 0; i < p->n; i++) {
			double t, error;

			if (!follows) /* it forgets where the handle was */
				look(vision, &p->empty, &result);
			t = cpu_us();
			look(vision, &p->frame[i], &result);
			us[n++] = cpu_us() - t;
			if (r || !result.found)
				continue;
			error = result.length_px - p->length_px[i];
			sum += error;
			square += error * error;
			said += result.sd_px * result.sd_px;
			row.found++;
		}
	incise_vision_free(vision);
	stopwatch_sort(us, n);
	row.us = stopwatch_quantile(us, n, 0.5);
	row.us_p99 = stopwatch_quantile(us, n, 0.99);
	row.bias_px = row.found ? sum / row.found : NAN;
	row.sd_px =
		row.found ? sqrt(fmax(0, square / row.found - row.bias_px * row.bias_px))
			  : NAN;
	row.said_px = row.found ? sqrt(said / row.found) : NAN;
	return row;
}

void bench_vision(bool json, bool quick)
{
	static struct pictures pictures;
	int rounds = quick ? QUICK_ROUNDS : ROUNDS;
	struct machine machine;
	json_t *list = json_array();

	incise_vision_free(vision_of(0)); /* fails before anything is printed */
	machine_init(&machine);
	if (!json)
		printf("%s\n640 x 480 pixels, one thread\n%-12s %-8s %7s %9s %7s %7s %8s %8s\n",
		       machine.cpu, "pictures", "region", "found", "bias px", "sd px",
		       "said px", "us", "us p99");
	for (int k = 0; k < KINDS; k++) {
		draw_all(&pictures, k, quick ? QUICK_PICTURES : PICTURES);
		for (int follows = 1; follows >= 0; follows--) {
			const char *region = follows ? "follows" : "whole";
			struct row r = measure(&pictures, k, follows, rounds);

			if (!json)
				printf("%-12s %-8s %3d/%-3d %+9.3f %7.3f %7.3f %8.0f %8.0f\n",
				       kinds[k].name, region, r.found, r.pictures,
				       r.bias_px, r.sd_px, r.said_px, r.us, r.us_p99);
			json_array_append_new(
				list, json_pack("{ss ss si si so so so sf sf}", "name",
						kinds[k].name, "region", region,
						"pictures", r.pictures, "found", r.found,
						"bias_px", json_number(r.bias_px),
						"sd_px", json_number(r.sd_px),
						"said_sd_px", json_number(r.said_px),
						"us", r.us, "us_p99", r.us_p99));
		}
		free_all(&pictures);
	}
	if (json)
		json_print(json_pack("{so si si si so}", "machine",
				     machine_json(&machine), "width", 640, "height", 480,
				     "rounds", rounds, "rows", list));
	else
		json_decref(list);
}
