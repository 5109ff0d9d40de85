// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The exact Gram matrix: sums against plain integers, any order and division of the rows to the
 * bit, both kernels, the factor next to a QR, dependent columns, limits. Includes the source, to
 * reach the kernels.
 */
#include "../unit.h"
#include "../../../lib/base/random.h"
#include "../../../lib/learn/gram.c"

static void fill(struct incise_gram *gram, uint64_t seed, size_t from, size_t to)
{
	for (size_t r = from; r < to; r++) {
		uint64_t state = seed * 1000003 + r;
		double *row = incise_gram_row(gram);

		for (int k = 0; k < gram->n - 2; k++)
			row[k] = 1.9999 * incise_random_symmetric(&state);
		row[gram->n - 2] = 1;
		row[gram->n - 1] =
			row[0] - 0.5 * row[1] + 0.1 * incise_random_symmetric(&state);
		if (fabs(row[gram->n - 1]) >= 2)
			row[gram->n - 1] = 1.5;
		assert_int_equal(incise_gram_add(gram), 0);
	}
}

static void same(struct incise_gram *a, struct incise_gram *b)
{
	assert_int_equal(incise_gram_rows(a), incise_gram_rows(b));
	assert_memory_equal(incise_gram_sums(a), incise_gram_sums(b),
			    incise_gram_count(a) * sizeof(incise_gram_sum));
}

/* Each sum is the integers' own, for widths around the tiles and rows around the blocks. */
TEST(test_sums)
{
	static const int widths[] = {3, 4, 5, 8, 13, 62}, rows[] = {1, 15, 16, 17, 200};

	for (size_t w = 0; w < sizeof(widths) / sizeof(*widths); w++) {
		int n = widths[w], count = rows[w % 5];
		struct incise_gram *gram = incise_gram_new(n);
		incise_gram_sum *sums, *wanted;

		wanted = calloc(incise_gram_count(gram), sizeof(*wanted));
		fill(gram, w, 0, 0);
		for (int r = 0; r < count; r++) {
			incise_gram_sum *to = wanted;

			fill(gram, w, r, r + 1);
			for (int i = 0; i < n; i++)
				for (int j = i; j < n; j++)
					*to++ += (incise_gram_sum)llrint(
							 ldexp(gram->row[i], 46)) *
						 llrint(ldexp(gram->row[j], 46));
		}
		sums = incise_gram_sums(gram);
		assert_memory_equal(sums, wanted,
				    incise_gram_count(gram) * sizeof(*sums));
		free(wanted);
		incise_gram_free(gram);
	}
}

/* More rows than 64 bits hold without a flush; parts in any order, and less a part. */
TEST(test_parts)
{
	enum { N = 9, ROWS = FLUSH + 1000 };
	struct incise_gram *whole = incise_gram_new(N), *parts = incise_gram_new(N);
	struct incise_gram *part = incise_gram_new(N), *rest = incise_gram_new(N);

	fill(whole, 1, 0, ROWS);
	fill(rest, 1, 0, 700);
	for (int from = ROWS; from > 0; from -= 3001) {
		incise_gram_reset(part);
		fill(part, 1, from > 3001 ? from - 3001 : 0, from);
		assert_int_equal(incise_gram_merge(parts, part), 0);
	}
	same(whole, parts);
	incise_gram_reset(part);
	fill(part, 1, 700, ROWS);
	incise_gram_subtract(whole, part);
	same(whole, rest);
	incise_gram_free(whole);
	incise_gram_free(parts);
	incise_gram_free(part);
	incise_gram_free(rest);
}

TEST(test_kernels)
{
#ifdef __x86_64__
	struct incise_gram *gram = incise_gram_new(23);
	struct tile *plain = zeros(n_tiles(gram), sizeof(*plain));
	struct tile *avx2 = zeros(n_tiles(gram), sizeof(*avx2));

	if (!__builtin_cpu_supports("avx2"))
		skip();
	fill(gram, 3, 0, BLOCK - 1);
	add_plain(plain, gram->block, BLOCK - 1, gram->padded);
	add_avx2(avx2, gram->block, BLOCK - 1, gram->padded);
	assert_memory_equal(plain, avx2, n_tiles(gram) * sizeof(*plain));
	free(plain);
	free(avx2);
	incise_gram_free(gram);
#else
	skip();
#endif
}

/* The largest and smallest elements, and those outside, which leave no trace. */
TEST(test_limits)
{
	struct incise_gram *gram = incise_gram_new(1);
	double last = nextafter(2, 0);
	static const double outside[] = {2, -2, 1e300, INFINITY, NAN};

	for (size_t i = 0; i < sizeof(outside) / sizeof(*outside); i++) {
		*incise_gram_row(gram) = outside[i];
		assert_int_equal(incise_gram_add(gram), -ERANGE);
	}
	for (int r = 0; r < 2 * FLUSH; r++) {
		*incise_gram_row(gram) = r % 2 ? last : -last;
		assert_int_equal(incise_gram_add(gram), 0);
	}
	assert_true(incise_gram_sums(gram)[0] == ((incise_gram_sum)2 * FLUSH << 94));
	incise_gram_set_rows(gram, GRAM_ROWS_MAX);
	assert_int_equal(incise_gram_add(gram), -EOVERFLOW);
	incise_gram_free(gram);
}

/* Row r of a design of 13 cosines, a column of ones and a target; multiples of 2⁻⁴⁶. */
static void cosines(int r, int rows, double *row)
{
	uint64_t seed = r;

	for (int k = 0; k < 13; k++)
		row[k] = nearbyint(0x1p46 * cos(3.0 * k * r / rows)) / 0x1p46;
	row[13] = 1;
	row[14] = nearbyint(0x1p46 * sin(5.0 * r / rows) +
			    0x1p42 * incise_random_symmetric(&seed)) /
		  0x1p46;
}

/* As a QR of the same rows, to a double's last digits. */
TEST(test_factor)
{
	enum { N = 13, ROWS = 500 };
	struct incise_gram *gram = incise_gram_new(N + 2);
	struct incise_lsq *qr = incise_lsq_new(N, NULL), *lsq = incise_lsq_new(N, NULL);
	double mean = 0.25, scale = 0.125, x[N], y[N], row[N + 2], error = 0;
	const double *a, *b;
	int stride;

	for (int r = 0; r < ROWS; r++) {
		cosines(r, ROWS, incise_gram_row(gram));
		cosines(r, ROWS, row);
		memcpy(incise_lsq_row(qr), row, N * sizeof(*row));
		incise_lsq_add(qr, (row[N + 1] - mean) / scale);
		assert_int_equal(incise_gram_add(gram), 0);
	}
	assert_int_equal(incise_gram_factor(gram, mean, scale, lsq), 0);
	a = incise_lsq_factor(qr, NULL, &stride);
	b = incise_lsq_factor(lsq, NULL, &stride);
	/* Rows of a factor have either sign. */
	for (int i = 0; i <= N; i++)
		for (int j = i; j <= N; j++)
			assert_true(fabs(fabs(a[i * stride + j]) -
					 fabs(b[i * stride + j])) < 1e-11);
	assert_int_equal(incise_lsq_solve(qr, NULL, x), 0);
	assert_int_equal(incise_lsq_solve(lsq, NULL, y), 0);
	for (int k = 0; k < N; k++)
		assert_true(fabs(x[k] - y[k]) < 1e-10 * fabs(x[0]));
	for (int r = 0; r < ROWS; r++) {
		double e;

		cosines(r, ROWS, row);
		e = -(row[N + 1] - mean) / scale;
		for (int k = 0; k < N; k++)
			e += y[k] * row[k];
		error += e * e;
	}
	assert_true(fabs(incise_gram_error(gram, mean, scale, y) - error) < 1e-9 * error);
	assert_true(fabs(pow(b[N * stride + N], 2) - error) < 1e-9 * error);
	incise_gram_free(gram);
	incise_lsq_free(qr);
	incise_lsq_free(lsq);
}

/* Columns that repeat others, or are 0, have a row of zeros; with a ridge there is an answer. */
TEST(test_dependent)
{
	enum { N = 6 };
	struct incise_ridge ridge = {.ridge = 1e-6, .n = N};
	struct incise_gram *gram = incise_gram_new(N + 2);
	struct incise_lsq *lsq = incise_lsq_new(N, NULL);
	double x[N], mean, sd;
	const double *factor;
	int stride;

	for (int r = 0; r < 300; r++) {
		uint64_t seed = r;
		double *row = incise_gram_row(gram);

		for (int k = 0; k < 3; k++)
			row[k] = nearbyint(0x1p30 * incise_random_symmetric(&seed)) /
				 0x1p30;
		row[3] = row[0] / 2 + row[1] / 4;
		row[4] = 0;
		row[5] = row[2] / 8;
		row[N] = 1;
		row[N + 1] = r % 2 ? 0.75 : 0.25;
		assert_int_equal(incise_gram_add(gram), 0);
	}
	incise_gram_target(gram, &mean, &sd);
	assert_true(mean == 0.5);
	assert_true(sd == 0.25);
	assert_int_equal(incise_gram_factor(gram, mean, sd, lsq), 0);
	factor = incise_lsq_factor(lsq, NULL, &stride);
	for (int i = 0; i < N; i++)
		assert_int_equal(factor[i * stride + i] == 0, i >= 3);
	assert_int_equal(incise_lsq_solve(lsq, NULL, x), -EDOM);
	assert_int_equal(incise_lsq_solve(lsq, &ridge, x), 0);
	incise_gram_free(gram);
	incise_lsq_free(lsq);
}
