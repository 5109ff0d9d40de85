// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Fixed work to hold times against; see yardstick.h.
 */
#include <stdint.h>
#include "../cli/stopwatch.h"
#include "yardstick.h"

#define STEPS 8192
#define TABLE 1024
#define LINES 8192 /* of 64 bytes */
#define LINE_WORDS 8

static volatile double result;

static void chain(void)
{
	static double table[TABLE];
	uint64_t x = 88172645463325252u;
	double sum = 0;

	for (int i = 0; i < STEPS; i++) {
		x ^= x << 13;
		x ^= x >> 7;
		x ^= x << 17;
		sum = 0.75 * sum + table[x % TABLE];
		table[i % TABLE] = 1 + sum * 0x1p-8;
	}
	result = sum;
}

/* Six chains at once, of a multiplication, a sum and a load each. */
static void wide(void)
{
	static const uint32_t factor = 2891336453u;
	static uint32_t table[TABLE];
	uint32_t a = 1, b = 2, c = 3, d = 4, e = 5, f = 6, sum = 0;

	for (int i = 0; i < STEPS; i++) {
		a = a * factor + 1;
		b = b * factor + 3;
		c = c * factor + 5;
		d = d * factor + 7;
		e = e * factor + 9;
		f = f * factor + 11;
		sum += table[a % TABLE] + table[b % TABLE] + table[c % TABLE] +
		       table[d % TABLE] + table[e % TABLE] + table[f % TABLE];
	}
	table[0] = sum;
	result = sum;
}

static void memory(void)
{
	static uint32_t next[LINES * LINE_WORDS];
	uint32_t at = 0;

	/* An odd step through a power of two, mixed: a walk that comes by each line once. */
	if (!next[0])
		for (uint32_t i = 0; i < LINES; i++)
			next[i * LINE_WORDS] = (i * 5 + 4321) % LINES * LINE_WORDS;
	for (int i = 0; i < LINES; i++)
		at = next[at];
	result = at;
}

double yardstick_ns(enum yardstick yardstick)
{
	static void (*const works[YARDSTICKS])(void) = {chain, wide, memory};
	double begin;

	works[yardstick]();
	begin = stopwatch_ns();
	works[yardstick]();
	return stopwatch_ns() - begin;
}
