// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise bench loop; see bench_loop.h. What it measures is in bench_tick, bench_wakeup and
 * bench_rate.
 */
#include <stdio.h>
#include <string.h>
#include "bench_loop.h"
#include "bench_rate.h"
#include "bench_tick.h"
#include "bench_wakeup.h"
#include "../cli/cli.h"
#include "metrics.h"
#include "../cli/json.h"
#include "loop_picture.h"
#include "machine.h"
#include "../cli/plot.h"

#define AWAKE_S 5
#define QUICK_AWAKE_S 0.5

static enum load load_named(const char *name)
{
	enum load load = 0;

	if (!name)
		return LOADS;
	while (load < LOADS && strcmp(name, load_name(load)))
		load++;
	if (load == LOADS)
		cli_usage("--load: '%s' is none of idle, cpu, memory, disk and view",
			  name);
	return load;
}

static json_t *rows_json(const struct tick_row *rows, int n)
{
	json_t *list = json_array();

	for (int i = 0; i < n; i++)
		json_array_append_new(list, tick_row_json(&rows[i]));
	return list;
}

/* Of the first row, with what was left out. */
static json_t *loop_lateness(const struct wakeup_row *row)
{
	json_t *lateness = lateness_json(&row->got.loop);

	if (json_is_object(lateness))
		json_object_set_new(lateness, "skipped",
				    json_integer((json_int_t)row->got.skipped));
	return lateness;
}

void bench_loop(const struct bench_loop *bench)
{
	enum load only = load_named(bench->load);
	const char *folder = NULL, *name = NULL;
	struct tick_row ticks[BENCH_TICK_ROWS] = {0};
	struct wakeups wakeups;
	struct machine machine;
	struct rates rates;
	double seconds = bench->seconds;
	int n;

	if (bench->plot)
		plot_place("plot", bench->plot, &folder, &name);
	if (!(seconds > 0))
		seconds = bench->quick ? QUICK_AWAKE_S : AWAKE_S;
	machine_init(&machine);
	n = bench_tick(bench->scene, bench->quick, ticks);
	bench_rate(bench->quick, &rates);
	bench_wakeup(bench->scene, only, bench->quick, seconds, &wakeups);
	if (bench->json) {
		json_t *figures = json_array();

		tick_rows_figures(ticks, n, figures);
		rates_figures(&rates, figures);
		wakeups_figures(&wakeups, figures);
		json_print(json_pack("{so sb so so so so so so so}", "machine",
				     machine_json(&machine), "quick", bench->quick,
				     "tick_ns", tick_cost_json(&ticks[0].cost), "rows",
				     rows_json(ticks, n), "lateness_us",
				     loop_lateness(&wakeups.row[0]), "cyclictest_us",
				     lateness_json(&wakeups.row[0].got.cyclictest),
				     "wakeups", wakeups_json(&wakeups), "rates",
				     rates_json(&rates), "figures", figures));
	} else {
		printf("%s, %s\n\n", machine.cpu, machine.kernel);
		tick_rows_print(ticks, n);
		wakeups_print(&wakeups);
		rates_print(&rates);
	}
	if (bench->plot) {
		loop_picture_wakeups(&wakeups, folder, name);
		loop_picture_rates(&rates, folder, name);
	}
}
