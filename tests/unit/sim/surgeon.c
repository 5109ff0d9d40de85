// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/sim/surgeon.c: smooth motion, the protocol, every depth at every speed; a pose that a program
 * holds reaches the tracker whole, and bad ones are refused.
 */
#include "../unit.h"
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <incise/rig.h>
#include "../../../lib/sim/sim.h"
#include "../../../lib/sim/surgeon.h"
#include "../../../lib/tissue/tick.h"

#define TREMOR_MM 0.035 /* a little over the amplitude in y and z */

static void check_velocity(int motion)
{
	struct incise_sim_config config;
	struct incise_surgeon surgeon;

	incise_sim_config_init(&config);
	config.motion = motion;
	incise_surgeon_init(&surgeon, &config);
	/*
	 * Central difference over ±50 µs: its error is h²/6·jerk ≈ 4e-10·jerk, and at
	 * joints of the path, where acceleration jumps, h/4·jump: at most 600 mm/s² in a
	 * pause, 2·25·2π·1.6·0.9 in a cut and 5.5·(4π)² where pressing starts. So 0.02 mm/s is
	 * ample, and far below any wrong term.
	 */
	for (int64_t t = 50000; t < incise_surgeon_duration(&surgeon); t += 1234567) {
		struct incise_blade before, at, after;

		incise_surgeon_blade(&surgeon, t - 50000, &before);
		incise_surgeon_blade(&surgeon, t, &at);
		incise_surgeon_blade(&surgeon, t + 50000, &after);
		for (int i = 0; i < 3; i++) {
			double v = (after.position_mm[i] - before.position_mm[i]) / 1e-4;

			assert_true(fabs(v - at.velocity_mm_s[i]) <
				    0.02 + 1e-3 * fabs(v));
		}
		assert_true(fabs(at.speed_mm_s -
				 sqrt(at.velocity_mm_s[0] * at.velocity_mm_s[0] +
				      at.velocity_mm_s[1] * at.velocity_mm_s[1] +
				      at.velocity_mm_s[2] * at.velocity_mm_s[2])) < 1e-9);
	}
}

TEST(velocity_is_the_derivative)
{
	check_velocity(INCISE_SURGEON_CUTS);
	check_velocity(INCISE_SURGEON_TURNS);
	check_velocity(INCISE_SURGEON_PRESSES);
}

TEST(protocol_is_kept)
{
	static const double nominal[14] = {5,  5,  5,  10, 10, 10, 10,
					   15, 15, 15, 15, 20, 20, 20};
	struct incise_sim_config config;
	struct incise_surgeon surgeon;
	struct incise_blade blade;

	incise_sim_config_init(&config);
	incise_surgeon_init(&surgeon, &config);
	assert_int_equal(incise_surgeon_duration(&surgeon),
			 (14 * 9 + 1) * INCISE_NS_PER_S);
	for (int cut = 0; cut < 14; cut++) {
		double deepest = 0, ends = 0;

		for (int ms = 0; ms < 9000; ms++) {
			incise_surgeon_blade(&surgeon, (cut * 9000LL + ms) * 1000000,
					     &blade);
			assert_int_equal(blade.cut, ms < 1000 ? -1 : cut);
			if (ms < 1000) {
				assert_true(blade.depth_mm == 0);
				continue;
			}
			deepest = fmax(deepest, blade.depth_mm);
			ends = blade.position_mm[0];
			assert_true(blade.slab >= 0 && blade.slab <= 1);
		}
		/* Held to within 2.5 % of drift, which passes its peak on the way. */
		assert_true(deepest > nominal[cut] * 1.02);
		assert_true(deepest < nominal[cut] * 1.026 + TREMOR_MM);
		/* Along +x, some 25 mm/s for 8 s: less on the steep parts. */
		assert_true(ends > 5 + 25 * 8 * 0.8 && ends < 5 + 25 * 8);
		/* Middle of the pause: 5 mm above the surface. */
		incise_surgeon_blade(&surgeon, (cut * 9000LL + 500) * 1000000, &blade);
		assert_true(fabs(blade.position_mm[2] - 5) < TREMOR_MM);
	}
	/* After the script: at rest in the air, for ever. */
	incise_surgeon_blade(&surgeon, 1000 * INCISE_NS_PER_S, &blade);
	assert_int_equal(blade.cut, -1);
	assert_true(fabs(blade.position_mm[2] - 5) < TREMOR_MM);
	assert_true(blade.velocity_mm_s[0] == 0);
}

TEST(every_depth_at_every_speed)
{
	struct incise_sim_config config;
	struct incise_surgeon surgeon;

	incise_sim_config_init(&config);
	for (config.seed = 1; config.seed < 6; config.seed++) {
		long bin[12][10] = {{0}};

		incise_surgeon_init(&surgeon, &config);
		/* Every 1 ms: ten of the samples at 10 kHz. */
		for (int64_t t = 0; t < incise_surgeon_duration(&surgeon); t += 1000000) {
			struct incise_blade blade;
			int i, j;

			incise_surgeon_blade(&surgeon, t, &blade);
			i = (int)(blade.depth_mm / 20 * 12);
			j = (int)(blade.speed_mm_s / 47 * 10);
			if (blade.depth_mm > 0 && i < 12 && j < 10)
				bin[i][j]++;
		}
		/* At least 300 samples a bin, so that a mean is known to 1/17 of its spread. */
		for (int i = 0; i < 12; i++)
			for (int j = 0; j < 10; j++)
				assert_true(bin[i][j] >= 30);
	}
}

TEST(grip_is_a_rotation)
{
	struct incise_sim_config config;
	struct incise_surgeon surgeon;

	incise_sim_config_init(&config);
	incise_surgeon_init(&surgeon, &config);
	for (int64_t t = 0; t < 20 * INCISE_NS_PER_S; t += 10000001) {
		double q[4], norm;

		incise_surgeon_grip(&surgeon, t, q);
		norm = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
		assert_true(fabs(norm - 1) < 1e-14); /* a few roundings */
		/* The handle (z) within 0.18 rad of upright: lean 0.13, roll 0.03, yaw. */
		assert_true(1 - 2 * (q[1] * q[1] + q[2] * q[2]) > cos(0.18));
	}
}

/* The tip rests while the tool sweeps the configured cone, and no more. */
TEST(a_turn_is_about_the_tip)
{
	struct incise_sim_config config;
	struct incise_surgeon surgeon;
	double farthest = 1;

	incise_sim_config_init(&config);
	config.motion = INCISE_SURGEON_TURNS;
	config.cone_deg = 90;
	incise_surgeon_init(&surgeon, &config);
	for (int64_t t = 0; t < 20 * INCISE_NS_PER_S; t += 10000001) {
		struct incise_blade blade;
		double q[4], norm, up;

		incise_surgeon_blade(&surgeon, t, &blade);
		assert_true(blade.position_mm[0] == 5 && blade.position_mm[1] == 0 &&
			    blade.position_mm[2] == 0 && blade.speed_mm_s == 0);
		incise_surgeon_grip(&surgeon, t, q);
		norm = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
		assert_true(fabs(norm - 1) < 1e-14);
		up = 1 - 2 * (q[1] * q[1] + q[2] * q[2]);
		farthest = fmin(farthest, up);
	}
	/* half the cone; turning about itself on the way takes a little off */
	assert_true(farthest > cos(45 * M_PI / 180) - 1e-9);
	assert_true(farthest < cos(42 * M_PI / 180));
}

TEST(pressing_goes_into_the_tissue_and_out)
{
	struct incise_sim_config config;
	struct incise_surgeon surgeon;
	double low = 0, high = 0;
	int strokes = 0;
	bool inside = false;

	incise_sim_config_init(&config);
	config.motion = INCISE_SURGEON_PRESSES;
	incise_surgeon_init(&surgeon, &config);
	for (int64_t t = 0; t < 11 * INCISE_NS_PER_S; t += 1000001) {
		struct incise_blade blade;

		incise_surgeon_blade(&surgeon, t, &blade);
		assert_int_equal(blade.cut, -1);
		assert_true(t > INCISE_NS_PER_S || blade.position_mm[2] == 3);
		low = fmin(low, blade.position_mm[2]);
		high = fmax(high, blade.position_mm[2]);
		strokes += !inside && blade.depth_mm > 0;
		inside = blade.depth_mm > 0;
	}
	assert_true(fabs(low + 8) < 1e-3 && fabs(high - 3) < 1e-3);
	assert_in_range(strokes, 15, 25); /* about twice a second */
}

TEST(a_held_pose_reaches_the_tracker)
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

TEST(bad_poses_are_refused)
{
	struct incise_rig *rig =
		incise_rig_open("sim:clock=simulated", INCISE_RIG_TRACKER, NULL);
	const double zero[3] = {0}, whole[] = {1, 0, 0, 0}, half[] = {0.5, 0, 0, 0};
	const double bad[] = {0, NAN, 0}, far[] = {0, 0, 1e7};

	/* Only motion 3 can be held. */
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

struct moved {
	struct incise_hand hand;
	_Atomic int looks;
	_Atomic bool end;
};

static void *move_hand(void *argument)
{
	struct moved *moved = argument;

	int looks = 0, moves = 0;

	/*
	 * Three times between two looks at most: one that is disturbed again and again gives up.
	 * Moves that the thread did not make while it was suspended are not made up for.
	 */
	for (int i = 1; !moved->end; i++, moves++) {
		while (moves >= 3 && moved->looks == looks && !moved->end)
			sched_yield();
		if (moved->looks != looks)
			moves = 0;
		looks = moved->looks;
		const double p[] = {i, i, i}, v[] = {i, i, i}, q[] = {i, i, i, i};

		incise_hand_move(&moved->hand, p, v, q);
	}
	return NULL;
}

/* No pose is a mix of two, whatever the interleaving; poses move until 200 differ. */
TEST(held_poses_are_whole)
{
	struct moved moved = {.end = false};
	pthread_t thread;
	double p[3], v[3], q[4], last = 0;
	long mixed = 0, backwards = 0;

	incise_hand_init(&moved.hand);
	incise_hand_move(&moved.hand, (const double[3]){0}, (const double[3]){0},
			 (const double[4]){0});
	assert_int_equal(pthread_create(&thread, NULL, move_hand, &moved), 0);
	for (int seen = 0; seen < 200; seen += p[0] != last, last = p[0]) {
		incise_hand_look(&moved.hand, p, v, q);
		mixed += p[2] != p[0] || v[1] != p[0] || q[3] != p[0];
		backwards += p[0] < last;
		moved.looks++;
		if (p[0] == last)
			sched_yield();
	}
	moved.end = true;
	pthread_join(thread, NULL);
	assert_int_equal(mixed, 0);
	assert_int_equal(backwards, 0);
}

TEST(cuts_lie_side_by_side)
{
	for (int paper = 0; paper < 2; paper++) {
		struct incise_sim_config config;
		struct incise_surgeon surgeon;
		struct incise_blade blade;
		double y_mm[14] = {0};
		int64_t period;

		incise_sim_config_init(&config);
		config.withdrawal = paper;
		incise_surgeon_init(&surgeon, &config);
		period = surgeon.pause_ns + surgeon.cut_ns;
		for (int cut = 0; cut < surgeon.cuts; cut++) {
			incise_surgeon_blade(&surgeon,
					     cut * period + surgeon.pause_ns +
						     surgeon.cut_ns / 2,
					     &blade);
			assert_int_equal(blade.cut, cut);
			y_mm[cut] = blade.position_mm[1];
			/* beyond where a blade is in its own cut, and the tremor of two */
			if (cut && !paper)
				assert_true(y_mm[cut] - y_mm[cut - 1] >
					    INCISE_FRONT_BESIDE_MM + 0.2);
			if (paper)
				assert_true(fabs(y_mm[cut]) < 0.1);
		}
	}
}
