// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The look of cuts: metrics of saw-teeth of known rate and drop, what no scale may change, and bytes of strangers.
 */
#include "../cases.h"
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/learn/realism.h"

#define ROWS 4000

/* Cuts with a force each, over a way of even steps. */
struct made {
	struct incise_texture_row row[2][ROWS];
	double other[2][ROWS];
	struct incise_texture_cut cuts[2];
};

static struct made *make_cuts(double step)
{
	struct made *made = calloc(1, sizeof(*made));

	assert_non_null(made);
	for (int c = 0; c < 2; c++) {
		for (int i = 0; i < ROWS; i++)
			made->row[c][i].way = step * i;
		made->cuts[c] = (struct incise_texture_cut){made->row[c], ROWS};
	}
	return made;
}

static double saw_tooth(double way, double length, double high)
{
	return 1 + high * (2 * (way / length - floor(way / length)) - 1);
}

TEST(teeth_are_counted_and_their_drops_measured)
{
	static const struct {
		double length, high;
	} cases[] = {{2, 0.2}, {1.28, 0.05}, {5.12, 0.5}};

	for (size_t k = 0; k < sizeof(cases) / sizeof(*cases); k++) {
		double length = cases[k].length, high = cases[k].high;
		struct made *made = make_cuts(0.04);
		struct incise_look look = {0};
		double drop = 2 * high / (1 + high);

		for (int c = 0; c < 2; c++)
			for (int i = 0; i < ROWS; i++)
				made->row[c][i].force =
					3 * saw_tooth(made->row[c][i].way, length, high);
		assert_int_equal(incise_look_at(&look, made->cuts, 2, NULL), 0);
		assert_float_equal(look.step, 0.04, 1e-9);
		assert_true(look.noise < 1e-9);
		/* A tooth at either end of a cut may be cut off. */
		assert_float_equal(look.shape.rate, 1 / length, 2 / look.length);
		/* A cell is a mean over a step: the edge loses a step of rise at either end at most. */
		assert_true(look.drop[0] <= drop + 1e-9);
		assert_true(look.drop[0] > drop * (1 - 2 * 0.04 / length) - 1e-9);
		/* It rises slowly, and falls at once. */
		assert_true(look.skewness < -2);
		free(look.drop);
		free(made);
	}
}

TEST(noise_is_found_and_makes_no_events)
{
	struct made *made = make_cuts(0.04);
	struct incise_look look = {0};

	for (int c = 0; c < 2; c++)
		for (int i = 0; i < ROWS; i++)
			made->row[c][i].force =
				2 +
				0.1 * incise_random_normal(7, (uint64_t)(c * ROWS + i));
	assert_int_equal(incise_look_at(&look, made->cuts, 2, NULL), 0);
	/* The median of 8000 numbers has a relative sd of 1.4 %; they repeat with the seed. */
	assert_float_equal(look.noise, 0.1, 0.005);
	assert_int_equal(look.n_events, 0);
	assert_float_equal(look.skewness, 0, 0.1);
	free(look.drop);
	free(made);
}

/* A force 2^k times as large has the same drops, rms and skewness, and octaves 20 lg 2^k dB higher. */
TEST(scales_of_force_and_way_change_no_shape)
{
	uint64_t key = cases_seed(3);
	int n = cases_of(200, 10);

	for (int k = 0; k < n; k++) {
		struct made *made = make_cuts(0.0625);
		struct incise_look is = {0}, other = {0}, wide = {0};
		double length = 1 + 4 * incise_random_uniform(key, (uint64_t)k);
		double high = 0.1 + 0.5 * incise_random_uniform(~key, (uint64_t)k);

		for (int c = 0; c < 2; c++)
			for (int i = 0; i < ROWS; i++) {
				made->row[c][i].force =
					saw_tooth(made->row[c][i].way, length, high) +
					0.01 * incise_random_normal(
						       key + (uint64_t)k,
						       (uint64_t)(c * ROWS + i));
				made->other[c][i] = 4 * made->row[c][i].force;
			}
		assert_int_equal(incise_look_at(&is, made->cuts, 2, NULL), 0);
		other.step = is.step;
		assert_int_equal(incise_look_at(&other, made->cuts, 2, *made->other), 0);
		assert_float_equal(incise_look_distance(&is, &is), 0, 0);
		assert_float_equal(incise_look_drops(&is, &is), 0, 0);
		assert_float_equal(incise_look_distance(&is, &other), 20 * log10(4),
				   1e-6);
		assert_float_equal(other.shape.rms, is.shape.rms, 1e-9);
		assert_float_equal(other.skewness, is.skewness, 1e-6);
		for (int c = 0; c < 2; c++)
			for (int i = 0; i < ROWS; i++)
				made->row[c][i].way *= 8;
		assert_int_equal(incise_look_at(&wide, made->cuts, 2, NULL), 0);
		assert_int_equal(wide.n_events, is.n_events);
		assert_float_equal(wide.shape.rate * 8, is.shape.rate, 1e-9);
		assert_float_equal(incise_look_distance(&is, &wide), 0, 1e-6);
		free(is.drop);
		free(other.drop);
		free(wide.drop);
		free(made);
	}
}

TEST(drops_are_compared_by_their_distributions)
{
	double few[] = {0.1, 0.2}, many[] = {0.1, 0.1, 0.2, 0.2}, low[] = {0.01, 0.02},
	       half[] = {0.1, 0.5};
	struct incise_look a = {.drop = few, .n_events = 2},
			   b = {.drop = many, .n_events = 4},
			   c = {.drop = low, .n_events = 2},
			   d = {.drop = half, .n_events = 2}, none = {0};

	assert_float_equal(incise_look_drops(&a, &b), 0, 1e-12);
	assert_float_equal(incise_look_drops(&a, &c), 1, 1e-12);
	assert_float_equal(incise_look_drops(&c, &a), 1, 1e-12);
	assert_float_equal(incise_look_drops(&a, &d), 0.5, 1e-12);
	assert_float_equal(incise_look_drops(&a, &none), 1, 0);
}

/* Rows come from files of strangers: ways and forces of any size end in bounded time and memory. */
TEST(any_rows_are_looked_at)
{
	static const double steps[] = {1e-300, 1, 1e300, 0x1p-1074, 1e17};
	uint64_t key = cases_seed(5);
	int n = cases_of(2000, 100);

	for (int k = 0; k < n; k++) {
		struct made *made = make_cuts(1);
		struct incise_look look = {0};
		uint64_t at = (uint64_t)k * 4 * ROWS;

		for (int c = 0; c < 2; c++) {
			double way = steps[incise_random_bits(key, at++) % 5];

			made->cuts[c].n = incise_random_bits(key, at++) % 200;
			for (size_t i = 0; i < made->cuts[c].n; i++) {
				double more = steps[incise_random_bits(key, at++) % 5];

				made->row[c][i].way = way;
				/* Rising, whatever is rounded. */
				way = fmin(fmax(way + more, nextafter(way, INFINITY)),
					   1e307);
				made->row[c][i].force =
					incise_random_normal(key, at++) * 1e10;
			}
		}
		assert_int_equal(incise_look_at(&look, made->cuts, 2, NULL), 0);
		free(look.drop);
		free(made);
	}
}
