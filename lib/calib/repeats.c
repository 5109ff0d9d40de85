// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Repeats; see repeats.h.
 */
#include <math.h>
#include <stdlib.h>
#include "../base/ascending.h"
#include "repeats.h"

#define FEW 20
#define LAGS_MAX 200 /* four seconds of pictures */

double repeats_median(double *values, int n)
{
	qsort(values, n, sizeof(*values), ascending);
	return (values[n / 2] + values[(n - 1) / 2]) / 2;
}

double repeats_sd(double *absolute, int n)
{
	double sd = 1.4826 * repeats_median(absolute, n);

	/* Few can lie close together by chance: what three quarters of them keep within. */
	if (n < FEW)
		sd = absolute[3 * n / 4] / 1.1503;
	return sd * (1 + 12.0 / n);
}

/* Half of what Student's t needs for 95.45 %, by degrees of freedom. */
static double widen(int dof)
{
	static const double t[] = {13.97, 4.53, 3.31, 2.87, 2.65, 2.52, 2.43, 2.37};

	if (dof < 1)
		return t[0] / 2;
	if (dof <= 8)
		return t[dof - 1] / 2;
	return 1 + 1.26 / dof; /* within 0.005 of the table from there on */
}

/*
 * 1 + 2 Σ ρ as long as the correlation is more than chance makes, Sokal's way to end a sum:
 * at a lag of 5 times what it has come to.
 */
static double correlation_time(const double *r, int n, double power)
{
	double sum = 1;

	for (int lag = 1; lag < n / 4 && lag < LAGS_MAX && lag <= 5 * sum; lag++) {
		double product = 0;

		for (int i = lag; i < n; i++)
			product += r[i] * r[i - lag];
		if (product / power < 2 / sqrt(n))
			break;
		sum += 2 * product / power;
	}
	return sum;
}

double repeats_u(const double *residual, int n, int fitted, int *effective)
{
	double power = 0, times;
	int worth = n;

	for (int i = 0; i < n; i++)
		power += residual[i] * residual[i];
	*effective = n;
	if (n <= fitted || !(power > 0))
		return 0;
	times = n >= 8 ? correlation_time(residual, n, power) : 1;
	worth = (int)(n / times);
	if (worth < fitted + 1)
		worth = fitted + 1;
	*effective = worth;
	return sqrt(power / (n - fitted) / worth) * widen(worth - fitted);
}
