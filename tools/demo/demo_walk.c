// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The verbs of paper 1 one after the other, as a person would type them.
 *
 *   capture ─▶ export ─▶ train ─▶ haptic     each printed as "$ incise …"
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "../cli/cli.h"
#include "demo.h"
#include "verb.h"

/* The bins that make the paper's 120 pairs. */
#define BINS "12x10"

static json_t *run(const struct demo *demo, char *const *argv)
{
	struct incise_error err = {0};
	json_t *report;

	if (!demo->quiet)
		verb_say(argv);
	report = verb_report(argv, &err);
	if (!report)
		cli_fail("%s; the folder %s holds what was done until then", err.text,
			 demo->folder);
	return report;
}

#define RUN(demo, ...) run(demo, (char *const[]){__VA_ARGS__, NULL})

static void write_scene(const struct demo *demo)
{
	char *path = demo_path(demo, "liver.scene");
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

/* The verbs, one after the other; their reports go into the summary. */
void demo_walk(struct demo *demo, const char *loop_time)
{
	char *rec = demo_path(demo, "liver.rec"),
	     *new_rec = demo_path(demo, "new-cut.rec");
	char *raw = demo_path(demo, "raw.csv"), *pairs = demo_path(demo, "pairs.csv");
	char *by_cut = demo_path(demo, "pairs-by-cut.csv"),
	     *new_csv = demo_path(demo, "new-cut.csv");
	char *paper = demo_path(demo, "paper.fis"), *model = demo_path(demo, "liver.fis");
	char *initial = demo_path(demo, "liver-initial.fis"),
	     *scene = demo_path(demo, "liver.scene");
	char *history = demo_path(demo, "paper-epochs.csv"),
	     *log = demo_path(demo, "haptic.csv");
	char *sim = demo_text("sim:seed=%ld,clock=simulated", demo->seed);
	char *seed_text = demo_text("%ld", demo->seed);
	/* Another liver: the boundary effect of its cut is not that of any cut above. */
	char *new_sim = demo_text("sim:seed=%ld,clock=simulated,depth_mm=5,times=1",
				  demo->seed + DEMO_OTHER_LIVER);
	char *live = demo_text("sim:seed=%ld,clock=real,depth_mm=5,times=1",
			       demo->seed + DEMO_OTHER_LIVER);
	char *duration = demo_text("%s", loop_time);

	demo_step(demo,
		  "Cut the virtual liver: 3, 4, 4 and 3 times at 5, 10, 15 and 20 mm");
	json_object_set_new(demo->summary, "capture",
			    RUN(demo, "capture", "-o", rec, "--rig", sim, "--force",
				"--json"));
	demo_step(demo,
		  "Make datasets of the recording: raw, averaged, averaged cut by cut");
	json_object_set_new(demo->summary, "export_raw",
			    RUN(demo, "export", rec, "-o", raw, "--rate", "1000",
				"--json"));
	json_object_set_new(demo->summary, "export_averaged",
			    RUN(demo, "export", rec, "-o", pairs, "--average", BINS,
				"--json"));
	json_object_set_new(demo->summary, "export_by_cut",
			    RUN(demo, "export", rec, "-o", by_cut, "--average", BINS,
				"--by-cut", "--json"));
	demo_step(demo, "Train on random halves as the paper does, then by unseen cuts");
	json_object_set_new(demo->summary, "train_random_halves",
			    RUN(demo, "train", pairs, "-o", paper, "--classic", "--check",
				"0.5", "--seed", seed_text, "--history", history,
				"--json"));
	json_object_set_new(demo->summary, "train_unseen_cuts",
			    RUN(demo, "train", by_cut, "-o", model, "--group", "cut",
				"--check", "0.3", "--seed", seed_text, "--initial",
				initial, "--json"));
	demo_step(demo, "Cut another liver once, 5 mm deep, to compare with");
	json_object_set_new(demo->summary, "capture_new_cut",
			    RUN(demo, "capture", "-o", new_rec, "--rig", new_sim,
				"--force", "--json"));
	json_object_set_new(demo->summary, "export_new_cut",
			    RUN(demo, "export", new_rec, "-o", new_csv, "--rate", "1000",
				"--json"));
	demo_step(demo, "Run the haptic loop in real time, in fixed point");
	write_scene(demo);
	json_object_set_new(demo->summary, "haptic",
			    RUN(demo, "haptic", scene, "--rig", live, "--no-rt",
				"--duration", duration, "--log", log, "--json"));
	free(rec), free(new_rec), free(raw), free(pairs), free(by_cut), free(new_csv);
	free(paper), free(model), free(initial), free(scene), free(history), free(log);
	free(sim), free(seed_text), free(new_sim), free(live), free(duration);
}
