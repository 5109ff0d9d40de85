// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise demo: walks paper 1 on the virtual rig with the same commands a person would
 * type, and leaves a folder with the data, the model, pictures like the paper's and a
 * summary.
 *
 *   capture ─▶ export ─▶ train ─▶ eval ─▶ haptic     each printed as "$ incise …"
 *                 └────────┴────────┴───────┴──▶ pictures, summary
 */
#include <errno.h>
#include <getopt.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <incise/dataset.h>
#include <incise/fixed.h>
#include <incise/model.h>
#include <incise/outfile.h>
#include <incise/rig.h>
#include <incise/sim.h>
#include <incise/version.h>
#include "cli.h"
#include "demo_scene.h"
#include "json.h"
#include "model_picture.h"
#include "picture.h"

enum { OPT_SEED = CLI_LONG, OPT_LOOP, OPT_SCENE, OPT_FORCE, OPT_JSON };

/* What the paper reports after 80 epochs, §4.3. Its data are not published. */
#define PAPER_MSE_TRAIN 0.036
#define PAPER_MSE_CHECK 0.0804

/* Added to the seed for a liver that no training saw; seeds of a rig end at 2^31 - 1. */
#define OTHER_LIVER 1000
#define SEED_MAX (INT32_MAX - OTHER_LIVER)

/* Depths of the paper's cuts, and the bins that make its 120 pairs. */
#define BINS "12x10"
#define N_NOMINAL 4
static const double nominal_mm[N_NOMINAL] = {5, 10, 15, 20};

static const struct cli_option options[] = {
	{'o', "output", "DIR", "folder to leave everything in (default demo.out)"},
	{OPT_SEED, "seed", "N", "of the virtual rig (default 1)"},
	{OPT_LOOP, "loop", "TIME", "length of the haptic loop (default 10s)"},
	{OPT_SCENE, "scene", "SCENE",
	 "paper 2 instead: a film and a strip of a procedure on this scene, as neck"},
	{OPT_FORCE, "force", NULL, "write into a folder that exists"},
	{OPT_JSON, "json", NULL, "print the summary as JSON, and nothing else"},
	{0},
};

static const struct cli_verb verb = {
	.name = "demo",
	.synopsis = "[OPTIONS]",
	.summary =
		"Walk paper 1 on the virtual rig: cut, record, export, train, compile to fixed\n"
		"point, run the haptic loop; leave data, model, pictures and summary in a folder.",
	.options = options,
	.notes = "Exit: 0 done, 1 failed, 2 bad usage. See incise-demo(1).",
};

static const char *folder = "demo.out";
static long seed = 1;
static bool quiet; /* --json: no steps and commands */
static json_t *summary;
static json_t *pictures;

static char *in_folder(const char *name)
{
	char *path;

	if (asprintf(&path, "%s/%s", folder, name) < 0)
		cli_fail("no memory");
	return path;
}

static char *text(const char *fmt, ...) INCISE_PRINTF(1, 2);
static char *text(const char *fmt, ...)
{
	va_list args;
	char *s;

	va_start(args, fmt);
	if (vasprintf(&s, fmt, args) < 0)
		cli_fail("no memory");
	va_end(args);
	return s;
}

/* Run the verb in argv (argv[0] is its name) and read the JSON it prints. */
static json_t *run(char *const *argv)
{
	char *program;
	int pipe_fd[2], status;
	json_error_t why;
	json_t *report;
	FILE *in;
	pid_t child;

	program = text("%s/incise-%s", cli_folder(), argv[0]);
	if (!quiet) {
		printf("$ incise");
		for (char *const *arg = argv; *arg; arg++)
			printf(" %s", *arg);
		putchar('\n');
	}
	fflush(stdout);
	if (pipe(pipe_fd))
		cli_fail("pipe: %s", strerror(errno));
	child = fork();
	if (child < 0)
		cli_fail("fork: %s", strerror(errno));
	if (!child) {
		dup2(pipe_fd[1], STDOUT_FILENO);
		close(pipe_fd[0]);
		close(pipe_fd[1]);
		execv(program, argv);
		fprintf(stderr, "incise demo: %s: %s\n", program, strerror(errno));
		_exit(127);
	}
	close(pipe_fd[1]);
	in = fdopen(pipe_fd[0], "r");
	report = in ? json_loadf(in, 0, &why) : NULL;
	if (in)
		fclose(in);
	while (waitpid(child, &status, 0) < 0 && errno == EINTR)
		;
	if (status)
		cli_fail(
			"'incise %s' failed, see the line above; the folder %s holds what was "
			"done until then",
			argv[0], folder);
	if (!report)
		cli_fail("'incise %s' printed no report: %s", argv[0], why.text);
	free(program);
	return report;
}

#define RUN(...) run((char *const[]){__VA_ARGS__, NULL})

static double get(const json_t *object, const char *a, const char *b)
{
	const json_t *value = json_object_get(object, a);

	return json_number_value(b ? json_object_get(value, b) : value);
}

/* A quantile of the loop's report in us; null there means beyond its histogram. */
static char *quantile_us(const json_t *haptic, const char *what, const char *name,
			 double unit)
{
	const json_t *value = json_object_get(json_object_get(haptic, what), name);

	return json_is_number(value) ? text("< %g us", json_number_value(value) * unit)
				     : text("beyond the histogram");
}

static void step(const char *what)
{
	static int number;

	if (!quiet)
		printf("\n[%d] %s\n", ++number, what);
}

static void draw(FILE *script, const char *name)
{
	if (!picture_draw(script, folder, name))
		cli_fail("%s/plot/%s.gp: gnuplot failed, see above", folder, name);
	json_array_append_new(pictures, json_string(name));
}

static struct incise_dataset *read_csv(const char *name, const char *const *columns,
				       int n, const char *group)
{
	struct incise_error err = {0};
	char *path = in_folder(name);
	struct incise_dataset *data = incise_dataset_read(path, columns, n, group, &err);

	if (!data)
		cli_fail_with(&err);
	free(path);
	return data;
}

static struct incise_model *read_model(const char *name)
{
	struct incise_error err = {0};
	char *path = in_folder(name);
	struct incise_model *model = incise_model_load(path, &err);

	if (!model)
		cli_fail_with(&err);
	free(path);
	return model;
}

/* ---- Figure 2: force against time, raw and averaged ---- */

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

static void figure_force(void)
{
	struct incise_dataset *raw = read_csv("raw.csv", raw_columns, 4, "cut");
	static double sum[N_NOMINAL][SLOTS];
	static int count[N_NOMINAL][SLOTS];
	size_t rows = incise_dataset_rows(raw), first = 0;
	FILE *data = picture_data(folder, "force-raw.dat");
	FILE *script;

	/* A block per cut, its nominal depth as the last column. */
	for (size_t i = 0; i < rows; i++) {
		double deepest = 0, start = incise_dataset_row(raw, first)[0];
		int nominal;

		if (i + 1 < rows &&
		    incise_dataset_group(raw, i + 1) == incise_dataset_group(raw, first))
			continue;
		for (size_t k = first; k <= i; k++)
			deepest = fmax(deepest, incise_dataset_row(raw, k)[1]);
		nominal = nearest_nominal(deepest);
		for (size_t k = first; k <= i; k++) {
			const double *row = incise_dataset_row(raw, k);
			int slot = (int)((row[0] - start) / SLOT_S);

			fprintf(data, "%.4f %.4f %g\n", row[0], row[3],
				nominal_mm[nominal]);
			if (slot < 0 || slot >= SLOTS)
				continue;
			sum[nominal][slot] += row[3];
			count[nominal][slot]++;
		}
		fputs("\n\n", data);
		first = i + 1;
	}
	picture_data_end(data, folder);
	data = picture_data(folder, "force-averaged.dat");
	for (int d = 0; d < N_NOMINAL; d++) {
		for (int s = 0; s < SLOTS; s++)
			if (count[d][s])
				fprintf(data, "%.4f %.5f\n", (s + 0.5) * SLOT_S,
					sum[d][s] / count[d][s]);
		fputs("\n\n", data);
	}
	picture_data_end(data, folder);
	script = picture_begin(folder, "fig2-force", 1200, 800);
	fputs("set multiplot layout 2,1 title 'Cutting force, virtual liver (as paper 1, fig. 2)'\n"
	      "set xlabel 'time in the recording / s'\nset ylabel 'force / N'\n"
	      "set title '(a) raw: cuts at 5, 10, 15 and 20 mm'\n"
	      "set key top left Left reverse samplen 2\n"
	      "plot 'force-raw.dat' using 1:($3==5?$2:NaN) with lines ls 1 title '5 mm', \\\n"
	      "  '' using 1:($3==10?$2:NaN) with lines ls 2 title '10 mm', \\\n"
	      "  '' using 1:($3==15?$2:NaN) with lines ls 3 title '15 mm', \\\n"
	      "  '' using 1:($3==20?$2:NaN) with lines ls 4 title '20 mm'\n"
	      "set xlabel 'time in the cut / s'\n"
	      "set title '(b) averaged over the cuts of each depth'\n"
	      "plot for [i=0:3] 'force-averaged.dat' index i using 1:2 with lines ls (i+1) lw 2 \\\n"
	      "  title sprintf('%d mm', 5*(i+1))\n"
	      "unset multiplot\n",
	      script);
	draw(script, "fig2-force");
	incise_dataset_free(raw);
}

/* ---- Figure 3: membership functions and the force surface ---- */

static void figure_membership(const struct incise_model *model)
{
	static const char *const names[] = {"NB NS Z PS PB", "NB NS PS PB"};
	struct incise_model *before = read_model("liver-initial.fis");
	FILE *script;

	model_picture_functions(before, folder, "membership-before.dat");
	model_picture_functions(model, folder, "membership-after.dat");
	script = picture_begin(folder, "fig3a-membership", 1200, 700);
	fputs("set multiplot layout 2,2 title 'Membership functions before and after training "
	      "(as paper 1, fig. 3a)'\nset key outside right center\n",
	      script);
	for (int i = 0; i < 2; i++)
		model_picture_plot_functions(script, before, i, "membership-before.dat",
					     "before training", names[i]);
	for (int i = 0; i < 2; i++)
		model_picture_plot_functions(script, model, i, "membership-after.dat",
					     "after training", names[i]);
	fputs("unset multiplot\n", script);
	draw(script, "fig3a-membership");
	incise_model_free(before);
}

static void figure_surface(const struct incise_model *model)
{
	FILE *script;

	model_picture_surface(model, folder, "surface.dat");
	script = picture_begin(folder, "fig3b-surface", 1000, 800);
	model_picture_plot_surface(
		script, model, "surface.dat",
		"Force of the trained model (as paper 1, fig. 3b); dots: the averaged pairs",
		", \\\n  'pairs.dat' with points pt 7 ps 0.6 lc rgb 'black'");
	draw(script, "fig3b-surface");
}

static void write_pairs(void)
{
	static const char *const columns[] = {"depth_mm", "velocity_mm_s", "force_N"};
	struct incise_dataset *pairs = read_csv("pairs.csv", columns, 3, NULL);
	FILE *data = picture_data(folder, "pairs.dat");

	for (size_t i = 0; i < incise_dataset_rows(pairs); i++) {
		const double *row = incise_dataset_row(pairs, i);

		fprintf(data, "%g %g %g\n", row[0], row[1], row[2]);
	}
	picture_data_end(data, folder);
	incise_dataset_free(pairs);
}

/* ---- Figure 5: predicted, rendered and measured force of a cut never seen ---- */

/* RMSE of the model over a cut that no training saw. */
static double figure_prediction(const struct incise_model *model)
{
	static const char *const ticks[] = {"t_s", "depth_mm", "command_N", "rendered_N"};
	struct incise_dataset *cut = read_csv("new-cut.csv", raw_columns, 4, "cut");
	struct incise_dataset *log = read_csv("haptic.csv", ticks, 4, NULL);
	size_t n = incise_dataset_rows(cut);
	FILE *data = picture_data(folder, "prediction.dat");
	double sum = 0, contact = -1;
	FILE *script;

	for (size_t i = 0; i < n; i++) {
		const double *row = incise_dataset_row(cut, i);
		double x[] = {row[1], row[2]}, y = incise_model_eval(model, x, NULL);

		sum += (y - row[3]) * (y - row[3]) / n;
		fprintf(data, "%.4f %.5f %.5f\n", row[0] - incise_dataset_row(cut, 0)[0],
			row[3], y);
	}
	picture_data_end(data, folder);
	/* Both begin where the blade meets the tissue. */
	data = picture_data(folder, "rendered.dat");
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
	picture_data_end(data, folder);
	script = picture_begin(folder, "fig5-prediction", 1200, 800);
	fputs("set multiplot layout 2,1 title 'A new cut at 5 mm (as paper 1, fig. 5)'\n"
	      "set xlabel 'time in the cut / s'\nset ylabel 'force / N'\nset key top right\n"
	      "set xrange [0:*]\nset yrange [0:*]\n"
	      "set title '(a) predicted by the model, and measured'\n"
	      "plot 'prediction.dat' using 1:2 with lines lc rgb '#999999' title 'measured', \\\n"
	      "  '' using 1:3 with lines ls 2 lw 2 title 'predicted'\n"
	      "set title '(b) rendered by the haptic loop, and recorded'\n"
	      "plot 'prediction.dat' using 1:2 with lines lc rgb '#999999' title 'recorded', \\\n"
	      "  'rendered.dat' using 1:3 with lines ls 3 lw 2.5 title 'on the hand', \\\n"
	      "  '' using 1:2 with lines lc rgb 'black' dt 2 title 'commanded'\n"
	      "unset multiplot\n",
	      script);
	draw(script, "fig5-prediction");
	incise_dataset_free(cut);
	incise_dataset_free(log);
	return sqrt(sum);
}

static void figure_lateness(const json_t *haptic)
{
	const json_t *lateness = json_object_get(haptic, "lateness_us");
	const json_t *histogram = json_object_get(lateness, "histogram");
	char *median = quantile_us(haptic, "lateness_us", "median", 1);
	char *p999 = quantile_us(haptic, "lateness_us", "p999", 1);
	FILE *data = picture_data(folder, "lateness.dat");
	size_t i;
	json_t *bin;
	FILE *script;

	json_array_foreach(histogram, i, bin)
		fprintf(data, "%g %g\n", json_number_value(json_array_get(bin, 0)) + 0.5,
			json_number_value(json_array_get(bin, 1)));
	picture_data_end(data, folder);
	script = picture_begin(folder, "tick-lateness", 1000, 500);
	fprintf(script,
		"set title 'Lateness of %g ticks at 1 kHz (this machine, %s): median %s, "
		"99.9 %% %s, largest %.0f us'\n"
		"set xlabel 'lateness / us (the last bin holds all above 20 ms)'\n"
		"set ylabel 'ticks'\nset logscale xy\nset xrange [0.4:25000]\n"
		"set yrange [0.7:*]\nset style fill solid 0.6\n"
		"plot 'lateness.dat' using 1:2 with impulses ls 1 lw 2\n",
		get(haptic, "ticks", NULL),
		json_string_value(json_object_get(haptic, "scheduling")), median, p999,
		get(lateness, "max", NULL));
	free(median), free(p999);
	draw(script, "tick-lateness");
}

/* ---- The camera's picture ---- */

static void figure_camera(void)
{
	struct incise_error err = {0};
	struct incise_camera_frame frame;
	struct incise_rig *rig;
	char *spec = text("sim:seed=%ld,clock=simulated,depth_mm=10,times=1", seed);
	FILE *data, *script;

	rig = incise_rig_open(spec, INCISE_RIG_CAMERA, &err);
	if (!rig)
		cli_fail_with(&err);
	/* Well into the first cut. */
	incise_clock_wait_until(incise_rig_clock(rig),
				incise_clock_now(incise_rig_clock(rig)) +
					6 * INCISE_NS_PER_S);
	if (incise_camera_newest(incise_rig_camera(rig), &frame) != 1)
		cli_fail("the virtual camera gave no picture");
	data = picture_data(folder, "camera.rgb");
	for (int y = 0; y < frame.height; y++)
		fwrite(frame.data + (size_t)y * frame.stride, 3, frame.width, data);
	picture_data_end(data, folder);
	script = picture_begin(folder, "camera", frame.width + 160, frame.height + 120);
	fprintf(script,
		"set title 'Virtual camera: %g mm/px, scalpel 10 mm deep'\nset size ratio -1\n"
		"unset grid\nset xrange [0:%d]\nset yrange [%d:0]\nset xlabel 'px'\n"
		"set ylabel 'px'\nplot 'camera.rgb' binary array=(%d,%d) format='%%uchar' "
		"with rgbimage\n",
		incise_sim_config(incise_rig_sim(rig))->camera_mm_px, frame.width,
		frame.height, frame.width, frame.height);
	draw(script, "camera");
	incise_rig_close(rig);
	free(spec);
}

/* ---- What the model and its fixed form are worth ---- */

#define GRID 400

/* Largest difference of the two arithmetics on a grid over the support, N. */
static double fixed_difference(const struct incise_model *model, double *bound)
{
	struct incise_error err = {0};
	struct incise_fixed *fixed = incise_fixed_compile(model, NULL, &err);
	double largest = 0;

	if (!fixed)
		cli_fail_with(&err);
	for (int i = 0; i <= GRID; i++)
		for (int j = 0; j <= GRID; j++) {
			const struct incise_variable *d = incise_model_input(model, 0);
			const struct incise_variable *v = incise_model_input(model, 1);
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
static double truth_error(const struct incise_model *model)
{
	static const char *const columns[] = {"depth_mm", "velocity_mm_s", "force_N"};
	struct incise_dataset *pairs = read_csv("pairs.csv", columns, 3, NULL);
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

static void write_scene(void)
{
	char *path = in_folder("liver.scene");
	FILE *out = fopen(path, "we");

	if (!out)
		cli_fail("%s: %s", path, strerror(errno));
	fputs("# Written by incise demo; see incise-scene(5).\n"
	      "rate_hz = 1000.0;\nmodel = \"liver.fis\";\narithmetic = \"fixed\";\n"
	      "limits = { force_N = 4.0; slew_N_s = 400.0; pose_age_ms = 50.0; };\n",
	      out);
	if (fclose(out))
		cli_fail("%s: %s", path, strerror(errno));
	free(path);
}

static void print_summary(FILE *out, double seconds)
{
	const json_t *capture = json_object_get(summary, "capture");
	const json_t *halves = json_object_get(summary, "train_random_halves");
	const json_t *unseen = json_object_get(summary, "train_unseen_cuts");
	const json_t *lines = json_object_get(unseen, "baselines");
	const json_t *haptic = json_object_get(summary, "haptic");
	char *late50 = quantile_us(haptic, "lateness_us", "median", 1);
	char *late999 = quantile_us(haptic, "lateness_us", "p999", 1);
	char *tick50 = quantile_us(haptic, "tick_ns", "median", 1e-3);
	char *tick999 = quantile_us(haptic, "tick_ns", "p999", 1e-3);

	fprintf(out,
		"incise demo, version %s, virtual rig with seed %ld\n\n"
		"recording          %.1f s, %.0f force samples, %.0f lost, %.0f clipped\n"
		"pairs              %.0f, averaged over depth and velocity as in paper 1, "
		"section 4.1\n\n"
		"Random halves, as the paper does it (classic ANFIS, 20 rules, 80 epochs). Its data "
		"are\nnot published and ours are of a virtual liver: the figures compare in kind, "
		"not in value.\n"
		"                         training      check\n"
		"  MSE here / N^2     %12.5f %10.5f\n"
		"  MSE in the paper   %12.5f %10.5f   (its unit is not stated)\n\n"
		"By unseen cuts, ridge and epochs by cross-validation, RMSE / N:\n"
		"  this model         %12.4f %10.4f\n"
		"  mean                            %10.4f\n"
		"  linear regression               %10.4f\n"
		"  nearest neighbours              %10.4f\n\n"
		"model against the tissue's true mean force   %.4f N rms at the pairs\n"
		"model against a new cut at 5 mm              %.4f N rms\n"
		"fixed point against double                   %.4f mN largest of %d points, "
		"certified to %.4f mN\n\n"
		"haptic loop        %.0f ticks at %g Hz, %.0f skipped (%s)\n"
		"  lateness         median %s, 99.9 %% %s, largest %.0f us\n"
		"  tick             median %s, 99.9 %% %s\n"
		"  force            largest %.3f N, actuator off by %.4f N rms\n\n"
		"took               %.0f s\n",
		incise_version(), seed, get(capture, "seconds", NULL),
		get(capture, "force", NULL),
		get(capture, "force_lost", NULL) + get(capture, "tracker_lost", NULL),
		get(capture, "force_clipped", NULL), get(halves, "pairs", NULL),
		get(halves, "train", "mse_N2"), get(halves, "check", "mse_N2"),
		PAPER_MSE_TRAIN, PAPER_MSE_CHECK, get(unseen, "train", "rmse_N"),
		get(unseen, "check", "rmse_N"), get(lines, "mean", "rmse_N"),
		get(lines, "linear", "rmse_N"), get(lines, "knn", "rmse_N"),
		get(summary, "truth_rmse_N", NULL), get(summary, "new_cut_rmse_N", NULL),
		get(summary, "fixed_point", "max_difference_N") * 1e3,
		(GRID + 1) * (GRID + 1), get(summary, "fixed_point", "bound_N") * 1e3,
		get(haptic, "ticks", NULL), get(haptic, "rate_hz", NULL),
		get(haptic, "skipped", NULL),
		json_string_value(json_object_get(haptic, "scheduling")), late50, late999,
		get(haptic, "lateness_us", "max"), tick50, tick999,
		get(haptic, "force_max_N", NULL),
		get(haptic, "rendered_rms_error_N", NULL), seconds);
	free(late50), free(late999), free(tick50), free(tick999);
}

static void save_summary(double seconds)
{
	struct incise_error err = {0};
	char *json = in_folder("summary.json"), *txt = in_folder("summary.txt");
	struct incise_outfile *file = incise_outfile_open(json, &err);

	if (!file)
		cli_fail_with(&err);
	json_dumpf(summary, incise_outfile_stream(file),
		   JSON_INDENT(2) | JSON_REAL_PRECISION(12));
	if (incise_outfile_commit(file, &err))
		cli_fail_with(&err);
	file = incise_outfile_open(txt, &err);
	if (!file)
		cli_fail_with(&err);
	print_summary(incise_outfile_stream(file), seconds);
	if (incise_outfile_commit(file, &err))
		cli_fail_with(&err);
	free(json);
	free(txt);
}

static void make_folder(bool force)
{
	char *plot = in_folder("plot");

	if (mkdir(folder, 0777) && (errno != EEXIST || !force))
		cli_fail("%s: %s%s", folder, strerror(errno),
			 errno == EEXIST ? "; give another -o DIR, or --force" : "");
	if (mkdir(plot, 0777) && errno != EEXIST)
		cli_fail("%s: %s", plot, strerror(errno));
	free(plot);
}

/* The verbs, one after the other; their reports go into the summary. */
static void walk(const char *loop_time)
{
	char *rec = in_folder("liver.rec"), *new_rec = in_folder("new-cut.rec");
	char *raw = in_folder("raw.csv"), *pairs = in_folder("pairs.csv");
	char *by_cut = in_folder("pairs-by-cut.csv"), *new_csv = in_folder("new-cut.csv");
	char *paper = in_folder("paper.fis"), *model = in_folder("liver.fis");
	char *initial = in_folder("liver-initial.fis"), *scene = in_folder("liver.scene");
	char *history = in_folder("paper-epochs.csv"), *log = in_folder("haptic.csv");
	char *sim = text("sim:seed=%ld,clock=simulated", seed);
	char *seed_text = text("%ld", seed);
	/* Another liver: the boundary effect of its cut is not that of any cut above. */
	char *new_sim = text("sim:seed=%ld,clock=simulated,depth_mm=5,times=1",
			     seed + OTHER_LIVER);
	char *live =
		text("sim:seed=%ld,clock=real,depth_mm=5,times=1", seed + OTHER_LIVER);
	char *duration = text("%s", loop_time);

	step("Cut the virtual liver: 3, 4, 4 and 3 times at 5, 10, 15 and 20 mm");
	json_object_set_new(summary, "capture",
			    RUN("capture", "-o", rec, "--rig", sim, "--force", "--json"));
	step("Make datasets of the recording: raw, averaged, averaged cut by cut");
	json_object_set_new(summary, "export_raw",
			    RUN("export", rec, "-o", raw, "--rate", "1000", "--json"));
	json_object_set_new(summary, "export_averaged",
			    RUN("export", rec, "-o", pairs, "--average", BINS, "--json"));
	json_object_set_new(summary, "export_by_cut",
			    RUN("export", rec, "-o", by_cut, "--average", BINS,
				"--by-cut", "--json"));
	step("Train on random halves as the paper does, then by unseen cuts");
	json_object_set_new(summary, "train_random_halves",
			    RUN("train", pairs, "-o", paper, "--classic", "--check",
				"0.5", "--seed", seed_text, "--history", history,
				"--json"));
	json_object_set_new(summary, "train_unseen_cuts",
			    RUN("train", by_cut, "-o", model, "--group", "cut", "--check",
				"0.3", "--seed", seed_text, "--initial", initial,
				"--json"));
	step("Cut another liver once, 5 mm deep, to compare with");
	json_object_set_new(summary, "capture_new_cut",
			    RUN("capture", "-o", new_rec, "--rig", new_sim, "--force",
				"--json"));
	json_object_set_new(summary, "export_new_cut",
			    RUN("export", new_rec, "-o", new_csv, "--rate", "1000",
				"--json"));
	step("Run the haptic loop in real time, in fixed point");
	write_scene();
	json_object_set_new(summary, "haptic",
			    RUN("haptic", scene, "--rig", live, "--no-rt", "--duration",
				duration, "--log", log, "--json"));
	free(rec), free(new_rec), free(raw), free(pairs), free(by_cut), free(new_csv);
	free(paper), free(model), free(initial), free(scene), free(history), free(log);
	free(sim), free(seed_text), free(new_sim), free(live), free(duration);
}

static void draw_all(const struct incise_model *model)
{
	double new_cut;

	write_pairs();
	figure_force();
	figure_membership(model);
	figure_surface(model);
	new_cut = figure_prediction(model);
	figure_lateness(json_object_get(summary, "haptic"));
	figure_camera();
	json_object_set_new(summary, "new_cut_rmse_N", json_number(new_cut));
}

int main(int argc, char **argv)
{
	const char *loop_time = "10s", *scene = NULL;
	struct incise_model *model;
	struct timespec begin, end;
	bool force = false;
	double seconds, difference, bound;
	int opt;

	while ((opt = cli_next(&verb, argc, argv)) != CLI_END)
		switch (opt) {
		case 'o':
			folder = optarg;
			break;
		case OPT_SEED:
			seed = cli_integer("seed", optarg, 0, SEED_MAX);
			break;
		case OPT_LOOP:
			cli_duration("loop", optarg, 0.2, 3600);
			loop_time = optarg;
			break;
		case OPT_SCENE:
			scene = optarg;
			break;
		case OPT_FORCE:
			force = true;
			break;
		case OPT_JSON:
			quiet = true;
			break;
		}
	if (optind != argc)
		cli_usage("'%s': demo takes options only", argv[optind]);
	if (scene && quiet)
		cli_usage("--scene makes pictures, and has nothing to say as JSON");
	if (scene) {
		demo_scene(scene, folder, force);
		return 0;
	}
	if (!picture_possible())
		cli_fail(
			"gnuplot is not installed, it draws the pictures: apt-get install "
			"gnuplot-nox, or run 'make demo'");
	clock_gettime(CLOCK_MONOTONIC, &begin);
	make_folder(force);
	summary = json_object();
	pictures = json_array();
	json_object_set_new(summary, "version", json_string(incise_version()));
	json_object_set_new(summary, "seed", json_integer(seed));
	json_object_set_new(
		summary, "note",
		json_string("virtual liver: the paper's data are not published"));
	json_object_set_new(summary, "paper",
			    json_pack("{sf sf}", "mse_train", PAPER_MSE_TRAIN,
				      "mse_check", PAPER_MSE_CHECK));
	walk(loop_time);
	model = read_model("liver.fis");
	step("Compare, and draw the pictures");
	difference = fixed_difference(model, &bound);
	json_object_set_new(summary, "fixed_point",
			    json_pack("{sf sf si}", "max_difference_N", difference,
				      "bound_N", bound, "points",
				      (GRID + 1) * (GRID + 1)));
	json_object_set_new(summary, "truth_rmse_N", json_number(truth_error(model)));
	draw_all(model);
	json_object_set_new(summary, "pictures", pictures);
	clock_gettime(CLOCK_MONOTONIC, &end);
	seconds = end.tv_sec - begin.tv_sec + (end.tv_nsec - begin.tv_nsec) * 1e-9;
	json_object_set_new(summary, "seconds", json_number(seconds));
	save_summary(seconds);
	if (quiet) {
		json_print(json_incref(summary));
	} else {
		putchar('\n');
		print_summary(stdout, seconds);
		printf("left in            %s: summary.json, pictures (*.png, *.svg), data, "
		       "models\n",
		       folder);
	}
	cli_finish();
	incise_model_free(model);
	json_decref(summary);
	return 0;
}
