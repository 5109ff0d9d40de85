/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A picture drawn by gnuplot: a script and its data in FOLDER/plot/, the result as
 * FOLDER/NAME.png and .svg. The scripts stay, so that anyone can draw again:
 *
 *     cd FOLDER/plot && gnuplot -e "ext='png'" NAME.gp
 */
#ifndef INCISE_PICTURE_H
#define INCISE_PICTURE_H

#include <stdbool.h>
#include <stdio.h>

/*
 * Where a picture that the user named shall go: "a/b/name", perhaps with .png or .svg, as
 * folder "a/b" and "name". Makes both folders that are missing, and fails the program when
 * there is no gnuplot, or the name cannot be. Both strings live as long as the program.
 */
void picture_place(const char *option, const char *path, const char **folder,
		   const char **name);

/* Whether gnuplot is there. */
bool picture_possible(void);

/* Open FOLDER/plot/NAME for writing data; fails the program when that cannot be. */
FILE *picture_data(const char *folder, const char *name);

/* Close it; fails the program when not all of it was written. */
void picture_data_end(FILE *data, const char *folder);

/* Begin the script of a picture of width × height pixels; gnuplot commands follow. */
FILE *picture_begin(const char *folder, const char *name, int width, int height);

/* End the script and draw. Returns whether both files were made. */
bool picture_draw(FILE *script, const char *folder, const char *name);

/* One of several pictures of a name: "NAME-part", and "NAME-part.dat" for its data. */
struct picture_part {
	const char *folder;
	char *name, *data;
};

struct picture_part picture_part(const char *folder, const char *name, const char *part);

/* End its script and draw, or fail the program; the part is of no more use. */
void picture_part_draw(FILE *script, struct picture_part *part);

#endif
