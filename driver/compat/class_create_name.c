// SPDX-License-Identifier: GPL-2.0-only
/* 6.4: class_create() takes the name only. */
#include <linux/device.h>
#include <linux/module.h>

struct class *probe(void);

struct class *probe(void)
{
#ifdef NEW
	return class_create("incise");
#else
	return class_create(THIS_MODULE, "incise");
#endif
}
