// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Error of the shown pose over rate, delay and cost; see bench_pose.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "bench_pose.h"
#include "../cli/cli.h"
#include "metrics.h"
#include "../cli/json.h"
#include "machine.h"
#include "../cli/plot.h"
#include "pose_picture.h"

#define TICKS 16000
#define QUICK_TICKS 3500
#define TIMED_TICKS 2000
#define REPEATS 101
#define QUICK_REPEATS 5

static const double rates_hz[] = {60, 120, 240, 1000};
#define RATES (int)(sizeof(rates_hz) / sizeof(*rates_hz))

static const double delays_ms[] = {4, 12};
#define DELAYS (int)(sizeof(delays_ms) / sizeof(*delays_ms))

static const double gaps_ms[] = {25, 50, 100, 200, 500};
#define GAPS (int)(sizeof(gaps_ms) / sizeof(*gaps_ms))

/* That losses and costs are measured at, and figures given of. */
#define USUAL_HZ 120
#define USUAL_MS 4

struct bench {
	struct pose_table rows, losses;
	struct harness_time times[RATES][POSE_METHODS];
	struct machine machine;
	int ticks, repeats;
	bool quick;
};

static void table_begin(struct pose_table *table, int conditions)
{
	*table = (struct pose_table){
		.row = calloc((size_t)conditions * POSE_ROWS, sizeof(*table->row))};
	if (!table->row)
		cli_fail("no memory");
}

/* Append a row per method, and one of the exact pose. */
static void measure(struct pose_table *table, const struct pose_condition *condition,
		    const struct harness_time *times)
{
	struct harness_time none;
	struct pose_run run;

	harness_times(&(struct harness_variant){0}, 1, 0, &none); /* left out: NaN */
	pose_run_begin(&run, condition);
	for (int i = 0; i < POSE_ROWS; i++) {
		const struct pose_method *method =
			i < POSE_METHODS ? &pose_methods[i] : NULL;
		struct pose_row *row = &table->row[table->n++];

		row->name = method ? method->name : "exact_delayed";
		row->condition = *condition;
		row->time = method ? times[i] : none;
		pose_error(&run, method, &row->error);
	}
	pose_run_end(&run);
}

static void measure_rows(struct bench *b)
{
	table_begin(&b->rows, MOTIONS * DELAYS * RATES);
	for (int i = 0; i < MOTIONS * DELAYS * RATES && !cli_stop; i++) {
		struct pose_condition condition = {
			.motion = &motions[i / RATES / DELAYS],
			.delay_ms = delays_ms[i / RATES % DELAYS],
			.tracker_hz = rates_hz[i % RATES],
			.ticks = b->ticks,
		};

		cli_progress("%s, %g ms late, %g Hz", condition.motion->name,
			     condition.delay_ms, condition.tracker_hz);
		measure(&b->rows, &condition, b->times[i % RATES]);
	}
	cli_progress_end();
}

static void measure_losses(struct bench *b)
{
	int usual = 0;

	while (rates_hz[usual] != USUAL_HZ)
		usual++;
	table_begin(&b->losses, GAPS);
	for (int i = 0; i < GAPS && !cli_stop; i++)
		measure(&b->losses,
			&(struct pose_condition){.motion = &motions[MOTION_STROKE],
						 .delay_ms = USUAL_MS,
						 .tracker_hz = USUAL_HZ,
						 .gap_ms = gaps_ms[i],
						 .ticks = b->ticks},
			b->times[usual]);
}

/* ---- cost ---- */

struct timed {
	const struct pose_run *run;
	const struct pose_method *method;
};

static void run_timed(void *context)
{
	const struct timed *timed = context;
	struct motion_state shown;

	pose_show(timed->run, timed->method, &shown, false);
}

static void measure_times(struct bench *b)
{
	struct harness_variant ways[RATES * POSE_METHODS];
	struct timed timed[RATES * POSE_METHODS];
	struct pose_run runs[RATES];

	for (int r = 0; r < RATES; r++)
		pose_run_begin(&runs[r],
			       &(struct pose_condition){.motion = &motions[MOTION_STROKE],
							.delay_ms = USUAL_MS,
							.tracker_hz = rates_hz[r],
							.ticks = TIMED_TICKS});
	for (int i = 0; i < RATES * POSE_METHODS; i++) {
		timed[i] = (struct timed){&runs[i / POSE_METHODS],
					  &pose_methods[i % POSE_METHODS]};
		ways[i] = (struct harness_variant){
			.run = run_timed, .context = &timed[i], .units = TIMED_TICKS};
	}
	harness_times(ways, RATES * POSE_METHODS, b->repeats, b->times[0]);
	for (int r = 0; r < RATES; r++)
		pose_run_end(&runs[r]);
}

/* ---- report ---- */

/* Of a motion and a delay: a line per method, columns per rate. */
static void print_block(const struct pose_row *block)
{
	const struct pose_row *usual = block;

	while (usual->condition.tracker_hz != USUAL_HZ)
		usual += POSE_ROWS;
	printf("\n%s: %s; %g ms late\n%-16s", block->condition.motion->name,
	       block->condition.motion->about, block->condition.delay_ms, "rms / mm at");
	for (int r = 0; r < RATES; r++)
		printf(" %6g Hz", block[r * POSE_ROWS].condition.tracker_hz);
	printf("   %g Hz: %7s %7s %7s %8s %7s %6s\n", (double)USUAL_HZ, "99 %", "largest",
	       "jump", "mm/s", "deg", "ns");
	for (int i = 0; i < POSE_ROWS; i++) {
		const struct pose_error *error = &usual[i].error;

		printf("%-16s", block[i].name);
		for (int r = 0; r < RATES; r++)
			printf(" %8.4f%c", block[r * POSE_ROWS + i].error.place_mm.rms,
			       *block[r * POSE_ROWS + i].error.failed ? '*' : ' ');
		printf("           %7.3f %7.3f %7.3f %8.2f %7.3f ", error->place_mm.p99,
		       error->place_mm.max, error->jump_mm, error->velocity_mm_s.rms,
		       error->turn_deg.rms);
		if (isnan(usual[i].time.ns.median))
			printf("%6s\n", "-");
		else
			printf("%6.1f\n", usual[i].time.ns.median);
	}
}

static void print_losses(const struct pose_table *losses)
{
	printf("\n%s, %d Hz, %d ms late, and nothing comes for\n%-16s",
	       motions[MOTION_STROKE].name, USUAL_HZ, USUAL_MS, "rms / mm");
	for (int g = 0; g * POSE_ROWS < losses->n; g++)
		printf(" %6g ms", losses->row[g * POSE_ROWS].condition.gap_ms);
	printf("  largest / mm, and the largest jump, at the last\n");
	for (int i = 0; i < POSE_ROWS && i < losses->n; i++) {
		const struct pose_error *last = NULL;

		printf("%-16s", losses->row[i].name);
		for (int k = i; k < losses->n; k += POSE_ROWS) {
			last = &losses->row[k].error;
			printf(" %8.3f%c", last->place_mm.rms, *last->failed ? '*' : ' ');
		}
		printf("  %8.2f %8.2f\n", last->place_mm.max, last->jump_mm);
	}
}

static void print_failed(const struct pose_table *table, const char *mark)
{
	for (int i = 0; i < table->n; i++) {
		const struct pose_condition *c = &table->row[i].condition;

		if (!*table->row[i].error.failed)
			continue;
		printf("%s%s, %s, %g Hz, %g ms late", mark, table->row[i].name,
		       c->motion->name, c->tracker_hz, c->delay_ms);
		if (c->gap_ms > 0)
			printf(", gaps of %g ms", c->gap_ms);
		printf(": %s\n", table->row[i].error.failed);
	}
}

static void print_report(const struct bench *b)
{
	const struct machine *m = &b->machine;

	printf("poses with %g mm of noise, %g ms of jitter, %g %% lost; %g s at 1000 ticks a "
	       "second; times of %d runs in turn\n%s; %s; %s\n",
	       POSE_NOISE_MM, POSE_JITTER_MS, POSE_LOST * 100, b->ticks * 1e-3,
	       b->repeats, m->cpu, m->kernel, m->compiler);
	for (int i = 0; i + RATES * POSE_ROWS <= b->rows.n; i += RATES * POSE_ROWS)
		print_block(&b->rows.row[i]);
	print_losses(&b->losses);
	putchar('\n');
	print_failed(&b->rows, "* ");
	print_failed(&b->losses, "* ");
}

static json_t *row_json(const struct pose_row *row)
{
	const struct pose_error *e = &row->error;
	const struct pose_condition *c = &row->condition;
	json_t *object = json_pack(
		"{ss ss so so so so so so so so so so so so so so so so so so so}",
		"name", row->name, "motion", c->motion->name, "tracker_hz",
		json_number(c->tracker_hz), "delay_ms", json_number(c->delay_ms),
		"rms_mm", json_number(e->place_mm.rms), "p99_mm",
		json_number(e->place_mm.p99), "max_mm", json_number(e->place_mm.max),
		"jump_mm", json_number(e->jump_mm), "rms_mm_s",
		json_number(e->velocity_mm_s.rms), "p99_mm_s",
		json_number(e->velocity_mm_s.p99), "max_mm_s",
		json_number(e->velocity_mm_s.max), "rms_deg",
		json_number(e->turn_deg.rms), "p99_deg", json_number(e->turn_deg.p99),
		"max_deg", json_number(e->turn_deg.max), "held_theory_mm",
		json_number(e->theory_mm), "spread_mm", json_number(e->spread_mm), "ns",
		json_number(row->time.ns.median), "ns_p5", json_number(row->time.ns.p5),
		"ns_p95", json_number(row->time.ns.p95), "gap_ms",
		c->gap_ms > 0 ? json_number(c->gap_ms) : json_null(), "failed",
		*e->failed ? json_text(e->failed) : json_null());

	return object;
}

static json_t *table_json(const struct pose_table *table)
{
	json_t *list = json_array();

	for (int i = 0; i < table->n; i++)
		json_array_append_new(list, row_json(&table->row[i]));
	return list;
}

static json_t *figures_of(const struct bench *b)
{
	json_t *figures = json_array();

	for (int r = 0; r < RATES; r++)
		for (int i = 0; i < POSE_METHODS; i++)
			metrics_time(figures, &b->times[r][i], "ns", "%s, %g Hz",
				     pose_methods[i].name, rates_hz[r]);
	for (int i = 0; i < b->rows.n; i++) {
		const struct pose_row *row = &b->rows.row[i];

		if (row->condition.delay_ms == USUAL_MS &&
		    row->condition.tracker_hz == USUAL_HZ)
			metrics_exact(figures, row->error.place_mm.rms, "mm",
				      "%s, %s, rms", row->name,
				      row->condition.motion->name);
	}
	return figures;
}

static void print_json(const struct bench *b)
{
	json_print(json_pack("{so sb sf sf sf sf si so so so}", "machine",
			     machine_json(&b->machine), "quick", b->quick, "noise_mm",
			     POSE_NOISE_MM, "jitter_ms", POSE_JITTER_MS, "lost",
			     POSE_LOST, "seconds", b->ticks * 1e-3, "repeats", b->repeats,
			     "rows", table_json(&b->rows), "losses",
			     table_json(&b->losses), "figures", figures_of(b)));
}

void bench_pose(bool json, bool quick, const char *plot)
{
	struct bench *b = calloc(1, sizeof(*b));
	const char *folder, *name;

	if (!b)
		cli_fail("no memory");
	if (plot)
		plot_place("plot", plot, &folder, &name);
	b->quick = quick;
	b->ticks = quick ? QUICK_TICKS : TICKS;
	b->repeats = quick ? QUICK_REPEATS : REPEATS;
	machine_init(&b->machine);
	measure_times(b);
	measure_rows(b);
	measure_losses(b);
	if (json)
		print_json(b);
	else
		print_report(b);
	cli_finish();
	if (plot) {
		pose_picture_cost(&b->rows, folder, name);
		pose_picture_rates(&b->rows, folder, name);
	}
	free(b->rows.row);
	free(b->losses.row);
	free(b);
}
