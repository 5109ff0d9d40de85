// SPDX-License-Identifier: GPL-2.0-or-later
/* Eigenvalues against LAPACK's, of random matrices and of those that are hard: companions, chains, multiple ones. */
#include "../unit.h"
#include <lapacke.h>
#include "../../../lib/base/random.h"
#include "../../../lib/control/eigenvalues.h"

#define MOST 60

static double a[MOST * MOST], work[MOST * MOST], wr[MOST], wi[MOST];
static double complex found[MOST];

static int kind_of(uint64_t *seed, int kind, double to[])
{
	int n = 1 + (int)(incise_random_next(seed) % MOST);

	for (int i = 0; i < n * n; i++)
		to[i] = kind == 0 ? incise_random_symmetric(seed) : 0;
	/* Places that move on, in three axes, with little of each in the first: most eigenvalues are near 0, and more than one. */
	for (int i = 0; i < n * n && kind == 3; i++) {
		double size = pow(10, -6 * fabs(incise_random_symmetric(seed)));

		to[i] = (i / n == i % n + 3) +
			(i / n < 3 ? size * incise_random_symmetric(seed) : 0);
	}
	for (int i = 0; i < n && (kind == 1 || kind == 2); i++) {
		/* A shift of places, whose first row is a mean: as poses on their way. */
		if (i > 0)
			to[i * n + i - 1] = kind == 1 ? 1 : 0.02;
		to[i] = kind == 1 ? incise_random_symmetric(seed) : 0;
		/* A chain of integrators, one after the other. */
		if (kind == 2) {
			to[i] = 0;
			to[i * n + i] = 1 - 0.02 * i;
		}
	}
	return n;
}

/* Each of LAPACK's has one of ours near by, which is then taken. Of chains of 60 the condition takes half of the digits. */
TEST(test_as_lapack)
{
	uint64_t seed = 1;

	for (int round = 0; round < 400; round++) {
		int n = kind_of(&seed, round % 4, a);
		double size = 0;

		for (int i = 0; i < n * n; i++)
			size = fmax(size, fabs(a[i]));
		memcpy(work, a, sizeof(a));
		assert_int_equal(LAPACKE_dgeev(LAPACK_ROW_MAJOR, 'N', 'N', n, work, n, wr,
					       wi, NULL, 1, NULL, 1),
				 0);
		memcpy(work, a, sizeof(a));
		assert_true(incise_eigenvalues(work, n, found));
		for (int i = 0; i < n; i++) {
			int nearest = i;

			for (int k = i; k < n; k++)
				if (cabs(found[k] - (wr[i] + I * wi[i])) <
				    cabs(found[nearest] - (wr[i] + I * wi[i])))
					nearest = k;
			if (!(cabs(found[nearest] - (wr[i] + I * wi[i])) < 1e-7 * n))
				fail_msg("round %d, %d: %g %g i, not %g %g i", round, n,
					 creal(found[nearest]), cimag(found[nearest]),
					 wr[i], wi[i]);
			found[nearest] = found[i];
		}
	}
}

/* A vector of its plane: A² x - 2 Re λ A x + |λ|² x = 0. */
TEST(test_vectors)
{
	uint64_t seed = 5;

	for (int round = 0; round < 100; round++) {
		int n = kind_of(&seed, 0, a);
		double x[MOST], y[MOST], z[MOST];
		double complex e;

		memcpy(work, a, sizeof(a));
		assert_true(incise_eigenvalues(work, n, found));
		e = found[incise_random_next(&seed) % (uint64_t)n];
		for (int i = 0; i < n; i++)
			x[i] = 1 + i;
		incise_eigenvector(a, n, e, work, x);
		for (int i = 0; i < n; i++) {
			y[i] = 0;
			for (int k = 0; k < n; k++)
				y[i] += a[i * n + k] * x[k];
		}
		for (int i = 0; i < n; i++) {
			z[i] = creal(e * conj(e)) * x[i] - 2 * creal(e) * y[i];
			for (int k = 0; k < n; k++)
				z[i] += a[i * n + k] * y[k];
			assert_true(fabs(z[i]) < 1e-9);
		}
	}
}

TEST(test_no_numbers)
{
	double not [4] = {1, 2, NAN, 3};

	assert_false(incise_eigenvalues(not, 2, found));
}
