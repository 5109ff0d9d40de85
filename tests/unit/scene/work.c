// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * No closed motion returns more work than it takes, as a property of random scenes in both kinds of numbers,
 * stable ones or not: of each contact, from when a tool meets the skin until it has left, with its membrane,
 * cuts, turns and borders.
 *
 *     seed ─▶ a scene, a hand ─▶ forces ─▶ work put in, work that came back     of each contact
 *
 * SEED=N begins with the scene of a seed that failed. Without the account of stage `work` some do.
 */
#include "../unit.h"
#include "../cases.h"
#include "drawn.h"

#define SCENES 2000
#define SCENES_FEW 60
#define TICKS 3000
#define PRINTED 5

/* Of the work put in, and of a force in integers along the way. */
#define SHARE 1e-6
#define ROUNDING_N 1e-4

/* An account knows the work up to the last tick, and not what this one's force will do. */
#define TICKS_OPEN 2

/* A leap is no motion. */
#define LEAP_MM 5

/* A contact. The work between two ticks is that of the mean of their forces. */
struct contact {
	struct incise_tick last;
	double put_mJ, back_mJ, path_mm;
	double left_mJ; /* the most that a force could give on the way to the next tick */
	bool is;	/* it began, and was one motion so far */
};

/* What all scenes met. */
struct met {
	int contacts, returned, unpaid;
	double most_mJ;
};

static bool over(const struct contact *c)
{
	return c->back_mJ > c->put_mJ * (1 + SHARE) + ROUNDING_N * c->path_mm +
				    TICKS_OPEN * c->left_mJ;
}

/* Returns whether a contact ended. */
static bool follow(struct contact *c, const struct incise_tick *tick, bool accounts)
{
	bool in = tick->phase != INCISE_PHASE_FREE,
	     was = c->last.phase != INCISE_PHASE_FREE;
	double way[3], sum[3], put_mJ, way_mm;

	v3_sub(way, tick->tool_mm, c->last.tool_mm);
	v3_add(sum, tick->command_N, 1, c->last.command_N);
	put_mJ = -v3_dot(sum, way) / 2;
	way_mm = v3_length(way);
	/* Another tool begins anew; the last one's force has faded. */
	if ((in && !was) || tick->tool != c->last.tool)
		*c = (struct contact){.last = c->last, .is = true};
	c->is = c->is && way_mm < LEAP_MM &&
		(accounts || !(tick->flags & INCISE_TICK_STARTING));
	*(put_mJ > 0 ? &c->put_mJ : &c->back_mJ) += fabs(put_mJ);
	c->path_mm += way_mm;
	c->left_mJ = fmax(c->left_mJ, v3_length(c->last.command_N) * way_mm);
	c->last = *tick;
	return was && !in && c->is;
}

/* A scene, which is freed. */
static void walk(uint64_t seed, const struct drawn *d, struct incise_scene *scene,
		 bool account, struct met *met)
{
	struct incise_plan *plan[2];
	struct contact contact = {.is = false};
	struct incise_tick tick;
	struct hand hand;

	succeeds(scene);
	scene->unchecked = true;
	if (!scene->texture && seed % 4)
		add_texture(seed, scene);
	/* Limits are another stage's. */
	scene->limits.force_N = scene->limits.start_N = 1000;
	scene->limits.slew_N_s = 1e6;
	scene->limits.ramp_ms = 1;
	plan[0] = plan[1] = incise_plan_new_fed(scene, &d->tracker, &err);
	succeeds(plan[0]);
	if (!account)
		plan[0]->doubles.plan.numbers.account = 0;
	hand = hand_of(seed, d, scene, plan);
	hand.calm = true;
	for (int i = 0; i < TICKS; i++) {
		step(&hand);
		assert_int_equal(incise_plan_tick(plan[0], hand.t_ns, &tick), 0);
		met->unpaid += !!(tick.flags & INCISE_TICK_UNPAID);
		if (!follow(&contact, &tick, plan[0]->accounts))
			continue;
		met->contacts++;
		met->most_mJ = fmax(met->most_mJ, contact.put_mJ);
		if (over(&contact) && met->returned++ < PRINTED &&
		    (account || !plan[0]->accounts))
			printf("seed %" PRIu64
			       ", tick %d, tool %d: of %g mJ %g come back\n%s\n",
			       seed, i, tick.tool, contact.put_mJ, contact.back_mJ,
			       d->text[scene->fixed].all);
	}
	incise_plan_free(plan[0]);
	incise_scene_free(scene);
}

static struct incise_scene *scene_of(const struct drawn *d, int k)
{
	return fed_scene(&folder, d->text[k].all, &err);
}

TEST(test_no_closed_motion_returns_more_than_it_takes)
{
	int scenes = cases_are_all() ? SCENES : SCENES_FEW;
	uint64_t first = cases_seed(1);
	struct met met[2] = {0}, without = {0};
	static struct drawn d;

	for (int i = 0; i < scenes; i++) {
		draw(first + (uint64_t)i, &d);
		for (int k = 0; k < 2; k++)
			walk(first + (uint64_t)i, &d, scene_of(&d, k), true, &met[k]);
		walk(first + (uint64_t)i, &d, scene_of(&d, 0), false, &without);
	}
	for (int k = 0; k < 2; k++)
		printf("%s: %d contacts of up to %.3g mJ, %d return more; %d ticks unpaid\n",
		       k ? "integers" : "double", met[k].contacts, met[k].most_mJ,
		       met[k].returned, met[k].unpaid);
	printf("without an account: %d return more\n", without.returned);
	for (int k = 0; k < 2; k++) {
		assert_int_equal(met[k].returned, 0);
		assert_true(met[k].contacts > scenes / 4);
	}
	assert_int_equal(without.unpaid, 0);
	assert_true(without.returned > 0);
}

#define CUTS 10000
#define CUTS_FEW 200

/* A model of depth, or of depth and speed, with nothing beside it that needs an account; NULL: the scene has none. */
static struct incise_scene *cut_of(const struct drawn *d, uint64_t seed)
{
	const char *rest = strstr(d->text[seed % 2].all, "arithmetic");
	struct incise_scene *scene;
	struct text text = {.n = 0};

	if (d->is_mesh || rest == d->text[seed % 2].all)
		return NULL;
	add(&text, "model = \"k%d.%s\";\n%s", (int)(seed / 2 % 2),
	    seed % 2 ? "fx" : "fis", rest);
	scene = fed_scene(&folder, text.all, &err);
	succeeds(scene);
	scene->tissue.dissipates = true;
	scene->membrane.thickness_mm = 0;
	scene->effects.average_ticks = 1;
	scene->tissue.force[INCISE_FORCE_INSERTION][0] = 0;
	scene->tissue.force[INCISE_FORCE_SPREAD][0] = 0;
	scene->tissue.force[INCISE_FORCE_DAMPING][0] = 0;
	assert_true(add_texture(seed, scene));
	return scene;
}

/* By the front alone; first a stiff one that was drawn back sideways and gave work. */
TEST(test_no_cut_with_texture_returns_more_than_it_takes)
{
	int cuts = cases_are_all() ? CUTS : CUTS_FEW;
	uint64_t seed = 30175, next = cases_seed(1);
	struct met met = {0};
	static struct drawn d;

	for (; met.contacts < cuts; seed = next++) {
		struct incise_scene *scene;

		draw(seed, &d);
		scene = cut_of(&d, seed);
		if (scene)
			walk(seed, &d, scene, false, &met);
	}
	printf("%d contacts of up to %.3g mJ, %d return more\n", met.contacts,
	       met.most_mJ, met.returned);
	assert_int_equal(met.returned, 0);
}

/* Springs on convex skin, and a tool that stays: one of a potential, as the account sees it. */
static struct incise_scene *springs_of(const struct drawn *d, int k)
{
	struct incise_scene *scene;

	if (d->is_mesh || strstr(d->text[k].all, "model ="))
		return NULL;
	scene = fed_scene(&folder, d->text[k].all, &err);
	succeeds(scene);
	scene->unchecked = true;
	scene->membrane.thickness_mm = 0;
	scene->effects.average_ticks = 1;
	scene->tissue.printed_orientation = false;
	scene->tissue.force[INCISE_FORCE_INSERTION][1] = 1;
	/* Not less where the blade was before. */
	scene->tissue.force[INCISE_FORCE_REACTION][INCISE_REACTION_FRICTION] = 1;
	/* By the filter's velocity, which is late. */
	scene->tissue.force[INCISE_FORCE_DAMPING][0] = 0;
	scene->limits.start_N = scene->limits.force_N = 1000;
	scene->limits.slew_N_s = 1e6;
	scene->limits.ramp_ms = 1;
	return scene;
}

/* Roundings of a work in integers add up to no more than this along the way. */
#define WORK_N 0x1p-16

/* Of skin: of a tick's work by the mean of two forces a share of K L³ / 12 R is left out, as of a chord. */
#define RADIUS_LEAST_MM 15

/* Forces of both kinds are nearer to each other, of these scenes. */
#define FORCE_N 0.01

/*
 * The same in double without an account, and in double or integers with one. Returns the ticks in the tissue.
 */
static int pay(uint64_t seed, const struct drawn *d, struct incise_scene *scene,
	       struct incise_scene *other)
{
	struct incise_plan *plan[2];
	struct incise_tick tick[2];
	double rounded_mJ = 0, at_mm[3] = {0}, off[3], most_N, way_mm, K;
	struct hand hand;
	int in = 0;

	plan[0] = incise_plan_new_fed(scene, &d->tracker, &err);
	succeeds(plan[0]);
	plan[1] = incise_plan_new_fed(other, &d->tracker, &err);
	succeeds(plan[1]);
	plan[0]->doubles.plan.numbers.account = 0;
	K = plan[1]->account_N_mm;
	for (int k = 0; k < 2; k++)
		incise_plan_set_tool(plan[k], (enum incise_tool)(1 + seed % 3));
	hand = hand_of(seed, d, scene, plan);
	hand.calm = hand.quiet = true;
	for (int i = 0; i < TICKS; i++) {
		step(&hand);
		for (int k = 0; k < 2; k++)
			assert_int_equal(incise_plan_tick(plan[k], hand.t_ns, &tick[k]),
					 0);
		v3_sub(off, tick[0].tool_mm, at_mm);
		v3_copy(at_mm, tick[0].tool_mm);
		way_mm = v3_length(off);
		rounded_mJ +=
			WORK_N * way_mm + K * pow(way_mm, 3) / (12 * RADIUS_LEAST_MM);
		if (tick[0].phase == INCISE_PHASE_FREE)
			rounded_mJ = 0;
		v3_sub(off, tick[1].command_N, tick[0].command_N);
		most_N = FORCE_N + sqrt(2 * K * rounded_mJ);
		in += tick[0].phase != INCISE_PHASE_FREE;
		if (tick[1].flags & INCISE_TICK_UNPAID && !(v3_length(off) <= most_N))
			fail_msg("seed %" PRIu64 ", tick %d: unpaid, %g N of %g\n%s",
				 seed, i, v3_length(off), most_N, d->text[0].all);
	}
	for (int k = 0; k < 2; k++)
		incise_plan_free(plan[k]);
	return in;
}

TEST(test_the_account_leaves_a_potential_as_it_is)
{
	int scenes = cases_are_all() ? SCENES : SCENES_FEW, in = 0;
	uint64_t first = cases_seed(1);
	static struct drawn d;

	for (int i = 0; i < scenes; i++) {
		struct incise_scene *scene[2];
		uint64_t seed = first + (uint64_t)i;

		draw(seed, &d);
		for (int k = 0; k < 2; k++)
			scene[k] = springs_of(&d, k);
		for (int k = 0; k < 2 && scene[0]; k++)
			in += pay(seed, &d, scene[0], scene[k]);
		for (int k = 0; k < 2; k++)
			incise_scene_free(scene[k]);
	}
	printf("%d ticks are paid\n", in);
	assert_true(in > 200 * scenes);
}

GROUP(drawn_set_up, drawn_tear_down);
