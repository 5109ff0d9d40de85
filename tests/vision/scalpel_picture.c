// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Frames of a scalpel over liver; see scalpel_picture.h. In float until all is drawn: liver,
 * scalpel, reflections, blur, light, noise, bytes.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/base/random.h"
#include "scalpel_picture.h"

#define SAMPLES 256
#define GOLDEN 0.6180339887498949
#define MOST_BLUR 8 /* pixels to each side */

static const float liver[3] = {118, 46, 38}, steel[3] = {190, 192, 196};
static const float black[3] = {24, 24, 26}, shine = 250;

struct canvas {
	int width, height;
	float *rgb, *row; /* three values per pixel */
};

static uint64_t bits(uint64_t *state)
{
	return incise_random_mix(*state += 0x9e3779b97f4a7c15u);
}

double scalpel_picture_random(uint64_t *state)
{
	return (bits(state) >> 11) * 0x1p-53;
}

/* Four uniform ones: near enough to a Gaussian, of sd 1. */
static double noise(uint64_t *state)
{
	uint64_t b = bits(state);
	double sum = (b & 0xffff) + (b >> 16 & 0xffff) + (b >> 32 & 0xffff) + (b >> 48);

	return (sum / 65536 - 2) * 1.7320508;
}

void scalpel_picture_init(struct scalpel_picture *picture)
{
	*picture = (struct scalpel_picture){
		.width = 640,
		.height = 480,
		.x = 320,
		.y = 440,
		.length_px = 360,
		.width_px = 67.4,
		.texture = 12,
		.light = 1,
	};
}

/* Waves of four directions and lengths. */
static void paint_liver(struct canvas *c, const struct scalpel_picture *p,
			uint64_t *state)
{
	double kx[4], ky[4], phase[4];

	for (int k = 0; k < 4; k++) {
		double turn = 2 * M_PI * scalpel_picture_random(state);
		double length = 12 * pow(2, k);

		kx[k] = 2 * M_PI / length * cos(turn);
		ky[k] = 2 * M_PI / length * sin(turn);
		phase[k] = 2 * M_PI * scalpel_picture_random(state);
	}
	for (int y = 0; y < c->height; y++)
		for (int x = 0; x < c->width; x++) {
			float *pixel = c->rgb + 3 * ((size_t)y * c->width + x), sum = 0;

			if (p->texture > 0)
				for (int k = 0; k < 4; k++)
					sum += sinf((float)(kx[k] * x + ky[k] * y +
							    phase[k]));
			for (int k = 0; k < 3; k++)
				pixel[k] = liver[k] *
					   (1 + (float)p->texture * sum / (4 * liver[0]));
		}
}

/* Distance of a point inside the black or, with blade, inside the blade: below 0 outside. */
static double inside(const struct scalpel_picture *p, double x, double y, double up_x,
		     double up_y, bool blade)
{
	double dx = x - p->x, dy = y - p->y;
	double along = dx * up_x + dy * up_y, across = fabs(dx * up_y - dy * up_x);

	if (blade)
		return fmin(fmin(-along, along + 60), p->blade_px / 2 - across);
	if (p->level)
		return fmin(fmin(-dy, p->length_px - along), p->width_px / 2 - across);
	return fmin(fmin(along, p->length_px - along), p->width_px / 2 - across);
}

static void lay_scalpel(struct canvas *c, const struct scalpel_picture *p, bool blade)
{
	double turn = p->angle_deg * M_PI / 180, up_x = sin(turn), up_y = -cos(turn);
	const float *colour = blade ? steel : black;

	for (int y = 0; y < c->height; y++)
		for (int x = 0; x < c->width; x++) {
			float *pixel = c->rgb + 3 * ((size_t)y * c->width + x);
			double in = inside(p, x + 0.5, y + 0.5, up_x, up_y, blade);
			float cover = in > 0;

			if (fabs(in) < 0.75) {
				int hits = 0;

				/* A lattice that no edge is parallel to. */
				for (int i = 0; i < SAMPLES; i++) {
					double v = i * GOLDEN;

					hits += inside(p, x + (i + 0.5) / SAMPLES,
						       y + v - floor(v), up_x, up_y,
						       blade) > 0;
				}
				cover = (float)hits / SAMPLES;
			}
			for (int k = 0; k < 3; k++)
				pixel[k] += cover * (colour[k] - pixel[k]);
		}
}

/* Half of them on the scalpel, a third of these near its end in the tissue. */
static void lay_spots(struct canvas *c, const struct scalpel_picture *p, uint64_t *state)
{
	double turn = p->angle_deg * M_PI / 180, up_x = sin(turn), up_y = -cos(turn);

	for (int i = 0; i < p->spots; i++) {
		double radius = 1.5 + 3.5 * scalpel_picture_random(state);
		double x = p->width * scalpel_picture_random(state);
		double y = p->height * scalpel_picture_random(state);

		if (i % 2 && p->length_px > 0) {
			double along = scalpel_picture_random(state) *
				       (i % 6 == 1 ? 20 : p->length_px);
			double across =
				(scalpel_picture_random(state) - 0.5) * p->width_px;

			x = p->x + along * up_x - across * up_y;
			y = p->y + along * up_y + across * up_x;
		}
		for (int j = (int)fmax(0, y - 7); j < c->height && j < y + 7; j++)
			for (int l = (int)fmax(0, x - 7); l < c->width && l < x + 7;
			     l++) {
				float *pixel = c->rgb + 3 * ((size_t)j * c->width + l);
				double in =
					radius - hypot(l + 0.5 - x, j + 0.5 - y) + 0.5;
				float cover = (float)fmax(0, fmin(1, in));

				for (int k = 0; k < 3; k++)
					pixel[k] += cover * (shine - pixel[k]);
			}
	}
}

/* One line of @n pixels that are @stride floats apart. */
static void blur_line(float *line, int n, size_t stride, const float *weight, int reach,
		      float *copy)
{
	for (int i = 0; i < n; i++)
		memcpy(copy + 3 * i, line + stride * i, 3 * sizeof(float));
	for (int i = 0; i < n; i++) {
		float sum[3] = {0};

		for (int j = -reach; j <= reach; j++) {
			int at = i + j < 0 ? 0 : i + j >= n ? n - 1 : i + j;

			for (int k = 0; k < 3; k++)
				sum[k] += weight[abs(j)] * copy[3 * at + k];
		}
		memcpy(line + stride * i, sum, sizeof(sum));
	}
}

static void blur(struct canvas *c, double sd)
{
	float weight[MOST_BLUR + 1], sum = 0;
	int reach = (int)fmin(MOST_BLUR, ceil(3.5 * sd));

	for (int j = 0; j <= reach; j++) {
		weight[j] = (float)exp(-j * j / (2 * sd * sd));
		sum += weight[j] * (j ? 2 : 1);
	}
	for (int j = 0; j <= reach; j++)
		weight[j] /= sum;
	for (int y = 0; y < c->height; y++)
		blur_line(c->rgb + 3 * (size_t)y * c->width, c->width, 3, weight, reach,
			  c->row);
	for (int x = 0; x < c->width; x++)
		blur_line(c->rgb + 3 * (size_t)x, c->height, 3 * (size_t)c->width, weight,
			  reach, c->row);
}

static uint8_t byte(double value, double sd, uint64_t *state)
{
	if (sd > 0)
		value += sd * noise(state);
	return (uint8_t)fmax(0, fmin(255, value + 0.5));
}

static double luma(const float *rgb)
{
	return 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2];
}

/* BT.601, 16 … 235, as cameras send it. */
static void to_yuyv(const float *rgb, double sd, uint64_t *state, uint8_t *out)
{
	double y0 = luma(rgb), y1 = luma(rgb + 3), y = (y0 + y1) / 2;

	out[0] = byte(16 + y0 * 219 / 255, sd, state);
	out[1] = byte(128 + 0.564 * 224 / 255 * ((rgb[2] + rgb[5]) / 2 - y), sd, state);
	out[2] = byte(16 + y1 * 219 / 255, sd, state);
	out[3] = byte(128 + 0.713 * 224 / 255 * ((rgb[0] + rgb[3]) / 2 - y), sd, state);
}

static void to_bytes(struct canvas *c, const struct scalpel_picture *p, uint8_t *data,
		     int stride, uint64_t *state)
{
	for (int y = 0; y < c->height; y++) {
		float *rgb = c->rgb + 3 * (size_t)y * c->width;
		uint8_t *row = data + (size_t)y * stride;

		for (int x = 0; x < c->width; x++) {
			double light = p->light *
				       (1 + p->gradient * ((x + 0.5) / c->width - 0.5));

			for (int k = 0; k < 3; k++)
				rgb[3 * x + k] = (float)fmin(255, rgb[3 * x + k] * light);
		}
		for (int x = 0; x < c->width; x++)
			if (p->pixels == INCISE_PIXELS_GREY)
				row[x] = byte(luma(rgb + 3 * x), p->noise, state);
			else if (p->pixels == INCISE_PIXELS_RGB)
				for (int k = 0; k < 3; k++)
					row[3 * x + k] =
						byte(rgb[3 * x + k], p->noise, state);
			else if (x % 2 == 0 && x + 1 < c->width)
				to_yuyv(rgb + 3 * x, p->noise, state, row + 2 * x);
	}
}

int scalpel_picture_draw(const struct scalpel_picture *p,
			 struct incise_camera_frame *frame)
{
	size_t pixels = (size_t)p->width * p->height;
	int longest = p->width > p->height ? p->width : p->height;
	int stride = p->width * (p->pixels == INCISE_PIXELS_RGB	   ? 3
				 : p->pixels == INCISE_PIXELS_YUYV ? 2
								   : 1);
	uint8_t *data = malloc((size_t)stride * p->height);
	struct canvas c = {p->width, p->height, malloc(pixels * 3 * sizeof(float)),
			   malloc(longest * 3 * sizeof(float))};
	uint64_t state = p->seed;
	int ret = -ENOMEM;

	if (!data || !c.rgb || !c.row)
		goto out;
	paint_liver(&c, p, &state);
	if (p->length_px > 0)
		lay_scalpel(&c, p, false);
	if (p->blade_px > 0)
		lay_scalpel(&c, p, true);
	lay_spots(&c, p, &state);
	if (p->blur_px > 0)
		blur(&c, p->blur_px);
	to_bytes(&c, p, data, stride, &state);
	*frame = (struct incise_camera_frame){
		.width = p->width,
		.height = p->height,
		.stride = stride,
		.pixels = p->pixels,
		.data = data,
		.size = (size_t)stride * p->height,
	};
	data = NULL;
	ret = 0;
out:
	free(data);
	free(c.rgb);
	free(c.row);
	return ret;
}
