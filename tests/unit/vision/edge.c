// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/vision/edge.cc: the error of the sub-pixel edge compared with the theoretical bound of
 * Cramer and Rao's bound. An end of the handle is a row of means, each over w pixels,
 *
 *   y_i = inside + (beyond - inside) F((x_i - place) / s) + noise / sqrt(w) + texture
 *
 * with F the cumulated Gaussian. With J the derivatives of all y by the unknowns and C the
 * covariance of noise and texture, no unbiased estimate has a variance of the place below
 * that of (J' C^-1 J)^-1, and of the length, which has two ends, below twice that. If all
 * but the place known, and no texture, that is
 *
 *   sd = noise / step · sqrt(2 · 2 s sqrt(pi) / w)
 *
 * for both ends. For 8 levels of noise, w = 54, s = 2 and a step of 97 it is 0.042 px; with
 * blur and levels unknown 0.050 px; with liver that has a texture of 12 levels 0.082 px.
 * In YUYV at 8 levels (step 36) it is 0.081 px at best, 0.098 with texture. So the 0.05 px
 * of issue 7 cannot be had in these two. The part without texture is strict. Texture is
 * taken as Gaussian here and is four waves in the frames: an estimate may be a little
 * better than that bound, and is (of 300 frames 0.071 px for 0.082; grey at 4 levels
 * 0.048 for 0.051).
 */
#include "../unit.h"
#include <incise/vision.h>
#include "../../vision/scalpel_picture.h"

#define FRAMES 40
#define ROWS 25	       /* 12 to each side, as edge.cc looks at */
#define WIDTH_PX 67.4  /* of the handle */
#define SHARE 0.8      /* of it, that edge.cc uses; all of it would give 10 % less */
#define DIRECTIONS 180 /* of the texture's waves, over which the mean is taken */

enum { PLACE, BLUR, INSIDE, BEYOND, UNKNOWNS };

struct step {
	double height; /* levels */
	double noise;  /* of a pixel */
	double blur_px;
	double wave; /* amplitude of each of the liver's four */
};

/* Lower triangle of @a, n x n; then @b becomes the solution of L x = b. */
static void factor(double *a, int n)
{
	for (int i = 0; i < n; i++)
		for (int j = 0; j <= i; j++) {
			double sum = a[i * n + j];

			for (int k = 0; k < j; k++)
				sum -= a[i * n + k] * a[j * n + k];
			a[i * n + j] = i == j ? sqrt(sum) : sum / a[j * n + j];
		}
}

static void forward(const double *l, int n, double *b)
{
	for (int i = 0; i < n; i++) {
		for (int k = 0; k < i; k++)
			b[i] -= l[i * n + k] * b[k];
		b[i] /= l[i * n + i];
	}
}

/* Covariance of means over the width, @apart on the axis: waves of 12, 24, 48, 96 px. */
static double texture_covariance(const struct step *s, double width, double apart)
{
	double sum = 0;

	for (int l = 12; l <= 96; l *= 2) {
		double k = 2 * M_PI / l, blurred = exp(-k * k * s->blur_px * s->blur_px);

		for (int i = 0; i < DIRECTIONS; i++) {
			double turn = 2 * M_PI * (i + 0.5) / DIRECTIONS;
			double across = k * cos(turn) * width / 2;
			double mean = sin(across) / across;

			sum += s->wave * s->wave / 2 * blurred * mean * mean *
			       cos(k * sin(turn) * apart) / DIRECTIONS;
		}
	}
	return sum;
}

/* Cramer and Rao's bound of the length's sd, in pixels. */
static double bound_px(const struct step *s)
{
	double width = SHARE * WIDTH_PX, sd = sqrt(s->blur_px * s->blur_px + 1 / 12.0);
	double c[ROWS * ROWS], j[UNKNOWNS][ROWS], apart[ROWS], part[ROWS];
	double fisher[UNKNOWNS * UNKNOWNS] = {0}, unit[UNKNOWNS] = {0}, variance = 0;

	for (int i = 0; i < ROWS; i++) {
		double x = (i - ROWS / 2 + 0.3) / sd;
		double slope = s->height * exp(-x * x / 2) / (sd * sqrt(2 * M_PI));

		apart[i] = texture_covariance(s, width, i);
		part[i] = erfc(-x / sqrt(2)) / 2;
		j[PLACE][i] = -slope;
		j[BLUR][i] = -slope * x;
		j[INSIDE][i] = 1 - part[i];
		j[BEYOND][i] = part[i];
	}
	for (int i = 0; i < ROWS; i++)
		for (int k = 0; k < ROWS; k++)
			c[i * ROWS + k] =
				part[i] * part[k] * apart[abs(i - k)] +
				/* of bytes: they are rounded */
				(i == k ? (s->noise * s->noise + 1 / 12.0) / width : 0);
	factor(c, ROWS);
	for (int k = 0; k < UNKNOWNS; k++)
		forward(c, ROWS, j[k]);
	for (int k = 0; k < UNKNOWNS; k++)
		for (int l = 0; l < UNKNOWNS; l++)
			for (int i = 0; i < ROWS; i++)
				fisher[k * UNKNOWNS + l] += j[k][i] * j[l][i];
	factor(fisher, UNKNOWNS);
	unit[PLACE] = 1;
	forward(fisher, UNKNOWNS, unit);
	for (int k = 0; k < UNKNOWNS; k++)
		variance += unit[k] * unit[k];
	return sqrt(2 * variance);
}

/* The formula at the top. */
static double all_known_px(const struct step *s)
{
	double sd = sqrt(s->blur_px * s->blur_px + 1 / 12.0);

	return s->noise / s->height * sqrt(2 * 2 * sd * sqrt(M_PI) / (SHARE * WIDTH_PX));
}

/* An end in a frame of tests/vision/scalpel_picture.c, liver and black. */
static struct step step_of(const struct scalpel_picture *p)
{
	static const double liver[3] = {118, 46, 38}, black[3] = {24, 24, 26};
	static const double luma[3] = {0.299, 0.587, 0.114};
	struct step s = {.noise = p->noise, .blur_px = p->blur_px};
	double wave = p->texture / 4 / liver[0];

	for (int k = 0; k < 3; k++) {
		double d = liver[k] - black[k];

		if (p->pixels == INCISE_PIXELS_RGB) {
			s.height += d * d;
			s.wave += d * liver[k] * wave;
		} else {
			s.height += luma[k] * d;
			s.wave += luma[k] * liver[k] * wave;
		}
	}
	if (p->pixels == INCISE_PIXELS_RGB) {
		s.height = sqrt(s.height);
		s.wave /= s.height;
	} else if (p->pixels == INCISE_PIXELS_YUYV) {
		s.height *= 219 / 255.0;
		s.wave *= 219 / 255.0;
	}
	return s;
}

/* Compared with the formula, which nearly holds if almost everything is known. */
TEST(the_bound_is_that_of_the_formula)
{
	struct step s = {.height = 97.3, .noise = 8, .blur_px = 1};
	double known = all_known_px(&s), all = bound_px(&s);

	assert_true(fabs(known - 0.0304) < 0.0002);
	/* Unknown levels and blur cost something, in a window of 12 px not much. */
	assert_true(all > known && all < 1.15 * known);
	s.wave = 3;
	assert_true(bound_px(&s) > 1.1 * all);
}

TEST(the_edge_is_as_good_as_can_be)
{
	static const struct {
		enum incise_pixels pixels;
		double noise, blur_px, texture;
	} cases[] = {
		{INCISE_PIXELS_RGB, 8, 1, 12},	{INCISE_PIXELS_RGB, 8, 2, 12},
		{INCISE_PIXELS_RGB, 8, 1, 0},	{INCISE_PIXELS_RGB, 8, 2, 0},
		{INCISE_PIXELS_GREY, 4, 1, 12}, {INCISE_PIXELS_YUYV, 8, 1, 12},
	};
	const int n_cases = sizeof(cases) / sizeof(*cases);
	uint64_t random = 7;
	double pooled = 0;

	for (int k = 0; k < n_cases; k++) {
		struct incise_vision_setup setup = {.hue = {0, 179},
						    .saturation = {0, 255}};
		struct incise_vision *vision;
		struct scalpel_picture p;
		struct step step;
		double square = 0, bound;

		scalpel_picture_init(&p);
		p.width = 160;
		p.height = 240;
		p.pixels = cases[k].pixels;
		p.noise = cases[k].noise;
		p.blur_px = cases[k].blur_px;
		p.texture = cases[k].texture;
		step = step_of(&p);
		bound = bound_px(&step);
		setup.value[1] = p.pixels == INCISE_PIXELS_GREY ? 45 : 60;
		vision = incise_vision_new(&setup, NULL);
		assert_non_null(vision);
		for (int i = 0; i < FRAMES; i++) {
			struct incise_vision_result r;
			struct incise_camera_frame frame;

			p.x = 80 + scalpel_picture_random(&random);
			p.y = 200 + scalpel_picture_random(&random);
			p.length_px = 150 + scalpel_picture_random(&random);
			p.angle_deg = 16 * scalpel_picture_random(&random) - 8;
			p.seed = 5000 + 100 * k + i;
			assert_int_equal(scalpel_picture_draw(&p, &frame), 0);
			assert_int_equal(incise_vision_measure(vision, &frame, &r), 0);
			free((void *)frame.data);
			assert_true(r.found);
			square += pow(r.length_px - p.length_px, 2) / FRAMES;
		}
		incise_vision_free(vision);
		print_message(
			"format %d, noise %g, blur %g, texture %2g: rms %.3f px, bound "
			"%.3f (all but the place known, no texture: %.3f)\n",
			p.pixels, p.noise, p.blur_px, p.texture, sqrt(square), bound,
			all_known_px(&step));
		pooled += square / (bound * bound) / n_cases;
		/* 1.3: limit of chance for the rms of 40, at 99 % */
		assert_true(sqrt(square) < 1.25 * 1.3 * bound);
	}
	pooled = sqrt(pooled);
	print_message("all: %.2f times the bound\n", pooled);
	/* 1.1: limit of chance for the rms of 240; far below the bound it would be wrong */
	assert_true(pooled < 1.15 * 1.1 && pooled > 1 / 1.15);
}
