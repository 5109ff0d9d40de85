/* SPDX-License-Identifier: LGPL-2.1-or-later OR GPL-2.0-only */
/*
 * Divisions of 64 bits under the kernel's names: on a processor of 32 bits a kernel has no
 * other, and user space needs none.
 */
#ifndef INCISE_DIVISION_H
#define INCISE_DIVISION_H

#ifdef __KERNEL__
#include <linux/math64.h>
#else
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
