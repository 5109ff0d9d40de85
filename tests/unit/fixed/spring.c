// SPDX-License-Identifier: GPL-2.0-or-later
/* The spring in integers, by hand; tests/extremes/motion.c tries any numbers. */
#include "../unit.h"
#include "../../../lib/fixed/layout.h"
#include "../../../driver/kunit/trial.h"

#define MM (1 << 16)
#define N_MM (1 << 16)
#define N (1 << 16)

/* 0.5 N/mm along (0.6, 0, 0.8), which Q2.30 holds to an LSB: forces are off by none. */
TEST(test_pulls_and_pushes)
{
	static const struct incise_fixed_spring s = {
		.stiffness = N_MM / 2,
		.anchor = {MM, 2 * MM, 3 * MM},
		.direction = {644245094, 0, 858993459},
	};
	static const struct {
		int32_t away[3], stretch, pull[3], push[3];
	} cases[] = {
		{{0, 0, 0}, 0, {0, 0, 0}, {0, 0, 0}},
		/* across the direction */
		{{8 * MM, 5 * MM, -6 * MM}, 0, {0, 0, 0}, {0, 0, 0}},
		/* outside: held by the plane, let go by the tissue */
		{{6 * MM, -MM, 8 * MM}, 10 * MM, {-3 * N, 0, -4 * N}, {0, 0, 0}},
		/* inside */
		{{-6 * MM, MM, -8 * MM}, -10 * MM, {3 * N, 0, 4 * N}, {3 * N, 0, 4 * N}},
	};

	for (size_t c = 0; c < sizeof(cases) / sizeof(*cases); c++) {
		int32_t p[3], pull[3] = {7, -7, 0}, push[3] = {7, -7, 0};

		for (int i = 0; i < 3; i++)
			p[i] = s.anchor[i] + cases[c].away[i];
		assert_int_equal(incise_fixed_spring_pull(&s, p, pull), cases[c].stretch);
		assert_int_equal(incise_fixed_spring_push(&s, p, push), cases[c].stretch);
		for (int i = 0; i < 3; i++) {
			/* Added to what was there. */
			int32_t was = i == 0 ? 7 : i == 1 ? -7 : 0;

			assert_int_equal(pull[i] - was, cases[c].pull[i]);
			assert_int_equal(push[i] - was, cases[c].push[i]);
		}
	}
}

/* The known answer of any compiler, a kernel's too: driver/kunit/fixed.c. */
TEST(test_known_answer)
{
	const uint32_t n = 10000;
	int32_t(*result)[5] = calloc(n, sizeof(*result));
	uint64_t seed = 1;

	assert_non_null(result);
	for (uint32_t i = 0; i < n; i++) {
		struct incise_fixed_spring spring;
		int32_t p[3];

		incise_fx_trial_spring(&seed, &spring, p);
		result[i][4] = incise_fixed_spring_pull(&spring, p, &result[i][1]);
	}
	assert_int_equal(incise_fx_crc((const uint8_t *)result,
				       n * (uint32_t)sizeof(*result)),
			 INCISE_FX_TRIAL_SPRINGS);
	free(result);
}
