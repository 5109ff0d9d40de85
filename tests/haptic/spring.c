// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * haptic = "spring:[no|dies=N|flag=N|leans=FILE]": a module for tests. A handle on a spring of 1 N/mm, which
 * is where the force puts it. "no" cannot be opened; "dies" fails after N reads; "flag" is not ready from
 * read N on; "leans" is 40 mm lower while there is that file.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/backend.h>

struct spring {
	struct incise_haptic base;
	struct incise_clock *clock;
	double force_N[3];
	uint64_t reads;
	uint64_t dies, flag; /* 0: never */
	char leans[100];
};

static int read_spring(struct incise_haptic *haptic, struct incise_haptic_sample *samples,
		       int n)
{
	struct spring *spring = (struct spring *)haptic;

	(void)n;
	if (spring->dies && spring->reads == spring->dies)
		return -ENODEV;
	samples[0] = (struct incise_haptic_sample){
		.t_ns = incise_clock_now(spring->clock),
		.seq = spring->reads++,
		.quaternion = {1},
		.buttons = 2,
	};
	if (spring->flag && spring->reads > spring->flag)
		samples[0].flags = INCISE_HAPTIC_NOT_READY;
	memcpy(samples[0].position_mm, spring->force_N, sizeof(spring->force_N));
	if (*spring->leans && !access(spring->leans, F_OK))
		samples[0].position_mm[2] -= 40;
	return 1;
}

static int push_spring(struct incise_haptic *haptic, const double force_N[3],
		       const double torque_N_mm[3])
{
	(void)torque_N_mm;
	memcpy(((struct spring *)haptic)->force_N, force_N, 3 * sizeof(*force_N));
	return 0;
}

static void get_info(const struct incise_haptic *haptic, struct incise_haptic_info *info)
{
	(void)haptic;
	*info = (struct incise_haptic_info){
		.name = "test spring",
		.low_mm = {-50, -50, -50},
		.high_mm = {50, 50, 50},
		.peak_N = 3,
		.continuous_N = 2,
		.mass_kg = 0.1,
		.damping_N_s_mm = 0.001,
		.rate_hz = 1000,
		.latency_ns = 1000000,
		.buttons = 2,
	};
}

static uint64_t count_lost(const struct incise_haptic *haptic)
{
	(void)haptic;
	return 7;
}

static int tell_cause(struct incise_haptic *haptic, char *text, size_t size)
{
	const struct spring *spring = (struct spring *)haptic;

	return snprintf(text, size, "%s",
			spring->dies && spring->reads == spring->dies
				? "the spring broke; wind another"
			: spring->flag && spring->reads > spring->flag
				? "the spring is cold; warm it"
				: "");
}

static void close_spring(struct incise_haptic *haptic)
{
	free(haptic);
}

static const struct incise_haptic_ops ops = {
	.read = read_spring,
	.push = push_spring,
	.info = get_info,
	.lost = count_lost,
	.close = close_spring,
	.cause = tell_cause,
};

static void *open_spring(const struct incise_backend_request *request,
			 struct incise_error *err)
{
	struct spring *spring;

	if (!strcmp(request->arguments, "no")) {
		incise_error_set(err, ENODEV, "%s: no spring is attached; attach one",
				 request->where);
		return NULL;
	}
	spring = calloc(1, sizeof(*spring));
	if (!spring)
		return NULL;
	spring->base.ops = &ops;
	spring->clock = request->clock;
	sscanf(request->arguments, "dies=%lu", &spring->dies);
	sscanf(request->arguments, "flag=%lu", &spring->flag);
	sscanf(request->arguments, "leans=%99s", spring->leans);
	return spring;
}

INCISE_API const struct incise_backend incise_backend = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "haptic",
	.name = "spring",
	.open = open_spring,
};
