// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The results of incise demo; see demo.h: the errors of the model, paper 1's figures 2, 3 and 5
 * with the virtual liver's data, the lateness of ticks, the camera's picture, and the summary
 * next to the paper's results.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/dataset.h>
#include <incise/fixed.h>
#include <incise/rig.h>
#include <incise/sim.h>
#include <incise/version.h>
#include <incise/vision.h>
#include "../../lib/base/ascending.h"
#include "../cli/cli.h"
#include "../cli/file.h"
#include "../cli/json.h"
#include "../cli/model_plot.h"
#include "../cli/plot.h"
#include "demo.h"

char *demo_path(const struct demo *demo, const char *name)
{
	return cli_text("%s/%s", demo->folder, name);
}

/* The pairs that the models learned. */
#define ADVANCING "advancing"

/* Without the rows whose number in the column @where is 0, if it is not NULL. */
static struct incise_dataset *read_dataset(const struct demo *demo, const char *name,
					   const char *const *columns, int n,
					   const char *group, const char *where)
{
	struct incise_error err = {0};
	char *path = demo_path(demo, name);
	size_t left_out;
	struct incise_dataset *data =
		cli_require(incise_dataset_read_where(path, columns, n, group, where,
						      &left_out, &err),
			    &err);

	free(path);
	return data;
}

struct incise_model *demo_model(const struct demo *demo, const char *name)
{
	struct incise_error err = {0};
	char *path = demo_path(demo, name);
	struct incise_model *model = cli_require(incise_model_load(path, &err), &err);

	free(path);
	return model;
}

/* A number of a report, in the object @a of it if there is a @b. */
static double number_of_results(const json_t *report, const char *a, const char *b)
{
	const json_t *value = json_object_get(report, a);

	return json_number_value(b ? json_object_get(value, b) : value);
}

/* A quantile of the loop's report in us: free(3); null there: beyond the histogram. */
static char *quantile_us(const json_t *haptic, const char *what, const char *name,
			 double unit)
{
	const json_t *value = json_object_get(json_object_get(haptic, what), name);

	return json_is_number(value)
		       ? cli_text("< %g µs", json_number_value(value) * unit)
		       : cli_text("beyond the histogram");
}

/* --- errors of the model -------------------------------------------------------------- */

#define GRID 400

/* Largest difference of the two evaluators on a grid over the support, N. */
static double fixed_difference(const struct incise_model *model, double *bound)
{
	struct incise_error err = {0};
	struct incise_fixed *fixed =
		cli_require(incise_fixed_compile(model, NULL, &err), &err);
	double largest = 0;

	for (int i = 0; i <= GRID; i++)
		for (int j = 0; j <= GRID; j++) {
			const struct incise_variable *d =
				&incise_model_info(model)->input[0];
			const struct incise_variable *v =
				&incise_model_info(model)->input[1];
			double x[] = {d->min + (d->max - d->min) * i / GRID,
				      v->min + (v->max - v->min) * j / GRID};

			largest = fmax(largest, fabs(incise_model_eval(model, x, NULL) -
						     incise_fixed_eval_double(fixed, x)));
		}
	*bound = incise_fixed_bound(fixed);
	incise_fixed_free(fixed);
	return largest;
}

/* RMSE of the model against the virtual tissue's mean force, at the averaged pairs. */
static double truth_error(const struct demo *demo, const struct incise_model *model)
{
	static const char *const columns[] = {"depth_mm", "velocity_mm_s", "force_N"};
	struct incise_dataset *pairs =
		read_dataset(demo, "pairs.csv", columns, 3, NULL, ADVANCING);
	size_t n = incise_dataset_rows(pairs);
	struct incise_sim_config config;
	double sum = 0;

	incise_sim_config_init(&config);
	for (size_t i = 0; i < n; i++) {
		const double *row = incise_dataset_row(pairs, i);
		double e = incise_model_eval(model, row, NULL) -
			   incise_sim_mean_force(&config, row[0], row[1]);

		sum += e * e / n;
	}
	incise_dataset_free(pairs);
	return sqrt(sum);
}

void demo_worth(struct demo *demo, const struct incise_model *model)
{
	double bound, difference = fixed_difference(model, &bound);

	json_object_set_new(demo->summary, "fixed_point",
			    json_pack("{sf sf si}", "max_difference_N", difference,
				      "bound_N", bound, "points",
				      (GRID + 1) * (GRID + 1)));
	json_set_number(demo->summary, "truth_rms_error_N", truth_error(demo, model));
}

void demo_interrupted(const char *folder)
{
	cli_fail(
		"interrupted; the folder %s is not complete: run it again, and it is replaced",
		folder);
}

/* --- plots --------------------------------------------------------------------------- */

static void draw_results(const struct demo *demo, FILE *script, const char *name)
{
	bool drawn = plot_draw(script, demo->folder, name);

	if (cli_stop)
		demo_interrupted(demo->folder);
	if (!drawn)
		cli_fail("%s/plot/%s.gp: gnuplot failed, see above", demo->folder, name);
	json_array_append_new(demo->pictures, json_string(name));
}

/* ---- Figure 2: force against time, raw and averaged ---- */

/* Depths of the cuts. */
#define N_NOMINAL 4
static const double nominal_mm[N_NOMINAL] = {5, 10, 15, 20};

#define SLOT_S 0.05
#define SLOTS 400

static const char *const raw_columns[] = {"t_s", "depth_mm", "velocity_mm_s", "force_N"};

/* Index of the nominal depth nearest to a cut's deepest point. */
static int nearest_nominal(double depth_mm)
{
	int best = 0;

	for (int i = 1; i < N_NOMINAL; i++)
		if (fabs(depth_mm - nominal_mm[i]) < fabs(depth_mm - nominal_mm[best]))
			best = i;
	return best;
}

/* Force of the cuts of each depth, over the time in the cut. */
struct averages {
	double sum[N_NOMINAL][SLOTS];
	int count[N_NOMINAL][SLOTS];
	/* of the raw cuts: where their name stands */
	double from_s[N_NOMINAL], to_s[N_NOMINAL], highest_N[N_NOMINAL];
};

/* Write one cut, its nominal depth as the last column, as a block. */
static void write_cut(FILE *data, const struct incise_dataset *raw, size_t first,
		      size_t last, struct averages *of)
{
	double deepest = 0, start = incise_dataset_row(raw, first)[0];
	int n;

	for (size_t k = first; k <= last; k++)
		deepest = fmax(deepest, incise_dataset_row(raw, k)[1]);
	n = nearest_nominal(deepest);
	if (!of->to_s[n])
		of->from_s[n] = start;
	of->to_s[n] = incise_dataset_row(raw, last)[0];
	for (size_t k = first; k <= last; k++) {
		const double *row = incise_dataset_row(raw, k);
		int slot = (int)((row[0] - start) / SLOT_S);

		fprintf(data, "%.4f %.4f %g\n", row[0], row[3], nominal_mm[n]);
		of->highest_N[n] = fmax(of->highest_N[n], row[3]);
		if (slot < 0 || slot >= SLOTS)
			continue;
		of->sum[n][slot] += row[3];
		of->count[n][slot]++;
	}
	fputs("\n\n", data);
}

/* Where the averaged curve is in the middle of the cut, N. */
static double plateau(const struct averages *of, int n, double *middle_s)
{
	double highest = 0;
	int slots = 0;

	while (slots < SLOTS && of->count[n][slots])
		slots++;
	*middle_s = SLOT_S * slots / 2;
	for (int s = slots * 2 / 5; s < slots * 3 / 5; s++)
		highest = fmax(highest, of->sum[n][s] / of->count[n][s]);
	return highest;
}

static void name_depths(FILE *script, const struct averages *of, bool averaged)
{
	for (int n = 0; n < N_NOMINAL; n++) {
		double x = (of->from_s[n] + of->to_s[n]) / 2, y = of->highest_N[n];

		if (averaged)
			y = plateau(of, n, &x);
		fprintf(script,
			"set label %d '%g mm' at %.4f,%.4f center offset 0,0.7 tc lt %d\n",
			n + 1, nominal_mm[n], x, y, n + 1);
	}
}

static void figure_force(const struct demo *demo)
{
	struct incise_dataset *raw =
		read_dataset(demo, "raw.csv", raw_columns, 4, "cut", NULL);
	static struct averages averages;
	size_t rows = incise_dataset_rows(raw), first = 0;
	FILE *data = plot_data(demo->folder, "force-raw.dat");
	FILE *script;

	for (size_t i = 0; i < rows; i++) {
		if (i + 1 < rows &&
		    incise_dataset_group(raw, i + 1) == incise_dataset_group(raw, first))
			continue;
		write_cut(data, raw, first, i, &averages);
		first = i + 1;
	}
	plot_data_end(data, demo->folder);
	data = plot_data(demo->folder, "force-averaged.dat");
	for (int d = 0; d < N_NOMINAL; d++) {
		for (int s = 0; s < SLOTS; s++)
			if (averages.count[d][s])
				fprintf(data, "%.4f %.5f\n", (s + 0.5) * SLOT_S,
					averages.sum[d][s] / averages.count[d][s]);
		fputs("\n\n", data);
	}
	plot_data_end(data, demo->folder);
	script = plot_begin(demo->folder, "fig2-force", 1000, 740);
	fputs("layout = panels(80, 20, below(0), above(1), 0, between)\n"
	      "set multiplot layout 2,1 @layout title 'Cutting force of the simulated liver "
	      "(compare figure 2 of Song et al., 2006)'\n"
	      "set autoscale fix\nset offsets 0, 0, graph 0.14, graph 0.03\n"
	      "set xrange [0:*]\n"
	      "set xlabel 'time in the recording / s'\nset ylabel 'force / N'\n"
	      "set title '(a) raw samples, three or four cuts at each depth'\n",
	      script);
	name_depths(script, &averages, false);
	fputs("plot for [i=1:4] 'force-raw.dat' using 1:($3==5*i?$2:NaN) with lines lt i lw 0.7\n"
	      "set xlabel 'time in the cut / s'\n"
	      "set title '(b) mean of the cuts of each depth'\n",
	      script);
	name_depths(script, &averages, true);
	fputs("plot for [i=0:3] 'force-averaged.dat' index i using 1:2 with lines lt (i+1)\n"
	      "unset multiplot\n",
	      script);
	draw_results(demo, script, "fig2-force");
	incise_dataset_free(raw);
}

/* ---- Figure 3: membership functions and the force surface ---- */

/* Draw the memberships of the paper's training, which moves them; the default one keeps them. */
static void figure_membership(const struct demo *demo)
{
	struct incise_model *before = demo_model(demo, "paper.initial.fis");
	struct incise_model *model = demo_model(demo, "paper.fis");
	FILE *script;

	model_plot_write_functions(before, demo->folder, "membership-before.dat");
	model_plot_write_functions(model, demo->folder, "membership-after.dat");
	script = plot_begin(demo->folder, "fig3a-membership", 1000, 680);
	fputs("set multiplot layout 2,2 title 'Membership functions of depth and velocity, "
	      "train --search classic (compare figure 3a of Song et al., 2006)'\nset key outside right center\n",
	      script);
	for (int i = 0; i < 2; i++)
		model_plot_functions(script, before, i, "membership-before.dat",
				     i ? "(b) before training" : "(a) before training");
	for (int i = 0; i < 2; i++)
		model_plot_functions(script, model, i, "membership-after.dat",
				     i ? "(d) after training" : "(c) after training");
	fputs("unset multiplot\n", script);
	draw_results(demo, script, "fig3a-membership");
	incise_model_free(before);
	incise_model_free(model);
}

static void figure_surface(const struct demo *demo, const struct incise_model *model)
{
	struct model_surface surface = model_surface_of(model);
	FILE *script;

	model_plot_write_surface(&surface, demo->folder, "surface.dat");
	script = plot_begin(demo->folder, "fig3b-surface", 1000, 720);
	model_plot_surface(
		script, &surface, "surface.dat",
		"Cutting force of the trained model; markers: averaged pairs, with their "
		"distance from it (compare figure 3b of Song et al., 2006)",
		", \\\n  'pairs.dat' using 1:2:4:(0):(0):($3-$4) with vectors nohead "
		"lw 2 lc rgb vermillion, \\\n  '' with points pt 7 ps 0.5 lc rgb ink");
	draw_results(demo, script, "fig3b-surface");
}

/* The pairs, with the model's force at each. */
static void write_pairs(const struct demo *demo, const struct incise_model *model)
{
	static const char *const columns[] = {"depth_mm", "velocity_mm_s", "force_N"};
	struct incise_dataset *pairs =
		read_dataset(demo, "pairs.csv", columns, 3, NULL, ADVANCING);
	FILE *data = plot_data(demo->folder, "pairs.dat");

	for (size_t i = 0; i < incise_dataset_rows(pairs); i++) {
		const double *row = incise_dataset_row(pairs, i);

		fprintf(data, "%g %g %g %g\n", row[0], row[1], row[2],
			incise_model_eval(model, row, NULL));
	}
	plot_data_end(data, demo->folder);
	incise_dataset_free(pairs);
}

/* ---- Figure 5: predicted, rendered and measured force of a cut never seen ---- */

#define CLOSE_FROM_S 4.0 /* of the cut, seen close */
#define CLOSE_S 0.5

static void figure_prediction(const struct demo *demo)
{
	static const char *const ticks[] = {"t_s", "depth_mm", "command_N", "rendered_N"};
	static const char *const columns[] = {"t_s", "measured_N", "predicted_N"};
	/* The ticks of a replay that are in its cut. */
	struct incise_dataset *cut =
		read_dataset(demo, "new-cut-replay.csv", columns, 3, NULL, "cut");
	/* The same ticks. */
	struct incise_dataset *felt =
		read_dataset(demo, "new-cut-texture.csv", columns, 3, NULL, "cut");
	struct incise_dataset *log =
		read_dataset(demo, "haptic.csv", ticks, 4, NULL, NULL);
	FILE *data = plot_data(demo->folder, "prediction.dat");
	double contact = -1, duration_s = 1;
	FILE *script;

	for (size_t i = 0; i < incise_dataset_rows(cut); i++) {
		const double *row = incise_dataset_row(cut, i);

		duration_s = row[0] - incise_dataset_row(cut, 0)[0];
		fprintf(data, "%.4f %.5f %.5f %.5f\n", duration_s, row[1], row[2],
			incise_dataset_row(felt, i)[2]);
	}
	plot_data_end(data, demo->folder);
	/* Both begin where the blade meets the tissue. */
	data = plot_data(demo->folder, "rendered.dat");
	for (size_t i = 0; i < incise_dataset_rows(log); i++) {
		const double *row = incise_dataset_row(log, i);

		/* The same threshold as a cut's begin in an export. */
		if (contact < 0 && row[1] > 0.3)
			contact = row[0];
		if (contact >= 0)
			fprintf(data, "%.4f %.5f %.5f\n", row[0] - contact, row[2],
				row[3]);
	}
	if (contact < 0)
		fputs("0 0 0\n", data);
	plot_data_end(data, demo->folder);
	script = plot_begin(demo->folder, "fig5-prediction", 1000, 1100);
	/* One time axis: that of the cut, whatever the loop ran on for. */
	fprintf(script,
		"layout = panels(80, 20, below(2), above(1), 0, between)\n"
		"set multiplot layout 3,1 @layout "
		"title 'New cut at 5 mm (compare figure 5 of Song et al., 2006)'\n"
		"set xlabel 'time in the cut / s'\nset ylabel 'force / N'\nset key off\n"
		"set xrange [0:%.4f]\nset yrange [0:*]\nset ytics 0.1\n"
		"set title '(a) measured, and predicted by the model: the mean'\n"
		"plot 'prediction.dat' using 1:2 with lines lc rgb grey lw 0.8, \\\n"
		"  '' using 1:3 with lines lt 2\n"
		"set title '(b) measured, and rendered by the haptic loop with texture'\n"
		"plot 'prediction.dat' using 1:2 with lines lc rgb grey lw 0.8, \\\n"
		"  'rendered.dat' using 1:3 with lines lt 3 lw 1.5, \\\n"
		"  '' using 1:2 with lines lc rgb ink dt 2 lw 0.5\n"
		"set xrange [%g:%g]\n"
		"set title '(c) the same poses for all, seen close'\n"
		"plot 'prediction.dat' using 1:2 with lines lc rgb grey lw 1.5, \\\n"
		"  '' using 1:3 with lines lt 2, '' using 1:4 with lines lt 1\n"
		"eval key_panel\n"
		"plot NaN with lines lc rgb grey lw 0.8 title 'measured', \\\n"
		"  NaN with lines lt 2 title 'predicted mean', \\\n"
		"  NaN with lines lt 1 title 'rendered with texture', \\\n"
		"  NaN with lines lt 3 lw 2.5 title 'force on the hand', \\\n"
		"  NaN with lines lc rgb ink dt 2 lw 1 title 'commanded force'\n"
		"unset multiplot\n",
		duration_s, CLOSE_FROM_S, CLOSE_FROM_S + CLOSE_S);
	draw_results(demo, script, "fig5-prediction");
	incise_dataset_free(cut);
	incise_dataset_free(felt);
	incise_dataset_free(log);
}

/* Share of the ticks in bins that widen with the lateness. */
static void write_lateness(const json_t *histogram, double ticks, FILE *data)
{
	double end = 0, from = 0;
	size_t i = 0, n = json_array_size(histogram);

	for (size_t k = 0; k < n; k++)
		end = fmax(end, json_number_value(
					json_array_get(json_array_get(histogram, k), 0)));
	while (from <= end && n) {
		double to = from + fmax(1, floor(from / 10)), count = 0;

		for (; i < n; i++) {
			const json_t *bin = json_array_get(histogram, i);

			if (json_number_value(json_array_get(bin, 0)) >= to)
				break;
			count += json_number_value(json_array_get(bin, 1));
		}
		/* Lateness within the first µs begins where the axis does. */
		if (count > 0)
			fprintf(data, "%g %g %.9g\n", fmax(from, 0.5), to, count / ticks);
		from = to;
	}
}

static void figure_lateness(const struct demo *demo, const json_t *haptic)
{
	const json_t *lateness = json_object_get(haptic, "lateness_us");
	double ticks = fmax(1, number_of_results(haptic, "ticks", NULL));
	char *median = quantile_us(haptic, "lateness_us", "median", 1);
	char *p999 = quantile_us(haptic, "lateness_us", "p999", 1);
	FILE *data = plot_data(demo->folder, "lateness.dat");
	FILE *script;

	write_lateness(json_object_get(lateness, "histogram"), ticks, data);
	plot_data_end(data, demo->folder);
	script = plot_begin(demo->folder, "tick-lateness", 900, 480);
	fprintf(script,
		"set title \"Lateness of %g ticks of the haptic loop at 1 kHz, %s\\n"
		"median %s, 99.9th percentile %s, largest %.0f µs\"\n"
		"set xlabel 'lateness / µs'\nset ylabel 'share of the ticks'\n"
		"set logscale xy\nset format xy power\nset style fill solid 0.8 noborder\n"
		"stats 'lateness.dat' using 1 prefix 'low' nooutput\n"
		"stats 'lateness.dat' using 2 prefix 'high' nooutput\n"
		"set xrange [*:1200<*]\n"
		"set arrow from 1000, graph 0 to 1000, graph 1 nohead lc rgb ink dt 2\n"
		"set label 'next tick due' at 1000, graph 0.97 right offset -0.6,0 font small\n"
		"high_max = high_max > 1200 ? high_max : 1200\n"
		"if (high_max / low_min < 1e3) { set format x '%%g'; "
		"eval 'set xtics ('.log_tics(low_min, high_max).')' }\n"
		"set yrange [%g:1]\n"
		"plot 'lateness.dat' using (sqrt($1*$2)):3:1:2:(%g):3 "
		"with boxxyerror fc rgb blue\n",
		ticks, json_string_value(json_object_get(haptic, "scheduling")), median,
		p999, number_of_results(lateness, "max", NULL), 0.5 / ticks, 0.5 / ticks);
	free(median), free(p999);
	draw_results(demo, script, "tick-lateness");
}

/* ---- The camera's frame ---- */

/*
 * Draw over the frame what the camera's measurement found: the edge of the tissue, the exposed
 * length along the axis, and the hidden part of the blade down to its tip.
 *
 *     ├─┤  upper end of the black part
 *      │   exposed length
 *   ───┼─── skin line
 *      ╎   depth
 *      ▼   tip
 */
static void annotate(FILE *script, const struct incise_vision_result *r, double mm_px)
{
	const double *e = r->edge_px, *a = r->axis;
	double down = r->depth_mm / mm_px, up = r->length_px;
	double aside = 60; /* of the exposed length, px */

	fprintf(script,
		"set arrow from %.1f,%.1f to %.1f,%.1f nohead dt 2 lc rgb sky lw 2 front\n"
		"set label 'skin line' at %.1f,%.1f left front tc rgb paper\n",
		e[0] + 150 * a[1], e[1] - 150 * a[0], e[0] - 150 * a[1],
		e[1] + 150 * a[0], e[0] + 155, e[1] - 14);
	fprintf(script,
		"set arrow from %.1f,%.1f to %.1f,%.1f heads size 8,20 dt 1 lc rgb sky lw 2 front\n"
		"set label \"exposed length\\n%.1f px = %.2f mm\" at %.1f,%.1f left front "
		"tc rgb paper\n",
		e[0] + aside, e[1] - aside * a[0], e[0] + aside - up * a[0],
		e[1] - aside * a[0] - up * a[1], r->length_px, r->length_px * mm_px,
		e[0] + aside + 14 - up / 2 * a[0], e[1] - up / 2 * a[1]);
	fprintf(script,
		"set arrow from %.1f,%.1f to %.1f,%.1f nohead dt 3 lc rgb ink lw 2 front\n"
		"set label '' at %.1f,%.1f point pt 11 ps 1.2 lc rgb ink front\n"
		"set label \"tip, hidden by the tissue,\\n%.2f mm below the skin line\" at "
		"%.1f,%.1f left front\n",
		e[0], e[1], e[0] + down * a[0], e[1] + down * a[1], e[0] + down * a[0],
		e[1] + down * a[1], r->depth_mm, e[0] + down * a[0] + 16,
		e[1] + down * a[1] - 14);
}

/* Measure the frame as incise capture does; false without the module for it. */
static bool measure_results(struct incise_rig *rig,
			    const struct incise_camera_frame *frame,
			    struct incise_vision_setup *setup,
			    struct incise_vision_result *result)
{
	struct incise_error err = {0};
	struct incise_vision *vision;
	bool found;

	if (incise_rig_vision(rig, setup))
		return false;
	vision = incise_vision_new(setup, &err);
	if (!vision)
		return false;
	found = !incise_vision_measure(vision, frame, result) && result->found;
	incise_vision_free(vision);
	return found;
}

static void figure_camera(const struct demo *demo)
{
	struct incise_vision_result result;
	struct incise_vision_setup setup;
	struct incise_camera_frame frame;
	struct incise_rig *rig;
	char *spec =
		cli_text("sim:seed=%ld,clock=simulated,depth_mm=10,times=1", demo->seed);
	FILE *data, *script;
	double mm_px;

	rig = cli_open_rig(spec, INCISE_RIG_CAMERA);
	mm_px = incise_sim_config(incise_rig_sim(rig))->camera_mm_px;
	/* Well into the first cut. */
	incise_clock_wait_until(incise_rig_clock(rig),
				incise_clock_now(incise_rig_clock(rig)) +
					6 * INCISE_NS_PER_S);
	if (incise_camera_newest(incise_rig_camera(rig), &frame) != 1)
		cli_fail("the simulated camera gave no frame");
	data = plot_data(demo->folder, "camera.rgb");
	for (int y = 0; y < frame.height; y++)
		fwrite(frame.data + (size_t)y * frame.stride, 3, frame.width, data);
	plot_data_end(data, demo->folder);
	script = plot_begin(demo->folder, "camera", 900, 860);
	fprintf(script,
		"set title 'Scalpel in a cut: frame of the simulated camera at %.5g mm per "
		"pixel'\n"
		"set size ratio -1\nunset grid\nset xrange [0:%d]\nset yrange [%d:0]\n"
		"set xlabel 'x / px'\nset ylabel 'y / px'\n",
		mm_px, frame.width, frame.height + 120);
	if (measure_results(rig, &frame, &setup, &result))
		annotate(script, &result, mm_px);
	fprintf(script,
		"plot 'camera.rgb' binary array=(%d,%d) format='%%uchar' with rgbimage\n",
		frame.width, frame.height);
	draw_results(demo, script, "camera");
	incise_rig_close(rig);
	free(spec);
}

void demo_figures(struct demo *demo, const struct incise_model *model)
{
	const json_t *replay = json_object_get(demo->summary, "replay_new_cut");

	write_pairs(demo, model);
	figure_force(demo);
	figure_membership(demo);
	figure_surface(demo, model);
	figure_prediction(demo);
	figure_lateness(demo, json_object_get(demo->summary, "haptic"));
	figure_camera(demo);
	json_set_number(demo->summary, "new_cut_rms_error_N",
			number_of_results(replay, "rms_error_N", NULL));
}

/* --- the summary ---------------------------------------------------------------------- */

/* The paper after 80 epochs, §4.3. Its data are not published. */
#define PAPER_MSE_TRAIN 0.036
#define PAPER_MSE_CHECK 0.0804

json_t *demo_summary_begin(long seed)
{
	return json_pack("{ss sI ss s{sf sf}}", "version", incise_version(), "seed",
			 (json_int_t)seed, "note",
			 "simulated liver: the paper's data are not published", "paper",
			 "mse_train", PAPER_MSE_TRAIN, "mse_check", PAPER_MSE_CHECK);
}

void demo_summary_print(const struct demo *demo, FILE *out, double seconds)
{
	const json_t *capture = json_object_get(demo->summary, "capture");
	const json_t *halves = json_object_get(demo->summary, "train_random_halves");
	const json_t *unseen = json_object_get(demo->summary, "train_unseen_cuts");
	const json_t *lines = json_object_get(unseen, "baselines");
	const json_t *haptic = json_object_get(demo->summary, "haptic");
	char *late50 = quantile_us(haptic, "lateness_us", "median", 1);
	char *late999 = quantile_us(haptic, "lateness_us", "p999", 1);
	char *tick50 = quantile_us(haptic, "tick_ns", "median", 1e-3);
	char *tick999 = quantile_us(haptic, "tick_ns", "p999", 1e-3);
	double splits[DEMO_SPLITS];

	for (int i = 0; i < DEMO_SPLITS; i++)
		splits[i] = json_number_value(json_array_get(
			json_object_get(demo->summary, "check_mse_N2_of_splits"),
			(size_t)i));
	qsort(splits, DEMO_SPLITS, sizeof(*splits), ascending);
	fprintf(out,
		"incise demo, version %s, simulated rig with seed %ld\n"
		"\n"
		"recording          %.1f s, %.0f force samples, %.0f lost, %.0f "
		"clipped\n"
		"pairs              %.0f, averaged over depth and velocity as in Song "
		"et al. (2006), section 4.1\n"
		"\n"
		"Random halves, as in the paper (classic ANFIS, 20 rules, 80 epochs). "
		"Its data are\n"
		"not published and these are of a simulated liver: compare the kind of "
		"the figures, not the values.\n"
		"                         training      check\n"
		"  MSE here / N^2     %12.5f %10.5f\n"
		"  of %d splits                    %10.5f median, %.5f to %.5f\n"
		"  MSE in the paper   %12.5f %10.5f   (its unit is not stated)\n"
		"  %.0f warnings, not printed: half of the pairs is little to learn from\n"
		"\n"
		"On held-out cuts, settings by cross-validation, RMSE / N:\n"
		"  this model         %12.4f %10.4f\n"
		"  mean                            %10.4f\n"
		"  linear regression               %10.4f\n"
		"  nearest neighbours              %10.4f\n"
		"\n"
		"model against the tissue's true mean force   %.4f N rms at the pairs\n"
		"model against a new cut at 5 mm, replayed    %.4f N rms\n"
		"fixed point against double                   %.4f mN largest of %d "
		"points, certified to %.4f mN\n"
		"\n"
		"haptic loop        %.0f ticks at %g Hz, %.0f skipped (%s)\n"
		"  lateness         median %s, 99.9 %% %s, largest %.0f µs\n"
		"  tick             median %s, 99.9 %% %s\n"
		"  force            largest %.3f N, actuator off by %.4f N rms\n"
		"\n"
		"took               %.0f s\n",
		incise_version(), demo->seed, number_of_results(capture, "seconds", NULL),
		number_of_results(capture, "force", NULL),
		number_of_results(capture, "force_lost", NULL) +
			number_of_results(capture, "tracker_lost", NULL),
		number_of_results(capture, "force_clipped", NULL),
		number_of_results(halves, "pairs", NULL),
		number_of_results(halves, "train", "mse_N2"),
		number_of_results(halves, "check", "mse_N2"), DEMO_SPLITS,
		(splits[DEMO_SPLITS / 2 - 1] + splits[DEMO_SPLITS / 2]) / 2, splits[0],
		splits[DEMO_SPLITS - 1], PAPER_MSE_TRAIN, PAPER_MSE_CHECK,
		number_of_results(demo->summary, "warnings_of_splits", NULL),
		number_of_results(unseen, "train", "rms_error_N"),
		number_of_results(unseen, "check", "rms_error_N"),
		number_of_results(lines, "mean", "rms_error_N"),
		number_of_results(lines, "linear", "rms_error_N"),
		number_of_results(lines, "knn", "rms_error_N"),
		number_of_results(demo->summary, "truth_rms_error_N", NULL),
		number_of_results(demo->summary, "new_cut_rms_error_N", NULL),
		number_of_results(demo->summary, "fixed_point", "max_difference_N") * 1e3,
		(GRID + 1) * (GRID + 1),
		number_of_results(demo->summary, "fixed_point", "bound_N") * 1e3,
		number_of_results(haptic, "ticks", NULL),
		number_of_results(haptic, "rate_hz", NULL),
		number_of_results(haptic, "skipped", NULL),
		json_string_value(json_object_get(haptic, "scheduling")), late50, late999,
		number_of_results(haptic, "lateness_us", "max"), tick50, tick999,
		number_of_results(haptic, "force_max_N", NULL),
		number_of_results(haptic, "rendered_rms_error_N", NULL), seconds);
	free(late50), free(late999), free(tick50), free(tick999);
}

void demo_summary_save(const struct demo *demo, double seconds)
{
	char *json = demo_path(demo, "summary.json");
	char *txt = demo_path(demo, "summary.txt");
	struct incise_outfile *file;

	json_write(whole_file_begin(json, &file), demo->summary, JSON_INDENT(2));
	whole_file_end(file);
	demo_summary_print(demo, whole_file_begin(txt, &file), seconds);
	whole_file_end(file);
	free(json);
	free(txt);
}
