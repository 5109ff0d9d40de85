// SPDX-License-Identifier: GPL-2.0-only
/* 6.11: platform_driver.remove returns nothing. */
#include <linux/platform_device.h>

#ifdef NEW
#define WANTED void
#else
#define WANTED int
#endif

static_assert(__builtin_types_compatible_p(typeof(((struct platform_driver *)0)->remove),
					   WANTED (*)(struct platform_device *)));
