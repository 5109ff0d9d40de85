// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The share of a texture that acts on a hand: of the forces at ticks at which the blade cuts new tissue, by least squares,
 *
 *   acting = a + b · mean + share · texture
 *
 * with the model's force and its texture as they are before the front: a share of 1 is all of it, at once. Neither an
 * actuator aside of the normal nor a ramp of the force counts, as both act on the mean as well.
 */
#include <math.h>
#include "../base/vector.h"
#include "plan.h"

void incise_felt_add(struct incise_felt *felt, double mean_N, double texture_N,
		     double acting_N)
{
	const double of[] = {1, mean_N, texture_N, acting_N};

	for (int i = 0; i < 4; i++)
		for (int k = i; k < 4; k++)
			felt->sum[i][k] += of[i] * of[k];
}

/* Less would be a constant, or rounding. */
#define LEAST 1e-9

double incise_felt_share(const struct incise_felt *felt)
{
	struct incise_felt left = *felt;

	for (int i = 0; i < 2; i++) {
		const double *row = left.sum[i];

		if (!(row[i] > LEAST * felt->sum[i][i]))
			continue;
		for (int k = i + 1; k < 4; k++)
			for (int j = k; j < 4; j++)
				left.sum[k][j] -= row[k] * row[j] / row[i];
	}
	return left.sum[2][2] > LEAST * felt->sum[2][2] ? left.sum[2][3] / left.sum[2][2]
							: NAN;
}

void incise_plan_feel(struct incise_plan *plan, const struct incise_tick *tick,
		      double mean_N, double texture_N)
{
	double acting_N[3];

	v3_copy(acting_N, plan->axes.n ? (const double[3]){0} : plan->last_N);
	for (int i = 0; i < plan->axes.n; i++)
		v3_add(acting_N, acting_N, tick->rendered_N[i],
		       plan->axes.axis[i].direction);
	incise_felt_add(&plan->felt, mean_N, texture_N, v3_dot(acting_N, tick->normal));
}

double incise_plan_texture_felt(const struct incise_plan *plan)
{
	return incise_felt_share(&plan->felt);
}

bool incise_plan_texture(const struct incise_plan *plan, struct incise_plan_texture *to)
{
	const struct incise_fixed_texture *texture = plan->texture;
	int32_t least = INT32_MAX;
	double squares = 0;

	*to = (struct incise_plan_texture){.most = 0};
	if (!texture)
		return false;
	for (int i = 0; i < INCISE_TEXTURE_CUTS; i++)
		least = texture->factor[i] < least ? texture->factor[i] : least;
	for (int i = 0; i < INCISE_TEXTURE_KNOTS; i++)
		squares += (double)texture->knot[i] * texture->knot[i];
	*to = (struct incise_plan_texture){
		.most = (double)texture->most / INCISE_TEXTURE_ONE,
		.rms = sqrt(squares / INCISE_TEXTURE_KNOTS) / INCISE_TEXTURE_ONE,
		.events_per_mm = plan->scene->learned.rendered.rate,
		.factor_least = least / (double)INCISE_FIXED_ONE,
		.factor_most = texture->factor_most / (double)INCISE_FIXED_ONE,
	};
	return true;
}
