// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A haptic loop from its set-up to its report: in this process, or in the kernel, which this process
 * feeds or watches; see run.h.
 */
#include <errno.h>
#include <sched.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/outfile.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "../cli/loop_report.h"
#include "../cli/state_folder.h"
#include "../cli/stream_report.h"
#include "../stepper/status.h"
#include "hold.h"
#include "run.h"

/* At most so often poses are handed to the kernel, and its status is read. */
#define LOOKS_HZ 1000

/* Leave the reason in the state page, too. */
static _Noreturn void fail_run(struct haptic_job *job, const struct incise_error *err)
{
	incise_state_run(job->haptic.state, INCISE_RUN_FAULT, err->text);
	incise_state_free(job->haptic.state);
	cli_fail_with(err);
}

/* --- the state page -------------------------------------------------------------------- */

/* Default path of the page: free(3); NULL: there is no folder for it. */
static char *state_path(const char *scene)
{
	static bool warned;
	char *list[STATE_FOLDERS], *name = scene_argument_name(scene), *path = NULL;
	int i;

	state_folders(list);
	i = state_folder_choose(list);
	if (i >= 0)
		path = cli_text("%s/%s.state", list[i], name);
	/* The line for the feeder's page named the same folder already. */
	if (i == STATE_FOLDER_TEMPORARY && !warned)
		cli_warn("there is no %s and no XDG_RUNTIME_DIR: the status file is %s, "
			 "which 'incise status' finds for this user only",
			 list[STATE_FOLDER_SYSTEM], path);
	else if (i < 0)
		cli_warn("no status file: %s belongs to another user, or others may "
			 "write there; give --state FILE",
			 list[STATE_FOLDER_TEMPORARY]);
	warned = true;
	state_folders_free(list);
	free(name);
	return path;
}

static char *feeds_at(char *loop_page)
{
	char *page = feeder_page(loop_page);

	free(loop_page);
	return page;
}

static void open_state(struct haptic_job *job, bool real)
{
	struct haptic *haptic = &job->haptic;
	struct incise_state_setup setup = {
		.rate_hz = haptic->loop.rate_hz,
		.rig = incise_rig_spec(haptic->rig),
		.policy = haptic->scheduling,
	};
	struct incise_error err = {0};
	char *path = NULL;

	if (job->state && !strcmp(job->state, "none"))
		return;
	if (job->state)
		path = cli_text("%s", job->state);
	else if (real) /* simulated time is over before anyone looks */
		path = state_path(haptic->argument.path);
	if (path && haptic->mode == HAPTIC_FEED)
		path = feeds_at(path);
	if (!path)
		return;
	haptic->state = incise_state_new(path, &setup, &err);
	if (!haptic->state)
		fail_run(job, &err);
	haptic->loop.state = haptic->state;
	haptic->page = path;
	incise_state_scene(haptic->state, haptic->argument.path, haptic->plan);
}

/* --- start ----------------------------------------------------------------------------- */

static void enter_real_time(struct haptic_job *job)
{
	struct haptic *haptic = &job->haptic;
	static char text[40];
	struct incise_error err = {0};

	haptic->scheduling = "SCHED_OTHER";
	if (job->no_rt) {
		cli_note("normal scheduling (--no-rt): ticks may be late");
		return;
	}
	job->realtime.period_ns = llrint(INCISE_NS_PER_S / haptic->loop.rate_hz);
	haptic->realtime = incise_realtime_new(&job->realtime, &err);
	if (!haptic->realtime)
		cli_fail("%s; or give --no-rt for normal scheduling", err.text);
	if (job->realtime.policy == INCISE_REALTIME_DEADLINE)
		haptic->scheduling = "SCHED_DEADLINE";
	else
		snprintf(text, sizeof(text), "SCHED_FIFO %d", job->realtime.priority);
	if (job->realtime.policy == INCISE_REALTIME_FIFO)
		haptic->scheduling = text;
}

static void advise(const struct incise_realtime_setup *setup)
{
	struct incise_realtime_check checks[INCISE_REALTIME_CHECKS];
	int n = incise_realtime_checks(setup, checks, INCISE_REALTIME_CHECKS);

	for (int i = 0; i < n && i < INCISE_REALTIME_CHECKS; i++)
		if (!checks[i].ok)
			cli_note("real time: %s%s%s", checks[i].found,
				 *checks[i].fix ? "; better: " : "", checks[i].fix);
}

/* Checked before a device is opened: a refusal must not have moved anything. */
static bool has_real_clock(const char *spec)
{
	struct incise_rig *rig = cli_open_rig(spec, 0);
	bool real;

	real = incise_clock_is_real(incise_rig_clock(rig));
	incise_rig_close(rig);
	return real;
}

/* The feeder's page is next to this loop's. */
static struct feeder *own_feeder;

/* However this program ends, but by a signal that kills. */
static void end_own_feeder(void)
{
	if (own_feeder)
		feeder_end(own_feeder);
}

static void begin_feeder(struct haptic_job *job)
{
	struct haptic *haptic = &job->haptic;
	struct incise_error err = {0};
	char *page = job->state ? cli_text("%s", job->state)
				: state_path(haptic->argument.path);

	if (!page || !strcmp(page, "none"))
		cli_fail("--in-kernel needs a status file, to find incise feed by; give "
			 "--state FILE");
	haptic->feeder.page = feeds_at(page);
	own_feeder = &haptic->feeder;
	atexit(end_own_feeder);
	/* From here on a signal ends the feeder, too. */
	cli_catch_signals();
	if (feeder_begin(&haptic->feeder, job->feeder, &err))
		cli_fail("%s: %s", haptic->argument.path, err.text);
	if (!haptic->feeder.own && haptic->tool != INCISE_TOOL_AUTO &&
	    feeder_tool(&haptic->feeder, loop_tool_names[haptic->tool], &err))
		cli_warn("the tool is unchanged: %s", err.text);
}

static void watch(struct haptic_job *job)
{
	struct haptic *haptic = &job->haptic;
	struct incise_error err = {0};

	begin_feeder(job);
	haptic->rig =
		cli_open_rig(cli_rig(job->rig), INCISE_RIG_STEPPER | INCISE_RIG_WATCH);
	haptic->scheduling = "in the kernel";
	haptic->plan = haptic_plan(haptic, haptic->scene, &err);
	if (!haptic->plan || incise_plan_watch(haptic->plan, haptic->rig, &err))
		cli_fail_with(&err);
	open_state(job, true);
}

static void warn_of_network(const struct haptic *haptic)
{
	struct incise_tracker_info info;

	incise_tracker_info(incise_rig_tracker(haptic->rig), &info);
	if (info.network)
		cli_warn(
			"%s: poses come over a network, whose delay has no bound; the force "
			"fades whenever a pose is late",
			info.name);
}

static void test_scene(struct haptic *haptic)
{
	struct incise_error err = {0};
	struct self_test test;

	warn_of_network(haptic);
	if (haptic_self_test(haptic->scene, incise_rig_tracker(haptic->rig), &test, &err))
		cli_fail_with(&err);
	cli_note("self-test: %u ticks in the tissue, at most %.3f N; force 0 within "
		 "%.0f ms of the last pose (limit %.0f)",
		 test.contact, test.force_max_N, test.silent_ms, test.silent_max_ms);
}

/* The scripted hand moves the tip itself. */
static void take_calibration(struct haptic_job *job, const char *rig)
{
	calibration_use(&job->haptic.calibration,
			job->scripted && !job->calibration ? "none" : job->calibration,
			rig);
}

/* Everything but power: scene, real time, devices, plan, self-test. */
static void set_up_run(struct haptic_job *job)
{
	struct haptic *haptic = &job->haptic;
	const char *spec = job->scripted ? PROCEDURE_RIG : cli_rig(job->rig);
	struct incise_error err = {0};
	char *size;
	bool real;

	if (haptic->mode != HAPTIC_LOOP)
		haptic->argument.arith = "fixed";
	haptic->scene = scene_argument_load(&haptic->argument);
	haptic->loop.rate_hz = incise_scene_rate_hz(haptic->scene);
	if (haptic->mode != HAPTIC_LOOP)
		haptic->loop.rate_hz = fmin(haptic->loop.rate_hz, LOOKS_HZ);
	haptic->loop.duration_ns = (int64_t)(job->duration * INCISE_NS_PER_S);
	haptic->scheduling = "simulated time";
	real = has_real_clock(spec);
	if (haptic->mode == HAPTIC_WATCH) {
		take_calibration(job, NULL);
		watch(job);
		return;
	}
	if (real)
		enter_real_time(job);
	haptic->rig = cli_open_rig(spec, INCISE_RIG_TRACKER | INCISE_RIG_STEPPER);
	take_calibration(job, spec);
	haptic->plan = cli_require(haptic_plan(haptic, haptic->scene, &err), &err);
	size = scene_argument_size(haptic->argument.path,
				   incise_plan_surface(haptic->plan));
	if (*size)
		cli_note("surface: %s", size);
	free(size);
	test_scene(haptic);
	haptic_begin_device(haptic);
	if (haptic->mode == HAPTIC_FEED &&
	    incise_plan_feed_kernel(haptic->plan, haptic->rig, &err))
		cli_fail_with(&err);
	if (job->scripted)
		procedure_begin(&job->procedure, haptic->rig, haptic->plan,
				haptic->scene);
	open_state(job, real);
	if (haptic->realtime)
		advise(&job->realtime);
}

/* The module's timers fire on the processor that enables: be there until they are. */
static int prepare_on_cpu(struct haptic_job *job, struct incise_error *err)
{
	cpu_set_t one, before;
	int rc;

	CPU_ZERO(&one);
	CPU_SET(job->timer_cpu, &one);
	if (sched_getaffinity(0, sizeof(before), &before) ||
	    sched_setaffinity(0, sizeof(one), &one))
		return incise_error_set(err, errno, "CPU %d: %s; name one of `nproc`'s",
					job->timer_cpu, strerror(errno));
	rc = hold_prepare(job->haptic.rig, job->home, job->recover, err);
	sched_setaffinity(0, sizeof(before), &before);
	return rc;
}

/* Actuators with power, and poses on their way. Returns 0 or a negative errno. */
static int begin_force(struct haptic_job *job, struct incise_error *err)
{
	struct haptic *haptic = &job->haptic;
	int rc;

	if (haptic->mode == HAPTIC_WATCH)
		return 0;
	rc = haptic->mode == HAPTIC_FEED && job->timer_cpu >= 0
		     ? prepare_on_cpu(job, err)
		     : hold_prepare(haptic->rig, job->home, job->recover, err);
	return rc ? rc : hold_take(haptic->rig, err);
}

static int end_force(struct haptic *haptic, struct incise_error *err)
{
	if (haptic->mode != HAPTIC_WATCH)
		return hold_let_go(haptic->rig, err);
	if (feeder_end(&haptic->feeder))
		return incise_error_set(err, ECHILD, "incise feed ended with an error");
	return 0;
}

static void finish(struct haptic_job *job)
{
	struct haptic *haptic = &job->haptic;

	incise_plan_free(haptic->plan);
	incise_rig_close(haptic->rig);
	incise_scene_free(haptic->scene);
	incise_realtime_free(haptic->realtime);
	free(haptic->loop.log);
	free(haptic->page);
	free(haptic->feeder.page);
}

/* --- log and report -------------------------------------------------------------------- */

static const char *const phases[] = {"free", "cutting", "insertion"};

/* Write them as CSV, with more columns for more than one actuator, under the file's final name; 0 or a negative errno. */
static int write_log(struct incise_outfile *file, const struct incise_tick *ticks,
		     size_t n, int axes, struct incise_error *err)
{
	char flags[INCISE_TICK_FLAGS + 1];
	FILE *out;

	out = incise_outfile_stream(file);
	fputs("t_s,x_mm,y_mm,z_mm,depth_mm,velocity_mm_s,command_N,rendered_N,flags,phase,"
	      "command_x_N,command_y_N,command_z_N,tool",
	      out);
	for (int i = 1; i < axes; i++)
		fprintf(out, ",rendered_%d_N", i + 1);
	fputs(axes > 1 ? ",unfelt_N\n" : "\n", out);
	for (size_t i = 0; i < n; i++) {
		const struct incise_tick *t = &ticks[i];

		fprintf(out,
			"%.6f,%.4f,%.4f,%.4f,%.4f,%.3f,%.5f,%.5f,%s,%s,%.5f,%.5f,%.5f,%s",
			(t->t_ns - ticks[0].t_ns) * 1e-9, t->position_mm[0],
			t->position_mm[1], t->position_mm[2], t->depth_mm,
			t->velocity_mm_s,
			sqrt(t->command_N[0] * t->command_N[0] +
			     t->command_N[1] * t->command_N[1] +
			     t->command_N[2] * t->command_N[2]),
			t->rendered_N[0], loop_flags_text(t->flags, flags),
			phases[t->phase], t->command_N[0], t->command_N[1],
			t->command_N[2], loop_tool_names[t->tool]);
		for (int k = 1; k < axes; k++)
			fprintf(out, ",%.5f", t->rendered_N[k]);
		if (axes > 1)
			fprintf(out, ",%.5f", t->unfelt_N);
		fputc('\n', out);
	}
	return incise_outfile_commit(file, err);
}

/* Memory for all ticks of a run; at most half of the machine's. */
static void make_log(const char *path, double duration_s,
		     struct incise_loop_options *loop)
{
	double most = 0.5 * (double)sysconf(_SC_PHYS_PAGES) *
		      (double)sysconf(_SC_PAGESIZE) / sizeof(*loop->log);
	double ticks = ceil(duration_s * loop->rate_hz) + 1;

	if (ticks <= most)
		loop->log = calloc((size_t)ticks, sizeof(*loop->log));
	if (!loop->log)
		cli_fail("%s: not enough memory for %.0f ticks; give a --duration "
			 "of up to %.0f s, which takes half of it",
			 path, ticks, floor(most / loop->rate_hz));
	loop->log_size = (size_t)ticks;
	/* Touch the pages now: a page fault in the loop is a late tick. */
	memset(loop->log, 0xff, loop->log_size * sizeof(*loop->log));
}

/* The actuators' force against the command of the tick before, rms. */
static double render_error(const struct haptic *haptic)
{
	const struct incise_loop_stats *stats = haptic->stats;

	return incise_rig_stepper(haptic->rig) && stats->ticks > 1
		       ? sqrt(stats->rendered_off2 / (stats->ticks - 1))
		       : NAN;
}

/* The part of the force that cannot be felt on this rig, rms. */
static double unfelt_rms(const struct haptic *haptic)
{
	const struct incise_loop_stats *stats = haptic->stats;

	return incise_rig_stepper(haptic->rig) && stats->ticks
		       ? sqrt(stats->unfelt2 / stats->ticks)
		       : NAN;
}

static int count_axes(struct incise_rig *rig)
{
	int n = 0;

	while (incise_rig_axis(rig, n, NULL))
		n++;
	return incise_rig_haptic(rig) ? 3 : n;
}

static bool is_real(const struct haptic *haptic)
{
	return incise_clock_is_real(incise_rig_clock(haptic->rig));
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

static json_t *counts_json(const struct incise_realtime_counts *counts)
{
	return json_pack("{sI sI sI sI}", "minor_faults",
			 (json_int_t)counts->minor_faults, "major_faults",
			 (json_int_t)counts->major_faults, "voluntary_switches",
			 (json_int_t)counts->voluntary, "involuntary_switches",
			 (json_int_t)counts->involuntary);
}

static json_t *axes_json(struct incise_rig *rig)
{
	struct incise_stepper *stepper;
	struct incise_stepper_info info;
	json_t *axes = json_array();
	double direction[3];

	for (int i = 0; (stepper = incise_rig_axis(rig, i, direction)); i++) {
		incise_stepper_info(stepper, &info);
		json_array_append_new(
			axes, json_pack("{ss so so}", "name", info.name, "direction",
					json_numbers(direction, 3), "counters",
					stepper_counters_json(stepper)));
	}
	return axes;
}

/* "no fresh pose came, its feeder ended"; "none". */
static void reasons_text(unsigned int reasons, char *text, size_t size)
{
	size_t n = 0;

	snprintf(text, size, "none");
	for (int i = 0; i < INCISE_STEPPER_PLAN_REASONS && n < size; i++)
		if (reasons >> i & 1)
			n += (size_t)snprintf(
				text + n, size - n, "%s%s", n ? ", " : "",
				incise_stepper_plan_reason_text(
					(enum incise_stepper_plan_reason)(1 << i)));
}

/* The kernel's own words of its plan; null where this process renders. */
static json_t *kernel_json(const struct haptic *haptic)
{
	struct incise_stepper_rendered r;
	char reasons[400];

	if (haptic->mode == HAPTIC_LOOP)
		return json_null();
	incise_plan_rendered(haptic->plan, &r);
	reasons_text(r.reasons, reasons, sizeof(reasons));
	return json_pack("{ss ss sI sI sI sI}", "state",
			 incise_stepper_plan_state_name(r.state), "reasons", reasons,
			 "ticks", (json_int_t)r.ticks, "missed", (json_int_t)r.missed,
			 "poses", (json_int_t)r.poses, "refused", (json_int_t)r.refused);
}

static void kernel_line(const struct haptic *haptic)
{
	struct incise_stepper_rendered r;
	char reasons[400];

	if (haptic->mode == HAPTIC_LOOP)
		return;
	incise_plan_rendered(haptic->plan, &r);
	reasons_text(r.reasons, reasons, sizeof(reasons));
	printf("kernel     %s; %llu ticks, %llu missed; %llu poses, %llu refused; "
	       "force switched off by: %s\n",
	       incise_stepper_plan_state_name(r.state), (unsigned long long)r.ticks,
	       (unsigned long long)r.missed, (unsigned long long)r.poses,
	       (unsigned long long)r.refused, reasons);
}

/* Why no tick commanded a force: free(3); NULL if one did. */
static char *no_force_text(const struct incise_loop_stats *s)
{
	static const struct {
		enum incise_tick_flag flag;
		const char *text;
	} causes[] = {
		{INCISE_TICK_FAULT, "after a device had failed"},
		{INCISE_TICK_STALE, "without a fresh pose"},
		{INCISE_TICK_UNUSABLE, "with poses that the tracker flagged as bad"},
		{INCISE_TICK_NOT_FINITE, "with a force that was not finite"},
		{INCISE_TICK_STARTING, "while the loop waited for a small force, as out "
				       "of the tissue"},
		{INCISE_TICK_UNPAID, "with a force that no work had paid for"},
		{INCISE_TICK_IN_CUT, "in a cut that was there"},
	};
	const unsigned long long contact = s->forceless[0];
	char *text, *more;

	if (s->force_max_N > 0)
		return NULL;
	if (!contact && !(s->nearest_mm < HUGE_VAL))
		return cli_text("no tick had a fresh pose that can be used");
	if (!contact)
		return cli_text("no contact: the tool came no nearer to the tissue than "
				"%.1f mm",
				fmax(s->nearest_mm, 0));
	if (s->forceless_off != INCISE_HAPTIC_ON)
		return cli_text("%llu ticks in contact, and the force was %s", contact,
				incise_haptic_off_text(s->forceless_off));
	text = cli_text("%llu ticks in contact", contact);
	for (size_t i = 0; i < sizeof(causes) / sizeof(*causes); i++) {
		const uint64_t ticks = s->forceless[__builtin_ctz(causes[i].flag)];

		if (!ticks)
			continue;
		more = cli_text("%s, %llu of them %s", text, (unsigned long long)ticks,
				causes[i].text);
		free(text);
		text = more;
	}
	return text;
}

static void report_run_json(const struct haptic *haptic)
{
	struct incise_stepper *stepper = incise_rig_stepper(haptic->rig);
	const struct incise_loop_stats *s = haptic->stats;
	bool real = is_real(haptic);
	json_t *stages = json_array();
	char *no_force = no_force_text(s);

	for (int i = 0; incise_plan_stage(haptic->plan, i); i++)
		json_array_append_new(stages,
				      json_string(incise_plan_stage(haptic->plan, i)));
	json_print(json_pack(
		"{sI sI sI sf so so sI sI sI sI so so sf so so so so so ss so so so so so so so ss?}",
		"ticks", (json_int_t)s->ticks, "skipped", (json_int_t)s->skipped,
		"overruns", (json_int_t)s->overruns, "rate_hz", haptic->loop.rate_hz,
		"lateness_us", real ? loop_lateness_json(s) : json_null(), "tick_ns",
		real ? cost_json(s) : json_null(), "contact",
		(json_int_t)ticks_with(s, INCISE_TICK_CONTACT), "extrapolated",
		(json_int_t)ticks_with(s, INCISE_TICK_EXTRAPOLATED), "stale",
		(json_int_t)ticks_with(s, INCISE_TICK_STALE), "limited",
		(json_int_t)s->limited, "flags", loop_flags_json(s->flagged), "poses",
		pose_json(&s->poses), "force_max_N", s->force_max_N,
		"rendered_rms_error_N", json_number(render_error(haptic)), "actuator",
		stepper ? stepper_counters_json(stepper) : json_null(), "actuators",
		axes_json(haptic->rig), "unfelt_rms_N", json_number(unfelt_rms(haptic)),
		"unfelt_max_N", stepper ? json_real(s->unfelt_max_N) : json_null(),
		"scheduling", haptic->scheduling, "thread", counts_json(&haptic->counts),
		"stages", stages, "stopped_by",
		cli_stop ? json_string(strsignal(cli_stop)) : json_null(), "kernel",
		kernel_json(haptic), "calibration",
		calibration_json(&haptic->calibration), "haptic",
		haptic_device_json(haptic), "texture_felt", json_number(s->texture_felt),
		"no_force", no_force));
	free(no_force);
}

/* Directions that can be felt, and the part of the force that cannot. */
static void felt_line(const struct haptic *haptic)
{
	double direction[3];

	printf("\nfelt      ");
	for (int i = 0; incise_rig_axis(haptic->rig, i, direction); i++)
		printf("%s along (%.4g, %.4g, %.4g)", i ? "," : "", direction[0],
		       direction[1], direction[2]);
	printf("; not felt: %.4f N rms, at most %.3f N", unfelt_rms(haptic),
	       haptic->stats->unfelt_max_N);
}

static void report_run_text(const struct haptic *haptic)
{
	struct incise_stepper *stepper = incise_rig_stepper(haptic->rig);
	const struct incise_loop_stats *s = haptic->stats;
	double rms_N = render_error(haptic);
	char a[32], b[32], flags[1000], *no_force = no_force_text(s);

	printf("%llu ticks at %g Hz, %llu missed deadlines in %llu overruns (%s)\n"
	       "stages    ",
	       (unsigned long long)s->ticks, haptic->loop.rate_hz,
	       (unsigned long long)s->skipped, (unsigned long long)s->overruns,
	       haptic->scheduling);
	for (int i = 0; incise_plan_stage(haptic->plan, i); i++)
		printf(" %s", incise_plan_stage(haptic->plan, i));
	printf("\ncalibration %s\n", calibration_text(&haptic->calibration));
	/* In simulated time a tick takes no time and is never late. */
	if (is_real(haptic)) {
		loop_lateness_line(s);
		printf("tick       median %s, 99.9 %% %s, max %.1f us\n",
		       loop_below(a, sizeof(a), loop_quantile(s->tick_100ns, 0.5, 0.1)),
		       loop_below(b, sizeof(b), loop_quantile(s->tick_100ns, 0.999, 0.1)),
		       s->tick_max_ns * 1e-3);
		printf("thread     %llu page faults, %llu involuntary context "
		       "switches\n",
		       (unsigned long long)(haptic->counts.minor_faults +
					    haptic->counts.major_faults),
		       (unsigned long long)haptic->counts.involuntary);
	}
	printf("force      largest %.3f N", s->force_max_N);
	if (!isnan(rms_N))
		printf(", actuator off by %.4f N rms", rms_N);
	if (stepper)
		felt_line(haptic);
	if (no_force)
		printf("\nno force   %s", no_force);
	free(no_force);
	printf("\n"
	       "ticks      %llu in contact, %llu out of the training range, %llu "
	       "without a fresh pose, %llu limited\n",
	       (unsigned long long)ticks_with(s, INCISE_TICK_CONTACT),
	       (unsigned long long)ticks_with(s, INCISE_TICK_EXTRAPOLATED),
	       (unsigned long long)ticks_with(s, INCISE_TICK_STALE),
	       (unsigned long long)s->limited);
	if (incise_pose_counts_text(&s->poses, flags, sizeof(flags)))
		printf("poses      %s\n", flags);
	printf("limited    %llu ticks by force, %llu by slew rate, %llu by travel, %llu in "
	       "the start ramp\n",
	       (unsigned long long)ticks_with(s, INCISE_TICK_CLAMPED),
	       (unsigned long long)ticks_with(s, INCISE_TICK_SLEWED),
	       (unsigned long long)ticks_with(s, INCISE_TICK_TRAVEL),
	       (unsigned long long)ticks_with(s, INCISE_TICK_STARTING));
	loop_texture_line(s, haptic->scene);
	kernel_line(haptic);
	haptic_device_line(haptic);
	for (int i = 0; (stepper = incise_rig_axis(haptic->rig, i, NULL)); i++)
		stepper_counters_line(stepper);
}

/* --- the session ----------------------------------------------------------------------- */

/* Between two ticks of simulated time. */
static int ticked_run(void *context, const struct incise_tick *tick)
{
	struct haptic_job *job = context;

	if (job->haptic.session)
		session_log_tick(job->haptic.session, tick);
	if (job->scripted)
		procedure_ticked(&job->procedure, tick);
	return 0;
}

/* Simulated time runs ahead of the supervisor: there the loop's thread gives the ticks. */
static void open_session(struct haptic_job *job)
{
	struct haptic *haptic = &job->haptic;
	const struct session_start start = {.program = "haptic",
					    .source = incise_rig_spec(haptic->rig),
					    .scene = haptic->scene,
					    .scene_path = haptic->argument.path,
					    .real = is_real(haptic)};

	haptic->session = session_log_begin(&job->session, &start);
	if (start.real || (!haptic->session && !job->scripted))
		return;
	haptic->loop.ticked = ticked_run;
	haptic->loop.context = job;
}

static int end_session(struct haptic *haptic, int rc, const struct incise_error *cause,
		       struct incise_error *err)
{
	const char *why = rc ? cause->text : cli_stop ? strsignal(cli_stop) : "";

	return session_log_end(haptic->session,
			       rc	  ? "fault"
			       : cli_stop ? "signal"
					  : "asked",
			       why, err);
}

int haptic_run(struct haptic_job *job)
{
	static struct incise_loop_stats stats;
	struct incise_outfile *file = NULL;
	struct incise_error err = {0}, left = {0}, log_err = {0}, session_err = {0};
	struct haptic *haptic = &job->haptic;
	int rc, released;

	haptic->stats = &stats;
	haptic->loop.stop = &cli_stop;
	set_up_run(job);
	if (job->log) {
		/* A wrong path fails before the run, not after it. */
		file = incise_outfile_open(job->log, &err);
		if (!file)
			fail_run(job, &err);
		make_log(job->log, job->duration, &haptic->loop);
	}
	open_session(job);
	cli_catch_signals();
	haptic_catch_reload();
	if (begin_force(job, &err)) {
		/* Closed, as a motor that this process steps keeps its power without it. */
		incise_rig_close(haptic->rig);
		fail_run(job, &err);
	}
	cli_progress("%s: %g Hz, Ctrl-C ends", haptic->argument.path,
		     haptic->loop.rate_hz);
	rc = haptic_supervise(haptic, &err);
	cli_progress_end();
	released = end_force(haptic, &left);
	/* Behind a failure of the loop, a fault of the actuator is the same one. */
	if (!rc && released) {
		rc = released;
		err = left;
	} else if (released && released != -EIO) {
		cli_warn("%s", left.text);
	}
	incise_state_run(haptic->state, rc ? INCISE_RUN_FAULT : INCISE_RUN_STOPPED,
			 rc	    ? err.text
			 : cli_stop ? strsignal(cli_stop)
				    : "");
	incise_state_free(haptic->state);
	if (job->log)
		write_log(file, haptic->loop.log, stats.logged, count_axes(haptic->rig),
			  &log_err);
	end_session(haptic, rc, &err, &session_err);
	if (ticks_with(&stats, INCISE_TICK_FULL))
		cli_warn("the blade left no cut in %llu ticks: the scene has "
			 "tissue.cuts_most cuts already; raise it",
			 (unsigned long long)ticks_with(&stats, INCISE_TICK_FULL));
	if (job->json) {
		report_run_json(haptic);
	} else if (!job->log || strcmp(job->log, "-")) {
		report_run_text(haptic);
		cli_written();
	}
	cli_finish();
	finish(job);
	/* The run cannot be repeated: its summary comes first, with or without its log. */
	if (rc && log_err.code)
		cli_warn("%s", log_err.text);
	if ((rc || log_err.code) && session_err.code)
		cli_warn("%s", session_err.text);
	if (rc)
		cli_fail("%s: %s", haptic->argument.path, err.text);
	if (log_err.code)
		cli_fail_with(&log_err);
	if (session_err.code)
		cli_fail_with(&session_err);
	return 0;
}
