/* SPDX-License-Identifier: GPL-2.0-only */
/*
 * One interface on kernels 6.1 and later. Sources are written for the newest
 * kernel; where an older one differs, its form is bridged here, by the results of
 * compat/NAME.c on the headers at hand (distributions bring changes back to old kernels,
 * so that a version number says little).
 *
 * A callback whose type changed is wrapped:
 *
 *	static void stepper_remove(struct platform_device *pdev) { … }
 *	COMPAT_PLATFORM_REMOVE(stepper_remove)
 *	… .remove = compat_platform_remove(stepper_remove),
 *
 *	static int chip_set(struct gpio_chip *chip, unsigned int line, int value) { … }
 *	COMPAT_GPIO_SET(chip_set)
 *	… .set = compat_gpio_set(chip_set),
 */
#ifndef INCISE_COMPAT_H
#define INCISE_COMPAT_H

#include <linux/device.h>
#include <linux/gpio/consumer.h>
#include <linux/hrtimer.h>
#include <linux/mm.h>
#include <linux/module.h>
#include <linux/platform_device.h>

#include "compat/config.h"

#ifndef HAVE_HRTIMER_SETUP
static inline void hrtimer_setup(struct hrtimer *timer,
				 enum hrtimer_restart (*tick)(struct hrtimer *),
				 clockid_t clock, enum hrtimer_mode mode)
{
	hrtimer_init(timer, clock, mode);
	timer->function = tick;
}
#endif

#ifndef HAVE_CLASS_CREATE_NAME
static inline struct class *compat_class_create(const char *name)
{
	return class_create(THIS_MODULE, name);
}

#undef class_create
#define class_create(name) compat_class_create(name)
#endif

#ifndef HAVE_VM_FLAGS_SET
static inline void vm_flags_set(struct vm_area_struct *vma, unsigned long flags)
{
	vma->vm_flags |= flags;
}

static inline void vm_flags_clear(struct vm_area_struct *vma, unsigned long flags)
{
	vma->vm_flags &= ~flags;
}
#endif

/* Good for asking whether a device that was just added found its driver. */
#ifndef HAVE_DEVICE_IS_BOUND
#define device_is_bound(dev) (!!(dev)->driver)
#endif

#ifdef HAVE_PLATFORM_REMOVE_VOID
#define COMPAT_PLATFORM_REMOVE(remove)
#define compat_platform_remove(remove) remove
#else
#define COMPAT_PLATFORM_REMOVE(remove)                           \
	static int compat_##remove(struct platform_device *pdev) \
	{                                                        \
		remove(pdev);                                    \
		return 0;                                        \
	}
#define compat_platform_remove(remove) compat_##remove
#endif

#ifdef HAVE_GPIO_CHIP_SET_INT
#define COMPAT_GPIO_SET(set)
#define compat_gpio_set(set) set
#else
#define COMPAT_GPIO_SET(set)                                                           \
	static void compat_##set(struct gpio_chip *chip, unsigned int line, int value) \
	{                                                                              \
		set(chip, line, value);                                                \
	}
#define compat_gpio_set(set) compat_##set
#endif

/* Old kernels do not say whether a line was set. */
static inline int compat_gpiod_set_value(struct gpio_desc *desc, int value)
{
#ifdef HAVE_GPIOD_SET_VALUE_INT
	return gpiod_set_value(desc, value);
#else
	gpiod_set_value(desc, value);
	return 0;
#endif
}

#endif
