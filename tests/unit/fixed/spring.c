// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The spring in integers, step by step against long double, whose 64 bits of mantissa
 * hold all of its products; corner values of every number included.
 */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>
#include "../../../lib/fixed/spring.h"
#include "../model/paper_model.h"

#define CASES 1000000

static const int32_t corners[] = {
	INT32_MIN, INT32_MIN + 1, -(1 << 30) - 1, -(1 << 30),	 -1,	    0,
	1,	   1 << 30,	  (1 << 30) + 1,  INT32_MAX - 1, INT32_MAX,
};
#define N_CORNERS ((int)(sizeof(corners) / sizeof(*corners)))

/* A corner in one of four, else as many bits as chance gives. */
static int32_t any(uint64_t *seed)
{
	uint32_t v = (uint32_t)(int64_t)(0x7fffffff * paper_random(seed)) * 2;
	int pick = (int)((paper_random(seed) + 1) * 2 * N_CORNERS);

	if (pick < N_CORNERS)
		return corners[pick];
	return (int32_t)v >> pick % 32;
}

static void any_spring(struct incise_fixed_spring *s, uint64_t *seed)
{
	s->stiffness = any(seed);
	for (int i = 0; i < 3; i++) {
		s->anchor[i] = any(seed);
		s->direction[i] = any(seed);
	}
}

static long double held(long double v, long double most)
{
	return fmaxl(-most, fminl(most, v));
}

/* As the header says it, in numbers without an end. */
static int32_t expected(const struct incise_fixed_spring *s, const int32_t p[3],
			bool push_only, int32_t force[3])
{
	long double sum = 0, stretch, back;

	for (int i = 0; i < 3; i++)
		sum += held((long double)p[i] - s->anchor[i], 0x1p30L) * s->direction[i];
	stretch = held(roundl(sum * 0x1p-30L), INT32_MAX);
	back = fmaxl(0, s->stiffness) * stretch * 0x1p-16L;
	back = held(roundl(back), INT32_MAX);
	for (int i = 0; i < 3 && (stretch < 0 || !push_only); i++) {
		long double part = roundl(back * s->direction[i] * 0x1p-30L);

		force[i] = (int32_t)held(force[i] - part, INT32_MAX);
	}
	return (int32_t)stretch;
}

static void test_any_numbers(void **state)
{
	uint64_t seed = 1;
	int held_forces = 0;

	for (int n = 0; n < CASES; n++) {
		int32_t p[3], force[3], right[3], stretch, right_stretch;
		struct incise_fixed_spring s;

		any_spring(&s, &seed);
		for (int i = 0; i < 3; i++) {
			p[i] = any(&seed);
			force[i] = right[i] = any(&seed);
		}
		right_stretch = expected(&s, p, n % 2, right);
		stretch = n % 2 ? incise_fixed_spring_push(&s, p, force)
				: incise_fixed_spring_pull(&s, p, force);
		if (stretch != right_stretch || memcmp(force, right, sizeof(right)))
			fail_msg("case %d: %d %d %d, not %d %d %d", n, force[0], force[1],
				 force[2], right[0], right[1], right[2]);
		held_forces += force[0] == INT32_MAX || force[0] == -INT32_MAX;
	}
	/* The ends of the format were met. */
	assert_true(held_forces > CASES / 100);
}

/* Mirrored at its anchor, a spring does the opposite, to the bit. */
static void test_both_sides_the_same(void **state)
{
	uint64_t seed = 2;

	for (int n = 0; n < 100000; n++) {
		int32_t p[3], mirrored[3], force[3] = {0}, back[3] = {0};
		struct incise_fixed_spring s;

		any_spring(&s, &seed);
		for (int i = 0; i < 3; i++) {
			int32_t away = any(&seed) / 4;

			s.anchor[i] /= 4;
			p[i] = s.anchor[i] + away;
			mirrored[i] = s.anchor[i] - away;
		}
		assert_int_equal(incise_fixed_spring_pull(&s, p, force),
				 -incise_fixed_spring_pull(&s, mirrored, back));
		for (int i = 0; i < 3; i++)
			assert_int_equal(force[i], -back[i]);
	}
}

#define MM (1 << 16)
#define N_MM (1 << 16)
#define N (1 << 16)

/* 0.5 N/mm along (0.6, 0, 0.8), which Q2.30 holds to an LSB: forces are off by none. */
static void test_pulls_and_pushes(void **state)
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

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_any_numbers),
		cmocka_unit_test(test_both_sides_the_same),
		cmocka_unit_test(test_pulls_and_pushes),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
