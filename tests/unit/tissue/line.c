// SPDX-License-Identifier: GPL-2.0-or-later
/* The cut as a line: its direction, its extent, and what lies within reach of it. */
#include "../unit.h"
#include "../../../lib/tissue/line.h"

static double dot(const double a[3], const double b[3])
{
	return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

#define ANY             \
	{               \
		0, 0, 0 \
	} /* any direction in the surface */
#define C30 0.86602540378443865
/* The sine of an angle of 2 mrad: the blade still has a direction; 0.5 mrad: it has not. */
#define S2 2e-3
#define S05 0.5e-3

TEST(test_direction)
{
	static const double at[3] = {7, 8, 9};
	static const struct {
		double normal[3], side[3], along[3];
	} cases[] = {
		{{0, 0, 1}, {0, 1, 0}, {1, 0, 0}},
		{{0, 0, 1}, {0, -1, 0}, {-1, 0, 0}},
		{{0, 0, 1}, {1, 0, 0}, {0, -1, 0}},
		{{1, 0, 0}, {0, 1, 0}, {0, 0, -1}},
		/* A blade that leans over cuts along the same line. */
		{{0, 0, 1}, {0, C30, 0.5}, {1, 0, 0}},
		{{0, 0, 1}, {0, S2, 1}, {1, 0, 0}},
		/* Flat on the skin: its cut has no direction of its own. */
		{{0, 0, 1}, {0, 0, 1}, ANY},
		{{0, 0, 1}, {0, 0, -1}, ANY},
		{{1, 0, 0}, {1, 0, 0}, ANY},
		{{0, 1, 0}, {0, -1, 0}, ANY},
		{{0.6, 0, 0.8}, {0.6, 0, 0.8}, ANY},
		{{C30, 0.5, 0}, {-C30, -0.5, 0}, ANY},
		{{0, 0, 1}, {0, S05, 1}, ANY},
		/* Places as a broken rig may give them. */
		{{0, 0, 1}, {0, 0, 0}, ANY},
		{{0, 0, 1}, {NAN, 0, 0}, ANY},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_line cut = {.to_mm = 99, .from_mm = -99};
		const double *want = cases[i].along;

		incise_line_begin(&cut, at, cases[i].normal, cases[i].side);
		assert_true(cut.there && cut.from_mm == 0 && cut.to_mm == 0);
		/* In the surface and of length 1, whatever the blade: some roundings. */
		assert_true(fabs(dot(cut.along, cut.along) - 1) < 1e-14);
		assert_true(fabs(dot(cut.along, cases[i].normal)) < 1e-14);
		for (int k = 0; k < 3 && dot(want, want) > 0; k++)
			assert_true(fabs(cut.along[k] - want[k]) < 1e-14);
		for (int k = 0; k < 3; k++)
			assert_true(cut.at_mm[k] == at[k]);
	}
}

/* A cut from x = 0 that runs along x, to where these places are. */
TEST(test_extent)
{
	static const struct {
		double at[3], from, to;
	} steps[] = {
		{{5, 0, 0}, 0, 5},    {{3, 0, 0}, 0, 5},     {{-2, 0, 0}, -2, 5},
		{{20, 4, 0}, -2, 20}, {{20, 0, -6}, -2, 20}, {{NAN, 0, 0}, -2, 20},
	};
	struct incise_line cut;

	incise_line_begin(&cut, (double[]){0, 0, 0}, (double[]){0, 0, 1},
			  (double[]){0, 1, 0});
	for (size_t i = 0; i < sizeof(steps) / sizeof(*steps); i++) {
		incise_line_extend(&cut, steps[i].at);
		assert_true(cut.from_mm == steps[i].from && cut.to_mm == steps[i].to);
	}
	/* The next cut takes its place. */
	incise_line_begin(&cut, (double[]){100, 0, 0}, (double[]){0, 0, 1},
			  (double[]){0, 1, 0});
	assert_true(cut.from_mm == 0 && cut.to_mm == 0 && cut.at_mm[0] == 100);
}

/* The cut from -2 to 20 has the shape of a capsule around it that is in reach. */
TEST(test_reach)
{
	static const struct {
		double at[3];
		bool holds;
	} cases[] = {
		{{0, 0, 0}, true},	 {{10, 5, 0}, true},
		{{10, 5.001, 0}, false}, {{10, -5, 0}, true},
		{{10, 0, 4.999}, true},	 {{10, 0, -5.001}, false},
		{{25, 0, 0}, true},	 {{25.001, 0, 0}, false},
		{{-7, 0, 0}, true},	 {{-7.001, 0, 0}, false},
		{{23, 4, 0}, true}, /* 3-4-5 around the end */
		{{23.01, 4, 0}, false},	 {{40, 0, 0}, false},
		{{NAN, 0, 0}, false},	 {{10, NAN, 0}, false},
	};
	struct incise_line cut = {0};

	/* Before the first cut there is none. */
	assert_false(incise_line_holds(&cut, (double[]){0, 0, 0}, 1e9));
	incise_line_begin(&cut, (double[]){0, 0, 0}, (double[]){0, 0, 1},
			  (double[]){0, 1, 0});
	incise_line_extend(&cut, (double[]){20, 0, 0});
	incise_line_extend(&cut, (double[]){-2, 0, 0});
	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		if (incise_line_holds(&cut, cases[i].at, 5) != cases[i].holds)
			fail_msg("case %zu", i);
	/* Its very points are in reach of 0. */
	assert_true(incise_line_holds(&cut, (double[]){20, 0, 0}, 0));
}
