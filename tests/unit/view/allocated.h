/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Counts the bytes that the library allocates: a test that includes this is linked with --wrap.
 */
#ifndef INCISE_TEST_ALLOCATED_H
#define INCISE_TEST_ALLOCATED_H

#include <stddef.h>

static size_t allocated;

void *__real_malloc(size_t size);
void *__wrap_malloc(size_t size)
{
	allocated += size;
	return __real_malloc(size);
}

void *__real_calloc(size_t n, size_t size);
void *__wrap_calloc(size_t n, size_t size)
{
	allocated += n * size;
	return __real_calloc(n, size);
}

#endif
