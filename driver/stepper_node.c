// SPDX-License-Identifier: GPL-2.0-only
/*
 * The firmware nodes of motors: children of the controller's node, distinguished by reg.
 *
 *   controller ─┬─ motor@0 { reg = <0>; }
 *               └─ motor@1 { reg = <1>; }
 */
#include <linux/device.h>
#include <linux/property.h>

#include "stepper.h"

/* A motor's node, to be put; NULL: it has none. */
struct fwnode_handle *stepper_node_motor(struct device *dev, unsigned int motor)
{
	struct fwnode_handle *node = NULL;
	u32 reg;

	do {
		node = device_get_next_child_node(dev, node);
	} while (node && (fwnode_property_read_u32(node, "reg", &reg) || reg != motor));
	return node;
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
				     "motors must be numbered from 0 on without a gap\n");
	return n;
}
