// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench stability: a hand presses a light device on walls that are far too stiff and
 * answer late, with the library's guard of passivity and without it.
 *
 *   hand's press ──▶ device ──▶ x_k ──▶ wall ──▶ [late answer] ──▶ guard ──▶ clamp ──┐
 *                      ▲                                                             │
 *                      └────────── held for T ◀── [late actuator] ◀──────────────────┘
 */
#include <stdio.h>
#include <string.h>
#include "../../lib/control/guard.h"
#include "../../lib/control/plant.h"
#include "stability.h"

#define GUARD_ROWS_MAX 768
/* Hardly any friction of the device's own: the guard has to do it. */
#define DAMPING_N_s_mm 1e-5
#define CAP_UNIT_N_s_mm (DEVICE / PERIOD_S) /* m/T */
/* A hand that leans on it: no passive hand is worse than a weight. */
#define PRESS_N 1
#define BEGIN_mm 1
#define SPEED_mm_s 50
/* Energy that a tissue can have stored: 4 N at 1 mm. */
#define RESERVE_N_mm 2
#define CLAMP_N 10
#define GUARD_DELAY_MAX 15
#define GUARD_TICKS 12000
/* 10 m: no device goes there, and nobody waits for it to come back. */
#define GONE_mm 1e4

/* On in every tick, without its cap, or asked in contact only. */
enum setting { GUARD_OFF, GUARD_ON, GUARD_UNCAPPED, GUARD_CONTACT, SETTINGS };
static const char *const setting_names[SETTINGS] = {"off", "on", "uncapped", "contact"};

struct guard_row {
	double K_N_mm;
	int delay; /* ticks */
	enum setting setting;
	const char *guard, *late; /* names of the setting, and of the late part */
	double share;		  /* of m/T: the cap; NaN: none */
	double clamp_N;		  /* NaN: none */
	bool bounded;
	double largest_mm, largest_N; /* over the whole run */
	double late_mm;		      /* over its last quarter */
	bool swept; /* at every stiffness, delay and setting; else of other caps */
	char text[40];
};

static const char wall_is_late[] = "wall", actuator_is_late[] = "actuator";

static void press(struct guard_row *row)
{
	struct incise_plant plant = {.mass_kg = DEVICE_KG,
				     .damping_N_s_mm = DAMPING_N_s_mm,
				     .position_mm = BEGIN_mm,
				     .velocity_mm_s = -SPEED_mm_s};
	const int size = GUARD_DELAY_MAX + 1;
	double seen[GUARD_DELAY_MAX + 1], sent[GUARD_DELAY_MAX + 1] = {0},
								 quarter[4] = {0};
	double was = BEGIN_mm + SPEED_mm_s * PERIOD_S;
	bool actuator = row->late == actuator_is_late;
	struct incise_guard guard;
	int k;

	incise_guard_init(&guard, DEVICE_KG, PERIOD_S,
			  row->setting == GUARD_OFF ? 0 : RESERVE_N_mm);
	if (row->setting == GUARD_ON || row->setting == GUARD_CONTACT)
		guard.cap_N_s_mm = row->share * CAP_UNIT_N_s_mm;
	else if (row->setting == GUARD_UNCAPPED)
		guard.cap_N_s_mm = 1e30;
	for (k = 0; k < size; k++)
		seen[k] = BEGIN_mm;
	for (k = 0; k < GUARD_TICKS && fabs(plant.position_mm) < GONE_mm; k++) {
		double x = plant.position_mm, wall_mm;
		/* A loop's velocity is that of the last period. */
		double at[3] = {x}, velocity[3] = {(x - was) / PERIOD_S}, force[3] = {0};

		seen[k % size] = x;
		wall_mm = seen[(k + size - (actuator ? 0 : row->delay)) % size];
		force[0] = wall_mm < 0 ? -row->K_N_mm * wall_mm : 0;
		/* Debt is never forgiven here: the harder case. Out of contact the guard goes
		 * on until it is paid, but for the setting that shows why. */
		if (row->setting != GUARD_CONTACT || force[0] != 0)
			incise_guard_apply(&guard, at, velocity, force);
		if (row->clamp_N > 0)
			force[0] = fmax(-row->clamp_N, fmin(row->clamp_N, force[0]));
		sent[k % size] = force[0];
		if (actuator)
			force[0] = sent[(k + size - row->delay) % size];
		incise_guard_sent(&guard, force);
		incise_plant_step(&plant, force[0] - PRESS_N, PERIOD_S);
		was = x;
		quarter[4 * k / GUARD_TICKS] =
			fmax(quarter[4 * k / GUARD_TICKS], fabs(x));
		row->largest_N = fmax(row->largest_N, fabs(force[0]));
	}
	row->late_mm = k < GUARD_TICKS ? INFINITY : quarter[3];
	for (int q = 0; q < 4; q++)
		row->largest_mm = fmax(row->largest_mm, quarter[q]);
	/* It may bounce for ever, but not higher and higher: a motion that grows at all doubles
	 * in far less than half of the run. */
	row->bounded = k == GUARD_TICKS &&
		       (quarter[3] < 1.25 * quarter[1] || quarter[3] < BEGIN_mm);
	if (row->bounded)
		snprintf(row->text, sizeof(row->text), "%.3g mm %.3g N", row->largest_mm,
			 row->largest_N);
	else
		strcpy(row->text, "grows");
}

/* Settings that hold walls, of those that answer late. */
struct held {
	double held, grow, n;
};

/* The number of stiffnesses that are bounded with another cap. */
struct cap {
	double share;
	int delay;
	const char *late, *verdict;
	int bounded, n;
	char text[20];
};

static struct guard_row guard_rows[GUARD_ROWS_MAX];
static int n_guard_rows;

const struct bench_table stability_guard_table = {
	.key = "guard",
	.row_bytes = sizeof(struct guard_row),
	.columns = {COLUMN(guard_row, "K_N_mm", K_N_mm),
		    COLUMN(guard_row, "delay", delay), COLUMN(guard_row, "late", late),
		    COLUMN(guard_row, "guard", guard), COLUMN(guard_row, "share", share),
		    COLUMN(guard_row, "clamp_N", clamp_N),
		    COLUMN(guard_row, "bounded", bounded),
		    COLUMN(guard_row, "largest_mm", largest_mm),
		    COLUMN(guard_row, "late_mm", late_mm),
		    COLUMN(guard_row, "largest_N", largest_N),
		    COLUMN(guard_row, "swept", swept, .data = true)},
};

const struct bench_table stability_cap_table = {
	.row_bytes = sizeof(struct cap),
	.columns = {COLUMN(cap, "share", share), COLUMN(cap, "delay", delay),
		    COLUMN(cap, "verdict", verdict)},
};

static const struct bench_block walls_block = {
	.corner = "K_N_mm",
	.line = COLUMN(guard_row, NULL, K_N_mm, "%10g"),
	.across = COLUMN(guard_row, NULL, delay, "  delay %-9.0f"),
	.cell = COLUMN(guard_row, NULL, text, "  %-15s"),
};

static const struct bench_block caps_block = {
	.corner = "of m/T",
	.line = COLUMN(cap, NULL, share, "%10g"),
	.across = COLUMN(cap, NULL, delay, "  delay %-9.0f"),
	.cell = COLUMN(cap, NULL, text, "  %-15s"),
};

static struct guard_row *add_guard_row(double K_N_mm, int delay, enum setting setting,
				       const char *late, double share, double clamp_N)
{
	struct guard_row *row = &guard_rows[n_guard_rows++];

	if (n_guard_rows > GUARD_ROWS_MAX)
		cli_fail("guard: more than %d rows", GUARD_ROWS_MAX);
	*row = (struct guard_row){.K_N_mm = K_N_mm,
				  .delay = delay,
				  .setting = setting,
				  .guard = setting_names[setting],
				  .late = late,
				  .share = share,
				  .clamp_N = clamp_N};
	cli_progress("guard: %d", n_guard_rows);
	press(row);
	if (setting != GUARD_ON && setting != GUARD_CONTACT)
		row->share = NAN;
	return row;
}

static const double stiffness[] = {1, 2, 5, 10, 20, 50, 90, 140, 200};
static const int delays[] = {0, 1, 2, 5, 10, 15};

/* Late walls of a setting, with a clamp or without, as a block of text; in the rows these two take
 * turns. */
static void print_walls(struct bench_run *run, enum setting setting, bool clamped)
{
	int n_delays = run->quick ? 2 : N(delays), n = run->quick ? 3 : N(stiffness);
	const struct guard_row *rows = &guard_rows[2 * setting * n_delays * n + clamped];

	bench_text(run, "guard %s%s%s\n", setting_names[setting],
		   setting == GUARD_CONTACT ? " only" : "", clamped ? ", clamp" : "");
	bench_block(run, &walls_block, 2 * sizeof(*rows), rows, n, n_delays, 0);
}

/* Every setting. Quick: three stiffnesses, two delays. */
static void measure_late_walls(bool quick, struct held *held)
{
	for (int s = 0; s < SETTINGS; s++) {
		for (int d = 0; d < N(delays); d += quick ? 5 : 1)
			for (int i = 0; i < N(stiffness); i += quick ? 4 : 1)
				for (int clamp = 0; clamp < 2; clamp++) {
					const struct guard_row *r = add_guard_row(
						stiffness[i], delays[d], (enum setting)s,
						wall_is_late, INCISE_GUARD_SHARE,
						clamp ? CLAMP_N : NAN);

					held[s].held += r->bounded;
					held[s].n += !clamp;
					held[s].grow += !clamp && !r->bounded;
				}
	}
	for (int i = 0; i < n_guard_rows; i++)
		guard_rows[i].swept = true;
}

#define CAPS_MAX 64

static const double shares[] = {0.05, 0.1, 0.25, 0.5, 0.75, 1, 1.5, 2};

/* Other caps, delay by delay; rows are cap by cap. Returns how many caps there are. */
static int measure_caps(bool quick, const char *late, struct cap caps[CAPS_MAX],
			int *n_delays)
{
	int step = quick ? 3 : 1, n = (N(shares) + step - 1) / step;

	*n_delays = quick ? 2 : 4;
	for (int c = 0; c < n; c++)
		for (int d = 0; d < *n_delays; d++) {
			struct cap *cap = &caps[d * n + c];

			*cap = (struct cap){.share = shares[c * step],
					    .delay = delays[d * step],
					    .late = late};
			for (int i = 0; i < N(stiffness); i += quick ? 8 : 4, cap->n++)
				cap->bounded +=
					add_guard_row(stiffness[i], cap->delay, GUARD_ON,
						      late, cap->share, NAN)
						->bounded;
			snprintf(cap->text, sizeof(cap->text), "%d of %d", cap->bounded,
				 cap->n);
			cap->verdict = cap->bounded == cap->n ? "bounded" : "grows";
		}
	return n;
}

void stability_guard(struct bench_run *run)
{
	static const char *const late[] = {wall_is_late, actuator_is_late};
	static struct held held[SETTINGS];
	static struct cap caps[2][CAPS_MAX];
	char title[200];
	int n_caps = 0, n_delays = 0, missed = 0;

	measure_late_walls(run->quick, held);
	for (int i = 0; i < 2; i++)
		n_caps = measure_caps(run->quick, late[i], caps[i], &n_delays);
	bench_text(run,
		   "guard of passivity: %g kg, pressed by %g N, meets a wall that "
		   "answers late, at %g mm/s; cap %g m/T; farthest and hardest in %g s\n",
		   DEVICE_KG, (double)PRESS_N, (double)SPEED_mm_s, INCISE_GUARD_SHARE,
		   GUARD_TICKS * PERIOD_S);
	for (int clamped = 0; clamped < 2; clamped++)
		for (int s = 0; s < SETTINGS; s++)
			print_walls(run, (enum setting)s, clamped);
	for (int i = 0; i < 2; i++) {
		bench_text(run, "bounded for other caps, %s late\n", late[i]);
		bench_block(run, &caps_block, sizeof(**caps), caps[i], n_caps, n_delays,
			    0);
	}
	bench_text(run, "\n");
	bench_rows(run, &stability_guard_table, guard_rows, n_guard_rows);
	for (int i = 0; i < SETTINGS; i++)
		metrics_more_is_better(
			metrics_add(run->metrics, METRIC_EXACT, &held[i].held, "1",
				    "guard %s walls held", setting_names[i]));
	bench_rows(run, &stability_cap_table, caps[1], n_caps * n_delays);
	snprintf(title, sizeof(title),
		 "%g of %g without a guard, %g of %g with it, %g of %g without its cap, "
		 "%g of %g in contact only",
		 held[0].grow, held[0].n, held[1].grow, held[1].n, held[2].grow,
		 held[2].n, held[3].grow, held[3].n);
	bench_scalars(run, "{ss sf}", "unbounded", title, "share", INCISE_GUARD_SHARE);
	for (int i = 0; i < n_guard_rows; i++) {
		const struct guard_row *r = &guard_rows[i];

		missed += r->setting == GUARD_ON && r->late == wall_is_late &&
			  r->share == INCISE_GUARD_SHARE && !r->bounded;
	}
	if (missed)
		bench_fail(run,
			   "guard: %d walls were not bounded with it: please report it",
			   missed);
}
