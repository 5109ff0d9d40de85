/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Physics in double and in integers by the same cases: a file has a `struct kind` of functions that take
 * and give doubles (mm, N), one for each kind of numbers, `kinds` of them, and `kind`, the one at work.
 */
#ifndef TEST_KINDS_H
#define TEST_KINDS_H

#include <math.h>
#include <stdint.h>

#define ONE 65536.0	  /* of a length or a force */
#define UNIT 1073741824.0 /* of a direction */

#define EACH_KIND \
	for (kind = kinds; kind < kinds + sizeof(kinds) / sizeof(*kinds); kind++)

/* A TEST() of a function that runs on the kind at work. */
#define TEST_KINDS(name, ...)             \
	static void name##_of_kind(void); \
	TEST(name, ##__VA_ARGS__)         \
	{                                 \
		EACH_KIND                 \
		name##_of_kind();         \
	}                                 \
	static void name##_of_kind(void)

static inline int32_t q16(double x)
{
	return (int32_t)lrint(x * ONE);
}

static inline int32_t q30(double x)
{
	return (int32_t)lrint(x * UNIT);
}

static inline void q16_all(int32_t to[3], const double from[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = q16(from[i]);
}

static inline void q30_all(int32_t to[3], const double from[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = q30(from[i]);
}

static inline void from_q16(double to[3], const int32_t from[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = from[i] / ONE;
}

static inline void from_q30(double to[3], const int32_t from[3])
{
	for (int i = 0; i < 3; i++)
		to[i] = from[i] / UNIT;
}

#endif
