// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Whether a scene is stable on its device, before its first tick: a search for swings that do not end, see rest.h.
 */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/units.h"
#include "../base/vector.h"
#include "../control/pose_loop.h"
#include "../model/slope.h"
#include "rest.h"

/*
 * Of the scene's forces, how much an actuator may have to push along its direction: all, and
 * more where it works against others that are not at right angles.
 */
static double pushed(const struct incise_plan *plan, int i)
{
	return plan->axes.n > 1 ? fmax(1, v3_length(plan->axes.axis[i].dual)) : 1;
}

/* Inputs that the search's hand does not move, or does not move far enough. */
static const enum incise_model_input unmoved[] = {INCISE_INPUT_TILT, INCISE_INPUT_TIME,
						  INCISE_INPUT_MEAN_SPEED};
#define UNMOVED ((int)(sizeof(unmoved) / sizeof(*unmoved)))

/* Take another search of the same plan in: the one that swings, or took longer to come to rest, stays. */
static void add_search(struct incise_rest *rest, const struct incise_rest *other)
{
	const struct incise_rest before = *rest;

	if (!other->rests || other->worst.settle_s > rest->worst.settle_s)
		*rest = *other;
	rest->weakest = before.weakest;
	incise_rest_take_weakest(&rest->weakest, &other->weakest);
	rest->runs = before.runs + other->runs;
	rest->ticks = before.ticks + other->ticks;
}

/*
 * Search as the inputs are, then with those unmoved ones held at either end of their supports, in all
 * combinations, until one swings; a blade is not below the deepest depth, which is held at its upper end. Returns 0 or
 * -ENOMEM.
 */
static int search_inputs(struct incise_plan *plan,
			 const struct incise_tracker_info *tracker,
			 const struct incise_rest_trial *as_is, struct incise_rest *rest)
{
	struct incise_rest_trial own = *as_is, *const trial = &own;
	enum incise_model_input inputs[UNMOVED];
	double ends[UNMOVED][2], deepest[2];
	bool deep;
	int n = 0, rc;

	for (int i = 0; i < plan->stability.n_axes; i++)
		trial->gain = fmax(trial->gain, as_is->gain * pushed(plan, i));
	for (int i = 0; i < UNMOVED; i++)
		if (incise_plan_kind_range(plan, unmoved[i], ends[n]))
			inputs[n++] = unmoved[i];
	deep = incise_plan_kind_range(plan, INCISE_INPUT_DEEPEST, deepest);
	rc = incise_plan_rest(plan, tracker, trial, rest);
	for (int corner = 0; (n || deep) && corner < 1 << n && !rc && rest->rests;
	     corner++) {
		struct incise_rest here;

		if (deep) {
			plan->doubles.plan.held[INCISE_FIXED_INPUT_DEEPEST] = deepest[1];
			plan->doubles.plan.holds |= 1U << INCISE_FIXED_INPUT_DEEPEST;
		}
		for (int i = 0; i < n; i++) {
			plan->doubles.plan.held[inputs[i] + 1] = ends[i][corner >> i & 1];
			plan->doubles.plan.holds |= 2U << inputs[i];
		}
		rc = incise_plan_rest(plan, tracker, trial, &here);
		if (!rc)
			add_search(rest, &here);
	}
	plan->doubles.plan.holds = 0;
	return rc;
}

/*
 * A texture counts as if its largest factor were constant: while a tool swings in one place, the front stays where it was
 * deepest, and so does its factor. A tool meets each tooth once, as the way only grows, though one that creeps may fall from
 * it long after it began to lean.
 */
static int search_check(struct incise_plan *plan,
			const struct incise_tracker_info *tracker,
			const struct incise_rest_trial *as_is, struct incise_rest *rest)
{
	const struct incise_fixed_texture *texture = plan->texture;
	struct incise_fixed_texture *constant = NULL;
	int rc;

	if (!texture)
		return search_inputs(plan, tracker, as_is, rest);
	constant = calloc(1, sizeof(*constant));
	if (!constant)
		return -ENOMEM;
	constant->step_shift = texture->step_shift;
	constant->factor_most =
		(int32_t)lrint(incise_plan_texture_most(plan) * INCISE_FIXED_ONE);
	for (int i = 0; i < INCISE_TEXTURE_CUTS; i++)
		constant->factor[i] = constant->factor_most;
	plan->texture = constant;
	rc = search_inputs(plan, tracker, as_is, rest);
	plan->texture = texture;
	free(constant);
	return rc;
}

/* A gain, or a damping, that is looked for. */
struct advice {
	bool damps;
	struct incise_rest swung; /* a run with the least gain that swung … */
	double gain;		  /* … and that */
};

/*
 * The search, with this gain or damping: only the way *@way, or all if *@way is below 0; then *@way becomes the way
 * that swung.
 */
static bool helps(struct incise_plan *plan, const struct incise_tracker_info *tracker,
		  struct advice *advice, double value, int *way)
{
	const struct incise_rest_trial trial = {
		.gain = advice->damps ? plan->gain : value,
		.damping_N_s_mm =
			advice->damps ? value : plan->stability.device.damping_N_s_mm,
		.way = *way,
	};
	struct incise_rest rest = {.way = -1};

	if (!search_check(plan, tracker, &trial, &rest) && rest.rests)
		return true;
	if (*way < 0)
		*way = rest.way;
	if (rest.way >= 0 && trial.gain < advice->gain) {
		advice->swung = rest;
		advice->gain = trial.gain;
	}
	return false;
}

/*
 * The advice is looked for down to a millionth of the gain, and up to 16 times the damping: by the way that swung alone, by
 * halvings of its logarithm, and then tried in all ways; if another way swings, the search goes on with that.
 */
#define GAIN_LEAST (1.0 / 1048576)
#define DAMPING_MOST 16 /* times the device's own, or than 1 mN s/mm */
#define HALVINGS 5
#define ATTEMPTS 6
#define HOST_ATTEMPTS 16 /* shorter steps swing in other ways */

/* For a message, to the bit as it is read again. */
static double three_digits(double value, double (*round)(double))
{
	double part = pow(10, 2 - floor(log10(value)));

	return round(value * part) / part;
}

/* The device's own damping, or as much as any has. */
static double least_damping(const struct incise_plan *plan)
{
	return fmax(plan->stability.device.damping_N_s_mm, 1e-3);
}

/* The nearest value to the plan's own, in three digits, that was tried and holds; 0: not found. @way swung. */
static double find_advice(struct incise_plan *plan,
			  const struct incise_tracker_info *tracker, bool damps, int way,
			  struct advice *advice)
{
	double (*safe)(double) = damps ? ceil : floor;
	double from = damps ? least_damping(plan) : plan->gain;
	double end = from * (damps ? DAMPING_MOST : GAIN_LEAST), factor = damps ? 2 : 0.5;
	int attempts = plan->hold.ticks > 1 ? HOST_ATTEMPTS : ATTEMPTS;

	advice->damps = damps;
	for (int i = 0; i < attempts; i++) {
		double good, bad = from;
		int any = -1;

		/* The plan as it is was tried. */
		if (i) {
			if (helps(plan, tracker, advice, from, &any))
				return from;
			way = any;
		}
		for (good = factor * from; !helps(plan, tracker, advice, good, &way);
		     good *= factor) {
			if (damps ? good > end : good < end)
				return 0;
			bad = good;
		}
		for (int k = 0; k < HALVINGS; k++) {
			double middle = sqrt(good * bad);

			*(helps(plan, tracker, advice, middle, &way) ? &good : &bad) =
				middle;
		}
		from = three_digits(good, safe);
	}
	return 0;
}

/* Say the gain and the damping that were tried and hold. */
static void advise(struct incise_plan *plan, const struct incise_tracker_info *tracker,
		   struct advice *advice, char text[200])
{
	int way = advice->swung.way;
	double gain = find_advice(plan, tracker, false, way, advice);
	double damping = plan->hold.fit && gain > 0
				 ? 0
				 : find_advice(plan, tracker, true, way, advice);

	plan->hold.gain = gain;
	*text = '\0';
	if (gain > 0)
		snprintf(text, 200, "set tissue.gain to at most %.3g%s", gain,
			 damping > 0 ? ", or " : "");
	if (damping > 0)
		snprintf(text + strlen(text), 200 - strlen(text),
			 "use a device with %s.damping_N_s_mm of at least %.3g",
			 tracker->haptic ? "haptic_setup" : "device", damping);
	if (!*text)
		snprintf(text, 200,
			 "no gain down to %.3g holds, and no damping of the device up "
			 "to %.3g N s/mm",
			 plan->gain * GAIN_LEAST, DAMPING_MOST * least_damping(plan));
}

/* A run in words, for a message. */
static void name_run(const struct incise_rest *rest, char name[160])
{
	static const char *const tools[] = {"tool", "blade", "handle", "tube"};
	static const char *const held[] = {"free", "held across", "in a hand"};
	const struct incise_plan_lean *worst = &rest->worst;
	const double *at = worst->place_mm, *N = rest->force_N;

	if (worst->guided)
		snprintf(
			name, 160,
			"the blade, along the skin at %.0f mm/s, under %.3g N, %.1f mm deep,",
			worst->along_mm_s, worst->lean_N, worst->depth_mm);
	else
		snprintf(
			name, 160,
			"the %s%s, %s, under [%.3g, %.3g, %.3g] N at [%.2f, %.2f, %.2f],",
			worst->tilted ? "tilted " : "", tools[worst->tool],
			held[worst->held], N[0], N[1], N[2], at[0], at[1], at[2]);
}

int incise_plan_check_rest(struct incise_plan *plan,
			   const struct incise_tracker_info *tracker,
			   struct incise_error *err)
{
	struct incise_plan_stability *s = &plan->stability;
	const struct incise_rest_trial as_is = {plan->gain, s->device.damping_N_s_mm, -1};
	char text[200], run[160], delay[64], how[64], with[64] = "";
	struct advice advice = {.gain = plan->gain};
	struct incise_rest *rest = &advice.swung;

	if (plan->scene->unchecked)
		return 0;
	if (search_check(plan, tracker, &as_is, rest))
		return incise_error_set(err, ENOMEM, "no memory for a plan");
	s->runs = rest->runs;
	s->ticks = rest->ticks;
	s->worst = rest->worst;
	s->weakest = rest->weakest;
	s->noise_mm = rest->noise_mm;
	s->noise_N = rest->noise_N;
	if (rest->rests)
		return 0;
	/* Names the run that limits the gain. */
	advise(plan, tracker, &advice, text);
	name_run(rest, run);
	if (plan->hold.ticks > 1)
		snprintf(delay, sizeof(delay), "a host that steps once in %.4g ms",
			 rest->hold_ticks * s->device.period_s * 1e3);
	else if (s->own_delay)
		snprintf(delay, sizeof(delay), "a delay of %d ticks",
			 s->device.delay_ticks);
	else
		snprintf(delay, sizeof(delay), "a tracker of %g Hz and %g ms",
			 tracker->rate_hz, (double)tracker->latency_ns * 1e-6);
	if (rest->worst.swing_mm > INCISE_REST_SWING_MM)
		snprintf(how, sizeof(how), "by %.3f mm and %.2f N", rest->worst.swing_mm,
			 rest->swing_N);
	else
		snprintf(how, sizeof(how), "with %.3g Hz, more and more",
			 rest->weakest.hz);
	if (advice.gain < plan->gain)
		snprintf(with, sizeof(with), " already with a gain of %.3g", advice.gain);
	return incise_error_set(
		err, EDOM,
		"%s: not stable: %s oscillates %s%s, on a device of %g kg and "
		"%g N s/mm with %s; %s%s, or describe the device",
		plan->scene->path, run, how, with, s->device.mass_kg,
		s->device.damping_N_s_mm, delay, text,
		plan->texture ? ", leave out its texture" : "");
}
