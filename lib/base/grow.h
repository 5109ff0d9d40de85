/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Arrays that grow, by doubling.
 */
#ifndef INCISE_BASE_GROW_H
#define INCISE_BASE_GROW_H

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/*
 * Room in *@array, a pointer of any type, for one more behind @n elements of @size bytes; the first
 * room is @first. False: no memory, and nothing has changed.
 */
static inline bool grow_array(void *array, size_t n, size_t *capacity, size_t first,
			      size_t size)
{
	size_t wanted = *capacity ? 2 * *capacity : first;
	void *elements;

	if (n < *capacity)
		return true;
	memcpy(&elements, array, sizeof(elements));
	elements = reallocarray(elements, wanted, size);
	if (!elements)
		return false;
	memcpy(array, &elements, sizeof(elements));
	*capacity = wanted;
	return true;
}

#endif
