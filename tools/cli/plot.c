// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Plots by gnuplot; see plot.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <incise/infile.h>
#include "child.h"
#include "cli.h"
#include "features.h"
#include "../../lib/base/control_character.h"
#include "../origin/origins.h"
#include "file.h"
#include "folder.h"
#include "plot.h"

#define FIGURE_MAX (1 << 30) /* bytes */

extern const char text_style_gp[];

#define NAME_CHARACTERS \
	"abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-"

static char *plot_path(const char *folder, const char *name, const char *suffix)
{
	return cli_text("%s/plot/%s%s", folder, name, suffix);
}

void plot_place(const char *option, const char *path, const char **folder,
		const char **name)
{
	const char *slash = strrchr(path, '/'), *last = slash ? slash + 1 : path;
	size_t n = strlen(last);

	cli_extension(option, path, ".png .svg");
	if (n > 4 && (!strcmp(last + n - 4, ".png") || !strcmp(last + n - 4, ".svg")))
		n -= 4;
	/* The name is part of a script and a command: '-' would be an option of gnuplot. */
	if (!n || *last == '.' || *last == '-' ||
	    strspn(last, NAME_CHARACTERS) != strlen(last))
		cli_usage("--%s: '%s' cannot name a plot; use letters, digits, '.', "
			  "'_' and '-', but not '.' or '-' first",
			  option, last);
	*name = cli_text("%.*s", (int)n, last);
	*folder = slash ? cli_text("%.*s", (int)(slash > path ? slash - path : 1), path)
			: ".";
	plot_reserve(*folder, *name);
	plot_folder(*folder);
}

static void reserve(const char *folder, const char *name, void (*note)(const char *path))
{
	char *png = cli_text("%s/%s.png", folder, name);
	char *svg = cli_text("%s/%s.svg", folder, name);
	char *script = plot_path(folder, name, ".gp");

	note(png);
	note(svg);
	cli_output_part(script);
	free(png);
	free(svg);
	free(script);
}

void plot_reserve(const char *folder, const char *name)
{
	reserve(folder, name, cli_output);
}

void plot_folder(const char *folder)
{
	char *plot = cli_text("%s/plot", folder);

	plot_require();
	folder_make_all(plot);
	free(plot);
}

bool plot_possible(void)
{
	return !system("command -v gnuplot >/dev/null 2>&1");
}

void plot_require(void)
{
	if (!plot_possible())
		cli_fail("gnuplot is not installed, which draws the plots; %s",
			 features_remedy("gnuplot"));
}

static FILE *open_plot(const char *folder, const char *name, const char *suffix)
{
	char *path = plot_path(folder, name, suffix);
	FILE *file;

	cli_output_part(path);
	file = fopen(path, "we");
	if (!file)
		cli_fail("%s: %s", path, strerror(errno));
	free(path);
	return file;
}

FILE *plot_data(const char *folder, const char *name)
{
	return open_plot(folder, name, "");
}

void plot_data_end(FILE *data, const char *folder)
{
	bool failed = ferror(data);

	errno = 0;
	if (fclose(data) || failed)
		cli_fail("%s/plot: %s; free some space and run it again", folder,
			 strerror(errno ? errno : EIO));
}

/* A style that is there stays, with the changes of whoever made them; --overwrite replaces it. */
static void write_style(const char *folder)
{
	char *path = plot_path(folder, "style", ".gp");
	struct incise_outfile *file;

	if (access(path, F_OK) || cli_overwrite()) {
		cli_output_part(path);
		fputs(text_style_gp, whole_file_begin(path, &file));
		whole_file_end(file);
	}
	free(path);
}

FILE *plot_begin(const char *folder, const char *name, int width, int height)
{
	FILE *script;

	/* The place of a folder for a while, or reserved already. */
	reserve(folder, name, cli_output_part);
	script = open_plot(folder, name, ".gp");
	write_style(folder);
	fprintf(script,
		"# gnuplot -e \"ext='png'\" %s.gp\n"
		"figure_width = %d\nfigure_height = %d\nload 'style.gp'\n"
		"figure_file = '../%s.'.ext\n"
		"if (strstrt('png svg pdf', ext)) { set output figure_file } \\\n"
		"else { eval 'set terminal '.ext.' size '.figure_width.','.figure_height }\n",
		name, width, height, name);
	return script;
}

void plot_add(FILE *script, int *n, const char *format, ...)
{
	va_list args;

	fputs((*n)++ ? ", \\\n  " : "plot ", script);
	va_start(args, format);
	vfprintf(script, format, args);
	va_end(args);
}

static bool draw(const char *folder, const char *name, const char *ext)
{
	char *command;
	int status;

	/* In the environment the folder's name may hold any character. */
	setenv("INCISE_PICTURE_FOLDER", folder, 1);
	command = cli_text(
		"cd \"$INCISE_PICTURE_FOLDER/plot\" && gnuplot -e \"ext='%s'\" %s.gp",
		ext, name);
	status = system(command);
	free(command);
	/* system(3) ignores the Ctrl-C that has ended it. */
	if (WIFSIGNALED(status) || (WIFEXITED(status) && WEXITSTATUS(status) > 128))
		cli_stop = SIGINT;
	return status == 0;
}

bool plot_draw(FILE *script, const char *folder, const char *name)
{
	fputs("\neval end_figure\n", script);
	if (fclose(script))
		cli_fail("%s/plot/%s.gp: %s", folder, name, strerror(errno));
	return draw(folder, name, "png") && draw(folder, name, "svg");
}

void plot_draw_or_fail(FILE *script, const char *folder, const char *name)
{
	if (!plot_draw(script, folder, name))
		cli_fail("gnuplot could not draw %s/%s", folder, name);
}

/* Bytes of the character of UTF-8 that a text starts with; 0: it starts with none. */
static int character(const char *text)
{
	static const struct {
		unsigned char mask, lead;
	} forms[] = {{0x80, 0}, {0xe0, 0xc0}, {0xf0, 0xe0}, {0xf8, 0xf0}};
	const unsigned char *c = (const unsigned char *)text;

	for (int n = 0; n < 4; n++) {
		int more = 0;

		while (more < n && (c[more + 1] & 0xc0) == 0x80)
			more++;
		if ((*c & forms[n].mask) == forms[n].lead)
			return more == n && *c != 0xc0 && *c != 0xc1 ? n + 1 : 0;
	}
	return 0;
}

void plot_put_quoted(FILE *out, const char *text, int most, char quote)
{
	/* A name in a file may hold anything, also what would end the string, or an SVG. */
	fputc(quote, out);
	for (int n; *text && most; text += n, most--) {
		n = character(text);
		if (!n || control_character(text) || strchr("'\"\\`", *text)) {
			fputc(' ', out);
			n = n ? n : 1;
		} else {
			fwrite(text, 1, (size_t)n, out);
		}
	}
	fputs(*text ? "…" : "", out);
	fputc(quote, out);
}

void plot_put_text(FILE *script, const char *text)
{
	plot_put_quoted(script, text, 60, '\'');
}

const char *plot_unit_of(const char *name, size_t *n)
{
	static const struct {
		const char *suffix, *unit;
	} units[] = {{"_mm_s", "mm/s"}, {"_mm", "mm"}, {"_deg_s", "°/s"},
		     {"_deg", "°"},	{"_N", "N"},   {"_s", "s"}};

	*n = strlen(name);
	for (size_t i = 0; i < sizeof(units) / sizeof(*units); i++) {
		size_t suffix = strlen(units[i].suffix);

		if (*n <= suffix || strcmp(name + *n - suffix, units[i].suffix))
			continue;
		*n -= suffix;
		return units[i].unit;
	}
	return "";
}

void plot_put_label(FILE *script, const char *name)
{
	size_t n;
	const char *unit = plot_unit_of(name, &n);
	char *text = cli_text(!*unit		  ? "%.*s%s"
			      : strchr(unit, '/') ? "%.*s / (%s)"
						  : "%.*s / %s",
			      (int)n, name, unit);

	plot_put_text(script, text);
	free(text);
}

/* --- one form of a plot ------------------------------------------------------------------ */

const char *plot_window(void)
{
	static const char *const windows[] = {"qt", "wxt", "x11"};
	char known[4096] = " ";
	FILE *gnuplot;
	size_t n;

	/* Only gnuplot's Qt opens windows without X. */
	gnuplot = popen("gnuplot -e \"set print '-'; print GPVAL_TERMINALS\" 2>/dev/null",
			"re");
	if (!gnuplot)
		return NULL;
	n = fread(known + 1, 1, sizeof(known) - 3, gnuplot);
	pclose(gnuplot);
	known[n + 1] = ' ';
	for (char *c = known; *c; c++)
		if (*c == '\n')
			*c = ' ';
	for (int i = 0; i < (getenv("DISPLAY") ? 3 : 1); i++) {
		char *word = cli_text(" %s ", windows[i]);
		bool is = strstr(known, word);

		free(word);
		if (is)
			return windows[i];
	}
	return NULL;
}

/* The report of gnuplot: '"NAME.gp" line 9: …', below the command, or its first line. */
static void find_report(const char *path, char *report, size_t size)
{
	FILE *file = fopen(path, "re");
	char line[300];

	*report = 0;
	while (file && fgets(line, sizeof(line), file)) {
		line[strcspn(line, "\n")] = 0;
		if (!*report || *line == '"')
			snprintf(report, size, "%s", line);
		if (*line == '"')
			break;
	}
	if (file)
		fclose(file);
}

/* Returns its status as of waitpid(2); a signal ends it. */
static int wait_for(pid_t gnuplot)
{
	const struct timespec pause = {.tv_nsec = 20000000};
	int status;

	while (!child_ended(gnuplot, &status)) {
		if (cli_stop)
			return child_end(gnuplot, 0);
		nanosleep(&pause, NULL);
	}
	return status;
}

static void copy_file(const char *from, const char *to,
		      const struct incise_origins *origins)
{
	static const struct incise_infile_kind kind = {.name = "a figure",
						       .size_max = FIGURE_MAX};
	struct incise_error err = {0};
	struct incise_outfile *file;
	FILE *out = whole_file_begin(to, &file);
	size_t n;
	char *bytes = incise_infile_read(from, &kind, &n, &err);

	if (!bytes)
		cli_fail("%s: gnuplot did not draw it: %s", to, err.text);
	origins_into_figure(origins, bytes, n, out);
	free(bytes);
	whole_file_end(file);
}

void plot_draw_form(FILE *script, const char *folder, const char *name, const char *form,
		    const char *path, const struct incise_origins *origins)
{
	char *command = cli_text("cd \"$0/plot\" && exec gnuplot -e \"ext='%s'\" %s.gp",
				 form, name);
	char *argv[] = {"sh", "-c", command, (char *)folder, NULL};
	char *errors = cli_text("%s/errors", folder), *drawn, line[300];
	int fd = open(errors, O_WRONLY | O_CREAT | O_CLOEXEC, 0600), status;

	fputs(path ? "\neval end_figure\n" : "\npause mouse close\n", script);
	if (fd < 0 || fclose(script))
		cli_fail("%s: %s; make room and run it again", folder, strerror(errno));
	status = wait_for(child_start(argv, -1, fd));
	close(fd);
	if (cli_stop)
		cli_fail("interrupted%s", path ? "; nothing was written" : "");
	find_report(errors, line, sizeof(line));
	if (status)
		cli_fail("gnuplot could not draw it: %s", *line ? line : "it was killed");
	drawn = cli_text("%s/%s.%s", folder, name, form);
	if (path)
		copy_file(drawn, path, origins);
	free(drawn), free(errors), free(command);
}
