// SPDX-License-Identifier: GPL-2.0-only
/* 6.17: gpio_chip.set returns an error; the years between had set_rv beside it. */
#include <linux/gpio/driver.h>

#ifdef NEW
int probe(struct gpio_chip *chip, unsigned int line, int value);
#else
void probe(struct gpio_chip *chip, unsigned int line, int value);
#endif

static_assert(__same_type(((struct gpio_chip *)0)->set, &probe));
