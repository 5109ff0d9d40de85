// SPDX-License-Identifier: GPL-2.0-only
/*
 * /dev/incise-stepperN: the device node, its class and the memory behind it. The memory
 * stays until the last open file is closed and the last page unmapped, which may be long
 * after the hardware has gone:
 *
 *   probe ── new ── add ═════════ remove ── (put)          hardware
 *                       open ───────────────────── release memory
 */
#include <linux/device.h>
#include <linux/fs.h>
#include <linux/gfp.h>
#include <linux/idr.h>
#include <linux/mm.h>
#include <linux/slab.h>

#include "compat.h"
#include "stepper.h"

#define MINORS 64

static DEFINE_IDA(stepper_ids);
static struct class *stepper_class;
static dev_t stepper_devt;

static struct stepper *to_stepper(struct device *dev)
{
	return container_of(dev, struct stepper, dev);
}

static ssize_t name_show(struct device *dev, struct device_attribute *attr, char *buf)
{
	return sysfs_emit(buf, "%s\n", to_stepper(dev)->info.name);
}
static DEVICE_ATTR_RO(name);

static ssize_t motors_show(struct device *dev, struct device_attribute *attr, char *buf)
{
	return sysfs_emit(buf, "%u\n", to_stepper(dev)->n_motors);
}
static DEVICE_ATTR_RO(motors);

static struct attribute *stepper_attrs[] = {
	&dev_attr_name.attr,
	&dev_attr_motors.attr,
	NULL,
};
ATTRIBUTE_GROUPS(stepper);

static void stepper_device_release(struct device *dev)
{
	struct stepper *stepper = to_stepper(dev);

	/* No mapping is left: each holds a file. */
	free_page((unsigned long)stepper->setpoints);
	free_page((unsigned long)stepper->status);
	ida_free(&stepper_ids, stepper->id);
	mutex_destroy(&stepper->mutex);
	mutex_destroy(&stepper->loading);
	kfree(stepper);
}

/**
 * stepper_device_new() - memory for a controller
 * @parent: device that it is bound to
 * @n_motors:	1 … INCISE_STEPPER_MOTORS_MAX
 *
 * Return: to be freed with put_device(&stepper->dev), or an ERR_PTR.
 */
struct stepper *stepper_device_new(struct device *parent, unsigned int n_motors)
{
	struct stepper *stepper;
	unsigned int i;
	int id, ret;

	BUILD_BUG_ON(sizeof(struct incise_stepper_setpoint) != 64);
	BUILD_BUG_ON(sizeof(struct incise_stepper_motor_status) != 128);
	BUILD_BUG_ON(sizeof(struct incise_stepper_event) != 32);
	BUILD_BUG_ON(sizeof(struct incise_stepper_controller) != 256);
	BUILD_BUG_ON(sizeof(struct incise_stepper_config) != 128);
	BUILD_BUG_ON(sizeof(struct incise_stepper_origin) != 16);
	BUILD_BUG_ON(sizeof(struct incise_stepper_sync) != 64);
	BUILD_BUG_ON(sizeof(struct incise_stepper_plan) != 128);
	BUILD_BUG_ON(sizeof(struct incise_stepper_plan_status) != 384);

	id = ida_alloc_max(&stepper_ids, MINORS - 1, GFP_KERNEL);
	if (id < 0)
		return ERR_PTR(id);
	stepper = kzalloc(sizeof(*stepper), GFP_KERNEL);
	if (!stepper) {
		ida_free(&stepper_ids, id);
		return ERR_PTR(-ENOMEM);
	}
	stepper->id = id;
	stepper->parent = parent;
	stepper->n_motors = n_motors;
	stepper->info.n_motors = n_motors;
	stepper->info.capabilities = STEPPER_PLAN_CAPABILITY;
	mutex_init(&stepper->mutex);
	mutex_init(&stepper->loading);
	stepper_event_init(stepper);
	stepper_sync_init(stepper);
	stepper_latency_init(stepper);
	stepper_lines_init(stepper);
	for (i = 0; i < n_motors; i++) {
		stepper->motor[i].stepper = stepper;
		stepper->motor[i].index = i;
		stepper_motor_init(&stepper->motor[i]);
	}

	/* From here on the release function frees everything. */
	device_initialize(&stepper->dev);
	stepper->dev.class = stepper_class;
	stepper->dev.parent = parent;
	stepper->dev.devt = MKDEV(MAJOR(stepper_devt), id);
	stepper->dev.groups = stepper_groups;
	stepper->dev.release = stepper_device_release;
	cdev_init(&stepper->cdev, &stepper_file_operations);
	stepper->cdev.owner = THIS_MODULE;

	stepper->setpoints = (void *)get_zeroed_page(GFP_KERNEL);
	stepper->status = (void *)get_zeroed_page(GFP_KERNEL);
	ret = stepper->setpoints && stepper->status ? 0 : -ENOMEM;
	if (!ret)
		ret = dev_set_name(&stepper->dev, "incise-stepper%d", id);
	if (ret) {
		put_device(&stepper->dev);
		return ERR_PTR(ret);
	}
	return stepper;
}

/* From now on it can be opened. */
int stepper_device_add(struct stepper *stepper)
{
	return cdev_device_add(&stepper->cdev, &stepper->dev);
}

/* It can be opened no more. Files that are open stay so. */
void stepper_device_remove(struct stepper *stepper)
{
	cdev_device_del(&stepper->cdev, &stepper->dev);
}

int stepper_device_init(void)
{
	int ret;

	ret = alloc_chrdev_region(&stepper_devt, 0, MINORS, "incise-stepper");
	if (ret)
		return ret;
	stepper_class = class_create("incise");
	if (IS_ERR(stepper_class)) {
		unregister_chrdev_region(stepper_devt, MINORS);
		return PTR_ERR(stepper_class);
	}
	return 0;
}

void stepper_device_exit(void)
{
	class_destroy(stepper_class);
	unregister_chrdev_region(stepper_devt, MINORS);
	ida_destroy(&stepper_ids);
}
