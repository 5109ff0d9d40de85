// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A day of the wall scene in simulated time, 8.64e7 ticks of a kilohertz: does anything
 * drift, leak or wrap?
 *
 *   day SCENE [HOURS [START_NS]]
 *
 * The virtual surgeon presses on the tissue; how fast swings, with 13 swings and 200 strokes
 * in 100 s. After that all restarts, and so does the tracker without noise, 12000 poses
 * on. So each round of 100 s must give what the second one gave: the first has the ramp of
 * the start in it. The clock starts at START_NS, 1 s without: a power of two that a counter
 * may wrap at, or that a double is too short for, comes to lie in the run.
 *
 *   round   0 (ramp)    1 (kept)      2              3         …
 *           ├──────────┼─────────────┼──────────────┼──────────▶
 *                        each tick   = the same one   = the same one
 */
#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <incise/backend.h>
#include <incise/fixed.h>
#include <incise/loop.h>
#include <incise/state.h>

#define RATE_HZ 1000
#define PERIOD_NS 1000000LL
#define ROUND_TICKS 100000
#define RIG                                                                    \
	"sim:clock=simulated,motion=2,tracker_noise_mm=0,tracker_jitter_ms=0," \
	"tracker_drift_ppm=0"

/*
 * The surgeon's angle, 2π · 2 Hz · 86400 s = 1.1e6 rad, is a double good to 1.2e-10 rad; 4
 * such roundings on 5.5 mm are 2.6e-9 mm, and the predictor, which goes on by 13 ms with a
 * speed that it has of them at β/T = 40/s, less than doubles that. A clock that is off by
 * 1 µs makes 1e-4 mm of it, at 107 mm/s. The place is in integers: where it lies on a rounding it
 * is its last digit, 15 nm.
 */
#define POSITION_MM (1e-8 + 1.01 / INCISE_FIXED_ONE)

/* The force is in fixed point: where that lies on a rounding it is its last digit, 15 µN. */
#define COMMAND_N (1.01 / INCISE_FIXED_ONE)

/* One step of the nut, 0.625 µm, more or less, at 2 N/mm, on either side of a rounding. */
#define RENDERED_N 2.6e-3

/* Such a last digit on the 0.1 mm of a tick is 1.6e-6 N mm; there may be ten in a round. */
#define WORK_NMM 2e-5

/*
 * Of 8.64e7 sums that come to 3e4 N mm each rounds by 1.8e-12 at most, at random: 2e-8 in
 * all. A hundred times that.
 */
#define PAGE_NMM 2e-6

struct round_sum {
	uint64_t flagged[INCISE_TICK_FLAGS];
	/* Of the hand, against the force of the tick before: below 0, a sampled wall leaks. */
	double work_Nmm;
};

struct memory {
	size_t held; /* of malloc, bytes */
	/* Its own pages. Pages of files come and go with the load of the machine. */
	long own_KiB;
};

static struct kept {
	double position_mm[3], command_N[3], rendered_N;
	unsigned int flags;
} kept[ROUND_TICKS];

static struct day {
	int64_t start_ns, first_check;
	uint64_t ticks;
	uint64_t wrong_times, wrong_flags, wrong_rounds;
	uint64_t flagged[INCISE_TICK_FLAGS];
	double position_off_mm, command_off_N, rendered_off_N, work_off, work_Nmm;
	double before_mm[3], before_N[3];
	struct round_sum sum, first;
	struct memory early;
} day;

static struct tracker_watch {
	const struct incise_tracker_ops *own;
	uint64_t poses, wrong;
} watch;

static const struct incise_loop_stats empty_stats;
static struct incise_loop_stats stats;

/* The rig's clock, which would start at 1 s. */
struct incise_clock *__real_incise_clock_new_simulated(int64_t start_ns);
struct incise_clock *__wrap_incise_clock_new_simulated(int64_t start_ns);
struct incise_clock *__wrap_incise_clock_new_simulated(int64_t start_ns)
{
	(void)start_ns;
	return __real_incise_clock_new_simulated(day.start_ns);
}

static int watch_read(struct incise_tracker *tracker,
		      struct incise_tracker_sample *samples, int n)
{
	int taken = watch.own->read(tracker, samples, n);

	for (int i = 0; i < taken; i++) {
		watch.wrong += samples[i].seq != watch.poses;
		watch.poses++;
	}
	return taken;
}

static struct memory memory_now(void)
{
	FILE *in = fopen("/proc/self/smaps_rollup", "r");
	struct memory memory = {0};
	char line[200];
	long KiB;

	while (in && fgets(line, sizeof(line), in))
		if (sscanf(line, "Anonymous: %ld", &KiB) == 1 ||
		    sscanf(line, "Swap: %ld", &KiB) == 1)
			memory.own_KiB += KiB;
	if (in)
		fclose(in);
	memory.held = mallinfo2().uordblks;
	return memory;
}

static void end_round(uint64_t number)
{
	if (number == 1)
		day.first = day.sum;
	if (number > 1) {
		day.wrong_rounds += memcmp(day.sum.flagged, day.first.flagged,
					   sizeof(day.sum.flagged)) != 0;
		day.work_off =
			fmax(day.work_off, fabs(day.sum.work_Nmm - day.first.work_Nmm));
	}
	day.work_Nmm += day.sum.work_Nmm;
	memset(&day.sum, 0, sizeof(day.sum));
}

static void compare(struct kept *k, const struct incise_tick *tick)
{
	day.wrong_flags += k->flags != tick->flags;
	for (int i = 0; i < 3; i++) {
		day.position_off_mm =
			fmax(day.position_off_mm,
			     fabs(k->position_mm[i] - tick->position_mm[i]));
		day.command_off_N = fmax(day.command_off_N,
					 fabs(k->command_N[i] - tick->command_N[i]));
	}
	day.rendered_off_N =
		fmax(day.rendered_off_N, fabs(k->rendered_N - tick->rendered_N[0]));
}

static int ticked(void *context, const struct incise_tick *tick)
{
	uint64_t number = day.ticks / ROUND_TICKS;
	struct kept *k = &kept[day.ticks % ROUND_TICKS];

	(void)context;
	day.wrong_times +=
		tick->t_ns != day.start_ns + ((int64_t)day.ticks + 1) * PERIOD_NS;
	for (int i = 0; i < INCISE_TICK_FLAGS; i++) {
		day.flagged[i] += tick->flags >> i & 1;
		day.sum.flagged[i] += tick->flags >> i & 1;
	}
	for (int i = 0; i < 3; i++) {
		day.sum.work_Nmm -=
			day.before_N[i] * (tick->position_mm[i] - day.before_mm[i]);
		day.before_mm[i] = tick->position_mm[i];
		day.before_N[i] = tick->command_N[i];
	}
	if (number > 1) {
		compare(k, tick);
	} else if (number == 1) {
		memcpy(k->position_mm, tick->position_mm, sizeof(k->position_mm));
		memcpy(k->command_N, tick->command_N, sizeof(k->command_N));
		k->rendered_N = tick->rendered_N[0];
		k->flags = tick->flags;
	}
	day.ticks++;
	if (day.ticks % ROUND_TICKS == 0)
		end_round(number);
	/* Not before the first round has gone through all code. */
	if ((int64_t)day.ticks == day.first_check)
		day.early = memory_now();
	return 0;
}

static int failures;

static void expect(bool holds, const char *what)
{
	printf("%-6s %s\n", holds ? "ok" : "FAILED", what);
	failures += !holds;
}

static void report(uint64_t due, const struct memory *late)
{
	uint64_t binned = 0, costs = 0;
	bool flags = true;
	char text[200];

	for (int i = 0; i < INCISE_LOOP_BINS; i++)
		costs += stats.tick_100ns[i];
	for (int i = 0; i < INCISE_LOOP_BINS; i++)
		binned += stats.lateness_us[i];
	for (int i = 0; i < INCISE_TICK_FLAGS; i++)
		flags = flags && stats.flagged[i] == day.flagged[i];
	snprintf(text, sizeof(text), "%llu ticks of %llu, none skipped",
		 (unsigned long long)stats.ticks, (unsigned long long)due);
	expect(stats.ticks == due && day.ticks == due && !stats.skipped, text);
	expect(!day.wrong_times, "each at its time, to the ns");
	expect(stats.lateness_us[0] == due && binned == due && costs == due &&
		       !stats.lateness_max_ns,
	       "statistics hold all of them, and none was late");
	expect(flags, "flags are counted as they were");
	snprintf(text, sizeof(text), "%llu poses, counted without a gap",
		 (unsigned long long)watch.poses);
	/* The last one under way is measured 8.3 ms before the end, and here after 4.2 ms. */
	expect(!watch.wrong && watch.poses == due / RATE_HZ * 120, text);
	snprintf(text, sizeof(text), "tip: %.2g mm off the first round at most",
		 day.position_off_mm);
	expect(day.position_off_mm <= POSITION_MM, text);
	snprintf(text, sizeof(text), "force asked for: %.2g N at most",
		 day.command_off_N);
	expect(day.command_off_N <= COMMAND_N, text);
	snprintf(text, sizeof(text), "force rendered: %.2g N at most",
		 day.rendered_off_N);
	expect(day.rendered_off_N <= RENDERED_N, text);
	expect(!day.wrong_flags && !day.wrong_rounds && day.first.flagged[0] > 0,
	       "the same ticks have the same flags in each round");
	snprintf(text, sizeof(text), "work of a round %.6g N mm, off by %.2g at most",
		 day.first.work_Nmm, day.work_off);
	expect(day.work_off <= WORK_NMM && fabs(day.first.work_Nmm) > 1, text);
	snprintf(text, sizeof(text),
		 "memory: %zu bytes held, then %zu; own pages %ld KiB, then %ld",
		 day.early.held, late->held, day.early.own_KiB, late->own_KiB);
	expect(day.early.held == late->held && late->own_KiB > 0 &&
		       late->own_KiB <= day.early.own_KiB,
	       text);
}

/* Read the state of the loop, as other programs do. */
static void report_page(const char *path, uint64_t due)
{
	static struct incise_tick ticks[INCISE_STATE_TICKS];
	static struct incise_state_now now;
	struct incise_error err = {0};
	struct incise_state *state = incise_state_open(path, &err);
	uint64_t cursor = 0, lost = 0;
	int n, rc;

	if (!state || (rc = incise_state_read(state, &now))) {
		printf("%s\n", state ? strerror(-rc) : err.text);
		expect(false, "the loop's page is read");
		return;
	}
	expect(now.ticks == due && !now.skipped && !now.overruns &&
		       !now.lateness_max_ns &&
		       !memcmp(now.flagged, stats.flagged, sizeof(now.flagged)) &&
		       incise_state_total(&now.lateness) == due &&
		       incise_state_total(&now.cost) == due &&
		       now.first_ns == day.start_ns + PERIOD_NS &&
		       now.tick.t_ns == day.start_ns + (int64_t)due * PERIOD_NS,
	       "the page counts the same");
	expect(fabs(now.absorbed_mJ - now.returned_mJ - day.work_Nmm - day.sum.work_Nmm) <
		       PAGE_NMM,
	       "and its work is the sum of all rounds");
	n = incise_state_ticks(state, &cursor, ticks, INCISE_STATE_TICKS, &lost);
	expect(n > 0 && n + lost == due && cursor == due && n >= INCISE_STATE_TICKS / 2 &&
		       ticks[n - 1].t_ns == now.tick.t_ns,
	       "its ring holds the last ticks, and counts the others");
	incise_state_close(state);
}

static double now_s(void)
{
	struct timespec t;

	clock_gettime(CLOCK_MONOTONIC, &t);
	return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

static int run(const char *path, double hours)
{
	const struct incise_state_setup setup = {.rate_hz = RATE_HZ, .rig = RIG};
	char folder[] = "/tmp/incise-day-XXXXXX", page[sizeof(folder) + 8];
	struct incise_loop_options options = {.rate_hz = RATE_HZ, .ticked = ticked};
	uint64_t due = (uint64_t)llrint(hours * 3600) * RATE_HZ;
	struct incise_error err = {0};
	struct incise_scene *scene = incise_scene_load(path, NULL, &err);
	struct incise_rig *rig =
		scene ? incise_rig_open(RIG, INCISE_RIG_TRACKER | INCISE_RIG_STEPPER,
					&err)
		      : NULL;
	struct incise_plan *plan = rig ? incise_plan_new(scene, rig, &err) : NULL;
	struct incise_tracker_ops ops;
	struct memory late;
	double begin;
	int rc;

	if (plan && mkdtemp(folder)) {
		snprintf(page, sizeof(page), "%s/state", folder);
		options.state = incise_state_new(page, &setup, &err);
	}
	if (!options.state) {
		fprintf(stderr, "day: %s\n", err.text);
		return 1;
	}
	watch.own = incise_rig_tracker(rig)->ops;
	ops = *watch.own;
	ops.read = watch_read;
	incise_rig_tracker(rig)->ops = &ops;
	options.duration_ns = (int64_t)due * PERIOD_NS;
	day.first_check = (int64_t)due / 100;
	/* All pages are there before they are counted. */
	memset(kept, 1, sizeof(kept));
	stats = empty_stats;
	memory_now();
	begin = now_s();
	rc = incise_loop_run(plan, incise_rig_clock(rig), &options, &stats, &err);
	begin = now_s() - begin;
	late = memory_now();
	incise_rig_tracker(rig)->ops = watch.own;
	if (rc)
		fprintf(stderr, "day: %s\n", err.text);
	else
		report(due, &late);
	/* The file of the page follows the loop in real time; a change of the run writes all of it. */
	incise_state_run(options.state, INCISE_RUN_STOPPED, "");
	if (!rc)
		report_page(page, due);
	incise_state_free(options.state);
	unlink(page);
	rmdir(folder);
	printf("%.2f h in %.1f s: %.0f ns a tick, virtual rig included\n", hours, begin,
	       begin * 1e9 / (double)day.ticks);
	incise_plan_free(plan);
	incise_rig_close(rig);
	incise_scene_free(scene);
	return rc || failures;
}

int main(int argc, char **argv)
{
	double hours = argc > 2 ? atof(argv[2]) : 24;

	day.start_ns = argc > 3 ? strtoll(argv[3], NULL, 10) : INCISE_NS_PER_S;
	/* Three rounds at least, or there is nothing to compare. */
	if (argc < 2 || !(hours * 3600 * RATE_HZ >= 3 * ROUND_TICKS && hours <= 1000)) {
		fprintf(stderr, "usage: day SCENE [HOURS [START_NS]], from 0.1 h on\n");
		return 2;
	}
	return run(argv[1], hours);
}
