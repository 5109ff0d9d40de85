// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Membership functions; see incise/model.h. Degrees are computed as logarithms, because
 * far from every centre the degrees themselves are all zero and eq. (3) would be 0/0.
 *
 * The degree of a triangle or trapezoid is exactly zero outside its feet, which has no
 * logarithm. There the distance to the feet, the gap, stands in for it:
 *
 *            ____           log degree  finite
 *           /    \          gap         0
 *   _______/      \_______
 *      gap a      d gap     log degree  taken as 0: only the gap distinguishes rules
 */
#include <float.h>
#include <math.h>
#include <string.h>
#include "model.h"

/*
 * Distances of more widths than this go on growing as their logarithm only: then the
 * squares of all of them, and the sums over all inputs, stay below DBL_MAX.
 */
#define FAR 1e150
#define LN_FAR 345.38776394910684

/*
 * The gap on a foot itself, where the degree is zero already. Gaps of a function without
 * a width (a = d) are counted in this width: further than all others, yet in order.
 */
#define GAP_MIN 1e-300
#define WIDTH_MIN 1e-150

static const struct {
	const char *name;
	int n_params;
} kinds[] = {
	[INCISE_MF_GAUSS] = {"gaussmf", 2},   [INCISE_MF_GBELL] = {"gbellmf", 3},
	[INCISE_MF_GAUSS2] = {"gauss2mf", 4}, [INCISE_MF_TRI] = {"trimf", 3},
	[INCISE_MF_TRAP] = {"trapmf", 4},     [INCISE_MF_SIG] = {"sigmf", 2},
};

#define N_KINDS (sizeof(kinds) / sizeof(*kinds))

bool incise_mf_type_known(enum incise_mf_type type)
{
	return (size_t)type < N_KINDS;
}

const char *incise_mf_type_name(enum incise_mf_type type)
{
	return kinds[type].name;
}

int incise_mf_type_find(const char *word)
{
	for (size_t i = 0; i < N_KINDS; i++)
		if (!strcmp(word, kinds[i].name))
			return i;
	return -1;
}

int incise_mf_n_params(enum incise_mf_type type)
{
	return kinds[type].n_params;
}

static const char *trapezoid_fault(double a, double b, double c, double d)
{
	if (a > b || c > d || a > d)
		return "a foot lies inside: it needs a <= b, c <= d and a <= d";
	/* With b > c MATLAB takes the lower of both slopes; [5 6 4 5] would be zero everywhere. */
	if (b > c && a == d)
		return "it is zero everywhere";
	if (!isfinite(b - a) || !isfinite(d - c) || !isfinite(d - a))
		return "its width must be finite";
	return NULL;
}

const char *incise_mf_fault(enum incise_mf_type type, const double *p)
{
	for (int i = 0; i < kinds[type].n_params; i++)
		if (!isfinite(p[i]))
			return "its numbers must be finite";
	switch (type) {
	case INCISE_MF_GAUSS:
		return p[0] > 0 ? NULL : "its width must be positive";
	case INCISE_MF_GBELL:
		return p[0] > 0 && p[1] > 0 ? NULL
					    : "its width and slope must be positive";
	case INCISE_MF_GAUSS2:
		return p[0] > 0 && p[2] > 0 ? NULL : "its widths must be positive";
	case INCISE_MF_TRI:
		if (!(p[0] <= p[1] && p[1] <= p[2]))
			return "its numbers must not fall: a <= b <= c";
		return trapezoid_fault(p[0], p[1], p[1], p[2]);
	case INCISE_MF_TRAP:
		return trapezoid_fault(p[0], p[1], p[2], p[3]);
	case INCISE_MF_SIG:
		return NULL;
	}
	return "its kind is unknown";
}

/* distance/width ≥ 0: growing, and finite, however far. */
static double in_widths(double distance, double width)
{
	double q = distance / width;

	if (q <= FAR)
		return q;
	distance = fmin(distance, DBL_MAX);
	return FAR * (1 + log(distance) - log(width) - LN_FAR);
}

/* One side of a Gaussian. */
static double flank_log(double distance, double s)
{
	double z = in_widths(fabs(distance), s);

	return -0.5 * z * z;
}

/* -log(1 + |d/a|^(2b)), where the power alone could overflow. */
static double bell_log(double d, double a, double b)
{
	double z, t;

	d = fmin(fabs(d), DBL_MAX);
	z = d / a;
	if (d == 0)
		return 0;
	/* A quotient that over- or underflows still has a logarithm. */
	t = b * (2 * (z > 1 / FAR && z < FAR ? log(z) : log(d) - log(a)));
	/* From 40 on, the 1 is less than half an ulp of the power. */
	return fmax(t > 40 ? -t : -log1p(exp(t)), MODEL_LOG_MIN);
}

static double trapezoid_log(double x, double a, double b, double c, double d, double *gap)
{
	double rise = x >= b ? 1 : (x - a) / (b - a);
	double fall = x <= c ? 1 : (d - x) / (d - c);
	double degree = fmin(rise, fall);

	if (degree > 0)
		return log(degree);
	*gap = fmax(in_widths(fmax(fmax(a - x, x - d), 0), fmax(d - a, WIDTH_MIN)),
		    GAP_MIN);
	return 0;
}

/* -log(1 + exp(-a d)) */
static double sigmoid_log(double d, double a)
{
	double t;

	d = fmax(-DBL_MAX, fmin(DBL_MAX, d));
	t = a * d;
	if (t > 0)
		return -log1p(exp(-t));
	if (t < -FAR * FAR)
		return -FAR * FAR * (1 + log(fabs(a)) + log(fabs(d)) - 2 * LN_FAR);
	return t - log1p(exp(t));
}

double incise_mf_log(const struct incise_mf *mf, double x, double *gap)
{
	const double *p = mf->p;

	*gap = 0;
	switch (mf->type) {
	case INCISE_MF_GAUSS:
		return flank_log(x - p[1], p[0]);
	case INCISE_MF_GBELL:
		return bell_log(x - p[2], p[0], p[1]);
	case INCISE_MF_GAUSS2:
		/* With c1 > c2 both flanks hold between them, and their product counts. */
		return (x < p[1] ? flank_log(x - p[1], p[0]) : 0) +
		       (x > p[3] ? flank_log(x - p[3], p[2]) : 0);
	case INCISE_MF_TRI:
		return trapezoid_log(x, p[0], p[1], p[1], p[2], gap);
	case INCISE_MF_TRAP:
		return trapezoid_log(x, p[0], p[1], p[2], p[3], gap);
	case INCISE_MF_SIG:
		return sigmoid_log(x - p[1], p[0]);
	}
	return 0;
}

static double trapezoid_log_slope(double x, double a, double b, double c, double d)
{
	double rise = x >= b ? 1 : (x - a) / (b - a);
	double fall = x <= c ? 1 : (d - x) / (d - c);

	if (!(fmin(rise, fall) > 0) || rise == fall)
		return 0;
	return rise < fall ? 1 / (x - a) : -1 / (d - x);
}

double incise_mf_log_slope(const struct incise_mf *mf, double x)
{
	const double *p = mf->p;
	double gap, slope = 0;

	switch (mf->type) {
	case INCISE_MF_GAUSS:
		slope = -(x - p[1]) / p[0] / p[0];
		break;
	case INCISE_MF_GBELL: /* smooth at the centre for b above 1/2 */
		slope = x == p[2] ? 0
				  : 2 * p[1] / (x - p[2]) *
					    expm1(incise_mf_log(mf, x, &gap));
		break;
	case INCISE_MF_GAUSS2:
		slope = (x < p[1] ? -(x - p[1]) / p[0] / p[0] : 0) +
			(x > p[3] ? -(x - p[3]) / p[2] / p[2] : 0);
		break;
	case INCISE_MF_TRI:
		slope = trapezoid_log_slope(x, p[0], p[1], p[1], p[2]);
		break;
	case INCISE_MF_TRAP:
		slope = trapezoid_log_slope(x, p[0], p[1], p[2], p[3]);
		break;
	case INCISE_MF_SIG:
		slope = -p[0] * expm1(incise_mf_log(mf, x, &gap));
		break;
	}
	return fmax(-DBL_MAX, fmin(DBL_MAX, slope));
}

double incise_mf_eval(const struct incise_mf *mf, double x)
{
	double gap, log = isnan(x) ? MODEL_LOG_MIN : incise_mf_log(mf, x, &gap);

	return isnan(x) || gap > 0 ? 0 : exp(log);
}
