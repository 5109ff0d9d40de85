// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Extreme cases, and a sweep of stiff walls; see bench_extremes.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "bench_extremes.h"
#include "../../tests/extremes/extremes.h"
#include "../cli/cli.h"
#include "metrics.h"
#include "../cli/json.h"
#include "machine.h"
#include "../cli/plot.h"
#include "../cli/scene_argument.h"
#include "stiff_sweep.h"

#define ROWS_MAX 64
#define QUICK_PART 20 /* a look tries one of so many cases */

struct extremes {
	struct extremes_setup setup;
	struct extremes_row row[ROWS_MAX];
	int n;
};

/* What was tried, within a column, broken between words. */
static void print_what(const char *what)
{
	const int width = 96;

	while (*what) {
		int n = (int)strlen(what);

		if (n > width)
			for (n = width; n > 1 && what[n] != ' ';)
				n--;
		printf("    %.*s\n", n, what);
		what += n;
		while (*what == ' ')
			what++;
	}
}

static void print_table(const struct extremes *all, const struct stiff_sweep *stiff)
{
	printf("seed %llu\n%-20s %10s %10s %10s %8s\n",
	       (unsigned long long)all->setup.seed, "cases", "tried", "held", "refused",
	       "wrong");
	for (int i = 0; i < all->n; i++) {
		const struct extremes_row *r = &all->row[i];

		printf("%-20s %10ld %10ld %10ld %8ld\n", r->name, r->tried, r->held,
		       r->refused, r->wrong);
		print_what(r->what);
		if (*r->failed)
			printf("    WRONG: %s\n", r->failed);
	}
	putchar('\n');
	stiff_sweep_print(stiff);
}

static void print_json(const struct extremes *all, const struct stiff_sweep *stiff)
{
	json_t *rows = json_array(), *figures = json_array();
	struct machine machine;

	machine_init(&machine);
	for (int i = 0; i < all->n; i++) {
		const struct extremes_row *r = &all->row[i];
		json_t *failed = *r->failed ? json_string(r->failed) : json_null();

		json_array_append_new(
			rows,
			json_pack("{ss ss sI sI sI sI so}", "name", r->name, "what",
				  r->what, "tried", (json_int_t)r->tried, "held",
				  (json_int_t)r->held, "refused", (json_int_t)r->refused,
				  "wrong", (json_int_t)r->wrong, "failed", failed));
		metrics_exact(figures, (double)r->wrong, "cases", "%s wrong", r->name);
	}
	stiff_sweep_figures(stiff, figures);
	json_print(json_pack("{so sI sb so so so}", "machine", machine_json(&machine),
			     "seed", (json_int_t)all->setup.seed, "quick",
			     all->setup.part > 1, "rows", rows, "stiff",
			     stiff_sweep_json(stiff), "figures", figures));
}

static void try_all(struct extremes *all)
{
	static const struct property *const tables[] = {
		model_properties,   fixed_properties,  surface_properties,
		control_properties, motion_properties, plan_properties,
		wall_properties,    device_properties, file_properties};

	for (size_t i = 0; i < sizeof(tables) / sizeof(*tables); i++)
		for (const struct property *p = tables[i]; p->name; p++) {
			if (p->for_tests_only)
				continue;
			if (all->n == ROWS_MAX)
				cli_fail("extremes: more than %d rows", ROWS_MAX);
			cli_progress("extremes: %s", p->name);
			extremes_try(p, &all->setup, &all->row[all->n++]);
		}
}

void bench_extremes(uint64_t seed, bool json, bool quick, const char *plot)
{
	struct extremes *all = calloc(1, sizeof(*all));
	struct stiff_sweep *stiff = calloc(1, sizeof(*stiff));
	const char *folder, *name, *first = NULL;
	long wrong = 0;

	if (!all || !stiff)
		cli_fail("no memory");
	if (plot)
		plot_place("plot", plot, &folder, &name);
	all->setup = (struct extremes_setup){seed, quick ? QUICK_PART : 1,
					     scene_argument_shipped()};
	try_all(all);
	stiff_sweep(stiff, quick);
	cli_progress_end();
	if (cli_stop)
		cli_fail("interrupted");
	if (json)
		print_json(all, stiff);
	else
		print_table(all, stiff);
	cli_finish();
	if (plot)
		stiff_sweep_draw(stiff, folder, name);
	for (int i = 0; i < all->n; i++) {
		wrong += all->row[i].wrong;
		if (all->row[i].wrong && !first)
			first = all->row[i].name;
	}
	if (wrong)
		cli_fail("%ld cases came out wrong, the first in %s: a fault of incise, "
			 "please report it with the line above",
			 wrong, first);
	if (stiff_sweep_missed(stiff))
		cli_fail("%d walls are not as theory says: see 'failed'",
			 stiff_sweep_missed(stiff));
	free(all);
	free(stiff);
}
