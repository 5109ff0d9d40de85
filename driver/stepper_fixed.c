// SPDX-License-Identifier: GPL-2.0-only
/*
 * The integer force model inside the kernel: the interface for a force loop here. So far it
 * shows that the kernel computes the same bits as a program, in debugfs:
 *
 *   incise_stepper/fixed/
 *     blob      write a MODEL.fx, whole
 *     run       write "N SEED": N evaluations of inputs by chance, see lib/fixed/trial.h
 *     outputs   read N int32, of the fuzzy evaluator; empty without a blob
 *     forces    read 4N int32: force and stretch of the plane constraint
 *
 * Blobs are untrusted: incise_fixed_open() looks at all of it.
 */
#include <linux/debugfs.h>
#include <linux/fs.h>
#include <linux/kernel.h>
#include <linux/mm.h>
#include <linux/module.h>
#include <linux/mutex.h>
#include <linux/sched.h>
#include <linux/slab.h>
#include <linux/uaccess.h>

#include "../lib/fixed/trial.h"
#include "stepper.h"

#define FORCE_WORDS 4

struct stepper_fixed {
	struct mutex mutex; /* all below */
	u8 *blob;
	size_t size;
	s32 *outputs, *forces;
	u32 n, n_outputs;
};

static struct stepper_fixed stepper_fixed = {
	.mutex = __MUTEX_INITIALIZER(stepper_fixed.mutex),
};

static int blob_open(struct inode *inode, struct file *file)
{
	struct stepper_fixed *fixed = &stepper_fixed;

	/* Each opening starts a new one. */
	mutex_lock(&fixed->mutex);
	fixed->size = 0;
	mutex_unlock(&fixed->mutex);
	return nonseekable_open(inode, file);
}

static ssize_t blob_write(struct file *file, const char __user *from, size_t n,
			  loff_t *offset)
{
	struct stepper_fixed *fixed = &stepper_fixed;
	ssize_t ret = n;

	mutex_lock(&fixed->mutex);
	if (!fixed->blob)
		fixed->blob = kvmalloc(INCISE_FIXED_SIZE_MAX, GFP_KERNEL);
	if (!fixed->blob)
		ret = -ENOMEM;
	else if (n > INCISE_FIXED_SIZE_MAX - fixed->size)
		ret = -EFBIG;
	else if (copy_from_user(fixed->blob + fixed->size, from, n))
		ret = -EFAULT;
	else
		fixed->size += n;
	mutex_unlock(&fixed->mutex);
	return ret;
}

static const struct file_operations blob_fops = {
	.owner = THIS_MODULE,
	.open = blob_open,
	.write = blob_write,
};

static void stepper_fixed_compute(struct stepper_fixed *fixed,
				  const struct incise_fixed *fx, u64 seed)
{
	struct incise_fixed_spring spring;
	u64 state = seed;
	s32 p[3], x[INCISE_FIXED_INPUTS_MAX];
	u32 i;

	for (i = 0; i < fixed->n; i++) {
		s32 *force = &fixed->forces[i * FORCE_WORDS];

		if (fx) {
			incise_fx_trial_inputs(&state, fx, x);
			fixed->outputs[i] = incise_fixed_eval(fx, x);
		}
		incise_fx_trial_spring(&state, &spring, p);
		memset(force, 0, FORCE_WORDS * sizeof(*force));
		force[3] = incise_fixed_spring_pull(&spring, p, force);
		cond_resched();
	}
	fixed->n_outputs = fx ? fixed->n : 0;
}

static int stepper_fixed_run(struct stepper_fixed *fixed, u32 n, u64 seed)
{
	struct incise_fixed fx;
	int ret;

	if (n < 1 || n > INCISE_FX_TRIAL_MAX)
		return -EINVAL;
	ret = fixed->size ? incise_fixed_open(&fx, fixed->blob, fixed->size) : 0;
	if (ret)
		return ret;
	kvfree(fixed->outputs);
	kvfree(fixed->forces);
	fixed->n = 0;
	fixed->n_outputs = 0;
	fixed->outputs = kvcalloc(n, sizeof(s32), GFP_KERNEL);
	fixed->forces = kvcalloc(n, FORCE_WORDS * sizeof(s32), GFP_KERNEL);
	if (!fixed->outputs || !fixed->forces)
		return -ENOMEM;
	fixed->n = n;
	stepper_fixed_compute(fixed, fixed->size ? &fx : NULL, seed);
	return 0;
}

static ssize_t run_write(struct file *file, const char __user *from, size_t size,
			 loff_t *offset)
{
	struct stepper_fixed *fixed = &stepper_fixed;
	char text[48];
	u64 seed;
	u32 n;
	int ret;

	if (size >= sizeof(text))
		return -EINVAL;
	if (copy_from_user(text, from, size))
		return -EFAULT;
	text[size] = '\0';
	if (sscanf(text, "%u %llu", &n, &seed) != 2)
		return -EINVAL;
	mutex_lock(&fixed->mutex);
	ret = stepper_fixed_run(fixed, n, seed);
	mutex_unlock(&fixed->mutex);
	return ret ? ret : (ssize_t)size;
}

static const struct file_operations run_fops = {
	.owner = THIS_MODULE,
	.open = simple_open,
	.write = run_write,
};

static ssize_t outputs_read(struct file *file, char __user *to, size_t n, loff_t *offset)
{
	struct stepper_fixed *fixed = &stepper_fixed;
	ssize_t ret;

	mutex_lock(&fixed->mutex);
	ret = simple_read_from_buffer(to, n, offset, fixed->outputs,
				      fixed->n_outputs * sizeof(s32));
	mutex_unlock(&fixed->mutex);
	return ret;
}

static const struct file_operations outputs_fops = {
	.owner = THIS_MODULE,
	.open = simple_open,
	.read = outputs_read,
};

static ssize_t forces_read(struct file *file, char __user *to, size_t n, loff_t *offset)
{
	struct stepper_fixed *fixed = &stepper_fixed;
	ssize_t ret;

	mutex_lock(&fixed->mutex);
	ret = simple_read_from_buffer(to, n, offset, fixed->forces,
				      fixed->n * FORCE_WORDS * sizeof(s32));
	mutex_unlock(&fixed->mutex);
	return ret;
}

static const struct file_operations forces_fops = {
	.owner = THIS_MODULE,
	.open = simple_open,
	.read = forces_read,
};

void stepper_fixed_init(struct dentry *root)
{
	struct dentry *dir = debugfs_create_dir("fixed", root);

	debugfs_create_file("blob", 0200, dir, NULL, &blob_fops);
	debugfs_create_file("run", 0200, dir, NULL, &run_fops);
	debugfs_create_file("outputs", 0400, dir, NULL, &outputs_fops);
	debugfs_create_file("forces", 0400, dir, NULL, &forces_fops);
}

/* The files have gone before. */
void stepper_fixed_exit(void)
{
	kvfree(stepper_fixed.blob);
	kvfree(stepper_fixed.outputs);
	kvfree(stepper_fixed.forces);
}
