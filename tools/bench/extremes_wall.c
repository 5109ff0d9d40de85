// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Generated scenes: walls of any stiffness on any device, at any rate and with any limits;
 * and those that ship. What is no scene or not stable is refused; what is accepted is
 * felt, with good poses and bad ones.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/plan.h>
#include "any_pose.h"
#include "../cli/cli.h"
#include "extremes.h"
#include "../cli/file.h"

#define SCENES 6000
#define TICKS 200
#define SHIPPED_TICKS 60000

static double decade(double low, double high)
{
	return pow(10, between(low, high));
}

static double length(const double v[3])
{
	return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* Down into the tissue and about, with a bad pose now and then. */
static void feel(struct extremes_row *row, const struct incise_scene *scene,
		 struct incise_plan *plan, const char *text, int ticks)
{
	double rate_hz = incise_scene_rate_hz(scene), was_N[3] = {0};
	int64_t step_ns = (int64_t)(1e9 / rate_hz), t_ns = step_ns;
	struct incise_scene_limits limits;
	struct incise_touch top;
	struct incise_tick tick;

	incise_scene_limits(scene, &limits);
	incise_plan_top(plan, &top);
	for (int k = 0; k < ticks; k++, t_ns += step_ns) {
		struct incise_tracker_sample s = {.t_ns = t_ns, .status = ' '};
		double height = fmax(3 - 0.1 * k, -1) + 0.5 * sin(0.3 * k), change[3];
		int rc;

		for (int i = 0; i < 3; i++)
			s.position_mm[i] =
				below(40) ? top.point_mm[i] + height * top.normal[i]
					  : special();
		any_attitude(s.quaternion);
		incise_plan_feed(plan, &s, 1);
		rc = incise_plan_tick(plan, t_ns, &tick);
		for (int i = 0; i < 3; i++)
			change[i] = tick.command_N[i] - was_N[i];
		memcpy(was_N, tick.command_N, sizeof(was_N));
		if (extremes_first_wrong(
			    row, !rc && length(tick.command_N) <= limits.force_N &&
					 length(change) <= limits.slew_N_s / rate_hz *
								   (1 + 1e-12) &&
					 isfinite(tick.depth_mm) &&
					 isfinite(tick.velocity_mm_s) &&
					 !(tick.flags &
					   (INCISE_TICK_NOT_FINITE | INCISE_TICK_FAULT))))
			extremes_tell(
				row,
				"tick %d: %d, force (%a, %a, %a), depth %a, v %a, flags "
				"%#x, case %ld, of %s",
				k, rc, tick.command_N[0], tick.command_N[1],
				tick.command_N[2], tick.depth_mm, tick.velocity_mm_s,
				tick.flags, row->tried, text);
	}
}

static void try_text(struct extremes_row *row, const char *text)
{
	struct memory_file file = memory_file_begin("scene");
	struct incise_error err = {0};
	struct incise_plan *plan = NULL;
	struct incise_scene *scene;

	fputs(text, file.file);
	memory_file_written(&file);
	scene = incise_scene_load(file.path, NULL, &err);
	if (scene)
		plan = incise_plan_new(scene, NULL, &err);
	if (plan)
		feel(row, scene, plan, text, TICKS);
	else
		extremes_refused(row, &err);
	incise_plan_free(plan);
	incise_scene_free(scene);
	fclose(file.file);
}

static void try_walls(struct extremes *all)
{
	struct extremes_row *row = extremes_begin(
		all, "wall",
		"generated scenes: walls of 1e-3 to 1e9 N/mm, devices of 1 g to 10 kg, rates of "
		"1 Hz to 64 kHz, any limits of force and slew: refused as no scene or as not "
		"stable, or within their limits");

	rng = extremes_seed(all, row);
	for (long k = extremes_cases(all, SCENES); k; k--) {
		double gain = below(2) ? 1 : decade(-3, 1);
		char text[600];

		/* Exponents, as a libconfig number without a point would be an integer. */
		snprintf(
			text, sizeof(text),
			"rate_hz = %.17e; arithmetic = \"%s\"; tissue = { gain = %.17e; "
			"reaction_N_mm = %.17e; plane_N_mm = %.17e; damping_N_s_mm = %.17e; }; "
			"effects = { guard = %s; average_ticks = %d; }; "
			"device = { mass_kg = %.17e; damping_N_s_mm = %.17e; "
			"delay_ticks = %d; }; "
			"limits = { force_N = %.17e; slew_N_s = %.17e; start_N = 100.0; "
			"ramp_ms = 1.0; };",
			decade(0, 4.8), below(2) ? "fixed" : "double", gain,
			decade(-3, below(2) ? 9 : 3), below(2) ? 0.0 : decade(-3, 9),
			below(2) ? 0.0 : decade(-9, 0), below(2) ? "true" : "false",
			1 + (int)below(64), decade(-3, 1), decade(-6, 0),
			below(4) ? (int)below(3) : (int)below(70), decade(-2, 2),
			decade(0, 5));
		try_text(row, text);
	}
}

static void try_shipped(struct extremes *all)
{
	static const char *const names[] = {"liver", "neck", "wall"};
	struct extremes_row *row = extremes_begin(
		all, "scenes", "the scenes that ship, with good and bad poses: as above");

	rng = extremes_seed(all, row);
	for (size_t i = 0; i < sizeof(names) / sizeof(*names); i++) {
		struct incise_error err = {0};
		struct incise_scene *scene;
		struct incise_plan *plan;
		char *path;

		if (asprintf(&path, "%s/../share/incise/scenes/%s.scene", cli_folder(),
			     names[i]) < 0)
			cli_fail("no memory");
		scene = incise_scene_load(path, NULL, &err);
		free(path);
		if (!scene)
			cli_fail_with(&err);
		plan = incise_plan_new(scene, NULL, &err);
		if (!plan)
			cli_fail_with(&err);
		feel(row, scene, plan, names[i], (int)extremes_cases(all, SHIPPED_TICKS));
		incise_plan_free(plan);
		incise_scene_free(scene);
	}
}

void extremes_wall(struct extremes *all)
{
	try_walls(all);
	try_shipped(all);
}
