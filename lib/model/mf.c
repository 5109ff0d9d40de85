// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Membership functions; see incise/model.h. Degrees are computed as logarithms, because
 * far from every centre the degrees themselves are all zero and eq. (3) would be 0/0.
 */
#include <math.h>
#include <string.h>
#include "model.h"

/* Largest distance in widths that is told apart; its square is still finite. */
#define Z_MAX 1e150

static const struct {
	const char *name;
	int n_params;
} kinds[] = {
	[INCISE_MF_GAUSS] = {"gaussmf", 2},
	[INCISE_MF_GBELL] = {"gbellmf", 3},
};

const char *incise_mf_type_name(enum incise_mf_type type)
{
	return kinds[type].name;
}

int incise_mf_type_find(const char *word)
{
	for (size_t i = 0; i < sizeof(kinds) / sizeof(*kinds); i++)
		if (!strcmp(word, kinds[i].name))
			return i;
	return -1;
}

int incise_mf_n_params(enum incise_mf_type type)
{
	return kinds[type].n_params;
}

bool incise_mf_valid(enum incise_mf_type type, const double *p)
{
	for (int i = 0; i < kinds[type].n_params; i++)
		if (!isfinite(p[i]))
			return false;
	return p[0] > 0 && (type != INCISE_MF_GBELL || p[1] > 0);
}

double incise_mf_log(const struct incise_mf *mf, double x)
{
	const double *p = mf->p;
	double z, t;

	switch (mf->type) {
	case INCISE_MF_GAUSS:
		z = fmin(fabs((x - p[1]) / p[0]), Z_MAX);
		return -0.5 * z * z;
	case INCISE_MF_GBELL:
		/* log(1 + |z|^(2b)), where the power alone could overflow */
		z = fmin(fabs((x - p[2]) / p[0]), Z_MAX);
		t = 2 * p[1] * log(z);
		return fmax(t > 40 ? -t : -log1p(exp(t)), MODEL_LOG_MIN);
	}
	return 0;
}

double incise_mf_eval(const struct incise_mf *mf, double x)
{
	return exp(incise_mf_log(mf, x));
}
