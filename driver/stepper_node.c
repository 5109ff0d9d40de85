// SPDX-License-Identifier: GPL-2.0-only
/*
 * The firmware nodes of motors: children of the controller's node, distinguished by reg.
 *
 *   controller ─┬─ motor@0 { reg = <0>; }
 *               └─ motor@1 { reg = <1>; }
 */
#include <dt-bindings/gpio/gpio.h>
#include <linux/device.h>
#include <linux/property.h>

#include "stepper.h"

/* A motor's node, to be put; NULL: it has no node. */
struct fwnode_handle *stepper_node_motor(struct device *dev, unsigned int motor)
{
	struct fwnode_handle *node = NULL;
	u32 reg;

	do {
		node = device_get_next_child_node(dev, node);
	} while (node && (fwnode_property_read_u32(node, "reg", &reg) || reg != motor));
	return node;
}

/**
 * stepper_node_push_pull() - whether a line's flags say that it is driven both ways
 * @node:	its node
 * @name:	of the line, less "-gpios"
 *
 * gpiolib writes a line that is driven one way only by changing its direction, for which
 * pin controllers take a mutex. The flags are the last of at least two cells.
 */
bool stepper_node_push_pull(const struct fwnode_handle *node, const char *name)
{
	struct fwnode_reference_args args;
	char property[32];

	snprintf(property, sizeof(property), "%s-gpios", name);
	if (fwnode_property_get_reference_args(node, property, "#gpio-cells", 0, 0,
					       &args)) {
		snprintf(property, sizeof(property), "%s-gpio", name);
		if (fwnode_property_get_reference_args(node, property, "#gpio-cells", 0,
						       0, &args))
			return true;
	}
	fwnode_handle_put(args.fwnode);
	return args.nargs < 2 || !(args.args[args.nargs - 1] & GPIO_SINGLE_ENDED);
}

/* The number of motors, 0 … N-1 without a gap, or a negative errno. */
int stepper_node_count(struct device *dev)
{
	struct fwnode_handle *node = NULL;
	unsigned long seen = 0;
	u32 n = 0, reg;

	for (;;) {
		node = device_get_next_child_node(dev, node);
		if (!node)
			break;
		if (fwnode_property_read_u32(node, "reg", &reg))
			continue; /* not a motor's */
		if (reg >= INCISE_STEPPER_MOTORS_MAX || seen & BIT(reg)) {
			fwnode_handle_put(node);
			return dev_err_probe(dev, -EINVAL,
					     "motor %u: out of range, or twice\n", reg);
		}
		seen |= BIT(reg);
		n++;
	}
	/* Without nodes, as with a bare lookup table, the number must be given. */
	if (!n && !device_property_read_u32(dev, "incise,motors", &n) && n >= 1 &&
	    n <= INCISE_STEPPER_MOTORS_MAX)
		return n;
	if (!n || seen != BIT(n) - 1)
		return dev_err_probe(dev, -EINVAL,
				     "motors must be numbered from 0 without a gap\n");
	return n;
}
