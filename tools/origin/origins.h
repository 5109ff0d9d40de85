/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The files that a file was made of, as it says itself: see incise/origin.h. Every failure ends the
 * program unless it says otherwise.
 */
#ifndef INCISE_ORIGINS_H
#define INCISE_ORIGINS_H

#include <stdbool.h>
#include <stdio.h>
#include <incise/origin.h>

#define ORIGINS_MAX 4096

/* In the order of the file; each one is followed by those of a larger depth that it was made of. */
struct origins {
	struct incise_origin *all;
	int n;
	bool cut; /* there were more than ORIGINS_MAX */
};

/* Add those that a regular file carries; another one carries none. Returns 0 or -errno. */
int origins_read(struct origins *origins, const char *path, struct incise_error *err);

/*
 * Add a file, or a recording, as the one that something is made of, and below it those that it
 * carries. A recording is of its present commit; the members of a joined one are added each. Of
 * format 1 to 3, which have no head, nothing is added.
 */
void origins_add(struct origins *origins, const char *path);

/* Write their tokens, each between @before and @after. */
void origins_write(const struct origins *origins, FILE *out, const char *before,
		   const char *after);

void origins_end(struct origins *origins);

/*
 * Copy a figure and put the origins into it: as text tEXt of PNG, as metadata of SVG, or behind the
 * end of a PDF, whose end is written again. Text of another form is copied as it is.
 */
void origins_into_figure(const struct origins *origins, const char *bytes, size_t n,
			 FILE *out);

#endif
