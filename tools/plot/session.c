// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The figure of a session: the tool's path from above, and depth and force over time. See figure.h.
 */
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "../cli/plot.h"
#include "../session/session.h"
#include "figure.h"

/* Panels from the top, pixels. */
#define TITLE_HEIGHT 40
#define PATH_HEIGHT 560
#define LINES_HEIGHT 260
#define HEIGHT (TITLE_HEIGHT + PATH_HEIGHT + 2 * LINES_HEIGHT)

static void place_session_plot(FILE *script, int top, int height)
{
	fprintf(script, "set size 1,%.5f\nset origin 0,%.5f\n", (double)height / HEIGHT,
		1 - (double)(top + height) / HEIGHT);
}

static void put_title(FILE *script, const char *path, const struct session *s)
{
	const char *slash = strrchr(s->scene.path, '/');
	int met = 0, judged = 0;
	struct session_verdict verdict[INCISE_CRITERIA];

	session_judge(s, verdict);
	for (int i = 0; i < INCISE_CRITERIA; i++) {
		judged += verdict[i].judged;
		met += verdict[i].met;
	}
	fputs("set multiplot title ", script);
	plot_put_text(script, path);
	fputs(".', '.", script);
	plot_put_text(script, slash ? slash + 1 : s->scene.path);
	fprintf(script, ".', %.1f s, %d of %d criteria met' noenhanced\n", s->duration_s,
		met, judged);
}

FILE *figure_of_session(const struct figure *figure)
{
	struct incise_error err = {0};
	struct session *s = cli_require(session_read(figure->path, &err), &err);
	FILE *script;

	if (!s->n_trace)
		cli_fail("%s: ended before its first tick", figure->path);
	script = plot_begin(figure->folder, figure->name, FIGURE_WIDTH, HEIGHT);
	put_title(script, figure->path, s);
	place_session_plot(script, TITLE_HEIGHT, PATH_HEIGHT);
	session_figure_path(script, s, NULL);
	fputs("set size noratio\nset lmargin at screen 0.08\nset rmargin at screen 0.86\n",
	      script);
	place_session_plot(script, TITLE_HEIGHT + PATH_HEIGHT, LINES_HEIGHT);
	session_figure_depth(script, s, NULL);
	place_session_plot(script, TITLE_HEIGHT + PATH_HEIGHT + LINES_HEIGHT,
			   LINES_HEIGHT);
	session_figure_force(script, s, NULL);
	fputs("unset multiplot\n", script);
	free(s);
	return script;
}
