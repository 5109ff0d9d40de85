// SPDX-License-Identifier: GPL-2.0-only
/*
 * A module with one mistake of each kind that the debug kernel is there to find. It is the
 * control of `make check-vm-debug`: a kernel that says nothing about these proves nothing
 * about our modules.
 *
 *   insmod broken.ko fault=locks|free|sleep|leak
 */
#include <linux/delay.h>
#include <linux/hrtimer.h>
#include <linux/module.h>
#include <linux/slab.h>
#include <linux/spinlock.h>
#include <linux/string.h>

static char *fault = "";
module_param(fault, charp, 0);
MODULE_PARM_DESC(fault, "locks, free, sleep or leak");

static DEFINE_RAW_SPINLOCK(first);
static DEFINE_RAW_SPINLOCK(second);
static DEFINE_SPINLOCK(sleeping);
static struct hrtimer timer;

/* Two locks in both orders: nothing hangs here, and one day it would. */
static void mix_locks(void)
{
	raw_spin_lock(&first);
	raw_spin_lock(&second);
	raw_spin_unlock(&second);
	raw_spin_unlock(&first);

	raw_spin_lock(&second);
	raw_spin_lock(&first);
	raw_spin_unlock(&first);
	raw_spin_unlock(&second);
}

static void use_after_free(void)
{
	char *bytes = kmalloc(64, GFP_KERNEL);

	kfree(bytes);
	if (bytes)
		WRITE_ONCE(bytes[5], 1);
}

/* A spinlock_t sleeps on PREEMPT_RT, which a hard timer must not. */
static enum hrtimer_restart sleep_in_timer(struct hrtimer *t)
{
	spin_lock(&sleeping);
	spin_unlock(&sleeping);
	return HRTIMER_NORESTART;
}

static void start_timer(void)
{
	hrtimer_init(&timer, CLOCK_MONOTONIC, HRTIMER_MODE_REL_HARD);
	timer.function = sleep_in_timer;
	hrtimer_start(&timer, ms_to_ktime(1), HRTIMER_MODE_REL_HARD);
	msleep(20);
	hrtimer_cancel(&timer);
}

static void leak(void)
{
	void *lost = kmalloc(4321, GFP_KERNEL);

	/* A use that the compiler cannot see through, or it would drop the allocation. */
	OPTIMIZER_HIDE_VAR(lost);
}

static int __init broken_init(void)
{
	if (!strcmp(fault, "locks"))
		mix_locks();
	else if (!strcmp(fault, "free"))
		use_after_free();
	else if (!strcmp(fault, "sleep"))
		start_timer();
	else if (!strcmp(fault, "leak"))
		leak();
	else
		return -EINVAL;
	return 0;
}

static void __exit broken_exit(void)
{
}

module_init(broken_init);
module_exit(broken_exit);
MODULE_DESCRIPTION("mistakes that a debug kernel must find");
MODULE_LICENSE("GPL");
