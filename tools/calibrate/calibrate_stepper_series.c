// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Points of an actuator as CSV: what --keep writes and --from reads; see calibrate_stepper.h.
 *
 *     t_s,steps,position_mm,force_N
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "calibrate_stepper.h"
#include "../cli/cli.h"
#include "../cli/file.h"

#define COLUMNS 32
#define POINTS_MAX 1000000

void stepper_series_add(struct stepper_series *series, double t_s, double position_mm,
			double force_N)
{
	if (series->n == series->room) {
		series->room = series->room ? 2 * series->room : 512;
		series->points =
			realloc(series->points, series->room * sizeof(*series->points));
		series->t_s = realloc(series->t_s, series->room * sizeof(*series->t_s));
		series->states =
			realloc(series->states, series->room * sizeof(*series->states));
		if (!series->points || !series->t_s || !series->states)
			cli_fail("no memory for %d points", series->room);
	}
	series->t_s[series->n] = t_s;
	series->states[series->n] = INCISE_CALIBRATE_STEPPER_USED;
	series->points[series->n++] =
		(struct incise_calibrate_stepper_point){position_mm, force_N};
}

void stepper_series_free(struct stepper_series *series)
{
	free(series->points);
	free(series->t_s);
	free(series->states);
	*series = (struct stepper_series){0};
}

/* Cut a line at its commas, in place; returns how many columns. */
static int cut(char *line, char **columns)
{
	int n = 0;

	line[strcspn(line, "\r\n")] = 0;
	while (n < COLUMNS) {
		columns[n] = line + strspn(line, " \t");
		n++;
		line += strcspn(line, ",");
		if (!*line)
			break;
		*line++ = 0;
	}
	for (int i = 0; i < n; i++) {
		size_t length = strlen(columns[i]);

		while (length && strchr(" \t", columns[i][length - 1]))
			columns[i][--length] = 0;
	}
	return n;
}

struct reader {
	const char *path;
	FILE *in;
	int line, columns, position, steps, force, time; /* -1: no such column */
	double mm, counted; /* largest ways, of both columns: what a step is */
	double first_mm, first_steps;
};

static void read_header(struct reader *r, char **columns)
{
	r->position = r->steps = r->force = r->time = -1;
	for (int i = 0; i < r->columns; i++) {
		int *at = !strcmp(columns[i], "position_mm") ? &r->position
			  : !strcmp(columns[i], "steps")     ? &r->steps
			  : !strcmp(columns[i], "force_N")   ? &r->force
			  : !strcmp(columns[i], "t_s")	     ? &r->time
							     : NULL;

		if (at && *at >= 0)
			cli_fail("%s:%d: two columns are called %s; name each once",
				 r->path, r->line, columns[i]);
		if (at)
			*at = i;
	}
	if (r->force < 0 || (r->position < 0 && r->steps < 0))
		cli_fail(
			"%s:%d: expected a line of names with force_N, and position_mm or "
			"steps",
			r->path, r->line);
}

static double number(const struct reader *r, char **columns, int i, const char *name)
{
	char *end;
	double value;

	if (i < 0)
		return NAN;
	value = strtod(columns[i], &end);
	if (!*columns[i] || *end || !isfinite(value))
		cli_fail("%s:%d: %s is '%.20s' and not a number", r->path, r->line, name,
			 columns[i]);
	return value;
}

static void read_point(struct reader *r, char **columns, struct stepper_series *series)
{
	double mm = number(r, columns, r->position, "position_mm");
	double steps = number(r, columns, r->steps, "steps");

	if (!series->n) {
		r->first_mm = mm;
		r->first_steps = steps;
	}
	if (fabs(steps - r->first_steps) > r->counted) {
		r->counted = fabs(steps - r->first_steps);
		r->mm = fabs(mm - r->first_mm);
	}
	if (fabs(steps - round(steps)) > 1e-3)
		cli_fail("%s:%d: steps is %.6g and no whole number; are columns swapped?",
			 r->path, r->line, steps);
	/* From the second place on that is another: all of them are to be as far apart. */
	if (r->counted > 0 && r->mm > 0 && r->position >= 0 &&
	    fabs(fabs(mm - r->first_mm) -
		 fabs(steps - r->first_steps) * r->mm / r->counted) >
		    1.5 * r->mm / r->counted + 0.01 * r->mm)
		cli_fail(
			"%s:%d: position_mm and steps do not go together; are columns swapped?",
			r->path, r->line);
	if (series->n == POINTS_MAX)
		cli_fail("%s:%d: more than %d points; take every tenth", r->path, r->line,
			 POINTS_MAX);
	/* Steps are the commanded thing: a position in mm has been rounded. */
	stepper_series_add(series, number(r, columns, r->time, "t_s"),
			   r->steps >= 0 ? steps : mm,
			   number(r, columns, r->force, "force_N"));
}

void stepper_series_read(struct stepper_series *series, const char *path, double step_mm)
{
	struct reader r = {.path = path, .in = fopen(path, "re")};
	char *line = NULL, *columns[COLUMNS];
	bool header = true;
	size_t size = 0;

	*series = (struct stepper_series){0};
	if (!r.in)
		cli_fail("%s: %s", path, strerror(errno));
	while (getline(&line, &size, r.in) >= 0) {
		int n;

		r.line++;
		if (line[strspn(line, " \t\r\n")] == 0 || *line == '#')
			continue;
		n = cut(line, columns);
		if (header) {
			r.columns = n;
			read_header(&r, columns);
			header = false;
			continue;
		}
		if (n != r.columns)
			cli_fail("%s:%d: %d columns where the first line names %d", path,
				 r.line, n, r.columns);
		read_point(&r, columns, series);
	}
	if (ferror(r.in))
		cli_fail("%s: %s", path, strerror(errno));
	fclose(r.in);
	free(line);
	if (!series->n)
		cli_fail("%s: no points in it", path);
	if (r.counted > 0 && r.position >= 0)
		series->step_mm = r.mm / r.counted;
	else
		series->step_mm = step_mm;
	if (!isnan(step_mm))
		series->step_mm = step_mm;
	if (!(series->step_mm > 0))
		cli_fail(
			"%s: how far a step goes is not in it; give --step-mm, or both columns, "
			"steps and position_mm",
			path);
	for (int i = 0; i < series->n && r.steps >= 0; i++)
		series->points[i].position_mm *= series->step_mm;
}

void stepper_series_write(const struct stepper_series *series, const char *path)
{
	struct incise_outfile *file;
	FILE *out = whole_file_begin(path, &file);

	fprintf(out, "t_s,steps,position_mm,force_N\n");
	for (int i = 0; i < series->n; i++)
		fprintf(out, "%.4f,%lld,%.9g,%.6f\n", series->t_s[i],
			llround(series->points[i].position_mm / series->step_mm),
			series->points[i].position_mm, series->points[i].force_N);
	whole_file_end(file);
}
