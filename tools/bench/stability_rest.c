// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench stability: does a scene with a learned model come to rest? Each case is a model, a
 * device, a tracker and an actuator: the plan accepts or refuses it, and a closed loop in time,
 * which knows nothing of the plan's own search, leans on it with and without noise.
 *
 *              ┌─ accepted ──▶ leans: rests or swings            asked: none swings
 *   case ─▶ plan
 *              └─ refused ───▶ the same, as it is and twice as strong
 *                                                        asked: few would rest then
 *
 * A refused case runs on a plan made for a device that is damped well enough: a plan's ticks do not
 * depend on the device.
 */
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include <incise/plan.h>
#include "closed_loop.h"
#include "../cli/child.h"
#include "../cli/file.h"
#include "../cli/folder.h"
#include "../cli/scene_argument.h"
#include "stability.h"

/* --- models --- */

#define MODELS_MAX 6
#define SEEDS 3 /* of other virtual livers */

struct model {
	char name[24];
	char path[256]; /* compiled, so that a plan is made in little time */
};

static struct model models[MODELS_MAX];
static int n_models;
static char folder[200];

static void run_program(const char *name, char *const argv[])
{
	char *program = cli_text("%s/incise-%s", cli_folder(), name),
	     *all[24] = {program};
	int n = 1;

	while (argv[n - 1] && n < N(all) - 1) {
		all[n] = argv[n - 1];
		n++;
	}
	if (child_end(child_start(all, -1, STDERR_FILENO), 120))
		cli_fail("incise %s, which makes a model for the bench, failed", name);
	free(program);
}

#define RUN(name, ...) run_program(name, (char *const[]){__VA_ARGS__, NULL})

static void add_model(const char *name, char *fis)
{
	struct model *model = &models[n_models++];

	snprintf(model->name, sizeof(model->name), "%s", name);
	snprintf(model->path, sizeof(model->path), "%s/%s.fx", folder, name);
	/* Stiffer ones have a larger bound. */
	RUN("compile", fis, "-o", model->path, "--budget", "10mN");
	free(fis);
}

/* As in incise demo: cuts recorded, averaged and trained, of another seed. */
static void train_model(int seed)
{
	char *rig = cli_text("sim:seed=%d,clock=simulated", seed), name[24];
	char *rec = cli_text("%s/%d.rec", folder, seed);
	char *pairs = cli_text("%s/%d.csv", folder, seed);
	char *fis = cli_text("%s/%d.fis", folder, seed);

	cli_progress("models: liver of seed %d", seed);
	RUN("capture", "-o", rec, "--rig", rig, "--camera", "off", "--json");
	RUN("export", rec, "-o", pairs, "--average", "12x10", "--by-cut", "--json");
	RUN("train", pairs, "-o", fis, "--group", "cut", "--json");
	snprintf(name, sizeof(name), "seed %d", seed);
	add_model(name, fis);
	free(rig), free(rec), free(pairs);
}

/* By hand: 0.1 N/mm at the skin and 0.3 N/mm at 12 mm, half as much again in a fast cut. */
static void write_model(void)
{
	char *path = cli_text("%s/hand.fis", folder);
	FILE *out = fopen(path, "we");

	if (!out)
		cli_fail("%s: cannot be written", path);
	fputs("[System]\nName='hand'\nType='sugeno'\nVersion=2.0\nNumInputs=2\nNumOutputs=1\n"
	      "NumRules=4\nAndMethod='prod'\nOrMethod='probor'\nImpMethod='prod'\n"
	      "AggMethod='sum'\nDefuzzMethod='wtaver'\n\n"
	      "[Input1]\nName='depth_mm'\nRange=[0 12]\nNumMFs=2\n"
	      "MF1='shallow':'gaussmf',[5 0]\nMF2='deep':'gaussmf',[5 12]\n\n"
	      "[Input2]\nName='velocity_mm_s'\nRange=[0 60]\nNumMFs=2\n"
	      "MF1='slow':'gaussmf',[25 0]\nMF2='fast':'gaussmf',[25 60]\n\n"
	      "[Output1]\nName='force_N'\nRange=[0 4]\nNumMFs=4\n"
	      "MF1='a':'linear',[0.10 0 0]\nMF2='b':'linear',[0.15 0 0]\n"
	      "MF3='c':'linear',[0.20 0 -0.4]\nMF4='d':'linear',[0.30 0 -0.6]\n\n"
	      "[Rules]\n1 1, 1 (1) : 1\n1 2, 2 (1) : 1\n2 1, 3 (1) : 1\n2 2, 4 (1) : 1\n",
	      out);
	if (fclose(out))
		cli_fail("%s: cannot be written", path);
	add_model("by hand", path);
}

static void make_models(const struct bench_run *run)
{
	folder_make(folder, sizeof(folder), "for models");
	add_model("shipped", cli_text("%s/liver.fis", scene_argument_shipped()));
	if (run->n_operands)
		add_model("given", cli_text("%s", run->operands[0]));
	if (run->quick)
		return;
	write_model();
	for (int i = 0; i < SEEDS; i++)
		train_model(2 + i);
}

/* --- cases --- */

#define LEANS 11
#define RUN_S 8.0
#define NOISE_MM 0.02 /* of a tracker, as predict.h has it */
#define LATENCY_S 4.2e-3
#define DAMPED_N_s_mm 1 /* a device on which no gain of these cases is refused */
#define TWICE 2

/* N, and mm/s along the skin; the scene's limit is 4 N. */
static const double leans[LEANS][2] = {{0.2, 0},  {0.6, 0},  {1.2, 0}, {1.9, 0},
				       {2.1, 0},  {2.4, 0},  {3.0, 0}, {3.8, 0},
				       {0.5, 15}, {2.1, 15}, {3.8, 15}};

static const char *const withdrawals[] = {"dissipative", "paper"};

struct rest_row {
	const char *model, *path, *withdrawal;
	double mass_kg, damping_N_s_mm, tracker_hz;
	int late_ticks;
	double noise_mm;

	const char *verdict; /* "accepted", "refused" */
	char why[500];	     /* refused */
	double margin;	     /* accepted: of the loop's limit to the stiffness */
	/* The widest swing of all leans, as it is and with twice the forces; NaN: not run. */
	double swing_mm, swing_N, lean_N, along_mm_s, twice_mm;
	double shaken_mm; /* by the noise */
	bool rests, rests_twice;
};

#define CASES_MAX 3000
static struct rest_row cases[CASES_MAX];
static int n_cases;

const struct bench_table stability_rest_table = {
	.key = "rest",
	.row_bytes = sizeof(struct rest_row),
	.columns = {COLUMN(rest_row, "model", model),
		    COLUMN(rest_row, "withdrawal", withdrawal),
		    COLUMN(rest_row, "mass_kg", mass_kg),
		    COLUMN(rest_row, "damping_N_s_mm", damping_N_s_mm),
		    COLUMN(rest_row, "tracker_hz", tracker_hz),
		    COLUMN(rest_row, "late_ticks", late_ticks),
		    COLUMN(rest_row, "noise_mm", noise_mm),
		    COLUMN(rest_row, "verdict", verdict), COLUMN(rest_row, "why", why),
		    COLUMN(rest_row, "margin", margin), COLUMN(rest_row, "rests", rests),
		    COLUMN(rest_row, "swing_mm", swing_mm),
		    COLUMN(rest_row, "swing_N", swing_N),
		    COLUMN(rest_row, "lean_N", lean_N),
		    COLUMN(rest_row, "along_mm_s", along_mm_s),
		    COLUMN(rest_row, "twice_mm", twice_mm),
		    COLUMN(rest_row, "rests_twice", rests_twice),
		    COLUMN(rest_row, "shaken_mm", shaken_mm)},
};

static struct closed_loop loop_of(const struct rest_row *row)
{
	return (struct closed_loop){
		.mass_kg = row->mass_kg,
		.damping_N_s_mm = row->damping_N_s_mm,
		.tracker_hz = row->tracker_hz,
		.latency_s = LATENCY_S,
		.late_ticks = row->late_ticks,
		.run_s = RUN_S,
	};
}

/* The path of a file in memory differs from run to run: an error's text goes on without it. */
static void drop_path(struct incise_error *err, const char *path)
{
	size_t n = strlen(path);

	if (strncmp(err->text, path, n) || strncmp(err->text + n, ": ", 2))
		return;
	n += strlen(": ");
	memmove(err->text, err->text + n, strlen(err->text + n) + 1);
}

/* The plan of a case, with its forces times @gain, on a device of that damping. */
static struct incise_plan *plan_of(const struct rest_row *row, double gain,
				   double damping_N_s_mm, struct incise_scene **scene,
				   struct incise_error *err)
{
	struct memory_file file = memory_file_begin("case.scene");
	struct closed_loop loop = loop_of(row);
	struct incise_tracker_info tracker = closed_loop_tracker(&loop);
	struct incise_plan *plan = NULL;

	fprintf(file.file,
		"model = \"%s\"; tissue = { gain = %.1f; withdrawal = \"%s\"; };\n"
		"device = { mass_kg = %.4f; damping_N_s_mm = %.4f; late_ticks = %d; };\n",
		row->path, gain, row->withdrawal, row->mass_kg, damping_N_s_mm,
		row->late_ticks);
	memory_file_written(&file);
	*scene = incise_scene_load(file.path, NULL, err);
	if (*scene)
		plan = incise_plan_new_fed(*scene, &tracker, err);
	if (!plan)
		drop_path(err, file.path);
	fclose(file.file);
	return plan;
}

/* The widest swing of all leans, mm; NaN where the plan does not take a pose or tick. */
static double lean_all(struct incise_plan *plan, const struct rest_row *row,
		       double noise_mm, struct rest_row *note)
{
	struct closed_loop loop = loop_of(row);
	struct closed_loop_end end;
	double widest_mm = -1;

	loop.noise_mm = noise_mm;
	for (int i = 0; i < LEANS; i++) {
		loop.lean_N = leans[i][0];
		loop.along_mm_s = leans[i][1];
		/* A plan's time goes on: those with noise come second. */
		if (!closed_loop_run(plan, &loop, noise_mm > 0 ? LEANS + i : i, &end))
			return NAN;
		if (end.swing_mm > widest_mm && note) {
			note->swing_N = end.swing_N;
			note->lean_N = loop.lean_N;
			note->along_mm_s = loop.along_mm_s;
			note->shaken_mm = noise_mm > 0 ? end.shaken_mm : NAN;
		}
		widest_mm = fmax(widest_mm, end.swing_mm);
	}
	return widest_mm;
}

/* As if it were accepted, with a gain. */
static double lean_forced(struct rest_row *row, double gain, struct rest_row *note)
{
	struct incise_error err = {0};
	struct incise_scene *scene;
	struct incise_plan *plan = plan_of(row, gain, DAMPED_N_s_mm, &scene, &err);
	double swing_mm = plan ? lean_all(plan, row, 0, note) : NAN;

	incise_plan_free(plan);
	incise_scene_free(scene);
	return swing_mm;
}

/* Cases of a plan: without noise, and with it. */
static void try_plan(struct rest_row row[2])
{
	struct incise_error err = {0};
	struct incise_scene *scene;
	struct incise_plan *plan = plan_of(row, 1, row->damping_N_s_mm, &scene, &err);
	struct incise_plan_stability s;

	for (int i = 0; i < 2; i++) {
		row[i].verdict = plan ? "accepted" : "refused";
		row[i].margin = row[i].swing_mm = row[i].twice_mm = NAN;
		row[i].swing_N = row[i].lean_N = row[i].along_mm_s = row[i].shaken_mm =
			NAN;
		snprintf(row[i].why, sizeof(row[i].why), "%s", err.text);
		if (plan) {
			incise_plan_stability(plan, &s);
			row[i].margin = s.limit_N_mm / s.stiffness_N_mm;
			row[i].swing_mm = lean_all(plan, row, row[i].noise_mm, &row[i]);
		} else if (i == 0) {
			row->swing_mm = lean_forced(row, 1, row);
			row->twice_mm = lean_forced(row, TWICE, NULL);
		}
		/* Not a number is no rest. */
		row[i].rests = row[i].swing_mm <= CLOSED_LOOP_SWING_MM;
		row[i].rests_twice = row[i].twice_mm <= CLOSED_LOOP_SWING_MM;
	}
	incise_plan_free(plan);
	incise_scene_free(scene);
}

static atomic_int next_case, tried;

static void *try_plans(void *nothing)
{
	int i;

	while (i = atomic_fetch_add(&next_case, 2), i < n_cases && !cli_stop) {
		try_plan(&cases[i]);
		atomic_fetch_add(&tried, 2);
	}
	return nothing;
}

struct grid {
	double mass_kg[3], damping_N_s_mm[4], tracker_hz[3];
	int late_ticks[3];
	int n_masses, n_dampings, n_rates, n_lates;
};

static void add_cases(const struct grid *g)
{
	for (int i = 0; i < n_models * N(withdrawals) * g->n_masses * g->n_dampings *
				    g->n_rates * g->n_lates;
	     i++) {
		int k = i;

		if (n_cases + 2 > CASES_MAX)
			cli_fail("rest: more than %d cases", CASES_MAX);
		cases[n_cases].late_ticks = g->late_ticks[k % g->n_lates];
		k /= g->n_lates;
		cases[n_cases].tracker_hz = g->tracker_hz[k % g->n_rates];
		k /= g->n_rates;
		cases[n_cases].damping_N_s_mm = g->damping_N_s_mm[k % g->n_dampings];
		k /= g->n_dampings;
		cases[n_cases].mass_kg = g->mass_kg[k % g->n_masses];
		k /= g->n_masses;
		cases[n_cases].withdrawal = withdrawals[k % N(withdrawals)];
		k /= N(withdrawals);
		cases[n_cases].model = models[k].name;
		cases[n_cases].path = models[k].path;
		cases[n_cases + 1] = cases[n_cases];
		cases[n_cases + 1].noise_mm = NOISE_MM;
		n_cases += 2;
	}
}

static void measure(const struct bench_run *run)
{
	static const struct grid full = {{0.03, 0.05, 0.1},
					 {0.005, 0.01, 0.02, 0.05},
					 {60, 120, 240},
					 {0, 2, 5},
					 3,
					 4,
					 3,
					 3},
				 few = {{0.05}, {0.01, 0.05}, {120}, {0, 5}, 1, 2, 1, 2};
	pthread_t thread[64];
	long n = sysconf(_SC_NPROCESSORS_ONLN);

	make_models(run);
	add_cases(run->quick ? &few : &full);
	n = n < 1 ? 1 : n > N(thread) ? N(thread) : n;
	for (int i = 0; i < n; i++)
		if (pthread_create(&thread[i], NULL, try_plans, NULL))
			cli_fail("no thread for the cases");
	while (atomic_load(&tried) < n_cases && !cli_stop) {
		cli_progress("rest: %d of %d", atomic_load(&tried), n_cases);
		usleep(100000);
	}
	for (int i = 0; i < n; i++)
		pthread_join(thread[i], NULL);
	folder_remove(folder);
	if (cli_stop)
		cli_fail("interrupted");
}

/* --- report --- */

/* Cases of a model and a way out of the tissue. */
struct sum {
	const char *model, *withdrawal;
	double cases, accepted, swing, plans_refused, rest_as_is, rest_twice;
	double widest_mm; /* of the accepted */
};

static const struct bench_table sum_table = {
	.key = "rest_sums",
	.row_bytes = sizeof(struct sum),
	.columns = {COLUMN(sum, "model", model, "%10s", "model"),
		    COLUMN(sum, "withdrawal", withdrawal, "%13s", "withdrawal"),
		    COLUMN(sum, "cases", cases, "%7.0f", "cases", .whole = true),
		    COLUMN(sum, "accepted", accepted, "%10.0f", "accepted",
			   .whole = true),
		    COLUMN(sum, "swing", swing, "%10.0f", "oscillate", .whole = true),
		    COLUMN(sum, "widest_mm", widest_mm, "%12.2g", "largest, mm"),
		    COLUMN(sum, "plans_refused", plans_refused, "%15.0f", "plans refused",
			   .whole = true),
		    COLUMN(sum, "rest_as_is", rest_as_is, "%19.0f", "stable as it is",
			   .whole = true),
		    COLUMN(sum, "rest_twice", rest_twice, "%22.0f", "at twice the force",
			   .whole = true)},
};

static struct sum sum_of(const char *model, const char *withdrawal)
{
	struct sum sum = {model, withdrawal, .widest_mm = NAN};

	for (const struct rest_row *r = cases; r < cases + n_cases; r++) {
		bool accepted = r->verdict[0] == 'a', plan = r->noise_mm == 0;

		if ((model && strcmp(model, r->model)) ||
		    (withdrawal && strcmp(withdrawal, r->withdrawal)))
			continue;
		sum.cases++;
		sum.accepted += accepted;
		sum.swing += accepted && !r->rests;
		if (accepted)
			sum.widest_mm = fmax(sum.widest_mm, r->swing_mm);
		sum.plans_refused += !accepted && plan;
		sum.rest_as_is += !accepted && plan && r->rests;
		sum.rest_twice += !accepted && plan && r->rests_twice;
	}
	return sum;
}

static void list(struct bench_run *run, const char *title, bool accepted)
{
	bool any = false;

	for (const struct rest_row *r = cases; r < cases + n_cases; r++) {
		if (accepted ? r->verdict[0] != 'a' || r->rests : !r->rests_twice)
			continue;
		if (!any)
			bench_text(run, "%s\n", title);
		any = true;
		bench_text(
			run,
			"  %s, %s, %g kg, %g N s/mm, %g Hz, %d ticks late, noise %g mm: "
			"%.3g mm\n",
			r->model, r->withdrawal, r->mass_kg, r->damping_N_s_mm,
			r->tracker_hz, r->late_ticks, r->noise_mm,
			accepted ? r->swing_mm : r->twice_mm);
	}
}

void stability_rest(struct bench_run *run)
{
	static struct sum sums[MODELS_MAX * N(withdrawals)];
	struct sum all;
	double early;
	int n = 0;

	measure(run);
	cli_progress_end();
	for (int m = 0; m < n_models; m++)
		for (int w = 0; w < N(withdrawals); w++)
			sums[n++] = sum_of(models[m].name, withdrawals[w]);
	all = sum_of(NULL, NULL);
	bench_text(
		run,
		"learned models on devices of %g to %g kg: accepted or refused by the plan, "
		"and at rest under %d hand forces; an oscillation is more than %g mm in the "
		"last quarter of %g s\n",
		cases[0].mass_kg, cases[n_cases - 1].mass_kg, LEANS, CLOSED_LOOP_SWING_MM,
		RUN_S);
	bench_table(run, &sum_table, sums, n);
	bench_text(
		run,
		"%.0f cases: %.0f accepted, of which %.0f oscillate; %.0f plans refused, "
		"of which %.0f are stable at twice the force\n",
		all.cases, all.accepted, all.swing, all.plans_refused, all.rest_twice);
	list(run, "accepted, but oscillates", true);
	list(run, "refused, but stable at twice the force", false);
	bench_text(run, "\n");
	bench_rows(run, &stability_rest_table, cases, n_cases);
	early = all.plans_refused > 0 ? all.rest_twice / all.plans_refused : 0;
	metrics_add(run->metrics, METRIC_EXACT, &all.swing, "1",
		    "accepted cases that swing");
	metrics_add(run->metrics, METRIC_EXACT, &early, "1",
		    "refused plans that would rest twice as strong");
	metrics_more_is_better(metrics_add(run->metrics, METRIC_EXACT, &all.accepted, "1",
					   "accepted cases of learned models"));
	if (all.swing > 0)
		bench_fail(
			run,
			"rest: %.0f of %.0f accepted cases oscillate: please report it",
			all.swing, all.accepted);
}
