/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Integer types, their limits as C names them, error numbers, and divisions of 64 bits as a kernel names
 * them: a kernel has the types, other names for the limits, and on a processor of 32 bits no
 * other divisions.
 */
#ifndef INCISE_FX_INTEGERS_H
#define INCISE_FX_INTEGERS_H

#ifdef __KERNEL__
#include <linux/errno.h>
#include <linux/limits.h>
#include <linux/math64.h>
#include <linux/types.h>

#ifndef INT32_MAX
#define INT32_MIN S32_MIN
#define INT32_MAX S32_MAX
#define INT64_MIN S64_MIN
#define INT64_MAX S64_MAX
#endif
#else
#include <errno.h>
#include <stdbool.h>
#include <stdint.h>

static inline uint64_t div_u64(uint64_t dividend, uint32_t divisor)
{
	return dividend / divisor;
}

static inline uint64_t div64_u64(uint64_t dividend, uint64_t divisor)
{
	return dividend / divisor;
}

static inline int64_t div64_s64(int64_t dividend, int64_t divisor)
{
	return dividend / divisor;
}

static inline uint64_t div_u64_rem(uint64_t dividend, uint32_t divisor, uint32_t *rest)
{
	*rest = (uint32_t)(dividend % divisor);
	return dividend / divisor;
}
#endif

#endif
