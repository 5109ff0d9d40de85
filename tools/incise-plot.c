// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise plot FILE: draws a file of incise, whose kind is recognised by its content, into a PNG or
 * SVG file or a window.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <incise/outfile.h>
#include "cli/cli.h"
#include "cli/file_kind.h"
#include "cli/folder.h"
#include "cli/plot.h"
#include "origin/origins.h"
#include "plot/figure.h"
#include "web/web.h"

struct plot_job {
	struct figure figure;
	const char *output; /* NULL: a window */
	bool range;
};

/* Either end may be missing. */
static void parse_part(void *whole, char *text)
{
	struct plot_job *job = whole;

	cli_time_range("range", text, &job->figure.from_s, &job->figure.to_s);
	job->range = true;
}

static const struct cli_option options[] = {
	{'o', "output", "FILE",
	 "the file to write: NAME.png, .svg or .pdf; of a recording, a session or a .fis also NAME.html, "
	 "a page for a browser, with zoom and without a network (default: a window)",
	 CLI_OUTPUT(struct plot_job, output), .extensions = ".png .svg .pdf .html"},
	{0, "range", "TIME..TIME",
	 "of a recording: the part to draw, such as 2s..4.5s, 90s.. or ..1min; "
	 "from its first force sample (default: all)",
	 CLI_PARSED_BY(parse_part)},
	{0, "data", "DATA.csv", "of a model: also draw the residuals of this dataset",
	 CLI_INPUT(struct plot_job, figure.data)},
	{0},
};

static const struct cli_command command = {
	.name = "plot",
	.synopsis = "FILE [-o NAME.png] [OPTIONS]",
	.summary =
		"Draw a recording, a dataset, a model (.fis, .fx), a texture (.tex), a session or a "
		"calibration. The kind of the file is recognised by its content.",
	.options = options,
	.examples = "incise plot liver.fis --data pairs.csv -o liver.png",
};

/* --- kinds of files -------------------------------------------------------------------- */

static const struct drawn {
	enum file_kind kind;
	FILE *(*draw)(const struct figure *figure);
} drawn[] = {
	{FILE_RECORDING, figure_of_recording}, {FILE_MODEL, figure_of_model},
	{FILE_COMPILED, figure_of_compiled},   {FILE_TABLE, figure_of_dataset},
	{FILE_SESSION, figure_of_session},     {FILE_CALIBRATION, figure_of_calibration},
	{FILE_TEXTURE, figure_of_texture},
};

#define DRAWN (sizeof(drawn) / sizeof(*drawn))
#define MODELS (FILE_MODEL | FILE_COMPILED)

static const struct drawn *find_drawn(const char *path)
{
	enum file_kind kind = file_kind_of(path);
	unsigned int all = 0;
	struct stat st;

	for (size_t i = 0; i < DRAWN; i++) {
		all |= drawn[i].kind;
		if (kind == drawn[i].kind)
			return &drawn[i];
	}
	file_expect(path, all);
	/* An interrupted capture left only NAME.rec.part, which opens under the name as well. */
	if (kind == FILE_UNKNOWN &&
	    file_kind_of(cli_text("%s.part", path)) == FILE_RECORDING)
		return &drawn[0];
	cli_fail(
		"%s: %s; give a recording (.rec), a dataset (.csv), a model (.fis, .fx), a "
		"texture (.tex), a session or a calibration.conf",
		path, stat(path, &st) ? strerror(errno) : "is of no kind that is known");
}

/* --- the figure as a file or a window ---------------------------------------------------- */

static char folder[4096]; /* of data and script, for a while */

static void remove_folder(void)
{
	folder_remove(folder);
}

static const char *form_of(const char *output)
{
	static const char *const forms[] = {"png", "svg", "pdf"};
	const char *dot = strrchr(output, '.');

	for (size_t i = 0; i < sizeof(forms) / sizeof(*forms) && dot; i++)
		if (!strcmp(dot + 1, forms[i]))
			return forms[i];
	cli_usage("-o: '%s' has no extension of a figure; give NAME.png, NAME.svg, "
		  "NAME.pdf or NAME.html",
		  output);
}

/* A terminal of gnuplot that opens a window. */
static const char *window_form(void)
{
	const char *form;

	if (!getenv("DISPLAY") && !getenv("WAYLAND_DISPLAY"))
		cli_fail(
			"there is no display for a window; give -o NAME.png, .svg or .pdf");
	form = plot_window();
	if (!form)
		cli_fail(
			"this gnuplot opens no windows; give -o NAME.png, .svg or .pdf, or "
			"apt-get install gnuplot-qt");
	return form;
}

/* The viewer with what it shows, in one file. */
static void write_page(const struct plot_job *job, const struct drawn *kind)
{
	struct incise_error err = {0};
	struct incise_outfile *out;
	struct web_file *file;
	size_t size;
	char *page;

	if (!(kind->kind & (FILE_RECORDING | FILE_SESSION | FILE_MODEL)))
		cli_usage(
			"-o: a page is for a recording, a session or a .fis, and %s is none; "
			"give NAME.png, NAME.svg or NAME.pdf",
			job->figure.path);
	if (job->range || job->figure.data)
		cli_usage("--%s: a page shows all; leave it out",
			  job->range ? "range" : "data");
	file = web_open(job->figure.path);
	page = web_page(file, &size, &err);
	if (!page)
		cli_fail_with(&err);
	out = cli_require(incise_outfile_open(job->output, &err), &err);
	fwrite(page, 1, size, incise_outfile_stream(out));
	cli_check(incise_outfile_commit(out, &err), &err);
	web_close(file);
	free(page);
}

static void parse_plot(struct plot_job *job, int argc, char **argv)
{
	cli_parse(&command, argc, argv, job);
	job->figure.path = cli_operand(
		argc, argv, "FILE",
		"recording, dataset, model, texture, session or calibration to draw");
}

int main(int argc, char **argv)
{
	struct plot_job job = {.figure = {
				       .from_s = -INFINITY,
				       .to_s = INFINITY,
				       .folder = folder,
				       .name = "figure",
			       }};
	struct incise_origins origins = {0};
	const struct drawn *kind;
	const char *form;
	FILE *script;

	parse_plot(&job, argc, argv);
	form = !job.output			       ? NULL
	       : cli_extension_in(job.output, ".html") ? "html"
						       : form_of(job.output);
	kind = find_drawn(job.figure.path);
	if (form && !strcmp(form, "html")) {
		cli_catch_signals();
		write_page(&job, kind);
		cli_written();
		cli_finish();
		return 0;
	}
	if (job.figure.data && !(kind->kind & MODELS))
		cli_usage("--data is for a model, and %s is none", job.figure.path);
	if (job.range && kind->kind != FILE_RECORDING)
		cli_usage("--range is for a recording, and %s is none", job.figure.path);
	if (job.figure.data)
		file_expect(job.figure.data, FILE_TABLE);
	plot_require();
	if (!form)
		form = window_form();
	cli_catch_signals();
	folder_make(folder, sizeof(folder), "for a figure");
	atexit(remove_folder);
	plot_folder(folder);
	script = kind->draw(&job.figure);
	if (job.output)
		origins_add(&origins, job.figure.path);
	if (job.output && job.figure.data)
		origins_add(&origins, job.figure.data);
	plot_draw_form(script, folder, job.figure.name, form, job.output, &origins);
	incise_origins_free(&origins);
	if (job.output)
		cli_written();
	cli_finish();
	return 0;
}
