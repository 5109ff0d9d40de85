// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The exact Gram matrix; see gram.h.
 *
 *   v = V·2⁻⁴⁶, V = h·2²³ + l:   |V| < 2⁴⁷, |h| ≤ 2²⁴, |l| ≤ 2²², s = h + l
 *
 *   Σ V·V' = Σhh'·2⁴⁶ + (Σss' - Σhh' - Σll')·2²³ + Σll'
 *
 * Three products of 32 bits instead of four (Karatsuba); each sum of FLUSH rows fits 64 bits.
 * The rows wait in a block that fits the first-level cache, and the sums lie in tiles of 4×4
 * that stay in registers while the block is added.
 *
 *          columns
 *        ┌──┬──┬──┐
 *        │00│01│02│  tiles of the upper triangle, each hh, ll, ss
 *        └──┼──┼──┤
 *           │11│12│
 *           └──┼──┤
 *              │22│
 *              └──┘
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include "gram.h"
#include "watch.h"
#ifdef __x86_64__
#include <immintrin.h>
#endif

#define TILE 4
#define BLOCK 16

/* 2¹⁴ products of s, which is at most 2²⁴ + 2²²: below 2⁶³. */
#define FLUSH (1 << 14)

#define LIMIT 2.0 /* of an element */
#define LOW_BITS 23
#define UNIT 0x1p-92

/* Sums of a tile: hh, ll, ss, each TILE × TILE. */
struct tile {
	int64_t hh[TILE][TILE], ll[TILE][TILE], ss[TILE][TILE];
};

/* A row that waits: h, l, s of all columns after each other. */
struct incise_gram {
	int n, padded, tiles; /* tiles along a side */
	int waiting;	      /* rows of the block */
	int unflushed;	      /* rows in the tiles */
	uint64_t rows;
	double *row;
	int64_t *block; /* BLOCK × 3 × padded */
	struct tile *tile;
	incise_gram_sum *sum;
};

static void *zeros(size_t n, size_t size)
{
	size_t bytes = (n * size + 63) & ~(size_t)63;
	void *memory = aligned_alloc(64, bytes);

	if (memory)
		memset(memory, 0, bytes);
	return memory;
}

static size_t n_tiles(const struct incise_gram *gram)
{
	return (size_t)gram->tiles * (gram->tiles + 1) / 2;
}

size_t incise_gram_count(const struct incise_gram *gram)
{
	return (size_t)gram->n * (gram->n + 1) / 2;
}

struct incise_gram *incise_gram_new(int n)
{
	struct incise_gram *gram = calloc(1, sizeof(*gram));

	if (!gram)
		return NULL;
	gram->n = n;
	gram->tiles = (n + TILE - 1) / TILE;
	gram->padded = gram->tiles * TILE;
	gram->row = zeros(gram->padded, sizeof(*gram->row));
	gram->block = zeros((size_t)BLOCK * 3 * gram->padded, sizeof(*gram->block));
	gram->tile = zeros(n_tiles(gram), sizeof(*gram->tile));
	gram->sum = calloc(incise_gram_count(gram), sizeof(*gram->sum));
	if (!gram->row || !gram->block || !gram->tile || !gram->sum) {
		incise_gram_free(gram);
		errno = ENOMEM;
		return NULL;
	}
	return gram;
}

void incise_gram_free(struct incise_gram *gram)
{
	if (!gram)
		return;
	free(gram->row);
	free(gram->block);
	free(gram->tile);
	free(gram->sum);
	free(gram);
}

void incise_gram_reset(struct incise_gram *gram)
{
	gram->waiting = gram->unflushed = 0;
	gram->rows = 0;
	memset(gram->tile, 0, n_tiles(gram) * sizeof(*gram->tile));
	memset(gram->sum, 0, incise_gram_count(gram) * sizeof(*gram->sum));
}

double *incise_gram_row(struct incise_gram *gram)
{
	return gram->row;
}

uint64_t incise_gram_rows(const struct incise_gram *gram)
{
	return gram->rows;
}

void incise_gram_set_rows(struct incise_gram *gram, uint64_t rows)
{
	gram->rows = rows;
}

/* --- sums of a block ----------------------------------------------------------------- */

static void add_plain(struct tile *tile, const int64_t *block, int rows, int padded)
{
	int tiles = padded / TILE;

	for (int a = 0; a < tiles; a++)
		for (int b = a; b < tiles; b++, tile++) {
			const int64_t *at = block;

			for (int r = 0; r < rows; r++, at += (size_t)3 * padded)
				for (int i = 0; i < TILE; i++)
					for (int j = 0; j < TILE; j++) {
						const int64_t *p = at + a * TILE + i;
						const int64_t *q = at + b * TILE + j;

						tile->hh[i][j] += *p * *q;
						tile->ll[i][j] += p[padded] * q[padded];
						tile->ss[i][j] +=
							p[2 * padded] * q[2 * padded];
					}
		}
}

#ifdef __x86_64__
#define AVX2 __attribute__((target("avx2")))

AVX2 static inline __m256i spread(const int64_t *value)
{
	return _mm256_set1_epi64x(*value);
}

/* The four products of a row's elements i … i+3 with j … j+3, for one of h, l, s. */
#define ADD_PRODUCTS(sum, p, q)                                                        \
	do {                                                                           \
		__m256i right = _mm256_load_si256((const __m256i *)(q));               \
                                                                                       \
		sum##0 = _mm256_add_epi64(sum##0, _mm256_mul_epi32(spread(p), right)); \
		sum##1 = _mm256_add_epi64(sum##1,                                      \
					  _mm256_mul_epi32(spread((p) + 1), right));   \
		sum##2 = _mm256_add_epi64(sum##2,                                      \
					  _mm256_mul_epi32(spread((p) + 2), right));   \
		sum##3 = _mm256_add_epi64(sum##3,                                      \
					  _mm256_mul_epi32(spread((p) + 3), right));   \
	} while (0)

#define LOAD(sum, from)                                              \
	__m256i *at_##sum = (__m256i *)(from), sum##0 = at_##sum[0], \
		sum##1 = at_##sum[1], sum##2 = at_##sum[2], sum##3 = at_##sum[3]
#define STORE(sum)                                                        \
	at_##sum[0] = sum##0, at_##sum[1] = sum##1, at_##sum[2] = sum##2, \
	at_##sum[3] = sum##3

AVX2 static void add_avx2(struct tile *tile, const int64_t *block, int rows, int padded)
{
	int tiles = padded / TILE;

	for (int a = 0; a < tiles; a++)
		for (int b = a; b < tiles; b++, tile++) {
			const int64_t *p = block + a * TILE, *q = block + b * TILE;
			LOAD(hh, tile->hh);
			LOAD(ll, tile->ll);
			LOAD(ss, tile->ss);

			for (int r = 0; r < rows; r++) {
				ADD_PRODUCTS(hh, p, q);
				ADD_PRODUCTS(ll, p + padded, q + padded);
				ADD_PRODUCTS(ss, p + 2 * padded, q + 2 * padded);
				p += (size_t)3 * padded;
				q += (size_t)3 * padded;
			}
			STORE(hh);
			STORE(ll);
			STORE(ss);
		}
}
#endif

static void flush(struct incise_gram *gram)
{
	const struct tile *tile = gram->tile;
	incise_gram_sum *sum = gram->sum;

	if (!gram->unflushed)
		return;
	for (int i = 0; i < gram->n; i++) {
		/* The first tile of row a of tiles, less the a that are not there. */
		size_t a = i / TILE, first = a * gram->tiles - a * (a + 1) / 2;

		for (int j = i; j < gram->n; j++) {
			const struct tile *t = tile + first + j / TILE;
			int64_t hh = t->hh[i % TILE][j % TILE];
			int64_t ll = t->ll[i % TILE][j % TILE];
			int64_t hl = t->ss[i % TILE][j % TILE] - hh - ll;

			*sum++ += (incise_gram_sum)hh * (1LL << 2 * LOW_BITS) +
				  (incise_gram_sum)hl * (1 << LOW_BITS) + ll;
		}
	}
	memset(gram->tile, 0, n_tiles(gram) * sizeof(*gram->tile));
	gram->unflushed = 0;
}

static void add_block(struct incise_gram *gram)
{
	if (!gram->waiting)
		return;
#ifdef __x86_64__
	if (__builtin_cpu_supports("avx2"))
		add_avx2(gram->tile, gram->block, gram->waiting, gram->padded);
	else
#endif
		add_plain(gram->tile, gram->block, gram->waiting, gram->padded);
	gram->unflushed += gram->waiting;
	gram->waiting = 0;
	if (gram->unflushed > FLUSH - BLOCK)
		flush(gram);
}

/*
 * The integer of an element: adding 96 leaves a double with a last bit of 2⁻⁴⁶, whose bits less
 * those of 96 are the integer, rounded to the nearest one.
 */
static inline int64_t integer_of(double v)
{
	const double shift = 96;
	double sum = v + shift;
	int64_t bits, zero;

	memcpy(&bits, &sum, sizeof(bits));
	memcpy(&zero, &shift, sizeof(zero));
	return bits - zero;
}

int incise_gram_add(struct incise_gram *gram)
{
	int64_t *h = gram->block + (size_t)gram->waiting * 3 * gram->padded;
	int64_t *l = h + gram->padded, *s = l + gram->padded;
	bool inside = true;

	for (int k = 0; k < gram->n; k++)
		inside &= fabs(gram->row[k]) < LIMIT;
	if (!inside)
		return -ERANGE;
	if (gram->rows == GRAM_ROWS_MAX)
		return -EOVERFLOW;
	for (int k = 0; k < gram->n; k++) {
		/* Above 0 while it is shifted: the machine has no arithmetic shift of vectors. */
		const int64_t lift = 1LL << 60;
		int64_t v = integer_of(gram->row[k]);
		uint64_t up = (uint64_t)(v + lift + (1 << (LOW_BITS - 1))) >> LOW_BITS;

		h[k] = (int64_t)up - (lift >> LOW_BITS);
		l[k] = v - h[k] * (1 << LOW_BITS);
		s[k] = h[k] + l[k];
	}
	gram->rows++;
	if (++gram->waiting == BLOCK)
		add_block(gram);
	return 0;
}

incise_gram_sum *incise_gram_sums(struct incise_gram *gram)
{
	add_block(gram);
	flush(gram);
	return gram->sum;
}

int incise_gram_merge(struct incise_gram *gram, struct incise_gram *other)
{
	const incise_gram_sum *from = incise_gram_sums(other);
	incise_gram_sum *to = incise_gram_sums(gram);

	if (gram->rows > GRAM_ROWS_MAX - other->rows)
		return -EOVERFLOW;
	for (size_t i = 0; i < incise_gram_count(gram); i++)
		to[i] += from[i];
	gram->rows += other->rows;
	return 0;
}

void incise_gram_subtract(struct incise_gram *gram, struct incise_gram *other)
{
	const incise_gram_sum *from = incise_gram_sums(other);
	incise_gram_sum *to = incise_gram_sums(gram);

	for (size_t i = 0; i < incise_gram_count(gram); i++)
		to[i] -= from[i];
	gram->rows -= other->rows;
}

static size_t find_gram_place(const struct incise_gram *gram, int i, int j)
{
	return (size_t)i * gram->n - (size_t)i * (i + 1) / 2 + j;
}

/* --- twice the digits ---------------------------------------------------------------- */

/*
 * A number as an unevaluated sum of two doubles, 106 bits (Dekker 1971), four at a time. The
 * project is compiled with -ffp-contract=off: the results are those of IEEE arithmetic.
 */
typedef double v4 __attribute__((vector_size(32)));

struct pair4 {
	v4 high, low;
};

struct pair {
	double high, low;
};

#define INLINE static inline __attribute__((always_inline))

/* high + low = a + b, exactly. */
#define TWO_SUM(a, b, high, low)                        \
	do {                                            \
		high = (a) + (b);                       \
		low = high - (a);                       \
		low = ((a) - (high - low)) + ((b)-low); \
	} while (0)

/* high + low = a·b, exactly; the halves of a and b have 26 bits. */
#define SPLIT(a, upper, lower)                 \
	do {                                   \
		upper = (a)*134217729.0;       \
		upper = upper - (upper - (a)); \
		lower = (a)-upper;             \
	} while (0)

INLINE struct pair pair_renew(double high, double low)
{
	double sum = high + low;

	return (struct pair){sum, low - (sum - high)};
}

INLINE struct pair pair_product(struct pair a, struct pair b)
{
	double ah, al, bh, bl, high = a.high * b.high, low;

	SPLIT(a.high, ah, al);
	SPLIT(b.high, bh, bl);
	low = ((ah * bh - high) + ah * bl + al * bh) + al * bl;
	return pair_renew(high, low + (a.high * b.low + a.low * b.high));
}

INLINE struct pair pair_sum(struct pair a, struct pair b)
{
	double high, low;

	TWO_SUM(a.high, b.high, high, low);
	return pair_renew(high, low + (a.low + b.low));
}

INLINE struct pair pair_negative(struct pair a)
{
	return (struct pair){-a.high, -a.low};
}

INLINE struct pair pair_of(double a)
{
	return (struct pair){a, 0};
}

/* Newton's step from the quotient and from the root in double precision. */
static struct pair pair_quotient(struct pair a, struct pair b)
{
	double q = a.high / b.high;
	struct pair rest = pair_sum(a, pair_negative(pair_product(pair_of(q), b)));

	return pair_renew(q, rest.high / b.high);
}

static struct pair pair_root(struct pair a)
{
	double r = sqrt(a.high);
	struct pair rest =
		pair_sum(a, pair_negative(pair_product(pair_of(r), pair_of(r))));

	return pair_renew(r, rest.high / (2 * r));
}

static struct pair pair_of_sum(incise_gram_sum sum)
{
	double high = (double)sum;

	return (struct pair){high * UNIT, (double)(sum - (incise_gram_sum)high) * UNIT};
}

/* Row i less f times row k, from column `from` on: rows as highs and lows. */
static void row_subtract(v4 *restrict high, v4 *restrict low, const v4 *restrict of_high,
			 const v4 *restrict of_low, struct pair f, int from, int n)
{
	v4 fh, fl, f4 = {f.high, f.high, f.high, f.high};
	double upper, lower;

	SPLIT(f.high, upper, lower);
	fh = (v4){upper, upper, upper, upper};
	fl = (v4){lower, lower, lower, lower};
	for (int k = from / 4; k < n; k++) {
		v4 bh, bl, b = of_high[k], p = f4 * b, e, sum, rest, old = high[k];

		SPLIT(b, bh, bl);
		e = ((fh * bh - p) + fh * bl + fl * bh) + fl * bl;
		e = e + (f4 * of_low[k] + f.low * b);
		p = -p;
		TWO_SUM(old, p, sum, rest);
		rest = rest + (low[k] - e);
		high[k] = sum + rest;
		low[k] = rest - (high[k] - sum);
	}
}

/* A column is dependent if less than this share of its square is left, per column. */
#define DEPENDENT 0x1p-90

/*
 * Cholesky's factor of m columns in place: row k has its highs at a + 2·stride·k and its lows
 * behind them. squares: those of the columns.
 */
static void cholesky(v4 *a, int m, int stride, const double *squares,
		     struct incise_watch *watch)
{
	for (int k = 0; k < m && !incise_watch_count(watch, 10.0 * (m - k) * (m - k));
	     k++) {
		v4 *high = a + (size_t)2 * stride * k, *low = high + stride;
		double *h = (double *)high, *l = (double *)low;
		struct pair root;

		if (!(h[k] > DEPENDENT * m * squares[k])) {
			for (int j = k; j < m; j++)
				h[j] = l[j] = 0;
			continue;
		}
		root = pair_root((struct pair){h[k], l[k]});
		for (int j = k; j < m; j++) {
			struct pair q = pair_quotient((struct pair){h[j], l[j]}, root);

			h[j] = q.high;
			l[j] = q.low;
		}
		for (int i = k + 1; i < m; i++) {
			v4 *to = a + (size_t)2 * stride * i;

			if (h[i] != 0)
				row_subtract(to, to + stride, high, low,
					     (struct pair){h[i], l[i]}, i, stride);
		}
	}
}

/* --- rows (w, 1, t) ------------------------------------------------------------------ */

/* Σ a·t' for a sum with t and one with the column of ones: t' = (t - mean)/scale. */
static struct pair with_target(incise_gram_sum with_t, incise_gram_sum with_one,
			       double mean, double scale)
{
	struct pair off = pair_product(pair_of(-mean), pair_of_sum(with_one));

	return pair_quotient(pair_sum(pair_of_sum(with_t), off), pair_of(scale));
}

/* Σ t'². */
static struct pair square_of_target(const struct incise_gram *gram, double mean,
				    double scale)
{
	const incise_gram_sum *end = gram->sum + incise_gram_count(gram);
	struct pair n = pair_of_sum(end[-3]), sum = pair_of_sum(end[-2]);
	struct pair squares = pair_of_sum(end[-1]), m = pair_of(-mean);

	squares = pair_sum(squares, pair_product(pair_product(pair_of(2), m), sum));
	squares = pair_sum(squares, pair_product(pair_product(m, m), n));
	return pair_quotient(squares, pair_product(pair_of(scale), pair_of(scale)));
}

int incise_gram_factor(struct incise_gram *gram, double mean, double scale,
		       struct incise_lsq *lsq)
{
	const incise_gram_sum *sum = incise_gram_sums(gram);
	int n = gram->n - 2, m = n + 1, stride = (m + 3) / 4;
	v4 *a = zeros((size_t)2 * stride * m, sizeof(*a));
	double *squares = malloc(m * sizeof(*squares));

	if (!a || !squares) {
		free(a);
		free(squares);
		return -ENOMEM;
	}
	for (int i = 0; i < m; i++) {
		double *h = (double *)(a + (size_t)2 * stride * i);
		double *l = h + (size_t)4 * stride;
		struct pair p;

		for (int j = i; j < n; j++) {
			p = pair_of_sum(sum[find_gram_place(gram, i, j)]);
			h[j] = p.high;
			l[j] = p.low;
		}
		p = i < n ? with_target(sum[find_gram_place(gram, i, n + 1)],
					sum[find_gram_place(gram, i, n)], mean, scale)
			  : square_of_target(gram, mean, scale);
		h[n] = p.high;
		l[n] = p.low;
		squares[i] = h[i];
	}
	cholesky(a, m, stride, squares, incise_lsq_watch(lsq));
	for (int i = 0; i < m; i++) {
		const double *h = (const double *)(a + (size_t)2 * stride * i);
		double *row = incise_lsq_factor_row(lsq, i);

		memcpy(row + i, h + i, (m - i) * sizeof(*row));
	}
	free(a);
	free(squares);
	return 0;
}

double incise_gram_error(struct incise_gram *gram, double mean, double scale,
			 const double *x)
{
	const incise_gram_sum *sum = incise_gram_sums(gram);
	int n = gram->n - 2;
	struct pair total = square_of_target(gram, mean, scale);

	for (int i = 0; i < n; i++) {
		struct pair with =
			with_target(sum[find_gram_place(gram, i, n + 1)],
				    sum[find_gram_place(gram, i, n)], mean, scale);
		struct pair line = pair_product(pair_of(-2), with);

		line = pair_sum(
			line, pair_product(pair_of_sum(sum[find_gram_place(gram, i, i)]),
					   pair_of(x[i])));
		for (int j = i + 1; j < n; j++)
			line = pair_sum(
				line,
				pair_product(
					pair_of_sum(sum[find_gram_place(gram, i, j)]),
					pair_of(2 * x[j])));
		total = pair_sum(total, pair_product(line, pair_of(x[i])));
	}
	return fmax(total.high, 0);
}

void incise_gram_target(struct incise_gram *gram, double *mean, double *sd)
{
	const incise_gram_sum *end = incise_gram_sums(gram) + incise_gram_count(gram);

	*mean = *sd = 0;
	if (!gram->rows)
		return;
	*mean = pair_quotient(pair_of_sum(end[-2]), pair_of_sum(end[-3])).high;
	*sd = sqrt(fmax(square_of_target(gram, *mean, 1).high / gram->rows, 0));
}
