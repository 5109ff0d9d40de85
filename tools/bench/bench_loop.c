// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench loop: the cost of a tick of the haptic loop, and how late the machine wakes
 * it, idle and under loads, next to cyclictest of rt-tests, a program that only sleeps and looks at the clock.
 *
 * The loop runs a scene on the virtual rig in a thread of its own, and cyclictest runs next to
 * it, on the same processor, with the same policy and interval, half a period apart:
 *
 *   cyclictest      |               |               |
 *   loop                    |█              |█              |█
 *   of a second |               |               |               |
 *               0  T/4     3T/4
 *
 * So both meet the same host, interrupts and load, in the same minute: on a shared machine
 * minutes differ by more than the programs do. As long as a tick costs less than T/2 neither is
 * ready while the other works. Neither wakes at full milliseconds, where the kernel has its own
 * tick to do.
 *
 * The cause of an overrun: cyclictest's priority is one above the loop's, so no tick holds it up.
 * Where cyclictest waited in vain for half of the time that the loop was late, or longer, the
 * machine stood still: the host of a virtual one, mostly. Any other overrun is the program's.
 *
 *   loop        |█      |█      :       :       :    |█     left out: 3
 *   cyclictest      |       |........................|      late: the machine's
 */
#include <limits.h>
#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/loop.h>
#include <incise/plan.h>
#include <incise/realtime.h>
#include <incise/scene.h>
#include "bench.h"
#include "../cli/child.h"
#include "../cli/file.h"
#include "../cli/folder.h"
#include "../cli/json.h"
#include "../cli/machine.h"
#include "../cli/stopwatch.h"
#include "sheet.h"
#include "../plan/tick_cost.h"

/* --- the cost of a tick: scenes with every force and limits, or the user's --- */

/* Pace of the stroke's time, which goes by faster. */
#define MEASURED_S 60
#define QUICK_MEASURED_S 4
#define TURN_TICKS 2000
#define TURNS 49
#define QUICK_TURNS 7

static const char all_forces[] =
	"rate_hz = %.1f;\narithmetic = \"%s\";\n"
	"surface = { %s };\n"
	"tissue = { gain = 0.5; reaction_N_mm = 0.14; plane_N_mm = 0.17;\n"
	"  damping_N_s_mm = 0.0005; insertion_N_mm = 0.28; spread_N_mm = 0.22; };\n"
	"effects = { average_ticks = 8; };\n";

static const struct own {
	const char *name, *arithmetic, *surface;
	int cells; /* along each side of a sheet; two triangles each */
} own[] = {
	{"plane", "double", "kind = \"plane\";", 0},
	{"plane_fixed", "fixed", "kind = \"plane\";", 0},
	{"sphere", "double",
	 "kind = \"sphere\"; centre_mm = [0.0, 0.0, -50.0]; radius_mm = 50.0;", 0},
	{"mesh_20000", "double", "kind = \"mesh\"; file = \"%s\";", 100},
	{"mesh_500000", "double", "kind = \"mesh\"; file = \"%s\";", 500},
};

struct tick_row {
	const char *name, *failed;
	size_t memory, triangles;
	double load_s;
	struct tick_cost cost;
	struct harness_time time; /* of a tick, in turn with the others */
	/* While they are measured: */
	struct incise_scene *scene;
	struct tick_stroke *timed;
};

static void load_scene(const char *path, struct tick_row *row)
{
	struct incise_error err = {0};
	struct incise_plan *plan;
	double begin = stopwatch_ns();

	row->scene = cli_require(incise_scene_load(path, NULL, &err), &err);
	row->load_s = (stopwatch_ns() - begin) * 1e-9;
	plan = cli_require(incise_plan_new(row->scene, NULL, &err), &err);
	row->memory = incise_plan_memory(plan);
	incise_plan_free(plan);
}

static double turn_ns(void *context)
{
	static double buffer[TURN_TICKS];
	const struct tick_row *row = context;

	/* Caches and branches are as the variants before left them. */
	tick_stroke_ns(row->timed, TURN_TICKS / 4, buffer);
	return tick_stroke_ns(row->timed, TURN_TICKS, buffer);
}

/* Quantiles of a long run each, and then medians in turn. */
static void time_ticks(struct tick_row *rows, int n, bool quick)
{
	struct harness_variant variants[N(own)];

	for (int i = 0; i < n; i++) {
		cli_progress("%s", rows[i].name);
		tick_cost(rows[i].scene, NULL, NULL,
			  quick ? QUICK_MEASURED_S : MEASURED_S, &rows[i].cost);
		if (!rows[i].cost.ticks)
			cli_fail(
				"%s: a stroke over its top met no tissue: nothing to time",
				rows[i].name);
		rows[i].timed =
			tick_stroke_new(rows[i].scene, NULL, NULL, rows[i].cost.tool);
		variants[i] = (struct harness_variant){
			.ns = turn_ns, .context = &rows[i], .time = &rows[i].time};
	}
	harness_times(variants, n, quick ? QUICK_TURNS : TURNS);
	for (int i = 0; i < n; i++) {
		tick_stroke_free(rows[i].timed);
		incise_scene_free(rows[i].scene);
	}
}

static struct memory_file write_scene(const struct own *own, const char *sheet,
				      double rate_hz)
{
	struct memory_file file = memory_file_begin("scene");
	char surface[120];

	snprintf(surface, sizeof(surface), own->surface, sheet);
	fprintf(file.file, all_forces, rate_hz, own->arithmetic, surface);
	memory_file_written(&file);
	return file;
}

static struct memory_file plane(double rate_hz)
{
	return write_scene(&own[0], NULL, rate_hz);
}

static void load_own(const struct own *own, struct tick_row *row)
{
	struct memory_file sheet = {0}, scene;

	cli_progress("%s", own->name);
	if (own->cells)
		sheet = sheet_of_waves(own->cells, false);
	scene = write_scene(own, sheet.path, 1000);
	row->name = own->name;
	row->triangles = 2 * (size_t)own->cells * own->cells;
	load_scene(scene.path, row);
	fclose(scene.file);
	if (sheet.file)
		fclose(sheet.file);
}

static const struct bench_table tick_table = {
	.key = "rows",
	.row_bytes = sizeof(struct tick_row),
	.columns = {COLUMN(tick_row, "name", name),
		    COLUMN(tick_row, "triangles", triangles),
		    COLUMN(tick_row, "ticks", cost.ticks),
		    COLUMN(tick_row, "tick_ns.median", cost.median),
		    COLUMN(tick_row, "tick_ns.p99", cost.p99),
		    COLUMN(tick_row, "tick_ns.p999", cost.p999),
		    COLUMN(tick_row, "load_s", load_s),
		    COLUMN(tick_row, "memory_bytes", memory),
		    COLUMN(tick_row, "ns", time.ns.median),
		    COLUMN(tick_row, "ns_p5", time.ns.p5),
		    COLUMN(tick_row, "ns_p95", time.ns.p95),
		    COLUMN(tick_row, "failed", failed)},
	.metrics = {METRIC(TIME, tick_row, time, "ns", "tick {name}")},
};

/* --- wake-ups: loads --- */

#define UNDER_WAY_US 500000
#define BLEEDING_S 4
#define LONGER_S 30 /* than it is needed: the end of one whose bench was killed */

/* Nothing, stress-ng on processors, memory or disk, or `incise view` at 60 frames a second. */
enum load_kind { LOAD_IDLE, LOAD_CPU, LOAD_MEMORY, LOAD_DISK, LOAD_VIEW, LOADS };
const char *const bench_loads[LOADS + 1] = {"idle", "cpu", "memory", "disk", "view"};

/* Wake-ups of one program, us. Quantiles are upper edges of bins. */
struct lateness {
	double p999; /* NaN: not measured */
	uint64_t ticks;
	json_t *json; /* {"min", "median", …, "ticks"}, or null */
};

/* Its memory is never freed. */
struct wakeup {
	const char *load;
	double rate_hz;
	const char *no_load;	   /* why it was not measured, or NULL */
	const char *no_cyclictest; /* why there is no cyclictest next to it, or NULL */
	struct lateness loop, cyclictest;
	struct harness_spread median, p999; /* of the loop, with their intervals */
	double ratio;	  /* of the 99.9 %, the loop's by cyclictest's */
	uint64_t skipped; /* ticks of the loop */
	double machine; /* of these, while cyclictest was held up as well; NaN: unknown */
	double tick_us; /* median after each sleep, with cold caches */
	double tick_max_us;
	double frames_hz; /* drawn meanwhile by the view, or NaN */
};

#define WAKEUPS_MAX (2 * LOADS)

struct wakeups {
	struct wakeup row[WAKEUPS_MAX];
	int n;
	double seconds; /* of each */
	bool realtime;	/* SCHED_FIFO and locked memory, else the shell's policy */
	int cpu;	/* of both programs */
};

/* Arguments of stress-ng: one worker per processor, and one at the disk. */
static const char *const stress[LOADS][4] = {
	[LOAD_CPU] = {"--cpu", "0"},
	[LOAD_MEMORY] = {"--vm", "0", "--vm-bytes", "128m"},
	[LOAD_DISK] = {"--hdd", "1", "--hdd-bytes", "64m"},
};

struct load_run {
	pid_t pid;	       /* 0: no stress-ng runs */
	char folder[PATH_MAX]; /* where a disk is kept busy, or empty */
	struct memory_file said;
};

static const char *begin_stress(enum load_kind load, double seconds, struct load_run *run)
{
	const char *argv[16] = {"stress-ng", "--quiet", "--timeout",
				cli_text("%.0f", seconds + LONGER_S)};
	int n = 4;

	if (!child_possible("stress-ng"))
		return "stress-ng is not installed: apt-get install stress-ng";
	for (int i = 0; i < 4 && stress[load][i]; i++)
		argv[n++] = stress[load][i];
	/* It makes a folder there for any of its workers. */
	folder_make(run->folder, sizeof(run->folder), "to keep the disk busy in");
	argv[n++] = "--temp-path";
	argv[n++] = run->folder;
	run->pid = child_start((char *const *)argv, -1, -1);
	return NULL;
}

static const char *begin_view(const char *scene, double seconds, struct load_run *run)
{
	const char *argv[] = {cli_text("%s/incise-view", cli_folder()),
			      scene,
			      "--procedure",
			      "-o",
			      "none",
			      "--duration",
			      cli_text("%.0f", seconds + LONGER_S),
			      NULL};

	if (access(argv[0], X_OK))
		return "incise-view is not there";
	run->said = memory_file_begin("view");
	run->pid = child_start((char *const *)argv, fileno(run->said.file), -1);
	/* Until the skin is painted and the cut bleeds. */
	sleep(BLEEDING_S);
	return NULL;
}

/* Returns the frame rate of a view, else NaN. */
static double load_end(struct load_run *run)
{
	double frames_hz = NAN;

	if (run->pid)
		child_end(run->pid, 0);
	if (run->said.file) {
		rewind(run->said.file);
		if (fscanf(run->said.file, "%lf", &frames_hz) != 1)
			frames_hz = NAN;
		fclose(run->said.file);
	}
	if (*run->folder)
		folder_remove(run->folder);
	return frames_hz;
}

/* Begin, for @seconds at most, and wait until it is under way. Returns NULL, or why there is
 * no such load here. */
static const char *load_begin(enum load_kind load, const char *scene, double seconds,
			      struct load_run *run)
{
	const char *why;
	int status;

	if (load == LOAD_IDLE)
		return NULL;
	why = load == LOAD_VIEW ? begin_view(scene, seconds, run)
				: begin_stress(load, seconds, run);
	if (why)
		return why;
	usleep(UNDER_WAY_US);
	if (child_ended(run->pid, &status)) {
		run->pid = 0;
		load_end(run);
		return "it ended at once; run it by hand to see why";
	}
	return NULL;
}

/* --- cyclictest; its figures are JSON, its late wake-ups lines of output, times in µs ---
 *
 *     T: 0 Spike:    1301: TS:  68161260801
 */

#define SPIKES_MAX 200000
#define SPIKES_TEXT "200000"
#define END_S 5 /* after the time that it should take, which has passed */

/* Its histogram, and ours, whose last bin is all above. */
#define TRACKED_US "20000"
_Static_assert(INCISE_LOOP_BINS == 20001, "bins of both");

/* A wake-up that was late by more than a quarter of a period. */
struct spike {
	int64_t from_ns, to_ns; /* when it was due, when it came; CLOCK_MONOTONIC */
};

struct cyclictest {
	pid_t pid;
	struct memory_file report, out;
	uint64_t late_us[INCISE_LOOP_BINS];
	double max_us;
	struct spike spike[SPIKES_MAX]; /* in order of time */
	int spikes;
};

static const char *cyclictest_possible(bool realtime)
{
	if (!child_possible("cyclictest"))
		return "cyclictest is not installed: apt-get install rt-tests";
	if (!realtime)
		return "cyclictest runs only where real-time policies are granted";
	return NULL;
}

/* With one thread of SCHED_FIFO, for so many wake-ups, each a quarter of a period after where
 * one would be that counts from a full second of CLOCK_MONOTONIC. It begins with the next
 * second, when that is not to come within half a second. */
static void cyclictest_begin(struct cyclictest *c, double rate_hz, int cpu,
			     uint64_t cycles)
{
	c->report = memory_file_begin("cyclictest");
	c->out = memory_file_begin("cyclictest's lines");
	/* The buffer for spikes is allocated only behind the option that asks for them. */
	const char *argv[] = {
		"cyclictest",
		"--quiet",
		"--mlockall",
		"--policy=fifo",
		"--threads=1",
		cli_text("--priority=%d", INCISE_REALTIME_PRIORITY + 1),
		cli_text("--affinity=%d", cpu),
		cli_text("--interval=%.0f", 1e6 / rate_hz),
		cli_text("--loops=%llu", (unsigned long long)cycles),
		cli_text("--spike=%.0f", 0.25e6 / rate_hz),
		cli_text("--json=%s", c->report.path),
		cli_text("--secaligned=%.0f", 0.25e6 / rate_hz),
		"--spike-nodes=" SPIKES_TEXT,
		"--histogram=" TRACKED_US,
		NULL,
	};

	c->pid = child_start((char *const *)argv, fileno(c->out.file), -1);
}

static void read_spikes(struct cyclictest *c)
{
	char line[200];

	rewind(c->out.file);
	while (fgets(line, sizeof(line), c->out.file) && c->spikes < SPIKES_MAX) {
		long long late_us, at_us;
		int thread;

		if (sscanf(line, "T:%d Spike:%lld: TS:%lld", &thread, &late_us, &at_us) ==
		    3)
			c->spike[c->spikes++] =
				(struct spike){(at_us - late_us) * 1000, at_us * 1000};
	}
}

/* "histogram": {"14": 96, …}; a wake-up above all bins is in no bin. */
static const char *read_histogram(struct cyclictest *c, json_t *thread)
{
	json_t *histogram = json_object_get(thread, "histogram"), *count;
	json_int_t cycles = json_integer_value(json_object_get(thread, "cycles"));
	const char *us;

	if (!json_is_object(histogram) || cycles <= 0)
		return "cyclictest's report has no histogram";
	json_object_foreach(histogram, us, count)
	{
		long bin = strtol(us, NULL, 10);

		if (bin < 0 || bin >= INCISE_LOOP_BINS - 1 ||
		    json_integer_value(count) < 0)
			return "cyclictest's histogram makes no sense";
		c->late_us[bin] = (uint64_t)json_integer_value(count);
		cycles -= json_integer_value(count);
	}
	if (cycles > 0)
		c->late_us[INCISE_LOOP_BINS - 1] = (uint64_t)cycles;
	c->max_us = json_number_value(json_object_get(thread, "max"));
	return NULL;
}

/* Wait for its end and read its report. Returns NULL or the reason for no result. */
static const char *cyclictest_end(struct cyclictest *c)
{
	int status = child_end(c->pid, END_S);
	const char *why = NULL;
	json_t *report;

	rewind(c->report.file);
	report = json_loadf(c->report.file, 0, NULL);
	if (status || !report)
		why = "cyclictest failed; run it by hand to see why";
	else
		why = read_histogram(c, json_object_get(json_object_get(report, "thread"),
							"0"));
	if (!why)
		read_spikes(c);
	json_decref(report);
	fclose(c->report.file);
	fclose(c->out.file);
	return why;
}

/* --- the loop --- */

#define STALLS_MAX 65536

/* A gap between two ticks in which others were left out. */
struct stall {
	int64_t from_ns, to_ns;
	uint64_t skipped;
};

struct run {
	const struct wakeups *wakeups;
	const struct incise_realtime *realtime; /* NULL: the shell's policy */
	double rate_hz;
	bool with_cyclictest;
	struct incise_scene *scene;
	struct incise_rig *rig;
	struct incise_clock *clock; /* the rig's: CLOCK_MONOTONIC */
	struct incise_plan *plan;
	int64_t period_ns, due_ns; /* of the first tick */
	struct incise_loop_stats stats;
	struct incise_error err;
	int rc;
	/* of the tick before */
	int64_t index, t_ns;
	struct stall stall[STALLS_MAX];
	int stalls;
	uint64_t found; /* ticks skipped in all of these */
	struct cyclictest cyclictest;
};

static void add_stall(struct run *run, int64_t to_ns, uint64_t skipped)
{
	if (!skipped || run->stalls == STALLS_MAX)
		return;
	run->stall[run->stalls++] = (struct stall){run->t_ns, to_ns, skipped};
	run->found += skipped;
}

static int ticked_wakeup(void *context, const struct incise_tick *tick)
{
	struct run *run = context;
	int64_t index = (tick->t_ns - run->due_ns) / run->period_ns;

	if (index > run->index + 1)
		add_stall(run, tick->t_ns, (uint64_t)(index - run->index - 1));
	run->index = index;
	run->t_ns = tick->t_ns;
	return 0;
}

static int64_t next_second(struct incise_clock *clock)
{
	return (incise_clock_now(clock) / INCISE_NS_PER_S + 1) * INCISE_NS_PER_S;
}

/* Wait until three quarters of a period after a full second, half a period after cyclictest. Not much
 * later, or the two would be ready together. */
static void wait_for_phase(const struct run *run)
{
	int64_t start_ns = next_second(run->clock) + run->period_ns / 4 * 3;

	for (int i = 0; i < 1000; i++, start_ns += run->period_ns) {
		incise_clock_wait_until(run->clock, start_ns);
		if (incise_clock_now(run->clock) - start_ns < run->period_ns / 8)
			return;
	}
}

static void run_loop(struct run *run)
{
	struct incise_loop_options options = {
		.rate_hz = run->rate_hz,
		.duration_ns = (int64_t)(run->wakeups->seconds * 1e9),
		.stop = &cli_stop,
		.ticked = ticked_wakeup,
		.context = run,
	};

	if (run->with_cyclictest)
		wait_for_phase(run);
	run->due_ns = incise_clock_now(run->clock) + run->period_ns;
	run->t_ns = run->due_ns - run->period_ns;
	run->index = -1;
	run->rc =
		incise_loop_run(run->plan, run->clock, &options, &run->stats, &run->err);
	/* No tick comes after a gap over the end. */
	if (run->stats.skipped > run->found)
		add_stall(run, incise_clock_now(run->clock),
			  run->stats.skipped - run->found);
}

static void *loop_thread(void *context)
{
	struct run *run = context;
	cpu_set_t cpus;

	if (run->realtime) {
		run->rc = incise_realtime_enter(run->realtime, &run->err);
	} else {
		CPU_ZERO(&cpus);
		CPU_SET(run->wakeups->cpu, &cpus);
		pthread_setaffinity_np(pthread_self(), sizeof(cpus), &cpus);
	}
	if (!run->rc)
		run_loop(run);
	return NULL;
}

static void run_thread(struct run *run)
{
	pthread_t thread;
	int rc = pthread_create(&thread, NULL, loop_thread, run);

	if (rc)
		cli_fail("no thread for the loop: %s", strerror(rc));
	pthread_join(thread, NULL);
}

static void open_run(struct run *run, const char *scene)
{
	unsigned int devices = INCISE_RIG_TRACKER | INCISE_RIG_STEPPER;

	run->period_ns = llrint(INCISE_NS_PER_S / run->rate_hz);
	run->scene = cli_require(incise_scene_load(scene, NULL, &run->err), &run->err);
	run->rig = cli_require(incise_rig_open("sim:", devices, &run->err), &run->err);
	run->clock = incise_rig_clock(run->rig);
	run->plan =
		cli_require(incise_plan_new(run->scene, run->rig, &run->err), &run->err);
}

static void close_run(struct run *run)
{
	incise_plan_free(run->plan);
	incise_rig_close(run->rig);
	incise_scene_free(run->scene);
	free(run);
}

/* --- both together --- */

/* NaN if the wake-ups are too few for it. */
static double percentile(const uint64_t *bins, uint64_t ticks, double q)
{
	return stopwatch_resolves(ticks, q) ? incise_loop_quantile(bins, q) : NAN;
}

static struct lateness lateness_of(const uint64_t *bins, double max_us)
{
	struct lateness l = {0};
	int least = 0;

	while (least < INCISE_LOOP_BINS - 1 && !bins[least])
		least++;
	for (int i = 0; i < INCISE_LOOP_BINS; i++)
		l.ticks += bins[i];
	l.p999 = percentile(bins, l.ticks, 0.999);
	l.json = json_pack("{sf so so so so sf sI}", "min", (double)least, "median",
			   json_number(percentile(bins, l.ticks, 0.5)), "p99",
			   json_number(percentile(bins, l.ticks, 0.99)), "p999",
			   json_number(l.p999), "p9999",
			   json_number(percentile(bins, l.ticks, 0.9999)), "max", max_us,
			   "ticks", (json_int_t)l.ticks);
	return l;
}

/* By ranks, as if wake-ups were independent of each other, for one run alone. */
static struct harness_spread quantile_of(const uint64_t *bins, uint64_t ticks, double q)
{
	double off = 1.96 * sqrt(q * (1 - q) / fmax((double)ticks, 1));

	if (!stopwatch_resolves(ticks, q))
		return HARNESS_SPREAD_NONE;
	return (struct harness_spread){
		.median = incise_loop_quantile(bins, q),
		.low = incise_loop_quantile(bins, fmax(q - off, 0)),
		.high = incise_loop_quantile(bins, fmin(q + off, 1)),
	};
}

static bool held_up(const struct cyclictest *c, const struct stall *stall,
		    int64_t period_ns)
{
	int64_t gap_ns = stall->to_ns - stall->from_ns, both_ns = 0;

	for (int i = 0; i < c->spikes; i++) {
		int64_t from = c->spike[i].from_ns, to = c->spike[i].to_ns;

		from = from > stall->from_ns ? from : stall->from_ns;
		to = to < stall->to_ns ? to : stall->to_ns;
		if (to > from)
			both_ns += to - from;
	}
	return both_ns >= (gap_ns - period_ns) / 2;
}

/* Returns how many of the skipped ticks were the machine's. */
static double blame(const struct run *run)
{
	uint64_t machine = 0;

	for (int i = 0; i < run->stalls; i++)
		if (held_up(&run->cyclictest, &run->stall[i], run->period_ns))
			machine += run->stall[i].skipped;
	return (double)(machine < run->stats.skipped ? machine : run->stats.skipped);
}

/* A loop that fails ends the program. */
static void run_both(struct run *run, const char *scene, struct wakeup *row)
{
	struct cyclictest *c = &run->cyclictest;
	double cycles = run->wakeups->seconds * run->rate_hz;

	open_run(run, scene);
	if (run->with_cyclictest) {
		/* Early in a second: both begin with the next one. */
		if (incise_clock_now(run->clock) % INCISE_NS_PER_S > INCISE_NS_PER_S / 4)
			incise_clock_wait_until(run->clock, next_second(run->clock));
		cyclictest_begin(c, run->rate_hz, run->wakeups->cpu,
				 (uint64_t)llrint(cycles));
	}
	run_thread(run);
	if (run->with_cyclictest)
		row->no_cyclictest = cyclictest_end(c);
	if (run->rc && !cli_stop)
		cli_fail_with(&run->err);
	row->loop =
		lateness_of(run->stats.lateness_us, run->stats.lateness_max_ns * 1e-3);
	row->median = quantile_of(run->stats.lateness_us, row->loop.ticks, 0.5);
	row->p999 = quantile_of(run->stats.lateness_us, row->loop.ticks, 0.999);
	row->tick_us = incise_loop_quantile(run->stats.tick_100ns, 0.5) / 10;
	row->tick_max_us = run->stats.tick_max_ns * 1e-3;
	row->skipped = run->stats.skipped;
	if (!row->no_cyclictest) {
		row->cyclictest = lateness_of(c->late_us, c->max_us);
		row->ratio = row->loop.p999 / row->cyclictest.p999;
		row->machine = blame(run);
	}
}

static void measure_wakeup(const char *scene, enum load_kind load,
			   const struct wakeups *wakeups,
			   const struct incise_realtime *realtime, struct wakeup *row)
{
	struct run *run = cli_alloc(1, sizeof(*run));
	struct load_run beside = {0};

	row->no_cyclictest = cyclictest_possible(realtime);
	run->wakeups = wakeups;
	run->realtime = realtime;
	run->rate_hz = row->rate_hz;
	run->with_cyclictest = !row->no_cyclictest;
	row->no_load = load_begin(load, scene, wakeups->seconds, &beside);
	if (!row->no_load) {
		cli_progress("wake-ups at %g Hz, %s, %.3g s", row->rate_hz, row->load,
			     wakeups->seconds);
		run_both(run, scene, row);
		row->frames_hz = load_end(&beside);
	}
	close_run(run);
}

static double scene_rate(const char *path)
{
	struct incise_error err = {0};
	struct incise_scene *scene =
		cli_require(incise_scene_load(path, NULL, &err), &err);
	double rate_hz = incise_scene_rate_hz(scene);

	incise_scene_free(scene);
	return rate_hz;
}

/* As incise haptic asks for it; NULL where it is not granted. */
struct incise_realtime *bench_realtime(int cpu)
{
	const struct incise_realtime_setup setup = {
		.policy = INCISE_REALTIME_FIFO,
		.priority = INCISE_REALTIME_PRIORITY,
		.cpu = cpu,
		.period_ns = 1000000, /* of no account for this policy */
	};
	struct incise_error ignored = {0};

	return incise_realtime_new(&setup, &ignored);
}

/* A load takes seconds to begin and to end. */
static bool wanted(enum load_kind load, enum load_kind only, bool quick, int rate)
{
	if (only != LOADS)
		return load == only;
	return !quick || (load <= LOAD_CPU && !rate);
}

/* Measure a scene's file at its rate; with NULL the plane, at 1 and 4 kHz. @only: a
 * load, or LOADS for all, which with @quick are few. */
static void measure_wakeups(const char *scene, enum load_kind only, bool quick,
			    double seconds, struct wakeups *wakeups)
{
	static const struct lateness none = {NAN, 0, NULL};
	const double rates_hz[] = {scene ? scene_rate(scene) : 1000, 4000};
	struct incise_realtime *realtime;

	*wakeups = (struct wakeups){.seconds = seconds, .cpu = machine_cpu()};
	incise_realtime_prepare();
	realtime = bench_realtime(wakeups->cpu);
	wakeups->realtime = realtime;
	cli_catch_signals();
	for (int i = 0; i < (scene ? 1 : 2); i++) {
		struct memory_file file = {0};

		if (!scene)
			file = plane(rates_hz[i]);
		for (int load = 0; load < LOADS && !cli_stop; load++) {
			struct wakeup *row = &wakeups->row[wakeups->n];

			if (!wanted((enum load_kind)load, only, quick, i))
				continue;
			*row = (struct wakeup){
				.load = bench_loads[load],
				.rate_hz = rates_hz[i],
				.loop = none,
				.cyclictest = none,
				.median = {.median = NAN},
				.p999 = {.median = NAN},
				.ratio = NAN,
				.machine = NAN,
				.tick_us = NAN,
				.tick_max_us = NAN,
				.frames_hz = NAN,
			};
			measure_wakeup(scene ? scene : file.path, (enum load_kind)load,
				       wakeups, realtime, row);
			wakeups->n++;
		}
		if (file.file)
			fclose(file.file);
	}
	cli_progress_end();
	incise_realtime_free(realtime);
	if (cli_stop)
		cli_fail("interrupted");
}

/* --- wake-ups: rows --- */

#define AWAKE_S 5
#define QUICK_AWAKE_S 0.5

static const struct bench_table wakeup_table = {
	.key = "wakeups.rows",
	.row_bytes = sizeof(struct wakeup),
	.columns = {COLUMN(wakeup, "rate_hz", rate_hz), COLUMN(wakeup, "load", load),
		    COLUMN(wakeup, "no_load", no_load),
		    COLUMN(wakeup, "no_cyclictest", no_cyclictest),
		    COLUMN(wakeup, "lateness_us", loop.json),
		    COLUMN(wakeup, "cyclictest_us", cyclictest.json),
		    COLUMN(wakeup, "skipped", skipped),
		    COLUMN(wakeup, "skipped_by_machine", machine, .whole = true),
		    COLUMN(wakeup, "ratio_p999", ratio),
		    COLUMN(wakeup, "tick_cold_us", tick_us),
		    COLUMN(wakeup, "tick_max_us", tick_max_us),
		    COLUMN(wakeup, "frames_hz", frames_hz),
		    COLUMN(wakeup, "failed", no_load)},
	.metrics = {METRIC(MEASURED, wakeup, median, "us",
			   "late at {rate_hz} Hz, {load}, median"),
		    METRIC(MEASURED, wakeup, p999, "us",
			   "late at {rate_hz} Hz, {load}, 99.9 %")},
};

/* --- the bench --- */

/* Members of the first rows, where scripts look for them. */
static void report_first(struct bench_run *run, const struct tick_row *tick,
			 const struct wakeup *row)
{
	json_t *late = row->loop.json ? json_copy(row->loop.json) : json_null();

	if (row->loop.json)
		json_object_set_new(late, "skipped",
				    json_integer((json_int_t)row->skipped));
	bench_values(run, "{s{sf so so} so sO?}", "tick_ns", "median", tick->cost.median,
		     "p99", json_number(tick->cost.p99), "p999",
		     json_number(tick->cost.p999), "lateness_us", late, "cyclictest_us",
		     row->cyclictest.json);
}

static void run_bench_loop(struct bench_run *run)
{
	static struct tick_row ticks[N(own)];
	static struct wakeups wakeups;
	enum load_kind only =
		run->load ? (enum load_kind)cli_choice("load", run->load, bench_loads)
			  : LOADS;
	const char *scene = run->n_operands ? run->operands[0] : NULL;
	int n = scene ? 1 : N(own);

	if (scene) {
		ticks[0].name = scene;
		load_scene(scene, &ticks[0]);
	}
	for (int i = 0; i < n && !scene; i++)
		load_own(&own[i], &ticks[i]);
	time_ticks(ticks, n, run->quick);
	measure_wakeups(scene, only, run->quick,
			run->seconds > 0 ? run->seconds
			: run->quick	 ? QUICK_AWAKE_S
					 : AWAKE_S,
			&wakeups);
	report_first(run, ticks, wakeups.row);
	bench_rows(run, &tick_table, ticks, n);
	bench_values(run, "{s{sf ss so si}}", "wakeups", "seconds", wakeups.seconds,
		     "policy", wakeups.realtime ? "fifo" : "other", "priority",
		     wakeups.realtime ? json_integer(INCISE_REALTIME_PRIORITY)
				      : json_null(),
		     "cpu", wakeups.cpu);
	bench_rows(run, &wakeup_table, wakeups.row, wakeups.n);
}

const struct bench bench_loop = {
	.name = "loop",
	.operands = "[SCENE]",
	.summary = "run time of a tick; wake-up latency, idle and under "
		   "load, compared with cyclictest",
	.n_operands = 1,
	.takes_duration = true,
	.takes_load = true,
	.run = run_bench_loop,
};
