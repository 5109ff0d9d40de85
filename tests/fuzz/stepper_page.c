// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The kernel module's page of set-points under libFuzzer, and what comes of it: a config of
 * any bytes; if it is let pass, a page of any bytes, read as the module's timer does, and
 * ticks of the profile, each held against what lib/fixed/profile.h promises.
 *
 *   config  128 bytes, struct incise_stepper_config
 *   then, until the bytes end: how 1 · offset 1 · n 1 · n bytes, written into the slot at
 *   offset; how & 7 ticks follow, 16 times as many where how & 8, each of which looks at
 *   the slot. Writing it in parts is how an owner looks that is in the middle of it.
 */
#include <stdio.h>
#include "../../driver/stepper_page.c"
#include "../unit/fixed/profile_watch.h"

#define STEPS_MAX 4000 /* of one input, so that it is fast */

static void wrong(const char *what)
{
	fprintf(stderr, "stepper_page: %s\n", what);
	abort();
}

/* A machine that holds every config that any machine does. */
static const struct incise_stepper_controller machine = {
	.n_motors = INCISE_STEPPER_MOTORS_MAX,
	.rate_max = INCISE_PROFILE_VELOCITY_MAX,
};

struct run {
	struct incise_stepper_config config;
	struct incise_stepper_setpoint page;
	struct stepper_setpoint setpoint;
	struct incise_profile profile;
	struct incise_profile_slot slot;
	struct watch watch;
	int64_t steps;
};

/* The same rule once more, by what is wrong. */
static bool is_garbage(const struct incise_stepper_setpoint *page)
{
	uint32_t tool = page->pose.tool;
	bool garbage = page->mode > INCISE_STEPPER_MODE_POSE || page->reserved0;

	if (page->mode == INCISE_STEPPER_MODE_POSE)
		return garbage || page->target || page->pose.reserved ||
		       tool & 0xfffffdfc;
	for (int i = 0; i < 5; i++)
		garbage |= !!page->reserved[i];
	return garbage;
}

static void check_answer(const struct run *run, const struct stepper_setpoint *before,
			 enum stepper_page_answer answer)
{
	const struct incise_stepper_setpoint *page = &run->page;
	const struct stepper_setpoint *setpoint = &run->setpoint;
	struct stepper_setpoint expected = *before;
	bool is_new = !(page->seq & 1) && page->seq != before->seq;
	bool garbage = is_garbage(page);

	if (answer != (!is_new	 ? STEPPER_PAGE_NOTHING
		       : garbage ? STEPPER_PAGE_GARBAGE
				 : STEPPER_PAGE_TAKEN))
		wrong("not the right answer");
	if (setpoint->seq != (is_new ? page->seq : before->seq))
		wrong("not the right seq");
	if (answer == STEPPER_PAGE_TAKEN)
		expected = (struct stepper_setpoint){
			.mode = page->mode, .target = page->target, .t_ns = page->t_ns};
	if (setpoint->mode != expected.mode || setpoint->target != expected.target ||
	    setpoint->t_ns != expected.t_ns)
		wrong("not the right setpoint");
}

static void tick(struct run *run)
{
	struct stepper_setpoint before = run->setpoint;
	enum stepper_page_answer answer = stepper_page_take(&run->page, &run->setpoint);
	const char *what;

	check_answer(run, &before, answer);
	if (answer == STEPPER_PAGE_TAKEN) {
		int64_t target = stepper_page_clamp(&run->setpoint, &run->config);
		enum incise_profile_mode mode =
			run->setpoint.mode == INCISE_STEPPER_MODE_VELOCITY
				? INCISE_PROFILE_VELOCITY
				: INCISE_PROFILE_POSITION;

		if (incise_profile_target(&run->profile, mode, target) != target)
			wrong("the module and the profile clamp in other ways");
	} else if (answer == STEPPER_PAGE_GARBAGE) {
		incise_profile_stop(&run->profile);
	}
	incise_profile_tick(&run->profile, &run->slot);
	run->steps += run->slot.n;
	what = watch_tick(&run->watch, &run->profile, &run->slot);
	if (what)
		wrong(what);
}

static bool begin(struct run *run)
{
	const struct incise_stepper_config *c = &run->config;
	struct incise_profile_limits limits = {
		.tick_ns = c->tick_ns,
		.velocity = c->velocity,
		.acceleration = c->acceleration,
		.position_min = (int32_t)c->position_min,
		.position_max = (int32_t)c->position_max,
		.jerk = c->jerk,
	};
	int result;

	if (stepper_page_config(c, &machine))
		return false;
	result = incise_profile_init(&run->profile, &limits, (int32_t)c->safe_position);
	/* All but jerk has been looked at. */
	if (result && (result != -ERANGE || !c->jerk))
		wrong("a config was let pass that the profile refuses");
	if (!result)
		watch_begin(&run->watch, &limits, (int32_t)c->safe_position);
	return !result;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static struct run run;

	memset(&run, 0, sizeof(run));
	if (size < sizeof(run.config))
		return 0;
	memcpy(&run.config, data, sizeof(run.config));
	data += sizeof(run.config);
	size -= sizeof(run.config);
	if (!begin(&run))
		return 0;
	while (size >= 3 && run.steps < STEPS_MAX) {
		size_t at = data[1] % sizeof(run.page), n = data[2];
		int ticks = data[0] & 8 ? (data[0] & 7) * 16 : data[0] & 7;

		data += 3;
		size -= 3;
		n = n < sizeof(run.page) - at ? n : sizeof(run.page) - at;
		n = n < size ? n : size;
		memcpy((char *)&run.page + at, data, n);
		data += n;
		size -= n;
		for (; ticks && run.steps < STEPS_MAX; ticks--)
			tick(&run);
	}
	return 0;
}
