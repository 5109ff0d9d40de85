// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The hand that a program moves: the tracker shows what it was told, whole poses only, and
 * what cannot be is refused.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <incise/rig.h>
#include <incise/sim.h>
#include "../../../lib/sim/hand.h"

static void test_the_tracker_shows_it(void **state)
{
	struct incise_rig *rig = incise_rig_open(
		"sim:mouse,clock=simulated,tracker_noise_mm=0", INCISE_RIG_TRACKER, NULL);
	const double at[] = {10, -3, -2}, still[3] = {0}, turned[] = {0.6, 0, 0.8, 0};
	struct incise_tracker_sample samples[64];
	struct incise_sim_truth truth;
	int n;

	assert_non_null(rig);
	assert_int_equal(incise_sim_hold(incise_rig_sim(rig), at, still, turned), 0);
	incise_clock_wait_until(incise_rig_clock(rig),
				incise_clock_now(incise_rig_clock(rig)) + 200000000);
	n = incise_tracker_read(incise_rig_tracker(rig), samples, 64);
	assert_in_range(n, 20, 25); /* 120 Hz, 0.2 s */
	for (int i = 0; i < 3; i++)
		assert_true(fabs(samples[n - 1].position_mm[i] - at[i]) < 1e-9);
	/* Attitude has noise of 0.025 degrees, 0.4 mrad. */
	for (int i = 0; i < 4; i++)
		assert_true(fabs(samples[n - 1].quaternion[i] - turned[i]) < 4e-3);
	incise_sim_truth(incise_rig_sim(rig), &truth);
	assert_true(truth.depth_mm == 2 && truth.cut == -1);
	incise_rig_close(rig);
}

static void test_refused(void **state)
{
	struct incise_rig *rig =
		incise_rig_open("sim:clock=simulated", INCISE_RIG_TRACKER, NULL);
	const double zero[3] = {0}, whole[] = {1, 0, 0, 0}, half[] = {0.5, 0, 0, 0};
	const double bad[] = {0, NAN, 0}, far[] = {0, 0, 1e7};

	/* The surgeon's is not ours to move. */
	assert_int_equal(incise_sim_hold(incise_rig_sim(rig), zero, zero, whole),
			 -EINVAL);
	incise_rig_close(rig);
	rig = incise_rig_open("sim:mouse,clock=simulated", INCISE_RIG_TRACKER, NULL);
	assert_int_equal(incise_sim_hold(incise_rig_sim(rig), bad, zero, whole), -EINVAL);
	assert_int_equal(incise_sim_hold(incise_rig_sim(rig), zero, bad, whole), -EINVAL);
	assert_int_equal(incise_sim_hold(incise_rig_sim(rig), far, zero, whole), -EINVAL);
	assert_int_equal(incise_sim_hold(incise_rig_sim(rig), zero, zero, half), -EINVAL);
	assert_int_equal(incise_sim_hold(incise_rig_sim(rig), zero, zero, whole), 0);
	incise_rig_close(rig);
}

static void *move(void *argument)
{
	struct incise_hand *hand = argument;

	for (int i = 1; i <= 200000; i++) {
		const double p[] = {i, i, i}, v[] = {i, i, i}, q[] = {i, i, i, i};

		incise_hand_move(hand, p, v, q);
	}
	return NULL;
}

/* No pose is a mix of two, whoever is put off where. */
static void test_two_threads(void **state)
{
	struct incise_hand hand;
	pthread_t thread;
	double p[3], v[3], q[4], last = 0;
	long mixed = 0, looks = 0;

	incise_hand_init(&hand);
	incise_hand_move(&hand, (const double[3]){0}, (const double[3]){0},
			 (const double[4]){0});
	assert_int_equal(pthread_create(&thread, NULL, move, &hand), 0);
	while (p[0] = 0, incise_hand_look(&hand, p, v, q), p[0] < 200000) {
		looks++;
		mixed += p[2] != p[0] || v[1] != p[0] || q[3] != p[0];
		assert_true(p[0] >= last);
		last = p[0];
	}
	pthread_join(thread, NULL);
	assert_int_equal(mixed, 0);
	assert_true(looks > 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_the_tracker_shows_it),
		cmocka_unit_test(test_refused),
		cmocka_unit_test(test_two_threads),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
