// SPDX-License-Identifier: GPL-2.0-only
/*
 * The config that a motor has from bind on: properties of its firmware node, see
 * incise,stepper-gpio.yaml, and defaults for the rest. What this machine cannot hold is
 * brought to what it can, and said so: such a motor can be set up, but moves at no other
 * limits than the ones that GET_CONFIG shows.
 */
#include <linux/device.h>
#include <linux/kernel.h>
#include <linux/math64.h>
#include <linux/property.h>

#include "stepper.h"

static u32 stepper_defaults_u32(const struct fwnode_handle *node, const char *name,
				u32 otherwise)
{
	u32 value;

	return node && !fwnode_property_read_u32(node, name, &value) ? value : otherwise;
}

/* A position: 32 bits with a sign. */
static s32 stepper_defaults_s32(const struct fwnode_handle *node, const char *name,
				s32 otherwise)
{
	return (s32)stepper_defaults_u32(node, name, (u32)otherwise);
}

static u64 stepper_defaults_u64(const struct fwnode_handle *node, const char *name,
				u64 otherwise)
{
	u64 value;

	return node && !fwnode_property_read_u64(node, name, &value) ? value : otherwise;
}

static void stepper_defaults_read(struct incise_stepper_config *c,
				  const struct fwnode_handle *node)
{
	const s32 far = INCISE_PROFILE_POSITION_MAX;

	c->tick_ns = stepper_defaults_u32(node, "incise,tick-ns", 250000);
	c->velocity = stepper_defaults_u32(node, "incise,velocity", 10000);
	c->acceleration = stepper_defaults_u32(node, "incise,acceleration", 100000);
	c->jerk = stepper_defaults_u64(node, "incise,jerk", 0);
	c->late_max = stepper_defaults_u32(node, "incise,late-max", 100);
	c->position_min = stepper_defaults_s32(node, "incise,position-min", -far);
	c->position_max = stepper_defaults_s32(node, "incise,position-max", far);
	c->safe_position =
		clamp((s64)stepper_defaults_s32(node, "incise,safe-position", 0),
		      c->position_min, max(c->position_min, c->position_max));
	c->deadman_ns = stepper_defaults_u64(node, "incise,deadman-ns", 100000000);
	c->high_ns = stepper_defaults_u32(node, "incise,high-ns", 5000);
	c->low_ns = stepper_defaults_u32(node, "incise,low-ns", 5000);
	c->setup_ns = stepper_defaults_u32(node, "incise,setup-ns", 5000);
	c->hold_ns = stepper_defaults_u32(node, "incise,hold-ns", 5000);
	c->enable_ns = stepper_defaults_u64(node, "incise,enable-ns", 1000000);
	if (!node)
		return;
	if (fwnode_property_present(node, "incise,invert"))
		c->flags |= INCISE_STEPPER_CONFIG_INVERT;
	if (fwnode_property_present(node, "incise,retract"))
		c->flags |= INCISE_STEPPER_CONFIG_RETRACT;
}

static void stepper_defaults_fit(struct stepper_motor *motor,
				 struct incise_stepper_config *c, struct device *dev)
{
	const struct incise_stepper_controller *info = &motor->stepper->info;
	u32 velocity;

	if (c->tick_ns < info->tick_min_ns) {
		dev_warn(dev,
			 "motor %u: a tick of %u ns is too short for this machine: %u\n",
			 motor->index, c->tick_ns, info->tick_min_ns);
		c->tick_ns = info->tick_min_ns;
	}
	c->high_ns = max(c->high_ns, info->pulse_ns);
	c->low_ns = max(c->low_ns, info->pulse_ns);
	velocity = min_t(u64, info->rate_max,
			 div_u64(NSEC_PER_SEC, max(c->high_ns + c->low_ns, 1U)));
	if (c->velocity > velocity) {
		dev_warn(dev,
			 "motor %u: %u steps/s are more than this machine holds: %u\n",
			 motor->index, c->velocity, velocity);
		c->velocity = velocity;
	}
}

/* Configs of all motors; errors are reported. */
int stepper_defaults(struct stepper *stepper, struct device *dev)
{
	unsigned int i;
	int ret;

	for (i = 0; i < stepper->n_motors; i++) {
		struct incise_stepper_config config = {.motor = i};
		struct fwnode_handle *node;

		node = stepper_node_motor(dev, i);
		stepper_defaults_read(&config, node);
		fwnode_handle_put(node);
		stepper_defaults_fit(&stepper->motor[i], &config, dev);
		ret = stepper_page_config(&config, &stepper->info);
		if (!ret)
			ret = stepper_setup_config(&stepper->motor[i], &config);
		if (ret)
			return dev_err_probe(dev, ret,
					     "motor %u: a property is out of range\n", i);
	}
	return 0;
}
