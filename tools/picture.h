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

#endif
