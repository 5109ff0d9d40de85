// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Plans in integers under libFuzzer: a random good plan, changed in any of its bytes, with a checksum
 * that is right again. If it is accepted, poses and ticks follow, of a hand that moves over the
 * surface, and hostile ones. Each tick is compared with the limits of its plan, and the same
 * again has to give the same bits.
 *
 *   seed 8 · changes 1 · as many changes of 8 bytes: where 3 · how 1 · value 4; random ones
 *   where there are no bytes
 *   then, until the bytes end: how 1, and where how & 3 is 0 a pose of any 40 bytes;
 *   after them the hand goes on alone for TICKS ticks in all
 *
 * Counts go to standard error at the end.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../unit/fixed/trial_plan.h"

#define TICKS 200
#define CHANGES_MAX 7

/* Each component of a force or of its change is rounded twice, towards 0 or to the nearest. */
#define ROUNDING 4

static struct {
	unsigned long plans, good, ticks, contacts;
} count;

__attribute__((destructor)) static void report(void)
{
	fprintf(stderr,
		"fixed_plan: %lu plans, %lu accepted, %lu ticks, %lu of them in contact\n",
		count.plans, count.good, count.ticks, count.contacts);
}

static void wrong(const char *what)
{
	fprintf(stderr, "fixed_plan: %s\n", what);
	abort();
}

struct bytes {
	const uint8_t *at;
	size_t n;
};

static bool take(struct bytes *from, void *to, size_t n)
{
	if (from->n < n)
		return false;
	memcpy(to, from->at, n);
	from->at += n;
	from->n -= n;
	return true;
}

/* --- plans ------------------------------------------------------------------------------ */

static int32_t limit(int32_t value)
{
	static const int32_t limits[] = {
		0,
		1,
		-1,
		INT32_MAX,
		INT32_MIN,
		1 << 30,
		-(1 << 30),
		(1 << 30) + 64,
		1 << 28,
		-(1 << 28),
		1 << 29,
		-(1 << 29),
		(1 << 28) + 1,
		1 << 16,
		50000,
		20000000,
		64,
		65,
		3,
		4,
		18,
		19,
		2048,
		2049,
	};

	return limits[(uint32_t)value % (sizeof(limits) / sizeof(*limits))];
}

static void change(uint8_t *bytes, uint32_t *size, struct bytes *from,
		   struct incise_fx_trial *t)
{
	struct {
		uint8_t at[3], how;
		int32_t value;
	} c;
	uint32_t at;
	int32_t number;

	if (!take(from, &c, sizeof(c))) {
		uint64_t any = incise_fx_trial_next(&t->seed);

		memcpy(&c, &any, sizeof(c));
	}
	at = (uint32_t)c.at[0] | (uint32_t)c.at[1] << 8 | (uint32_t)c.at[2] << 16;
	/* Most of them in the numbers. */
	at %= c.how & 16 && *size ? *size
				  : (uint32_t)sizeof(struct incise_fixed_plan_header);
	if (!(c.how & 15)) {
		bytes[at] = (uint8_t)c.value;
		return;
	}
	at &= ~3u;
	memcpy(&number, bytes + at, sizeof(number));
	switch (c.how & 15) {
	case 1:
		*size = (uint32_t)c.value % (*size + 1);
		return;
	case 2:
	case 3:
	case 4:
		number = c.value;
		break;
	case 5:
	case 6:
	case 7:
	case 8:
		number = limit(c.value);
		break;
	case 9:
		number = number > INT32_MIN ? -number : INT32_MAX;
		break;
	case 10:
		number = (int32_t)((uint32_t)number ^ 1u << (c.value & 31));
		break;
	default:
		number = (int32_t)((uint32_t)number +
				   (uint32_t)(c.value >> (c.how & 15) * 2));
	}
	memcpy(bytes + at, &number, sizeof(number));
}

/* --- ticks ------------------------------------------------------------------------------ */

struct run {
	const struct incise_fixed_plan *plan;
	struct incise_fixed_state state;
	struct incise_fixed_tick tick;
	int32_t last[3];
	uint32_t digest;
	int64_t now_ns;
};

static bool is_longer(const int64_t v[3], int64_t most)
{
	unsigned __int128 sum = 0;

	for (int i = 0; i < 3; i++)
		sum += (unsigned __int128)((__int128)v[i] * v[i]);
	return sum > (unsigned __int128)((__int128)most * most);
}

static void check(const struct run *run)
{
	const struct incise_fixed_numbers *numbers = &run->plan->numbers;
	const struct incise_fixed_tick *tick = &run->tick;
	int64_t force[3], step[3];

	for (int i = 0; i < 3; i++) {
		force[i] = tick->command[i];
		step[i] = force[i] - run->last[i];
	}
	if (is_longer(force, numbers->force))
		wrong("the force is beyond its limit");
	if (is_longer(step, (int64_t)numbers->slew + ROUNDING))
		wrong("the force changes faster than its limit");
	for (int i = 0; i < numbers->n_axes; i++) {
		const struct incise_fixed_axis *axis = &numbers->axes[i];
		__int128 most = (__int128)axis->travel * axis->steps_per_mm;

		if (tick->target[i] < 0 ||
		    (__int128)tick->target[i] << 32 > most + ((__int128)1 << 31))
			wrong("a target is beyond its travel");
	}
	if (tick->depth < 0 || tick->phase < INCISE_PHASE_FREE ||
	    tick->phase > INCISE_PHASE_INSERTION || tick->held < INCISE_TOOL_BLADE ||
	    tick->held > INCISE_TOOL_TUBE || tick->age_ns < 0 ||
	    tick->flags >> INCISE_TICK_FLAGS || !incise_fx_is_unit(tick->attitude, 4))
		wrong("a tick says what it cannot");
	if ((tick->phase != INCISE_PHASE_FREE) != !!(tick->flags & INCISE_TICK_CONTACT))
		wrong("a phase without a contact");
	if (tick->phase != INCISE_PHASE_FREE && !incise_fx_is_unit(tick->normal, 3))
		wrong("a normal that is none");
}

static void mix(struct run *run, const void *bytes, size_t n)
{
	const uint8_t *at = bytes;

	/* FNV-1a */
	for (size_t i = 0; i < n; i++)
		run->digest = (run->digest ^ at[i]) * 16777619u;
}

static void step(struct run *run, const struct incise_fixed_pose *pose, int64_t on_ns)
{
	int32_t answer;

	if (on_ns > 0 && run->now_ns > INT64_MAX - on_ns)
		run->now_ns = INT64_MAX;
	else
		run->now_ns += on_ns;
	answer = (int32_t)incise_fixed_plan_pose(run->plan, &run->state, pose,
						 run->now_ns);
	incise_fixed_plan_tick(run->plan, &run->state, run->now_ns, &run->tick);
	check(run);
	incise_fx_copy(run->last, run->tick.command);
	mix(run, &answer, sizeof(answer));
	mix(run, run->tick.command, sizeof(run->tick.command));
	mix(run, run->tick.target, sizeof(run->tick.target));
	mix(run, &run->tick.flags, sizeof(run->tick.flags));
	count.ticks++;
	count.contacts += run->tick.phase != INCISE_PHASE_FREE;
}

/* One that no tracker sends: a number at its end, time that stands still or leaps. */
static void spoil(struct incise_fx_trial *t, struct incise_fixed_pose *pose)
{
	int32_t any = incise_fx_trial_number(&t->seed);

	switch (incise_fx_trial_in(t, 0, 6)) {
	case 0:
		pose->position[any & 1] = limit(any >> 1);
		break;
	case 1:
		pose->quaternion[any & 3] = limit(any >> 2);
		break;
	case 2:
		pose->t_ns -= any;
		break;
	case 3:
		pose->t_ns = any & 1 ? INT64_MAX : INT64_MIN;
		break;
	case 4:
		pose->tool = (uint32_t)any;
		break;
	case 5:
		for (int i = 0; i < 3; i++)
			pose->position[i] =
				incise_fx_trial_number(&t->seed) >> (any & 15);
		break;
	default:
		for (int i = 0; i < 4; i++)
			pose->quaternion[i] = incise_fx_trial_number(&t->seed);
	}
}

static uint32_t play(const struct incise_fixed_plan *plan, uint64_t seed,
		     struct bytes from, int fill)
{
	static struct run run;
	struct incise_fx_trial_hand hand = {.t.seed = seed ^ 0x9e3779b97f4a7c15u};
	struct incise_fx_trial *t = &hand.t;
	struct incise_fixed_pose pose;
	int ticks = 0;
	uint8_t how;

	/* Bits of a former run show what is read before it is set. */
	memset(&run, fill, sizeof(run));
	run.plan = plan;
	run.digest = 2166136261u;
	run.now_ns = hand.t_ns = 1000000000;
	for (int i = 0; i < 3; i++)
		run.last[i] = 0;
	incise_fixed_plan_begin(plan, &run.state);
	while (ticks < TICKS && take(&from, &how, 1)) {
		if (how & 3 || !take(&from, &pose, sizeof(pose)))
			incise_fx_trial_hand(&hand, plan, &pose);
		step(&run, &pose,
		     how & 4 ? plan->numbers.tick_ns : (int64_t)how << (how >> 3));
		ticks++;
	}
	while (ticks < TICKS) {
		int32_t more;

		if (run.now_ns > INT64_MAX / 2)
			break;
		hand.t_ns = hand.t_ns < run.now_ns ? run.now_ns : hand.t_ns;
		incise_fx_trial_hand(&hand, plan, &pose);
		if (incise_fx_trial_one_in(t, 16))
			spoil(t, &pose);
		more = incise_fx_trial_in(t, 1, 8);
		for (; more && ticks < TICKS; more--, ticks++)
			step(&run, &pose,
			     incise_fx_trial_one_in(t, 64)
				     ? (int64_t)incise_fx_trial_in(t, 0, INT32_MAX)
				     : plan->numbers.tick_ns);
	}
	return run.digest;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct bytes from = {data, size};
	struct incise_fixed_plan plan;
	struct incise_fx_trial t = {0};
	uint8_t *bytes, changes;
	uint64_t seed;
	uint32_t n;

	if (!take(&from, &seed, sizeof(seed)) || !take(&from, &changes, 1))
		return 0;
	t.seed = seed + size;
	bytes = calloc(1, INCISE_FX_TRIAL_PLAN_SIZE);
	if (!bytes)
		return 0;
	n = incise_fx_trial_plan(seed, bytes);
	if (incise_fixed_plan_open(&plan, bytes, n))
		wrong("a good plan is refused");
	for (changes %= CHANGES_MAX + 1; changes; changes--)
		change(bytes, &n, &from, &t);
	if (n >= sizeof(struct incise_fixed_plan_header)) {
		((struct incise_fixed_plan_header *)(void *)bytes)->size = n;
		incise_fx_trial_seal(bytes, n);
	}
	/* Just as long, so that reading beyond its end is seen. */
	bytes = realloc(bytes, n ? n : 1);
	count.plans++;
	if (bytes && !incise_fixed_plan_open(&plan, bytes, n)) {
		count.good++;
		if (play(&plan, seed, from, 0x55) != play(&plan, seed, from, 0xaa))
			wrong("the same twice is not the same");
	}
	free(bytes);
	return 0;
}
