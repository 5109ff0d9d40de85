// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A hostile owner of a plan: files that are wrong in some fields with a right CRC, and for each that
 * is taken, poses of any numbers in all slots, dirt in the page, and commands in between. A plan may
 * render nonsense; no motor leaves its limits for it, and the module works on.
 *
 *   stepper_plan_fuzz ROUNDS SEED MODEL
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "../../../lib/fixed/layout.h"
#include "../draw.h"
#include "../plan.h"
#include "../tap.h"

#define MOTORS 3
#define ALL 7U
#define PAGE 4096
#define DEADMAN_NS 3000000000

static struct bench bench;
static struct {
	unsigned int taken, refused, strange, faults, ran;
	uint64_t ticks, poses;
} sum;

/* Numbers that are not like others. */
static int32_t odd(int32_t was)
{
	static const int32_t numbers[] = {
		0,	 1,	     -1,      INT32_MAX, INT32_MIN,
		1 << 30, -(1 << 30), 1 << 28, 65536,	 INT32_MIN + 1};

	switch (draw_between(0, 4)) {
	case 0:
		return numbers[draw_between(0, 9)];
	case 1:
		return (int32_t)draw();
	case 2:
		return (int32_t)((uint32_t)was ^ 1U << draw_between(0, 31));
	case 3:
		return (int32_t)((int64_t)was * draw_between(-16, 16));
	default:
		return (int32_t)draw_scattered(1, INT32_MAX);
	}
}

/* Words anywhere, mostly in the numbers; the CRC is right but for once in twenty. */
static void spoil(struct incise_fixed_plan_header *head, uint32_t size)
{
	int32_t *words = (int32_t *)(void *)head;
	int64_t numbers = offsetof(struct incise_fixed_plan_header, numbers) / 4;

	for (int64_t n = draw_between(0, 4); n > 0; n--) {
		int64_t at = draw_between(numbers, sizeof(*head) / 4 - 1);

		if (!draw_between(0, 9))
			at = draw_between(0, size / 4 - 1);
		words[at] = odd(words[at]);
	}
	if (draw_between(0, 19))
		head->crc = incise_fx_crc((uint8_t *)head + INCISE_FIXED_PLAN_CRC_FROM,
					  size - INCISE_FIXED_PLAN_CRC_FROM);
}

static struct incise_fixed_pose wild_pose(struct plan_hand *hand)
{
	struct incise_fixed_pose pose = plan_hand_at(hand, bench_now_ns());

	pose.tool = (uint32_t)draw_between(INCISE_TOOL_AUTO, INCISE_TOOL_TUBE);
	if (draw_between(0, 3))
		return pose;
	for (int i = 0; i < 3; i++)
		pose.position[i] = odd(pose.position[i]);
	for (int i = 0; i < 4; i++)
		pose.quaternion[i] = odd(pose.quaternion[i]);
	if (!draw_between(0, 3))
		pose.t_ns = (int64_t)draw();
	/* The end of most runs. */
	if (!draw_between(0, 40))
		pose.tool = (uint32_t)draw();
	return pose;
}

static void disturb(const void *file, uint32_t size, uint32_t motors)
{
	volatile uint8_t *byte = (volatile uint8_t *)bench.setpoint;

	switch (draw_between(0, 30)) {
	case 0:
		byte[draw_between(0, PAGE - 1)] = (uint8_t)draw();
		break;
	case 1:
		bench_want(&bench, (unsigned int)draw_between(0, MOTORS - 1),
			   (unsigned int)draw_between(0, 1), (int64_t)draw());
		break;
	case 2:
		bench_command(&bench, INCISE_STEPPER_DISABLE, 1U << draw_between(0, 2));
		break;
	case 3:
		bench_command(&bench, INCISE_STEPPER_CLEAR, ALL);
		bench_command(&bench, INCISE_STEPPER_ENABLE, motors);
		break;
	case 4:
		plan_load(&bench, file, size, motors);
		break;
	case 5:
		plan_unload(&bench, motors);
		break;
	default:
		break;
	}
}

static void run(const void *file, uint32_t size, uint32_t motors)
{
	struct plan_hand hand = {.draw = draw() | 1, .start_ns = bench_now_ns()};
	struct incise_stepper_plan_status now;

	if (bench_command(&bench, INCISE_STEPPER_ENABLE, motors))
		return;
	sum.ran++;
	for (int k = 0; k < 80; k++) {
		for (unsigned int m = 0; m < MOTORS; m++) {
			struct incise_fixed_pose pose = wild_pose(&hand);

			if (!m || k < 2 || !draw_between(0, 20))
				plan_pose(&bench, m, &pose);
		}
		if (!draw_between(0, 3)) {
			struct incise_fixed_pose pose = wild_pose(&hand);

			plan_pose(&bench, INCISE_STEPPER_SLOT_TUBE, &pose);
		}
		if (k > 10)
			disturb(file, size, motors);
		if (bench_look(&bench, 0).faults && !draw_between(0, 3)) {
			sum.ticks += plan_look(&bench).ticks;
			bench_command(&bench, INCISE_STEPPER_CLEAR, ALL);
			bench_command(&bench, INCISE_STEPPER_ENABLE, motors);
		}
		bench_nap((int64_t)draw_scattered(20000, 9000000));
	}
	now = plan_look(&bench);
	sum.ticks += now.ticks;
	sum.poses += now.poses;
	for (unsigned int m = 0; m < MOTORS; m++)
		sum.faults += bench_look(&bench, m).faults != 0;
}

/* Another owner comes, sometimes in the middle of it. */
static bool owners_change(void)
{
	if (draw_between(0, 3))
		return true;
	bench_close(&bench);
	return !bench_open(&bench);
}

static bool one(const char *model)
{
	const struct plan_recipe recipe = {
		.name = "hostile",
		.surface = (enum incise_fixed_shape_kind)draw_between(0, 2),
		.axes = (int)draw_between(1, MOTORS),
		.tick_ns = 1000000,
		.inserts = true,
		.tube = draw_between(0, 1),
		.membrane = draw_between(0, 1),
		.model = draw_between(0, 1) ? model : NULL,
	};
	const uint32_t motors = (1U << recipe.axes) - 1;
	uint32_t size = 0;
	void *file = plan_make(&recipe, &size);
	int ret = 0;

	if (!file)
		return false;
	for (unsigned int m = 0; m < MOTORS && !ret; m++) {
		struct incise_stepper_config config =
			plan_config(&bench, m, 1000000, DEADMAN_NS);

		ret = bench_configure(&bench, &config, 750);
	}
	spoil(file, size);
	ret = ret ? ret : plan_load(&bench, file, size, motors);
	sum.taken += !ret;
	sum.refused += ret != 0;
	sum.strange += ret && ret != -EINVAL && ret != -ERANGE && ret != -EOPNOTSUPP;
	if (!ret)
		run(file, size, motors);
	free(file);
	if (!owners_change() || !bench_rest(&bench, MOTORS))
		return false;
	bench_judge(&bench);
	memset((void *)bench.setpoint, 0, PAGE);
	for (unsigned int i = 0; i < MOTORS; i++)
		plan_unload(&bench, (2U << i) - 1);
	return plan_look(&bench).state == INCISE_STEPPER_PLAN_EMPTY;
}

int main(int argc, char **argv)
{
	int rounds = argc > 1 ? atoi(argv[1]) : 10, done = 0;
	int ret;

	draw_seed(argc > 2 ? strtoull(argv[2], NULL, 0) : 1);
	ret = bench_bind(&bench, MOTORS);
	ret = ret ? ret : bench_open(&bench);
	if (!check(!ret, "three motors are bound (%s)", strerror(-ret)))
		return 1;
	while (done < rounds && one(argc > 3 ? argv[3] : NULL))
		done++;
	note("%u plans taken, %u refused; %u ran, %llu ticks, %llu poses, %u faults",
	     sum.taken, sum.refused, sum.ran, (unsigned long long)sum.ticks,
	     (unsigned long long)sum.poses, sum.faults);
	check(done == rounds, "after any of them motors come to rest, and the plan goes");
	check(sum.taken && sum.refused && sum.ticks && sum.poses && sum.faults,
	      "some of each sort");
	check(!sum.strange, "refused with one of the errors that the ABI names");
	check(!bench_faulty(&bench), "no edge breaks a promise, no position its limits");
	bench_close(&bench);
	check(!bench_unbind(&bench), "the motors are unbound");
	return tap_failures != 0;
}
