/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Origins in the files that commands write: see incise/origin.h. Every failure ends the program.
 */
#ifndef INCISE_ORIGINS_H
#define INCISE_ORIGINS_H

#include <stdio.h>
#include <incise/origin.h>

/* Add a file, or a recording, as the one that something is made of. */
void origins_add(struct incise_origins *origins, const char *path);

/*
 * Copy a figure and put the origins into it: as text tEXt of PNG, as metadata of SVG, or behind the
 * end of a PDF, whose end is written again. Text of another form is copied as it is.
 */
void origins_into_figure(const struct incise_origins *origins, const char *bytes,
			 size_t n, FILE *out);

#endif
