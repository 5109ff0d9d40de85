// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * work: work that the tissue of the shipped scenes gives back over closed motions.
 * A hand goes a random way in and above the tissue and back to where it began, in the air:
 *
 *     ┌──●──╮          taken = -∮ F·dx, from tick to tick by the trapezoid rule
 *   ──│─────┼───────
 *     ╰──╮  │          below 0, the tissue would drive a hand for ever
 *        ╰──╯
 *
 * The tool does not turn: no torque is rendered, so that only ways do work.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/plan.h>
#include "../../lib/base/random.h"
#include "../../lib/base/vector.h"
#include "../../tools/cli/scene_argument.h"
#include "../../tools/cli/stopwatch.h"
#include "program.h"

#define MOTIONS 10000
#define QUICK_MOTIONS 300
#define SCENES_MAX 16
#define WAVES 4
#define ABOVE_MM 2.0
#define AIR_S 0.5
#define RATE_HZ 1000.0
#define LEAST_N 0x1p-16 /* of the integers */
#define FAR_MM 500.0

struct work_row {
	char name[40];
	const char *tool;
	double motions, in_contact;
	double least_N_mm, median_N_mm; /* taken */
	double rounding_N_mm;		/* the largest */
	double least_held_N_mm;		/* taken from a device: forces held for a tick */
	double returned;		/* motions */
};

static const struct bench_table work_table = {
	.key = "work",
	.row_bytes = sizeof(struct work_row),
	.columns = {COLUMN(work_row, "scene", name), COLUMN(work_row, "tool", tool),
		    COLUMN(work_row, "motions", motions, .whole = true),
		    COLUMN(work_row, "in_contact", in_contact, .whole = true),
		    COLUMN(work_row, "returned", returned, .whole = true),
		    COLUMN(work_row, "least_N_mm", least_N_mm),
		    COLUMN(work_row, "rounding_N_mm", rounding_N_mm),
		    COLUMN(work_row, "median_N_mm", median_N_mm),
		    COLUMN(work_row, "least_held_N_mm", least_held_N_mm)},
};

/* A way to and fro: a sum of waves that is 0 at both ends. */
struct way {
	double size_mm[WAVES], phase[WAVES];
};

struct motion {
	struct way out, along, across;
	double length_s, at_mm;
};

static double draw(uint64_t key, uint64_t *n, double from, double to)
{
	return from + (to - from) * incise_random_uniform(key, (*n)++);
}

static struct way draw_way(uint64_t key, uint64_t *n, double most_mm)
{
	struct way way;

	for (int i = 0; i < WAVES; i++) {
		way.size_mm[i] = draw(key, n, -most_mm, most_mm) / (1 + i);
		way.phase[i] = draw(key, n, 0, 2 * M_PI);
	}
	return way;
}

static double at(const struct way *way, double share)
{
	double sum = 0;

	for (int i = 0; i < WAVES; i++)
		sum += way->size_mm[i] *
		       (sin(2 * M_PI * (1 + i) * share + way->phase[i]) -
			sin(way->phase[i]));
	return sum;
}

/* Straight in and out, along a cut, or anywhere. */
static struct motion draw_motion(uint64_t key, uint64_t *n)
{
	struct motion m = {.length_s = draw(key, n, 1, 3),
			   .at_mm = draw(key, n, -40, 40)};
	int kind = (int)draw(key, n, 0, 3);

	m.out = draw_way(key, n, 8);
	m.along = draw_way(key, n, kind > 0 ? 6 : 0);
	m.across = draw_way(key, n, kind > 1 ? 3 : 0);
	return m;
}

/* The last one is a session: another of them for each motion, in the cuts of all before. */
static const struct tool {
	const char *name;
	enum incise_tool held;
	double attitude[4]; /* its end down */
	const char *stage;  /* that a plan must have, or NULL */
} tools[] = {{"blade", INCISE_TOOL_BLADE, {1}, NULL},
	     {"handle", INCISE_TOOL_HANDLE, {0, 1}, "insertion"},
	     {"tube", INCISE_TOOL_TUBE, {1}, "insertion"},
	     {"any", INCISE_TOOL_AUTO, {1}, "insertion"}};
#define SINGLE_TOOLS 3

static struct work_row rows[SCENES_MAX * (SINGLE_TOOLS + 1)];
static int n_rows;

struct hand {
	struct incise_plan *plan;
	const struct tool *tool;
	struct incise_touch top;
	double end_mm[SINGLE_TOOLS][3]; /* of each tool, from the tip */
	double along[3], across[3];
	double t_s;
	struct incise_tick tick;
	bool known; /* there was a tick before */
};

/* One tick at a place; adds up the work that is taken. */
static void go(struct hand *hand, double along_mm, double across_mm, double out_mm,
	       double *taken, double *held, double *rounding)
{
	struct incise_tracker_sample sample = {.status = ' '};
	struct incise_tick was = hand->tick;
	double way[3], mean[3], change[3];

	memcpy(sample.quaternion, hand->tool->attitude, sizeof(sample.quaternion));
	v3_sub(sample.position_mm, hand->top.point_mm, hand->end_mm[hand->tool - tools]);
	v3_add(sample.position_mm, sample.position_mm, along_mm, hand->along);
	v3_add(sample.position_mm, sample.position_mm, across_mm, hand->across);
	v3_add(sample.position_mm, sample.position_mm, out_mm, hand->top.normal);
	hand->t_s += 1 / RATE_HZ;
	sample.t_ns = INCISE_NS_PER_S + llround(hand->t_s * INCISE_NS_PER_S);
	if (incise_plan_feed(hand->plan, &sample, 1) != 1 ||
	    incise_plan_tick(hand->plan, sample.t_ns, &hand->tick))
		cli_fail("work: a plan does not take a tick");
	if (hand->known) {
		v3_sub(way, hand->tick.tool_mm, was.tool_mm);
		v3_add(mean, was.command_N, 1, hand->tick.command_N);
		v3_sub(change, hand->tick.command_N, was.command_N);
		*taken -= v3_dot(mean, way) / 2;
		*held -= v3_dot(was.command_N, way);
		*rounding += LEAST_N * v3_length(way);
		/* Between these two the force begins somewhere. */
		if ((was.depth_mm > 0) != (hand->tick.depth_mm > 0))
			*rounding += v3_length(change) * v3_length(way) / 2;
	}
	hand->known = true;
}

static void take(struct hand *hand, const struct tool *tool)
{
	hand->tool = tool;
	incise_plan_set_tool(hand->plan, tool->held);
}

/* High up the end of each tool is found, relative to the tip. */
static void find_ends(struct hand *hand)
{
	double ignored[3] = {0};

	for (int i = 0; i < SINGLE_TOOLS; i++) {
		take(hand, &tools[i]);
		for (int k = 0; k < AIR_S * RATE_HZ; k++)
			go(hand, 0, 0, FAR_MM, &ignored[0], &ignored[1], &ignored[2]);
		v3_sub(hand->end_mm[i], hand->tick.tool_mm, hand->tick.position_mm);
	}
}

static void measure(struct hand *hand, const struct tool *tool, struct work_row *row)
{
	static double all[MOTIONS];
	uint64_t key = incise_random_key(1, INCISE_RANDOM_TOOTH), n = 0;
	double ignored[3] = {0};

	row->least_N_mm = row->least_held_N_mm = INFINITY;
	find_ends(hand);
	take(hand, tool);
	for (int i = 0; i < row->motions; i++) {
		struct motion m = draw_motion(key, &n);
		double taken = 0, held = 0, rounding = 0;
		bool contact = false;
		int ticks = (int)(m.length_s * RATE_HZ);

		if (tool->held == INCISE_TOOL_AUTO)
			take(hand, &tools[(int)draw(key, &n, 0, SINGLE_TOOLS)]);
		/* It is taken there through the air, where the predictor forgets the way. */
		for (int k = 0; k < AIR_S * RATE_HZ; k++)
			go(hand, m.at_mm, 0, ABOVE_MM, &ignored[0], &ignored[1],
			   &ignored[2]);
		for (int k = 0; k <= ticks; k++) {
			double share = (double)k / ticks;

			go(hand, m.at_mm + at(&m.along, share), at(&m.across, share),
			   ABOVE_MM + at(&m.out, share), &taken, &held, &rounding);
			contact |= hand->tick.depth_mm > 0;
		}
		if (contact)
			all[(int)row->in_contact] = taken;
		row->in_contact += contact;
		row->returned += taken < -rounding;
		row->least_N_mm = fmin(row->least_N_mm, taken);
		row->least_held_N_mm = fmin(row->least_held_N_mm, held);
		row->rounding_N_mm = fmax(row->rounding_N_mm, rounding);
		if (i % 100 == 0)
			cli_progress("work: %s, %s, %d", row->name, row->tool, i);
	}
	stopwatch_sort(all, (int)row->in_contact);
	row->median_N_mm = row->in_contact > 0 ? all[(int)row->in_contact / 2] : NAN;
}

static bool has(const struct incise_plan *plan, const char *stage)
{
	const char *name;

	for (int i = 0; (name = incise_plan_stage(plan, i)); i++)
		if (!strcmp(name, stage))
			return true;
	return false;
}

static void add(const char *path, const struct tool *tool, bool quick)
{
	const struct incise_tracker_info tracker = {.rate_hz = RATE_HZ};
	struct work_row *row = &rows[n_rows];
	struct incise_error err = {0};
	struct incise_scene *scene =
		cli_require(incise_scene_load(path, NULL, &err), &err);
	struct hand hand = {
		.plan = cli_require(incise_plan_new_fed(scene, &tracker, &err), &err)};
	char *name = scene_argument_name(path);

	snprintf(row->name, sizeof(row->name), "%s", name);
	free(name);
	row->tool = tool->name;
	row->motions = quick ? QUICK_MOTIONS : MOTIONS;
	if (!tool->stage || has(hand.plan, tool->stage)) {
		n_rows++;
		incise_plan_top(hand.plan, &hand.top);
		/* The top of the shipped scenes faces up, and the neck lies along x. */
		hand.along[0] = hand.across[1] = 1;
		measure(&hand, tool, row);
	}
	incise_plan_free(hand.plan);
	incise_scene_free(scene);
}

static void run_work(struct bench_run *run)
{
	double returned = 0;
	glob_t found;

	scene_argument_list_shipped(&found);
	for (size_t i = 0; i < found.gl_pathc && n_rows < N(rows); i++)
		for (int t = 0; t < N(tools); t++)
			add(found.gl_pathv[i], &tools[t], run->quick);
	globfree(&found);
	cli_progress_end();
	for (int i = 0; i < n_rows; i++)
		returned += rows[i].returned;
	bench_rows(run, &work_table, rows, n_rows);
	metrics_add(run->metrics, METRIC_EXACT, &returned, "1",
		    "closed motions that give work back");
	if (returned > 0)
		bench_fail(run, "work: %.0f closed paths returned work: please report it",
			   returned);
}

const struct bench bench_program = {
	.name = "work",
	.summary = "work that the shipped scenes give back over closed motions",
	.run = run_work,
};
