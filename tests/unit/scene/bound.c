// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The certificate of a plan in integers, as a property: of random scenes and a hand without jumps, no force
 * in integers is farther from that in double, of the same poses, than incise_plan_bound() says.
 *
 *     seed ─▶ a scene ─▶ in double   ─┐ |difference| ≤ bound, where both decide alike: see ../../apart.h
 *                     └▶ in integers ─┘
 *
 * SEED=N begins with the scene of a seed that failed.
 */
#include "../unit.h"
#include "../cases.h"
#include "../../apart.h"
#include "../../../lib/base/ascending.h"
#include "../../../lib/model/slope.h"
#include "drawn.h"

#define SCENES 500
#define SCENES_FEW 20
#define TICKS 20000
#define TICKS_FEW 2000
#define PRINTED 5

/* As far as the hand goes from where a contact began, at most. */
#define REACH_MM 40

/* What all scenes met. */
struct met {
	int scenes, textured, with_force, unbounded, broken;
	long ticks, apart, apart_beyond,
		unpaid;	      /* apart by a decision; of these beyond the bound */
	double ratio[SCENES]; /* bound ÷ largest difference */
};

/* Of each model the steepest slopes, which an unchecked plan has not searched for. */
static double steepest[KINDS][INCISE_MODEL_INPUT_KINDS];

static void find_steepest(int kind)
{
	struct incise_slope slope[INCISE_LOOP_INPUTS_MAX];
	struct incise_model *model;
	char path[80];

	model_path(path, kind, "fis");
	model = incise_model_load(path, &err);
	succeeds(model);
	assert_int_equal(incise_model_slopes(model, slope), 0);
	for (int i = 0; i < kinds[kind].n; i++)
		steepest[kind][kinds[kind].inputs[i]] =
			fmax(fabs(slope[i].lowest), fabs(slope[i].highest));
	incise_model_free(model);
}

/* The scene in integers, in double. Returns the kind of its model, -1: it has none. */
static int in_double(const char *text, char to[TEXT_MOST])
{
	const char *model = strstr(text, ".fx\""), *kind = strstr(text, "\"fixed\"");
	const char *rest = kind + strlen("\"fixed\"");

	if (model)
		snprintf(to, TEXT_MOST, "%.*s.fis\"%.*s\"double\"%s", (int)(model - text),
			 text, (int)(kind - model - 4), model + 4, rest);
	else
		snprintf(to, TEXT_MOST, "%.*s\"double\"%s", (int)(kind - text), text,
			 rest);
	return model ? model[-1] - '0' : -1;
}

/* Two plans of a scene, and what differs. */
struct pair {
	struct incise_scene *scene[2];
	struct incise_plan *plan[2];
	double bound_N, most_N;
	struct apart apart;
};

static void walk(struct pair *p, uint64_t seed, const struct drawn *d, struct met *met)
{
	struct hand hand = hand_of(seed, d, p->scene[1], p->plan);
	int ticks = cases_are_all() ? TICKS : TICKS_FEW;
	struct incise_tick tick[2];
	double off_N;

	hand.calm = true;
	for (int i = 0; i < ticks; i++) {
		step(&hand);
		for (int k = 0; k < 2; k++)
			assert_int_equal(
				incise_plan_tick(p->plan[k], hand.t_ns, &tick[k]), 0);
		met->ticks++;
		met->unpaid += !!((tick[0].flags | tick[1].flags) & INCISE_TICK_UNPAID);
		off_N = apart_N(&p->apart, &tick[0], &tick[1], p->bound_N);
		if (p->apart.is) {
			met->apart++;
			met->apart_beyond += off_N > p->bound_N;
			continue;
		}
		p->most_N = fmax(p->most_N, off_N);
		if (off_N <= p->bound_N)
			continue;
		if (met->broken++ < PRINTED)
			printf("seed %" PRIu64
			       ", tick %d, phase %d, tool %d: off by more "
			       "than %g N\n%s\n",
			       seed, i, tick[0].phase, tick[0].tool, p->bound_N,
			       d->text[1].all);
		return;
	}
}

static void compare(uint64_t seed, const struct drawn *d, struct met *met)
{
	struct pair p = {.bound_N = 0};
	char text[TEXT_MOST];
	int kind = in_double(d->text[1].all, text);
	bool textured = false;

	for (int k = 0; k < 2; k++) {
		p.scene[k] = fed_scene(&folder, k ? d->text[1].all : text, &err);
		succeeds(p.scene[k]);
		p.scene[k]->unchecked = true;
		textured = seed % 2 && add_texture(seed, p.scene[k]);
		p.plan[k] = incise_plan_new_fed(p.scene[k], &d->tracker, &err);
		succeeds(p.plan[k]);
	}
	for (int i = 0; kind >= 0 && i < INCISE_MODEL_INPUT_KINDS; i++)
		p.plan[1]->input_slope[i] = p.plan[1]->gain * steepest[kind][i];
	p.apart.plan = p.plan;
	p.bound_N = incise_plan_bound(p.plan[1], REACH_MM);
	met->scenes++;
	met->textured += textured;
	met->unbounded += !(p.bound_N < INFINITY);
	walk(&p, seed, d, met);
	if (p.most_N > 0)
		met->ratio[met->with_force++] = p.bound_N / p.most_N;
	for (int k = 0; k < 2; k++) {
		incise_plan_free(p.plan[k]);
		incise_scene_free(p.scene[k]);
	}
}

TEST(test_no_force_is_off_by_more_than_certified)
{
	int scenes = cases_are_all() ? SCENES : SCENES_FEW;
	uint64_t first = cases_seed(1);
	static struct met met;
	static struct drawn d;
	double middle;

	for (int kind = 0; kind < KINDS; kind++)
		find_steepest(kind);
	for (int i = 0; i < scenes; i++) {
		draw(first + (uint64_t)i, &d);
		compare(first + (uint64_t)i, &d, &met);
	}
	middle = met.with_force ? median(met.ratio, met.with_force) : 0;
	printf("%d scenes, %d textured, %d with a force, %ld ticks, %ld of them apart by a decision "
	       "(%ld beyond the bound), %ld unpaid; "
	       "bound ÷ largest difference: %.2f, median %.3g\n",
	       met.scenes, met.textured, met.with_force, met.ticks, met.apart,
	       met.apart_beyond, met.unpaid, met.ratio[0], middle);
	assert_true(met.with_force > scenes / 3 && met.apart < met.ticks / 100);
	assert_int_equal(met.broken, 0);
	assert_int_equal(met.unbounded, 0);
}

GROUP(drawn_set_up, drawn_tear_down);
