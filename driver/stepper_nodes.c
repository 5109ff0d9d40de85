// SPDX-License-Identifier: GPL-2.0-only
/*
 * From the wires that configfs names to a platform device whose driver finds them.
 * The device gets software nodes, so that it is bound by the same way as one of a device
 * tree. Where gpiolib does not follow these to a chip yet (before 6.2), a lookup table
 * does:
 *
 *   incise-stepper-NAME { label, estop-gpios, sync-gpios }
 *    ├─ motor@0 { reg, step-gpios = <&CHIP offset flags>, … }
 *    ├─ motor@1 …
 *    └─ CHIP         a node of the chip's label stands for the chip
 */
#include <linux/gpio/machine.h>
#include <linux/idr.h>
#include <linux/platform_device.h>
#include <linux/property.h>
#include <linux/slab.h>

#include "compat.h"
#include "stepper_wires.h"

#define LINES_MAX (STEPPER_WIRES + INCISE_STEPPER_MOTORS_MAX * STEPPER_MOTOR_WIRES)
#define NODES_MAX (1 + INCISE_STEPPER_MOTORS_MAX + LINES_MAX)

struct stepper_nodes {
	struct platform_device *pdev;
	int id;
	char name[64];
	char device[32];
	char motor_name[INCISE_STEPPER_MOTORS_MAX][24];
	char key[LINES_MAX][24]; /* step-gpios, or motor0-step */
	unsigned int n_lines, n_motors;

	struct software_node node[NODES_MAX];
	const struct software_node *group[NODES_MAX + 1];
	unsigned int n_nodes;
	struct property_entry property[1 + INCISE_STEPPER_MOTORS_MAX]
				      [2 + STEPPER_MOTOR_WIRES + 1];
	struct software_node_ref_args ref[LINES_MAX];
	struct gpiod_lookup_table *table;
};

static DEFINE_IDA(stepper_nodes_ids);

static struct software_node *stepper_nodes_new(struct stepper_nodes *nodes,
					       const char *name,
					       const struct software_node *parent)
{
	struct software_node *node = &nodes->node[nodes->n_nodes];

	*node = (struct software_node){.name = name, .parent = parent};
	nodes->group[nodes->n_nodes++] = node;
	return node;
}

#ifdef HAVE_GPIO_SOFTWARE_NODES
/* The node that stands for a chip: one per label. */
static const struct software_node *stepper_nodes_chip(struct stepper_nodes *nodes,
						      const char *label)
{
	unsigned int i;

	for (i = 1 + nodes->n_motors; i < nodes->n_nodes; i++)
		if (!strcmp(nodes->node[i].name, label))
			return &nodes->node[i];
	return stepper_nodes_new(nodes, label, &nodes->node[0]);
}
#endif

static unsigned int stepper_nodes_line(struct stepper_nodes *nodes,
				       struct property_entry *property, int motor,
				       const char *name, const struct stepper_wire *wire)
{
	unsigned int n = nodes->n_lines;
	unsigned long flags = wire->active_low ? GPIO_ACTIVE_LOW : GPIO_ACTIVE_HIGH;
	char *key = nodes->key[n];

	if (!wire->label)
		return 0;
	nodes->n_lines++;
#ifdef HAVE_GPIO_SOFTWARE_NODES
	const struct software_node *chip;

	snprintf(key, sizeof(nodes->key[n]), "%s-gpios", name);
	chip = stepper_nodes_chip(nodes, wire->label);
	nodes->ref[n] = SOFTWARE_NODE_REFERENCE(chip, wire->offset, flags);
	*property = PROPERTY_ENTRY_REF_ARRAY_LEN(key, &nodes->ref[n], 1);
	return 1;
#else
	if (motor < 0)
		snprintf(key, sizeof(nodes->key[n]), "%s", name);
	else
		snprintf(key, sizeof(nodes->key[n]), "motor%d-%s", motor, name);
	nodes->table->table[n] = GPIO_LOOKUP(wire->label, wire->offset, key, flags);
	return 0;
#endif
}

static void stepper_nodes_fill(struct stepper_nodes *nodes,
			       const struct stepper_wires *wires)
{
	struct property_entry *p = nodes->property[0];
	struct software_node *root, *node;
	int i, wire;

	root = stepper_nodes_new(nodes, nodes->name, NULL);
	root->properties = p;
	nodes->n_motors = wires->n_motors;
	/* Motors before chips: see stepper_nodes_chip(). */
	for (i = 0; i < wires->n_motors; i++) {
		snprintf(nodes->motor_name[i], sizeof(nodes->motor_name[i]), "motor@%d",
			 i);
		node = stepper_nodes_new(nodes, nodes->motor_name[i], root);
		node->properties = nodes->property[1 + i];
	}
	*p++ = PROPERTY_ENTRY_STRING("label", wires->name);
	for (wire = 0; wire < STEPPER_WIRES; wire++)
		p += stepper_nodes_line(nodes, p, -1, stepper_wire_names[wire],
					&wires->wire[wire]);
	for (i = 0; i < wires->n_motors; i++) {
		p = nodes->property[1 + i];
		*p++ = PROPERTY_ENTRY_U32("reg", i);
		for (wire = 0; wire < STEPPER_MOTOR_WIRES; wire++)
			p += stepper_nodes_line(nodes, p, i,
						stepper_motor_wire_names[wire],
						&wires->motor[i][wire]);
	}
}

static int stepper_nodes_bind(struct stepper_nodes *nodes)
{
	struct platform_device_info info = {
		.name = "incise-stepper",
		.id = nodes->id,
		.fwnode = software_node_fwnode(&nodes->node[0]),
	};

	nodes->pdev = platform_device_register_full(&info);
	if (IS_ERR(nodes->pdev))
		return PTR_ERR(nodes->pdev);
	/* Set when probe has succeeded. If not, the log says why. */
	if (!platform_get_drvdata(nodes->pdev)) {
		platform_device_unregister(nodes->pdev);
		return -ENXIO;
	}
	return 0;
}

/**
 * stepper_nodes_make() - make a device of wires
 * @wires:	must stay until stepper_nodes_free()
 *
 * Return: to be freed, or an ERR_PTR: -ENXIO the driver refused it, and the log says
 * why.
 */
struct stepper_nodes *stepper_nodes_make(const struct stepper_wires *wires)
{
	struct stepper_nodes *nodes;
	int ret = -ENOMEM;

	nodes = kzalloc(sizeof(*nodes), GFP_KERNEL);
	if (!nodes)
		return ERR_PTR(ret);
	nodes->table =
		kzalloc(struct_size(nodes->table, table, LINES_MAX + 1), GFP_KERNEL);
	if (!nodes->table)
		goto free;
	ret = ida_alloc(&stepper_nodes_ids, GFP_KERNEL);
	if (ret < 0)
		goto free;
	nodes->id = ret;
	snprintf(nodes->name, sizeof(nodes->name), "incise-stepper-%s", wires->name);
	snprintf(nodes->device, sizeof(nodes->device), "incise-stepper.%d", nodes->id);
	nodes->table->dev_id = nodes->device;
	stepper_nodes_fill(nodes, wires);

	ret = software_node_register_node_group(nodes->group);
	if (ret)
		goto free_id;
	gpiod_add_lookup_table(nodes->table);
	ret = stepper_nodes_bind(nodes);
	if (!ret)
		return nodes;

	gpiod_remove_lookup_table(nodes->table);
	software_node_unregister_node_group(nodes->group);
free_id:
	ida_free(&stepper_nodes_ids, nodes->id);
free:
	kfree(nodes->table);
	kfree(nodes);
	return ERR_PTR(ret);
}

void stepper_nodes_free(struct stepper_nodes *nodes)
{
	platform_device_unregister(nodes->pdev);
	gpiod_remove_lookup_table(nodes->table);
	software_node_unregister_node_group(nodes->group);
	ida_free(&stepper_nodes_ids, nodes->id);
	kfree(nodes->table);
	kfree(nodes);
}

/* The platform device: incise-stepper.N. */
struct device *stepper_nodes_device(struct stepper_nodes *nodes)
{
	return &nodes->pdev->dev;
}
