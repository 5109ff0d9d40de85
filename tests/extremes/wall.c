// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Generated scenes: walls of any stiffness on any device, at any rate and with any limits; and
 * the scenes that ship. A scene is refused, or its plan runs with good poses and bad ones.
 */
#include <stdio.h>
#include <stdlib.h>
#include <incise/plan.h>
#include "../../lib/base/vector.h"
#include "../../lib/scene/scene.h"
#include "../../tools/cli/cli.h"
#include "../../tools/cli/file.h"
#include "extremes.h"
#include "numbers.h"

#define TICKS 200

static double decade(double low, double high)
{
	return pow(10, between(low, high));
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
		v3_sub(change, tick.command_N, was_N);
		v3_copy(was_N, tick.command_N);
		extremes_check(
			row,
			!rc && v3_length(tick.command_N) <= limits.force_N &&
				v3_length(change) <=
					limits.slew_N_s / rate_hz * (1 + 1e-12) &&
				isfinite(tick.depth_mm) && isfinite(tick.velocity_mm_s) &&
				!(tick.flags &
				  (INCISE_TICK_NOT_FINITE | INCISE_TICK_FAULT)),
			"tick %d: %d, force " V3 ", depth %a, v %a, flags %#x, of %s", k,
			rc, V3_OF(tick.command_N), tick.depth_mm, tick.velocity_mm_s,
			tick.flags, text);
	}
}

/* Refused, or felt. */
static void try_scene(struct extremes_row *row, const char *path, const char *text,
		      int ticks, bool checked)
{
	struct incise_error err = {0};
	struct incise_scene *scene = incise_scene_load(path, NULL, &err);
	struct incise_plan *plan;

	if (scene)
		scene->unchecked = !checked;
	plan = scene ? incise_plan_new(scene, NULL, &err) : NULL;
	if (plan)
		feel(row, scene, plan, text, ticks);
	else
		extremes_refused(row, &err);
	incise_plan_free(plan);
	incise_scene_free(scene);
}

static void try_wall(struct extremes_row *row, const struct property *property)
{
	struct memory_file file = memory_file_begin("scene");
	double gain = below(2) ? 1 : decade(-3, 1);
	char text[600];

	/* Exponents, as a libconfig number without a point would be an integer. */
	snprintf(text, sizeof(text),
		 "rate_hz = %.17e; arithmetic = \"%s\"; tissue = { gain = %.17e; "
		 "reaction_N_mm = %.17e; plane_N_mm = %.17e; damping_N_s_mm = %.17e; }; "
		 "effects = { average_ticks = %d; }; "
		 "device = { mass_kg = %.17e; damping_N_s_mm = %.17e; "
		 "delay_ticks = %d; }; "
		 "limits = { force_N = %.17e; slew_N_s = %.17e; start_N = 100.0; "
		 "ramp_ms = 1.0; };",
		 decade(0, 4.8), below(2) ? "fixed" : "double", gain,
		 decade(-3, below(2) ? 9 : 3), below(2) ? 0.0 : decade(-3, 9),
		 below(2) ? 0.0 : decade(-9, 0), 1 + (int)below(64), decade(-3, 1),
		 decade(-6, 0), below(4) ? (int)below(3) : (int)below(70), decade(-2, 2),
		 decade(0, 5));
	fputs(text, file.file);
	memory_file_written(&file);
	/* A plan that is not stable keeps its limits, too; a check takes a thousand times as long: of a part fewer. */
	try_scene(row, file.path, text, TICKS, !below(row->setup->part > 1 ? 64 : 16));
	fclose(file.file);
}

static void try_shipped(struct extremes_row *row, const struct property *property)
{
	static const char *const names[] = {"liver", "neck", "wall"};

	for (size_t i = 0; i < sizeof(names) / sizeof(*names); i++) {
		long refused = row->refused;
		char *path;

		if (asprintf(&path, "%s/%s.scene", row->setup->scenes, names[i]) < 0)
			cli_fail("no memory");
		try_scene(row, path, names[i], (int)extremes_cases(row, property->cases),
			  true);
		if (row->refused > refused)
			cli_fail("%s is refused", path);
		free(path);
	}
}

const struct property wall_properties[] = {
	{"wall",
	 "generated scenes: walls of 1e-3 to 1e9 N/mm, devices of 1 g to 10 kg, rates of "
	 "1 Hz to 64 kHz, any limits of force and slew: refused as no scene or, one in 16, as not "
	 "stable, or within their limits",
	 6000, .each = try_wall},
	{"scenes", "the scenes that ship, with good and bad poses: as above", 60000,
	 .all = try_shipped},
	{0},
};
