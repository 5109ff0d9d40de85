// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The pose predictor: gains against the Riccati equation, no jump whatever comes when,
 * nothing but numbers. How far it is off is in reference_path.c.
 */
#include "../unit.h"
#include <incise/clock.h>
#include "../../../lib/base/random.h"
#include "../../../lib/base/vector.h"
#include "../../../lib/control/predict.h"

#define PERIOD_NS (INCISE_NS_PER_S / 120)
#define LATENCY_NS 4200000
#define MS_NS 1000000
#define HAND_MM2_S5 4e6 /* of predict.c */
#define S 1e-9

/* All that is asked for at one time. */
struct pose {
	double x[3], v[3], q[4];
};

static struct pose pose_at(const struct incise_predict *p, int64_t t_ns)
{
	struct pose pose;

	incise_predict_at(p, t_ns, pose.x, pose.v, pose.q);
	return pose;
}

static double length4(const double q[4])
{
	return sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
}

static struct incise_predict start(void)
{
	struct incise_tracker_info info = {
		.name = "test", .rate_hz = 120, .latency_ns = LATENCY_NS};
	struct incise_predict p;

	incise_predict_init(&p, &info, 0);
	return p;
}

/* A pose acquired at @t_ns. */
static struct incise_tracker_sample at(int64_t t_ns, double x, double y, double z)
{
	return (struct incise_tracker_sample){
		.t_ns = t_ns + LATENCY_NS, .position_mm = {x, y, z}, .quaternion = {1}};
}

static void add(struct incise_predict *p, int64_t t_ns, double x, double y, double z)
{
	struct incise_tracker_sample s = at(t_ns, x, y, z);

	incise_predict_add(p, &s);
}

/*
 * Gains by iterating P ← F (P - K P₀) Fᵀ + Q in units of the period and of the noise,
 * with Q = Λ² g gᵀ, g = (1/2 1 1): acceleration takes an independent step each period.
 */
static void riccati(double index, double k[3])
{
	static const double f[3][3] = {{1, 1, 0.5}, {0, 1, 1}, {0, 0, 1}};
	static const double g[3] = {0.5, 1, 1};
	double p[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

	for (int n = 0; n < 20000; n++) {
		double c[3][3], fc[3][3];

		for (int i = 0; i < 3; i++)
			k[i] = p[i][0] / (p[0][0] + 1);
		for (int i = 0; i < 3; i++)
			for (int j = 0; j < 3; j++)
				c[i][j] = p[i][j] - k[i] * p[0][j];
		for (int i = 0; i < 3; i++)
			for (int j = 0; j < 3; j++)
				fc[i][j] = f[i][0] * c[0][j] + f[i][1] * c[1][j] +
					   f[i][2] * c[2][j];
		for (int i = 0; i < 3; i++)
			for (int j = 0; j < 3; j++)
				p[i][j] = fc[i][0] * f[j][0] + fc[i][1] * f[j][1] +
					  fc[i][2] * f[j][2] +
					  index * index * g[i] * g[j];
	}
}

TEST(test_gains_are_kalmans)
{
	static const double hz[] = {30, 60, 120, 240, 1000};
	static const double noise_mm[] = {0.002, 0.02, 0.2};

	for (int i = 0; i < 5; i++) {
		for (int n = 0; n < 3; n++) {
			struct incise_tracker_info info = {.name = "test",
							   .rate_hz = hz[i],
							   .latency_ns = LATENCY_NS};
			struct incise_predict p;
			double k[3];

			incise_predict_init(&p, &info, noise_mm[n]);
			riccati(sqrt(HAND_MM2_S5 / hz[i]) / (hz[i] * hz[i]) / noise_mm[n],
				k);
			/* 2e4 steps of rounding, each 1e-16 of P's condition of 1e6. */
			assert_true(fabs(p.alpha - k[0]) < 1e-7 * k[0]);
			assert_true(fabs(p.beta - k[1]) < 1e-7 * k[1]);
			assert_true(fabs(p.gamma - k[2]) < 1e-7 * k[2]);
			if (n == 1) {
				struct incise_predict same;

				incise_predict_init(&same, &info, 0);
				assert_true(same.alpha == p.alpha &&
					    same.gamma == p.gamma);
			}
		}
	}
}

/* A hand that accelerates evenly is where the filter says; it has no lag. */
TEST(test_even_acceleration_is_exact)
{
	struct incise_predict p = start();
	int64_t now = 240 * PERIOD_NS + 1234567;
	double t = now * S;
	struct pose got;

	assert_int_equal(incise_predict_age(&p, 5), INT64_MAX);
	for (int i = 0; i <= 239; i++) {
		double then = i * PERIOD_NS * S;

		add(&p, i * PERIOD_NS, 30 * then - 40 * then * then, -10 * then, 5);
	}
	got = pose_at(&p, now);
	/* The slowest of the filter's roots is 0.66: 0.66^240 is nothing. */
	assert_true(fabs(got.x[0] - (30 * t - 40 * t * t)) < 1e-9);
	assert_true(fabs(got.x[1] + 10 * t) < 1e-9);
	assert_true(fabs(got.x[2] - 5) < 1e-9);
	assert_true(fabs(got.v[0] - (30 - 80 * t)) < 1e-7);
	assert_true(fabs(got.v[1] + 10) < 1e-7);
	assert_true(fabs(got.v[2]) < 1e-7);
	assert_int_equal(incise_predict_age(&p, 240 * PERIOD_NS), PERIOD_NS);
	assert_int_equal(incise_predict_age(&p, 5), 0);
}

/* The filter without the blend. */
static double bare(const struct incise_predict *p, int64_t t_ns)
{
	double dt = (double)(t_ns - p->t_ns) * S;

	return p->x[0] + p->v[0] * dt + p->a[0] * dt * dt / 2;
}

static double uniform(uint64_t *seed)
{
	incise_random_step(seed);
	return (double)(*seed >> 11) * 0x1p-52 - 1;
}

/*
 * Poses at any time, in bursts and with pauses: at the time when one arrives all that is
 * shown is the same before and after it is taken in.
 */
TEST(test_arrival_moves_nothing)
{
	struct incise_predict p = start();
	int64_t t_ns = 0;
	uint64_t seed = 1;

	for (int n = 0; n < 5000; n++) {
		struct incise_tracker_sample s;
		struct pose before, after;

		/* 0 … 2 periods, seldom 8 of them: beyond a gap. */
		t_ns += 1 +
			(int64_t)((1 + uniform(&seed)) * PERIOD_NS * (n % 50 ? 1 : 8));
		s = at(t_ns, uniform(&seed), uniform(&seed), 30 + uniform(&seed));
		for (int i = 0; i < 4; i++)
			s.quaternion[i] = uniform(&seed);
		for (double l = length4(s.quaternion), i = 0; i < 4; i++)
			s.quaternion[(int)i] /= l;
		before = pose_at(&p, s.t_ns);
		incise_predict_add(&p, &s);
		after = pose_at(&p, s.t_ns);
		if (!n)
			continue;
		for (int i = 0; i < 3; i++) {
			/* Rounding of some numbers below 100 mm and 1e4 mm/s. */
			assert_true(fabs(after.x[i] - before.x[i]) < 1e-12);
			assert_true(fabs(after.v[i] - before.v[i]) < 1e-9);
		}
		for (int i = 0; i < 4; i++)
			assert_true(fabs(after.q[i] - before.q[i]) < 1e-12);
	}
}

/* A hand at rest, then a pose elsewhere: the way there takes one period, evenly. */
TEST(test_blend_takes_one_period)
{
	struct incise_predict p = start();
	int64_t arrival = 20 * PERIOD_NS + LATENCY_NS;
	double half = sqrt(0.5);
	struct incise_tracker_sample s = at(20 * PERIOD_NS, 1, 0, 0);
	struct pose pose;

	for (int i = 0; i < 20; i++)
		add(&p, i * PERIOD_NS, 0, 0, 0);
	/* A quarter turn about x, as the other of its two quaternions. */
	s.quaternion[0] = -half;
	s.quaternion[1] = -half;
	incise_predict_add(&p, &s);
	for (int i = 0; i <= 10; i++) {
		double share = i / 10.0;
		int64_t t_ns = arrival + i * PERIOD_NS / 10;

		pose = pose_at(&p, t_ns);
		/* The filter's answer at arrival, less what it moved on since. */
		assert_true(fabs(pose.x[0] - bare(&p, t_ns) +
				 (1 - share) * bare(&p, arrival)) < 1e-6);
		assert_true(fabs(length4(pose.q) - 1) < 1e-15 * 4);
		assert_true(fabs(pose.q[1] / pose.q[0] -
				 share * half / (1 - share + share * half)) < 1e-6);
	}
	/* Done, and it stays so; periods are whole ns, 1 in 8e6. */
	assert_true(fabs(pose.x[0] - bare(&p, arrival + PERIOD_NS)) < 1e-6);
	assert_true(fabs(pose.q[0] - half) < 1e-6 && fabs(pose.q[1] - half) < 1e-6);
}

/* Three poses in one tick, after a stall of the wire: no more of a step than of one. */
TEST(test_many_poses_in_one_tick)
{
	struct incise_predict p = start();
	int64_t t_ns = 20 * PERIOD_NS;
	struct pose before, after;

	for (int i = 0; i < 20; i++)
		add(&p, i * PERIOD_NS, 0, 0, 0);
	before = pose_at(&p, t_ns + LATENCY_NS);
	for (int i = 1; i <= 3; i++)
		add(&p, t_ns + i * 300000, 0.1 * i, 0, 0);
	after = pose_at(&p, t_ns + LATENCY_NS + 1000000);
	/*
	 * Each correction is at most 0.3 mm and what velocity makes of it in the latency,
	 * β / T × 4.2 ms + γ / T² × (4.2 ms)²/2 < 0.4 of it; three of these, over 0.7, 0.4
	 * and 0.1 ms of the 8.3.
	 */
	assert_true(fabs(after.x[0] - before.x[0]) < 3 * 0.42 * 0.7 / 8.3);
	assert_true(after.x[0] > 0);
}

TEST(test_attitude_that_is_none)
{
	static const double hostile[][4] = {
		{NAN, 0, 0, 0},
		{1, INFINITY, 0, 0},
		{0, 0, 0, 0},
		{1e300, 1, 0, 0},
		{0.5, 0.5, 0.5, 0},
		{1.2, 0, 0, 0},
		{-INFINITY, INFINITY, NAN, 1e-300},
	};
	struct incise_predict p = start();
	struct incise_tracker_sample s = at(0, 0, 0, 0);
	struct pose pose;

	pose = pose_at(&p, 0);
	assert_true(pose.q[0] == 1);
	s.quaternion[0] = 0.6;
	s.quaternion[2] = -0.8;
	incise_predict_add(&p, &s);
	for (int i = 0; i < 7; i++) {
		s = at((i + 1) * PERIOD_NS, 0.1 * i, 0, 0);
		memcpy(s.quaternion, hostile[i], sizeof(s.quaternion));
		incise_predict_add(&p, &s);
		pose = pose_at(&p, s.t_ns + PERIOD_NS / 3);
		assert_true(fabs(pose.q[0] - 0.6) < 1e-12);
		assert_true(fabs(pose.q[2] + 0.8) < 1e-12);
		/* The position is taken all the same. */
		assert_int_equal(p.t_ns, (i + 1) * PERIOD_NS);
	}
	/* Rounding by the device is no reason. */
	s = at(8 * PERIOD_NS, 0, 0, 0);
	s.quaternion[0] = 1.001;
	incise_predict_add(&p, &s);
	pose = pose_at(&p, s.t_ns + PERIOD_NS + 100);
	assert_true(fabs(pose.q[0] - 1) < 1e-12);
}

TEST(test_nonsense_is_passed_over)
{
	static const double hostile[] = {NAN, INFINITY, -INFINITY, 1e300, -1e5};
	struct incise_predict p = start(), before;

	for (int i = 0; i < 10; i++)
		add(&p, i * PERIOD_NS, i, 0, 0);
	before = p;
	for (int i = 0; i < 5; i++) {
		struct incise_tracker_sample s = at(11 * PERIOD_NS, 1, 2, 3);

		s.position_mm[i % 3] = hostile[i];
		incise_predict_add(&p, &s);
	}
	/* An older pose than the last, and the same again. */
	incise_predict_add(&p, &(struct incise_tracker_sample){.t_ns = 0});
	incise_predict_add(&p, &(struct incise_tracker_sample){.t_ns = INT64_MIN});
	incise_predict_add(&p,
			   &(struct incise_tracker_sample){.t_ns = p.t_ns + LATENCY_NS});
	assert_memory_equal(&p, &before, sizeof(p));
}

/* After a gap the hand may be anywhere: no velocity is made up across it. */
TEST(test_gap_starts_anew)
{
	static const struct {
		int periods;
		double off_mm; /* from what is shown when the pose arrives */
		bool anew, blend;
	} cases[] = {
		{1, 0.5, false, true},	 {5, 3, false, true},	  {6, 3, true, true},
		{6, 19, true, true},	 {6, 21, true, false},	  {1, 21, true, false},
		{1, -5000, true, false}, {5000, -19, true, true},
	};

	for (int i = 0; i < (int)(sizeof(cases) / sizeof(*cases)); i++) {
		struct incise_predict p = start();
		int64_t then = (9 + cases[i].periods) * PERIOD_NS;
		double shown;
		struct pose pose;

		for (int k = 0; k < 10; k++)
			add(&p, k * PERIOD_NS, 0, 0.2 * k, 0);
		shown = pose_at(&p, then + LATENCY_NS).x[1];
		add(&p, then, 0, shown + cases[i].off_mm, 0);
		if (cases[i].anew)
			assert_true(v3_length(p.v) == 0 && v3_length(p.a) == 0);
		else
			assert_true(v3_length(p.v) > 0);
		/* A change that is not blended is a discontinuity; the first pose of all is none. */
		assert_int_equal(p.discontinuities, !cases[i].blend);
		pose = pose_at(&p, then + LATENCY_NS);
		if (cases[i].blend)
			assert_true(fabs(pose.x[1] - shown) < 1e-12);
		else
			assert_true(pose.x[1] == shown + cases[i].off_mm);
		if (!cases[i].blend)
			assert_true(v3_length(pose.v) == 0);
	}
}

/* An old pose is not carried on for ever. */
TEST(test_never_further_ahead_than_a_gap)
{
	struct incise_predict p = start();
	struct pose end, later;

	for (int i = 0; i < 50; i++)
		add(&p, i * PERIOD_NS, 0.5 * i, 0, 0);
	end = pose_at(&p, (49 + 5) * PERIOD_NS);
	later = pose_at(&p, INT64_MAX);
	/* 5 periods are 41 666 666 ns, 5 times a period 41 666 665; at 60 mm/s. */
	assert_true(fabs(end.x[0] - later.x[0]) < 1e-6);
	assert_true(fabs(end.x[0] - 27) < 1e-3);
	assert_int_equal(incise_predict_age(&p, INT64_MAX), INT64_MAX - 49 * PERIOD_NS);
	later = pose_at(&p, INT64_MIN);
	assert_true(v3_finite(later.x));
	assert_int_equal(incise_predict_age(&p, INT64_MIN), 0);
}

/* 12 ms are more than five periods of 1000 Hz, and are made up for all the same. */
TEST(test_latency_of_many_periods)
{
	struct incise_tracker_info info = {
		.name = "test", .rate_hz = 1000, .latency_ns = 12000000};
	struct incise_tracker_sample s = {.quaternion = {1}};
	struct incise_predict p;

	incise_predict_init(&p, &info, 0);
	for (int i = 0; i < 500; i++) {
		s.t_ns = i * MS_NS + info.latency_ns;
		s.position_mm[0] = 0.06 * i;
		incise_predict_add(&p, &s);
	}
	/* An even motion is exact once the start has died away, by 1e-15 and more. */
	assert_true(fabs(pose_at(&p, s.t_ns + MS_NS).x[0] - 0.06 * (499 + 13)) < 1e-6);
}

/* Poses a nanosecond apart, each 9 mm on: 9 000 km/s. */
TEST(test_speed_is_bounded)
{
	struct incise_predict p = start();
	double fastest = 0;

	for (int i = 0; i < 1000; i++) {
		struct pose pose;

		add(&p, i, i * 9.0, -i * 9.0, 0);
		pose = pose_at(&p, i + LATENCY_NS + PERIOD_NS);
		fastest = fmax(fastest, v3_length(pose.v));
		assert_true(v3_finite(pose.x));
	}
	assert_true(fastest > 1e3 && fastest <= 1e4 * sqrt(3));
	/* Turned about: the old speed is still blended out when the new one is gone. */
	p.v[0] = -1e4;
	p.a[0] = 1e5;
	p.v_shown[0] = 2e4;
	p.arrival_ns = p.t_ns + PERIOD_NS;
	assert_true(pose_at(&p, p.t_ns + PERIOD_NS).v[0] <= 1e4);
}

/* Any bits as poses, times and trackers: numbers only, and unit quaternions. */
TEST(test_only_numbers)
{
	static const double hz[] = {120, 60, 1000, 0, NAN, INFINITY, -5, 1e-300, 1e300};
	static const int64_t latency[] = {LATENCY_NS, 0, INT64_MAX, INT64_MIN, -1};
	uint64_t seed = 7;

	for (int run = 0; run < 45; run++) {
		struct incise_tracker_info info = {.rate_hz = hz[run % 9],
						   .latency_ns = latency[run % 5]};
		struct incise_predict p;
		int64_t t_ns = 0;

		incise_predict_init(&p, &info, 0);
		for (int i = 0; i < 2000; i++) {
			struct incise_tracker_sample s = {.quaternion = {1}};
			double spread = i % 3 ? 9 : 9999;
			struct pose pose;

			t_ns += (int64_t)((1 + uniform(&seed)) * (i % 7 ? 1e6 : 1e8));
			s.t_ns = t_ns;
			if (i > 1500 && run < 20)
				s.t_ns = (int64_t)(seed ^ seed << 32);
			for (int k = 0; k < 3; k++)
				s.position_mm[k] = spread * uniform(&seed);
			for (int k = 0; k < 4 && i % 5 == 0; k++) {
				uniform(&seed);
				memcpy(&s.quaternion[k], &seed, sizeof(seed));
			}
			if (i % 11 == 0)
				memcpy(&s.position_mm[i % 3], &seed, sizeof(seed));
			incise_predict_add(&p, &s);
			pose = pose_at(&p, i % 13 ? s.t_ns + (int64_t)(seed >> 40)
						  : (int64_t)seed);
			assert_true(v3_length(pose.x) < 1e6);
			assert_true(v3_length(pose.v) <= 1e4 * sqrt(3));
			assert_true(fabs(length4(pose.q) - 1) < 1e-14);
			assert_true(incise_predict_age(&p, s.t_ns) >= 0);
		}
	}
}
