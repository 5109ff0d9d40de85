// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Guard on and off at stiff and late walls; see bench_guard.h.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "../../lib/control/guard.h"
#include "../../lib/control/plant.h"
#include "bench_device.h"
#include "bench_guard.h"
#include "../cli/cli.h"
#include "metrics.h"
#include "../cli/json.h"

#define N(array) (sizeof(array) / sizeof(*(array)))

/* Hardly any friction of the device's own: the guard has to do it. */
#define DAMPING_N_s_mm 1e-5
#define CAP_UNIT_N_s_mm (DEVICE / PERIOD_S) /* m/T */
/* A hand that leans on it: nothing comes from a hand that is worse than a weight. */
#define PRESS_N 1
#define BEGIN_mm 1
#define SPEED_mm_s 50
/* What a tissue can have stored: 4 N at 1 mm. */
#define RESERVE_N_mm 2
#define CLAMP_N 10
#define DELAY_MAX 15
#define TICKS 12000
/* 10 m: no device goes there, and nobody waits for it to come back. */
#define GONE_mm 1e4

static const double stiffness[] = {1, 2, 5, 10, 20, 50, 90, 140, 200};
static const int delays[] = {0, 1, 2, 5, 10, 15};
static const double shares[] = {0.05, 0.1, 0.25, 0.5, 0.75, 1, 1.5, 2};
#define SHARE_DELAYS 4 /* of the first delays */

static const char *const setting_names[GUARD_SETTINGS] = {"off", "on", "uncapped",
							  "contact"};

static void set(struct incise_guard *guard, const struct guard_row *row)
{
	incise_guard_init(guard, DEVICE_KG, PERIOD_S,
			  row->setting == GUARD_OFF ? 0 : RESERVE_N_mm);
	if (row->setting == GUARD_ON || row->setting == GUARD_CONTACT)
		guard->cap_N_s_mm = row->share * CAP_UNIT_N_s_mm;
	else if (row->setting == GUARD_UNCAPPED)
		guard->cap_N_s_mm = 1e30;
}

static void press(struct guard_row *row)
{
	struct incise_plant plant = {.mass_kg = DEVICE_KG,
				     .damping_N_s_mm = DAMPING_N_s_mm,
				     .position_mm = BEGIN_mm,
				     .velocity_mm_s = -SPEED_mm_s};
	const int size = DELAY_MAX + 1;
	double seen[DELAY_MAX + 1], sent[DELAY_MAX + 1] = {0}, quarter[4] = {0};
	double was = BEGIN_mm + SPEED_mm_s * PERIOD_S;
	struct incise_guard guard;
	int k;

	set(&guard, row);
	for (k = 0; k < size; k++)
		seen[k] = BEGIN_mm;
	for (k = 0; k < TICKS && fabs(plant.position_mm) < GONE_mm; k++) {
		double x = plant.position_mm, wall_mm;
		/* The velocity that a loop has is that of the last period. */
		double at[3] = {x}, velocity[3] = {(x - was) / PERIOD_S}, force[3] = {0};

		seen[k % size] = x;
		wall_mm = seen[(k + size - (row->actuator ? 0 : row->delay)) % size];
		force[0] = wall_mm < 0 ? -row->K_N_mm * wall_mm : 0;
		/* Debt is never forgiven here: the harder case. Out of contact the guard goes
		 * on until it is paid, but for the setting that shows why. */
		if (row->setting != GUARD_CONTACT || force[0] != 0)
			incise_guard_apply(&guard, at, velocity, force);
		if (row->clamp_N > 0)
			force[0] = fmax(-row->clamp_N, fmin(row->clamp_N, force[0]));
		sent[k % size] = force[0];
		if (row->actuator)
			force[0] = sent[(k + size - row->delay) % size];
		incise_guard_sent(&guard, force);
		incise_plant_step(&plant, force[0] - PRESS_N, PERIOD_S);
		was = x;
		quarter[4 * k / TICKS] = fmax(quarter[4 * k / TICKS], fabs(x));
		row->largest_N = fmax(row->largest_N, fabs(force[0]));
	}
	row->late_mm = k < TICKS ? INFINITY : quarter[3];
	for (int q = 0; q < 4; q++)
		row->largest_mm = fmax(row->largest_mm, quarter[q]);
	/* It may bounce for ever, but not higher and higher: what grows at all doubles in far
	 * less than half of the run. */
	row->bounded =
		k == TICKS && (quarter[3] < 1.25 * quarter[1] || quarter[3] < BEGIN_mm);
}

static void add(struct guard_bench *bench, struct guard_row row)
{
	if (bench->n == GUARD_ROWS_MAX)
		cli_fail("guard: more than %d rows", GUARD_ROWS_MAX);
	press(&row);
	bench->row[bench->n++] = row;
	cli_progress("guard: %d", bench->n);
}

void bench_guard(struct guard_bench *bench, bool quick)
{
	/* Late walls: every setting. Quick: three stiffnesses, two delays. */
	for (int s = 0; s < GUARD_SETTINGS; s++)
		for (size_t d = 0; d < N(delays); d += quick ? 5 : 1)
			for (size_t i = 0; i < N(stiffness); i += quick ? 4 : 1)
				for (int clamp = 0; clamp < 2; clamp++)
					add(bench,
					    (struct guard_row){
						    .K_N_mm = stiffness[i],
						    .delay = delays[d],
						    .setting = s,
						    .share = INCISE_GUARD_SHARE,
						    .clamp_N = clamp ? CLAMP_N : 0});
	bench->swept = bench->n;
	/* Other caps; and the same behind a late actuator. */
	for (int actuator = 0; actuator < 2; actuator++)
		for (size_t c = 0; c < N(shares); c += quick ? 3 : 1)
			for (size_t d = 0; d < SHARE_DELAYS; d += quick ? 3 : 1)
				for (size_t i = 0; i < N(stiffness); i += quick ? 8 : 4)
					add(bench,
					    (struct guard_row){.K_N_mm = stiffness[i],
							       .delay = delays[d],
							       .actuator = actuator,
							       .setting = GUARD_ON,
							       .share = shares[c]});
}

static bool capped(const struct guard_row *r)
{
	return r->setting == GUARD_ON || r->setting == GUARD_CONTACT;
}

static bool must_hold(const struct guard_row *r)
{
	return r->setting == GUARD_ON && !r->actuator && r->share == INCISE_GUARD_SHARE;
}

int guard_bench_missed(const struct guard_bench *bench)
{
	int missed = 0;

	for (int i = 0; i < bench->n; i++)
		missed += must_hold(&bench->row[i]) && !bench->row[i].bounded;
	return missed;
}

/* One setting as a table of stiffness and delay: how far and how hard, or that it grows. */
static void print_setting(const struct guard_bench *bench, enum guard_setting setting,
			  bool clamped)
{
	double K = 0;

	printf("guard %s%s%s\n%10s", setting_names[setting],
	       setting == GUARD_CONTACT ? " only" : "", clamped ? ", clamp" : "",
	       "K_N_mm");
	for (int i = 0; i < bench->n; i++) {
		const struct guard_row *r = &bench->row[i];

		if (r->K_N_mm == bench->row[0].K_N_mm && r->setting == setting &&
		    (r->clamp_N > 0) == clamped && r->share == INCISE_GUARD_SHARE &&
		    !r->actuator && i < bench->swept)
			printf("   delay %-9d", r->delay);
	}
	/* Rows are by delay and then stiffness: turned round here. */
	for (size_t k = 0; k < N(stiffness); k++)
		for (int i = 0; i < bench->swept; i++) {
			const struct guard_row *r = &bench->row[i];
			char text[40];

			if (r->K_N_mm != stiffness[k] || r->setting != setting ||
			    (r->clamp_N > 0) != clamped)
				continue;
			if (r->K_N_mm != K)
				printf("\n%10g", r->K_N_mm);
			K = r->K_N_mm;
			snprintf(text, sizeof(text), "%.3g mm %.3g N", r->largest_mm,
				 r->largest_N);
			printf("   %-15s", r->bounded ? text : "grows");
		}
	printf("\n");
}

/* How many of the stiffnesses are bounded for each cap. */
static void print_shares(const struct guard_bench *bench, bool actuator)
{
	printf("bounded for other caps, %s late\n%10s", actuator ? "actuator" : "wall",
	       "of m/T");
	for (size_t d = 0; d < SHARE_DELAYS; d++)
		printf("   delay %-9d", delays[d]);
	for (size_t c = 0; c < N(shares); c++) {
		char line[128] = "";
		int length = 0;

		for (size_t d = 0; d < SHARE_DELAYS; d++) {
			int bounded = 0, all = 0;

			for (int i = bench->swept; i < bench->n; i++)
				if (bench->row[i].share == shares[c] &&
				    bench->row[i].delay == delays[d] &&
				    bench->row[i].actuator == actuator) {
					all++;
					bounded += bench->row[i].bounded;
				}
			if (all)
				length += snprintf(line + length, sizeof(line) - length,
						   "   %d of %-10d", bounded, all);
			else
				length += snprintf(line + length, sizeof(line) - length,
						   "   %-15s", "-");
		}
		if (strpbrk(line, "0123456789"))
			printf("\n%10g%s", shares[c], line);
	}
	printf("\n");
}

void guard_bench_print(const struct guard_bench *bench)
{
	printf("guard of passivity: %g kg, pressed by %g N, meets a wall that answers late, at "
	       "%g mm/s; cap %g m/T; farthest and hardest in %g s\n",
	       DEVICE_KG, (double)PRESS_N, (double)SPEED_mm_s, INCISE_GUARD_SHARE,
	       TICKS * PERIOD_S);
	for (int clamped = 0; clamped < 2; clamped++)
		for (int s = 0; s < GUARD_SETTINGS; s++)
			print_setting(bench, s, clamped);
	for (int actuator = 0; actuator < 2; actuator++)
		print_shares(bench, actuator);
	putchar('\n');
}

json_t *guard_bench_json(const struct guard_bench *bench)
{
	json_t *rows = json_array();

	for (int i = 0; i < bench->n; i++) {
		const struct guard_row *r = &bench->row[i];

		json_array_append_new(
			rows,
			json_pack("{so si ss ss so so sb so so so}", "K_N_mm",
				  json_number(r->K_N_mm), "delay", r->delay, "late",
				  r->actuator ? "actuator" : "wall", "guard",
				  setting_names[r->setting], "share",
				  json_number(capped(r) ? r->share : NAN), "clamp_N",
				  json_number(r->clamp_N > 0 ? r->clamp_N : NAN),
				  "bounded", r->bounded, "largest_mm",
				  json_number(r->largest_mm), "late_mm",
				  json_number(r->late_mm), "largest_N",
				  json_number(r->largest_N)));
	}
	return rows;
}

void guard_bench_figures(const struct guard_bench *bench, json_t *figures)
{
	int bounded[GUARD_SETTINGS] = {0};

	for (int i = 0; i < bench->swept; i++)
		bounded[bench->row[i].setting] += bench->row[i].bounded;
	for (int s = 0; s < GUARD_SETTINGS; s++)
		metrics_more_is_better(metrics_exact(figures, bounded[s], "1",
						     "guard %s walls held",
						     setting_names[s]));
}
