// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The front of a cut; see front.h.
 */
#include <math.h>
#include "../base/vector.h"
#include "../fixed/front.h"
#include "front.h"

bool incise_front_enter(struct incise_front *front, const double at_mm[3],
			const double normal[3], const double side[3])
{
	bool fresh = !incise_line_holds(&front->line, at_mm, INCISE_FRONT_BESIDE_MM);

	/* The work of an earlier visit pays for nothing now. */
	*front = (struct incise_front){.cut_mm = fresh ? 0 : front->cut_mm,
				       .line = front->line};
	if (fresh)
		incise_line_begin(&front->line, at_mm, normal, side);
	return fresh;
}

double incise_front_advance(struct incise_front *front, const double at_mm[3],
			    const double normal[3], const double side[3])
{
	struct incise_line *line = &front->line;
	double length_mm = line->to_mm - line->from_mm;

	incise_line_extend(line, at_mm);
	if (incise_line_holds(line, at_mm, INCISE_FRONT_BESIDE_MM))
		return line->to_mm - line->from_mm - length_mm;
	/* It left the line sideways; a curved skin does that too. The cut goes on from here. */
	incise_line_begin(line, at_mm, normal, side);
	return INCISE_FRONT_BESIDE_MM;
}

double incise_front_force(struct incise_front *front, double unloading_N_mm,
			  double friction, double depth_mm, double advance_mm,
			  double cutting_N)
{
	double K = unloading_N_mm, friction_N = friction * cutting_N, upper_N;
	double elastic_N = K * (depth_mm - front->rest_mm), trial_N, force_N;
	double half_way_mm = (depth_mm - front->depth_mm) / 2;

	front->cut_mm = fmax(front->cut_mm - advance_mm, 0);
	front->rest_mm -= advance_mm;
	trial_N = force_N = K * (depth_mm - front->rest_mm);
	if (advance_mm > 0) {
		double work =
			front->work_N_mm + (front->force_N + elastic_N) * half_way_mm;
		/* Elastic energy is F²/2K. */
		double paid_N = sqrt(
			2 * K * fmax(work - INCISE_FRONT_KEPT * front->most_N_mm, 0));

		force_N = fmax(elastic_N, fmin(trial_N, paid_N));
	}
	upper_N = fmax(friction_N, K * (depth_mm - front->cut_mm));
	force_N = fmax(-friction_N, fmin(force_N, fmin(upper_N, cutting_N)));
	/* Else it stays to the bit, and no rounding adds up. */
	if (force_N < trial_N || force_N > trial_N)
		front->rest_mm = depth_mm - force_N / K;
	/* The blade cuts where all of the model's force acts. */
	if (force_N >= cutting_N)
		front->cut_mm = fmax(front->cut_mm, depth_mm - cutting_N / K);
	front->work_N_mm += (front->force_N + force_N) * half_way_mm;
	front->most_N_mm = fmax(front->most_N_mm, front->work_N_mm);
	front->depth_mm = depth_mm;
	front->force_N = force_N;
	return force_N;
}

double incise_fixed_front_bound(double unloading_N_mm, double friction, double most_N,
				double cutting_bound_N)
{
	const double half = 0x1p-17;

	return (1 + 4 * friction) * cutting_bound_N +
	       half * (8 * unloading_N_mm + 12 + 2 * most_N +
		       2 * most_N * (1 + friction) / unloading_N_mm);
}
