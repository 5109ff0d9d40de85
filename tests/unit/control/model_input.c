// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Inputs of a model: names, tilt by a quaternion, the stay in tissue, and the acceleration that the filter
 * finds. Those of a tick are in ../tissue/input.c.
 */
#include "../unit.h"
#include <incise/clock.h>
#include "../../../lib/control/model_input.h"
#include "../../../lib/control/predict.h"

TEST(names_are_found)
{
	for (int i = 0; i < INCISE_MODEL_INPUT_KINDS; i++)
		assert_int_equal(
			incise_model_input_find(incise_model_input_kinds[i].name), i);
	assert_int_equal(incise_model_input_find("depth"), -1);
	assert_int_equal(incise_model_input_find(""), -1);
}

TEST(tilt_is_the_angle)
{
	const double normal[] = {0, 0.6, 0.8}, axis[] = {0, 0.6, 0.8};

	for (int k = 0; k <= 180; k++) {
		double half = k * M_PI / 360;
		/* About x, which is across; the sign of a quaternion does not matter. */
		double q[] = {cos(half), sin(half), 0, 0}, minus[] = {-q[0], -q[1], 0, 0};

		assert_true(fabs(incise_input_tilt_deg(q, axis, normal) - k) < 1e-9);
		assert_true(fabs(incise_input_tilt_deg(minus, axis, normal) - k) < 1e-9);
	}
	assert_true(isnan(incise_input_tilt_deg((double[]){NAN, 0, 0, 0}, axis, normal)));
}

TEST(a_stay_begins_at_the_surface)
{
	/* ms, mm; since when it is inside, ms, or -1 */
	static const struct {
		int t_ms;
		double depth_mm;
		int began_ms;
	} depths[] = {
		{0, -1, -1},	{10, -0.5, -1}, {20, 0.5, 15},	{30, 3, 15},
		{40, -0.1, 15}, /* not out yet */
		{50, 0.4, 15},	{60, -0.3, -1}, {70, -0.1, -1}, {80, 0.3, 72},
	};
	struct incise_stay stay = {0};

	for (size_t i = 0; i < sizeof(depths) / sizeof(*depths); i++) {
		incise_stay_add(&stay, depths[i].t_ms * 1000000LL, depths[i].depth_mm, 0);
		assert_int_equal(stay.inside, depths[i].began_ms >= 0);
		if (stay.inside)
			assert_true(llabs(stay.began_ns -
					  depths[i].began_ms * 1000000LL) < 600000);
	}
	/* From the first depth on, when it is one. */
	stay = (struct incise_stay){0};
	incise_stay_add(&stay, 5, 1, 7);
	assert_true(stay.inside && stay.began_ns == 5);
	assert_true(incise_stay_mean_speed_mm_s(&stay) == 7);
}

/* A speed that rises evenly from the touch on, down for a second and up for one; then another stay. */
TEST(a_stay_keeps_its_path_and_its_deepest_depth)
{
	struct incise_stay stay = {0};

	for (int k = -3; k <= 200; k++) {
		double t_s = k * 0.01, depth_mm = 4 * (t_s < 1 ? t_s : 2 - t_s);

		incise_stay_add(&stay, k * 10000000LL, k < 0 ? -1 : depth_mm,
				k < 0 ? 0 : 5 * t_s);
		if (k < 2)
			continue;
		assert_true(fabs(incise_stay_mean_speed_mm_s(&stay) - 2.5 * t_s) <
			    0.05 * t_s);
		assert_true(stay.deepest_mm == fmax(depth_mm, k < 100 ? 0 : 4));
	}
	/* Without a speed, or long apart. */
	incise_stay_add(&stay, 2010000000, 0.1, NAN);
	assert_true(fabs(stay.path_mm - 10.1) < 0.05);
	incise_stay_add(&stay, 90000000000, 0.1, 10);
	assert_true(fabs(stay.path_mm - 50.1) < 0.05);
	incise_stay_add(&stay, 90100000000, -1, 3);
	incise_stay_add(&stay, 90200000000, 1, 3);
	assert_true(stay.deepest_mm == 1);
	assert_true(fabs(incise_stay_mean_speed_mm_s(&stay) - 3) < 1e-9);
}

/* A hand that is pushed evenly: the filter finds it; and between two ticks nothing leaps. */
TEST(filter_finds_an_even_acceleration)
{
	const struct incise_tracker_info tracker = {
		.name = "t", .rate_hz = 120, .latency_ns = 4200000};
	const double push_mm_s2 = 400;
	struct incise_predict p;
	double last = 0;
	int64_t pose = 0;

	incise_predict_init(&p, &tracker, 0);
	for (int64_t t_ns = 0; t_ns < INCISE_NS_PER_S / 2; t_ns += 1000000) {
		double a[3];

		for (; pose * 8333333 + tracker.latency_ns <= t_ns; pose++) {
			double t_s = (double)(pose * 8333333) * 1e-9;

			incise_predict_add(
				&p, &(struct incise_tracker_sample){
					    .t_ns = pose * 8333333 + tracker.latency_ns,
					    .position_mm = {push_mm_s2 / 2 * t_s * t_s},
					    .quaternion = {1}});
		}
		incise_predict_acceleration(&p, t_ns, a);
		assert_true(fabs(a[0] - last) < push_mm_s2 / 10);
		assert_true(a[1] == 0 && a[2] == 0);
		if (t_ns > 300000000)
			assert_true(fabs(a[0] - push_mm_s2) < 1);
		last = a[0];
	}
}
