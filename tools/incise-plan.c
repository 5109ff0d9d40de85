// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise plan SCENE: what a scene runs, what it leaves out and why, what a tick costs, and
 * how far it is from instability.
 */
#include <errno.h>
#include <math.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include <incise/plan.h>
#include "plan/tick_cost.h"
#include "cli/cli.h"
#include "cli/json.h"
#include "cli/loop_report.h"
#include "cli/mapped_libraries.h"
#include "cli/model_force.h"
#include "cli/scene_argument.h"
#include "cli/stopwatch.h"

/* Seconds of the stroke in which ticks are timed. */
#define MEASURED_S 20

/* Depth for which the fixed-point error is stated: paper 1's deepest cut. */
#define REACH_MM 20

struct plan_job {
	struct scene_argument scene;
	const char *rig;
	bool full, json;
	const struct incise_scene *loaded;
};

static const struct cli_option options[] = {
	{'r', "rig", "RIG",
	 "file rig.conf, or sim:KEY=VALUE,…, whose stepper and tracker delay are "
	 "used (default: no rig; a tracker of 120 Hz with a delay of 4.2 ms)",
	 CLI_INPUT(struct plan_job, rig)},
	SCENE_ARGUMENT_OPTIONS(struct plan_job, scene),
	{0, "full", NULL, "keep every stage, needed or not, to see what pruning saves",
	 CLI_FLAG(struct plan_job, full)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct plan_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "plan",
	.synopsis = "SCENE [OPTIONS]",
	.summary =
		"Show which stages the haptic loop of a scene runs and which it leaves "
		"out, the time of a tick on this machine, and the stability of the scene.",
	.options = options,
	.examples = "incise plan scenes/neck.scene",
	.failure = "failure, or the scene is not stable",
};

/* Places over the ranges of a model's inputs at which its evaluation is timed; rounds of them. */
#define PLACES 1000
#define ROUNDS 21

/* As a scene has them. */
static const char *const phases[INCISE_CUTTING_PHASES] = {"cut", "puncture", "withdraw"};

/* ns of an evaluation of the model, of the middle half of the rounds. */
static double model_ns(const struct incise_plan *plan, enum incise_cutting_phase phase,
		       const struct incise_plan_model *model)
{
	double ns[ROUNDS], x[PLACES][INCISE_PLAN_INPUTS_MAX];
	volatile double sum = 0;

	for (int k = 0; k < PLACES; k++)
		for (int i = 0; i < model->n_inputs; i++)
			x[k][i] = model->min[i] +
				  (model->max[i] - model->min[i]) *
					  fmod(0.5 + k * sqrt(2 + 3 * i), 1);
	for (int round = 0; round < ROUNDS; round++) {
		double begin = stopwatch_ns();

		for (int k = 0; k < PLACES; k++)
			sum += incise_plan_model_force(plan, phase, x[k]);
		ns[round] = (stopwatch_ns() - begin) / PLACES;
	}
	(void)sum;
	stopwatch_sort(ns, ROUNDS);
	return stopwatch_middle(ns, ROUNDS);
}

static json_t *model_json(const struct incise_plan *plan, enum incise_cutting_phase phase)
{
	struct incise_plan_model model;
	json_t *inputs = json_array();

	incise_plan_model(plan, phase, &model);
	for (int i = 0; i < model.n_inputs; i++)
		json_array_append_new(
			inputs, json_pack("{ss sf sf}", "name", model.input[i], "min",
					  model.min[i], "max", model.max[i]));
	if (model.n_inputs)
		return json_pack("{so ss sf sI}", "inputs", inputs, "evaluator",
				 model.evaluator, "ns", model_ns(plan, phase, &model),
				 "memory_bytes", (json_int_t)model.memory_bytes);
	json_decref(inputs);
	return json_null();
}

/* The inputs of each model, with their ranges, and its cost. */
static void print_evaluation(const struct incise_plan *plan)
{
	for (int k = 0; k < INCISE_CUTTING_PHASES; k++) {
		enum incise_cutting_phase phase = (enum incise_cutting_phase)k;
		struct incise_plan_model model;

		incise_plan_model(plan, phase, &model);
		if (!model.n_inputs)
			continue;
		printf("%-12s", k ? phases[k] : "model");
		for (int i = 0; i < model.n_inputs; i++)
			printf("%s%s %.4g to %.4g", i ? ", " : "", model.input[i],
			       model.min[i], model.max[i]);
		printf("\n            %s: %.0f ns an evaluation, %.1f KiB\n",
		       model.evaluator, model_ns(plan, phase, &model),
		       (double)model.memory_bytes / 1024);
	}
}

static const char *const held_names[] = {
	[INCISE_HELD_FREE] = "free",
	[INCISE_HELD_ACROSS] = "held across",
	[INCISE_HELD_IN_HAND] = "in a hand",
};

static json_t *weakest_margin(const struct incise_plan_weakest *w)
{
	return json_number(w->margin < INCISE_PLAN_MARGIN_MOST ? w->margin : NAN);
}

static json_t *stability_json(const struct incise_plan_stability *s)
{
	const struct incise_haptic_device *d = &s->device;
	const struct incise_plan_weakest *w = &s->weakest;

	return json_pack(
		"{so so so so sf sf sf sf sf si sI "
		"s{ss ss sb sb so sf sf sf sf sf sf} "
		"s{so so sf sf sf so ss ss sb si si} sf "
		"sf si sb sb s{sf sf sf sf sf si}}",
		"stiffness_N_mm", json_number(s->stiffness_N_mm), "margin",
		weakest_margin(w), "damping_N_s_mm", json_number(s->damping_N_s_mm),
		"speed_slope_N_s_mm", json_number(s->speed_slope_N_s_mm),
		"acceleration_slope_N_s2_mm", s->acceleration_slope_N_s2_mm, "slope_N_mm",
		s->slope_N_mm, "unloading_N_mm", s->unloading_N_mm, "support_mm",
		s->support_mm, "beyond_N_mm", s->beyond_N_mm, "leans", s->runs, "ticks",
		(json_int_t)s->ticks, "worst", "tool", loop_tool_names[s->worst.tool],
		"held", held_names[s->worst.held], "guided", s->worst.guided, "tilted",
		s->worst.tilted, "place_mm", json_numbers(s->worst.place_mm, 3), "askew",
		s->worst.askew, "lean_N", s->worst.lean_N, "along_mm_s",
		s->worst.along_mm_s, "depth_mm", s->worst.depth_mm, "swing_mm",
		s->worst.swing_mm, "settle_s", s->worst.settle_s, "weakest", "margin",
		weakest_margin(w), "along", json_numbers(w->along, 3), "hz", w->hz,
		"lean_N", w->lean_N, "depth_mm", w->depth_mm, "place_mm",
		json_numbers(w->place_mm, 3), "tool", loop_tool_names[w->tool], "held",
		held_names[w->held], "tilted", w->tilted, "states", w->states, "paid",
		w->paid, "noise_mm", s->noise_mm, "noise_N", s->noise_N, "late_ticks",
		s->late_ticks, "certified", s->certified, "own_delay", s->own_delay,
		"device", "mass_kg", d->mass_kg, "damping_N_s_mm", d->damping_N_s_mm,
		"coulomb_N", d->coulomb_N, "encoder_mm", d->encoder_mm, "period_s",
		d->period_s, "delay_ticks", d->delay_ticks);
}

/* A stage that writes to a device; the timed plan has no rig. */
static bool is_of_device(const char *stage)
{
	return !strcmp(stage, "actuate") || !strcmp(stage, "push");
}

/* The highest frequency of a force of this amplitude on a handle at rest, by the profile of the nut. */
#define BANDWIDTH_N 0.1

static double bandwidth_hz(const struct incise_stepper_info *info)
{
	double way_mm = BANDWIDTH_N / info->spring_N_mm;

	return fmin(info->velocity_mm_s / way_mm,
		    sqrt(info->acceleration_mm_s2 / way_mm)) /
	       (2 * M_PI);
}

/* The rig's actuators. */
static json_t *axes_json(struct incise_rig *rig, const struct incise_plan_stability *s)
{
	struct incise_stepper *stepper;
	struct incise_stepper_info info;
	json_t *axes = json_array();
	double direction[3];

	for (int i = 0; rig && (stepper = incise_rig_axis(rig, i, direction)); i++) {
		incise_stepper_info(stepper, &info);
		json_array_append_new(axes,
				      json_pack("{ss so si sf}", "name", info.name,
						"direction", json_numbers(direction, 3),
						"late_ticks", s->axis_late_ticks[i],
						"bandwidth_hz", bandwidth_hz(&info)));
	}
	return axes;
}

/* Find the model's force where the slowest of the hands comes to rest; false: not known. */
static bool rest_force(const struct plan_job *job, const struct incise_plan_stability *s,
		       struct model_force *force)
{
	return s->support_mm > 0 &&
	       model_force_at(job->loaded, s->worst.depth_mm, s->worst.along_mm_s, force);
}

static json_t *surface_json(const struct incise_plan *plan)
{
	const struct incise_surface *surface = incise_plan_surface(plan);
	struct incise_surface_size s;
	double mm[3];

	if (!incise_surface_size(surface, &s))
		return json_null();
	for (int i = 0; i < 3; i++)
		mm[i] = s.hi_mm[i] - s.lo_mm[i];
	return json_pack("{sI so sI so so}", "triangles",
			 (json_int_t)incise_surface_triangles(surface), "size_mm",
			 json_numbers(mm, 3), "open_edges", (json_int_t)s.open_edges,
			 "open_from_mm",
			 s.open_edges ? json_numbers(s.open_lo_mm, 3) : json_null(),
			 "open_to_mm",
			 s.open_edges ? json_numbers(s.open_hi_mm, 3) : json_null());
}

static json_t *texture_json(const struct incise_plan *plan)
{
	struct incise_plan_texture t;

	if (!incise_plan_texture(plan, &t))
		return json_null();
	return json_pack("{sf sf sf sf sf}", "most", t.most, "rms", t.rms,
			 "events_per_mm", t.events_per_mm, "factor_min", t.factor_least,
			 "factor_max", t.factor_most);
}

static void print_texture(const struct incise_plan *plan)
{
	struct incise_plan_texture t;

	if (!incise_plan_texture(plan, &t))
		return;
	printf("texture     up to ±%.3g %% of the force, %.3g %% rms, %.3g events/mm; ",
	       100 * t.most, 100 * t.rms, t.events_per_mm);
	if (t.factor_most > 1.005 * t.factor_least)
		printf("a cut has %.3g to %.3g times the force\n", t.factor_least,
		       t.factor_most);
	else
		puts("all cuts have the mean force (tissue.variation is 0)");
}

static void report_plan_json(const struct plan_job *job, const struct incise_plan *plan,
			     struct incise_rig *rig, const struct tick_cost *cost)
{
	json_t *kept = json_array(), *stages = json_array(), *left = json_array();
	json_t *mapped = mapped_libraries(0), *object;
	struct incise_plan_stability stability;
	struct model_force force;
	const char *name, *why;

	for (int i = 0; (name = incise_plan_stage(plan, i)); i++) {
		json_array_append_new(kept, json_string(name));
		json_array_append_new(stages,
				      json_pack("{ss so}", "stage", name, "ns",
						is_of_device(name)
							? json_null()
							: json_number(cost->stage[i])));
	}
	for (int i = 0; (name = incise_plan_left_out(plan, i, &why)); i++)
		json_array_append_new(left,
				      json_pack("{ss ss}", "stage", name, "why", why));
	incise_plan_stability(plan, &stability);
	object = json_pack(
		"{so so so so so so so sI so so so so so}", "scene",
		json_text(job->scene.path), "kept", kept, "left_out", left, "stages",
		stages, "tick_ns", json_number(cost->median), "tick_p99_ns",
		json_number(cost->p99), "tick_p999_ns", json_number(cost->p999),
		"memory_bytes", (json_int_t)incise_plan_memory(plan), "bound_N",
		json_number(incise_plan_bound(plan, REACH_MM)), "devices",
		!job->rig		 ? json_array()
		: incise_rig_haptic(rig) ? json_pack("[s]", "haptic")
					 : json_pack("[ss]", "tracker", "stepper"),
		"untouched_devices",
		job->rig ? json_pack("[ss]", "force", "camera")
			 : json_pack("[ssss]", "tracker", "stepper", "force", "camera"),
		"libraries", mapped, "unmapped_libraries", unmapped_libraries(mapped));
	json_object_set_new(object, "surface", surface_json(plan));
	json_object_update_new(object, stability_json(&stability));
	json_object_set_new(object, "rest",
			    model_force_json(rest_force(job, &stability, &force) ? &force
										 : NULL));
	json_object_set_new(object, "model", model_json(plan, INCISE_CUT));
	json_object_set_new(object, "puncture_model", model_json(plan, INCISE_PUNCTURE));
	json_object_set_new(object, "withdraw_model", model_json(plan, INCISE_WITHDRAW));
	json_object_set_new(object, "axes", axes_json(rig, &stability));
	json_object_set_new(object, "texture", texture_json(plan));
	json_print(object);
}

/* The tissue of a model. */
static void print_model(const struct incise_plan_stability *s)
{
	printf("            the model: up to %.3g N/mm and %.3g N s/mm, to a depth of "
	       "%.3g mm, then on with %.3g N/mm\n",
	       s->slope_N_mm, s->speed_slope_N_s_mm, s->support_mm, s->beyond_N_mm);
	if (s->acceleration_slope_N_s2_mm > 0)
		printf("            by acceleration it acts as a mass of up to %.3g kg\n",
		       s->acceleration_slope_N_s2_mm * 1e3);
	if (s->unloading_N_mm > 0)
		printf("            withdrawal: unloads with %.3g N/mm, %.3g mm for each N, "
		       "then friction\n",
		       s->unloading_N_mm, 1 / s->unloading_N_mm);
	else
		printf("            withdrawal: the model's force in both directions\n");
}

/* The state about which the least more of its forces makes the loop swing. */
static void print_weakest(const struct incise_plan_weakest *w)
{
	if (w->margin < INCISE_PLAN_MARGIN_MOST)
		printf("margin %.3g: with so many times its forces it swings along (%.2f, %.2f, %.2f) with %.3g Hz\n"
		       "            there %.3g N hold the %s%s %.3g mm deep at (%.4g, %.4g, %.4g), %s: the weakest of %d states of rest\n",
		       w->margin, w->along[0] + 0.0, w->along[1] + 0.0, w->along[2] + 0.0,
		       w->hz, w->lean_N, w->tilted ? "tilted " : "",
		       loop_tool_names[w->tool], w->depth_mm, w->place_mm[0],
		       w->place_mm[1], w->place_mm[2], held_names[w->held], w->states);
	else if (!w->states)
		puts("margin: not known; no state of rest was looked at");
	else
		printf("margin: none; in %d states of rest it swings not even with %d times its forces\n",
		       w->states - w->paid, INCISE_PLAN_MARGIN_MOST);
	if (w->paid)
		printf("            in %d of them it would swing, but what gives work is not paid for\n",
		       w->paid);
}

/* Print the result of the search for swings. */
static void print_rest(const struct incise_plan_stability *s)
{
	const double *at = s->worst.place_mm;

	printf("            settling: all %d simulated pushes came to rest, in %" PRId64
	       " ticks; slowest %.2g s, of %.2f N",
	       s->runs, s->ticks, s->worst.settle_s, s->worst.lean_N);
	if (s->worst.guided)
		printf(" at %.1f mm", s->worst.depth_mm);
	else
		printf(", %.0f %% of it along the skin, by the %s%s at (%.4g, %.4g, %.4g), "
		       "%s",
		       100 * s->worst.askew, s->worst.tilted ? "tilted " : "",
		       loop_tool_names[s->worst.tool], at[0], at[1], at[2],
		       held_names[s->worst.held]);
	if (s->worst.along_mm_s > 0)
		printf(", while it goes along the skin with %g mm/s",
		       s->worst.along_mm_s);
	printf("\n            a tracker's noise of 0.02 mm moves it within %.2g mm and "
	       "%.2g N\n",
	       s->noise_mm, s->noise_N);
}

static void print_stability(const struct plan_job *job, const struct incise_plan *plan)
{
	struct incise_plan_stability s;
	struct model_force force;

	incise_plan_stability(plan, &s);
	fputs("stability   ", stdout);
	print_weakest(&s.weakest);
	printf("            its stiffest has %.4g N/mm%s\n            on %g kg and %g N s/mm, with ",
	       s.stiffness_N_mm, s.certified ? "" : " (the model's slope is an estimate)",
	       s.device.mass_kg, s.device.damping_N_s_mm);
	if (s.own_delay)
		printf("forces %d ticks late\n", s.device.delay_ticks);
	else
		printf("poses up to %d ticks old, extrapolated, and an actuator %d ticks "
		       "late\n",
		       s.device.delay_ticks, s.late_ticks);
	if (s.support_mm > 0)
		print_model(&s);
	print_rest(&s);
	if (rest_force(job, &s, &force)) {
		fputs("            the model where that one rests: ", stdout);
		model_force_print(stdout, &force);
	}
}

/* For a person: at right angles to both, with -0 as 0. */
static void cross(double to[3], const double a[3], const double b[3])
{
	double length;

	for (int i = 0; i < 3; i++)
		to[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
	length = sqrt(to[0] * to[0] + to[1] * to[1] + to[2] * to[2]);
	for (int i = 0; i < 3; i++)
		to[i] = to[i] / length + 0.0;
}

static void print_direction(const char *before, const double d[3])
{
	printf("%s(%.4g, %.4g, %.4g)", before, d[0], d[1], d[2]);
}

/* Directions of force that can be felt on the rig. */
static void print_axes(struct incise_rig *rig, const struct incise_plan_stability *s)
{
	double direction[INCISE_RIG_AXES_MAX][3], other[3];
	struct incise_stepper *stepper;
	struct incise_stepper_info info;
	int n = 0;

	for (;
	     n < INCISE_RIG_AXES_MAX && (stepper = incise_rig_axis(rig, n, direction[n]));
	     n++) {
		incise_stepper_info(stepper, &info);
		print_direction(n ? "            along " : "felt        along ",
				direction[n]);
		printf(": %s, %d ticks late, ±%g N up to %.3g Hz\n", info.name,
		       s->axis_late_ticks[n], BANDWIDTH_N, bandwidth_hz(&info));
	}
	if (n == 1)
		printf("            not felt: forces across it\n");
	if (n == 2) {
		/* Either way round; on a usual rig so that it is positive. */
		cross(other, direction[1], direction[0]);
		print_direction("            not felt: forces along ", other);
		putchar('\n');
	}
}

static void report_plan_text(const struct plan_job *job, const struct incise_plan *plan,
			     struct incise_rig *rig, const struct tick_cost *cost,
			     const char *size)
{
	json_t *mapped = mapped_libraries(0), *absent = unmapped_libraries(mapped);
	const char *name, *why;
	double bound_N = incise_plan_bound(plan, REACH_MM);
	struct incise_plan_stability stability;

	if (cost->ticks)
		printf("%s: %.0f ns a tick (99.9 %% below %.0f), ", job->scene.path,
		       cost->median, cost->p999);
	else
		printf("%s: a stroke over it met no tissue, so no tick was timed; ",
		       job->scene.path);
	printf("%.1f KiB\n\nkept\n", (double)incise_plan_memory(plan) / 1024);
	for (int i = 0; (name = incise_plan_stage(plan, i)); i++)
		if (is_of_device(name))
			printf("  %-10s    - (the device's)\n", name);
		else if (cost->ticks)
			printf("  %-10s %4.0f ns\n", name, cost->stage[i]);
		else
			printf("  %-10s    -\n", name);
	puts("left out");
	for (int i = 0; (name = incise_plan_left_out(plan, i, &why)); i++)
		printf("  %-10s %s\n", name, why);
	putchar('\n');
	if (*size)
		printf("surface     %s\n", size);
	printf("devices     %s; not touched: %s\n",
	       !job->rig && !access("rig.conf", F_OK)
		       ? "none: --rig rig.conf takes the rig of this folder"
	       : !job->rig		? "none without --rig"
	       : incise_rig_haptic(rig) ? "haptic"
					: "tracker, stepper",
	       job->rig ? "force, camera" : "tracker, stepper, force, camera");
	printf("libraries   not mapped: ");
	for (size_t i = 0; i < json_array_size(absent); i++)
		printf("%s%s", i ? ", " : "",
		       json_string_value(json_array_get(absent, i)));
	json_decref(mapped);
	json_decref(absent);
	incise_plan_stability(plan, &stability);
	printf("\narithmetic  %s", bound_N > 0 ? "fixed" : "double");
	if (isinf(bound_N))
		printf(", not bounded");
	else if (bound_N > 0)
		printf(", within %.3g mN of double, %s", bound_N * 1e3,
		       stability.certified ? "certified" : "by estimated slopes");
	putchar('\n');
	print_evaluation(plan);
	print_texture(plan);
	print_stability(job, plan);
	if (rig)
		print_axes(rig, &stability);
	printf("accepted    %s\n", job->scene.path);
}

/* Only watch the actuator if it can be watched: a loop may run on it. */
static struct incise_rig *open_rig(const char *spec)
{
	const unsigned int devices = INCISE_RIG_TRACKER | INCISE_RIG_STEPPER;
	struct incise_error err = {0};
	struct incise_rig *rig = incise_rig_open(spec, devices | INCISE_RIG_WATCH, &err);

	return rig || err.code != EOPNOTSUPP ? cli_require(rig, &err)
					     : cli_open_rig(spec, devices);
}

int main(int argc, char **argv)
{
	struct incise_error err = {0};
	struct incise_tracker_info tracker;
	struct incise_rig *rig = NULL;
	struct incise_scene *scene;
	struct incise_plan *plan;
	struct tick_cost cost;
	struct plan_job job = {0};
	char *size;

	cli_parse(&command, argc, argv, &job);
	scene_argument_operand(&job.scene, argc, argv, optind);
	scene = scene_argument_load(&job.scene);
	job.loaded = scene;
	incise_scene_set_full(scene, job.full);
	if (job.rig) {
		rig = open_rig(job.rig);
		incise_tracker_info(incise_rig_tracker(rig), &tracker);
	}
	plan = cli_require(incise_plan_new(scene, rig, &err), &err);
	cli_progress("%s: timing %d s of ticks", job.scene.path, MEASURED_S);
	tick_cost(scene, rig ? NULL : plan, rig ? &tracker : NULL, MEASURED_S, &cost);
	cli_progress_end();
	size = scene_argument_size(job.scene.path, incise_plan_surface(plan));
	if (job.json)
		report_plan_json(&job, plan, rig, &cost);
	else
		report_plan_text(&job, plan, rig, &cost, size);
	if (strstr(size, "open edges"))
		cli_warn(
			"%s: its surface is open: a contact ends at the border, which is "
			"not passive; close it, or keep cuts away from there",
			job.scene.path);
	free(size);
	cli_finish();
	incise_plan_free(plan);
	incise_rig_close(rig);
	incise_scene_free(scene);
	return 0;
}
