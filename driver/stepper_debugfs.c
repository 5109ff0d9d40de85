// SPDX-License-Identifier: GPL-2.0-only
/*
 * debugfs: incise_stepper/incise-stepperN/ with statistics of the timers of its motors.
 *
 *   lateness   text: how late firings were, µs in bins that double
 *   cost       text: how long they took; ns only, no counter of instructions
 *   tick_cost  text: how long ticks of the motors took, without edges
 *   plan       text: how late ticks of the plan were and how long they took, in the same
 *              bins, and the cost of one at the load; empty without a plan
 *   counters   text: "name=number" per motor
 *   reset      write anything: all but counters restart
 */
#include <linux/debugfs.h>
#include <linux/math64.h>
#include <linux/module.h>
#include <linux/seq_file.h>
#include <linux/slab.h>

#include "stepper.h"

static struct dentry *stepper_debugfs_root;

/* All motors, as the table of one histogram. */
static int stepper_debugfs_histogram(struct seq_file *file, size_t offset)
{
	struct stepper *stepper = file->private;
	struct stepper_histogram *copy;
	unsigned long flags;
	unsigned int i, bin;

	copy = kcalloc(stepper->n_motors, sizeof(*copy), GFP_KERNEL);
	if (!copy)
		return -ENOMEM;
	seq_puts(file, "from_us");
	for (i = 0; i < stepper->n_motors; i++) {
		struct stepper_motor *motor = &stepper->motor[i];

		raw_spin_lock_irqsave(&motor->lock, flags);
		copy[i] = *(struct stepper_histogram *)((char *)motor + offset);
		raw_spin_unlock_irqrestore(&motor->lock, flags);
		seq_printf(file, " motor%u", i);
	}
	for (bin = 0; bin < STEPPER_BINS; bin++) {
		seq_printf(file, "\n%u", bin ? 1U << (bin - 1) : 0);
		for (i = 0; i < stepper->n_motors; i++)
			seq_printf(file, " %llu", copy[i].count[bin]);
	}
	seq_puts(file, "\nmean_ns");
	for (i = 0; i < stepper->n_motors; i++) {
		u64 n = 0;

		for (bin = 0; bin < STEPPER_BINS; bin++)
			n += copy[i].count[bin];
		seq_printf(file, " %llu", n ? div64_u64(copy[i].sum_ns, n) : 0);
	}
	seq_puts(file, "\nmax_ns");
	for (i = 0; i < stepper->n_motors; i++)
		seq_printf(file, " %llu", copy[i].max_ns);
	seq_puts(file, "\n");
	kfree(copy);
	return 0;
}

static int lateness_show(struct seq_file *file, void *data)
{
	return stepper_debugfs_histogram(file, offsetof(struct stepper_motor, lateness));
}
DEFINE_SHOW_ATTRIBUTE(lateness);

static int cost_show(struct seq_file *file, void *data)
{
	return stepper_debugfs_histogram(file, offsetof(struct stepper_motor, cost));
}
DEFINE_SHOW_ATTRIBUTE(cost);

static int tick_cost_show(struct seq_file *file, void *data)
{
	return stepper_debugfs_histogram(file, offsetof(struct stepper_motor, tick_cost));
}
DEFINE_SHOW_ATTRIBUTE(tick_cost);

static int plan_show(struct seq_file *file, void *data)
{
	struct stepper *stepper = file->private;

	mutex_lock(&stepper->mutex);
	stepper_plan_show(stepper, file);
	mutex_unlock(&stepper->mutex);
	return 0;
}
DEFINE_SHOW_ATTRIBUTE(plan);

static int counters_show(struct seq_file *file, void *data)
{
	struct stepper *stepper = file->private;
	enum stepper_input input;
	unsigned long flags;
	unsigned int i;

	for (i = 0; i < stepper->n_motors; i++) {
		struct stepper_motor *motor = &stepper->motor[i];
		u64 edges, up, down, late, shifted, waits, storms;
		u32 faults;

		raw_spin_lock_irqsave(&motor->lock, flags);
		edges = motor->edges;
		up = motor->steps_up;
		down = motor->steps_down;
		late = motor->late;
		shifted = motor->shifted_ns;
		waits = motor->waits;
		faults = motor->faults;
		storms = stepper->estop_irq.storms;
		for (input = 0; input < STEPPER_INPUTS; input++)
			storms += motor->lines.irq[input].storms;
		raw_spin_unlock_irqrestore(&motor->lock, flags);
		seq_printf(file, "motor=%u edges=%llu steps_up=%llu steps_down=%llu", i,
			   edges, up, down);
		seq_printf(
			file,
			" late=%llu shifted_ns=%llu waits=%llu storms=%llu faults=%#x\n",
			late, shifted, waits, storms, faults);
	}
	return 0;
}
DEFINE_SHOW_ATTRIBUTE(counters);

static ssize_t reset_write(struct file *file, const char __user *from, size_t n,
			   loff_t *offset)
{
	struct stepper *stepper = file->private_data;
	unsigned long flags;
	unsigned int i;

	for (i = 0; i < stepper->n_motors; i++) {
		struct stepper_motor *motor = &stepper->motor[i];

		raw_spin_lock_irqsave(&motor->lock, flags);
		memset(&motor->lateness, 0, sizeof(motor->lateness));
		memset(&motor->cost, 0, sizeof(motor->cost));
		memset(&motor->tick_cost, 0, sizeof(motor->tick_cost));
		raw_spin_unlock_irqrestore(&motor->lock, flags);
	}
	mutex_lock(&stepper->mutex);
	stepper_plan_reset(stepper);
	mutex_unlock(&stepper->mutex);
	return n;
}

static const struct file_operations reset_fops = {
	.owner = THIS_MODULE,
	.open = simple_open,
	.write = reset_write,
};

/* debugfs may be missing; nothing depends on it. */
void stepper_debugfs_add(struct stepper *stepper)
{
	struct dentry *dir;

	dir = debugfs_create_dir(dev_name(&stepper->dev), stepper_debugfs_root);
	debugfs_create_file("lateness", 0444, dir, stepper, &lateness_fops);
	debugfs_create_file("cost", 0444, dir, stepper, &cost_fops);
	debugfs_create_file("tick_cost", 0444, dir, stepper, &tick_cost_fops);
	if (STEPPER_PLAN_CAPABILITY)
		debugfs_create_file("plan", 0444, dir, stepper, &plan_fops);
	debugfs_create_file("counters", 0444, dir, stepper, &counters_fops);
	debugfs_create_file("reset", 0200, dir, stepper, &reset_fops);
	stepper->debugfs = dir;
}

/* Waits for readers. */
void stepper_debugfs_remove(struct stepper *stepper)
{
	debugfs_remove_recursive(stepper->debugfs);
}

void stepper_debugfs_init(void)
{
	stepper_debugfs_root = debugfs_create_dir("incise_stepper", NULL);
}

void stepper_debugfs_exit(void)
{
	debugfs_remove_recursive(stepper_debugfs_root);
}
