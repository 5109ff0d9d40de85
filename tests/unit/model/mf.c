// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Membership functions against their formulas, and where the formulas overflow, divide
 * by zero or have no logarithm.
 */
#include "../unit.h"
#include <float.h>
#include "any_model.h"

/* Worked out by hand. */
TEST(test_degrees)
{
	static const struct {
		struct incise_mf mf;
		double x, degree;
	} cases[] = {
		{{INCISE_MF_GAUSS, "", {2, 5}}, 5, 1},
		/* One s from the centre: e^-1/2. The paper's σ is √2 s: e^-1 there. */
		{{INCISE_MF_GAUSS, "", {2, 5}}, 7, 0.60653065971263342},
		{{INCISE_MF_GAUSS, "", {2, 5}}, 5 - 2 * M_SQRT2, 0.36787944117144233},
		{{INCISE_MF_GBELL, "", {2, 4, 6}}, 6, 1},
		{{INCISE_MF_GBELL, "", {2, 4, 6}}, 8, 0.5},
		{{INCISE_MF_GBELL, "", {2, 4, 6}}, 2, 1 / (1 + 256.0)},
		{{INCISE_MF_GBELL, "", {1, 0.5, 0}}, -3, 0.25},
		/* A plateau between the centres, its own width on each side. */
		{{INCISE_MF_GAUSS2, "", {1, 2, 3, 4}}, 3, 1},
		{{INCISE_MF_GAUSS2, "", {1, 2, 3, 4}}, 2, 1},
		{{INCISE_MF_GAUSS2, "", {1, 2, 3, 4}}, 4, 1},
		{{INCISE_MF_GAUSS2, "", {1, 2, 3, 4}}, 1, 0.60653065971263342},
		{{INCISE_MF_GAUSS2, "", {1, 2, 3, 4}}, 7, 0.60653065971263342},
		/* c1 > c2: between them both flanks count, e^-1/2 · e^-1/2. */
		{{INCISE_MF_GAUSS2, "", {1, 4, 1, 2}}, 3, 0.36787944117144233},
		{{INCISE_MF_GAUSS2, "", {1, 4, 1, 2}}, 4, 0.13533528323661270},
		{{INCISE_MF_TRI, "", {0, 4, 6}}, 0, 0},
		{{INCISE_MF_TRI, "", {0, 4, 6}}, 1, 0.25},
		{{INCISE_MF_TRI, "", {0, 4, 6}}, 4, 1},
		{{INCISE_MF_TRI, "", {0, 4, 6}}, 5, 0.5},
		{{INCISE_MF_TRI, "", {0, 4, 6}}, 6, 0},
		{{INCISE_MF_TRI, "", {0, 4, 6}}, 7, 0},
		/* Upright edges: 1 on the edge, 0 right behind it. */
		{{INCISE_MF_TRI, "", {0, 0, 4}}, 0, 1},
		{{INCISE_MF_TRI, "", {0, 0, 4}}, -5e-324, 0},
		{{INCISE_MF_TRI, "", {0, 0, 4}}, 1, 0.75},
		{{INCISE_MF_TRI, "", {0, 4, 4}}, 4, 1},
		{{INCISE_MF_TRI, "", {0, 4, 4}}, 4 + 4 * DBL_EPSILON, 0},
		{{INCISE_MF_TRI, "", {0, 4, 4}}, 3, 0.75},
		{{INCISE_MF_TRI, "", {4, 4, 4}}, 4, 1},
		{{INCISE_MF_TRI, "", {4, 4, 4}}, 4 + 4 * DBL_EPSILON, 0},
		{{INCISE_MF_TRAP, "", {0, 2, 4, 8}}, 1, 0.5},
		{{INCISE_MF_TRAP, "", {0, 2, 4, 8}}, 3, 1},
		{{INCISE_MF_TRAP, "", {0, 2, 4, 8}}, 7, 0.25},
		{{INCISE_MF_TRAP, "", {0, 2, 4, 8}}, 8, 0},
		{{INCISE_MF_TRAP, "", {0, 0, 4, 4}}, 0, 1},
		{{INCISE_MF_TRAP, "", {0, 0, 4, 4}}, 4, 1},
		{{INCISE_MF_TRAP, "", {0, 0, 4, 4}}, -1e-300, 0},
		{{INCISE_MF_TRAP, "", {0, 0, 4, 4}}, 4.0000000000000009, 0},
		/* b > c: the slopes x/8 and (10-x)/5 cross at 80/13. */
		{{INCISE_MF_TRAP, "", {0, 8, 5, 10}}, 4, 0.5},
		{{INCISE_MF_TRAP, "", {0, 8, 5, 10}}, 80 / 13.0, 10 / 13.0},
		{{INCISE_MF_TRAP, "", {0, 8, 5, 10}}, 8, 0.4},
		{{INCISE_MF_SIG, "", {2, 3}}, 3, 0.5},
		{{INCISE_MF_SIG, "", {2, 3}}, 3.5, 0.73105857863000488},
		{{INCISE_MF_SIG, "", {-2, 3}}, 3.5, 0.26894142136999512},
		{{INCISE_MF_SIG, "", {0, 3}}, 1e300, 0.5},
		{{INCISE_MF_SIG, "", {1, 0}}, 1e300, 1},
		{{INCISE_MF_SIG, "", {1, 0}}, -1e300, 0},
		{{INCISE_MF_SIG, "", {1, 0}}, NAN, 0},
		{{INCISE_MF_TRAP, "", {0, 2, 4, 8}}, NAN, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		double degree = incise_mf_eval(&cases[i].mf, cases[i].x);

		/* exp(log) loses a few ulp; 0 and 1 are exact. */
		if (fabs(degree - cases[i].degree) > 8 * DBL_EPSILON ||
		    (cases[i].degree == rint(cases[i].degree) &&
		     degree != cases[i].degree))
			fail_msg("case %zu, %s at %g: %.17g", i,
				 incise_mf_type_name(cases[i].mf.type), cases[i].x,
				 degree);
	}
}

/*
 * Against the formulas in long double, for widths from 1e-12 to 1e12 and inputs that are
 * within a few of them.
 */
TEST(test_against_formulas)
{
	int seen[ANY_KINDS] = {0};
	uint64_t seed = 1;

	for (int n = 0; n < 200000; n++) {
		struct incise_mf mf;
		double x, degree, tolerance;
		long double want;

		any_mf(&mf, &seed, 12);
		/* Slopes beyond 100 turn the rounding of one input into anything. */
		if (mf.type == INCISE_MF_GBELL)
			mf.p[1] = any_width(&seed, 2);
		x = mf.p[mf.type == INCISE_MF_GBELL ? 2 : 1];
		x += 4 * paper_random(&seed) *
		     (mf.type == INCISE_MF_SIG ? 1 / fmax(fabs(mf.p[0]), 1e-12)
		      : mf.type >= INCISE_MF_TRI
			      ? mf.p[mf.type == INCISE_MF_TRI ? 2 : 3] - mf.p[0]
			      : mf.p[0]);
		degree = incise_mf_eval(&mf, x);
		want = any_degree(&mf, x);
		/*
		 * A degree from a log L is off by L e^-L ulp and less than one; a bell's
		 * quotient carries half an ulp into a power of 2b.
		 */
		tolerance = 8 * DBL_EPSILON;
		if (mf.type == INCISE_MF_GBELL)
			tolerance *= 1 + mf.p[1];
		if (!(fabsl(degree - want) <= tolerance))
			fail_msg(
				"%s [%.17g %.17g %.17g %.17g] at %.17g: %.17g, not %.17Lg",
				incise_mf_type_name(mf.type), mf.p[0], mf.p[1], mf.p[2],
				mf.p[3], x, degree, want);
		/* Neither always 0 nor always 1: the inputs were where it matters. */
		seen[mf.type] += want > 0.001 && want < 0.999;
	}
	for (int k = 0; k < ANY_KINDS; k++)
		assert_true(seen[k] > 2000);
}

/* Whatever comes in, the logarithm is within its bounds and the gap is a number. */
TEST(test_log_is_always_a_number)
{
	static const double xs[] = {0,	      -1,      1e300,  -1e300,	 DBL_MAX,
				    -DBL_MAX, DBL_MIN, 5e-324, INFINITY, -INFINITY};
	static const double sizes[] = {5e-324, 1e-300, 1e-12,	   1,
				       1e12,   1e300,  DBL_MAX / 2};
	static const double centres[] = {0, 1, -1e300, DBL_MAX};
	int checked = 0;

	/* Two sizes, a centre, a kind and an input in all combinations. */
	for (int n = 0; n < 7 * 7 * 4 * ANY_KINDS * 10; n++) {
		double s = sizes[n % 7], t = sizes[n / 7 % 7], c = centres[n / 49 % 4];
		double x = xs[n / 196 / ANY_KINDS], gap = -1, log;
		struct incise_mf mf = {.type = n / 196 % ANY_KINDS};
		const double p[ANY_KINDS][4] = {
			{s, c},
			{s, t, c},
			{s, c, t, -c},
			{c - s, c, c + t},
			{c - s, c - s / 2, c, c + t},
			{t > 1 ? -s : s, c},
		};

		memcpy(mf.p, p[mf.type], sizeof(mf.p));
		if (incise_mf_fault(mf.type, mf.p))
			continue; /* a foot beyond DBL_MAX */
		log = incise_mf_log(&mf, x, &gap);
		if (!(log >= MODEL_LOG_MIN && log <= 0 && gap >= 0 && gap < 1e160))
			fail_msg("%s at %g, sizes %g %g, centre %g: %g, gap %g",
				 incise_mf_type_name(mf.type), x, s, t, c, log, gap);
		checked++;
	}
	/* All but the feet that overflow, and those of a width too large to subtract. */
	assert_true(checked > 10000);
}

/* Further away is less, also where the square of the distance overflows. */
TEST(test_log_falls_with_distance)
{
	static const struct incise_mf mfs[] = {
		{INCISE_MF_GAUSS, "", {1e-12, 0}},
		{INCISE_MF_GAUSS, "", {1e12, 0}},
		{INCISE_MF_GBELL, "", {1e-12, 3, 0}},
		{INCISE_MF_GBELL, "", {1e12, 1, 0}},
		{INCISE_MF_GAUSS2, "", {1, -1, 1e-12, 1}},
		{INCISE_MF_SIG, "", {-1e12, 0}},
		{INCISE_MF_SIG, "", {-1e-2, 0}},
	};

	for (size_t i = 0; i < sizeof(mfs) / sizeof(*mfs); i++) {
		double last = 1;

		/* From where the degree no longer rounds to 1. */
		for (double x = 1e13; x < 1e307; x *= 10) {
			double gap, log = incise_mf_log(&mfs[i], x, &gap);

			assert_true(log < last);
			last = log;
		}
	}
}

/* Where a triangle or trapezoid is zero, the distance to its foot counts instead. */
TEST(test_gaps)
{
	static const struct {
		struct incise_mf mf;
		double x, gap;
	} cases[] = {
		{{INCISE_MF_TRI, "", {0, 4, 10}}, 5, 0},
		{{INCISE_MF_TRI, "", {0, 4, 10}}, -5, 0.5},
		{{INCISE_MF_TRI, "", {0, 4, 10}}, 30, 2},
		{{INCISE_MF_TRAP, "", {0, 1, 3, 4}}, 6, 0.5},
		{{INCISE_MF_TRAP, "", {0, 1, 3, 4}}, 2, 0},
		{{INCISE_MF_TRAP, "", {0, 3, 1, 4}}, -8, 2},
		{{INCISE_MF_TRAP, "", {0, 0, 4, 4}}, 4, 0},
	};
	static const struct incise_mf steps[] = {
		{INCISE_MF_TRI, "", {-1, 0, 1}},
		{INCISE_MF_TRI, "", {0, 0, 0}},
		{INCISE_MF_TRI, "", {-1e-12, 0, 1e-12}},
		{INCISE_MF_TRAP, "", {-1e12, -1, 0, 0}},
	};
	double gap, wide, thin;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		double log = incise_mf_log(&cases[i].mf, cases[i].x, &gap);

		assert_true(gap == cases[i].gap);
		assert_true(gap == 0 || log == 0);
	}
	/* On a foot the degree is zero already: there is a gap, if next to nothing. */
	incise_mf_log(&cases[0].mf, 0, &gap);
	assert_true(gap > 0 && gap < 1e-200);
	for (size_t i = 0; i < sizeof(steps) / sizeof(*steps); i++) {
		double last = 0;

		for (double x = 2e-12; x < 1e307; x *= 10) {
			incise_mf_log(&steps[i], x, &gap);
			assert_true(gap > last || (gap == 0 && i == 0));
			last = gap;
		}
	}
	/* The same distance is more widths of a thin one, and most of one without any. */
	incise_mf_log(&steps[0], 1e6, &wide);
	incise_mf_log(&steps[2], 1e6, &thin);
	incise_mf_log(&steps[1], 1e6, &gap);
	assert_true(wide < thin && thin < gap);
}

TEST(test_names)
{
	static const struct {
		enum incise_mf_type type;
		const char *name;
		int n_params;
	} cases[] = {
		{INCISE_MF_GAUSS, "gaussmf", 2},   {INCISE_MF_GBELL, "gbellmf", 3},
		{INCISE_MF_GAUSS2, "gauss2mf", 4}, {INCISE_MF_TRI, "trimf", 3},
		{INCISE_MF_TRAP, "trapmf", 4},	   {INCISE_MF_SIG, "sigmf", 2},
	};

	assert_int_equal(sizeof(cases) / sizeof(*cases), ANY_KINDS);
	for (size_t i = 0; i < ANY_KINDS; i++) {
		/* Programs have these numbers compiled in. */
		assert_int_equal(cases[i].type, i);
		assert_int_equal(incise_mf_type_find(cases[i].name), i);
		assert_string_equal(incise_mf_type_name(cases[i].type), cases[i].name);
		assert_int_equal(incise_mf_n_params(cases[i].type), cases[i].n_params);
		assert_true(incise_mf_type_known(cases[i].type));
	}
	assert_false(incise_mf_type_known(ANY_KINDS));
	assert_int_equal(incise_mf_type_find("pimf"), -1);
}

TEST(test_faults)
{
	static const struct {
		enum incise_mf_type type;
		double p[4];
		const char *word; /* or NULL */
	} cases[] = {
		{INCISE_MF_GAUSS, {1, 0}, NULL},
		{INCISE_MF_GAUSS, {5e-324, 0}, NULL},
		{INCISE_MF_GAUSS, {0, 0}, "positive"},
		{INCISE_MF_GAUSS, {1, NAN}, "finite"},
		{INCISE_MF_GBELL, {1, -1, 0}, "positive"},
		{INCISE_MF_GBELL, {-1, 1, 0}, "positive"},
		{INCISE_MF_GBELL, {1, 1, INFINITY}, "finite"},
		{INCISE_MF_GAUSS2, {1, 5, 2, 3}, NULL},
		{INCISE_MF_GAUSS2, {0, 5, 2, 3}, "positive"},
		{INCISE_MF_GAUSS2, {1, 5, -2, 3}, "positive"},
		{INCISE_MF_GAUSS2, {1, 5, 2, INFINITY}, "finite"},
		{INCISE_MF_TRI, {1, 1, 1}, NULL},
		{INCISE_MF_TRI, {1, 1, 2}, NULL},
		{INCISE_MF_TRI, {1, 2, 2}, NULL},
		{INCISE_MF_TRI, {2, 1, 3}, "fall"},
		{INCISE_MF_TRI, {1, 3, 2}, "fall"},
		{INCISE_MF_TRI, {-1e308, 0, 1e308}, "width"},
		{INCISE_MF_TRAP, {1, 1, 1, 1}, NULL},
		{INCISE_MF_TRAP, {0, 8, 5, 10}, NULL},
		{INCISE_MF_TRAP, {1, 0, 2, 3}, "foot"},
		{INCISE_MF_TRAP, {0, 1, 3, 2}, "foot"},
		{INCISE_MF_TRAP, {5, 6, 1, 2}, "foot"},
		{INCISE_MF_TRAP, {5, 6, 4, 5}, "zero everywhere"},
		{INCISE_MF_TRAP, {-1e308, 0, 0, 1e308}, "width"},
		{INCISE_MF_SIG, {0, 0}, NULL},
		{INCISE_MF_SIG, {-3, 0}, NULL},
		{INCISE_MF_SIG, {NAN, 0}, "finite"},
		{ANY_KINDS - 1, {1, -INFINITY}, "finite"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		const char *fault = incise_mf_fault(cases[i].type, cases[i].p);

		if (cases[i].word ? !fault || !strstr(fault, cases[i].word) : !!fault)
			fail_msg("case %zu: '%s'", i, fault ? fault : "none");
	}
}
