/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A plot by gnuplot: script and data in FOLDER/plot/, the result as FOLDER/NAME.png and
 * .svg. The script stays, so that anyone can draw the plot again, also as .pdf:
 *
 *     cd FOLDER/plot && gnuplot -e "ext='png'" NAME.gp
 *
 * FOLDER/plot/style.gp, which each script loads, is the text of tools/cli/style.gp: colours,
 * markers, fonts, number formats and the key of every figure. A script names a colour or takes
 * a line type 1 to 8 of it, and holds none of its own.
 */
#ifndef INCISE_PLOT_H
#define INCISE_PLOT_H

#include <stdbool.h>
#include <stdio.h>
#include <incise/origin.h>

/*
 * Split the argument of @option, "a/b/name", perhaps with .png or .svg, into folder "a/b" and
 * "name", and make missing folders. Fails the program without gnuplot, or at a name that a
 * script cannot hold. Both strings live as long as the program.
 */
void plot_place(const char *option, const char *path, const char **folder,
		const char **name);

/* Note the plot's files with cli_output(), before the work whose result it shows. */
void plot_reserve(const char *folder, const char *name);

/* Make FOLDER/plot and missing folders; fails the program without gnuplot. */
void plot_folder(const char *folder);

/* Whether gnuplot is installed. */
bool plot_possible(void);

/* Fails the program if it is not. */
void plot_require(void);

/* Open FOLDER/plot/NAME for writing data; fails the program on an error. */
FILE *plot_data(const char *folder, const char *name);

/* Close it; fails the program when not all of it was written. */
void plot_data_end(FILE *data, const char *folder);

/* Open the script of a plot of width × height pixels of 1/96 inch; gnuplot commands follow. */
FILE *plot_begin(const char *folder, const char *name, int width, int height);

/*
 * Add an element to a plot command: "plot" before the first one, a comma before the others;
 * *n counts them. A command leaves out an element without data, and so its legend.
 */
__attribute__((format(printf, 3, 4))) void plot_add(FILE *script, int *n,
						    const char *format, ...);

/* Close the script and draw. Returns whether both files were made. */
bool plot_draw(FILE *script, const char *folder, const char *name);

/* The same; fails the program if they were not. */
void plot_draw_or_fail(FILE *script, const char *folder, const char *name);

/* A terminal of this gnuplot that opens a window here, or NULL. */
const char *plot_window(void);

/*
 * Close the script and draw one form: "png", "svg" or "pdf" as the file @path, which appears whole
 * and carries its origins, or in a window, until that is closed. Fails the program.
 */
void plot_draw_form(FILE *script, const char *folder, const char *name, const char *form,
		    const char *path, const struct incise_origins *origins);

/*
 * Write a text, which may hold anything, as a string of a script, or in data. What a string or an
 * SVG cannot hold becomes a space; of a longer one than @most characters there is the beginning.
 */
void plot_put_quoted(FILE *out, const char *text, int most, char quote);

/* The same in a script, of 60 characters at most. */
void plot_put_text(FILE *script, const char *text);

/* The unit in a name such as velocity_mm_s, "mm/s", and the length of the name before it; "": none. */
const char *plot_unit_of(const char *name, size_t *n);

/* Write the name of a quantity as the title of an axis: 'depth / mm' of depth_mm. */
void plot_put_label(FILE *script, const char *name);

#endif
