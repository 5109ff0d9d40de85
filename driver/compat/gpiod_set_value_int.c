// SPDX-License-Identifier: GPL-2.0-only
/* 6.15: gpiod_set_value() returns an error. */
#include <linux/gpio/consumer.h>

int probe(struct gpio_desc *desc);

int probe(struct gpio_desc *desc)
{
#ifdef NEW
	return gpiod_set_value(desc, 1);
#else
	gpiod_set_value(desc, 1);
	return 0;
#endif
}
