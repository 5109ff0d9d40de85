// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise demo: runs the commands of paper 1 on the virtual rig as a person would type them,
 * and leaves a folder with the data, the model, plots like the paper's and a summary.
 *
 *   capture ─▶ export ─▶ train ─▶ haptic     each printed as "$ incise …"
 *                 └────────┴────────┴───────┴──▶ plots, summary
 *
 * Until it is complete the folder holds a file .unfinished: the next run replaces it.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "cli/child.h"
#include "cli/cli.h"
#include "cli/file.h"
#include "cli/json.h"
#include "cli/plot.h"
#include "cli/report_script.h"
#include "cli/scene_argument.h"
#include "demo/demo.h"

/* Seeds end below those of a rig by as much as another liver's is more. */
#define OTHER_LIVER 1000
#define SEED_MAX (INT32_MAX - OTHER_LIVER)

struct demo_options {
	struct demo demo;
	const char *loop_time, *scene;
};

/* Checked here, and handed on to incise haptic as it is. */
static void parse_loop(void *loop_time, char *text)
{
	cli_duration("duration", text, 0.2, 3600);
	*(const char **)loop_time = text;
}

static const struct cli_option option_table[] = {
	{'o', "output", "DIR", "folder to leave everything in (default: demo.out)",
	 CLI_OUTPUTS(struct demo_options, demo.folder)},
	{0, "seed", "N", "of the simulated rig (default: 1)",
	 CLI_INTEGER(struct demo_options, demo.seed, 0, SEED_MAX)},
	{0, "duration", "TIME", "length of the haptic loop (default: 10s)",
	 CLI_PARSED(struct demo_options, loop_time, parse_loop)},
	{0, "scene", "SCENE",
	 "write a film and a contact sheet of a procedure on this scene, for "
	 "example neck (Bhasin et al., 2005), instead",
	 CLI_TEXT(struct demo_options, scene)},
	{0, "json", NULL, "print the summary as JSON, and nothing else",
	 CLI_FLAG(struct demo_options, demo.quiet)},
	{0},
};

static const struct cli_command command = {
	.name = "demo",
	.synopsis = "[OPTIONS]",
	.summary =
		"Follow Song et al. (2006) on the simulated rig: cut, record, export, "
		"train, compile to fixed point, run the haptic loop; write data, model, "
		"plots and summary into a folder.",
	.options = option_table,
};

/* Make a folder, which may exist if @may_exist. */
static void make_folder(const char *folder, bool may_exist)
{
	if (mkdir(folder, 0777) && (errno != EEXIST || !may_exist))
		cli_fail("%s: %s%s", folder, strerror(errno),
			 errno == EEXIST ? "; give another -o DIR, or --overwrite" : "");
}

/* Make the folder of a demo, or take one that a demo has not completed. */
static void begin_folder(const char *folder)
{
	char *mark = cli_text("%s/.unfinished", folder);
	int fd;

	if (!access(mark, F_OK))
		cli_allow_overwrite();
	make_folder(folder, cli_overwrite());
	fd = open(mark, O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
	if (fd < 0)
		cli_fail("%s: %s", mark, strerror(errno));
	close(fd);
	free(mark);
}

static void end_folder(const char *folder)
{
	char *mark = cli_text("%s/.unfinished", folder);

	if (unlink(mark))
		cli_fail("%s: %s", mark, strerror(errno));
	free(mark);
}

static void print_step(const struct demo *demo, const char *what)
{
	static int number;

	if (!demo->quiet)
		printf("\n[%d] %s\n", ++number, what);
}

/* --- commands ------------------------------------------------------------------------ */

/* The command, with --overwrite if this one has it; lives as long as the program. */
static char **handed_on(char *const *argv)
{
	size_t n = 0;
	char **more;

	while (argv[n])
		n++;
	more = cli_alloc(n + 2, sizeof(*more));
	memcpy(more, argv, n * sizeof(*more));
	if (cli_overwrite())
		more[n] = "--overwrite";
	return more;
}

static void print_command(char *const *argv)
{
	fputs("$ incise", stdout);
	for (char *const *arg = argv; *arg; arg++)
		printf(" %s", *arg);
	puts(cli_overwrite() ? " --overwrite" : "");
}

/* Run a command to its end. @out: descriptor of its output. */
static int run_child(char *const *argv, int out, const struct demo *demo,
		     struct incise_error *err)
{
	struct memory_file said = memory_file_begin("warned");
	char **own = handed_on(argv), line[1024];
	int status;

	own[0] = cli_text("%s/incise-%s", cli_folder(), argv[0]);
	fflush(stdout);
	status = child_run(own, STDIN_FILENO, out,
			   demo->silent ? fileno(said.file) : STDERR_FILENO);
	if (status < 0)
		cli_fail("%s: %s", own[0], strerror(errno));
	/* However it ended. */
	if (cli_stop)
		demo_interrupted(demo->folder);
	rewind(said.file);
	while (status && fgets(line, sizeof(line), said.file))
		fputs(line, stderr);
	fclose(said.file);
	if (!status)
		return 0;
	return incise_error_set(
		err, ECANCELED,
		"'incise %s' failed, see the line above; the folder %s holds "
		"what was done until then",
		argv[0], demo->folder);
}

/* Run a command, and read the JSON that it prints; NULL with the error. */
static json_t *read_report(char *const *argv, const struct demo *demo,
			   struct incise_error *err)
{
	struct memory_file said = memory_file_begin("said");
	json_error_t why = {.text = "no memory"};
	json_t *report = NULL;

	if (!run_child(argv, fileno(said.file), demo, err)) {
		rewind(said.file);
		report = json_loadf(said.file, 0, &why);
		if (!report)
			incise_error_set(err, EINVAL, "'incise %s' printed no report: %s",
					 argv[0], why.text);
	}
	fclose(said.file);
	return report;
}

/* --- paper 1 ------------------------------------------------------------------------- */

/* The bins that make the paper's 120 pairs. */
#define BINS "12x10"

static json_t *run_command(const struct demo *demo, char *const *argv)
{
	struct incise_error err = {0};

	if (!demo->quiet)
		print_command(argv);
	return cli_require(read_report(argv, demo, &err), &err);
}

#define RUN(demo, ...) run_command(demo, (char *const[]){__VA_ARGS__, NULL})

/* Damping of the haptic scalpel: enough for the models of most seeds to come to rest on it. */
#define DAMPING "0.02"

static void write_scene(const struct demo *demo)
{
	char *path = demo_path(demo, "liver.scene");
	FILE *out = fopen(path, "we");

	if (!out)
		cli_fail("%s: %s", path, strerror(errno));
	fputs("# Written by incise demo; see incise-scene(5).\n"
	      "rate_hz = 1000.0;\narithmetic = \"fixed\";\n"
	      "model = { cut = \"liver.fis\"; texture = \"liver.fis.tex\"; };\n"
	      "device = { damping_N_s_mm = " DAMPING "; };\n"
	      "limits = { force_N = 4.0; slew_N_s = 400.0; pose_age_ms = 50.0; };\n",
	      out);
	if (fclose(out))
		cli_fail("%s: %s", path, strerror(errno));
	free(path);
}

/*
 * The check of one split says little: of the paper's, and of others of the same pairs. A list of mean
 * square errors, N²; @warnings counts those of all. They say that half of the pairs is little, and are
 * not printed.
 */
static json_t *other_splits(struct demo *demo, char *pairs, const json_t *first,
			    size_t *warnings)
{
	char *model = demo_path(demo, "split.fis"), *beside = cli_text("%s.sd", model);
	json_t *errors = json_array();
	const bool quiet = demo->quiet;

	for (int i = 0; i < DEMO_SPLITS && !cli_stop; i++) {
		char *seed = cli_text("%ld", demo->seed + i);
		json_t *report = NULL;

		demo->quiet = demo->silent = true;
		if (i)
			report = RUN(demo, "train", pairs, "-o", model, "--overwrite",
				     "--search", "classic", "--check", "0.5", "--seed",
				     seed, "--json");
		json_array_append(
			errors,
			json_object_get(json_object_get(i ? report : first, "check"),
					"mse_N2"));
		*warnings +=
			json_array_size(json_object_get(i ? report : first, "warnings"));
		json_decref(report);
		free(seed);
	}
	demo->quiet = quiet;
	demo->silent = false;
	unlink(model);
	unlink(beside);
	free(model);
	free(beside);
	return errors;
}

/* Run the commands of paper 1; their reports go into the summary. */
static void walk(struct demo *demo, const char *loop_time)
{
	char *rec = demo_path(demo, "liver.rec"),
	     *new_rec = demo_path(demo, "new-cut.rec");
	char *raw = demo_path(demo, "raw.csv"), *pairs = demo_path(demo, "pairs.csv");
	char *by_cut = demo_path(demo, "pairs-by-cut.csv"),
	     *new_csv = demo_path(demo, "new-cut.csv");
	char *paper = demo_path(demo, "paper.fis"), *model = demo_path(demo, "liver.fis");
	char *initial = demo_path(demo, "paper.initial.fis"),
	     *scene = demo_path(demo, "liver.scene");
	char *history = demo_path(demo, "paper-epochs.csv"),
	     *log = demo_path(demo, "haptic.csv");
	char *replay = demo_path(demo, "new-cut-replay.csv"),
	     *felt = demo_path(demo, "new-cut-texture.csv");
	char *texture = demo_path(demo, "liver.fis.tex");
	char *sim = cli_text("sim:seed=%ld,clock=simulated", demo->seed);
	char *seed_text = cli_text("%ld", demo->seed);
	/* Another liver: the boundary effect of its cut is not that of any cut above. */
	char *new_sim = cli_text("sim:seed=%ld,clock=simulated,depth_mm=5,times=1",
				 demo->seed + OTHER_LIVER);
	char *live = cli_text("sim:seed=%ld,clock=real,depth_mm=5,times=1,"
			      "hand_N_s_mm=" DAMPING,
			      demo->seed + OTHER_LIVER);
	char *duration = cli_text("%s", loop_time);
	size_t warnings = 0;

	print_step(demo,
		   "Cut the virtual liver: 3, 4, 4 and 3 times at 5, 10, 15 and 20 mm");
	json_object_set_new(demo->summary, "capture",
			    RUN(demo, "capture", "-o", rec, "--rig", sim, "-c", "none",
				"--json"));
	print_step(demo,
		   "Make datasets of the recording: raw, averaged, averaged cut by cut");
	json_object_set_new(demo->summary, "export_raw",
			    RUN(demo, "export", rec, "-o", raw, "--rate", "1000",
				"--json"));
	json_object_set_new(demo->summary, "export_averaged",
			    RUN(demo, "export", rec, "-o", pairs, "--average", BINS,
				"--json"));
	json_object_set_new(demo->summary, "export_by_cut",
			    RUN(demo, "export", rec, "-o", by_cut, "--average",
				BINS ",by-cut", "--json"));
	print_step(demo, "Train on random halves as the paper does, then by unseen cuts");
	demo->silent = true;
	json_object_set_new(demo->summary, "train_random_halves",
			    RUN(demo, "train", pairs, "-o", paper, "--search", "classic",
				"--check", "0.5", "--seed", seed_text, "-o", history,
				"-o", initial, "--json"));
	json_object_set_new(
		demo->summary, "check_mse_N2_of_splits",
		other_splits(demo, pairs,
			     json_object_get(demo->summary, "train_random_halves"),
			     &warnings));
	json_object_set_new(demo->summary, "warnings_of_splits",
			    json_integer((json_int_t)warnings));
	json_object_set_new(demo->summary, "train_unseen_cuts",
			    RUN(demo, "train", by_cut, "-o", model, "--group", "cut",
				"--check", "0.3", "--seed", seed_text, "--json"));
	print_step(demo, "Learn the texture of cutting, which averages do not have");
	json_object_set_new(demo->summary, "train_texture",
			    RUN(demo, "train", raw, "-o", texture, "--json"));
	print_step(demo, "Cut another liver once, 5 mm deep, to compare with");
	json_object_set_new(demo->summary, "capture_new_cut",
			    RUN(demo, "capture", "-o", new_rec, "--rig", new_sim, "-c",
				"none", "--json"));
	json_object_set_new(demo->summary, "export_new_cut",
			    RUN(demo, "export", new_rec, "-o", new_csv, "--rate", "1000",
				"--json"));
	write_scene(demo);
	json_object_set_new(demo->summary, "replay_new_cut",
			    RUN(demo, "replay", new_rec, scene, "--poses", "acquisition",
				"--no-texture", "-o", replay, "--json"));
	json_object_set_new(demo->summary, "replay_new_cut_with_texture",
			    RUN(demo, "replay", new_rec, scene, "--poses", "acquisition",
				"-o", felt, "--json"));
	print_step(demo, "Run the haptic loop in real time, in fixed point");
	json_object_set_new(demo->summary, "haptic",
			    RUN(demo, "haptic", scene, "--rig", live, "-c", "none",
				"--no-rt", "--duration", duration, "-o", log, "--json"));
	free(rec), free(new_rec), free(raw), free(pairs), free(by_cut), free(new_csv);
	free(paper), free(model), free(initial), free(scene), free(history), free(log);
	free(replay), free(felt), free(texture), free(sim), free(seed_text),
		free(new_sim), free(live), free(duration);
}

/* --- paper 2 ------------------------------------------------------------------------- */

/* In the script of `incise view --procedure`: cut, bleeding, enlarging, tube. */
#define MOMENTS "2.4s,8.5s,12.2s,20s"
/* Near the cut, from the side and above. */
#define NEAR "18,40,150"

static void run_view(char *const *argv, const struct demo *demo)
{
	struct incise_error err = {0};

	print_command(argv);
	cli_check(run_child(argv, STDOUT_FILENO, demo, &err), &err);
}

/* Leave NAME.mkv and NAME.png in the folder, by incise view. */
static void film_scene(const char *scene, const struct demo *demo)
{
	const char *folder = demo->folder;
	char *name = scene_argument_name(scene);
	char *film = cli_text("%s/%s.mkv", folder, name);
	char *strip = cli_text("%s/%s.png", folder, name);

	begin_folder(folder);
	run_view((char *const[]){"view", (char *)scene, "--procedure", "-o", film,
				 "--rate", "30", NULL},
		 demo);
	run_view((char *const[]){"view", (char *)scene, "--procedure", "-o", strip,
				 "--at", MOMENTS, "--size", "640x480", "--no-panel",
				 "--viewpoint", NEAR, "--rate", "10", NULL},
		 demo);
	end_folder(folder);
	printf("\nwrote %s and %s\n", film, strip);
	cli_finish();
	free(name), free(film), free(strip);
}

/* The page of it all, index.html; false with a warning without jinja2. */
static bool write_page(const struct demo *demo)
{
	json_t *data =
		json_pack("{ss sO}", "title", "incise: a first walk on the simulated rig",
			  "summary", demo->summary);
	char *path = demo_path(demo, "index.html");
	struct incise_error err = {0};
	struct incise_outfile *file;
	const bool can = !report_script("check", NULL, NULL, NULL, &err);
	FILE *out;

	if (can) {
		out = whole_file_begin(path, &file);
		if (report_script("demo", demo->folder, data, out, &err))
			cli_fail("%s: %s", path, err.text);
		whole_file_end(file);
	} else {
		cli_warn("%s is not made: %s", path, err.text);
	}
	json_decref(data);
	free(path);
	return can;
}

/* A loop that gave no force shows nothing: the demo fails, and says why. */
static void require_force(const struct demo *demo)
{
	const json_t *loop = json_object_get(demo->summary, "haptic");
	const char *why = json_string_value(json_object_get(loop, "no_force"));

	if (why)
		cli_fail("the haptic loop gave no force: %s; run the demo again with "
			 "--duration 6s or more, when less else runs",
			 why);
}

int main(int argc, char **argv)
{
	struct demo_options options = {.demo = {.folder = "demo.out", .seed = 1},
				       .loop_time = "10s"};
	struct demo *demo = &options.demo;
	struct incise_model *model;
	bool page;
	char *plot;
	int64_t begin_ns;
	double seconds;

	cli_parse(&command, argc, argv, &options);
	if (optind != argc)
		cli_usage("'%s': demo takes options only", argv[optind]);
	if (options.scene && demo->quiet)
		cli_usage("--scene makes pictures, and has nothing to say as JSON");
	cli_catch_signals();
	if (options.scene) {
		film_scene(options.scene, demo);
		return 0;
	}
	plot_require();
	begin_ns = cli_now_ns();
	begin_folder(demo->folder);
	plot = demo_path(demo, "plot");
	make_folder(plot, true);
	free(plot);
	demo->pictures = json_array();
	demo->summary = demo_summary_begin(demo->seed);
	walk(demo, options.loop_time);
	model = demo_model(demo, "liver.fis");
	print_step(demo, "Compare, and draw the pictures");
	demo_worth(demo, model);
	demo_figures(demo, model);
	json_object_set_new(demo->summary, "pictures", demo->pictures);
	seconds = (double)(cli_now_ns() - begin_ns) * 1e-9;
	json_set_number(demo->summary, "seconds", seconds);
	demo_summary_save(demo, seconds);
	page = write_page(demo);
	end_folder(demo->folder);
	if (demo->quiet) {
		json_print(json_incref(demo->summary));
	} else {
		putchar('\n');
		demo_summary_print(demo, stdout, seconds);
		printf("results in         %s: summary.json, plots (*.png, *.svg), "
		       "data, models\n",
		       demo->folder);
		if (page)
			printf("open %s/index.html\n", demo->folder);
	}
	cli_finish();
	require_force(demo);
	incise_model_free(model);
	json_decref(demo->summary);
	return 0;
}
