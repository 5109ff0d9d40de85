// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The figure of a dataset: force over depth and over velocity, and by cut. See figure.h.
 *
 *     ┌─ force over depth ─┬─ force over velocity ─┐   each row, and mean ± SD in bins
 *     ├────────────────────┴───────────────────────┤   of raw rows; mean ± sd_N of
 *     │        force by cut: mean ± SD             │   averaged ones
 *     └────────────────────────────────────────────┘
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/dataset.h>
#include <incise/infile.h>
#include "../cli/cli.h"
#include "../cli/plot.h"
#include "figure.h"

#define HEIGHT 460 /* of a row of panels */
#define TITLE_HEIGHT 40
#define BINS 20		 /* of mean and SD */
#define BINNED_LEAST 100 /* rows; fewer show it all by themselves */
#define KEYS_MOST 8	 /* cuts with a colour and a key of their own */

/* Columns, as they are read. */
enum { FORCE, DEPTH, VELOCITY, SD, UNCERTAINTY, COLUMNS };

static const char *const names[COLUMNS] = {"force_N", "depth_mm", "velocity_mm_s", "sd_N",
					   "force_u_N"};

struct table {
	struct incise_dataset *data;
	int column[COLUMNS]; /* in a row; -1: no such column */
	double low[COLUMNS], high[COLUMNS];
	const char *group; /* "cut", "recording" or NULL */
	int n_groups;
	const char *where; /* rows in which it is 0 are left out; or NULL */
	size_t n, left_out;
};

/* Whether a header has a column. */
static bool has_dataset_column(const char *header, const char *name)
{
	size_t n = strlen(name);

	for (const char *at = header; (at = strstr(at, name)); at += n) {
		char before = at > header ? at[-1] : ',', after = at[n];

		if (strchr(",\"", before) && strchr(",\"\r", after))
			return true;
	}
	return false;
}

/* The line of names: the first that is neither empty nor a comment. */
static char *read_header(const char *path)
{
	static const struct incise_infile_kind csv = {
		.name = "a dataset",
		.advice = "give a CSV file",
	};
	struct incise_error err = {0};
	struct incise_infile *file =
		cli_require(incise_infile_open(path, &csv, &err), &err);
	char *line = NULL, *header;
	int rc;

	while ((rc = incise_infile_line(file, &line, &err)) > 0 && strchr("#\r", *line))
		;
	cli_check(rc < 0, &err);
	header = cli_text("%s", rc ? line : "");
	incise_infile_close(file);
	return header;
}

static void read_table(struct table *table, const char *path)
{
	const char *columns[COLUMNS];
	char *header = read_header(path);
	struct incise_error err = {0};
	int n = 0, last;

	for (int i = 0; i < COLUMNS; i++) {
		bool there = i < VELOCITY || has_dataset_column(header, names[i]);

		table->column[i] = there ? n : -1;
		if (there)
			columns[n++] = names[i];
	}
	/* A resampled recording is also the time between its cuts. */
	if (has_dataset_column(header, "recording") && has_dataset_column(header, "cut"))
		table->where = "cut";
	else if (has_dataset_column(header, "advancing"))
		table->where = "advancing";
	table->group = has_dataset_column(header, "cut") ? "cut" : NULL;
	last = table->column[UNCERTAINTY];
	table->data = incise_dataset_read_where(path, columns, n, table->group,
						table->where, &table->left_out, &err);
	/* An unknown uncertainty is nan, which is no number of a dataset. */
	if (!table->data && last >= 0) {
		table->column[UNCERTAINTY] = -1;
		table->data = cli_require(
			incise_dataset_read_where(path, columns, n - 1, table->group,
						  table->where, &table->left_out, &err),
			&err);
	}
	cli_require(table->data, &err);
	table->n = incise_dataset_rows(table->data);
	free(header);
}

static double value(const struct table *table, size_t row, int column)
{
	return incise_dataset_row(table->data, row)[table->column[column]];
}

static void find_ranges(struct table *table)
{
	for (int c = 0; c < COLUMNS; c++) {
		if (table->column[c] < 0)
			continue;
		table->low[c] = table->high[c] = value(table, 0, c);
		for (size_t i = 1; i < table->n; i++) {
			table->low[c] = fmin(table->low[c], value(table, i, c));
			table->high[c] = fmax(table->high[c], value(table, i, c));
		}
	}
	for (size_t i = 0; i < table->n && table->group; i++)
		table->n_groups = (int)fmax(table->n_groups,
					    incise_dataset_group(table->data, i) + 1);
}

/* 0: not known. */
static double uncertainty(const struct table *table, size_t row)
{
	return table->column[UNCERTAINTY] < 0 ? 0 : value(table, row, UNCERTAINTY);
}

/* Columns x, force, its SD or 0, the cut from 1, its uncertainty or 0; as many as there are places in each cut. */
static void write_rows(const struct table *table, int over, const char *folder,
		       const char *name)
{
	const double low[] = {table->low[over], table->low[FORCE]};
	const double high[] = {table->high[over], table->high[FORCE]};
	int n = table->n_groups ? table->n_groups : 1;
	struct scatter *scatter = cli_alloc((size_t)n, sizeof(*scatter));
	FILE *data = plot_data(folder, name);

	for (int k = 0; k < n; k++)
		scatter_begin(&scatter[k], low, high);
	for (size_t i = 0; i < table->n; i++) {
		int k = table->group ? incise_dataset_group(table->data, i) : 0;
		double x = value(table, i, over), force = value(table, i, FORCE);

		if (scatter_takes(&scatter[k], x, force))
			fprintf(data, "%.6g %.6g %.6g %d %.6g\n", x, force,
				table->column[SD] < 0 ? 0 : value(table, i, SD), k + 1,
				uncertainty(table, i));
	}
	for (int k = 0; k < n; k++)
		scatter_end(&scatter[k]);
	free(scatter);
	plot_data_end(data, folder);
}

/* Mean and SD of the added values. */
struct moments {
	double n, mean, m2;
};

static void add_dataset(struct moments *m, double x)
{
	double d = x - m->mean;

	m->n++;
	m->mean += d / m->n;
	m->m2 += d * (x - m->mean);
}

static double sd(const struct moments *m)
{
	return m->n > 1 ? sqrt(m->m2 / (m->n - 1)) : 0;
}

static void write_bins(const struct table *table, int over, const char *folder,
		       const char *name)
{
	double low = table->low[over], width = (table->high[over] - low) / BINS;
	struct moments bin[BINS] = {{0}}, at[BINS] = {{0}}, u[BINS] = {{0}};
	FILE *data = plot_data(folder, name);

	for (size_t i = 0; i < table->n; i++) {
		double x = value(table, i, over), place = (x - low) / width;
		/* Also where all rows have one value. */
		int k = place > 0 ? (int)fmin(place, BINS - 1) : 0;

		add_dataset(&bin[k], value(table, i, FORCE));
		add_dataset(&at[k], x);
		add_dataset(&u[k], uncertainty(table, i));
	}
	for (int k = 0; k < BINS; k++)
		if (bin[k].n)
			fprintf(data, "%.6g %.6g %.6g %.6g\n", at[k].mean, bin[k].mean,
				sd(&bin[k]), u[k].mean);
	plot_data_end(data, folder);
}

static void write_cuts(const struct table *table, const char *folder, const char *name)
{
	struct moments *cut = cli_alloc((size_t)table->n_groups, sizeof(*cut));
	FILE *data = plot_data(folder, name);

	for (size_t i = 0; i < table->n; i++)
		add_dataset(&cut[incise_dataset_group(table->data, i)],
			    value(table, i, FORCE));
	for (int k = 0; k < table->n_groups; k++)
		fprintf(data, "%d %.6g %.6g\n", k + 1, cut[k].mean, sd(&cut[k]));
	free(cut);
	plot_data_end(data, folder);
}

/* Force over one column; averaged rows have an SD of their own. */
static void put_panel(FILE *script, const struct table *table, int over, const char *rows,
		      const char *bins)
{
	bool averaged = table->column[SD] >= 0;
	bool stated = table->column[UNCERTAINTY] >= 0;
	int n = table->n_groups;

	fputs("set xlabel ", script);
	plot_put_label(script, names[over]);
	fputs("\nset ylabel 'force / N'\nplot ", script);
	/* For single values; common parts do not average out. */
	if (stated && bins)
		fprintf(script,
			"'%s' using 1:($2-1.96*$4):($2+1.96*$4) with filledcurves lc rgb "
			"blue fs transparent solid 0.25 noborder title '95 %% by the "
			"uncertainty', \\\n  ",
			bins);
	else if (stated)
		fprintf(script,
			"'%s' using 1:2:(1.96*$5) with yerrorbars lc rgb blue pt 0 title "
			"'95 %% by the uncertainty', \\\n  ",
			rows);
	if (averaged)
		fprintf(script,
			"'%s' using 1:2:3 with yerrorbars lc rgb grey pt 0 title "
			"'SD in the bin', \\\n  ",
			rows);
	if (n > 1 && n <= KEYS_MOST)
		fprintf(script,
			"for [k=1:%d] '%s' using 1:($4==k?$2:NaN) with points lt k pt 7 ps "
			"0.4 title sprintf('cut %%d', k)",
			n, rows);
	else
		fprintf(script,
			"'%s' using 1:2%s with points pt 7 ps 0.4 %s title 'rows'", rows,
			n > 1 ? ":4" : "", n > 1 ? "palette" : "lc rgb blue");
	if (bins)
		fprintf(script,
			", \\\n  '%s' using 1:2:3 with yerrorbars lc rgb ink pt 7 lw 1.5 "
			"title 'mean and SD'",
			bins);
	fputc('\n', script);
}

/* An upper panel, with its data. */
static void put_upper(FILE *script, const struct table *table, int over,
		      const struct figure *figure)
{
	char *rows = cli_text("%s.dat", names[over]), *bins = NULL;

	write_rows(table, over, figure->folder, rows);
	if (table->column[SD] < 0 && table->n >= BINNED_LEAST) {
		bins = cli_text("%s-bins.dat", names[over]);
		write_bins(table, over, figure->folder, bins);
	}
	put_panel(script, table, over, rows, bins);
	free(rows), free(bins);
}

static void put_title(FILE *script, const struct table *table, const char *path)
{
	fputs("set multiplot title ", script);
	plot_put_text(script, path);
	fprintf(script, ".': %s", cli_count(table->n, "row"));
	if (table->left_out)
		fprintf(script, " and %zu left out, %s", table->left_out,
			!strcmp(table->where, "cut")
				? "outside cuts"
				: "where the blade does not advance");
	fputs("'\n", script);
}

FILE *figure_of_dataset(const struct figure *figure)
{
	struct table table = {0};
	double height;
	bool velocity;
	int rows;
	FILE *script;

	read_table(&table, figure->path);
	find_ranges(&table);
	velocity = table.column[VELOCITY] >= 0;
	rows = table.n_groups > 1 ? 2 : 1;
	height = (double)HEIGHT / (rows * HEIGHT + TITLE_HEIGHT);
	script = plot_begin(figure->folder, figure->name, FIGURE_WIDTH,
			    rows * HEIGHT + TITLE_HEIGHT);
	put_title(script, &table, figure->path);
	fprintf(script,
		"set key outside bottom center horizontal width 2\nset cblabel 'cut'\n"
		"set palette maxcolors %d\nset cbrange [0.5:%d.5]\nset size %g,%g\n"
		"set origin 0,%g\n",
		table.n_groups > 1 ? table.n_groups : 2,
		table.n_groups > 1 ? table.n_groups : 2, velocity ? 0.5 : 1.0, height,
		(rows - 1) * height);
	put_upper(script, &table, DEPTH, figure);
	if (velocity) {
		fprintf(script, "set origin 0.5,%g\n", (rows - 1) * height);
		put_upper(script, &table, VELOCITY, figure);
	}
	if (rows > 1) {
		write_cuts(&table, figure->folder, "cuts.dat");
		fprintf(script,
			"set size 1,%g\nset origin 0,0\nset xlabel 'cut'\nset xtics %d\n"
			"set xrange [0.5:%d.5]\nset yrange [0:*]\nset boxwidth 0.6\n"
			"plot 'cuts.dat' using 1:2 with boxes fs solid 0.3 lt 1 title 'mean', "
			"'' using 1:2:3 with yerrorbars lc rgb ink pt 0 title 'SD'\n",
			height, 1 + table.n_groups / 30, table.n_groups);
	}
	fputs("unset multiplot\n", script);
	incise_dataset_free(table.data);
	return script;
}
