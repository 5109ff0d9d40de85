// SPDX-License-Identifier: GPL-2.0-only
/*
 * The file operations of /dev/incise-stepperN; see uapi/incise_stepper.h. The program
 * that opens it for writing is the owner, others watch. After unbind every call gives
 * ENODEV and poll shows HUP; pages that are mapped stay memory.
 *
 * A user's memory is never touched under stepper.mutex: a page fault there could wait
 * for a mapping that waits for the mutex. So a plan is copied before.
 */
#include <linux/fs.h>
#include <linux/io.h>
#include <linux/mm.h>
#include <linux/poll.h>
#include <linux/slab.h>
#include <linux/string.h>
#include <linux/uaccess.h>

#include "compat.h"
#include "stepper.h"

struct stepper_file {
	struct stepper *stepper;
	bool owner;
	struct mutex mutex; /* after, among threads that read */
	u64 after; /* seq of the last event read; on 32 bits poll() may see it torn */
};

static int stepper_file_open(struct inode *inode, struct file *file)
{
	struct stepper *stepper = container_of(inode->i_cdev, struct stepper, cdev);
	struct stepper_file *opened;
	int ret = 0;

	opened = kzalloc(sizeof(*opened), GFP_KERNEL);
	if (!opened)
		return -ENOMEM;
	mutex_init(&opened->mutex);
	opened->stepper = stepper;
	opened->owner = file->f_mode & FMODE_WRITE;

	mutex_lock(&stepper->mutex);
	if (stepper->gone) {
		ret = -ENODEV;
	} else if (opened->owner && stepper->owner) {
		ret = -EBUSY;
	} else if (opened->owner) {
		/* It is not mapped: a mapping would hold the last owner's file. */
		memset(stepper->setpoints, 0, PAGE_SIZE);
		stepper->owner = file;
		stepper_plan_new_owner(stepper);
	}
	mutex_unlock(&stepper->mutex);
	if (ret) {
		kfree(opened);
		return ret;
	}
	get_device(&stepper->dev);
	opened->after = stepper_event_last(stepper);
	file->private_data = opened;
	return stream_open(inode, file);
}

static int stepper_file_release(struct inode *inode, struct file *file)
{
	struct stepper_file *opened = file->private_data;
	struct stepper *stepper = opened->stepper;
	unsigned int i;
	u32 fade;

	if (opened->owner) {
		mutex_lock(&stepper->mutex);
		/* Motors of a plan get the same fault when there is no force any more. */
		fade = stepper_plan_let_go(stepper, INCISE_STEPPER_PLAN_LEFT);
		for (i = 0; !stepper->gone && i < stepper->n_motors; i++)
			if (!(fade & BIT(i)))
				stepper_setup_fault(&stepper->motor[i],
						    INCISE_STEPPER_FAULT_OWNER);
		stepper->owner = NULL;
		mutex_unlock(&stepper->mutex);
	}
	mutex_destroy(&opened->mutex);
	kfree(opened);
	put_device(&stepper->dev);
	return 0;
}

/* All motors, or no motor: every motor is asked first. A motor that had power before keeps it. */
static int stepper_file_enable(struct stepper *stepper, u32 mask)
{
	unsigned long given = 0;
	unsigned int i;
	int ret;

	if (stepper->closing)
		return -ESHUTDOWN;
	if (stepper_plan_leaving(stepper))
		return -EBUSY;
	for (i = 0; i < stepper->n_motors; i++) {
		if (!(mask & BIT(i)))
			continue;
		ret = stepper_setup_ready(&stepper->motor[i]);
		if (ret)
			return ret;
	}
	/* Given back by the events of motors that lose power, or never got it. */
	stepper_latency_hold(stepper);
	for (i = 0; i < stepper->n_motors; i++) {
		if (!(mask & BIT(i)))
			continue;
		ret = stepper_setup_enable(&stepper->motor[i]);
		if (ret < 0)
			goto back;
		if (ret)
			given |= BIT(i);
	}
	return 0;
back:
	for_each_set_bit(i, &given, stepper->n_motors)
		stepper_setup_disable(&stepper->motor[i]);
	stepper_event_wake(stepper);
	return ret;
}

static int stepper_file_clear(struct stepper *stepper, u32 mask)
{
	unsigned int i;
	int ret;

	for (i = 0; i < stepper->n_motors; i++) {
		ret = mask & BIT(i) ? stepper_setup_clearable(&stepper->motor[i]) : 0;
		if (ret)
			return ret;
	}
	for (i = 0; i < stepper->n_motors; i++)
		if (mask & BIT(i))
			stepper_setup_clear(&stepper->motor[i]);
	return 0;
}

static int stepper_file_mask(struct stepper *stepper, unsigned int command, u32 mask)
{
	unsigned int i;

	if (!mask || mask & ~(u32)(BIT(stepper->n_motors) - 1))
		return -EINVAL;
	switch (command) {
	case INCISE_STEPPER_ENABLE:
		return stepper_file_enable(stepper, mask);
	case INCISE_STEPPER_CLEAR:
		return stepper_file_clear(stepper, mask);
	default:
		for (i = 0; i < stepper->n_motors; i++)
			if (mask & BIT(i))
				stepper_setup_disable(&stepper->motor[i]);
		stepper_plan_disabled(stepper, mask);
		return 0;
	}
}

/* The arguments of the ioctls, one at a time. */
union stepper_argument {
	u32 mask;
	struct incise_stepper_controller info;
	struct incise_stepper_config config;
	struct incise_stepper_origin origin;
	struct incise_stepper_sync sync;
	struct incise_stepper_plan plan;
};

/* stepper.mutex held, the device there, the caller allowed to. */
static int stepper_file_command(struct stepper *stepper, unsigned int command,
				union stepper_argument *arg)
{
	unsigned int motor;
	int ret;

	stepper_plan_sweep(stepper);
	switch (command) {
	case INCISE_STEPPER_GET_INFO:
		arg->info = stepper->info;
		return 0;
	case INCISE_STEPPER_GET_CONFIG:
		motor = arg->config.motor;
		if (motor >= stepper->n_motors ||
		    memchr_inv(arg->config.reserved, 0, sizeof(arg->config.reserved)))
			return -EINVAL;
		stepper_setup_get_config(&stepper->motor[motor], &arg->config);
		return 0;
	case INCISE_STEPPER_SET_CONFIG:
		ret = stepper_page_config(&arg->config, &stepper->info);
		if (ret)
			return ret;
		return stepper_setup_config(&stepper->motor[arg->config.motor],
					    &arg->config);
	case INCISE_STEPPER_SET_POSITION:
		if (arg->origin.motor >= stepper->n_motors || arg->origin.homed > 1)
			return -EINVAL;
		return stepper_setup_position(&stepper->motor[arg->origin.motor],
					      &arg->origin);
	case INCISE_STEPPER_SET_SYNC:
		if (stepper->closing)
			return -ESHUTDOWN;
		return stepper_sync_set(stepper, &arg->sync);
	case INCISE_STEPPER_GET_SYNC:
		if (!stepper->sync.line)
			return -EOPNOTSUPP;
		stepper_sync_get(stepper, &arg->sync);
		return 0;
	default:
		return stepper_file_mask(stepper, command, arg->mask);
	}
}

static bool stepper_file_watchers(unsigned int command)
{
	return command == INCISE_STEPPER_GET_INFO ||
	       command == INCISE_STEPPER_GET_CONFIG ||
	       command == INCISE_STEPPER_GET_SYNC || command == INCISE_STEPPER_DISABLE;
}

static bool stepper_file_known(unsigned int command)
{
	switch (command) {
	case INCISE_STEPPER_GET_INFO:
	case INCISE_STEPPER_GET_CONFIG:
	case INCISE_STEPPER_SET_CONFIG:
	case INCISE_STEPPER_ENABLE:
	case INCISE_STEPPER_DISABLE:
	case INCISE_STEPPER_CLEAR:
	case INCISE_STEPPER_SET_POSITION:
	case INCISE_STEPPER_SET_SYNC:
	case INCISE_STEPPER_GET_SYNC:
	case INCISE_STEPPER_LOAD_PLAN:
		return true;
	default:
		return false;
	}
}

/* One load at a time: each holds as much memory as its plan is long. */
static int stepper_file_load(struct stepper *stepper,
			     const struct incise_stepper_plan *load)
{
	struct stepper_plan *plan = NULL;
	int ret;

	if (!mutex_trylock(&stepper->loading))
		return -EBUSY;
	ret = stepper_plan_make(stepper, load, &plan);
	if (!ret) {
		mutex_lock(&stepper->mutex);
		ret = -ENODEV;
		if (!stepper->gone) {
			stepper_plan_sweep(stepper);
			ret = stepper_plan_install(stepper, load, &plan);
		}
		mutex_unlock(&stepper->mutex);
		stepper_plan_free(plan);
	}
	mutex_unlock(&stepper->loading);
	return ret;
}

static long stepper_file_ioctl(struct file *file, unsigned int command, unsigned long to)
{
	struct stepper_file *opened = file->private_data;
	struct stepper *stepper = opened->stepper;
	void __user *user = (void __user *)to;
	union stepper_argument arg;
	int ret;

	if (!stepper_file_known(command))
		return -ENOTTY;
	/* A watcher gets that error before its arguments are checked. */
	if (!opened->owner && !stepper_file_watchers(command))
		return -EPERM;
	memset(&arg, 0, sizeof(arg));
	if (_IOC_DIR(command) & _IOC_WRITE &&
	    copy_from_user(&arg, user, _IOC_SIZE(command)))
		return -EFAULT;

	if (command == INCISE_STEPPER_LOAD_PLAN)
		return stepper_file_load(stepper, &arg.plan);
	mutex_lock(&stepper->mutex);
	ret = stepper->gone ? -ENODEV : stepper_file_command(stepper, command, &arg);
	mutex_unlock(&stepper->mutex);
	if (ret)
		return ret;
	if (_IOC_DIR(command) & _IOC_READ && copy_to_user(user, &arg, _IOC_SIZE(command)))
		return -EFAULT;
	return 0;
}

static int stepper_file_mmap(struct file *file, struct vm_area_struct *vma)
{
	struct stepper_file *opened = file->private_data;
	struct stepper *stepper = opened->stepper;
	void *page;

	/* No mutex: see above. After unbind a new mapping would only be of no use. */
	if (READ_ONCE(stepper->gone))
		return -ENODEV;
	/* If the file is open for reading only, the kernel has taken VM_SHARED away already. */
	if (vma->vm_end - vma->vm_start != PAGE_SIZE || !(vma->vm_flags & VM_MAYSHARE))
		return -EINVAL;
	if (vma->vm_flags & VM_EXEC)
		return -EACCES;
	switch (vma->vm_pgoff) {
	case INCISE_STEPPER_PAGE_SETPOINTS:
		if (!opened->owner)
			return -EPERM;
		page = stepper->setpoints;
		break;
	case INCISE_STEPPER_PAGE_STATUS:
		if (vma->vm_flags & VM_WRITE)
			return -EACCES;
		vm_flags_clear(vma, VM_MAYWRITE);
		page = stepper->status;
		break;
	default:
		return -EINVAL;
	}
	vm_flags_clear(vma, VM_MAYEXEC);
	/*
	 * By its frame, which the last owner cannot pin to write on when another owner
	 * has come. The mapping holds the file and the file holds the memory, whatever
	 * becomes of the device.
	 */
	return remap_pfn_range(vma, vma->vm_start, virt_to_phys(page) >> PAGE_SHIFT,
			       PAGE_SIZE, vma->vm_page_prot);
}

static bool stepper_file_has(struct stepper *stepper, const struct stepper_file *opened)
{
	return READ_ONCE(stepper->gone) ||
	       stepper_event_last(stepper) != READ_ONCE(opened->after);
}

/* As many events as there are and fit; opened->mutex held. */
static ssize_t stepper_file_take(struct stepper_file *opened, char __user *to,
				 size_t wanted)
{
	struct incise_stepper_event events[8];
	size_t done = 0;

	while (done < wanted) {
		u64 after = opened->after;
		unsigned int n;

		n = stepper_event_take(opened->stepper, &after, events,
				       min(wanted - done, ARRAY_SIZE(events)));
		if (!n)
			break;
		/* Keep the events that could not be handed over. */
		if (copy_to_user(to + done * sizeof(*events), events,
				 n * sizeof(*events)))
			return done ? done * sizeof(*events) : -EFAULT;
		WRITE_ONCE(opened->after, after);
		done += n;
	}
	return done * sizeof(*events);
}

static ssize_t stepper_file_read(struct file *file, char __user *to, size_t size,
				 loff_t *offset)
{
	struct stepper_file *opened = file->private_data;
	struct stepper *stepper = opened->stepper;
	size_t wanted = size / sizeof(struct incise_stepper_event);
	ssize_t ret;

	if (!wanted)
		return -EINVAL;
	for (;;) {
		ret = mutex_lock_interruptible(&opened->mutex);
		if (ret)
			return ret;
		ret = stepper_file_take(opened, to, wanted);
		mutex_unlock(&opened->mutex);
		if (ret)
			return ret;
		/* Its last events, of the unbind say, could still be read. */
		if (READ_ONCE(stepper->gone))
			return -ENODEV;
		if (file->f_flags & O_NONBLOCK)
			return -EAGAIN;
		ret = wait_event_interruptible(stepper->wait,
					       stepper_file_has(stepper, opened));
		if (ret)
			return ret;
	}
}

static __poll_t stepper_file_poll(struct file *file, poll_table *table)
{
	struct stepper_file *opened = file->private_data;
	struct stepper *stepper = opened->stepper;
	__poll_t mask = 0;

	poll_wait(file, &stepper->wait, table);
	if (stepper_event_last(stepper) != READ_ONCE(opened->after))
		mask |= EPOLLIN | EPOLLRDNORM;
	if (READ_ONCE(stepper->gone))
		mask |= EPOLLHUP | EPOLLERR;
	return mask;
}

const struct file_operations stepper_file_operations = {
	.owner = THIS_MODULE,
	.open = stepper_file_open,
	.release = stepper_file_release,
	.unlocked_ioctl = stepper_file_ioctl,
	.compat_ioctl = compat_ptr_ioctl,
	.mmap = stepper_file_mmap,
	.read = stepper_file_read,
	.poll = stepper_file_poll,
};
