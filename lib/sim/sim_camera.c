// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The virtual camera: 640 × 480 RGB of a black scalpel over liver, drawn when it is read.
 * Pixel (0, 0) covers 0 … 1 in both directions, top row first.
 *
 *       +----------------------+    The camera moves with the blade; the liver passes
 *       |         ##           |    behind. The scalpel's axis is turned 0.05 rad from
 *       |         ##           |    the vertical. Its sheath and handle are 47.5 mm long;
 *       |  liver  ##  47.5 mm  |    the part below the surface is hidden: the visible
 *       |         ##  - depth  |    part has 400 px at the default scale, minus
 *       |        ##            |    depth / camera_mm_px. In the air all of it is visible,
 *       |......[entry].........|    and moves up by its height.
 *       +----------------------+
 *
 * The lean of the hand is left out: the frame shows the axis as it is in the tissue.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/random.h"
#include "sim.h"
#include "world.h"

#define WIDTH 640
#define HEIGHT 480
#define STRIDE (WIDTH * 3)

#define SCALPEL_MM 47.5 /* Song et al. (2006), §2 */
#define SCALPEL_WIDE_MM 8.0
#define ROLL 0.05 /* rad */
#define ENTRY_X (WIDTH / 2.0)
/*
 * 5 mm and a tremor above the surface the scalpel still ends in the frame, at the finest
 * scale: 462 - (47.5 + 5.03) / 0.118 > 16.
 */
#define ENTRY_Y 462.0

#define LIVER_PERIOD 1024 /* pixels, after which the texture repeats */
#define NOISE_SIZE 65536
#define WAIT_MOST 24 /* frames, for a late reader */

#define NOISE_LEVELS 2.0 /* sd of the sensor's noise */

/* Far enough from 0 and 255 that noise, 6.7 sd at most, cannot overflow. */
static const double liver_rgb[3] = {118, 46, 38};
static const double liver_spread[3] = {30, 16, 14}; /* ± */
static const double scalpel_rgb[3] = {24, 24, 26};

struct sim_camera {
	struct incise_camera camera;
	struct incise_sim *sim;
	uint64_t key;
	uint64_t next, first; /* next frame by the world's count; frame of seq 0 */
	uint64_t lost;
	uint8_t *rgb;	/* HEIGHT rows */
	uint8_t *liver; /* HEIGHT rows of LIVER_PERIOD pixels */
	int8_t *noise;
};

static struct sim_camera *of_camera(const struct incise_camera *camera)
{
	return (struct sim_camera *)camera;
}

/* Smooth noise in -1 … 1 on a lattice of @cells per period. */
static double lattice(uint64_t key, int cells, double x, double y)
{
	int i = (int)x, j = (int)y;
	double u = x - i, v = y - j;
	double corner[2][2];

	for (int b = 0; b < 2; b++)
		for (int a = 0; a < 2; a++)
			corner[b][a] =
				2 * incise_random_uniform(key, (j + b) * cells +
								       (i + a) % cells) -
				1;
	u = u * u * (3 - 2 * u);
	v = v * v * (3 - 2 * v);
	return (corner[0][0] * (1 - u) + corner[0][1] * u) * (1 - v) +
	       (corner[1][0] * (1 - u) + corner[1][1] * u) * v;
}

/* Lobules in three sizes, paler and darker. */
static void paint_liver(struct sim_camera *c)
{
	static const struct {
		int cells;
		double share;
	} octave[] = {{8, 0.5}, {32, 0.3}, {128, 0.2}};

	for (int y = 0; y < HEIGHT; y++) {
		uint8_t *pixel = c->liver + (size_t)y * LIVER_PERIOD * 3;

		for (int x = 0; x < LIVER_PERIOD; x++, pixel += 3) {
			double shade = 0;

			for (int k = 0; k < 3; k++) {
				double scale = (double)octave[k].cells / LIVER_PERIOD;

				shade += octave[k].share * lattice(c->key + k,
								   octave[k].cells,
								   x * scale, y * scale);
			}
			for (int k = 0; k < 3; k++)
				pixel[k] =
					(uint8_t)(liver_rgb[k] + shade * liver_spread[k]);
		}
	}
}

static double clip01(double value)
{
	return fmax(0, fmin(1, value));
}

/* Lay the scalpel over one row, from @low to @high px along its axis above the entry. */
static void draw_scalpel(uint8_t *row, int y, double low, double high, double half_px)
{
	double up[2] = {sin(ROLL), -cos(ROLL)}, dy = y + 0.5 - ENTRY_Y;
	double middle = ENTRY_X - dy * tan(ROLL);
	int from = (int)(middle - half_px / cos(ROLL) - 2);
	int to = (int)(middle + half_px / cos(ROLL) + 2);

	for (int x = from > 0 ? from : 0; x <= to && x < WIDTH; x++) {
		double dx = x + 0.5 - ENTRY_X;
		double along = dx * up[0] + dy * up[1];
		double across = fabs(dx * up[1] - dy * up[0]);
		/* Covered share of the pixel, as if the scalpel stood upright. */
		double cover = clip01(along - low + 0.5) * clip01(high - along + 0.5) *
			       clip01(half_px - across + 0.5);

		for (int k = 0; k < 3; k++) {
			uint8_t *level = &row[3 * x + k];

			*level = (uint8_t)(*level + cover * (scalpel_rgb[k] - *level) +
					   0.5);
		}
	}
}

static void draw_sim_camera(struct sim_camera *c, uint64_t n,
			    const struct incise_blade *blade)
{
	double mm_px = c->sim->config.camera_mm_px;
	double height = fmax(0, blade->position_mm[2]);
	double low = height / mm_px;
	double high = low + (SCALPEL_MM - blade->depth_mm) / mm_px;
	long shift = lround(blade->position_mm[0] / mm_px) % LIVER_PERIOD;
	int left = (int)(shift < 0 ? shift + LIVER_PERIOD : shift);
	int before = LIVER_PERIOD - left < WIDTH ? LIVER_PERIOD - left : WIDTH;

	for (int y = 0; y < HEIGHT; y++) {
		const uint8_t *liver = c->liver + (size_t)y * LIVER_PERIOD * 3;
		const int8_t *noise =
			c->noise + incise_random_bits(c->key, n * HEIGHT + y) %
					   (NOISE_SIZE - STRIDE);
		uint8_t *row = c->rgb + (size_t)y * STRIDE;

		memcpy(row, liver + 3 * left, 3 * before);
		memcpy(row + 3 * before, liver, 3 * (WIDTH - before));
		draw_scalpel(row, y, low, high, SCALPEL_WIDE_MM / mm_px / 2);
		for (int i = 0; i < STRIDE; i++)
			row[i] = (uint8_t)(row[i] + noise[i]);
	}
}

void incise_sim_vision_setup(const struct incise_sim_config *config,
			     struct incise_vision_setup *setup)
{
	/* In HSV's value between the scalpel, 26, and the darkest liver, 88. */
	*setup = (struct incise_vision_setup){
		.hue = {0, 179},
		.saturation = {0, 255},
		.value = {0, 60},
		.full_px = SCALPEL_MM / config->camera_mm_px,
		.depth_mm_px = config->camera_mm_px,
	};
}

double incise_sim_camera_exposed_px(const struct incise_sim *sim, int64_t t_ns)
{
	struct incise_blade blade;

	incise_surgeon_blade(&sim->surgeon, t_ns - sim->start_ns, &blade);
	return (SCALPEL_MM - blade.depth_mm) / sim->config.camera_mm_px;
}

static int sim_camera_read(struct incise_camera *camera,
			   struct incise_camera_frame *frame)
{
	struct sim_camera *c = of_camera(camera);
	double hz = c->sim->config.camera_hz;
	int64_t now = incise_clock_now(c->sim->clock) - c->sim->start_ns;
	struct incise_blade blade;
	uint64_t newest, n;

	if (incise_sim_time(c->next, hz) > now)
		return 0;
	newest = (uint64_t)((double)now * (hz / INCISE_NS_PER_S));
	while (newest > c->next && incise_sim_time(newest, hz) > now)
		newest--;
	if (newest < c->next)
		newest = c->next;
	n = newest - c->next < WAIT_MOST ? c->next : newest - WAIT_MOST + 1;
	c->lost += n - c->next;
	c->next = n + 1;
	/* The surgeon is a function of time: the world need not stop for a frame. */
	incise_surgeon_blade(&c->sim->surgeon, incise_sim_time(n, hz), &blade);
	draw_sim_camera(c, n, &blade);
	*frame = (struct incise_camera_frame){
		.t_ns = c->sim->start_ns + incise_sim_time(n, hz),
		.seq = n - c->first,
		.width = WIDTH,
		.height = HEIGHT,
		.stride = STRIDE,
		.pixels = INCISE_PIXELS_RGB,
		.data = c->rgb,
		.size = (size_t)HEIGHT * STRIDE,
	};
	return 1;
}

static void sim_camera_info(const struct incise_camera *camera,
			    struct incise_camera_info *info)
{
	*info = (struct incise_camera_info){
		.rate_hz = of_camera(camera)->sim->config.camera_hz,
		.width = WIDTH,
		.height = HEIGHT,
	};
	snprintf(info->name, sizeof(info->name), "virtual camera");
}

static uint64_t sim_camera_lost(const struct incise_camera *camera)
{
	return of_camera(camera)->lost;
}

static void sim_camera_close(struct incise_camera *camera)
{
	struct sim_camera *c = of_camera(camera);

	free(c->rgb);
	free(c->liver);
	free(c->noise);
	free(c);
}

static const struct incise_camera_ops ops = {
	.read = sim_camera_read,
	.info = sim_camera_info,
	.lost = sim_camera_lost,
	.close = sim_camera_close,
};

struct incise_camera *incise_sim_camera_new(struct incise_sim *sim)
{
	struct sim_camera *c = calloc(1, sizeof(*c));

	if (!c)
		goto fail;
	c->rgb = malloc((size_t)HEIGHT * STRIDE);
	c->liver = malloc((size_t)HEIGHT * LIVER_PERIOD * 3);
	c->noise = malloc(NOISE_SIZE);
	if (!c->rgb || !c->liver || !c->noise)
		goto fail_close;
	c->camera.ops = &ops;
	c->sim = sim;
	c->key = incise_random_key(sim->config.seed, INCISE_RANDOM_CAMERA);
	c->next = c->first = incise_sim_first(sim, sim->config.camera_hz);
	paint_liver(c);
	for (int i = 0; i < NOISE_SIZE; i++)
		c->noise[i] = (int8_t)lround(NOISE_LEVELS *
					     incise_random_normal(c->key + 3, i));
	return &c->camera;
fail_close:
	sim_camera_close(&c->camera);
fail:
	errno = ENOMEM;
	return NULL;
}
