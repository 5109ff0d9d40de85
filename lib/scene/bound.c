// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The certified error of a plan in integers: how far its force can be from that of the same plan in
 * double, tick by tick, on the same poses.
 *
 *   pose's rounding ─▶ filter: Σ |Aʲ| r ─▶ place of the tool ─ stiffness ─▶ force
 *                                       ─▶ speed ─ damping ─▶ force
 *   rounding of numbers, products and the model's table ─────▶ force
 *
 * The filter is linear. Its rounding r of each pose passes through A = (I - K C) F for as many poses
 * as come after, so that Σ |Aʲ| r bounds all that adds up. Stiffness and damping are those of the
 * stability check, which are the largest of any phase.
 */
#include <math.h>
#include "../base/vector.h"
#include "../fixed/input.h"
#include "plan.h"

/* A hand's speed at most, mm/s, and its largest acceleration that the filter lets pass, mm/s². */
#define SPEED_MM_S 1000
#define HARD_MM_S2 100000

/* A hand's own acceleration across its motion, at most: errors of the direction count by it. Below this
 * speed the direction counts in proportion to the speed: see lib/tissue/predict.c. */
#define HAND_MM_S2 2000
#define SLOW_MM_S 5

#define LSB_MM (1.0 / 65536)

/*
 * A blade enters the tissue at this angle to it at least, sine of 6°: where it enters, a place along
 * its way is as uncertain as its depth divided by this.
 */
#define ENTERS 0.1

/* The error of a place counts so often: in the depth, in the direction to the surface, and the
 * direction of the surface itself, which turns by no more than that while depths are below half of its
 * radius. */
#define PLACES 3

/* Steps of rounding of a tick behind the place of the tool: sums and products of a force. */
#define ROUNDINGS 24

/* Errors of a filter's state: mm, mm/s, mm/s². */
struct state_error {
	double x, v, a;
};

static void multiply(double to[3][3], double (*a)[3], double (*b)[3])
{
	for (int i = 0; i < 3; i++)
		for (int k = 0; k < 3; k++) {
			to[i][k] = 0;
			for (int j = 0; j < 3; j++)
				to[i][k] += a[i][j] * b[j][k];
		}
}

/* Rounding that a pose adds, of each component; @in_mm: the rounding of the pose itself. */
static struct state_error added(const struct incise_predict *p, double in_mm)
{
	const double dt = ldexp(1, -30); /* rounding of a time, s */
	double miss_mm = in_mm + ldexp(1, -25);
	double per_s = 1 / p->period_s;

	return (struct state_error){
		3 * ldexp(1, -33) + SPEED_MM_S * dt + p->alpha * miss_mm +
			ldexp(INCISE_PREDICT_JUMP_MM, -31),
		2 * ldexp(1, -21) + HARD_MM_S2 * dt + p->beta * per_s * miss_mm +
			ldexp(INCISE_PREDICT_JUMP_MM, -17),
		2 * ldexp(1, -17) + p->gamma * per_s * per_s * miss_mm +
			ldexp(INCISE_PREDICT_JUMP_MM, -13),
	};
}

/* Σ |Aʲ| r, of poses that come a period apart. Infinite where it does not settle. */
static struct state_error settled(const struct incise_predict *p, double in_mm)
{
	double T = p->period_s, b = p->beta / T, g = p->gamma / (T * T), al = p->alpha;
	double f[3][3] = {{1, T, T * T / 2}, {0, 1, T}, {0, 0, 1}};
	double keep[3][3] = {{1 - al, 0, 0}, {-b, 1, 0}, {-g, 0, 1}};
	double a[3][3], power[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, next[3][3];
	const struct state_error r = added(p, in_mm);
	const double in[3] = {r.x, r.v, r.a};
	double sum[3] = {0}, last[3];

	multiply(a, keep, f);
	for (int j = 0; j < 100000; j++) {
		bool small = true;

		for (int i = 0; i < 3; i++) {
			last[i] = 0;
			for (int k = 0; k < 3; k++)
				last[i] += fabs(power[i][k]) * in[k];
			sum[i] += last[i];
			small &= last[i] < 1e-9 * sum[i];
		}
		/* The rest of a sum that falls by more than 1/10 in ten steps, as gains make it. */
		if (small)
			return (struct state_error){1.001 * sum[0], 1.001 * sum[1],
						    1.001 * sum[2]};
		multiply(next, a, power);
		for (int i = 0; i < 3; i++)
			v3_copy(power[i], next[i]);
	}
	return (struct state_error){INFINITY, INFINITY, INFINITY};
}

/* Bounds of the prediction this long after a pose, mm and mm/s per component. */
static struct state_error ahead(const struct state_error *e, double s)
{
	return (struct state_error){
		e->x + e->v * s + e->a * s * s / 2 + SPEED_MM_S * ldexp(1, -30) +
			2 * ldexp(1, -33),
		e->v + e->a * s + HARD_MM_S2 * ldexp(1, -30) + 2 * ldexp(1, -21),
		0,
	};
}

/* Place, velocity and acceleration of the tool, as lengths of vectors. */
static struct state_error shown(const struct incise_plan *plan)
{
	const struct incise_predict *p = &plan->predict;
	/* Of attitude and arms 2^-27 each, and the rounding of the pose and of two sums. */
	double arms_mm =
		v3_length(plan->doubles.plan.numbers.tip) + plan->scene->tool.handle_mm;
	double in_mm = 2 * LSB_MM + ldexp(arms_mm, -27);
	struct state_error e = settled(p, in_mm);
	double latency_s = (double)p->latency_ns * 1e-9;
	/* The rest of the last prediction is blended out: its error, and the filter's then. */
	struct state_error now = ahead(&e, latency_s + p->period_s),
			   then = ahead(&e, latency_s);

	return (struct state_error){
		sqrt(3) * (2 * now.x + then.x + ldexp(1, -25) + LSB_MM / 2),
		sqrt(3) * (2 * now.v + then.v + ldexp(1, -17)),
		sqrt(3) * (3 * e.a + ldexp(1, -13)),
	};
}

/*
 * By the inputs of the model but its depth, each with its steepest slope. The acceleration along the
 * motion is off by that of the vector, and by the direction's; the tilt by attitude and normal; and a
 * contact may begin a tick earlier.
 */
static double inputs_N(const struct incise_plan *plan, const struct state_error *e)
{
	const double *slope = plan->input_slope;
	double turned = ldexp(1, -25);

	if (plan->surface->kind != INCISE_SURFACE_PLANE && !plan->surface->mesh)
		turned += 2 * e->x / plan->surface->capsule.radius;
	return slope[INCISE_INPUT_SPEED] * (e->v + LSB_MM) +
	       slope[INCISE_INPUT_ACCELERATION] *
		       (e->a + HAND_MM_S2 * e->v / SLOW_MM_S +
			ldexp(1, -INCISE_FIXED_INPUT_ACCELERATION_BITS) +
			ldexp(HARD_MM_S2, -INCISE_FIXED_INPUT_ACCELERATION_SHARE_BITS)) +
	       slope[INCISE_INPUT_TILT] *
		       (INCISE_FIXED_INPUT_TILT_DEG + turned * 180 / M_PI) +
	       slope[INCISE_INPUT_TIME] * (1 / plan->scene->rate_hz + 2 * LSB_MM);
}

double incise_front_bound(double unloading_N_mm, double friction, double most_N,
			  double cutting_bound_N)
{
	const double half = 0x1p-17;

	return (1 + 4 * friction) * cutting_bound_N +
	       half * (8 * unloading_N_mm + 12 + 2 * most_N +
		       2 * most_N * (1 + friction) / unloading_N_mm);
}

/* Rounding of the model's table, of the cut's front, and of each stiffness over its reach. */
static double tissue_N(const struct incise_plan *plan, const struct state_error *e,
		       double reach_mm)
{
	double bound_N = 0;

	if (plan->fixed)
		bound_N =
			plan->gain * incise_fixed_bound(plan->fixed) + inputs_N(plan, e);

	/* The force is below the unloading from the surface on. */
	if (plan->fixed && plan->dissipates)
		bound_N = incise_front_bound(plan->unloading_N_mm,
					     plan->acting[INCISE_FORCE_REACTION]
						     .number[INCISE_REACTION_FRICTION],
					     plan->unloading_N_mm * reach_mm,
					     bound_N + LSB_MM);
	for (int i = 0; i < incise_n_tissue_forces; i++)
		if (plan->acting[i].force && plan->acting[i].number[0] > 0)
			bound_N += reach_mm * LSB_MM / 2;
	if (plan->scene->membrane.thickness_mm > 0)
		bound_N += plan->scene->membrane.thickness_mm * LSB_MM / 2;
	return bound_N + ROUNDINGS * LSB_MM / 2;
}

/* Ticks of a contact in which the skin's anchor is rounded: an hour at 1 kHz. */
#define ANCHOR_TICKS 3.6e6

/*
 * The skin drags by the force along the normal, and by where its anchor is: it begins where the contact does,
 * which is uncertain along the skin, and goes on with the errors of tool, slip and rounding. A hand that circles
 * the anchor at the slip R = μ N / K draws it round on √(ρ² - R²): from ρ = R on an error δ of either makes up
 * to √(2 R δ) of it.
 */
static double skin_N(const struct incise_plan *plan, const struct state_error *e,
		     double normal_N, double reach_mm)
{
	const double *skin = plan->acting[INCISE_FORCE_SKIN].number;
	double most_N = plan->stability.stiffness_N_mm * reach_mm, pull_N, slip_mm,
	       off_mm;

	if (!(skin[0] > 0))
		return 0;
	/* Its share is rounded, too. */
	pull_N = skin[1] * normal_N + most_N * LSB_MM / 2;
	slip_mm = skin[1] * most_N / skin[0];
	off_mm = 4 * e->x + 8 * LSB_MM + ldexp(ANCHOR_TICKS, -33) + pull_N / skin[0];
	return pull_N + skin[0] * (e->x / ENTERS + off_mm + sqrt(2 * slip_mm * off_mm));
}

double incise_plan_bound(const struct incise_plan *plan, double reach_mm)
{
	const struct incise_plan_stability *s = &plan->stability;
	double plane_N_mm = plan->acting[INCISE_FORCE_PLANE].number[0], bound_N;
	struct state_error e;

	if (!plan->scene->fixed)
		return 0;
	e = shown(plan);
	bound_N =
		tissue_N(plan, &e, reach_mm) +
		s->stiffness_N_mm * (PLACES * (e.x + 4 * LSB_MM) + ldexp(reach_mm, -26)) +
		plane_N_mm * e.x / ENTERS + s->damping_N_s_mm * e.v +
		ldexp(SPEED_MM_S, -29);
	return bound_N + skin_N(plan, &e, bound_N, reach_mm);
}
