// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Many evaluations of a compiled model at once, for surfaces, exports and benches: four
 * at a time where the processor has AVX2, one by one elsewhere. Results equal
 * incise_fixed_eval()'s to the bit: this is a copy of lib/fixed/eval.c in vectors, and a
 * test compares both.
 *
 * Numbers stand in the lower halves of 64-bit lanes, whose products are exact. AVX2 has
 * no arithmetic shift of 64 bits: where the result fits in 32 bits and the shift is by at
 * most 32, a logical one gives the same lower half; elsewhere shift_right() adds a bias.
 * incise_fixed_open() has checked that all fits.
 */
#include "../fixed/layout.h"

static void one_by_one(const struct incise_fixed *fx, const int32_t *x, int32_t *y,
		       size_t n)
{
	for (size_t k = 0; k < n; k++)
		y[k] = incise_fixed_eval(fx, x + k * (size_t)fx->n_inputs);
}

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>

#define AVX2 __attribute__((target("avx2")))
#define AVX2_INLINE static inline __attribute__((always_inline, target("avx2")))

#define LANES 4

/* One input of four evaluations: the place in the table, and the way into the cell. */
struct batch_place {
	__m256i cell; /* 64-bit lanes */
	__m256i from; /* share of the knot below: 2^cell_shift - share of the knot above */
	__m256i to;
};

/* Right shift of 64-bit lanes, floored, of |v| < 2^62; the lower half of each counts. */
AVX2_INLINE __m256i shift_right(__m256i v, int shift)
{
	const __m256i bias = _mm256_set1_epi64x((int64_t)1 << 62);
	const __m128i count = _mm_cvtsi32_si128(shift);

	return _mm256_sub_epi64(_mm256_srl_epi64(_mm256_add_epi64(v, bias), count),
				_mm256_srl_epi64(bias, count));
}

/* The lower halves of four lanes, stored. */
AVX2_INLINE void store_low(int32_t *to, __m256i v)
{
	const __m256i low = _mm256_setr_epi32(0, 2, 4, 6, 0, 2, 4, 6);

	_mm_storeu_si128((__m128i *)to,
			 _mm256_castsi256_si128(_mm256_permutevar8x32_epi32(v, low)));
}

AVX2_INLINE __m256i high_halves(__m256i v)
{
	return _mm256_srli_epi64(v, 32);
}

/* Inputs in the lower halves, as distances from the support's lower end, clamped. */
AVX2_INLINE __m256i distance_from_min(const struct incise_fixed_input *in, __m256i x)
{
	const __m256i min = _mm256_set1_epi32(in->min), max = _mm256_set1_epi32(in->max);

	x = _mm256_sub_epi32(_mm256_min_epi32(_mm256_max_epi32(x, min), max), min);
	/* The upper halves held the other input. */
	return _mm256_and_si256(x, _mm256_set1_epi64x(UINT32_MAX));
}

AVX2_INLINE struct batch_place locate(const struct incise_fixed_input *in,
				      __m256i distance)
{
	const __m256i width = _mm256_set1_epi64x((int64_t)1 << in->cell_shift);
	const __m256i mask = _mm256_sub_epi64(width, _mm256_set1_epi64x(1));
	struct batch_place p;

	p.cell = _mm256_srl_epi64(distance, _mm_cvtsi32_si128(in->cell_shift));
	p.to = _mm256_and_si256(distance, mask);
	p.from = _mm256_sub_epi64(width, p.to);
	return p;
}

/* Between two knots, not yet shifted: from·2^s + (to - from)·f, which is below 2^62. */
AVX2_INLINE __m256i between(__m256i from, __m256i to, __m256i share_from,
			    __m256i share_to)
{
	return _mm256_add_epi64(_mm256_mul_epi32(from, share_from),
				_mm256_mul_epi32(to, share_to));
}

/* As incise_fx_lerp(); the lower halves count. */
AVX2_INLINE __m256i lerp(__m256i from, __m256i to, const struct batch_place *p, int shift)
{
	return _mm256_srl_epi64(between(from, to, p->from, p->to),
				_mm_cvtsi32_si128(shift));
}

/* The last step of all tables: between two values in Q(shift_a), rounded to Q16. */
AVX2_INLINE __m256i round_output(const struct incise_fixed *fx, __m256i from, __m256i to,
				 const struct batch_place *p, int cell_shift)
{
	/* Floors of floors are one floor. */
	const __m256i half =
		_mm256_set1_epi64x((int64_t)1 << (fx->shift_a - 17 + cell_shift));

	return shift_right(_mm256_add_epi64(between(from, to, p->from, p->to), half),
			   fx->shift_a - 16 + cell_shift);
}

/* Two neighbours in memory per lane, at 32-bit index: the first in the lower half. */
AVX2_INLINE __m256i pairs(const int32_t *values, __m256i index)
{
	return _mm256_i64gather_epi64((const long long *)values, index, 4);
}

/* --- one input: both kinds of tables are the same --- */

AVX2 static void one_input(const struct incise_fixed *fx, const int32_t *x, int32_t *y,
			   size_t n)
{
	const struct incise_fixed_input *in = &fx->input[0];

	for (size_t k = 0; k < n; k += LANES) {
		__m256i at =
			_mm256_cvtepu32_epi64(_mm_loadu_si128((const __m128i *)(x + k)));
		struct batch_place p = locate(in, distance_from_min(in, at));
		__m256i v = pairs(fx->data, p.cell);

		store_low(y + k, round_output(fx, v, high_halves(v), &p, in->cell_shift));
	}
}

/* --- force table of two inputs --- */

AVX2 static void force(const struct incise_fixed *fx, const int32_t *x, int32_t *y,
		       size_t n)
{
	const struct incise_fixed_input *a = &fx->input[0], *b = &fx->input[1];
	const __m256i width = _mm256_set1_epi64x((int64_t)b->cells + 1);

	for (size_t k = 0; k < n; k += LANES) {
		__m256i at = _mm256_loadu_si256((const __m256i *)(x + 2 * k));
		struct batch_place pa = locate(a, distance_from_min(a, at));
		struct batch_place pb = locate(b, distance_from_min(b, high_halves(at)));
		__m256i index =
			_mm256_add_epi64(_mm256_mul_epu32(pa.cell, width), pb.cell);
		__m256i low = pairs(fx->data, index);
		__m256i high = pairs(fx->data, _mm256_add_epi64(index, width));

		low = lerp(low, high_halves(low), &pb, b->cell_shift);
		high = lerp(high, high_halves(high), &pb, b->cell_shift);
		store_low(y + k, round_output(fx, low, high, &pa, a->cell_shift));
	}
}

/* --- tables of weights of two inputs; see lib/fixed/eval.c --- */

/* Weighed sums over input a's functions, at both knots of input b. */
struct sums {
	__m256i g[2], h[2];
};

/* Rows of n functions' weights and outputs; the next knot's row follows. */
struct rows {
	const int32_t *weight, *fold;
	int n;
};

/* The sum of each of four vectors, in a lane each. */
AVX2_INLINE __m256i add_up(__m256i v0, __m256i v1, __m256i v2, __m256i v3)
{
	__m256i v01 = _mm256_add_epi64(_mm256_unpacklo_epi64(v0, v1),
				       _mm256_unpackhi_epi64(v0, v1));
	__m256i v23 = _mm256_add_epi64(_mm256_unpacklo_epi64(v2, v3),
				       _mm256_unpackhi_epi64(v2, v3));

	return _mm256_add_epi64(_mm256_permute2x128_si256(v01, v23, 0x20),
				_mm256_permute2x128_si256(v01, v23, 0x31));
}

/* w in the lower halves; outputs g in the lower halves, h in the upper. */
AVX2_INLINE void add_weighted(struct sums *s, __m256i w, __m256i fold, __m256i fold_to)
{
	s->g[0] = _mm256_add_epi64(s->g[0], _mm256_mul_epi32(w, fold));
	s->g[1] = _mm256_add_epi64(s->g[1], _mm256_mul_epi32(w, fold_to));
	s->h[0] = _mm256_add_epi64(s->h[0], _mm256_mul_epi32(w, high_halves(fold)));
	s->h[1] = _mm256_add_epi64(s->h[1], _mm256_mul_epi32(w, high_halves(fold_to)));
}

/* One evaluation, functions i to i+3 in a lane each. */
AVX2_INLINE void weigh_four(struct sums *s, const struct rows *r, int i,
			    const struct batch_place *p, int shift)
{
	const int32_t *weight = r->weight + i, *fold = r->fold + 2 * i;
	__m256i w = _mm256_cvtepu32_epi64(_mm_loadu_si128((const __m128i *)weight));
	__m256i w_to =
		_mm256_cvtepu32_epi64(_mm_loadu_si128((const __m128i *)(weight + r->n)));

	add_weighted(s, lerp(w, w_to, p, shift),
		     _mm256_loadu_si256((const __m256i *)fold),
		     _mm256_loadu_si256((const __m256i *)(fold + 2 * r->n)));
}

/* The same for the last one to three: nothing beyond the rows is read, and a weight of 0
 * counts for nothing. */
AVX2_INLINE void weigh_rest(struct sums *s, const struct rows *r, int i,
			    const struct batch_place *p, int shift)
{
	const int32_t *weight = r->weight + i, *fold = r->fold + 2 * i;
	const __m256i mask = _mm256_cmpgt_epi64(_mm256_set1_epi64x(r->n - i),
						_mm256_setr_epi64x(0, 1, 2, 3));
	const __m128i mask_w =
		_mm_cmpgt_epi32(_mm_set1_epi32(r->n - i), _mm_setr_epi32(0, 1, 2, 3));
	__m256i w = _mm256_cvtepu32_epi64(_mm_maskload_epi32(weight, mask_w));
	__m256i w_to = _mm256_cvtepu32_epi64(_mm_maskload_epi32(weight + r->n, mask_w));

	add_weighted(s, lerp(w, w_to, p, shift),
		     _mm256_maskload_epi64((const long long *)fold, mask),
		     _mm256_maskload_epi64((const long long *)(fold + 2 * r->n), mask));
}

/* Four evaluations in a lane each, function i: a vector with one function of a single
 * evaluation would be three quarters idle. */
AVX2_INLINE void weigh_across(struct sums *s, const struct rows *r, int i,
			      const struct batch_place *pa, const struct batch_place *pb,
			      int shift)
{
	const int32_t *weight = r->weight + i, *fold = r->fold + 2 * i;
	const __m256i n = _mm256_set1_epi64x(r->n);
	__m256i row_a = _mm256_mul_epu32(pa->cell, n);
	__m256i row_b = _mm256_slli_epi64(_mm256_mul_epu32(pb->cell, n), 1);
	__m256i w = _mm256_cvtepu32_epi64(_mm256_i64gather_epi32(weight, row_a, 4));
	__m256i w_to =
		_mm256_cvtepu32_epi64(_mm256_i64gather_epi32(weight + r->n, row_a, 4));

	add_weighted(s, lerp(w, w_to, pa, shift), pairs(fold, row_b),
		     pairs(fold + 2 * r->n, row_b));
}

/* Four evaluations' sums, a lane each. n is a constant where it matters for speed. */
AVX2_INLINE struct sums table_sums(const struct incise_fixed *fx,
				   const struct batch_place *pa,
				   const struct batch_place *pb, int n)
{
	const struct rows first = {fx->input[0].values, fx->data, n};
	int shift = fx->input[0].cell_shift;
	uint64_t cell_a[LANES], cell_b[LANES], from[LANES], to[LANES];
	struct sums s, of[LANES];

	_mm256_storeu_si256((__m256i *)cell_a, pa->cell);
	_mm256_storeu_si256((__m256i *)cell_b, pb->cell);
	_mm256_storeu_si256((__m256i *)from, pa->from);
	_mm256_storeu_si256((__m256i *)to, pa->to);
#pragma GCC unroll 4
	for (int e = 0; e < LANES; e++) {
		struct rows r = {first.weight + cell_a[e] * (uint32_t)n,
				 first.fold + cell_b[e] * (uint32_t)(2 * n), n};
		struct batch_place p = {.from = _mm256_set1_epi64x((int64_t)from[e]),
					.to = _mm256_set1_epi64x((int64_t)to[e])};
		int i = 0;

		of[e] = (struct sums){0};
#pragma GCC unroll 2
		for (; i + 4 <= n; i += 4)
			weigh_four(&of[e], &r, i, &p, shift);
		if (i + 1 < n)
			weigh_rest(&of[e], &r, i, &p, shift);
	}
#pragma GCC unroll 2
	for (int k = 0; k < 2; k++) {
		s.g[k] = add_up(of[0].g[k], of[1].g[k], of[2].g[k], of[3].g[k]);
		s.h[k] = add_up(of[0].h[k], of[1].h[k], of[2].h[k], of[3].h[k]);
	}
	if (n % 4 == 1)
		weigh_across(&s, &first, n - 1, pa, pb, shift);
	return s;
}

AVX2_INLINE void table_of(const struct incise_fixed *fx, const int32_t *x, int32_t *y,
			  size_t count, int n)
{
	const struct incise_fixed_input *a = &fx->input[0], *b = &fx->input[1];
	const __m256i middle = _mm256_set1_epi64x(((int64_t)a->max - a->min) >> 1);
	int to_g = 16 + fx->shift_b - fx->shift_a;

	for (size_t k = 0; k < count; k += LANES) {
		__m256i at = _mm256_loadu_si256((const __m256i *)(x + 2 * k));
		__m256i from_a = distance_from_min(a, at), centred, v[2];
		struct batch_place pa = locate(a, from_a);
		struct batch_place pb = locate(b, distance_from_min(b, high_halves(at)));
		struct sums s = table_sums(fx, &pa, &pb, n);

		centred = _mm256_sub_epi64(from_a, middle);
#pragma GCC unroll 2
		for (int j = 0; j < 2; j++) {
			__m256i g = _mm256_srli_epi64(s.g[j], 30);
			__m256i h = _mm256_srli_epi64(s.h[j], 30);

			h = shift_right(_mm256_mul_epi32(centred, h), to_g);
			v[j] = _mm256_add_epi64(g, h);
		}
		store_low(y + k, round_output(fx, v[0], v[1], &pb, b->cell_shift));
	}
}

AVX2 static void table(const struct incise_fixed *fx, const int32_t *x, int32_t *y,
		       size_t count)
{
	int n = fx->input[0].n_mfs;

	/* The paper's count, with its loops unrolled. */
	if (n == 5)
		table_of(fx, x, y, count, 5);
	else
		table_of(fx, x, y, count, n);
}

/* Returns the number of evaluations done, of n. */
static size_t by_vectors(const struct incise_fixed *fx, const int32_t *x, int32_t *y,
			 size_t n)
{
	n -= n % LANES;
	/* The direct arithmetic is all 64-bit products, which AVX2 lacks. */
	if (fx->arithmetic == INCISE_FIXED_DIRECT || !__builtin_cpu_supports("avx2"))
		return 0;
	if (fx->n_inputs == 1)
		one_input(fx, x, y, n);
	else if (fx->arithmetic == INCISE_FIXED_FORCE)
		force(fx, x, y, n);
	else
		table(fx, x, y, n);
	return n;
}
#else
static size_t by_vectors(const struct incise_fixed *fx, const int32_t *x, int32_t *y,
			 size_t n)
{
	(void)fx, (void)x, (void)y, (void)n;
	return 0;
}
#endif

void incise_fixed_eval_batch(const struct incise_fixed *fx, const int32_t *x, int32_t *y,
			     size_t n)
{
	size_t done = by_vectors(fx, x, y, n);

	one_by_one(fx, x + done * (size_t)fx->n_inputs, y + done, n - done);
}
