// SPDX-License-Identifier: GPL-2.0-only
/*
 * The config that a motor has from bind on: properties of its firmware node, see
 * bindings/misc/incise,stepper-gpio.yaml, and defaults for the rest. A property that is
 * there but cannot be read fails the bind. Values that this machine cannot hold are brought
 * to values that it can, with a message: such a motor can be set up, but moves at no other
 * limits than GET_CONFIG shows.
 */
#include <linux/device.h>
#include <linux/kernel.h>
#include <linux/math64.h>
#include <linux/property.h>

#include "stepper.h"

/* Reads properties of a motor; keeps the first error, which it reports. */
struct stepper_defaults {
	struct device *dev;
	const struct fwnode_handle *node; /* NULL: there are none */
	unsigned int motor;
	int error;
};

/* A property that cannot be read must not pass for an absent one. */
static bool stepper_defaults_read(struct stepper_defaults *from, const char *name,
				  int ret, const char *form)
{
	if (!ret)
		return true;
	if (!from->error)
		from->error = dev_err_probe(from->dev, ret,
					    "motor %u: property %s: expected %s\n",
					    from->motor, name, form);
	return false;
}

static u32 stepper_defaults_u32(struct stepper_defaults *from, const char *name,
				u32 otherwise)
{
	u32 value;
	int ret;

	if (!fwnode_property_present(from->node, name))
		return otherwise;
	/* All cells are counted: the first of two would be read as if it were alone. */
	ret = fwnode_property_count_u32(from->node, name);
	ret = ret == 1 ? fwnode_property_read_u32(from->node, name, &value) : -EINVAL;
	return stepper_defaults_read(from, name, ret, "one cell") ? value : otherwise;
}

/* A position: 32 bits with a sign. */
static s32 stepper_defaults_s32(struct stepper_defaults *from, const char *name,
				s32 otherwise)
{
	return (s32)stepper_defaults_u32(from, name, (u32)otherwise);
}

static u64 stepper_defaults_u64(struct stepper_defaults *from, const char *name,
				u64 otherwise)
{
	u64 value;
	int ret;

	if (!fwnode_property_present(from->node, name))
		return otherwise;
	ret = fwnode_property_count_u64(from->node, name);
	ret = ret == 1 ? fwnode_property_read_u64(from->node, name, &value) : -EINVAL;
	return stepper_defaults_read(from, name, ret, "of 64 bits: /bits/ 64 <…>")
		       ? value
		       : otherwise;
}

/* Names that were: taken for nothing, their limits would be missing without a word. */
static void stepper_defaults_former(struct stepper_defaults *from, const char *name,
				    const char *now)
{
	if (!from->error && fwnode_property_present(from->node, name))
		from->error = dev_err_probe(from->dev, -EINVAL,
					    "motor %u: property %s is now %s\n",
					    from->motor, name, now);
}

/* 0, or an error that was reported. */
static int stepper_defaults_of(struct stepper_defaults *from,
			       struct incise_stepper_config *c)
{
	const s32 far = INCISE_PROFILE_POSITION_MAX;

	c->tick_ns = stepper_defaults_u32(from, "incise,tick-ns", 250000);
	c->velocity = stepper_defaults_u32(from, "incise,velocity", 10000);
	c->acceleration = stepper_defaults_u32(from, "incise,acceleration", 100000);
	c->jerk = stepper_defaults_u64(from, "incise,jerk", 0);
	c->debounce_ns = stepper_defaults_u32(from, "incise,debounce-ns", c->debounce_ns);
	c->late_max = stepper_defaults_u32(from, "incise,late-max", 100);
	c->lost_steps_max =
		stepper_defaults_u32(from, "incise,lost-steps-max", c->lost_steps_max);
	c->position_min = stepper_defaults_s32(from, "incise,position-min", -far);
	c->position_max = stepper_defaults_s32(from, "incise,position-max", far);
	c->safe_position =
		clamp((s64)stepper_defaults_s32(from, "incise,safe-position", 0),
		      c->position_min, max(c->position_min, c->position_max));
	c->deadman_ns = stepper_defaults_u32(from, "incise,deadman-us", 100000) *
			(u64)NSEC_PER_USEC;
	c->high_ns = stepper_defaults_u32(from, "incise,high-ns", 5000);
	c->low_ns = stepper_defaults_u32(from, "incise,low-ns", 5000);
	c->setup_ns = stepper_defaults_u32(from, "incise,setup-ns", 5000);
	c->hold_ns = stepper_defaults_u32(from, "incise,hold-ns", 5000);
	c->enable_ns =
		stepper_defaults_u32(from, "incise,enable-us", 1000) * (u64)NSEC_PER_USEC;
	if (fwnode_property_present(from->node, "incise,invert"))
		c->flags |= INCISE_STEPPER_CONFIG_INVERT;
	if (fwnode_property_present(from->node, "incise,retract"))
		c->flags |= INCISE_STEPPER_CONFIG_RETRACT;
	if (fwnode_property_present(from->node, "incise,volatile-home"))
		c->flags |= INCISE_STEPPER_CONFIG_VOLATILE_HOME;
	stepper_defaults_former(from, "incise,deadman-ns", "incise,deadman-us");
	stepper_defaults_former(from, "incise,enable-ns", "incise,enable-us");
	return from->error;
}

static void stepper_defaults_fit(struct stepper_motor *motor,
				 struct incise_stepper_config *c, struct device *dev)
{
	const struct incise_stepper_controller *info = &motor->stepper->info;
	u32 velocity;

	if (c->tick_ns < info->tick_min_ns) {
		dev_warn(dev,
			 "motor %u: a tick of %u ns is too short here: at least %u\n",
			 motor->index, c->tick_ns, info->tick_min_ns);
		c->tick_ns = info->tick_min_ns;
	}
	c->high_ns = max(c->high_ns, info->pulse_ns);
	c->low_ns = max(c->low_ns, info->pulse_ns);
	velocity = min(info->rate_max, stepper_page_velocity(c, info));
	if (c->velocity > velocity) {
		dev_warn(dev,
			 "motor %u: %u steps/s exceed the limit of this machine: %u\n",
			 motor->index, c->velocity, velocity);
		c->velocity = velocity;
	}
}

/* Configs of all motors; errors are reported. */
int stepper_defaults(struct stepper *stepper, struct device *dev)
{
	u32 lost_steps_max[INCISE_STEPPER_MOTORS_MAX] = {},
	    debounce_ns[INCISE_STEPPER_MOTORS_MAX] = {},
	    cpu[INCISE_STEPPER_MOTORS_MAX] = {};
	unsigned int i;
	int ret;

	/* configfs makes no nodes of motors. */
	device_property_read_u32_array(dev, "incise,lost-steps-max", lost_steps_max,
				       stepper->n_motors);
	device_property_read_u32_array(dev, "incise,debounce-ns", debounce_ns,
				       stepper->n_motors);
	device_property_read_u32_array(dev, "incise,cpu", cpu, stepper->n_motors);
	for (i = 0; i < stepper->n_motors; i++) {
		struct incise_stepper_config config = {
			.motor = i,
			.lost_steps_max = lost_steps_max[i],
			.debounce_ns = debounce_ns[i],
			.cpu = cpu[i],
		};
		struct stepper_defaults from = {.dev = dev, .motor = i};
		struct fwnode_handle *node;

		node = stepper_node_motor(dev, i);
		from.node = node;
		ret = stepper_defaults_of(&from, &config);
		fwnode_handle_put(node);
		if (ret)
			return ret;
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
