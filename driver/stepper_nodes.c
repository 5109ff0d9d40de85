// SPDX-License-Identifier: GPL-2.0-only
/*
 * From the wires that configfs names to a platform device whose driver finds them: by a
 * lookup table, whose chips go by their labels.
 *
 *   incise-stepper.N { label, incise,motors, -lost-steps-max, -debounce-ns, -cpu }
 *   lookup table of incise-stepper.N:  estop, sync, motor0-step, motor0-dir, …
 */
#include <linux/gpio/machine.h>
#include <linux/idr.h>
#include <linux/platform_device.h>
#include <linux/property.h>
#include <linux/slab.h>

#include "compat.h"
#include "stepper_wires.h"

#define LINES_MAX (STEPPER_WIRES + INCISE_STEPPER_MOTORS_MAX * STEPPER_MOTOR_WIRES)

struct stepper_nodes {
	struct platform_device *pdev;
	int id;
	char device[32];
	char key[LINES_MAX][24];
	unsigned int n_lines;
	struct gpiod_lookup_table *table;
};

static DEFINE_IDA(stepper_nodes_ids);

static void stepper_nodes_line(struct stepper_nodes *nodes, int motor, const char *name,
			       const struct stepper_wire *wire)
{
	unsigned int n = nodes->n_lines;
	char *key = nodes->key[n];

	if (!wire->label)
		return;
	if (motor < 0)
		snprintf(key, sizeof(nodes->key[n]), "%s", name);
	else
		snprintf(key, sizeof(nodes->key[n]), "motor%d-%s", motor, name);
	nodes->table->table[n] = GPIO_LOOKUP(wire->label, wire->offset, key, wire->flags);
	nodes->n_lines++;
}

static void stepper_nodes_fill(struct stepper_nodes *nodes,
			       const struct stepper_wires *wires)
{
	int i, wire;

	for (wire = 0; wire < STEPPER_WIRES; wire++)
		stepper_nodes_line(nodes, -1, stepper_wire_names[wire],
				   &wires->wire[wire]);
	for (i = 0; i < wires->n_motors; i++)
		for (wire = 0; wire < STEPPER_MOTOR_WIRES; wire++)
			stepper_nodes_line(nodes, i, stepper_motor_wire_names[wire],
					   &wires->motor[i][wire]);
}

static int stepper_nodes_bind(struct stepper_nodes *nodes,
			      const struct stepper_wires *wires)
{
	const struct property_entry properties[] = {
		PROPERTY_ENTRY_STRING("label", wires->name),
		PROPERTY_ENTRY_U32("incise,motors", wires->n_motors),
		PROPERTY_ENTRY_U32_ARRAY_LEN("incise,lost-steps-max",
					     wires->lost_steps_max, wires->n_motors),
		PROPERTY_ENTRY_U32_ARRAY_LEN("incise,debounce-ns", wires->debounce_ns,
					     wires->n_motors),
		PROPERTY_ENTRY_U32_ARRAY_LEN("incise,cpu", wires->cpu, wires->n_motors),
		{},
	};
	const struct platform_device_info info = {
		.name = "incise-stepper",
		.id = nodes->id,
		.properties = properties,
		/* A pointer, for stepper_nodes_label(): its target outlives the device. */
		.data = &nodes,
		.size_data = sizeof(nodes),
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
	snprintf(nodes->device, sizeof(nodes->device), "incise-stepper.%d", nodes->id);
	nodes->table->dev_id = nodes->device;
	stepper_nodes_fill(nodes, wires);

	gpiod_add_lookup_table(nodes->table);
	ret = stepper_nodes_bind(nodes, wires);
	if (!ret)
		return nodes;

	gpiod_remove_lookup_table(nodes->table);
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
	ida_free(&stepper_nodes_ids, nodes->id);
	kfree(nodes->table);
	kfree(nodes);
}

/* The platform device: incise-stepper.N. */
struct device *stepper_nodes_device(struct stepper_nodes *nodes)
{
	return &nodes->pdev->dev;
}

/* The label that was written for a line; NULL: not a device of ours, or no such line. */
const char *stepper_nodes_label(struct device *dev, const char *key)
{
	struct stepper_nodes *const *of = dev_get_platdata(dev);
	unsigned int i;

	for (i = 0; of && i < (*of)->n_lines; i++)
		if (!strcmp((*of)->key[i], key))
			return (*of)->table->table[i].key;
	return NULL;
}
