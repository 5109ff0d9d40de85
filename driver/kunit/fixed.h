/* SPDX-License-Identifier: GPL-2.0-only */
/* Cases of fixed.c. */
#ifndef INCISE_DRIVER_KUNIT_FIXED_H
#define INCISE_DRIVER_KUNIT_FIXED_H

#include "kunit.h"

void fixed_bits(struct kunit *test);
void fixed_damage(struct kunit *test);

#endif
