// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * the plan in integers, which the kernel runs, against the same plan in double: how far their
 * forces are from each other, next to the certified bound.
 *
 * Both walk along the same varied strokes (trajectory.h). Ticks at which they are apart by a decision
 * (../apart.h), as where a contact begins, are counted apart, and their largest difference is shown.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/plan.h>
#include "../../tools/cli/scene_argument.h"
#include "program.h"
#include "../apart.h"
#include "../../tools/bench/trajectory.h"

#define SCENES_MAX 16

/* A hand's reach around where a contact began, mm: as incise compile certifies. */
#define REACH_MM 20

#define TICKS 1000000
#define QUICK_TICKS 60000

struct row {
	const char *name, *path;
	struct incise_scene *scene[2]; /* double, integers */
	struct incise_plan *plan[2];
	long ticks, contact, apart;
	double sum2, rms_mN, most_mN, bound_mN, apart_most_mN;
	bool holds;
	char failed[520];
};

struct rows {
	struct row row[SCENES_MAX];
	int n;
};

static bool open_plan(struct row *row, int i, struct incise_error *err)
{
	row->scene[i] = incise_scene_load(row->path, NULL, err);
	if (!row->scene[i] ||
	    incise_scene_set_arithmetic(row->scene[i], i ? "fixed" : "double", err))
		return false;
	row->plan[i] = incise_plan_new(row->scene[i], NULL, err);
	return row->plan[i];
}

static bool inserts(const struct incise_plan *plan)
{
	const char *name;

	for (int i = 0; (name = incise_plan_stage(plan, i)); i++)
		if (!strcmp(name, "tool"))
			return true;
	return false;
}

static void open_row(struct row *row)
{
	struct incise_error err = {0};

	row->rms_mN = row->most_mN = row->bound_mN = row->apart_most_mN = NAN;
	if (!open_plan(row, 0, &err) || !open_plan(row, 1, &err)) {
		snprintf(row->failed, sizeof(row->failed), "%s", err.text);
		return;
	}
	row->bound_mN = 1e3 * incise_plan_bound(row->plan[1], REACH_MM);
}

static void compare_tick(struct row *row, struct apart *apart,
			 const struct incise_tick *a, const struct incise_tick *b)
{
	double mN = 1e3 * apart_N(apart, a, b, 1e-3 * row->bound_mN);

	row->ticks++;
	row->contact += !!(a->flags & INCISE_TICK_CONTACT);
	if (apart->is) {
		row->apart++;
		row->apart_most_mN = fmax(row->apart_most_mN, mN);
		return;
	}
	row->sum2 += mN * mN;
	row->most_mN = fmax(row->most_mN, mN);
}

static void compare(struct row *row, long ticks)
{
	int strokes = (int)(ticks / incise_scene_rate_hz(row->scene[0])) + 1;
	struct trajectory trajectory;
	struct walk walk[2];
	struct apart apart = {.plan = row->plan};

	row->most_mN = row->apart_most_mN = 0;
	trajectory_make(&trajectory, row->scene[0], row->plan[0], strokes,
			inserts(row->plan[0]), true);
	for (int i = 0; i < 2; i++)
		walk[i] = (struct walk){.trajectory = &trajectory, .plan = row->plan[i]};
	for (long k = 0; k < trajectory.ticks; k++) {
		struct incise_tick tick[2];

		for (int i = 0; i < 2; i++)
			incise_plan_tick(row->plan[i], walk_feed(&walk[i]), &tick[i]);
		compare_tick(row, &apart, &tick[0], &tick[1]);
	}
	row->rms_mN = sqrt(row->sum2 / (double)(row->ticks - row->apart));
	row->holds = row->most_mN <= row->bound_mN;
	free(trajectory.poses);
}

static const struct bench_table table = {
	.key = "rows",
	.row_bytes = sizeof(struct row),
	.columns =
		{
			COLUMN(row, "name", name),
			COLUMN(row, "rms_error_N", rms_mN, .scale = 1e-3),
			COLUMN(row, "max_error_N", most_mN, .scale = 1e-3),
			COLUMN(row, "bound_N", bound_mN, .scale = 1e-3),
			COLUMN(row, "holds", holds),
			COLUMN(row, "ticks", ticks),
			COLUMN(row, "contact", contact),
			COLUMN(row, "apart", apart),
			COLUMN(row, "apart_max_error_N", apart_most_mN, .scale = 1e-3),
			COLUMN(row, "failed", failed),
		},
	.metrics = {METRIC(EXACT, row, most_mN, "mN", "{name}, largest")},
};

static void add(struct rows *all, const char *name, size_t length, const char *path)
{
	all->row[all->n++] =
		(struct row){.name = cli_text("%.*s", (int)length, name), .path = path};
}

static void add_scenes(struct rows *all, const struct bench_run *run)
{
	glob_t found;

	for (int i = 0; i < run->n_operands; i++) {
		struct scene_argument argument = {0};

		if (!scene_argument_find(&argument, run->operands[i]))
			scene_argument_missing(run->operands[i]);
		add(all, run->operands[i], strlen(run->operands[i]), argument.path);
	}
	if (run->n_operands)
		return;
	scene_argument_list_shipped(&found);
	for (size_t i = 0; i < found.gl_pathc && all->n < SCENES_MAX; i++) {
		const char *name = strrchr(found.gl_pathv[i], '/') + 1;

		add(all, name, strlen(name) - strlen(".scene"), found.gl_pathv[i]);
	}
}

static void run_integers(struct bench_run *run)
{
	struct rows *all = cli_alloc(1, sizeof(*all));

	add_scenes(all, run);
	for (int i = 0; i < all->n; i++) {
		struct row *row = &all->row[i];

		cli_progress("%s: forces", row->name);
		open_row(row);
		if (!*row->failed)
			compare(row, run->quick ? QUICK_TICKS : TICKS);
	}
	bench_rows(run, &table, all->row, all->n);
	for (int i = 0; i < all->n; i++) {
		if (*all->row[i].failed)
			bench_fail(run, "%s", all->row[i].failed);
		else if (!all->row[i].holds)
			bench_fail(
				run,
				"%s: a force is off by more than certified: a fault of "
				"incise, please report it with the scene",
				all->row[i].name);
	}
}

const struct bench bench_program = {
	.name = "integers",
	.operands = "[SCENE...]",
	.summary = "fixed-point plan of the kernel compared with double",
	.n_operands = SCENES_MAX,
	.run = run_integers,
};
