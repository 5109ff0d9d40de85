// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The predictor in integers compared with lib/control/predict.c: a hand with noise, gaps, leaps and
 * late poses; then what no hand does.
 */
#include "../unit.h"
#include "../../../lib/control/predict.h"
#include "../../../lib/fixed/predict.h"
#include "../../../driver/kunit/trial.h"
#include "../../../lib/fixed/vector.h"

#define ONE 65536.0
#define UNIT 1073741824.0

/*
 * Positions are rounded to 2^-16 mm when they are shown. Gains are rounded: 2^-17 1/s of a miss of at
 * most 20 mm, over 1/4 s, and 2^-13 1/s² over (1/4 s)²/2; each miss passes that on, and the filter
 * forgets it within some poses.
 */
#define MOST_MM 2e-3
#define MOST_MM_S 2e-2

static struct incise_fixed_filter filter_of(const struct incise_predict *p)
{
	double per_s = 1 / p->period_s;

	return (struct incise_fixed_filter){
		.alpha = (int32_t)lrint(p->alpha * UNIT),
		.beta = (int32_t)lrint(p->beta * per_s * ONE),
		.gamma = (int32_t)lrint(p->gamma * per_s * per_s * 4096),
		.period_ns = (int32_t)lrint(p->period_s * 1e9),
		.latency_ns = (int32_t)p->latency_ns,
		.gap_ns = (int32_t)p->gap_ns,
		.ahead_ns = (int32_t)(p->gap_ns > INCISE_PREDICT_AHEAD_NS
					      ? p->gap_ns
					      : INCISE_PREDICT_AHEAD_NS),
	};
}

static double any(uint64_t *seed, double least, double most)
{
	return least +
	       (most - least) * (double)(incise_fx_trial_next(seed) >> 11) * 0x1p-53;
}

static void take(struct incise_predict *want, struct incise_fixed_predict *got,
		 const struct incise_fixed_filter *filter,
		 const struct incise_tracker_sample *sample)
{
	int32_t position[3], quaternion[4];

	for (int i = 0; i < 3; i++)
		position[i] = (int32_t)lrint(sample->position_mm[i] * ONE);
	for (int i = 0; i < 4; i++)
		quaternion[i] = (int32_t)lrint(sample->quaternion[i] * UNIT);
	incise_predict_add(want, sample);
	incise_fixed_predict_add(got, filter, position, quaternion, sample->t_ns);
}

static void compare(const struct incise_predict *want,
		    const struct incise_fixed_predict *got,
		    const struct incise_fixed_filter *filter, int64_t t_ns)
{
	double position[3], velocity[3], attitude[4];
	int32_t x[3], v[3], q[4];

	incise_predict_at(want, t_ns, position, velocity, attitude);
	incise_fixed_predict_at(got, filter, t_ns, x, v);
	incise_fixed_predict_attitude(got, filter, t_ns, q);
	for (int i = 0; i < 3; i++) {
		if (!(fabs(x[i] / ONE - position[i]) <= MOST_MM))
			fail_msg("position is %g mm off", x[i] / ONE - position[i]);
		if (!(fabs(v[i] / ONE - velocity[i]) <= MOST_MM_S))
			fail_msg("velocity is %g mm/s off", v[i] / ONE - velocity[i]);
	}
	for (int i = 0; i < 4; i++)
		/* The blend's share has 26 bits. */
		assert_true(fabs(q[i] / UNIT - attitude[i]) <= 1e-7);
	assert_int_equal(incise_fixed_predict_age(got, t_ns),
			 incise_predict_age(want, t_ns));
}

TEST(test_a_hand)
{
	static const double rates[] = {30, 60, 120, 240};
	uint64_t seed = 1;

	for (size_t k = 0; k < sizeof(rates) / sizeof(*rates); k++) {
		struct incise_tracker_info info = {.rate_hz = rates[k],
						   .latency_ns = 4200000};
		struct incise_fixed_filter filter;
		struct incise_fixed_predict got;
		struct incise_predict want;
		int64_t t_ns = 1000000000;

		incise_predict_init(&want, &info, 0.05);
		filter = filter_of(&want);
		assert_true(incise_fixed_filter_good(&filter));
		incise_fixed_predict_init(&got);
		for (int n = 0; n < 5000; n++) {
			double s = (double)t_ns * 1e-9;
			struct incise_tracker_sample sample = {.t_ns = t_ns};
			double turn = sin(s), step = any(&seed, 0.5, 1.5) / rates[k];

			sample.quaternion[0] = cos(turn);
			sample.quaternion[1] = sin(turn);
			for (int i = 0; i < 3; i++)
				sample.position_mm[i] =
					40 * sin((3 + i) * s) + any(&seed, -0.05, 0.05);
			if (n % 500 == 250)
				sample.position_mm[1] += 100;
			take(&want, &got, &filter, &sample);
			if (n % 300 == 100)
				step *= 20;
			for (int64_t end_ns = t_ns + (int64_t)(step * 1e9); t_ns < end_ns;
			     t_ns += 1000000)
				compare(&want, &got, &filter, t_ns);
		}
		assert_int_equal(got.discontinuities, want.discontinuities);
		assert_true(got.discontinuities > 0);
	}
}

/* Nothing overflows (under UBSan), and what is shown stays within what a place can be. */
TEST(test_any_numbers)
{
	uint64_t seed = 2;

	for (int k = 0; k < 2000; k++) {
		struct incise_fixed_filter filter = {
			.alpha = 1 << 30,
			.beta = INT32_MAX,
			.gamma = INT32_MAX,
			.period_ns = k & 1 ? INCISE_FIXED_PERIOD_MIN_NS
					   : INCISE_FIXED_PERIOD_MAX_NS,
			.latency_ns = k & 2 ? 1000000000 : 0,
			.gap_ns = INCISE_FIXED_AHEAD_MAX_NS,
			.ahead_ns = INCISE_FIXED_AHEAD_MAX_NS,
		};
		struct incise_fixed_predict p;
		int64_t t_ns = 0;

		assert_true(incise_fixed_filter_good(&filter));
		incise_fixed_predict_init(&p);
		for (int n = 0; n < 100; n++) {
			int shift = (int)(incise_fx_trial_next(&seed) % 16);
			int32_t position[3], quaternion[4], x[3], v[3], q[4];

			for (int i = 0; i < 3; i++)
				position[i] = incise_fx_trial_number(&seed) >> shift;
			for (int i = 0; i < 4; i++)
				quaternion[i] = incise_fx_trial_number(&seed);
			t_ns = n % 10 ? t_ns + (int64_t)(incise_fx_trial_next(&seed) %
							 100000000)
				      : (int64_t)incise_fx_trial_next(&seed);
			incise_fixed_predict_add(&p, &filter, position, quaternion, t_ns);
			t_ns = t_ns > INT64_MAX / 2 || t_ns < 0 ? 0 : t_ns;
			incise_fixed_predict_at(&p, &filter, t_ns, x, v);
			incise_fixed_predict_attitude(&p, &filter, t_ns, q);
			assert_true(incise_fx_is_unit(q, 4));
			for (int i = 0; i < 3; i++)
				assert_true(abs(v[i]) <= 10000 << 16);
		}
	}
}
