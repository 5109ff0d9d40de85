// SPDX-License-Identifier: GPL-2.0-only
/*
 * LOAD_PLAN: a plan comes and goes.
 *
 *   make     the file is copied and checked, and the cost of a tick measured: no lock
 *   install  it takes the place of the last one; stepper.mutex, no motor of both with power
 *   sweep    the plan of a former owner goes when its motors have no power
 */
#include <linux/ktime.h>
#include <linux/mm.h>
#include <linux/slab.h>
#include <linux/sort.h>
#include <linux/string.h>
#include <linux/uaccess.h>

#include "../lib/fixed/arithmetic.h"
#include "../lib/fixed/layout.h"
#include "../lib/fixed/vector.h"
#include "stepper_plan.h"

/* Ticks that are measured, down through the surface and into the tissue. */
#define TRIALS 64
#define DEPTH (4 << 16)

/* A quarter of the processor, as for the ticks of motors. */
#define SHARE 4

/* A place of the surface, or near it. */
static void stepper_plan_place(const struct incise_fixed_plan *view, s32 place[3])
{
	const struct incise_fixed_grid_frame *grid = &view->numbers.grid;
	s32 half[2];

	incise_fx_copy(place, view->numbers.shape.point);
	if (view->numbers.shape.kind == INCISE_FIXED_CAPSULE)
		incise_fx_add(place, place, view->numbers.shape.radius, view->numbers.up);
	if (view->numbers.shape.kind != INCISE_FIXED_GRID)
		return;
	half[0] = (grid->columns / 2) << grid->cell_shift;
	half[1] = (grid->rows / 2) << grid->cell_shift;
	incise_fx_add(place, grid->origin, half[0], grid->axis[0]);
	incise_fx_add(place, place, half[1], grid->axis[1]);
	incise_fx_add(
		place, place,
		view->grid.height[grid->rows / 2 * grid->columns + grid->columns / 2],
		grid->axis[2]);
}

static int stepper_plan_compare(const void *a, const void *b)
{
	u32 x = *(const u32 *)a, y = *(const u32 *)b;

	return x < y ? -1 : x > y;
}

/*
 * Cost of nine in ten ticks that get a pose, on this machine; some of the rest were interrupted.
 * The state is used up.
 */
static u32 stepper_plan_measure(struct stepper_plan *plan)
{
	const struct incise_fixed_numbers *numbers = &plan->view.numbers;
	struct incise_fixed_pose pose = {.quaternion = {INCISE_FIXED_UNIT}};
	s32 place[3], tip[3];
	u32 cost[TRIALS];
	int i, k;

	stepper_plan_place(&plan->view, place);
	for (k = 0; k < TRIALS; k++) {
		u64 before = ktime_get_ns();

		incise_fx_add(tip, place, DEPTH / 2 - DEPTH / TRIALS * k, numbers->up);
		for (i = 0; i < 3; i++)
			pose.position[i] =
				incise_fx_hold32((s64)tip[i] - numbers->tip[i]);
		pose.t_ns = NSEC_PER_SEC + (s64)k * numbers->tick_ns;
		pose.tool = numbers->inserts ? INCISE_TOOL_BLADE : INCISE_TOOL_AUTO;
		incise_fixed_plan_pose(&plan->view, &plan->state, &pose, pose.t_ns);
		incise_fixed_plan_tick(&plan->view, &plan->state, pose.t_ns, &plan->tick);
		cost[k] = min_t(u64, ktime_get_ns() - before, U32_MAX);
	}
	sort(cost, TRIALS, sizeof(*cost), stepper_plan_compare, NULL);
	return cost[TRIALS * 9 / 10];
}

static bool stepper_plan_good(const struct stepper *stepper,
			      const struct incise_stepper_plan *load)
{
	u32 all = BIT(stepper->n_motors) - 1;

	return load->motors && !(load->motors & ~all) && !load->flags &&
	       !memchr_inv(load->reserved, 0, sizeof(load->reserved)) &&
	       (load->size || !load->data);
}

static int stepper_plan_open(struct stepper_plan *plan)
{
	const struct incise_fixed_plan_header *head = plan->file;
	int ret;

	ret = incise_fixed_plan_open(&plan->view, plan->file, plan->load.size);
	if (ret)
		return ret;
	if (plan->view.numbers.n_axes != hweight32(plan->load.motors))
		return -EINVAL;
	plan->crc = head->crc;
	incise_fixed_plan_begin(&plan->view, &plan->state);
	plan->cost_ns = stepper_plan_measure(plan);
	if (plan->cost_ns > (u32)plan->view.numbers.tick_ns / SHARE)
		return -ERANGE;
	incise_fixed_plan_begin(&plan->view, &plan->state);
	memcpy(plan->begin, &plan->state, sizeof(plan->begin));
	return 0;
}

/**
 * stepper_plan_make() - copy a user's plan, and check it
 * @stepper:	the controller
 * @load:	argument of LOAD_PLAN; size 0: the plan goes, and @made is NULL
 * @made:	to be handed to stepper_plan_install(), then to stepper_plan_free()
 *
 * Without a lock, because it touches a user's memory. Sleeps.
 *
 * Return: 0; a negative errno as LOAD_PLAN says.
 */
int stepper_plan_make(struct stepper *stepper, const struct incise_stepper_plan *load,
		      struct stepper_plan **made)
{
	struct stepper_plan *plan;
	int ret, i;

	BUILD_BUG_ON(sizeof(struct incise_fixed_state) -
			     offsetofend(struct incise_fixed_state, incision) >=
		     sizeof(u64));
	*made = NULL;
	if (!stepper_plan_good(stepper, load))
		return -EINVAL;
	if (!load->size)
		return 0;
	if (load->size > INCISE_FIXED_PLAN_SIZE_MAX)
		return -EFBIG;
	plan = kvzalloc(sizeof(*plan), GFP_KERNEL_ACCOUNT);
	if (!plan)
		return -ENOMEM;
	raw_spin_lock_init(&plan->lock);
	plan->stepper = stepper;
	plan->load = *load;
	plan->digest = ~0U;
	plan->quiet = true;
	plan->leader = &stepper->motor[__ffs(load->motors)];
	for (i = 0; i < INCISE_FIXED_AXES_MAX; i++)
		plan->aim[i] = STEPPER_PLAN_NO_AIM;
	/* The user's control group pays. A warning in the log is not for users to cause. */
	plan->file = kvmalloc(load->size, GFP_KERNEL_ACCOUNT | __GFP_NOWARN);
	if (!plan->file)
		ret = -ENOMEM;
	else if (copy_from_user(plan->file, u64_to_user_ptr(load->data), load->size))
		ret = -EFAULT;
	else
		ret = stepper_plan_open(plan);
	if (ret) {
		stepper_plan_free(plan);
		return ret;
	}
	*made = plan;
	return 0;
}

/* A plan that is not installed; NULL is fine. */
void stepper_plan_free(struct stepper_plan *plan)
{
	if (!plan)
		return;
	kvfree(plan->file);
	kvfree(plan);
}

static bool stepper_plan_powered(struct stepper *stepper, u32 motors)
{
	bool powered = false;
	unsigned long flags;
	unsigned int i;

	for (i = 0; i < stepper->n_motors && !powered; i++) {
		struct stepper_motor *motor = &stepper->motor[i];

		if (!(motors & BIT(i)))
			continue;
		raw_spin_lock_irqsave(&motor->lock, flags);
		powered = motor->powered;
		raw_spin_unlock_irqrestore(&motor->lock, flags);
	}
	return powered;
}

/* 0; -ERANGE: the config of a motor does not go with the plan. */
static int stepper_plan_fits(struct stepper *stepper, const struct stepper_plan *plan)
{
	const struct incise_fixed_numbers *numbers = &plan->view.numbers;
	struct incise_stepper_config config;
	unsigned int i;

	for (i = 0; i < stepper->n_motors; i++) {
		if (!(plan->load.motors & BIT(i)))
			continue;
		stepper_setup_get_config(&stepper->motor[i], &config);
		if ((s64)config.deadman_ns <= incise_fixed_plan_fade_ns(numbers) ||
		    config.tick_ns > (u32)numbers->tick_ns)
			return -ERANGE;
	}
	return 0;
}

/* Tell its motors; NULL: there is no plan any more. No motor of them has power. */
static void stepper_plan_tell(struct stepper *stepper, u32 motors,
			      struct stepper_plan *plan)
{
	unsigned int i, axis = 0;
	unsigned long flags;

	for (i = 0; i < stepper->n_motors; i++) {
		struct stepper_motor *motor = &stepper->motor[i];

		if (!(motors & BIT(i)))
			continue;
		raw_spin_lock_irqsave(&motor->lock, flags);
		motor->plan = plan;
		motor->axis = axis++;
		motor->following = false;
		raw_spin_unlock_irqrestore(&motor->lock, flags);
	}
}

static void stepper_plan_announce(struct stepper_plan *plan, u32 state)
{
	struct stepper_motor *leader = plan->leader;
	bool empty = state == INCISE_STEPPER_PLAN_EMPTY;
	s64 now = ktime_get_ns();
	unsigned long flags;

	raw_spin_lock_irqsave(&leader->lock, flags);
	plan->status = (struct incise_stepper_plan_status){
		.motors = empty ? 0 : plan->load.motors,
		.plan = empty ? 0 : plan->crc,
		.t_ns = now,
		.age_ns = S64_MAX,
	};
	stepper_plan_publish(plan, state, now);
	raw_spin_unlock_irqrestore(&leader->lock, flags);
}

/* The plan goes, if there is one; its motors have no power. stepper.mutex held. */
void stepper_plan_take_out(struct stepper *stepper)
{
	struct stepper_plan *plan = stepper->plan;

	if (!plan)
		return;
	stepper_plan_tell(stepper, plan->load.motors, NULL);
	stepper->plan = NULL;
	stepper_plan_announce(plan, INCISE_STEPPER_PLAN_EMPTY);
	stepper_plan_free(plan);
}

/**
 * stepper_plan_install() - a plan takes the place of the last one
 * @stepper:	the controller; stepper.mutex held
 * @load:	what LOAD_PLAN said
 * @made:	out of stepper_plan_make(); NULL on return when it was taken
 *
 * Return: 0; a negative errno as LOAD_PLAN says.
 */
int stepper_plan_install(struct stepper *stepper, const struct incise_stepper_plan *load,
			 struct stepper_plan **made)
{
	struct stepper_plan *plan = *made, *last = stepper->plan;
	u32 before = last ? last->load.motors : 0;
	int ret;

	if (!plan && last && load->motors != before)
		return -EINVAL;
	if (stepper_plan_powered(stepper, load->motors | before))
		return -EBUSY;
	if (plan) {
		ret = stepper_plan_fits(stepper, plan);
		if (ret)
			return ret;
	}
	stepper_plan_take_out(stepper);
	if (!plan)
		return 0;
	stepper->plan = plan;
	stepper_plan_tell(stepper, load->motors, plan);
	stepper_plan_announce(plan, INCISE_STEPPER_PLAN_LOADED);
	*made = NULL;
	return 0;
}

/* The plan of an owner who has left goes, when its motors have no power. */
void stepper_plan_sweep(struct stepper *stepper)
{
	struct stepper_plan *plan = stepper->plan;

	if (plan && plan->orphan && !stepper_plan_powered(stepper, plan->load.motors))
		stepper_plan_take_out(stepper);
}

void stepper_plan_new_owner(struct stepper *stepper)
{
	if (stepper->plan)
		stepper->plan->orphan = true;
	stepper_plan_sweep(stepper);
}
