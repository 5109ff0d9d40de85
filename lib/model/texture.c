// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The tables of a texture, in integers: the same bits on every machine. Pieces of τ begin where it rises
 * through 0 and end before it does so again, so that any of them joins any other one within a rise:
 *
 *     /|    /|            /|
 *    / |   / |  /|   …   / |  /|
 *   /  |  /  | / |  /   /  | / |  /       the tape begins again at its end
 *      | /   |/  | /       |/  | /
 */
#include <math.h>
#include <string.h>
#include "../base/random.h"
#include "texture.h"

/* Fractions with room for the square of exp(2) in 64 bits. */
#define SHIFT 28
#define ONE ((int64_t)1 << SHIFT)

static int64_t times(int64_t a, int64_t b)
{
	return a * b / ONE;
}

/* exp(x) of |x| ≤ 2, as (1 + x/1024)^1024. */
static int64_t exponential(int64_t x)
{
	int64_t y = ONE + x / 1024;

	for (int i = 0; i < 10; i++)
		y = times(y, y);
	return y;
}

/* Log-normal with mean 1, of nearly normal numbers: sums of twelve uniform ones. */
static void draw_factors(struct incise_fixed_texture *to, double sd, uint64_t *state)
{
	int64_t size = llrint(fmax(0, fmin(sd, 1)) * (double)ONE);

	for (int i = 0; i < INCISE_TEXTURE_CUTS; i++) {
		int64_t z = -6 * ONE, x;

		for (int k = 0; k < 12; k++)
			z += (int64_t)(incise_random_next(state) >> (64 - SHIFT));
		x = times(size, z) - times(size, size) / 2;
		x = x < -2 * ONE ? -2 * ONE : x > 2 * ONE ? 2 * ONE : x;
		to->factor[i] = (int32_t)(exponential(x) >> (SHIFT - 16));
		to->factor_most =
			to->factor[i] > to->factor_most ? to->factor[i] : to->factor_most;
	}
}

static void shuffle_pieces(uint16_t *order, int n, uint64_t *state)
{
	for (int i = 0; i < n; i++) {
		int j = (int)(incise_random_next(state) % (uint64_t)(i + 1));

		order[i] = order[j];
		order[j] = (uint16_t)i;
	}
}

/* Pieces in random order, all before one comes again, to the length nearest to @most; returns it. */
static int join_pieces(const struct incise_texture *texture, uint64_t *state,
		       int16_t *tape, int most)
{
	uint16_t order[INCISE_TEXTURE_CURVES];
	int first[INCISE_TEXTURE_CURVES], at = 0, length = 0;

	for (int i = 0; i < texture->n_curves; at += texture->n[i++])
		first[i] = at;
	for (int i = 0;; i = (i + 1) % texture->n_curves) {
		int piece, n;

		if (!i)
			shuffle_pieces(order, texture->n_curves, state);
		piece = order[i];
		n = texture->n[piece];
		if (length && length + n / 2 >= most)
			return length;
		for (int k = 0; k < n; k++)
			tape[length++] = (int16_t)lrint(texture->point[first[piece] + k]);
	}
}

/* The tape stretched to the knots, by a piece at most; their mean is 0. */
static void set_knots(struct incise_fixed_texture *to, const int16_t *tape, int length)
{
	static const int n = INCISE_TEXTURE_KNOTS;
	int32_t knot[INCISE_TEXTURE_KNOTS];
	int64_t sum = 0;

	for (int64_t i = 0; i < n; i++) {
		int at = (int)(i * length / n), rest = (int)(i * length % n);

		knot[i] = (tape[at] * (n - rest) + tape[(at + 1) % length] * rest) / n;
		sum += knot[i];
	}
	for (int64_t i = 0; i < n; i++) {
		int64_t tau = knot[i] - ((i + 1) * sum / n - i * sum / n);

		tau = tau > INCISE_TEXTURE_MOST ? INCISE_TEXTURE_MOST : tau;
		tau = tau < -INCISE_TEXTURE_MOST ? -INCISE_TEXTURE_MOST : tau;
		to->knot[i] = (int16_t)tau;
		to->most = (int32_t)(tau > to->most    ? tau
				     : -tau > to->most ? -tau
						       : to->most);
	}
}

void incise_texture_fill(const struct incise_texture *texture, double variation,
			 uint64_t seed, struct incise_fixed_texture *to)
{
	int16_t tape[2 * INCISE_TEXTURE_KNOTS + INCISE_TEXTURE_PIECE];
	uint64_t state = incise_random_mix(seed + 1);
	double step, length;

	memset(to, 0, sizeof(*to));
	to->step_shift = INCISE_TEXTURE_SHIFT_LEAST;
	draw_factors(to, texture ? texture->info.variation * variation : 0, &state);
	if (!texture)
		return;
	for (int i = 0; i < INCISE_TEXTURE_CUTS; i++)
		to->start[i] =
			(uint16_t)(incise_random_next(&state) % INCISE_TEXTURE_KNOTS);
	/* A knot each step, or at most two steps. */
	step = texture->step * 65536;
	while (to->step_shift < INCISE_TEXTURE_SHIFT_MOST && (1 << to->step_shift) < step)
		to->step_shift++;
	length = INCISE_TEXTURE_KNOTS * (double)(1 << to->step_shift) / step;
	length = fmax(INCISE_TEXTURE_KNOTS / 2, fmin(length, 2 * INCISE_TEXTURE_KNOTS));
	set_knots(to, tape, join_pieces(texture, &state, tape, (int)length));
}
