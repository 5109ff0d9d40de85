// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Plots by gnuplot; see plot.h.
 */
#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include "cli.h"
#include "file.h"
#include "folder.h"
#include "plot.h"

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

	if (n > 4 && (!strcmp(last + n - 4, ".png") || !strcmp(last + n - 4, ".svg")))
		n -= 4;
	/* The name is part of a script and a command: '-' would be an option of gnuplot. */
	if (!n || *last == '.' || *last == '-' ||
	    strspn(last, NAME_CHARACTERS) != strlen(last))
		cli_usage("--%s: '%s' is no name for a picture: letters, digits, '.', "
			  "'_' and '-', and not '.' or '-' first",
			  option, last);
	*name = cli_text("%.*s", (int)n, last);
	*folder = slash ? cli_text("%.*s", (int)(slash > path ? slash - path : 1), path)
			: ".";
	plot_reserve(*folder, *name);
	plot_folder(*folder);
}

void plot_reserve(const char *folder, const char *name)
{
	static const char *const files[] = {"%s/%s.png", "%s/%s.svg", "%s/plot/%s.gp"};

	for (size_t i = 0; i < sizeof(files) / sizeof(*files); i++) {
		char *path = cli_text(files[i], folder, name);

		cli_output(path);
		free(path);
	}
}

void plot_folder(const char *folder)
{
	char *plot = cli_text("%s/plot", folder);

	if (!plot_possible())
		cli_fail("gnuplot is not installed, it draws the pictures: apt-get "
			 "install gnuplot-nox");
	folder_make_all(plot);
	free(plot);
}

bool plot_possible(void)
{
	return !system("command -v gnuplot >/dev/null 2>&1");
}

static FILE *open_plot(const char *folder, const char *name, const char *suffix)
{
	char *path = plot_path(folder, name, suffix);
	FILE *file;

	cli_output(path);
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
		cli_fail("%s/plot: %s; make room and run it again", folder,
			 strerror(errno ? errno : EIO));
}

/* A style that is there stays, with the changes of whoever made them; --overwrite replaces it. */
static void write_style(const char *folder)
{
	char *path = plot_path(folder, "style", ".gp");
	struct incise_outfile *file;

	if (access(path, F_OK) || cli_overwrite()) {
		fputs(text_style_gp, whole_file_begin(path, &file));
		whole_file_end(file);
	}
	free(path);
}

FILE *plot_begin(const char *folder, const char *name, int width, int height)
{
	FILE *script;

	plot_reserve(folder, name);
	script = open_plot(folder, name, ".gp");
	write_style(folder);
	fprintf(script,
		"# gnuplot -e \"ext='png'\" %s.gp\n"
		"width = %d\nheight = %d\nload 'style.gp'\nset output '../%s.'.ext\n",
		name, width, height, name);
	return script;
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
	fputs("\nunset output\n", script);
	if (fclose(script))
		cli_fail("%s/plot/%s.gp: %s", folder, name, strerror(errno));
	return draw(folder, name, "png") && draw(folder, name, "svg");
}

void plot_draw_or_fail(FILE *script, const char *folder, const char *name)
{
	if (!plot_draw(script, folder, name))
		cli_fail("gnuplot could not draw %s/%s", folder, name);
}
