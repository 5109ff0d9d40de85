// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The judge of edges: a log that keeps every limit to the nanosecond passes, and each
 * doctored copy of it is caught for what was done to it. The motion is made here, by the
 * closed formula of constant acceleration, not by the code that the judge is to judge.
 */
#include "../unit.h"

#include "../../vm/edge_log.h"
#include "../../vm/edge_log.c"

enum { step, dir, enable, limit_min, limit_max, estop, other };

#define MAX_EDGES 20000
#define STEPS 1000 /* there, and as many back */

static const struct edge_log_motor motor = {
	.step = step,
	.dir = dir,
	.enable = enable,
	.enable_low = true,
	.high_ns = 5000,
	.low_ns = 6000,
	.setup_ns = 20000,
	.hold_ns = 7000,
	.enable_ns = 1000000,
	.velocity = 10000,
	.acceleration = 200000, /* full speed after 250 steps */
	.tick_ns = 0,
	.lateness_ns = 1, /* times are rounded to it */
	.position_min = -10,
	.position_max = STEPS,
	.stop = {{.used = true, .line = limit_max, .direction = 1},
		 {.used = true, .line = estop, .low = true}},
};

struct log {
	struct incise_sim_edge edge[MAX_EDGES];
	size_t n;
	int64_t t_ns;
};

static void put(struct log *log, int64_t t_ns, unsigned int line, bool value)
{
	assert_true(log->n < MAX_EDGES);
	log->edge[log->n] = (struct incise_sim_edge){
		.t_ns = t_ns,
		.sequence = log->n,
		.line = line,
		.value = value,
		.flags = line >= limit_min && line != other ? INCISE_SIM_EDGE_INPUT : 0,
	};
	log->n++;
	log->t_ns = t_ns;
}

/* When a motion of @way steps from rest to rest has come to @at: the classic trapezium. */
static double time_of(double at, double way, double v, double a)
{
	double ramp = fmin(v * v / (2 * a), way / 2);
	double top = sqrt(2 * a * ramp);
	double end = 2 * top / a + (way - 2 * ramp) / top;

	if (at <= ramp)
		return sqrt(2 * at / a);
	if (at <= way - ramp)
		return top / a + (at - ramp) / top;
	return end - sqrt(2 * (way - at) / a);
}

/* Steps there and back again as fast as the limits allow, all times as short as allowed. */
static struct log *good(double v, double a)
{
	struct log *log = calloc(1, sizeof(*log));
	int64_t begin = 5000000000;

	assert_non_null(log);
	put(log, begin, enable, 0);
	begin += motor.enable_ns;
	for (int back = 0; back < 2; back++) {
		put(log, begin, dir, !back);
		begin += motor.setup_ns;
		for (int i = 1; i <= STEPS; i++) {
			int64_t t_ns = begin + llround(1e9 * time_of(i, STEPS, v, a));

			if (log->n && log->edge[log->n - 1].line == step &&
			    t_ns - log->edge[log->n - 2].t_ns < 1e9 / v)
				t_ns++;
			put(log, t_ns, step, 1);
			put(log, t_ns + motor.high_ns, step, 0);
		}
		begin = log->t_ns + motor.hold_ns;
	}
	put(log, begin + 3000000, enable, 1);
	return log;
}

/* Index of the leading edge of step @i, from 1, on the way there. */
static size_t lead_of(int i)
{
	return 2 + 2 * (i - 1);
}

static void later(struct log *log, size_t from, int64_t by_ns)
{
	for (size_t i = from; i < log->n; i++)
		log->edge[i].t_ns += by_ns;
}

static void drop(struct log *log, size_t at, bool renumber)
{
	memmove(&log->edge[at], &log->edge[at + 1], (--log->n - at) * sizeof(*log->edge));
	for (size_t i = at; renumber && i < log->n; i++)
		log->edge[i].sequence = i;
}

static void insert(struct log *log, size_t at, unsigned int line, bool value,
		   int64_t t_ns)
{
	memmove(&log->edge[at + 1], &log->edge[at], (log->n++ - at) * sizeof(*log->edge));
	log->edge[at] = (struct incise_sim_edge){
		.t_ns = t_ns,
		.line = line,
		.value = value,
		.flags = line >= limit_min && line != other ? INCISE_SIM_EDGE_INPUT : 0,
	};
	for (size_t i = at; i < log->n; i++)
		log->edge[i].sequence = i;
}

static void nothing(struct log *log)
{
}

static void sequence_skips(struct log *log)
{
	drop(log, lead_of(9), false);
	drop(log, lead_of(9), false);
}

static void time_goes_back(struct log *log)
{
	insert(log, lead_of(50), other, 1, log->edge[lead_of(50) - 1].t_ns - 1);
}

static void step_doubled(struct log *log)
{
	insert(log, lead_of(50) + 1, step, 1, log->edge[lead_of(50)].t_ns);
}

static void trail_missing(struct log *log)
{
	drop(log, lead_of(50) + 1, true);
}

static void high_short(struct log *log)
{
	log->edge[lead_of(50) + 1].t_ns--;
}

static void low_short(struct log *log)
{
	size_t at = lead_of(50);

	log->edge[at - 1].t_ns = log->edge[at].t_ns - motor.low_ns + 1;
}

static void setup_short(struct log *log)
{
	log->edge[1].t_ns = log->edge[2].t_ns - motor.setup_ns + 1;
}

static void hold_short(struct log *log)
{
	log->edge[lead_of(STEPS) + 2].t_ns =
		log->edge[lead_of(STEPS)].t_ns + motor.hold_ns - 1;
}

static void dir_in_pulse(struct log *log)
{
	size_t at = lead_of(STEPS);

	/* Longer than hold, and still the pulse is out. */
	later(log, at + 1, 10000);
	insert(log, at + 1, dir, 0, log->edge[at].t_ns + motor.hold_ns);
	drop(log, at + 3, true);
}

static void enable_soon(struct log *log)
{
	log->edge[0].t_ns += log->edge[2].t_ns - log->edge[0].t_ns - motor.enable_ns + 1;
}

static void no_power(struct log *log)
{
	insert(log, lead_of(STEPS) + 2, enable, 1, log->edge[lead_of(STEPS) + 1].t_ns);
	drop(log, log->n - 1, true);
}

static void too_fast(struct log *log)
{
	/* In the middle it goes at full speed: one step comes a little sooner. */
	log->edge[lead_of(500)].t_ns -= 20;
}

static void speed_jumps(struct log *log)
{
	/* Four steps in full run at half speed. */
	for (int i = 500; i < 504; i++)
		later(log, lead_of(i), 100000);
}

static void starts_at_once(struct log *log)
{
	/* The slow steps of the ramp are missing, and a long rest is before. */
	for (int i = 0; i < 2 * 100; i++)
		drop(log, lead_of(1), true);
	later(log, lead_of(1), 1000000000);
}

static void stops_at_once(struct log *log)
{
	/* Steps of the second ramp are missing; then a long rest, and back. */
	for (int i = 0; i < 2 * 100; i++)
		drop(log, lead_of(STEPS - 99), true);
	later(log, lead_of(STEPS - 99), 1000000000);
}

static void ends_at_once(struct log *log)
{
	struct incise_sim_edge off = log->edge[log->n - 1];

	off.t_ns += 1000000000;
	log->n = lead_of(500);
	put(log, off.t_ns, enable, 1);
}

static void turns_at_once(struct log *log)
{
	/* At full speed, and back at full speed. */
	log->n = lead_of(500);
	log->t_ns += 100000;
	put(log, log->t_ns, dir, 0);
	for (int i = 0; i < 100; i++) {
		put(log, log->t_ns + 95000, step, 1);
		put(log, log->t_ns + 5000, step, 0);
	}
}

static void goes_too_far(struct log *log)
{
	/* One step up more, slowly, before the way back. */
	size_t at = lead_of(STEPS) + 2;
	int64_t t_ns = log->edge[at - 1].t_ns + 100000000;

	later(log, at, 200000000);
	insert(log, at, step, 1, t_ns);
	insert(log, at + 1, step, 0, t_ns + 5000);
}

static void limit_ignored(struct log *log)
{
	insert(log, lead_of(501), limit_max, 1, log->edge[lead_of(500)].t_ns);
}

static void limit_obeyed(struct log *log)
{
	/* It comes with the last step, and the way back is free. */
	insert(log, lead_of(STEPS) + 1, limit_max, 1, log->edge[lead_of(STEPS)].t_ns);
}

static void estop_ignored(struct log *log)
{
	insert(log, lead_of(501), estop, 0, log->edge[lead_of(500)].t_ns);
}

static void estop_obeyed(struct log *log)
{
	/* At once, and power is gone: no braking is asked for. */
	log->n = lead_of(500) + 2;
	put(log, log->t_ns + 1, estop, 0);
	put(log, log->t_ns + 1, enable, 1);
}

static void configured_again(struct log *log)
{
	insert(log, lead_of(5), step, 0, log->edge[lead_of(5) - 1].t_ns + 1);
	log->edge[lead_of(5)].flags = INCISE_SIM_EDGE_CONFIGURED;
}

static void others_chatter(struct log *log)
{
	insert(log, lead_of(5), other, 0, log->edge[lead_of(5)].t_ns);
	insert(log, lead_of(5), other, 0, log->edge[lead_of(5)].t_ns);
}

#define PASSES EDGE_LOG_FAULTS

static const struct {
	const char *name;
	void (*doctor)(struct log *log);
	enum edge_log_fault fault;
} cases[] = {
	{"nothing", nothing, PASSES},
	{"the limit comes with the last step", limit_obeyed, PASSES},
	{"stands after the e-stop", estop_obeyed, PASSES},
	{"an output is configured as it was", configured_again, PASSES},
	{"other lines change", others_chatter, PASSES},
	{"edges are missing", sequence_skips, EDGE_LOG_LOST},
	{"a stamp is before the last one", time_goes_back, EDGE_LOG_ORDER},
	{"a leading edge comes twice", step_doubled, EDGE_LOG_REPEAT},
	{"a pulse has no end", trail_missing, EDGE_LOG_REPEAT},
	{"high is 1 ns short", high_short, EDGE_LOG_HIGH},
	{"low is 1 ns short", low_short, EDGE_LOG_LOW},
	{"set-up is 1 ns short", setup_short, EDGE_LOG_SETUP},
	{"hold is 1 ns short", hold_short, EDGE_LOG_HOLD},
	{"dir changes in the pulse", dir_in_pulse, EDGE_LOG_HOLD},
	{"the first step is 1 ns too soon", enable_soon, EDGE_LOG_ENABLE},
	{"it moves without power", no_power, EDGE_LOG_ENABLE},
	{"a step is 20 ns too soon", too_fast, EDGE_LOG_VELOCITY},
	{"speed jumps", speed_jumps, EDGE_LOG_ACCELERATION},
	{"it starts at once", starts_at_once, EDGE_LOG_ACCELERATION},
	{"it stops at once", stops_at_once, EDGE_LOG_ACCELERATION},
	{"power goes in full run", ends_at_once, EDGE_LOG_ACCELERATION},
	{"it turns at once", turns_at_once, EDGE_LOG_ACCELERATION},
	{"one step beyond", goes_too_far, EDGE_LOG_RANGE},
	{"a limit is not obeyed", limit_ignored, EDGE_LOG_STOP},
	{"the e-stop is not obeyed", estop_ignored, EDGE_LOG_STOP},
};

TEST(test_each_fault_is_caught_for_what_it_is)
{
	static struct edge_log judge;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct log *log = good(motor.velocity, motor.acceleration);

		cases[i].doctor(log);
		/* dir is low, enable is low active and high: no power */
		edge_log_init(&judge, &motor, 0, 4);
		edge_log_take(&judge, log->edge, log->n);
		if (cases[i].fault == PASSES && judge.faulty)
			fail_msg("%s: %s", cases[i].name, judge.first);
		if (cases[i].fault != PASSES && !judge.faults[cases[i].fault])
			fail_msg("%s: not caught as %s (%s)", cases[i].name,
				 edge_log_name(cases[i].fault), judge.first);
		free(log);
	}
}

TEST(test_steps_are_counted)
{
	struct log *log = good(motor.velocity, motor.acceleration);
	static struct edge_log judge;

	edge_log_init(&judge, &motor, 0, 4);
	/* In pieces, as a ring is drained. */
	for (size_t i = 0; i < log->n; i += 7)
		edge_log_take(&judge, &log->edge[i], log->n - i < 7 ? log->n - i : 7);
	assert_int_equal(judge.faulty, 0);
	assert_int_equal(judge.up, STEPS);
	assert_int_equal(judge.down, STEPS);
	assert_int_equal(judge.position, 0);
	/* enable, dir, dir, enable, and two edges a step */
	assert_int_equal(judge.edges, 4 + 4 * STEPS);
	free(log);
}

/* A motion with a little more acceleration than allowed does not pass, with less it does. */
TEST(test_acceleration_is_seen_to_a_hundredth)
{
	static const struct {
		double factor;
		bool passes;
	} motions[] = {{0.5, true}, {0.99, true}, {1, true}, {1.02, false}, {2, false}};
	static struct edge_log judge;

	for (size_t i = 0; i < sizeof(motions) / sizeof(*motions); i++) {
		struct log *log =
			good(motor.velocity, motor.acceleration * motions[i].factor);

		edge_log_init(&judge, &motor, 0, 4);
		edge_log_take(&judge, log->edge, log->n);
		assert_int_equal(!judge.faults[EDGE_LOG_ACCELERATION], motions[i].passes);
		/* What it says it saw is never more than there was. */
		assert_true(judge.hardest <= motions[i].factor * (1 + 1e-9));
		assert_true(judge.hardest > motions[i].factor * 0.98);
		free(log);
	}
}

/* Steps that are late by any time up to lateness_ns are no fault, and later ones are. */
TEST(test_lateness_is_allowed_for)
{
	struct edge_log_motor loose = motor;
	static struct edge_log judge;
	uint32_t random = 1;

	loose.low_ns = 500;
	loose.setup_ns = loose.hold_ns = 0;
	for (int slow = 0; slow < 2; slow++) {
		struct log *log = good(motor.velocity, motor.acceleration);

		loose.velocity = motor.velocity * 1.3;
		loose.lateness_ns = 20001;
		for (size_t i = 2; i < log->n; i++) {
			random = random * 1664525 + 1013904223;
			if (log->edge[i].line == step && log->edge[i].value) {
				log->edge[i].t_ns +=
					(random >> 8) % 20000 * (slow ? 4 : 1);
				log->edge[i + 1].t_ns = log->edge[i].t_ns + loose.high_ns;
			}
		}
		edge_log_init(&judge, &loose, 0, 4);
		edge_log_take(&judge, log->edge, log->n);
		assert_int_equal(!judge.faults[EDGE_LOG_ACCELERATION], !slow);
		free(log);
	}
}
