// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Figures of a session, as commands of gnuplot; see session.h.
 */
#include <math.h>
#include <stddef.h>
#include "../cli/loop_report.h"
#include "session.h"

#define MARGIN_MM 10.0
#define SHAPE 0.75 /* height of a path's plot, of its width */
#define CIRCLE 72  /* corners of the membrane's */

static const char *const colours[] = {"grey", "blue", "green", "purple"};

struct figures_range {
	double low[2], high[2];
};

static void widen_figures(struct figures_range *range, const double at_mm[3])
{
	for (int i = 0; i < 2; i++) {
		range->low[i] = fmin(range->low[i], at_mm[i] - MARGIN_MM);
		range->high[i] = fmax(range->high[i], at_mm[i] + MARGIN_MM);
	}
}

/* Lengths are the same on both axes: show more where the plot has place for it. */
static void fill_plot(struct figures_range *range)
{
	double size[2] = {range->high[0] - range->low[0], range->high[1] - range->low[1]};
	int i = size[1] < SHAPE * size[0];
	double more = i ? SHAPE * size[0] - size[1] : size[1] / SHAPE - size[0];

	range->low[i] -= more / 2;
	range->high[i] += more / 2;
}

/* Range of all shown points except the way through the air. */
static struct figures_range range_of_figures(const struct session *s)
{
	struct figures_range range = {{NAN, NAN}, {NAN, NAN}};

	for (int i = 0; i < s->n_trace; i++)
		if (s->trace[i].tool != INCISE_TOOL_AUTO)
			widen_figures(&range, s->trace[i].tool_mm);
	for (int i = 0; i < s->n_cuts; i++) {
		widen_figures(&range, s->cut[i].from_mm);
		widen_figures(&range, s->cut[i].to_mm);
	}
	if (s->has_membrane)
		widen_figures(&range, s->membrane.point_mm);
	if (isnan(range.low[0]))
		widen_figures(&range, s->trace[0].tool_mm);
	fill_plot(&range);
	return range;
}

/* Data of gnuplot: the path of one tool, with gaps where another tool is in the tissue. */
static int put_path(FILE *script, const char *name, const struct session *s,
		    enum incise_tool tool)
{
	int n = 0;

	fprintf(script, "$%s << END\n", name);
	for (int i = 0; i < s->n_trace; i++) {
		const struct session_sample *sample = &s->trace[i];

		if (sample->tool == tool)
			fprintf(script, "%.4f %.4f\n", sample->tool_mm[0],
				sample->tool_mm[1]);
		else if (i && s->trace[i - 1].tool == tool)
			fputc('\n', script);
		n += sample->tool == tool;
	}
	fputs("END\n", script);
	return n;
}

static int put_cuts(FILE *script, const char *name, const struct session *s)
{
	fprintf(script, "$%s << END\n", name);
	for (int i = 0; i < s->n_cuts; i++)
		fprintf(script, "%.4f %.4f\n%.4f %.4f\n\n", s->cut[i].from_mm[0],
			s->cut[i].from_mm[1], s->cut[i].to_mm[0], s->cut[i].to_mm[1]);
	fputs("END\n", script);
	return s->n_cuts;
}

/* As seen from above, wherever its normal leads. */
static void put_membrane(FILE *script, const struct incise_scene_membrane *membrane)
{
	const double *n = membrane->normal;
	/* Two directions across the normal: the first one across z, or x where that is it. */
	double across = hypot(n[0], n[1]);
	double u[2] = {1, 0}, v[2] = {0, n[2]};

	if (across > 1e-6) {
		u[0] = -n[1] / across;
		u[1] = n[0] / across;
		v[0] = -n[2] * n[0] / across;
		v[1] = -n[2] * n[1] / across;
	}
	fputs("$membrane << END\n", script);
	for (int i = 0; i <= CIRCLE; i++) {
		double a = 2 * M_PI * i / CIRCLE, c = membrane->radius_mm * cos(a),
		       d = membrane->radius_mm * sin(a);

		fprintf(script, "%.4f %.4f\n",
			membrane->point_mm[0] + c * u[0] + d * v[0],
			membrane->point_mm[1] + c * u[1] + d * v[1]);
	}
	fputs("END\n", script);
}

static void put_axes(FILE *script, const struct session *s)
{
	struct figures_range range = range_of_figures(s);

	fprintf(script,
		"set size ratio -1\nset xlabel 'x / mm'\nset ylabel 'y / mm'\n"
		"set xrange [%.4f:%.4f]\nset yrange [%.4f:%.4f]\n"
		"set key outside right top\n",
		range.low[0], range.high[0], range.low[1], range.high[1]);
}

void session_figure_path(FILE *script, const struct session *s,
			 const struct session *reference)
{
	int there[4], cuts = put_cuts(script, "cuts", s);
	int expert = reference ? put_cuts(script, "expert", reference) : 0;

	put_axes(script, s);
	for (int tool = 0; tool <= INCISE_TOOL_TUBE; tool++)
		there[tool] = put_path(script, loop_tool_names[tool], s,
				       (enum incise_tool)tool);
	if (s->has_membrane)
		put_membrane(script, &s->membrane);
	/* A plot of nothing is an error of gnuplot. */
	fputs("plot NaN notitle", script);
	if (cuts)
		fputs(", $cuts with lines lw 6 lc rgb orange title 'cut'", script);
	for (int tool = 0; tool <= INCISE_TOOL_TUBE; tool++)
		if (there[tool])
			fprintf(script,
				", $%s with linespoints pi 1000000 pt 6 lw %s lc rgb %s title '%s'",
				loop_tool_names[tool], tool ? "2" : "0.7", colours[tool],
				tool ? loop_tool_names[tool] : "in the air");
	if (expert)
		fputs(", $expert with lines lw 2 dt 2 lc rgb ink title 'cut, "
		      "reference'",
		      script);
	if (s->has_membrane)
		fputs(", $membrane with lines lw 2 lc rgb sky title 'membrane'", script);
	fputc('\n', script);
}

/* A member of the samples over time, as data of gnuplot. */
static void put_samples(FILE *script, const char *name, const struct session *s,
			size_t member, double later_s)
{
	fprintf(script, "$%s << END\n", name);
	for (int i = 0; i < s->n_trace; i++)
		fprintf(script, "%.4f %.4f\n", s->trace[i].t_s + later_s,
			*(const double *)((const char *)&s->trace[i] + member));
	fputs("END\n", script);
}

static void put_phases(FILE *script, const struct session *s)
{
	for (int i = 0; i < s->n_phases; i++)
		fprintf(script,
			"set object %d rectangle from %.4f, graph 0 to %.4f, graph 1 "
			"fc rgb %s fs solid 0.15 noborder behind\n",
			i + 1, s->phase[i].from_s, s->phase[i].to_s,
			colours[s->phase[i].tool]);
}

static bool has_phase(const struct session *s, int tool)
{
	for (int i = 0; i < s->n_phases; i++)
		if ((int)s->phase[i].tool == tool)
			return true;
	return false;
}

/* The reference follows from its first contact on, which is put at this session's first contact. */
static void put_over_time(FILE *script, const struct session *s,
			  const struct session *reference, size_t member,
			  const char *label, double most)
{
	double later_s = reference ? s->first_s - reference->first_s : NAN;

	fprintf(script,
		"set xlabel 'time / s'\nset ylabel '%s'\nset yrange [0:%.4f]\n"
		"set xrange [0:%.4f]\n",
		label, fmax(1.1 * most, 0.1), fmax(s->duration_s, 0.001));
	put_phases(script, s);
	put_samples(script, "session", s, member, 0);
	if (!isnan(later_s))
		put_samples(script, "expert", reference, member, later_s);
	fputs("plot $session with lines lc rgb ink title 'session'", script);
	if (!isnan(later_s))
		fputs(", $expert with lines lw 1 dt 2 lc rgb grey title 'reference'",
		      script);
	for (int tool = 1; tool <= INCISE_TOOL_TUBE; tool++)
		if (has_phase(s, tool))
			fprintf(script,
				", NaN with boxes fs solid 0.15 noborder lc rgb %s title '%s'",
				colours[tool], loop_tool_names[tool]);
}

void session_figure_force(FILE *script, const struct session *s,
			  const struct session *reference)
{
	const struct incise_scene_criterion *asked = &s->criteria[INCISE_CRITERION_FORCE];
	double most_N = fmax(s->force.largest_N, asked->asked ? asked->max : 0);

	fputs("set key outside right top\n", script);
	if (reference)
		most_N = fmax(most_N, reference->force.largest_N);
	put_over_time(script, s, reference, offsetof(struct session_sample, force_N),
		      "force / N", most_N);
	if (asked->asked)
		fprintf(script,
			", %.4f with lines lw 2 dt 3 lc rgb vermillion title 'at most'",
			asked->max);
	fputc('\n', script);
}

static double deepest_mm(const struct session *s)
{
	double deepest = 0;

	for (int i = 0; i < s->n_trace; i++)
		deepest = fmax(deepest, s->trace[i].depth_mm);
	return deepest;
}

void session_figure_depth(FILE *script, const struct session *s,
			  const struct session *reference)
{
	/* The force below has the same. */
	fputs("set key off\n", script);
	put_over_time(script, s, reference, offsetof(struct session_sample, depth_mm),
		      "depth / mm",
		      fmax(deepest_mm(s), reference ? deepest_mm(reference) : 0));
	fputc('\n', script);
}
