/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Output of a program for tests/vm/suite: "ok FACT" or "not ok FACT", a line per fact,
 * and lines with # for a person.
 */
#ifndef INCISE_VM_TAP_H
#define INCISE_VM_TAP_H

#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>

static int tap_failures;

/* Returns @good, so that a test can stop where going on makes no sense. */
__attribute__((format(printf, 2, 3))) static inline bool check(bool good,
							       const char *fact, ...)
{
	va_list rest;

	va_start(rest, fact);
	fputs(good ? "ok " : "not ok ", stdout);
	vprintf(fact, rest);
	putchar('\n');
	va_end(rest);
	fflush(stdout);
	tap_failures += !good;
	return good;
}

__attribute__((format(printf, 1, 2))) static inline void note(const char *text, ...)
{
	va_list rest;

	va_start(rest, text);
	fputs("# ", stdout);
	vprintf(text, rest);
	putchar('\n');
	va_end(rest);
	fflush(stdout);
}

#endif
