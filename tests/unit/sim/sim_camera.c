// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/sim/sim_camera.c: the scalpel in the frame has its true length, measured
 * from pixels alone; frames keep their times and count their losses.
 */
#include "../unit.h"
#include "../../../lib/sim/sim.h"

#define START_NS INCISE_NS_PER_S
#define DARK 70 /* red: half-way between scalpel, 24, and liver, 88 and more */

struct rig {
	struct incise_clock *clock;
	struct incise_sim *sim;
	struct incise_camera *camera;
};

static struct rig rig_new(uint64_t seed, double camera_mm_px)
{
	struct rig rig = {.clock = incise_clock_new_simulated(START_NS)};
	struct incise_sim_config config;

	incise_sim_config_init(&config);
	config.seed = seed;
	config.camera_mm_px = camera_mm_px;
	rig.sim = incise_sim_new(&config, rig.clock, NULL);
	assert_non_null(rig.sim);
	rig.camera = incise_sim_camera_new(rig.sim);
	return rig;
}

static void rig_free(struct rig *rig)
{
	rig->camera->ops->close(rig->camera);
	incise_sim_free(rig->sim);
	incise_clock_free(rig->clock);
}

static double red(const struct incise_camera_frame *frame, int x, int y)
{
	if (x < 0 || y < 0 || x >= frame->width || y >= frame->height)
		return 118; /* as liver: the edge of the frame is no edge of the scalpel */
	return frame->data[y * frame->stride + 3 * x];
}

static double red_between(const struct incise_camera_frame *frame, double x, double y)
{
	int i = (int)floor(x - 0.5), j = (int)floor(y - 0.5);
	double u = x - 0.5 - i, v = y - 0.5 - j;

	return (red(frame, i, j) * (1 - u) + red(frame, i + 1, j) * u) * (1 - v) +
	       (red(frame, i, j + 1) * (1 - u) + red(frame, i + 1, j + 1) * u) * v;
}

/* Half-height edges along the axis of what is dark: their distance, pixels. */
static double measure_px(const struct incise_camera_frame *frame)
{
	double n = 0, sy = 0, sx = 0, syy = 0, sxy = 0, slope, x0, y0, norm;
	double profile[2200], edge[2] = {NAN, NAN};
	int top = frame->height, bottom = 0, samples = 0, middle;

	for (int y = 0; y < frame->height; y++) {
		int dark = 0;

		for (int x = 0; x < frame->width; x++)
			dark += red(frame, x, y) < DARK;
		if (dark < 5)
			continue;
		top = y < top ? y : top;
		bottom = y;
	}
	/* A line through the rows' middles, away from the slanting ends. */
	for (int y = top + 8; y <= bottom - 8; y++) {
		double dark = 0, sum = 0;

		for (int x = 0; x < frame->width; x++)
			if (red(frame, x, y) < DARK) {
				dark++;
				sum += x + 0.5;
			}
		n++;
		sy += y + 0.5;
		sx += sum / dark;
		syy += (y + 0.5) * (y + 0.5);
		sxy += (y + 0.5) * sum / dark;
	}
	slope = (n * sxy - sx * sy) / (n * syy - sy * sy);
	norm = sqrt(1 + slope * slope);
	y0 = top - 15;
	x0 = sx / n + slope * (y0 - sy / n);
	/* Red along the axis every quarter pixel, over the middle columns. */
	for (double s = 0; s < (bottom - top + 30) * norm && samples < 2200; s += 0.25) {
		double sum = 0;

		for (int c = -8; c <= 8; c++)
			sum += red_between(frame, x0 + (s * slope + c) / norm,
					   y0 + (s - c * slope) / norm);
		profile[samples++] = sum / 17;
	}
	middle = samples / 2;
	for (int end = 0; end < 2; end++) {
		int out = end ? 1 : -1, edge_at = middle;
		double bright, half;

		while (profile[edge_at] < DARK)
			edge_at += out;
		/* The liver's level beside the edge: 1.5 to 2.5 px beyond it. */
		bright = 0;
		for (int i = 6; i <= 10; i++)
			bright += profile[edge_at + out * i] / 5;
		half = (bright + profile[middle]) / 2;
		while (profile[edge_at] >= half)
			edge_at -= out;
		edge[end] = edge_at + out * (half - profile[edge_at]) /
					      (profile[edge_at + out] - profile[edge_at]);
	}
	return (edge[1] - edge[0]) / 4;
}

TEST(picture_shows_the_true_length)
{
	/* Protocol time, s: at rest in the air, entering, deep at 5 mm, at 20 mm, leaving. */
	static const double at_s[] = {0,   0.5,	  1.5,	 2.5, 4,   6,
				      8.4, 100.3, 102.5, 104, 107, 130};
	static const double scale[] = {47.5 / 400, 0.118, 0.25};
	double shortest = 1e9, longest = 0;

	for (size_t k = 0; k < 3; k++) {
		struct rig rig = rig_new(k + 1, scale[k]);

		for (size_t i = 0; i < sizeof(at_s) / sizeof(at_s[0]); i++) {
			struct incise_camera_frame frame;
			double truth, seen;

			incise_clock_wait_until(rig.clock,
						START_NS + llround(at_s[i] * 1e9));
			assert_int_equal(incise_camera_newest(rig.camera, &frame), 1);
			truth = incise_sim_camera_exposed_px(rig.sim, frame.t_ns);
			seen = measure_px(&frame);
			/*
			 * The entry lies at 462 of 480 rows: the level below it can be taken.
			 * Coverage is linear over the edge pixel, so its half height is the
			 * edge; liver that changes by a few of 90 levels over 2 px moves it
			 * by some hundredths, noise of 2/√17 levels by less. Measured by
			 * others: 0.045 px (facts on cameras). An edge wrong by its usual
			 * half pixel would show.
			 */
			assert_true(fabs(seen - truth) < 0.15);
			shortest = fmin(shortest, seen * scale[k]);
			longest = fmax(longest, seen * scale[k]);
		}
		rig_free(&rig);
	}
	/* Whole in the air, 20 mm and its drift less at the deepest. */
	assert_true(fabs(longest - 47.5) < 0.15 * 0.25);
	assert_true(shortest < 28.5 && shortest > 26.8);
}

TEST(geometry_is_the_papers)
{
	struct rig rig = rig_new(1, 47.5 / 400);
	struct incise_sim_truth truth;

	assert_true(fabs(incise_sim_camera_exposed_px(rig.sim, START_NS) - 400) < 1e-9);
	for (double t = 0; t < 20; t += 0.37) {
		incise_clock_wait_until(rig.clock, START_NS + llround(t * 1e9));
		incise_sim_truth(rig.sim, &truth);
		assert_true(fabs(incise_sim_camera_exposed_px(rig.sim, truth.t_ns) -
				 (400 - truth.depth_mm / 0.11875)) < 1e-9);
	}
	rig_free(&rig);
}

/* The pixels within what is given for vision, value alone: the scalpel's area, no more. */
TEST(setup_for_vision_is_of_the_scalpel)
{
	static const double scale[] = {47.5 / 400, 0.25, 0.5};

	for (size_t k = 0; k < 3; k++) {
		struct rig rig = rig_new(k + 1, scale[k]);
		struct incise_vision_setup setup;
		struct incise_camera_frame frame;
		double seen = 0, truth;

		incise_sim_vision_setup(incise_sim_config(rig.sim), &setup);
		assert_true(fabs(setup.full_px * scale[k] - 47.5) < 1e-9);
		assert_true(setup.depth_mm_px == scale[k]);
		incise_clock_wait_until(rig.clock, START_NS + 4000000000LL);
		assert_int_equal(incise_camera_newest(rig.camera, &frame), 1);
		for (int i = 0; i < frame.width * frame.height; i++) {
			const uint8_t *rgb = frame.data + 3 * i;
			int value = fmax(rgb[0], fmax(rgb[1], rgb[2]));

			seen += value >= setup.value[0] && value <= setup.value[1];
		}
		/* 8 mm wide; the threshold is within a quarter pixel of half height, all
		 * around: 2 (w + h) / 4 of w h */
		truth = incise_sim_camera_exposed_px(rig.sim, frame.t_ns);
		truth *= 8 / scale[k];
		assert_true(fabs(seen - truth) <
			    (truth / (8 / scale[k]) + 8 / scale[k]) / 2);
		rig_free(&rig);
	}
}

TEST(pictures_wait_and_are_lost)
{
	/* ms, whether there is a frame, its number, losses so far */
	static const int row[][4] = {
		{0, 1, 0, 0},
		{0, 0, 0, 0},
		{19, 0, 0, 0},
		{20, 1, 1, 0},
		{59, 1, 2, 0},
		{60, 1, 3, 0},
		{145, 1, 4, 0},
		{145, 1, 5, 0},
		{145, 1, 6, 0},
		{145, 1, 7, 0},
		{159, 0, 0, 0},
		{160, 1, 8, 0},
		/* 24 wait at most: 477 to 500 */
		{10000, 1, 477, 468},
		{10000, 1, 478, 468},
	};
	struct rig rig = rig_new(1, 47.5 / 400);
	struct incise_camera_frame frame;

	for (size_t i = 0; i < sizeof(row) / sizeof(row[0]); i++) {
		incise_clock_wait_until(rig.clock, START_NS + row[i][0] * 1000000LL);
		assert_int_equal(incise_camera_read(rig.camera, &frame), row[i][1]);
		assert_int_equal(incise_camera_lost(rig.camera), row[i][3]);
		if (!row[i][1])
			continue;
		assert_int_equal(frame.seq, row[i][2]);
		assert_int_equal(frame.t_ns, START_NS + row[i][2] * 20000000LL);
		assert_int_equal(frame.width, 640);
		assert_int_equal(frame.height, 480);
		assert_true(frame.stride >= 640 * 3);
	}
	assert_int_equal(incise_camera_newest(rig.camera, &frame), 1);
	assert_int_equal(frame.seq, 500);
	assert_int_equal(incise_camera_newest(rig.camera, &frame), 0);
	assert_int_equal(frame.seq, 500); /* as it was */
	assert_int_equal(incise_camera_lost(rig.camera), 468);
	rig_free(&rig);
}

static uint8_t *picture(uint64_t seed, int ms, int skip_ms)
{
	struct rig rig = rig_new(seed, 47.5 / 400);
	struct incise_camera_frame frame;
	uint8_t *copy = malloc(640 * 480 * 3);

	if (skip_ms) {
		incise_clock_wait_until(rig.clock, START_NS + skip_ms * 1000000LL);
		incise_camera_newest(rig.camera, &frame);
	}
	incise_clock_wait_until(rig.clock, START_NS + ms * 1000000LL);
	assert_int_equal(incise_camera_newest(rig.camera, &frame), 1);
	for (int y = 0; y < 480; y++)
		memcpy(copy + y * 640 * 3, frame.data + y * frame.stride, 640 * 3);
	rig_free(&rig);
	return copy;
}

TEST(pictures_are_the_seeds)
{
	uint8_t *a = picture(1, 3000, 0), *b = picture(1, 3000, 500),
		*c = picture(2, 3000, 0);
	long dark = 0, black = 0;

	assert_memory_equal(a, b, 640 * 480 * 3);
	assert_memory_not_equal(a, c, 640 * 480 * 3);
	for (int i = 0; i < 640 * 480; i++) {
		/* Nothing wraps round: no level is far from both scalpel and liver. */
		assert_true(a[3 * i] < 118 + 30 + 14 && a[3 * i] > 24 - 14);
		dark += a[3 * i] < DARK;
		black += a[3 * i] < DARK && a[3 * i + 2] < 26 + 14;
	}
	/* 8 mm by what is exposed; the edges' half pixels are half dark. */
	assert_true(dark > 67 * 340 && dark < 68 * 400);
	assert_true(black > dark * 0.97);
	free(a);
	free(b);
	free(c);
}

TEST(info_names_the_camera)
{
	struct rig rig = rig_new(1, 47.5 / 400);
	struct incise_camera_info info;

	incise_camera_info(rig.camera, &info);
	assert_true(info.rate_hz == 50);
	assert_int_equal(info.width, 640);
	assert_int_equal(info.height, 480);
	assert_string_equal(info.name, "virtual camera");
	rig_free(&rig);
}
