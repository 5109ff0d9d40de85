/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Integer types and their limits as C names them, in a kernel too: it has the types, but
 * other names for the limits.
 */
#ifndef INCISE_FX_INTEGERS_H
#define INCISE_FX_INTEGERS_H

#ifdef __KERNEL__
#include <linux/limits.h>
#include <linux/types.h>

#ifndef INT32_MAX
#define INT32_MIN S32_MIN
#define INT32_MAX S32_MAX
#define INT64_MIN S64_MIN
#define INT64_MAX S64_MAX
#endif
#else
#include <stdint.h>
#endif

#endif
