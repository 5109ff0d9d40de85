// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Pictures whose truth is known, of VGA's size and others, measured one after the other: how far off
 * the exposed length is, and how long a picture takes on one core; where the region of
 * interest follows, and where each picture is searched as a whole.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <incise/vision.h>
#include "bench_vision.h"
#include "../cli/cli.h"
#include "metrics.h"
#include "../cli/json.h"
#include "machine.h"
#include "../cli/plot.h"
#include "scalpel_picture.h"
#include "../cli/stopwatch.h"

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
#define KINDS (int)(sizeof(kinds) / sizeof(*kinds))

struct pictures {
	int n;
	struct incise_camera_frame frame[PICTURES], empty;
	double length_px[PICTURES];
};

enum region { REGION_WHOLE, REGION_FOLLOWS, REGIONS };
static const char *const regions[REGIONS] = {"whole", "follows"};

struct row {
	int kind, width, height, pictures, found;
	enum region region;
	double bias_px, sd_px, rms_px, max_px, said_px, us, us_p99;
	struct harness_time time; /* of a picture, processor time */
	char failed[60];
};

/* What is measured of a region, in rounds that take turns. */
struct series {
	struct incise_vision *vision;
	double ns[PICTURES * ROUNDS], sum, square, said, max;
	int n, found;
};

#define ROWS (KINDS * REGIONS)

struct bench {
	struct row row[ROWS];
	struct pictures pictures;
	int rounds;
	struct machine machine;
};

static void draw(const struct scalpel_picture *picture, struct incise_camera_frame *frame)
{
	if (scalpel_picture_draw(picture, frame))
		cli_fail("out of memory");
}

/* A hand that moves by some pixels from picture to picture, and leans. */
static void draw_all(struct pictures *p, int kind, int n)
{
	double size = kinds[kind].size;
	uint64_t random = kind;
	struct scalpel_picture s;

	scalpel_picture_init(&s);
	s.width = (int)(s.width * size);
	s.height = (int)(s.height * size);
	s.width_px *= size;
	s.pixels = kinds[kind].pixels;
	s.noise = kinds[kind].noise;
	s.blur_px = kinds[kind].blur_px;
	s.gradient = kinds[kind].gradient;
	s.spots = kinds[kind].spots;
	p->n = n;
	for (int i = 0; i < n; i++) {
		/* Of a few the same hand, not a faster one. */
		double turn = 2 * M_PI * i / PICTURES;

		s.x = size * (320 + 30 * sin(turn)) + scalpel_picture_random(&random);
		s.y = size * 440 + scalpel_picture_random(&random);
		s.angle_deg = 10 * sin(2 * turn);
		s.length_px =
			size * (330 + 50 * cos(turn)) + scalpel_picture_random(&random);
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

/* All pictures once. */
static void look_at_all(const struct pictures *p, enum region region, struct series *s)
{
	struct incise_vision_result result;

	for (int i = 0; i < p->n; i++) {
		bool first = s->n < p->n;
		double t, error;

		if (region == REGION_WHOLE) /* it forgets where the handle was */
			look(s->vision, &p->empty, &result);
		t = cpu_us();
		look(s->vision, &p->frame[i], &result);
		s->ns[s->n++] = 1e3 * (cpu_us() - t);
		if (!first || !result.found)
			continue;
		error = result.length_px - p->length_px[i];
		s->sum += error;
		s->square += error * error;
		s->max = fmax(s->max, fabs(error));
		s->said += result.sd_px * result.sd_px;
		s->found++;
	}
}

static void finish(struct series *s, struct row *row)
{
	double n = s->found ? s->found : NAN;

	incise_vision_free(s->vision);
	row->found = s->found;
	row->bias_px = s->sum / n;
	row->sd_px = sqrt(fmax(0, s->square / n - row->bias_px * row->bias_px));
	row->rms_px = sqrt(s->square / n);
	row->max_px = s->found ? s->max : NAN;
	row->said_px = sqrt(s->said / n);
	if (!s->found)
		snprintf(row->failed, sizeof(row->failed), "nothing found");
	harness_time_of(s->ns, s->n, &row->time);
	stopwatch_sort(s->ns, s->n);
	row->us = 1e-3 * stopwatch_quantile(s->ns, s->n, 0.5);
	row->us_p99 = 1e-3 * stopwatch_quantile(s->ns, s->n, 0.99);
}

static void measure(struct bench *b, int kind)
{
	static struct series series[REGIONS];
	const struct pictures *p = &b->pictures;
	struct incise_vision_result result;

	for (int region = 0; region < REGIONS; region++) {
		struct row *row = &b->row[REGIONS * kind + REGIONS - 1 - region];

		*row = (struct row){.kind = kind,
				    .region = (enum region)region,
				    .width = p->frame[0].width,
				    .height = p->frame[0].height,
				    .pictures = p->n};
		series[region] = (struct series){.vision = vision_of(kind)};
		look(series[region].vision, &p->frame[p->n - 1], &result); /* warms up */
	}
	for (int r = 0; r < b->rounds; r++)
		for (int region = 0; region < REGIONS; region++)
			look_at_all(p, (enum region)region, &series[region]);
	for (int region = 0; region < REGIONS; region++)
		finish(&series[region], &b->row[REGIONS * kind + REGIONS - 1 - region]);
}

/* ---- report ---- */

static void print_table(const struct bench *b)
{
	printf("%s\none thread; %d rounds\n%-12s %-8s %-9s %7s %9s %7s %7s %7s %7s %8s %8s\n",
	       b->machine.cpu, b->rounds, "pictures", "region", "size", "found",
	       "bias px", "sd px", "rms px", "max px", "said px", "us", "us p99");
	for (int i = 0; i < ROWS; i++) {
		const struct row *r = &b->row[i];
		char size[16];

		snprintf(size, sizeof(size), "%dx%d", r->width, r->height);
		printf("%-12s %-8s %-9s %3d/%-3d %+9.3f %7.3f %7.3f %7.3f %7.3f %8.0f %8.0f\n",
		       kinds[r->kind].name, regions[r->region], size, r->found,
		       r->pictures, r->bias_px, r->sd_px, r->rms_px, r->max_px,
		       r->said_px, r->us, r->us_p99);
	}
}

static json_t *row_json(const struct row *r)
{
	return json_pack("{ss ss si si si si so so so so so sf sf so so so}", "name",
			 kinds[r->kind].name, "region", regions[r->region], "width",
			 r->width, "height", r->height, "pictures", r->pictures, "found",
			 r->found, "bias_px", json_number(r->bias_px), "sd_px",
			 json_number(r->sd_px), "rms_px", json_number(r->rms_px),
			 "max_px", json_number(r->max_px), "said_sd_px",
			 json_number(r->said_px), "us", r->us, "us_p99", r->us_p99,
			 "us_low", json_number(r->time.ns.low * 1e-3), "us_high",
			 json_number(r->time.ns.high * 1e-3), "failed",
			 *r->failed ? json_string(r->failed) : json_null());
}

static void print_json(const struct bench *b, bool quick)
{
	json_t *rows = json_array(), *figures = json_array();

	for (int i = 0; i < ROWS; i++) {
		const struct row *r = &b->row[i];

		json_array_append_new(rows, row_json(r));
		metrics_time(figures, &r->time, "us", "%s, %s", kinds[r->kind].name,
			     regions[r->region]);
		metrics_exact(figures, r->rms_px, "px", "%s, %s, error",
			      kinds[r->kind].name, regions[r->region]);
	}
	json_print(json_pack("{so sb si si si so so}", "machine",
			     machine_json(&b->machine), "quick", quick, "width", 640,
			     "height", 480, "rounds", b->rounds, "rows", rows, "figures",
			     figures));
}

/* A block per region: name, ms, its percentiles, rms error, the largest. */
static void draw_chart(const struct bench *b, const char *folder, const char *name)
{
	static const char *const titles[REGIONS] = {"the whole picture is searched",
						    "the region follows"};
	double fast = INFINITY, slow = 0, good = INFINITY, bad = 0;
	char *data;
	FILE *out;

	if (asprintf(&data, "%s.dat", name) < 0)
		cli_fail("no memory");
	out = plot_data(folder, data);
	free(data);
	for (int region = 0; region < REGIONS; region++) {
		fputs("none NaN NaN NaN NaN NaN\n", out);
		for (int i = 0; i < ROWS; i++) {
			const struct row *r = &b->row[i];

			if (r->region == (enum region)region && !*r->failed)
				fprintf(out, "%s %g %g %g %g %g\n", kinds[r->kind].name,
					r->time.ns.median * 1e-6, r->time.ns.p5 * 1e-6,
					r->time.ns.p95 * 1e-6, r->rms_px, r->max_px);
			if (*r->failed)
				continue;
			fast = fmin(fast, r->time.ns.p5 * 1e-6);
			slow = fmax(slow, r->time.ns.p95 * 1e-6);
			good = fmin(good, r->rms_px);
			bad = fmax(bad, r->max_px);
		}
		fputs("\n\n", out);
	}
	plot_data_end(out, folder);
	out = plot_begin(folder, name, 1100, 800);
	fprintf(out,
		"set title \"Error of the exposed length over run time\\n%s, %s\"\n"
		"set xlabel 'processor time of a picture / ms (bars: 5 to 95 %%)'\n"
		"set ylabel 'rms error / pixels (thin lines: up to the largest)'\n"
		"set logscale xy\nset format xy '%%g'\nset xrange [%g:%g]\n"
		"set yrange [%g:%g]\nset key outside bottom center horizontal\ndata = '%s.dat'\nplot \\\n",
		b->machine.cpu, b->machine.kernel, fast / 1.2, slow * 1.4, good / 1.3,
		bad * 1.3, name);
	for (int region = 0; region < REGIONS; region++)
		fprintf(out,
			"  data index %d using 2:5:(0):($6-$5) with vectors nohead ls %d lw 0.5 "
			"notitle, \\\n  '' index %d using 2:5:3:4 with xerrorbars ls %d pt 7 ps "
			"0.8 title '%s', \\\n  '' index %d using 2:5:1 with labels left rotate by "
			"%d offset 0.6,%g font ',8' notitle, \\\n",
			region, region + 1, region, region + 1, titles[region], region,
			region ? 20 : -20, region ? 0.3 : -0.3);
	fputs("  NaN notitle\n", out);
	if (!plot_draw(out, folder, name))
		cli_fail("%s/plot/%s.gp: gnuplot failed, see above", folder, name);
}

void bench_vision(bool json, bool quick, const char *plot)
{
	struct bench *b = calloc(1, sizeof(*b));
	const char *folder, *name;

	if (!b)
		cli_fail("no memory");
	incise_vision_free(vision_of(0)); /* fails before anything is drawn */
	if (plot)
		plot_place("plot", plot, &folder, &name);
	b->rounds = quick ? QUICK_ROUNDS : ROUNDS;
	machine_init(&b->machine);
	for (int k = 0; k < KINDS; k++) {
		cli_progress("vision: %s", kinds[k].name);
		draw_all(&b->pictures, k, quick ? QUICK_PICTURES : PICTURES);
		measure(b, k);
		free_all(&b->pictures);
	}
	cli_progress_end();
	if (json)
		print_json(b, quick);
	else
		print_table(b);
	cli_finish();
	if (plot)
		draw_chart(b, folder, name);
	free(b);
}
