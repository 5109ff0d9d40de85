// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Least squares by blockwise QR; see lsq.h.
 *
 *          n   1
 *       ┌────┬───┐
 *       │ R  │ z │  n + 1 rows, upper triangular: all rows folded in so far
 *       │    │ ρ │
 *       ├────┼───┤
 *       │ A  │ t │  up to BLOCK rows waiting
 *       └────┴───┘
 *
 * Reflection j works on row j of the triangle and on the block, nothing else. Training
 * solves many problems of 60 unknowns, for which a BLAS would spend its time on calls, and
 * return other bits than the next BLAS; so the matrices lie row by row, a reflection is a sum
 * of rows and a rank-one update of rows, and both go through the columns in strips that stay
 * in registers.
 */
#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include "lsq.h"
#include "watch.h"

/* Rows folded in at a time: the block of 60 unknowns then fits the first-level cache. */
#define BLOCK 64

/* Numbers whose squares neither overflow nor vanish, in sums of any length here. */
#define SAFE_MAX 1e140
#define SAFE_MIN 1e-140

typedef double v4 __attribute__((vector_size(32)));

struct incise_lsq {
	int n;
	int stride;
	int rows;	      /* waiting */
	double *r;	      /* (n+1) × stride */
	double *a;	      /* BLOCK × stride */
	double *v;	      /* of the reflection */
	double *work, *ridge; /* a copy of r, and rows to fold into it */
	double *penalty;      /* one number for each pair of rules */
	struct incise_watch *watch;
};

static double *matrix(int rows, int stride)
{
	size_t size = (size_t)rows * stride * sizeof(double);
	double *m = aligned_alloc(32, size);

	if (m)
		memset(m, 0, size);
	return m;
}

struct incise_lsq *incise_lsq_new(int n, struct incise_watch *watch)
{
	struct incise_lsq *lsq = calloc(1, sizeof(*lsq));

	if (!lsq)
		return NULL;
	lsq->n = n;
	lsq->watch = watch;
	lsq->stride = (n + 1 + 3) & ~3;
	lsq->r = matrix(n + 1, lsq->stride);
	lsq->a = matrix(BLOCK, lsq->stride);
	lsq->v = malloc((n + BLOCK) * sizeof(double));
	if (!lsq->r || !lsq->a || !lsq->v) {
		incise_lsq_free(lsq);
		errno = ENOMEM;
		return NULL;
	}
	return lsq;
}

void incise_lsq_free(struct incise_lsq *lsq)
{
	if (!lsq)
		return;
	free(lsq->r);
	free(lsq->a);
	free(lsq->v);
	free(lsq->work);
	free(lsq->ridge);
	free(lsq->penalty);
	free(lsq);
}

struct incise_watch *incise_lsq_watch(const struct incise_lsq *lsq)
{
	return lsq->watch;
}

void incise_lsq_reset(struct incise_lsq *lsq)
{
	lsq->rows = 0;
	memset(lsq->r, 0, (size_t)(lsq->n + 1) * lsq->stride * sizeof(double));
}

double *incise_lsq_factor_row(struct incise_lsq *lsq, int i)
{
	lsq->rows = 0;
	return lsq->r + (size_t)i * lsq->stride;
}

double *incise_lsq_row(struct incise_lsq *lsq)
{
	return lsq->a + (size_t)lsq->rows * lsq->stride;
}

/*
 * Apply 1 - tau·(1,v)(1,v)ᵀ to the row r above the rows of a, in the columns from … stride.
 * Inlined into a function per instruction set; without fused multiply-add (the project is
 * compiled with -ffp-contract=off) they agree to the bit.
 */
static inline __attribute__((always_inline)) void reflect_body(double *restrict r,
							       double *restrict a,
							       int stride, int from,
							       const double *restrict v,
							       int rows, double tau)
{
	int k = from;

	for (; k + 16 <= stride; k += 16) {
		v4 *top = (v4 *)(r + k);
		v4 s0 = top[0], s1 = top[1], s2 = top[2], s3 = top[3];
		v4 t0 = {0}, t1 = {0}, t2 = {0}, t3 = {0};
		double *row = a + k;
		int i = 0;

		for (; i + 2 <= rows; i += 2, row += 2 * stride) {
			const v4 *p = (const v4 *)row, *q = (const v4 *)(row + stride);

			s0 += v[i] * p[0];
			s1 += v[i] * p[1];
			s2 += v[i] * p[2];
			s3 += v[i] * p[3];
			t0 += v[i + 1] * q[0];
			t1 += v[i + 1] * q[1];
			t2 += v[i + 1] * q[2];
			t3 += v[i + 1] * q[3];
		}
		if (i < rows) {
			const v4 *p = (const v4 *)row;

			s0 += v[i] * p[0];
			s1 += v[i] * p[1];
			s2 += v[i] * p[2];
			s3 += v[i] * p[3];
		}
		s0 = (s0 + t0) * tau;
		s1 = (s1 + t1) * tau;
		s2 = (s2 + t2) * tau;
		s3 = (s3 + t3) * tau;
		top[0] -= s0;
		top[1] -= s1;
		top[2] -= s2;
		top[3] -= s3;
		row = a + k;
		for (i = 0; i < rows; i++, row += stride) {
			v4 *p = (v4 *)row;

			p[0] -= v[i] * s0;
			p[1] -= v[i] * s1;
			p[2] -= v[i] * s2;
			p[3] -= v[i] * s3;
		}
	}
	for (; k < stride; k += 4) {
		v4 *top = (v4 *)(r + k);
		v4 s = *top, t0 = {0}, t1 = {0}, t2 = {0};
		double *row = a + k;
		int i = 0;

		for (; i + 4 <= rows; i += 4, row += 4 * stride) {
			s += v[i] * *(const v4 *)row;
			t0 += v[i + 1] * *(const v4 *)(row + stride);
			t1 += v[i + 2] * *(const v4 *)(row + 2 * stride);
			t2 += v[i + 3] * *(const v4 *)(row + 3 * stride);
		}
		for (; i < rows; i++, row += stride)
			s += v[i] * *(const v4 *)row;
		s = ((s + t0) + (t1 + t2)) * tau;
		*top -= s;
		row = a + k;
		for (i = 0; i < rows; i++, row += stride)
			*(v4 *)row -= v[i] * s;
	}
}

static void reflect_plain(double *r, double *a, int stride, int from, const double *v,
			  int rows, double tau)
{
	reflect_body(r, a, stride, from, v, rows, tau);
}

#ifdef __x86_64__
__attribute__((target("avx2"))) static void reflect_avx2(double *r, double *a, int stride,
							 int from, const double *v,
							 int rows, double tau)
{
	reflect_body(r, a, stride, from, v, rows, tau);
}
#endif

typedef void reflect_fn(double *r, double *a, int stride, int from, const double *v,
			int rows, double tau);

static reflect_fn *reflect_here(void)
{
#ifdef __x86_64__
	if (__builtin_cpu_supports("avx2"))
		return reflect_avx2;
#endif
	return reflect_plain;
}

/* Length of (alpha, v), whose squares may leave the range of a double. */
static double length(double alpha, const double *v, int rows)
{
	double s[4] = {alpha * alpha}, largest = fabs(alpha), sum;
	int i = 0;

	for (; i + 4 <= rows; i += 4)
		for (int k = 0; k < 4; k++)
			s[k] += v[i + k] * v[i + k];
	for (; i < rows; i++)
		s[0] += v[i] * v[i];
	sum = (s[0] + s[1]) + (s[2] + s[3]);
	if (sum > SAFE_MIN * SAFE_MIN && sum < SAFE_MAX * SAFE_MAX)
		return sqrt(sum);
	for (i = 0; i < rows; i++)
		largest = fmax(largest, fabs(v[i]));
	if (!(largest > 0) || !isfinite(largest))
		return largest;
	sum = (alpha / largest) * (alpha / largest);
	for (i = 0; i < rows; i++)
		sum += (v[i] / largest) * (v[i] / largest);
	return largest * sqrt(sum);
}

/*
 * Fold rows of a into the triangle r; a is left zero. Of a staircase, row i starts in
 * column i: what lies below is not touched.
 */
static void fold(struct incise_lsq *lsq, double *r, double *a, int rows, bool staircase)
{
	reflect_fn *reflect = reflect_here();
	int n = lsq->n, stride = lsq->stride;
	double *v = lsq->v;

	for (int j = 0; j <= n; j++) {
		double *top = r + (size_t)j * stride, alpha = top[j], beta, over;
		int m = staircase && j + 1 < rows ? j + 1 : rows;
		bool zero = true;

		if (incise_watch_count(lsq->watch, 4.0 * m * (n - j)))
			return;
		for (int i = 0; i < m; i++) {
			v[i] = a[(size_t)i * stride + j];
			a[(size_t)i * stride + j] = 0;
			zero &= v[i] == 0;
		}
		if (zero)
			continue;
		beta = -copysign(length(alpha, v, m), alpha);
		over = 1 / (alpha - beta);
		if (isfinite(over))
			for (int i = 0; i < m; i++)
				v[i] *= over;
		else
			for (int i = 0; i < m; i++)
				v[i] /= alpha - beta;
		/* The columns done are zero and stay so, even where a strip covers them. */
		top[j] = 0;
		reflect(top, a, stride, (j + 1) & ~3, v, m, (beta - alpha) / beta);
		top[j] = beta;
	}
}

static void fold_waiting(struct incise_lsq *lsq)
{
	if (lsq->rows)
		fold(lsq, lsq->r, lsq->a, lsq->rows, false);
	lsq->rows = 0;
}

void incise_lsq_add(struct incise_lsq *lsq, double target)
{
	double *row = incise_lsq_row(lsq);

	row[lsq->n] = target;
	for (int k = lsq->n + 1; k < lsq->stride; k++)
		row[k] = 0;
	if (++lsq->rows == BLOCK)
		fold_waiting(lsq);
}

void incise_lsq_add_weighted(struct incise_lsq *lsq, double target, double weight)
{
	double *row = incise_lsq_row(lsq), root = sqrt(weight);

	for (int k = 0; k < lsq->n && weight != 1; k++)
		row[k] *= root;
	incise_lsq_add(lsq, target * root);
}

/* The penalty of the rules' consequents, one of each rule: upper triangle. */
static void penalise_rules(const struct incise_ridge *ridge, int rules, double *penalty)
{
	int inner;

	for (int k = 0; k < rules * rules; k++)
		penalty[k] = ridge->mean / rules;
	inner = rules;
	for (int i = 0; i < INCISE_MODEL_INPUTS_MAX && ridge->n_mfs[i]; i++) {
		inner /= ridge->n_mfs[i];
		for (int a = 0, b = inner; b < rules; a++, b++) {
			if (a / inner % ridge->n_mfs[i] == ridge->n_mfs[i] - 1)
				continue;
			penalty[a * rules + a] += ridge->ridge;
			penalty[b * rules + b] += ridge->ridge;
			penalty[a * rules + b] -= ridge->ridge;
		}
	}
}

/* Rows whose squares are the penalty: Cholesky's factor, for each parameter of a rule. */
static bool find_rows(struct incise_lsq *lsq, const struct incise_ridge *ridge)
{
	int rules = 1, width;
	double *penalty;

	for (int i = 0; i < INCISE_MODEL_INPUTS_MAX && ridge->n_mfs[i]; i++)
		rules *= ridge->n_mfs[i];
	width = ridge->n / rules;
	/* The rules of one problem stay the same. */
	if (!lsq->penalty)
		lsq->penalty = malloc((size_t)rules * rules * sizeof(*penalty));
	penalty = lsq->penalty;
	if (!penalty)
		return false;
	penalise_rules(ridge, rules, penalty);
	for (int j = 0; j < rules; j++) {
		double *row = penalty + (size_t)j * rules, pivot = sqrt(row[j]);

		for (int k = j; k < rules; k++)
			row[k] /= pivot;
		for (int i = j + 1; i < rules; i++)
			for (int k = i; k < rules; k++)
				penalty[(size_t)i * rules + k] -= row[i] * row[k];
		for (int c = 0; c < width; c++)
			for (int k = j; k < rules; k++)
				lsq->ridge[(size_t)(j * width + c) * lsq->stride +
					   k * width + c] = row[k];
	}
	return true;
}

/* Rows of √ridge·(p - q), without what is along the free rows. */
static void find_bound_rows(struct incise_lsq *lsq, const struct incise_ridge *ridge)
{
	double by = sqrt(ridge->ridge);
	int n = ridge->n;

	for (int i = 0; i < n; i++) {
		double *row = lsq->ridge + (size_t)i * lsq->stride;

		row[i] = by;
		row[lsq->n] = by * ridge->free[i];
		for (int f = 1; f <= ridge->n_free; f++) {
			const double *along = ridge->free + (size_t)f * n;

			for (int k = 0; k < n; k++) {
				row[k] -= by * along[i] * along[k];
				row[lsq->n] -= by * along[i] * along[k] * ridge->free[k];
			}
		}
	}
}

static bool fold_ridge(struct incise_lsq *lsq, const struct incise_ridge *ridge)
{
	if (ridge->free) {
		find_bound_rows(lsq, ridge);
	} else if (*ridge->n_mfs) {
		if (!find_rows(lsq, ridge))
			return false;
	} else {
		for (int i = 0; i < ridge->n; i++)
			lsq->ridge[(size_t)i * (lsq->stride + 1)] = sqrt(ridge->ridge);
	}
	fold(lsq, lsq->work, lsq->ridge, ridge->n, !ridge->free);
	return true;
}

const double *incise_lsq_factor(struct incise_lsq *lsq, const struct incise_ridge *ridge,
				int *stride)
{
	size_t size = (size_t)(lsq->n + 1) * lsq->stride;
	double *factor = lsq->r;

	fold_waiting(lsq);
	*stride = lsq->stride;
	errno = ENOMEM;
	if (ridge && ridge->ridge > 0) {
		if (!lsq->work)
			lsq->work = matrix(lsq->n + 1, lsq->stride);
		if (!lsq->ridge)
			lsq->ridge = matrix(lsq->n, lsq->stride);
		if (!lsq->work || !lsq->ridge)
			return NULL;
		memcpy(lsq->work, lsq->r, size * sizeof(double));
		if (!fold_ridge(lsq, ridge))
			return NULL;
		factor = lsq->work;
	}
	errno = EDOM;
	if (incise_watch_count(lsq->watch, 0))
		return NULL;
	for (int i = 0; i <= lsq->n; i++)
		for (int k = i; k <= lsq->n; k++)
			if (!isfinite(factor[(size_t)i * lsq->stride + k]))
				return NULL;
	return factor;
}

int incise_lsq_back(const double *factor, int stride, int n, int right, double *x)
{
	for (int i = n - 1; i >= 0; i--) {
		const double *row = factor + (size_t)i * stride;
		double sum = row[right];

		for (int k = i + 1; k < n; k++)
			sum -= row[k] * x[k];
		x[i] = sum / row[i];
		/* 0/0 and the like: singular. */
		if (!isfinite(x[i]))
			return -EDOM;
	}
	return 0;
}

double incise_lsq_leverage(const double *factor, int stride, int n, double *a)
{
	double sum = 0;

	for (int i = 0; i < n; i++) {
		const double *row = factor + (size_t)i * stride;
		double v = a[i] / row[i];

		sum += v * v;
		for (int k = i + 1; k < n; k++)
			a[k] -= row[k] * v;
	}
	return sum;
}

int incise_lsq_solve(struct incise_lsq *lsq, const struct incise_ridge *ridge, double *x)
{
	int stride;
	const double *factor = incise_lsq_factor(lsq, ridge, &stride);

	return factor ? incise_lsq_back(factor, stride, lsq->n, lsq->n, x) : -errno;
}

/* Upper bidiagonal: d on the diagonal, e above it. */
struct bidiagonal {
	int n;
	double *d, *e; /* n each */
};

/*
 * v becomes the vector of the reflection 1 - tau·v·vᵀ that makes all but the first of its n
 * elements zero. Returns what the first becomes.
 */
static double make_reflection(double *v, int n, double *tau)
{
	double beta = -copysign(length(v[0], v + 1, n - 1), v[0]), over = v[0] - beta;

	*tau = beta != 0 ? -over / beta : 0;
	for (int i = 1; i < n && beta != 0; i++)
		v[i] /= over;
	v[0] = 1;
	return beta;
}

/*
 * Reflections from both sides (Golub and Van Loan, Matrix Computations, 5.4.8) make a, n × n,
 * bidiagonal, with its singular values kept. v and sums are scratch, n each.
 */
static void make_bidiagonal(double *a, struct bidiagonal *to, double *v, double *sums,
			    struct incise_watch *watch)
{
	int n = to->n;
	double tau;

	for (int j = 0; j < n && !incise_watch_count(watch, 8.0 * (n - j) * (n - j));
	     j++) {
		for (int i = j; i < n; i++)
			v[i - j] = a[(size_t)i * n + j];
		to->d[j] = make_reflection(v, n - j, &tau);
		memset(sums, 0, n * sizeof(*sums));
		for (int i = j; i < n; i++)
			for (int k = j + 1; k < n; k++)
				sums[k] += tau * v[i - j] * a[(size_t)i * n + k];
		for (int i = j; i < n; i++)
			for (int k = j + 1; k < n; k++)
				a[(size_t)i * n + k] -= v[i - j] * sums[k];
		if (j + 1 == n)
			break;
		memcpy(v, a + (size_t)j * n + j + 1, (n - j - 1) * sizeof(*v));
		to->e[j] = make_reflection(v, n - j - 1, &tau);
		for (int i = j + 1; i < n; i++) {
			double *row = a + (size_t)i * n + j + 1, sum = 0;

			for (int k = 0; k < n - j - 1; k++)
				sum += v[k] * row[k];
			for (int k = 0; k < n - j - 1; k++)
				row[k] -= tau * sum * v[k];
		}
	}
}

/*
 * Number of singular values below x > 0: they and their negatives are the eigenvalues of the
 * tridiagonal matrix of zeros on the diagonal and d₀ e₀ d₁ … next to it, which Sturm's sequence
 * counts.
 */
static int count_below(const struct bidiagonal *b, double x)
{
	double q = -x;
	int count = 1;

	for (int i = 0; i < 2 * b->n - 1; i++) {
		double beside = i % 2 ? b->e[i / 2] : b->d[i / 2];

		if (fabs(q) < DBL_MIN)
			q = -DBL_MIN;
		q = -x - beside * beside / q;
		count += q < 0;
	}
	return count - b->n;
}

/* The singular value that k others are below, by bisection between 0 and `above`. */
static double singular_value(const struct bidiagonal *b, int k, double above)
{
	double low = 0, middle;

	while ((middle = low + (above - low) / 2) > low && middle < above)
		if (count_below(b, middle) > k)
			above = middle;
		else
			low = middle;
	return low;
}

int incise_lsq_condition(struct incise_lsq *lsq, double *condition)
{
	int n = lsq->n, stride;
	const double *factor = incise_lsq_factor(lsq, NULL, &stride);
	double *a, *lines, largest = 0, smallest;
	struct bidiagonal b = {.n = n};

	if (!factor)
		return -EDOM;
	a = calloc((size_t)n * n, sizeof(*a));
	lines = calloc((size_t)4 * n, sizeof(*lines));
	*condition = HUGE_VAL;
	for (int i = 0; i < n; i++)
		for (int k = i; k < n; k++)
			largest = fmax(largest, fabs(factor[(size_t)i * stride + k]));
	if (a && lines && largest > 0) {
		for (int i = 0; i < n; i++)
			for (int k = i; k < n; k++)
				a[(size_t)i * n + k] =
					factor[(size_t)i * stride + k] / largest;
		b.d = lines;
		b.e = lines + n;
		make_bidiagonal(a, &b, lines + 2 * n, lines + 3 * n, lsq->watch);
		/* elements are at most 1, so no singular value is above n */
		smallest = singular_value(&b, 0, n + 1);
		if (smallest > 0)
			*condition = singular_value(&b, n - 1, n + 1) / smallest;
	}
	free(a);
	free(lines);
	return a && lines ? 0 : -ENOMEM;
}
