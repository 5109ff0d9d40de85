// SPDX-License-Identifier: GPL-2.0-only
/* 6.11: platform_driver.remove returns nothing. */
#include <linux/platform_device.h>

#ifdef NEW
void probe(struct platform_device *pdev);
#else
int probe(struct platform_device *pdev);
#endif

static_assert(__same_type(((struct platform_driver *)0)->remove, &probe));
