// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise plot FILE: draws a file of incise, whose kind is recognized by its content, into a PNG or
 * SVG file or a window.
 */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include "cli/cli.h"
#include "cli/folder.h"
#include "cli/plot.h"
#include "plot/figure.h"

struct job {
	struct figure figure;
	const char *output; /* NULL: a window */
};

static const struct cli_option options[] = {
	{'o', "output", "FILE",
	 "the file to write: NAME.png or NAME.svg (default: a window)",
	 CLI_OUTPUT(struct job, output)},
	{0, "data", "DATA.csv", "of a model: also draw the residuals of this dataset",
	 CLI_INPUT(struct job, figure.data)},
	{0},
};

static const struct cli_command command = {
	.name = "plot",
	.synopsis = "FILE [-o NAME.png|NAME.svg] [OPTIONS]",
	.summary =
		"Draw a model (.fis, .fx) or a dataset (.csv). The kind of the file is recognized\n"
		"by its content.",
	.options = options,
	.notes = "Example:\n  incise plot liver.fis --data pairs.csv -o liver.png\n\n"
		 "Exit: 0 drawn, 1 failed, 2 bad usage. See incise-plot(1).",
};

/* --- kinds of files -------------------------------------------------------------------- */

#define HEAD_MOST 4096

struct kind {
	const char *name;
	bool (*is)(const char *head, size_t n);
	FILE *(*draw)(const struct figure *figure);
	bool data; /* takes --data */
};

static bool is_compiled(const char *head, size_t n)
{
	return n >= 8 && !memcmp(head, "INCISEFX", 8);
}

static bool is_model(const char *head, size_t n)
{
	const char *system = strstr(head, "[System]");

	(void)n;
	return system && (system == head || system[-1] == '\n');
}

static int commas(const char *line)
{
	int n = 0;

	for (; *line && *line != '\n'; line++)
		n += *line == ',';
	return n;
}

/* Below comments a line of names, and one of as many fields. */
static bool is_dataset(const char *head, size_t n)
{
	const char *line = head, *next;

	while (*line == '#' || *line == '\n' || *line == '\r')
		line += strcspn(line, "\n") + (line[strcspn(line, "\n")] == '\n');
	next = line + strcspn(line, "\n");
	return n == strlen(head) &&
	       isalpha((unsigned char)(*line == '"' ? line[1] : *line)) && commas(line) &&
	       *next && commas(next + 1) == commas(line);
}

static const struct kind kinds[] = {
	{"a compiled model", is_compiled, figure_of_compiled, true},
	{"a model", is_model, figure_of_model, true},
	{"a dataset", is_dataset, figure_of_dataset, false},
};

static const struct kind *kind_of(const char *path)
{
	char head[HEAD_MOST + 1];
	struct stat st;
	FILE *file;
	size_t n;

	if (stat(path, &st))
		cli_fail("%s: %s; give a model or a dataset", path, strerror(errno));
	file = S_ISREG(st.st_mode) ? fopen(path, "re") : NULL;
	if (!file)
		cli_fail("%s: %s; give a model or a dataset", path,
			 S_ISREG(st.st_mode) ? strerror(errno) : "is no regular file");
	n = fread(head, 1, HEAD_MOST, file);
	fclose(file);
	head[n] = 0;
	for (size_t i = 0; i < sizeof(kinds) / sizeof(*kinds); i++)
		if (kinds[i].is(head, n))
			return &kinds[i];
	cli_fail("%s: is neither a model (.fis, .fx) nor a dataset (.csv)", path);
}

/* --- the figure as a file or a window ---------------------------------------------------- */

static char *folder; /* of the figure */

static void remove_folder(void)
{
	folder_remove(folder);
}

static const char *form_of(const char *output)
{
	if (cli_ends_with(output, ".png"))
		return "png";
	if (cli_ends_with(output, ".svg"))
		return "svg";
	cli_usage("-o: '%s' has no extension of a figure; give NAME.png or NAME.svg",
		  output);
}

/* A terminal of gnuplot that opens a window. */
static const char *window_form(void)
{
	const char *form;

	if (!getenv("DISPLAY") && !getenv("WAYLAND_DISPLAY"))
		cli_fail(
			"there is no display for a window; give -o NAME.png or NAME.svg");
	form = plot_window();
	if (!form)
		cli_fail(
			"this gnuplot opens no windows; give -o NAME.png or NAME.svg, or "
			"apt-get install gnuplot-qt");
	return form;
}

static void parse(struct job *job, int argc, char **argv)
{
	cli_parse(&command, argc, argv, job);
	job->figure.path = cli_operand(argc, argv, "file");
}

int main(int argc, char **argv)
{
	struct job job = {0};
	const struct kind *kind;
	const char *form;
	FILE *script;

	parse(&job, argc, argv);
	form = job.output ? form_of(job.output) : NULL;
	kind = kind_of(job.figure.path);
	if (job.figure.data && !kind->data)
		cli_usage("--data is for a model, and %s is %s", job.figure.path,
			  kind->name);
	plot_require();
	if (!form)
		form = window_form();
	cli_catch_signals();
	folder_make(job.figure.folder, sizeof(job.figure.folder), "for a figure");
	folder = job.figure.folder;
	atexit(remove_folder);
	plot_folder(folder);
	script = kind->draw(&job.figure);
	plot_draw_form(script, folder, FIGURE_NAME, form, job.output);
	if (job.output)
		printf("wrote %s\n", job.output);
	cli_finish();
	return 0;
}
