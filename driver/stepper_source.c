// SPDX-License-Identifier: GPL-2.0-only
/*
 * Poses that come from within the kernel; incise_source.h has the contract. One module at a time
 * has sources, and it stays while one of them is open.
 */
#include <linux/bits.h>
#include <linux/device.h>
#include <linux/err.h>
#include <linux/module.h>

#include "../lib/fixed/arithmetic.h"
#include "../lib/fixed/vector.h"
#include "stepper_plan.h"

/* Limits of raw numbers, and of mm for one of them, 2^-32: their product stays below 2^63. */
#define RAW_MAX ((s64)BIT(30))
#define SCALE_MAX ((s64)BIT_ULL(32))

static DEFINE_MUTEX(stepper_source_mutex);
static const struct incise_stepper_source_ops *stepper_source_ops;

int incise_stepper_source_register(const struct incise_stepper_source_ops *ops)
{
	int ret = -EBUSY;

	mutex_lock(&stepper_source_mutex);
	if (!stepper_source_ops) {
		stepper_source_ops = ops;
		ret = 0;
	}
	mutex_unlock(&stepper_source_mutex);
	return ret;
}
EXPORT_SYMBOL_GPL(incise_stepper_source_register);

void incise_stepper_source_unregister(const struct incise_stepper_source_ops *ops)
{
	mutex_lock(&stepper_source_mutex);
	if (stepper_source_ops == ops)
		stepper_source_ops = NULL;
	mutex_unlock(&stepper_source_mutex);
}
EXPORT_SYMBOL_GPL(incise_stepper_source_unregister);

void incise_stepper_source_push(struct incise_stepper_sink *sink, s64 raw, s64 t_ns)
{
	struct stepper_plan *plan = (struct stepper_plan *)sink;
	unsigned long flags;

	raw_spin_lock_irqsave(&plan->lock, flags);
	plan->sample.raw = raw;
	plan->sample.t_ns = t_ns;
	plan->sample.sequence++;
	raw_spin_unlock_irqrestore(&plan->lock, flags);
}
EXPORT_SYMBOL_GPL(incise_stepper_source_push);

/* stepper.mutex held. 0; -EOPNOTSUPP: the controller has no source. */
int stepper_source_open(struct stepper_plan *plan)
{
	const struct incise_stepper_source_ops *ops;
	void *source;

	mutex_lock(&stepper_source_mutex);
	ops = stepper_source_ops;
	if (ops && !try_module_get(ops->owner))
		ops = NULL;
	mutex_unlock(&stepper_source_mutex);
	if (!ops)
		return -EOPNOTSUPP;
	source = ops->open(plan->stepper->parent, (struct incise_stepper_sink *)plan);
	if (IS_ERR(source)) {
		dev_dbg(&plan->stepper->dev, "no source: %ld\n", PTR_ERR(source));
		module_put(ops->owner);
		return PTR_ERR(source) == -ENOMEM ? -ENOMEM : -EOPNOTSUPP;
	}
	plan->source_ops = ops;
	plan->source = source;
	return 0;
}

/* stepper.mutex held. A plan without a source is left as it is. */
void stepper_source_close(struct stepper_plan *plan)
{
	const struct incise_stepper_source_ops *ops = plan->source_ops;

	if (!ops)
		return;
	ops->close(plan->source);
	module_put(ops->owner);
	plan->source_ops = NULL;
}

/* Whether the fields of a load describe a source, or are zero without one. */
bool stepper_source_good(const struct incise_stepper_plan *load)
{
	s32 attitude[4];
	int i;

	if (!(load->flags & INCISE_STEPPER_PLAN_SOURCE))
		return !memchr_inv(load->origin, 0,
				   offsetof(struct incise_stepper_plan, reserved0) -
					   offsetof(struct incise_stepper_plan, origin));
	for (i = 0; i < 3; i++)
		if (load->origin[i] > INCISE_FX_AWAY_MAX ||
		    load->origin[i] < -INCISE_FX_AWAY_MAX)
			return false;
	return incise_fx_is_unit(load->direction, 3) && load->scale >= -SCALE_MAX &&
	       load->scale <= SCALE_MAX &&
	       incise_fixed_attitude(attitude, load->quaternion) &&
	       load->tool <= INCISE_TOOL_TUBE;
}

/* A pose of the newest sample, unless it was taken. leader->lock held. */
bool stepper_source_take(struct stepper_plan *plan, struct incise_fixed_pose *pose)
{
	const struct incise_stepper_plan *load = &plan->load;
	s64 raw, length;
	u32 sequence;

	raw_spin_lock(&plan->lock);
	raw = plan->sample.raw;
	pose->t_ns = plan->sample.t_ns;
	sequence = plan->sample.sequence;
	raw_spin_unlock(&plan->lock);
	if (sequence == plan->taken)
		return false;
	plan->taken = sequence;
	/* 2^30 · 2^32 */
	length = incise_fx_rounded(incise_fx_hold(raw, RAW_MAX) * load->scale, 16);
	incise_fx_add(pose->position, load->origin, incise_fx_hold32(length),
		      load->direction);
	memcpy(pose->quaternion, load->quaternion, sizeof(pose->quaternion));
	pose->tool = load->tool;
	return true;
}
