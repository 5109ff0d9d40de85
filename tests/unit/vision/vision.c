// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/vision/vision.cc, handle.cc, edge.cc: the exposed length compared with the truth of frames
 * that are drawn outside the library (tests/vision/scalpel_picture.c), and of
 * the virtual camera. Results are printed for the log. Learnt thresholds find the handle.
 */
#include "../unit.h"
#include <incise/vision.h>
#include "../../../lib/sim/sim.h"
#include "../../vision/scalpel_picture.h"
#include "../cases.h"

/* A sanitizer slows them ten times down, and sees in a few what it sees in all. */
#define FRAMES cases_of(16, 4)

static const struct incise_vision_setup black = {
	.hue = {0, 179},
	.saturation = {0, 255},
	.value = {0, 60},
	.full_px = 400,
	.depth_mm_px = 0.11875,
};

static void small(struct scalpel_picture *p)
{
	scalpel_picture_init(p);
	p->width = 320;
	p->height = 320;
	p->x = 160;
	p->y = 280;
	p->length_px = 220;
}

static struct incise_vision *vision_of(const struct incise_vision_setup *setup)
{
	struct incise_vision *vision = incise_vision_new(setup, NULL);

	assert_non_null(vision);
	return vision;
}

static struct incise_vision_result measured_by(const struct incise_vision_setup *setup,
					       const struct scalpel_picture *p)
{
	struct incise_vision *vision = vision_of(setup);
	struct incise_vision_result result;
	struct incise_camera_frame frame;

	assert_int_equal(scalpel_picture_draw(p, &frame), 0);
	assert_int_equal(incise_vision_measure(vision, &frame, &result), 0);
	free((void *)frame.data);
	incise_vision_free(vision);
	return result;
}

static struct incise_vision_result measured(const struct scalpel_picture *p)
{
	struct incise_vision_setup setup = black;

	/* Liver is 67 levels in grey: less than in red, which the value is in colour. */
	if (p->pixels == INCISE_PIXELS_GREY)
		setup.value[1] = 45;
	return measured_by(&setup, p);
}

struct condition {
	const char *name;
	struct scalpel_picture with; /* differences from small() */
	double most_deg;	     /* of tilt, both ways; 0: 20, -1: none */
	double sd_px;		     /* limit; 0: the 0.05 px of issue 7 */
	int refused;		     /* largest number of frames without a result */
};

/*
 * Cramer and Rao's bound in edge.c, texture included, is above the 0.05 px of issue 7 for 8
 * levels of noise with a blur of 2 px (0.082 px), in grey at 4 levels (0.051) and in YUYV
 * at 8 (0.098): there 1.15 times the bound is allowed.
 */
#define GREY INCISE_PIXELS_GREY
#define YUYV INCISE_PIXELS_YUYV
static const struct condition conditions[] = {
	{"sharp", {.texture = 12}, 0, 0, 0},
	{"no texture", {.texture = 0}, 0, 0, 0},
	{"upright", {.texture = 12, .blur_px = 0.5, .noise = 1}, -1, 0, 0},
	{"blur 1", {.texture = 12, .blur_px = 1}, 0, 0, 0},
	{"blur 2", {.texture = 12, .blur_px = 2}, 0, 0, 0},
	{"noise 2", {.texture = 12, .noise = 2, .blur_px = 1}, 0, 0, 0},
	{"noise 8", {.texture = 12, .noise = 8, .blur_px = 1}, 0, 0.06, 0},
	{"noise 8, blur 2", {.texture = 12, .noise = 8, .blur_px = 2}, 0, 0.09, 0},
	{"6 spots", {.texture = 12, .noise = 2, .blur_px = 1, .spots = 6}, 0, 0, 0},
	{"12 spots", {.texture = 12, .noise = 2, .blur_px = 1, .spots = 12}, 0, 0.06, 5},
	{"gradient", {.texture = 12, .noise = 2, .blur_px = 1, .gradient = 0.5}, 0, 0, 0},
	{"flicker", {.texture = 12, .noise = 2, .blur_px = 1, .light = 0.3}, 0, 0, 0},
	{"level", {.texture = 12, .noise = 2, .blur_px = 1, .level = true}, 0, 0, 0},
	{"blade", {.texture = 12, .noise = 2, .blur_px = 1, .blade_px = 8}, 0, 0, 0},
	{"all",
	 {.texture = 12,
	  .noise = 4,
	  .blur_px = 1,
	  .spots = 6,
	  .gradient = 0.3,
	  .light = 0.2,
	  .level = true},
	 0,
	 0.06,
	 2},
	{"grey, noise 4",
	 {.texture = 12, .noise = 4, .blur_px = 1, .pixels = GREY},
	 0,
	 0.06,
	 0},
	{"yuyv, noise 2",
	 {.texture = 12, .noise = 2, .blur_px = 1, .pixels = YUYV},
	 0,
	 0,
	 0},
	{"yuyv, 6 spots",
	 {.texture = 12, .noise = 2, .blur_px = 1, .spots = 6, .pixels = YUYV},
	 0,
	 0.06,
	 2},
	{"yuyv, noise 8",
	 {.texture = 12, .noise = 8, .blur_px = 1, .pixels = YUYV},
	 0,
	 0.115,
	 0},
};

/* Of the test that runs. */
static struct scalpel_picture p;
static struct incise_vision_result r;
static struct incise_camera_frame frame;

TEST(length_is_that_of_the_picture)
{
	for (size_t k = 0; k < sizeof(conditions) / sizeof(*conditions); k++) {
		const struct condition *c = &conditions[k];
		double sum = 0, square = 0, said = 0, worst = 0, quality = 1;
		double tilt = c->most_deg < 0 ? 0 : 20;
		int n = 0;
		uint64_t random = 100 + k;

		for (int i = 0; i < FRAMES; i++) {
			double error;

			small(&p);
			p.pixels = c->with.pixels;
			p.blur_px = c->with.blur_px;
			p.noise = c->with.noise;
			p.spots = c->with.spots;
			p.gradient = c->with.gradient;
			p.level = c->with.level;
			p.texture = c->with.texture;
			p.blade_px = c->with.blade_px;
			p.light +=
				c->with.light * (2 * scalpel_picture_random(&random) - 1);
			p.angle_deg = tilt * (2 * scalpel_picture_random(&random) - 1);
			p.x += scalpel_picture_random(&random);
			p.y += scalpel_picture_random(&random);
			p.length_px += 10 * scalpel_picture_random(&random);
			p.seed = 1000 * k + i;
			r = measured(&p);
			if (!r.found)
				continue;
			n++;
			error = r.length_px - p.length_px;
			worst = fmax(worst, fabs(error));
			sum += error;
			square += error * error;
			said += r.sd_px * r.sd_px;
			quality = fmin(quality, r.quality);
			/* The axis is accurate to a fraction of a pixel over its length. */
			assert_true(fabs(r.axis[0] + sin(p.angle_deg * M_PI / 180)) <
				    0.005);
			assert_true(fabs(r.edge_px[0] - p.x) < 1);
			assert_true(fabs(r.edge_px[1] - p.y) < 1);
			assert_true(fabs(r.depth_mm - (400 - r.length_px) * 0.11875) <
				    1e-9);
		}
		assert_true(n >= FRAMES - c->refused);
		sum /= n;
		square = sqrt(fmax(0, square / n - sum * sum));
		said = sqrt(said / n);
		print_message(
			"%-16s %d of %d: bias %+.3f px, sd %.3f (said %.3f), worst %.3f, "
			"quality %.2f at least\n",
			c->name, n, FRAMES, sum, square, said, worst, quality);
		assert_true(fabs(sum) <= 0.1);
		/* 1.45: limit of chance for the sd of 16, at 99 % */
		assert_true(square <= 1.45 * (c->sd_px > 0 ? c->sd_px : 0.05));
	}
}

static void assert_not_found(const struct incise_vision_result *r, const char *why)
{
	assert_false(r->found);
	assert_true(isnan(r->length_px) && isnan(r->depth_mm) && isnan(r->sd_px));
	assert_true(isnan(r->edge_px[0]) && isnan(r->axis[1]) && r->quality == 0);
	assert_non_null(strstr(r->why, why));
}

TEST(without_a_scalpel_it_says_so)
{
	for (int i = 0; i < 4; i++) {
		small(&p);
		p.length_px = 0;
		p.noise = 2 * i;
		p.spots = 8 * i;
		p.pixels = i % 2 ? YUYV : INCISE_PIXELS_RGB;
		r = measured(&p);
		assert_not_found(&r, "nothing has the handle's colour");
	}
}

TEST(what_reaches_the_border_is_not_measured)
{
	/* above, below, and at an angle through a side */
	static const double y[] = {180, 340, 300}, angle[] = {0, 0, 50};

	for (int i = 0; i < 3; i++) {
		small(&p);
		p.x += i == 2 ? 30 : 0;
		p.y = y[i];
		p.angle_deg = angle[i];
		r = measured(&p);
		assert_not_found(&r, "");
	}
}

/* A rectangle of black pixels. */
static void blacken(struct incise_camera_frame *frame, int x, int y, int width,
		    int height)
{
	for (int j = y; j < y + height; j++)
		memset((uint8_t *)frame->data + (size_t)j * frame->stride + 3 * x, 20,
		       3 * (size_t)width);
}

TEST(of_several_dark_things_the_handle_is_taken)
{
	struct incise_vision *vision = vision_of(&black);

	scalpel_picture_init(&p);
	p.angle_deg = 8;
	p.noise = 2;
	p.blur_px = 1;
	assert_int_equal(scalpel_picture_draw(&p, &frame), 0);
	blacken(&frame, 20, 100, 200, 180); /* larger, not long */
	blacken(&frame, 500, 200, 40, 200); /* a handle's form, smaller */
	blacken(&frame, 0, 440, 200, 40);   /* flat, at the border */
	blacken(&frame, 580, 0, 60, 480);   /* through all of the frame */
	for (int i = 0; i < 3; i++) {
		assert_int_equal(incise_vision_measure(vision, &frame, &r), 0);
		assert_true(r.found);
		assert_true(fabs(r.length_px - p.length_px) < 0.2);
	}
	free((void *)frame.data);
	incise_vision_free(vision);
}

/* A rectangle of one colour. */
static void paint(struct incise_camera_frame *frame, int x, int y, int width, int height,
		  const uint8_t *rgb)
{
	for (int j = y; j < y + height; j++)
		for (int i = x; i < x + width; i++)
			memcpy((uint8_t *)frame->data + (size_t)j * frame->stride + 3 * i,
			       rgb, 3);
}

/*
 * A length that is wrong by tens of pixels must not have a good quality. The handle is
 * upright, 67 pixels wide, from row 100 to row 400.
 */
TEST(what_only_looks_like_the_handle_costs_quality)
{
	static const struct {
		const char *name;
		int y, height, half; /* of the painted box */
		uint8_t rgb[3];
		double most;	 /* quality; 1: unaffected */
		const char *why; /* not found */
	} cases[] = {
		{"reflection across", 200, 12, 40, {230, 230, 230}, 0, "cut in two"},
		{"wide reflection across", 220, 30, 40, {230, 230, 230}, 0, "cut in two"},
		{"reflection near the end", 370, 14, 40, {90, 90, 90}, 0, "cut in two"},
		{"wide one near the end", 366, 24, 40, {230, 230, 230}, 0, "cut in two"},
		{"mirror image", 400, 60, 34, {45, 45, 45}, 0.25, NULL},
		{"blood", 400, 60, 34, {50, 10, 10}, 0.25, NULL},
		{"shadow", 400, 40, 34, {35, 14, 11}, 0.25, NULL},
		{"blood at the edge", 400, 6, 45, {50, 10, 10}, 0.4, NULL},
		{"dark, but not the handle's", 400, 60, 34, {70, 30, 25}, 1, NULL},
		{"light that fades", 0, 0, 0, {0, 0, 0}, 1, NULL},
	};

	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		struct incise_vision *vision = vision_of(&black);

		scalpel_picture_init(&p);
		p.y = 400;
		p.length_px = 300;
		p.noise = 2;
		p.blur_px = 1;
		p.gradient = cases[k].half ? 0 : 1.2;
		assert_int_equal(scalpel_picture_draw(&p, &frame), 0);
		paint(&frame, 320 - cases[k].half, cases[k].y, 2 * cases[k].half,
		      cases[k].height, cases[k].rgb);
		/* The second search is in the region of interest, if there is one. */
		for (int i = 0; i < 2; i++) {
			assert_int_equal(incise_vision_measure(vision, &frame, &r), 0);
			print_message("%s: %s, %.1f px off, quality %.2f\n",
				      cases[k].name, r.found ? "found" : r.why,
				      r.length_px - 300, r.quality);
			assert_int_equal(r.found, !cases[k].why);
			if (!r.found) {
				assert_not_found(&r, cases[k].why);
				continue;
			}
			assert_true(r.quality <= cases[k].most);
			if (cases[k].most == 1) {
				assert_true(r.quality > 0.6);
				assert_true(fabs(r.length_px - 300) < 1);
			}
		}
		free((void *)frame.data);
		incise_vision_free(vision);
	}
}

/* The region of interest does not affect the result, wherever the handle jumps. */
TEST(the_region_follows)
{
	struct incise_vision *vision = vision_of(&black);
	double last = 0;

	scalpel_picture_init(&p);
	p.noise = 2;
	p.blur_px = 1;
	for (int i = 0; i < 8; i++) {
		struct incise_vision_result r, alone;

		p.x = i == 4 ? 100 : 320 + 8 * i;
		p.angle_deg = 2 * i;
		p.length_px = i == 6 ? 0 : 340;
		p.seed = i;
		assert_int_equal(scalpel_picture_draw(&p, &frame), 0);
		frame.t_ns = 1000 + i;
		assert_int_equal(incise_vision_measure(vision, &frame, &r), 0);
		free((void *)frame.data);
		alone = measured(&p);
		assert_int_equal(r.t_ns, 1000 + i);
		assert_int_equal(r.found, i != 6);
		assert_int_equal(alone.found, i != 6);
		if (i != 6)
			/* the mask differs by a row, the edges do not */
			assert_true(fabs(r.length_px - alone.length_px) < 0.02);
		last = r.length_px;
	}
	assert_true(last > 0);
	incise_vision_free(vision);
}

/* The virtual rig: over a cut, every 10th frame. */
TEST(the_virtual_cameras_truth)
{
	struct incise_clock *clock = incise_clock_new_simulated(INCISE_NS_PER_S);
	struct incise_vision *vision = vision_of(&black);
	struct incise_sim_config config;
	struct incise_camera *camera;
	struct incise_sim *sim;
	double sum = 0, square = 0;
	int n = 0;

	incise_sim_config_init(&config);
	sim = incise_sim_new(&config, clock, NULL);
	assert_non_null(sim);
	camera = incise_sim_camera_new(sim);
	assert_non_null(camera);
	for (int i = 0; i < 40; i++) {
		double error;

		incise_clock_wait_until(
			clock, INCISE_NS_PER_S + (int64_t)(i * 0.2 * INCISE_NS_PER_S));
		if (incise_camera_newest(camera, &frame) != 1)
			continue;
		assert_int_equal(incise_vision_measure(vision, &frame, &r), 0);
		if (!r.found)
			print_message("picture %d: %s\n", i, r.why);
		assert_true(r.found);
		assert_int_equal(r.t_ns, frame.t_ns);
		error = r.length_px - incise_sim_camera_exposed_px(sim, frame.t_ns);
		sum += error;
		square += error * error;
		n++;
	}
	assert_true(n >= 30);
	sum /= n;
	square = sqrt(fmax(0, square / n - sum * sum));
	print_message("virtual camera: bias %+.3f px, sd %.3f of %d\n", sum, square, n);
	assert_true(fabs(sum) <= 0.1);
	assert_true(square <= 0.05);
	camera->ops->close(camera);
	incise_sim_free(sim);
	incise_clock_free(clock);
	incise_vision_free(vision);
}

TEST(sizes_that_do_not_fit_are_refused)
{
	static uint8_t data[64 * 64 * 3];
	static const struct incise_camera_frame good = {.width = 64,
							.height = 64,
							.stride = 192,
							.data = data,
							.size = sizeof(data)};
	struct incise_vision *vision = vision_of(&black);
	struct incise_camera_frame bad[12];

	assert_int_equal(incise_vision_measure(vision, &good, &r), 0);
	for (int i = 0; i < 12; i++)
		bad[i] = good;
	bad[0].width = 0;
	bad[1].height = -1;
	bad[2].stride = 191;
	bad[3].stride = -192;
	bad[4].size = sizeof(data) - 1;
	bad[5].data = NULL;
	bad[6].width = 65;
	bad[7].stride = INT32_MAX;
	bad[8].width = bad[8].height = INT32_MAX;
	bad[9].pixels = (enum incise_pixels)99;
	bad[10].width = bad[10].height = 15;
	bad[11].pixels = YUYV;
	bad[11].width = 63;
	for (int i = 0; i < 12; i++) {
		assert_int_equal(incise_vision_measure(vision, &bad[i], &r), -EINVAL);
		assert_not_found(&r, "no picture");
	}
	/* a last row need not be as long as the stride */
	bad[0] = good;
	bad[0].width = 60;
	bad[0].size -= 12;
	assert_int_equal(incise_vision_measure(vision, &bad[0], &r), 0);
	incise_vision_free(vision);
}

TEST(a_setup_out_of_range_is_refused)
{
	struct incise_vision_setup bad[10];

	for (int i = 0; i < 10; i++)
		bad[i] = black;
	bad[0].hue[1] = 180;
	bad[1].hue[0] = -1;
	bad[2].saturation[0] = 256;
	bad[3].value[0] = 61;
	bad[4].value[1] = -1;
	bad[5].full_px = NAN;
	bad[6].depth_mm_px = 0;
	bad[7].depth_mm_px = INFINITY;
	bad[8].roi = (struct incise_vision_box){-1, 0, 10, 10};
	bad[9].roi = (struct incise_vision_box){0, 0, 10, 0};
	for (int i = 0; i < 10; i++) {
		struct incise_error err = {0};

		errno = 0;
		assert_null(incise_vision_new(&bad[i], &err));
		assert_int_equal(errno, EINVAL);
		assert_int_equal(err.code, EINVAL);
	}
	incise_vision_free(NULL);
}

TEST(any_region_will_do)
{
	static const struct incise_vision_box roi[] = {
		{0, 0, 1, 1},	     {INT32_MAX, INT32_MAX, INT32_MAX, INT32_MAX},
		{250, 40, 141, 430}, {0, 0, INT32_MAX, INT32_MAX},
		{300, 200, 40, 40},
	};

	for (size_t i = 0; i < sizeof(roi) / sizeof(*roi); i++) {
		struct incise_vision_setup setup = black;

		scalpel_picture_init(&p);
		p.pixels = i % 2 ? YUYV : INCISE_PIXELS_RGB;
		setup.roi = roi[i];
		setup.full_px = 0;
		r = measured_by(&setup, &p);
		assert_true(r.found);
		assert_true(isnan(r.depth_mm));
		assert_true(fabs(r.length_px - p.length_px) < 0.2);
	}
}

static struct incise_camera_frame drawn_frame(enum incise_pixels pixels, double noise,
					      double *length)
{
	struct incise_camera_frame frame;
	struct scalpel_picture p;

	scalpel_picture_init(&p);
	p.pixels = pixels;
	p.noise = noise;
	p.blur_px = 1;
	*length = p.length_px;
	assert_int_equal(scalpel_picture_draw(&p, &frame), 0);
	return frame;
}

/* On the handle, which is 67 wide at 320, 80 to 440. */
static const struct incise_vision_box box = {301, 201, 35, 91}, click = {320, 250, 1, 1};

TEST(learnt_thresholds_find_the_handle)
{
	static const enum incise_pixels formats[] = {
		INCISE_PIXELS_RGB, INCISE_PIXELS_GREY, INCISE_PIXELS_YUYV};

	for (int k = 0; k < 12; k++) {
		struct incise_vision_setup setup = {.full_px = 7, .depth_mm_px = 3};
		double length;
		struct incise_camera_frame frame =
			drawn_frame(formats[k % 3], k < 6 ? 2 : 4, &length);
		struct incise_vision *vision;

		assert_int_equal(incise_vision_learn(&frame, k % 2 ? &box : &click,
						     &setup, NULL),
				 0);
		/* black: the value alone; noise is 2.1 sd at its 2 %, 24 of RGB 41 in Y */
		assert_int_equal(setup.hue[0], 0);
		assert_int_equal(setup.hue[1], 179);
		assert_int_equal(setup.value[0], 0);
		assert_true(setup.value[1] > 30 && setup.value[1] < 80);
		assert_true(setup.full_px == 7 && setup.depth_mm_px == 3);
		vision = incise_vision_new(&setup, NULL);
		assert_non_null(vision);
		assert_int_equal(incise_vision_measure(vision, &frame, &r), 0);
		assert_true(r.found);
		assert_true(fabs(r.length_px - length) < 0.3);
		incise_vision_free(vision);
		free((void *)frame.data);
	}
}

/* Of one colour, and noise of one level. */
static struct incise_camera_frame plain_frame(uint8_t *data, int red, int green, int blue)
{
	for (int i = 0; i < 64 * 64; i++) {
		data[3 * i] = (uint8_t)(red + i % 2);
		data[3 * i + 1] = (uint8_t)(green + i / 2 % 2);
		data[3 * i + 2] = (uint8_t)(blue + i / 4 % 2);
	}
	return (struct incise_camera_frame){.width = 64,
					    .height = 64,
					    .stride = 192,
					    .data = data,
					    .size = 64 * 64 * 3};
}

TEST(colours_have_a_hue)
{
	static uint8_t data[64 * 64 * 3];
	static const struct incise_vision_box all = {0, 0, 64, 64};
	struct incise_camera_frame frame = plain_frame(data, 20, 200, 20); /* green: 60 */
	struct incise_vision_setup setup = {0};

	assert_int_equal(incise_vision_learn(&frame, &all, &setup, NULL), 0);
	assert_true(setup.hue[0] >= 50 && setup.hue[0] <= 56);
	assert_true(setup.hue[1] >= 64 && setup.hue[1] <= 70);
	assert_true(setup.saturation[0] > 60);
	/* red is at both ends of the scale */
	frame = plain_frame(data, 200, 20, 20);
	assert_int_equal(incise_vision_learn(&frame, &all, &setup, NULL), 0);
	assert_true(setup.hue[0] > 165 && setup.hue[1] < 15);
	/* grey: no hue */
	frame = plain_frame(data, 150, 150, 150);
	assert_int_equal(incise_vision_learn(&frame, &all, &setup, NULL), 0);
	assert_true(setup.hue[0] == 0 && setup.hue[1] == 179);
	assert_true(setup.saturation[1] < 40 && setup.value[0] > 60);
}

TEST(two_colours_are_refused)
{
	static const struct incise_vision_box across = {260, 200, 60, 60};
	struct incise_vision_setup setup = {.value = {1, 2}}, before = setup;
	double length;
	struct incise_camera_frame frame = drawn_frame(INCISE_PIXELS_RGB, 2, &length);

	assert_error(incise_vision_learn(&frame, &across, &setup, &err), ERANGE, &err,
		     NULL);
	assert_memory_equal(&setup, &before, sizeof(setup));
	free((void *)frame.data);
}

TEST(a_box_elsewhere_is_refused)
{
	static const struct incise_vision_box bad[] = {
		{-1, 0, 5, 5},	{0, 0, 0, 5},	      {636, 0, 5, 5},
		{0, 476, 5, 5}, {INT32_MAX, 0, 5, 5}, {5, 5, INT32_MAX, 5},
		{0, -5, 5, 5},
	};
	struct incise_vision_setup setup = {0};
	double length;
	struct incise_camera_frame frame = drawn_frame(INCISE_PIXELS_RGB, 2, &length);

	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++)
		assert_int_equal(incise_vision_learn(&frame, &bad[i], &setup, NULL),
				 -EINVAL);
	frame.stride = 5;
	assert_int_equal(incise_vision_learn(&frame, &box, &setup, NULL), -EINVAL);
	free((void *)frame.data);
}
