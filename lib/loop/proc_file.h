/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A small file of /proc or /sys: words of the kernel, which may be missing, cut off or
 * anything else.
 */
#ifndef INCISE_LOOP_PROC_FILE_H
#define INCISE_LOOP_PROC_FILE_H

#include <stdbool.h>
#include <stddef.h>

/*
 * The first @size - 1 bytes of the file @root@path as a string, without blanks at its end; what
 * is no printable character but a newline or a tab is '?'. Returns its length, or a negative
 * errno with an empty string. Allocates nothing.
 */
int proc_file_read(const char *root, const char *path, char *text, size_t size);

/* A whole number and nothing else. */
bool proc_file_integer(const char *text, long long *value);

/* Whether a list of CPUs as "0-2,5" has this one; of anything else: no. */
bool proc_file_lists(const char *list, int cpu);

#endif
