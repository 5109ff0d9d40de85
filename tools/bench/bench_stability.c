// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * How stiff a virtual wall may be; see bench_stability.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "bench_energy.h"
#include "bench_guard.h"
#include "bench_integrators.h"
#include "bench_limits.h"
#include "bench_stability.h"
#include "../cli/cli.h"
#include "metrics.h"
#include "../cli/json.h"
#include "machine.h"
#include "../cli/plot.h"
#include "stability_picture.h"

/* Simulation beside theory: what is measured, how near it shall come, and why not nearer. */
static const struct {
	void (*measure)(struct ratios *ratios, bool quick);
	struct ratios empty;
} experiments[] = {
	{bench_exact_limit,
	 {.key = "exact_limit",
	  .title =
		  "largest stable stiffness of a wall alone on the device, K T^2/m: simulated in "
		  "time against the eigenvalues",
	  .params = {"bT_m", "BT_m", "delay"},
	  .simulated = "sim_KT2_m",
	  .theory = "theory_KT2_m",
	  .tolerance = 0.01}},
	{bench_colgate,
	 {.key = "colgate",
	  .title =
		  "in the worst of passive hands, a mass and a spring that swing at some angle "
		  "per tick: against Colgate and Schenkel",
	  .params = {"bT_m", "BT_m", "delay", "angle"},
	  .simulated = "sim_KT2_m",
	  .theory = "theory_KT2_m",
	  .tolerance = 0.01,
	  .note = "at least: a damper in the wall needs a hand with many modes to reach the "
		  "bound, one does not"}},
	{bench_gil,
	 {.key = "gil",
	  .title = "little damping: against the linear law of Gil and Hulin",
	  .params = {"bT_m", "BT_m", "delay"},
	  .simulated = "sim_KT2_m",
	  .theory = "theory_KT2_m",
	  .tolerance = 0.02,
	  .note = "the law is the limit for b T/m to 0: it leaves out the next term"}},
	{bench_amplitude,
	 {.key = "amplitude",
	  .title =
		  "amplitude from which on Coulomb friction does not end an oscillation, mm: "
		  "against the describing function",
	  .params = {"omega_T", "viscous_part"},
	  .simulated = "sim_mm",
	  .theory = "theory_mm",
	  .tolerance = 0.03}},
	{bench_quantisation,
	 {.key = "quantisation",
	  .title =
		  "stiffness from which on a hand that shakes across an encoder's steps gets "
		  "energy, N/mm: against Abbott and Okamura",
	  .params = {"b_N_s_mm", "coulomb_N", "encoder_mm", "worst_way_mm"},
	  .simulated = "sim_N_mm",
	  .theory = "theory_N_mm",
	  .tolerance = 0.01}},
	{bench_leak,
	 {.key = "leak",
	  .title = "energy of a press to a depth and back, N mm: against K T u X",
	  .params = {"K_N_mm", "speed_mm_s", "depth_mm"},
	  .simulated = "sim_N_mm",
	  .theory = "theory_N_mm",
	  .tolerance = 0.03}},
	{bench_break_even,
	 {.key = "break_even",
	  .title = "damping that takes what a bounce makes, N s/mm: against K T/2",
	  .params = {"omega_T", "K_N_mm"},
	  .simulated = "sim_N_s_mm",
	  .theory = "theory_N_s_mm",
	  .tolerance = 0.03,
	  .note = "less by a third of omega T: the first part of a period in the wall has no "
		  "force yet"}},
};
#define EXPERIMENTS (sizeof(experiments) / sizeof(*experiments))

struct stability {
	struct ratios ratios[EXPERIMENTS];
	struct guard_bench guard;
	struct integrator_bench integrators;
	struct machine machine;
};

static void measure(struct stability *s, bool quick)
{
	machine_init(&s->machine);
	for (size_t i = 0; i < EXPERIMENTS; i++) {
		s->ratios[i] = experiments[i].empty;
		cli_progress("%s", s->ratios[i].key);
		experiments[i].measure(&s->ratios[i], quick);
	}
	bench_guard(&s->guard, quick);
	bench_integrators(&s->integrators, quick);
	cli_progress_end();
}

static void print_text(const struct stability *s, bool quick)
{
	printf("%s; %s; %s%s\n\n", s->machine.cpu, s->machine.kernel, s->machine.compiler,
	       quick ? "\nquick: a part of the grids" : "");
	for (size_t i = 0; i < EXPERIMENTS; i++)
		ratios_print(&s->ratios[i]);
	guard_bench_print(&s->guard);
	integrator_bench_print(&s->integrators);
}

/* How far the worst ratio of each experiment is off, and how many were tried. */
static json_t *figures_of(const struct stability *s)
{
	json_t *figures = json_array();

	for (size_t i = 0; i < EXPERIMENTS; i++) {
		const struct ratios *r = &s->ratios[i];
		double worst = 0;

		for (int k = 0; k < r->n; k++) {
			double off = ratios_value(&r->row[k]) - 1;

			/* Where theory is a lower bound more is not wrong. */
			worst = fmax(worst, r->row[k].at_least ? -off : fabs(off));
		}
		metrics_exact(figures, worst, "1", "%s worst ratio off", r->key);
		metrics_more_is_better(
			metrics_exact(figures, r->n, "1", "%s tried", r->key));
	}
	guard_bench_figures(&s->guard, figures);
	integrator_bench_figures(&s->integrators, figures);
	return figures;
}

static void print_json(const struct stability *s, bool quick)
{
	json_t *all = json_object();

	for (size_t i = 0; i < EXPERIMENTS; i++)
		json_object_set_new(all, s->ratios[i].key, ratios_json(&s->ratios[i]));
	json_object_set_new(all, "guard", guard_bench_json(&s->guard));
	json_object_set_new(all, "integrators", integrator_bench_json(&s->integrators));
	json_object_set_new(all, "quick", json_boolean(quick));
	json_object_set_new(all, "machine", machine_json(&s->machine));
	json_object_set_new(all, "figures", figures_of(s));
	json_print(all);
}

/* A bench that finds theory and simulation apart has found a fault in one of them. */
static void judge(const struct stability *s)
{
	int missed;

	for (size_t i = 0; i < EXPERIMENTS; i++) {
		const struct ratios *r = &s->ratios[i];
		const struct ratio *first = ratios_first_missed(r, &missed);
		char text[200];

		if (!first)
			continue;
		ratios_describe(r, first, text, sizeof(text));
		cli_fail(
			"%s: %d of %d differ from theory by more than %g %%, first %s: please "
			"report it",
			r->key, missed, r->n, 100 * r->tolerance, text);
	}
	missed = guard_bench_missed(&s->guard);
	if (missed)
		cli_fail("guard: %d walls were not bounded with it: please report it",
			 missed);
	missed = integrator_bench_missed(&s->integrators);
	if (missed)
		cli_fail(
			"integrators: %d runs of the exact ones were not: please report it",
			missed);
}

void bench_stability(bool json, bool quick, const char *plot)
{
	struct stability *s = calloc(1, sizeof(*s));
	const char *folder, *name;

	if (!s)
		cli_fail("no memory");
	/* A name that cannot be is said before the work, not after. */
	if (plot)
		plot_place("plot", plot, &folder, &name);
	measure(s, quick);
	if (json)
		print_json(s, quick);
	else
		print_text(s, quick);
	cli_finish();
	if (plot) {
		stability_picture_map(&s->ratios[0], folder, name);
		stability_picture_guard(&s->guard, folder, name);
		stability_picture_integrators(&s->integrators, folder, name);
	}
	judge(s);
	free(s);
}
