// SPDX-License-Identifier: GPL-2.0-only
/* 6.2: modules may ask; exported: device_is_bound */
#include <linux/device.h>

bool probe(struct device *dev);

bool probe(struct device *dev)
{
#ifdef NEW
	return device_is_bound(dev);
#else
	return dev->driver;
#endif
}
