/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A file that is there whole, or not at all, and the program fails: incise/outfile.h for those
 * who have nothing else to do then.
 */
#ifndef INCISE_WHOLE_FILE_H
#define INCISE_WHOLE_FILE_H

#include <stdio.h>
#include <incise/outfile.h>

/* To be written to, until whole_file_end(). "-" is standard output. */
FILE *whole_file_begin(const char *path, struct incise_outfile **file);

/* NULL: there was none. */
void whole_file_end(struct incise_outfile *file);

#endif
