// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise haptic SCENE: the real-time loop, tracker in, force out, with tick statistics.
 */
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/calibration.h>
#include <incise/loop.h>
#include <incise/outfile.h>
#include "cli.h"
#include "json.h"
#include "loop_report.h"
#include "scene_argument.h"
#include "stepper_counters.h"

enum {
	OPT_MODEL = CLI_LONG,
	OPT_ARITH,
	OPT_TOOL,
	OPT_DURATION,
	OPT_HOME,
	OPT_LOG,
	OPT_JSON
};

static const struct cli_option options[] = {
	{'r', "rig", "RIG",
	 "file rig.conf, or sim:KEY=VALUE,… for the virtual rig\n"
	 "(default: ./rig.conf, else /etc/incise/rig.conf)"},
	{'c', "calibration", "FILE",
	 "calibration.conf, for where the tip is (default: where the\n"
	 "tracker takes it to be)"},
	{OPT_MODEL, "model", "FILE", "use this model instead of the scene's"},
	{OPT_ARITH, "arith", "KIND", "fixed or double, instead of the scene's"},
	{OPT_TOOL, "tool", "KIND",
	 "what the hand holds: auto (blade or handle, by the scalpel's turn), blade,\n"
	 "handle or tube (default: auto)"},
	{OPT_DURATION, "duration", "TIME",
	 "stop after this time, e.g. 10s (default: at SIGINT)"},
	{OPT_HOME, "home", NULL, "find the actuator's 0 first, unless it is known"},
	{OPT_LOG, "log", "FILE", "write every tick as CSV at the end; needs --duration"},
	{OPT_JSON, "json", NULL, "report as JSON"},
	{0},
};

static const struct cli_verb verb = {
	.name = "haptic",
	.synopsis = "SCENE [OPTIONS]",
	.summary =
		"Run the haptic loop of a scene: read the pose, evaluate the force, drive the\n"
		"actuator, at the scene's rate. Not a safety device, not a medical device.",
	.options = options,
	.notes =
		"Example:\n  incise haptic scenes/liver.scene --rig sim: --duration 10s\n\n"
		"Exit: 0 ended as asked, 1 failed, 2 bad usage. See incise-haptic(1).",
};

struct job {
	struct scene_argument scene;
	const char *rig, *log, *calibration;
	enum incise_tool tool;
	double duration;
	bool json, home;
};

static enum incise_tool tool_named(const char *name)
{
	static const char *const names[] = {"auto", "blade", "handle", "tube"};

	for (int i = 0; i < 4; i++)
		if (!strcmp(name, names[i]))
			return (enum incise_tool)i;
	cli_usage("--tool: '%s' is none of auto, blade, handle, tube", name);
}

static void parse(struct job *job, int argc, char **argv)
{
	int opt;

	*job = (struct job){0};
	while ((opt = cli_next(&verb, argc, argv)) != CLI_END)
		switch (opt) {
		case 'r':
			job->rig = optarg;
			break;
		case 'c':
			job->calibration = optarg;
			break;
		case OPT_MODEL:
			job->scene.model = optarg;
			break;
		case OPT_ARITH:
			scene_argument_arith(&job->scene, optarg);
			break;
		case OPT_TOOL:
			job->tool = tool_named(optarg);
			break;
		case OPT_DURATION:
			job->duration = cli_duration("duration", optarg, 0.01, 86400);
			break;
		case OPT_HOME:
			job->home = true;
			break;
		case OPT_LOG:
			job->log = optarg;
			break;
		case OPT_JSON:
			job->json = true;
			break;
		}
	scene_argument_operand(&job->scene, argc, argv, optind);
	if (job->log && !job->duration)
		cli_usage("--log keeps all ticks in memory: it needs --duration");
	if (job->json && job->log && !strcmp(job->log, "-"))
		cli_usage("--json and --log - would both write to standard output");
}

static const char *const phases[] = {"free", "cutting", "insertion"};

static void write_log(struct incise_outfile *file, const struct incise_tick *ticks,
		      size_t n)
{
	struct incise_error err = {0};
	char flags[INCISE_TICK_FLAGS + 1];
	FILE *out;

	out = incise_outfile_stream(file);
	fputs("t_s,x_mm,y_mm,z_mm,depth_mm,velocity_mm_s,command_N,rendered_N,flags,phase,"
	      "command_x_N,command_y_N,command_z_N\n",
	      out);
	for (size_t i = 0; i < n; i++) {
		const struct incise_tick *t = &ticks[i];

		fprintf(out,
			"%.6f,%.4f,%.4f,%.4f,%.4f,%.3f,%.5f,%.5f,%s,%s,%.5f,%.5f,%.5f\n",
			(t->t_ns - ticks[0].t_ns) * 1e-9, t->position_mm[0],
			t->position_mm[1], t->position_mm[2], t->depth_mm,
			t->velocity_mm_s,
			sqrt(t->command_N[0] * t->command_N[0] +
			     t->command_N[1] * t->command_N[1] +
			     t->command_N[2] * t->command_N[2]),
			t->rendered_N, loop_flags_text(t->flags, flags), phases[t->phase],
			t->command_N[0], t->command_N[1], t->command_N[2]);
	}
	if (incise_outfile_commit(file, &err))
		cli_fail_with(&err);
}

/* Room for all ticks of the run, of half of this machine's memory at most. */
static void make_log(const struct job *job, struct incise_loop_options *loop)
{
	double most = 0.5 * (double)sysconf(_SC_PHYS_PAGES) *
		      (double)sysconf(_SC_PAGESIZE) / sizeof(*loop->log);
	double ticks = ceil(job->duration * loop->rate_hz) + 1;

	if (ticks <= most)
		loop->log = calloc((size_t)ticks, sizeof(*loop->log));
	if (!loop->log)
		cli_fail("--log: no memory for %.0f ticks; a --duration of up to %.0f s "
			 "fits in half of it",
			 ticks, floor(most / loop->rate_hz));
	loop->log_size = (size_t)ticks;
	/* Touch the pages now: a fault in the loop is a late tick. */
	memset(loop->log, 0xff, loop->log_size * sizeof(*loop->log));
}

/* How far the actuator's force was from the one asked of it at the tick before, rms. */
static double render_error(const struct incise_loop_stats *stats)
{
	return stats->ticks > 1 ? sqrt(stats->rendered_off2 / (stats->ticks - 1)) : NAN;
}

static const char *scheduling(bool real)
{
	int policy = sched_getscheduler(0);

	if (!real)
		return "simulated time";
	return policy == SCHED_FIFO ? "SCHED_FIFO"
	       : policy == SCHED_RR ? "SCHED_RR"
				    : "SCHED_OTHER";
}

static json_t *cost_json(const struct incise_loop_stats *s)
{
	return json_pack("{so so so}", "median",
			 json_number(loop_quantile(s->tick_100ns, 0.5, 100)), "p999",
			 json_number(loop_quantile(s->tick_100ns, 0.999, 100)), "max",
			 json_number(s->tick_max_ns));
}

static uint64_t ticks_with(const struct incise_loop_stats *s, enum incise_tick_flag flag)
{
	return s->flagged[__builtin_ctz(flag)];
}

static void report_json(const struct incise_loop_stats *s, const struct incise_plan *plan,
			struct incise_stepper *stepper, bool real, double rate_hz,
			double rms_N)
{
	json_t *stages = json_array();

	for (int i = 0; incise_plan_stage(plan, i); i++)
		json_array_append_new(stages, json_string(incise_plan_stage(plan, i)));
	json_print(json_pack(
		"{sI sI sf so so sI sI sI sI so sf so so ss so so}", "ticks",
		(json_int_t)s->ticks, "skipped", (json_int_t)s->skipped, "rate_hz",
		rate_hz, "lateness_us", real ? loop_lateness_json(s) : json_null(),
		"tick_ns", real ? cost_json(s) : json_null(), "contact",
		(json_int_t)ticks_with(s, INCISE_TICK_CONTACT), "extrapolated",
		(json_int_t)ticks_with(s, INCISE_TICK_EXTRAPOLATED), "stale",
		(json_int_t)ticks_with(s, INCISE_TICK_STALE), "limited",
		(json_int_t)s->limited, "flags", loop_flags_json(s->flagged),
		"force_max_N", s->force_max_N, "rendered_rms_error_N", json_number(rms_N),
		"actuator", stepper ? stepper_counters_json(stepper) : json_null(),
		"scheduling", scheduling(real), "stages", stages, "stopped_by",
		cli_stop ? json_string(strsignal(cli_stop)) : json_null()));
}

static void report_text(const struct incise_loop_stats *s, const struct incise_plan *plan,
			struct incise_stepper *stepper, bool real, double rate_hz,
			double rms_N)
{
	char a[32], b[32];

	printf("%llu ticks at %g Hz, %llu skipped (%s)\nstages    ",
	       (unsigned long long)s->ticks, rate_hz, (unsigned long long)s->skipped,
	       scheduling(real));
	for (int i = 0; incise_plan_stage(plan, i); i++)
		printf(" %s", incise_plan_stage(plan, i));
	putchar('\n');
	/* In simulated time a tick takes none and is never late. */
	if (real) {
		loop_lateness_line(s);
		printf("tick       median %s, 99.9 %% %s, max %.1f us\n",
		       loop_below(a, sizeof(a), loop_quantile(s->tick_100ns, 0.5, 0.1)),
		       loop_below(b, sizeof(b), loop_quantile(s->tick_100ns, 0.999, 0.1)),
		       s->tick_max_ns * 1e-3);
	}
	printf("force      largest %.3f N", s->force_max_N);
	if (!isnan(rms_N))
		printf(", actuator off by %.4f N rms", rms_N);
	printf("\nticks      %llu in contact, %llu outside the model's support, %llu without a "
	       "fresh pose, %llu limited\n",
	       (unsigned long long)ticks_with(s, INCISE_TICK_CONTACT),
	       (unsigned long long)ticks_with(s, INCISE_TICK_EXTRAPOLATED),
	       (unsigned long long)ticks_with(s, INCISE_TICK_STALE),
	       (unsigned long long)s->limited);
	printf("held       %llu at the largest force, %llu at the largest slew, %llu at the end "
	       "of the travel, %llu by the guard, %llu starting or fading\n",
	       (unsigned long long)ticks_with(s, INCISE_TICK_CLAMPED),
	       (unsigned long long)ticks_with(s, INCISE_TICK_SLEWED),
	       (unsigned long long)ticks_with(s, INCISE_TICK_TRAVEL),
	       (unsigned long long)ticks_with(s, INCISE_TICK_GUARDED),
	       (unsigned long long)ticks_with(s, INCISE_TICK_STARTING));
	if (stepper)
		stepper_counters_line(stepper);
}

static int home(struct incise_stepper *stepper, struct incise_error *err)
{
	int rc = incise_stepper_enable(stepper, err);

	if (!rc)
		rc = incise_stepper_home(stepper, &cli_stop, err);
	return rc ? rc : incise_stepper_disable(stepper, err);
}

/*
 * Poses that came while one was busy are old. To take them in the first tick would keep the
 * actuator waiting, longer than its deadman does.
 */
static void drop_poses(struct incise_tracker *tracker)
{
	struct incise_tracker_sample samples[64];

	while (incise_tracker_read(tracker, samples, 64) == 64)
		continue;
}

/*
 * Power the actuator. Without its 0 a target is no position: that of a real machine must
 * be found, where it has a switch for that.
 */
static void take_hold(const struct job *job, struct incise_rig *rig)
{
	struct incise_stepper *stepper = incise_rig_stepper(rig);
	struct incise_stepper_status status;
	struct incise_stepper_info info;
	struct incise_error err = {0};
	int rc = incise_stepper_status(stepper, &status);

	incise_stepper_info(stepper, &info);
	if (rc)
		cli_fail("%s: %s", info.name, strerror(-rc));
	if (!status.homed && !job->home) {
		if (info.can_home)
			cli_fail(
				"%s is not homed; run `incise stepper home --rig %s`, or "
				"give --home",
				info.name, incise_rig_spec(rig));
		cli_warn("%s cannot be homed: its 0 is where it stands", info.name);
	}
	if (!status.homed && job->home)
		rc = home(stepper, &err);
	if (!rc)
		drop_poses(incise_rig_tracker(rig));
	if (!rc)
		rc = incise_stepper_enable(stepper, &err);
	if (!rc)
		return;
	/* Steps that are made in this program do not lose their power with it. */
	incise_rig_close(rig);
	cli_fail_with(&err);
}

/* To where there is no force, then without power. */
static void let_go(struct incise_rig *rig)
{
	struct incise_stepper *stepper = incise_rig_stepper(rig);
	struct incise_clock *clock = incise_rig_clock(rig);
	struct incise_stepper_status status;
	struct incise_stepper_info info;
	struct incise_error err = {0};
	int64_t now = incise_clock_now(clock), end;

	incise_stepper_info(stepper, &info);
	/* The virtual one has no power to lose: it goes there by itself. */
	end = info.measures_handle
		      ? now
		      : now + (int64_t)((1 + info.travel_mm / info.velocity_mm_s) *
					INCISE_NS_PER_S);
	while (now < end && !incise_stepper_set(stepper, 0) &&
	       !incise_stepper_status(stepper, &status) &&
	       (status.position_mm > info.step_mm / 2 ||
		status.state == INCISE_STEPPER_MOVING)) {
		incise_clock_wait_until(clock, now + 2000000);
		now = incise_clock_now(clock);
	}
	if (incise_stepper_disable(stepper, &err))
		cli_warn("%s", err.text);
}

int main(int argc, char **argv)
{
	struct incise_loop_options loop = {.stop = &cli_stop};
	static struct incise_loop_stats stats;
	struct incise_calibration calibration;
	struct incise_error err = {0};
	struct incise_outfile *file = NULL;
	struct incise_scene *scene;
	struct incise_plan *plan;
	struct incise_rig *rig;
	struct job job;
	double rms_N;
	bool real;
	int rc;

	parse(&job, argc, argv);
	incise_calibration_nominal(&calibration);
	if (job.calibration &&
	    incise_calibration_load(job.calibration, &calibration, &err))
		cli_fail_with(&err);
	scene = scene_argument_load(&job.scene);
	rig = incise_rig_open(cli_rig(job.rig), INCISE_RIG_TRACKER | INCISE_RIG_STEPPER,
			      &err);
	if (!rig)
		cli_fail_with(&err);
	plan = incise_plan_new(scene, rig, &err);
	if (!plan)
		cli_fail_with(&err);
	incise_plan_set_tool(plan, job.tool);
	incise_plan_set_tip(plan, calibration.tip_mm);
	loop.rate_hz = incise_scene_rate_hz(scene);
	loop.duration_ns = (int64_t)(job.duration * INCISE_NS_PER_S);
	if (job.log) {
		/* A path that cannot be is said before the run, not after. */
		file = incise_outfile_open(job.log, &err);
		if (!file)
			cli_fail_with(&err);
		make_log(&job, &loop);
	}
	real = incise_clock_is_real(incise_rig_clock(rig));
	cli_catch_signals();
	take_hold(&job, rig);
	cli_progress("%s: %g Hz, Ctrl-C ends", job.scene.path, loop.rate_hz);
	rc = incise_loop_run(plan, incise_rig_clock(rig), &loop, &stats, &err);
	cli_progress_end();
	let_go(rig);
	rms_N = incise_rig_stepper(rig) ? render_error(&stats) : NAN;
	if (job.log)
		write_log(file, loop.log, stats.logged);
	if (job.json)
		report_json(&stats, plan, incise_rig_stepper(rig), real, loop.rate_hz,
			    rms_N);
	else if (!job.log || strcmp(job.log, "-"))
		report_text(&stats, plan, incise_rig_stepper(rig), real, loop.rate_hz,
			    rms_N);
	cli_finish();
	incise_plan_free(plan);
	incise_rig_close(rig);
	incise_scene_free(scene);
	free(loop.log);
	if (rc)
		cli_fail("%s: %s", job.scene.path, err.text);
	return 0;
}
