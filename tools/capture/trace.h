/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A trace of a quantity over the last seconds, in characters: each holds 2 x 4 dots of braille,
 * or without braille 1 x 2 levels. It keeps the least and the largest value of each column of
 * dots.
 *
 *      2 N|⠀⠀⢀⡴⠞⠉⠙⠲⣄⠀⠀
 *         |⠀⡴⠋⠀⠀⠀⠀⠀⠀⠳⣄
 *        0|⡜⠁⠀⠀⠀⠀⠀⠀⠀⠀⠈
 *                     ╰ now
 */
#ifndef INCISE_CAPTURE_TRACE_H
#define INCISE_CAPTURE_TRACE_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#define TRACE_DOTS 160	   /* columns of dots that are kept */
#define TRACE_COLUMN_S 0.1 /* time of one */
#define TRACE_LABEL 9	   /* characters to the left of the dots */

struct trace {
	const char *unit;
	double least;	/* range of the axis at least */
	int64_t newest; /* number of the newest column, if there is one */
	int n;
	struct trace_column {
		double low, high, last; /* NAN: no value */
	} column[TRACE_DOTS];		/* number k at k modulo TRACE_DOTS */
};

/* Empty it. */
void trace_begin(struct trace *trace, const char *unit, double least);

/* Add a value, which may be NAN; a time before that of the newest column empties the trace first. */
void trace_add(struct trace *trace, double t_s, double value);

/* Seconds that a width in characters shows. */
double trace_span_s(int width);

/* Write @height lines of at most @width characters, each with a newline in front. */
void trace_put(const struct trace *trace, int width, int height, bool braille, FILE *out);

#endif
