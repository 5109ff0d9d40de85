// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The loop on a simulated clock: number of ticks, overruns, stopping, statistics. On a
 * real one only order is asserted: times belong to benches.
 */
#include "../unit.h"
#include <sys/prctl.h>
#include <time.h>
#include "../../../lib/loop/loop_control.h"
#include <incise/loop.h>
#include "../scene/felt.h"

static struct incise_loop_stats stats;
#define LOG 300
static struct incise_tick ticks[LOG];
static struct incise_loop_options options;
static struct incise_tracker_ops ops;
static struct felt f;
static int calls;

static int begin(void **state)
{
	felt_start(&f, "fixed", INCISE_RIG_TRACKER);
	options = (struct incise_loop_options){
		.rate_hz = 1000, .log = ticks, .log_size = LOG};
	err = (struct incise_error){0};
	calls = 0;
	return 0;
}

static int end(void **state)
{
	felt_end(&f);
	incise_loop_control_free(options.control);
	return 0;
}

static int run(int64_t duration_ns)
{
	options.duration_ns = duration_ns;
	return incise_loop_run(f.plan, incise_rig_clock(f.rig), &options, &stats, &err);
}

TEST(test_number_of_ticks, begin, end)
{
	static const double rates[] = {1, 333, 1000, 8000};

	for (size_t i = 0; i < 4; i++) {
		options.rate_hz = rates[i];
		assert_int_equal(run(2 * INCISE_NS_PER_S), 0);
		/* A period of whole ns: 333 Hz is 3003003 ns, one tick more fits in. */
		assert_int_equal(stats.ticks, llrint(ceil(2e9 / rint(1e9 / rates[i]))));
		assert_int_equal(stats.skipped, 0);
		assert_int_equal(stats.lateness_max_ns, 0);
		assert_int_equal(stats.lateness_us[0], stats.ticks);
	}
}

TEST(test_log_and_times, begin, end)
{
	int64_t begin_ns = incise_clock_now(incise_rig_clock(f.rig));

	assert_int_equal(run(INCISE_NS_PER_S / 2), 0);
	/* More ticks than the log holds: it keeps the first. */
	assert_int_equal(stats.ticks, 500);
	assert_int_equal(stats.logged, 300);
	for (int i = 0; i < 300; i++)
		assert_int_equal(ticks[i].t_ns, begin_ns + (i + 1) * 1000000LL);
}

/* Replace the read function of the rig's tracker. */
static void read_by(int (*read)(struct incise_tracker *, struct incise_tracker_sample *,
				int))
{
	ops = *f.tracker_ops;
	ops.read = read;
	incise_rig_tracker(f.rig)->ops = &ops;
}

static struct incise_clock *stalled;

/* The tenth tick takes 3.4 periods, like a stall of the machine. */
static int slow_tracker(struct incise_tracker *tracker,
			struct incise_tracker_sample *samples, int n)
{
	if (++calls == 10)
		incise_clock_wait_until(stalled, incise_clock_now(stalled) + 3400000);
	return 0;
}

TEST(test_overrun_skips_and_counts, begin, end)
{
	read_by(slow_tracker);
	stalled = incise_rig_clock(f.rig);
	assert_int_equal(run(50000000), 0);
	/* Tick 10 ends 3.4 periods on. The next, 2.4 late, skips two and runs; the one after
	 * is on time again. 50 were due. */
	assert_int_equal(stats.skipped, 2);
	assert_int_equal(stats.ticks, 48);
	assert_int_equal(stats.lateness_max_ns, 2400000);
	assert_int_equal(stats.tick_max_ns, 3400000);
	assert_int_equal(ticks[10].t_ns - ticks[9].t_ns, 3400000);
	assert_int_equal(ticks[11].t_ns - ticks[9].t_ns, 4000000);
	assert_int_equal(stats.flagged[2], 48);
}

/* The same stall over the end: 12 were due, the two behind the tenth are left out. */
TEST(test_overrun_over_the_end, begin, end)
{
	read_by(slow_tracker);
	stalled = incise_rig_clock(f.rig);
	assert_int_equal(run(12000000), 0);
	assert_int_equal(stats.ticks, 10);
	assert_int_equal(stats.skipped, 2);
}

static const struct incise_stepper_ops *felt_ops;
static bool dropped;

/* The tenth tick is followed by a stall that is longer than the actuator's deadman. */
static int stall(void *context, const struct incise_tick *tick)
{
	dropped = ++calls == 10;
	if (dropped)
		incise_clock_wait_until(stalled, incise_clock_now(stalled) + 3400000);
	return 0;
}

static int dropping_set(struct incise_stepper *stepper, double position_mm)
{
	return dropped ? -EIO : felt_ops->set(stepper, position_mm);
}

static int dropping_status(struct incise_stepper *stepper,
			   struct incise_stepper_status *status)
{
	int rc = felt_ops->status(stepper, status);

	if (dropped)
		status->faults |= INCISE_STEPPER_FAULT_DEADMAN;
	return rc;
}

/* No tick finds it any more, as the loop is over: letting go does. */
TEST(test_overrun_over_the_end_drops_the_actuator, begin, end)
{
	struct incise_stepper_ops stepper_ops;

	options.ticked = stall;
	felt_end(&f);
	felt_start(&f, "fixed", INCISE_RIG_TRACKER | INCISE_RIG_STEPPER);
	felt_ops = f.stepper_ops;
	stepper_ops = *felt_ops;
	stepper_ops.set = dropping_set;
	stepper_ops.status = dropping_status;
	incise_rig_stepper(f.rig)->ops = &stepper_ops;
	stalled = incise_rig_clock(f.rig);
	dropped = false;
	assert_int_equal(run(12000000), -EIO);
	assert_int_equal(stats.ticks, 10);
	assert_says(err.text, "tick 10:");
}

static volatile sig_atomic_t stop;

static int stopping_tracker(struct incise_tracker *tracker,
			    struct incise_tracker_sample *samples, int n)
{
	stop = ++calls == 25;
	return 0;
}

TEST(test_stop_flag, begin, end)
{
	options.stop = &stop;

	read_by(stopping_tracker);
	stop = 0;
	assert_int_equal(run(0), 0);
	assert_int_equal(stats.ticks, 25);
}

static int failing_tracker(struct incise_tracker *tracker,
			   struct incise_tracker_sample *samples, int n)
{
	return ++calls == 5 ? -ENODEV : 0;
}

/* The actuator is released at each kind of end. */
TEST(test_end_lets_go, begin, end)
{
	struct incise_stepper_status status;
	struct incise_clock *clock;

	options.duration_ns = 5 * INCISE_NS_PER_S;
	felt_end(&f);
	felt_start(&f, "fixed", INCISE_RIG_TRACKER | INCISE_RIG_STEPPER);
	clock = incise_rig_clock(f.rig);
	assert_int_equal(incise_loop_run(f.plan, clock, &options, &stats, NULL), 0);
	assert_true(stats.force_N > 0.1);
	/* Earlier than the device's own deadman of 100 ms. */
	incise_clock_wait_until(clock, incise_clock_now(clock) + 90000000);
	assert_int_equal(incise_stepper_status(incise_rig_stepper(f.rig), &status), 0);
	assert_true(fabs(status.force_N) < 0.1 * stats.force_N);
}

TEST(test_device_failure_ends_the_loop, begin, end)
{
	read_by(failing_tracker);
	assert_int_equal(run(50000000), -ENODEV);
	assert_int_equal(stats.ticks, 5);
	assert_says(err.text, "tick 5");
}

TEST(test_refused_options, begin, end)
{
	static const double rates[] = {0, -1, 0.5, 20001, NAN, INFINITY};

	for (size_t i = 0; i < sizeof(rates) / sizeof(*rates); i++) {
		options.rate_hz = rates[i];
		assert_int_equal(run(1000000), -EINVAL);
	}
}

/* In real time ticks come in order and none before its time. */
TEST(test_real_clock, begin, end)
{
	struct incise_clock *clock = incise_clock_new_real();
	int64_t begin_ns = incise_clock_now(clock);

	options.duration_ns = 100000000;
	assert_int_equal(incise_loop_run(f.plan, clock, &options, &stats, NULL), 0);
	assert_int_equal(stats.ticks + stats.skipped, 100);
	for (size_t i = 0; i < stats.logged; i++)
		assert_true(ticks[i].t_ns >= begin_ns + ((int64_t)i + 1) * 1000000);
	for (size_t i = 1; i < stats.logged; i++)
		assert_true(ticks[i].t_ns > ticks[i - 1].t_ns);
	incise_clock_free(clock);
}

struct listener {
	int64_t begin_ns, stall_ns;
	int ticks, end_at, end_by;
};

static int ticked(void *context, const struct incise_tick *tick)
{
	struct listener *listener = context;

	assert_int_equal(tick->t_ns, listener->begin_ns + ++listener->ticks * 1000000LL);
	if (listener->ticks == 3 && listener->stall_ns)
		clock_nanosleep(CLOCK_MONOTONIC, 0,
				&(struct timespec){0, listener->stall_ns}, NULL);
	return listener->ticks == listener->end_at ? listener->end_by : 0;
}

TEST(test_callback_ends_the_loop, begin, end)
{
	struct listener listener = {.end_at = 17, .end_by = -ENOSPC};

	options.ticked = ticked;
	options.context = &listener;
	listener.begin_ns = incise_clock_now(incise_rig_clock(f.rig));
	assert_int_equal(run(INCISE_NS_PER_S), -ENOSPC);
	assert_int_equal(listener.ticks, 17);
	assert_int_equal(stats.ticks, 17);
	/* no device is blamed */
	assert_int_equal(err.code, 0);
}

/* On a paced clock a stall of many periods costs no tick, and each has its own time. */
TEST(test_paced_clock, begin, end)
{
	struct listener listener = {.begin_ns = 777, .stall_ns = 12000000};
	struct incise_clock *clock = incise_clock_new_paced(777);

	options.duration_ns = 40000000;
	options.ticked = ticked;
	options.context = &listener;
	assert_int_equal(incise_loop_run(f.plan, clock, &options, &stats, NULL), 0);
	assert_int_equal(listener.ticks, 40);
	assert_int_equal(stats.ticks, 40);
	assert_int_equal(stats.skipped, 0);
	/* The tick after the stall was due 1 ms after the third. */
	assert_true(stats.lateness_max_ns >= 11000000);
	assert_int_equal(stats.tick_max_ns, 0);
	incise_clock_free(clock);
}

TEST(test_quantile)
{
	/* The bytes behind the last bin are somebody else's. */
	static uint64_t histogram[INCISE_LOOP_BINS + 1] = {[INCISE_LOOP_BINS] = 1000};

	assert_true(incise_loop_quantile(histogram, 0.5) == 0);
	histogram[3] = 50;
	histogram[7] = 49;
	histogram[INCISE_LOOP_BINS - 1] = 1;
	assert_true(incise_loop_quantile(histogram, 0.5) == 4);
	assert_true(incise_loop_quantile(histogram, 0.51) == 8);
	assert_true(incise_loop_quantile(histogram, 0.99) == 8);
	assert_true(incise_loop_quantile(histogram, 1) == INCISE_LOOP_BINS);
}

/* Poses of a scalpel held still at a depth; or no more poses. */
static double held_mm;
static bool silent;
static char held_status; /* the flag of each pose */
static struct incise_clock *held_clock;
static uint64_t held_seq;

static int held_tracker(struct incise_tracker *tracker,
			struct incise_tracker_sample *samples, int n)
{
	samples[0] = (struct incise_tracker_sample){
		.t_ns = incise_clock_now(held_clock),
		.seq = held_seq++,
		.position_mm = {0, 0, -held_mm},
		.quaternion = {1, 0, 0, 0},
		.status = held_status,
		.station = 1,
	};
	return !silent;
}

/* Observations from inside a run. */
struct seen {
	struct incise_loop_control *control;
	struct incise_plan *next;
	volatile sig_atomic_t stop;
	int n, stop_at, offer_at, silent_at, back_at, flag_at;
	char flag; /* of the poses from flag_at to back_at */
	double slew_N, last_N, most_change_N, at_stop_N, last_but_stop_N;
	double after_N; /* largest force after the change of plans */
	bool changed;
};

static int look(void *context, const struct incise_tick *tick)
{
	struct seen *seen = context;
	double force_N = sqrt(tick->command_N[0] * tick->command_N[0] +
			      tick->command_N[1] * tick->command_N[1] +
			      tick->command_N[2] * tick->command_N[2]);

	seen->most_change_N = fmax(seen->most_change_N, fabs(force_N - seen->last_N));
	seen->last_N = force_N;
	seen->n++;
	/* In slowly, then it rests there. */
	held_mm = fmin(10, 0.02 * seen->n);
	if (seen->n == seen->silent_at)
		silent = true;
	if (seen->n == seen->flag_at)
		held_status = seen->flag;
	if (seen->n == seen->back_at) {
		silent = false;
		held_status = ' ';
	}
	if (seen->n == seen->stop_at) {
		seen->at_stop_N = force_N;
		seen->stop = 1;
	}
	if (seen->n == seen->offer_at) {
		seen->at_stop_N = force_N;
		assert_int_equal(incise_loop_control_offer(seen->control, seen->next), 0);
		assert_int_equal(incise_loop_control_offer(seen->control, seen->next),
				 -EBUSY);
	}
	if (seen->changed)
		seen->after_N = fmax(seen->after_N, force_N);
	else if (seen->control && incise_loop_control_retired(seen->control))
		seen->changed = true;
	return 0;
}

static void held_start(struct seen *seen)
{
	felt_end(&f);
	felt_start(&f, "double", INCISE_RIG_TRACKER);
	read_by(held_tracker);
	held_clock = incise_rig_clock(f.rig);
	held_seq = 0;
	held_mm = 0;
	silent = false;
	held_status = ' ';
	seen->slew_N = FELT_SLEW_N_S / 1000;
	options.ticked = look;
	options.context = seen;
}

TEST(test_stop_fades, begin, end)
{
	struct seen seen = {.stop_at = 600};
	int64_t most_ms;

	options.stop = &seen.stop;
	held_start(&seen);
	assert_int_equal(run(0), 0);
	/* There was a force, it went in steps within the slew, and is 0. */
	assert_true(seen.at_stop_N > 0.5);
	assert_true(seen.most_change_N <= seen.slew_N * (1 + 1e-9));
	assert_true(seen.last_N == 0);
	most_ms = incise_plan_fade_ns(f.plan) / 1000000;
	assert_in_range(stats.ticks, 602, 600 + most_ms + 1);
}

/* In the tissue: the old force fades, the new plan waits for a small one. */
TEST(test_another_plan, begin, end)
{
	struct seen seen = {.offer_at = 600};
	struct incise_loop_event events[20];
	int n;

	held_start(&seen);
	seen.control = options.control = incise_loop_control_new();
	seen.next = incise_plan_new(f.scene, f.rig, NULL);
	assert_non_null(seen.next);
	assert_int_equal(run(2 * INCISE_NS_PER_S), 0);
	assert_true(seen.at_stop_N > 0.5);
	assert_true(seen.changed);
	assert_true(seen.most_change_N <= seen.slew_N * (1 + 1e-9));
	assert_true(seen.after_N == 0);
	assert_int_equal(incise_loop_control_ticks(options.control), 2000);
	n = incise_loop_control_events(options.control, events, 20);
	assert_true(n > 0);
	for (int i = 0; i < n; i++)
		if (events[i].kind == INCISE_LOOP_PLAN)
			assert_in_range(events[i].tick, 600,
					601 + incise_plan_fade_ns(seen.next) / 1000000 +
						1);
	incise_plan_free(seen.next);
}

/* Set the tool at a tick, another plan some ticks later; the force before each change. */
struct tool_seen {
	struct seen seen;
	int tool_at;
	enum incise_tool tool;
	double last_N[2]; /* of the last two ticks */
	int changes;
	double at_change_N[8];
};

static int look_at_tool(void *context, const struct incise_tick *tick)
{
	struct tool_seen *own = context;
	int rc = look(&own->seen, tick);

	own->last_N[0] = own->last_N[1];
	own->last_N[1] = own->seen.last_N;
	if (own->seen.n > 1 && tick->tool != own->tool && own->changes < 8)
		own->at_change_N[own->changes++] = own->last_N[0];
	own->tool = tick->tool;
	if (own->seen.n == own->tool_at)
		assert_int_equal(incise_loop_control_set_tool(own->seen.control,
							      INCISE_TOOL_TUBE),
				 0);
	return rc;
}

/* The same scene, with insertion. */
static void let_insert(void)
{
	FILE *out = fopen(f.scene_path, "a");

	fputs("tissue = { insertion_N_mm = 0.28; };\n", out);
	fclose(out);
	incise_plan_free(f.plan);
	incise_scene_free(f.scene);
	f.scene = felt_scene(f.scene_path);
	f.plan = incise_plan_new(f.scene, f.rig, NULL);
	assert_non_null(f.plan);
}

/*
 * A tool that is set in the tissue is held once the force has faded, comes back with a ramp, and
 * stays the tool of a plan that takes over.
 */
TEST(test_another_tool, begin, end)
{
	struct tool_seen own = {.seen = {.offer_at = 1400}, .tool_at = 600};
	struct incise_loop_event events[20];
	int tools = 0, n;

	held_start(&own.seen);
	options.ticked = look_at_tool;
	options.context = &own;
	let_insert();
	own.seen.control = options.control = incise_loop_control_new();
	own.seen.next = incise_plan_new(f.scene, f.rig, NULL);
	assert_int_equal(run(2 * INCISE_NS_PER_S), 0);
	assert_true(own.seen.changed);
	assert_int_equal(own.changes, 1);
	assert_true(own.at_change_N[0] == 0);
	/* It had come back when the other plan was offered. */
	assert_true(own.seen.at_stop_N > 0.5);
	assert_true(own.seen.most_change_N <= own.seen.slew_N * (1 + 1e-9));
	assert_int_equal(own.tool, INCISE_TOOL_TUBE);
	assert_int_equal(incise_loop_control_tool(options.control), INCISE_TOOL_TUBE);
	n = incise_loop_control_events(options.control, events, 20);
	for (int i = 0; i < n; i++) {
		if (events[i].kind != INCISE_LOOP_TOOL)
			continue;
		tools++;
		assert_true(events[i].value == INCISE_TOOL_TUBE);
		assert_in_range(events[i].tick, 600,
				601 + incise_plan_fade_ns(own.seen.next) / 1000000 + 1);
	}
	assert_int_equal(tools, 1);
	incise_plan_free(own.seen.next);
}

/* A plan that is withdrawn during the fade leaves the old plan, and its force returns. */
static struct incise_loop_control *withdrawn_from;

static int look_and_withdraw(void *context, const struct incise_tick *tick)
{
	struct seen *seen = context;
	int rc = look(context, tick);

	if (seen->n == seen->offer_at + 3)
		assert_ptr_equal(incise_loop_control_withdraw(withdrawn_from),
				 seen->next);
	return rc;
}

TEST(test_a_plan_withdrawn, begin, end)
{
	struct seen seen = {.offer_at = 600};

	held_start(&seen);
	options.ticked = look_and_withdraw;
	withdrawn_from = seen.control = options.control = incise_loop_control_new();
	seen.next = incise_plan_new(f.scene, f.rig, NULL);
	assert_int_equal(run(2 * INCISE_NS_PER_S), 0);
	assert_false(seen.changed);
	assert_true(seen.last_N > 0.9 * seen.at_stop_N);
	assert_true(seen.most_change_N <= seen.slew_N * (1 + 1e-9));
	incise_plan_free(seen.next);
}

TEST(test_events, begin, end)
{
	static const enum incise_loop_event_kind expected[] = {INCISE_LOOP_STALE,
							       INCISE_LOOP_FRESH};
	struct seen seen = {.silent_at = 600, .back_at = 700};
	struct incise_loop_event events[20];

	held_start(&seen);
	options.control = incise_loop_control_new();
	assert_int_equal(run(INCISE_NS_PER_S), 0);
	assert_int_equal(incise_loop_control_events(options.control, events, 20), 2);
	for (int i = 0; i < 2; i++)
		assert_int_equal(events[i].kind, expected[i]);
	/* The reported duration is the one between the two. */
	assert_true(events[1].value == (events[1].t_ns - events[0].t_ns) * 1e-6);
	assert_in_range(events[0].tick, 600, 600 + 100);
	assert_int_equal(events[1].tick, 700 + 1);
	assert_int_equal(incise_loop_control_events_lost(options.control), 0);
}

/* A pose that its tracker flags ages as a missing one does, and the force fades. */
TEST(test_flagged_poses_are_no_poses, begin, end)
{
	static const struct {
		char flag;
		bool usable;
	} cases[] = {{'x', false}, {'j', false}, {'?', false}, {'=', false},
		     {'u', true},  {'t', true},	 {0, true}};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		/* The force is noted at stop_at; options.stop is not set. */
		struct seen seen = {.flag_at = 600,
				    .flag = cases[i].flag,
				    .stop_at = 1490,
				    .back_at = 1500};

		held_start(&seen);
		assert_int_equal(run(2 * INCISE_NS_PER_S), 0);
		if (cases[i].usable ? !(seen.at_stop_N > 0.5) : seen.at_stop_N != 0)
			fail_msg("flag '%c': %g N", cases[i].flag, seen.at_stop_N);
		assert_true(seen.most_change_N <= seen.slew_N * (1 + 1e-9));
		/* Stale 50 ms after the pose before tick 600, until that of tick 1501. */
		if (!cases[i].usable)
			assert_in_range(stats.flagged[2], 850, 860);
		assert_true(seen.last_N > 0.5);
	}
}

/* A tracker that flags all its poses is given up as one that is lost: after 10 s. */
TEST(test_a_stream_of_flagged_poses_ends, begin, end)
{
	struct seen seen = {.flag_at = 600, .flag = 'x'};

	held_start(&seen);
	assert_int_equal(run(30 * INCISE_NS_PER_S), -ENODEV);
	assert_in_range(stats.ticks, 10600, 10602);
	assert_says(err.text, "'x'", "10 s");
	assert_true(seen.last_N == 0);
}

/* Takes two and a half periods at each tick from the tenth on. */
static int always_slow(struct incise_tracker *tracker,
		       struct incise_tracker_sample *samples, int n)
{
	if (++calls >= 10)
		incise_clock_wait_until(stalled, incise_clock_now(stalled) + 2500000);
	return 0;
}

TEST(test_too_many_overruns, begin, end)
{
	options.overruns_most = 5;

	read_by(always_slow);
	stalled = incise_rig_clock(f.rig);
	assert_int_equal(run(INCISE_NS_PER_S), -ETIME);
	/* Ticks 10 to 14 are slow, and the wake-up after each is an overrun. */
	assert_int_equal(stats.overruns, 5);
	assert_int_equal(stats.ticks, 14);
	assert_says(err.text, "5 ticks");
}

static int keep_slack(void *context, const struct incise_tick *tick)
{
	*(int *)context = prctl(PR_GET_TIMERSLACK);
	return 0;
}

/* A real-time policy has none, and newer kernels keep it so. */
TEST(test_timer_slack, begin, end)
{
	int before_ns, inside_ns = -1;

	assert_int_equal(prctl(PR_SET_TIMERSLACK, 40000), 0);
	before_ns = prctl(PR_GET_TIMERSLACK);
	options.ticked = keep_slack;
	options.context = &inside_ns;
	assert_int_equal(run(INCISE_NS_PER_S / 100), 0);
	assert_in_range(inside_ns, 0, 1);
	assert_int_equal(prctl(PR_GET_TIMERSLACK), before_ns);
}
