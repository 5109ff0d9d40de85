// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The tables of a texture: a tape of the pieces, with their falls and no others, of mean 0 to the last bit, and
 * factors of cuts; the same bits on every machine.
 */
#include "../cases.h"
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/model/texture.h"

#define PIECES 40

/* Pieces of one tooth each: up from 0, a fall to below 0, and up to 0. */
struct made {
	struct incise_texture texture;
	int points;
	double rise; /* largest from point to point */
};

static void make_teeth(struct made *made, uint64_t *draws)
{
	struct incise_texture *texture = &made->texture;

	memset(made, 0, sizeof(*made));
	texture->step = ldexp(1, (int)(incise_random_draw(draws, 12)) - 8);
	texture->n_curves = 1 + (int)incise_random_draw(draws, PIECES);
	for (int i = 0; i < texture->n_curves; i++) {
		int up = 10 + (int)incise_random_draw(draws, 90),
		    down = 10 + (int)incise_random_draw(draws, 90);
		double top = 1000 + incise_random_draw(draws, 9000);

		texture->n[i] = up + down;
		made->rise = fmax(made->rise, top / (up < down ? up : down));
		for (int k = 0; k < up; k++)
			texture->point[made->points++] = rint(top * (k + 0.5) / up);
		for (int k = 0; k < down; k++)
			texture->point[made->points++] =
				rint(top * (k + 0.5 - down) / down);
	}
}

TEST(a_tape_has_the_falls_of_its_pieces)
{
	uint64_t draws = cases_seed(1);
	int n = cases_of(2000, 100);

	for (int k = 0; k < n; k++) {
		static struct made made;
		struct incise_fixed_texture to;
		int falls = 0, most = 0;
		int64_t sum = 0;

		make_teeth(&made, &draws);
		incise_texture_fill(&made.texture, 0, (uint64_t)k, &to);
		assert_true(ldexp(1, to.step_shift - 16) == made.texture.step);
		for (int i = 0; i < INCISE_TEXTURE_KNOTS; i++) {
			int next = to.knot[(i + 1) % INCISE_TEXTURE_KNOTS] - to.knot[i];

			sum += to.knot[i];
			most = abs(to.knot[i]) > most ? abs(to.knot[i]) : most;
			falls += next < -600 &&
				 (i == 0 || to.knot[i] >= to.knot[i - 1] - 600);
			/* Nowhere does it rise by more than its pieces, stretched by less than a piece, and 2 of rounding. */
			assert_true(next <= made.rise * 1.1 + 2);
		}
		assert_int_equal(sum, 0);
		assert_int_equal(to.most, most);
		assert_in_range(most, 1, INCISE_TEXTURE_MOST);
		/* Teeth have 110 points on average if there are many; a piece more or less, and stretched. */
		assert_float_equal(falls,
				   (double)INCISE_TEXTURE_KNOTS * made.texture.n_curves /
					   made.points,
				   made.texture.n_curves + 1);
		for (int i = 0; i < INCISE_TEXTURE_CUTS; i++) {
			assert_int_equal(to.factor[i], 65536);
			assert_in_range(to.start[i], 0, INCISE_TEXTURE_KNOTS - 1);
		}
	}
}

TEST(a_step_between_those_of_tapes_keeps_its_length)
{
	static struct made made;
	struct incise_fixed_texture a, b;
	uint64_t draws = 5;
	int rises[2] = {0};

	make_teeth(&made, &draws);
	made.texture.step = 0.125;
	incise_texture_fill(&made.texture, 0, 1, &a);
	made.texture.step = 0.1;
	incise_texture_fill(&made.texture, 0, 1, &b);
	assert_int_equal(a.step_shift, b.step_shift);
	for (int i = 0; i + 1 < INCISE_TEXTURE_KNOTS; i++) {
		rises[0] += a.knot[i] < 0 && a.knot[i + 1] >= 0;
		rises[1] += b.knot[i] < 0 && b.knot[i + 1] >= 0;
	}
	/* 1.25 times as many teeth on the same way, up to the choice of the last ones. */
	assert_float_equal((double)rises[1] / rises[0], 1.25, 0.1);
}

TEST(factors_are_log_normal_with_mean_1)
{
	static struct made made;
	uint64_t draws = 7;
	double sum = 0, log_sum = 0, log_square = 0;
	int n = 200 * INCISE_TEXTURE_CUTS;

	make_teeth(&made, &draws);
	made.texture.info.variation = 0.4;
	for (uint64_t seed = 0; seed < 200; seed++) {
		struct incise_fixed_texture to;
		int most = 0;

		incise_texture_fill(&made.texture, 0.5, seed, &to);
		for (int i = 0; i < INCISE_TEXTURE_CUTS; i++) {
			double factor = to.factor[i] / 65536.0;

			assert_true(factor > 0);
			sum += factor / n;
			log_sum += log(factor) / n;
			log_square += log(factor) * log(factor) / n;
			most = to.factor[i] > most ? to.factor[i] : most;
		}
		assert_int_equal(to.factor_most, most);
	}
	/* Five sd of a mean of so many numbers with the sd 0.2, and of their sd. */
	assert_float_equal(sum, 1, 5 * 0.2 / sqrt(n));
	assert_float_equal(sqrt(log_square - log_sum * log_sum), 0.2,
			   5 * 0.2 / sqrt(2.0 * n));
}

TEST(no_texture_is_neutral)
{
	struct incise_fixed_texture to;

	incise_texture_fill(NULL, 1, 3, &to);
	assert_int_equal(to.most, 0);
	assert_int_equal(to.factor_most, 65536);
	for (int i = 0; i < INCISE_TEXTURE_KNOTS; i++)
		assert_int_equal(to.knot[i], 0);
	for (int i = 0; i < INCISE_TEXTURE_CUTS; i++)
		assert_int_equal(to.factor[i], 65536);
}

/* The bits of one texture and seed, as they were when this was written. */
TEST(a_seed_gives_the_same_bits_everywhere)
{
	static struct made made;
	struct incise_fixed_texture to, other;
	uint64_t draws = 9, hash = 0xcbf29ce484222325;

	make_teeth(&made, &draws);
	made.texture.info.variation = 0.3;
	incise_texture_fill(&made.texture, 1, 42, &to);
	for (int i = 0; i < INCISE_TEXTURE_KNOTS; i++)
		hash = (hash ^ (uint16_t)to.knot[i]) * 0x100000001b3;
	for (int i = 0; i < INCISE_TEXTURE_CUTS; i++) {
		hash = (hash ^ (uint32_t)to.factor[i]) * 0x100000001b3;
		hash = (hash ^ to.start[i]) * 0x100000001b3;
	}
	assert_int_equal(hash, 0x1d3d479052a835cd);
	incise_texture_fill(&made.texture, 1, 43, &other);
	assert_memory_not_equal(&to, &other, sizeof(to));
}
