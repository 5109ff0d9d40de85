// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The steps of the protocol with a force; see protocol.h. Each is a run of incise haptic on a wall of its
 * own, whose log is read:
 *
 *   wall     0 ── start, hand leans ── 6 s ── turns of the pose by more than twice SWING_MM ── 11.5 s ── 12 s
 *   weight   the same with a weight in place of the hand; mean of the force
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>
#include <incise/plan.h>
#include "../cli/child.h"
#include "../cli/cli.h"
#include "../cli/file.h"
#include "protocol.h"

#define REACTION_N_MM 20.0 /* of a wall at a gain of 1 */
#define GAIN_MOST 10.0
#define FORCE_N 4.0 /* largest, of a device that gives more */
#define RUN "12s"
#define FROM_S 6.0
#define UNTIL_S 11.5
#define SWING_MM 0.1
#define LEAN_LEAST_N 0.1
#define WEIGHT_N (0.1 * 9.80665)
/* Shares of the largest stiffness that the plan accepts; the weight is on the second. */
static const double shares[PROTOCOL_WALLS] = {0.25, 0.5, 0.75, 0.9};

/* The keys of a simulated device's hand that does what is asked. */
#define HAND "motion=lean,z_mm=2,begin_s=3,lean_N="
#define LEANS HAND "3.5"
#define HANGS HAND "0.980665,hand_kg=0.1,hand_N_mm=0,hand_N_s_mm=0"

static void write_wall(struct memory_file *scene, double N_mm, double peak_N)
{
	*scene = memory_file_begin("wall");
	fprintf(scene->file,
		"tissue = { reaction_N_mm = %.1f; gain = %.9f; };\n"
		"limits = { force_N = %.9f; };\n",
		REACTION_N_MM, N_mm / REACTION_N_MM, fmin(FORCE_N, peak_N));
	memory_file_written(scene);
}

/* The largest stiffness that a plan accepts is the advice with which it refuses a larger one. */
double protocol_limit(struct incise_rig *rig, double peak_N, struct incise_error *err)
{
	static const char words[] = "set tissue.gain to at most ";
	struct memory_file file;
	struct incise_scene *scene;
	struct incise_plan *plan;
	const char *advice;
	double gain = GAIN_MOST;

	if (!(peak_N > 0)) {
		incise_error_set(
			err, ENODATA,
			"its largest force is not known; set haptic_setup.peak_N");
		return 0;
	}
	write_wall(&file, GAIN_MOST * REACTION_N_MM, peak_N);
	scene = incise_scene_load(file.path, NULL, err);
	plan = scene ? incise_plan_new(scene, rig, err) : NULL;
	advice = plan ? NULL : strstr(err->text, words);
	if (!plan)
		gain = advice ? strtod(advice + strlen(words), NULL) : 0;
	incise_plan_free(plan);
	incise_scene_free(scene);
	fclose(file.file);
	return gain * REACTION_N_MM;
}

/* A summary of the log between FROM_S and UNTIL_S. */
struct log {
	int ticks, turns;
	double sum_N, low_mm, high_mm;
	bool rises;
};

static void add_row(struct log *log, double depth_mm, double force_N)
{
	if (!log->ticks++)
		log->low_mm = log->high_mm = depth_mm;
	log->sum_N += force_N;
	log->low_mm = fmin(log->low_mm, depth_mm);
	log->high_mm = fmax(log->high_mm, depth_mm);
	if (log->rises ? depth_mm > log->high_mm - 2 * SWING_MM
		       : depth_mm < log->low_mm + 2 * SWING_MM)
		return;
	log->rises = !log->rises;
	log->turns++;
	log->low_mm = log->high_mm = depth_mm;
}

static void read_log(FILE *file, struct log *log)
{
	double t_s, depth_mm, force_N;
	char line[1000];

	rewind(file);
	while (fgets(line, sizeof(line), file))
		if (sscanf(line, "%lf,%*f,%*f,%*f,%lf,%*f,%lf", &t_s, &depth_mm,
			   &force_N) == 3 &&
		    t_s >= FROM_S && t_s < UNTIL_S)
			add_row(log, depth_mm, force_N);
}

/* The last line that a failed program said. */
static int report_failure(FILE *said, struct incise_error *err)
{
	char *line = NULL;
	size_t size = 0;
	bool any = false;

	rewind(said);
	while (getline(&line, &size, said) > 0)
		any = true;
	if (any)
		line[strcspn(line, "\n")] = '\0';
	incise_error_set(err, ECHILD, "%s",
			 any ? line : "incise haptic ended without a reason");
	free(line);
	return -ECHILD;
}

static int run_wall(const struct protocol *protocol, double N_mm, const char *hand,
		    struct log *log, struct incise_error *err)
{
	struct memory_file scene, out = memory_file_begin("log");
	struct memory_file said = memory_file_begin("errors");
	char *program = cli_text("%s/incise-haptic", cli_folder());
	char *rig = cli_text("%s%s%s", protocol->rig, protocol->has_hand ? "," : "",
			     protocol->has_hand ? hand : "");
	char *argv[] = {
		program,   "--rig",    rig,	     "-c", (char *)protocol->calibration,
		"--state", "none",     "--duration", RUN,  "-o",
		"-",	   scene.path, NULL};
	int rc = 0;

	write_wall(&scene, N_mm, protocol->info.peak_N);
	*log = (struct log){0};
	if (child_run(argv, -1, fileno(out.file), fileno(said.file)))
		rc = report_failure(said.file, err);
	else
		read_log(out.file, log);
	if (!rc && !(log->sum_N > LEAN_LEAST_N * log->ticks))
		rc = incise_error_set(err, EDOM,
				      "%s: nothing leant on the wall of %.3g N/mm",
				      protocol->info.name, N_mm);
	fclose(said.file);
	fclose(out.file);
	fclose(scene.file);
	free(rig);
	free(program);
	return rc;
}

/* A simulated device's hand needs no request. A key from before the request is no consent to it. */
static int ask_for_hand(const struct protocol *protocol, const char *what, double N_mm,
			struct incise_error *err)
{
	int c = 0;

	if (protocol->simulated)
		return 0;
	tcflush(STDIN_FILENO, TCIFLUSH);
	fprintf(stderr,
		"%s on the surface of %.3g N/mm below the handle, from %g s on until the "
		"%s are over; press Enter to begin\n",
		what, N_mm, FROM_S, RUN);
	while (c != '\n' && c != EOF)
		c = getchar();
	return c == EOF ? incise_error_set(err, ECANCELED,
					   "the input ended; press Enter at each request")
			: 0;
}

int protocol_force(struct protocol *protocol, struct incise_error *err)
{
	double weight_N_mm = shares[1] * protocol->limit_N_mm;
	struct log log;

	for (int i = 0; i < PROTOCOL_WALLS; i++) {
		double N_mm = shares[i] * protocol->limit_N_mm;

		if (ask_for_hand(protocol,
				 "keep the device's switch at hand, and lean steadily",
				 N_mm, err) ||
		    run_wall(protocol, N_mm, LEANS, &log, err))
			return -err->code;
		protocol->value[SWINGS + i] = log.turns / 2.0 / (UNTIL_S - FROM_S);
	}
	if (ask_for_hand(protocol, "hang 100 g on the handle, and let it rest",
			 weight_N_mm, err) ||
	    run_wall(protocol, weight_N_mm, HANGS, &log, err))
		return -err->code;
	protocol->value[WEIGHT] = 100 * fabs(log.sum_N / log.ticks / WEIGHT_N - 1);
	return 0;
}
