/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A file in memory, gone with the program, that has a path like any other: a bench's own
 * scenes are read as a user's would be, and another program's report is taken.
 */
#ifndef INCISE_MEMORY_FILE_H
#define INCISE_MEMORY_FILE_H

#include <stdio.h>

struct memory_file {
	FILE *file;
	char path[32]; /* valid in this process and in those that it starts */
};

/* Make an empty one; fails the program when that cannot be. Close with fclose(). */
struct memory_file memory_file_begin(const char *name);

/* All that was written can be read by its path from now on. */
void memory_file_written(const struct memory_file *file);

#endif
