// SPDX-License-Identifier: GPL-2.0-only
/* 6.17: gpio_chip.set returns an error; the years between had set_rv beside it. */
#include <linux/gpio/driver.h>

#ifdef NEW
#define WANTED int
#else
#define WANTED void
#endif

static_assert(__builtin_types_compatible_p(typeof(((struct gpio_chip *)0)->set),
					   WANTED (*)(struct gpio_chip *, unsigned int,
						      int)));
