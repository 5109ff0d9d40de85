/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Files of commands: output files that appear whole or not at all, and files in memory.
 * Every failure ends the program.
 */
#ifndef INCISE_FILE_H
#define INCISE_FILE_H

#include <stdio.h>
#include <incise/outfile.h>

/*
 * Open a file for writing, as cli_output() allows it; it gets its name at whole_file_end(). "-"
 * is standard output.
 */
FILE *whole_file_begin(const char *path, struct incise_outfile **file);

/* @file NULL: does nothing. */
void whole_file_end(struct incise_outfile *file);

/*
 * A file in memory, gone with the program, with a path like any other: a bench's own scene is
 * read as a user's is, and another program can write its report there.
 */
struct memory_file {
	FILE *file;
	char path[32]; /* valid in this process and in those that it starts */
};

/* An empty one; close with fclose(). */
struct memory_file memory_file_begin(const char *name);

/* Flush it, so that it can be read by its path. */
void memory_file_written(const struct memory_file *file);

#endif
