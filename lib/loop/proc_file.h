/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Reads a small file of /proc or /sys, which may be missing, truncated or malformed.
 */
#ifndef INCISE_LOOP_PROC_FILE_H
#define INCISE_LOOP_PROC_FILE_H

#include <stdbool.h>
#include <stddef.h>

/*
 * The first @size - 1 bytes of the file @root@path as a string, without trailing blanks;
 * unprintable characters other than newline and tab become '?'. Returns the length, or a
 * negative errno with an empty string. Allocates nothing.
 */
int proc_file_read(const char *root, const char *path, char *text, size_t size);

/* A whole number and nothing else. */
bool proc_file_integer(const char *text, long long *value);

/* Whether a list of CPUs such as "0-2,5" has this one; a malformed list has no CPU. */
bool proc_file_lists(const char *list, int cpu);

#endif
