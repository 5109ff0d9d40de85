// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise info stepper: what a controller of the kernel module is, does and costs.
 */
#include <glob.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <incise/stepper.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "stepper_module.h"
#include "stepper_module_report.h"

#define DEVICES "/dev/incise-stepper*"
#define KHZ 1e-3
#define US 1e-3 /* of ns */

/* By bit, as the library and rig.conf name them. */
static const char *const lines[] = {"limit_min", "limit_max", "home", "estop",
				    "alarm",	 "enable",    "dir"};
#define LINES (sizeof(lines) / sizeof(*lines))

static const char *const faults[] = {"deadman", "limit_min", "limit_max", "estop",
				     "alarm",	"late",	     "setpoint",  "owner",
				     "suspend", "gone",	     "line"};
#define FAULTS (sizeof(faults) / sizeof(*faults))

bool stepper_module_is(const char *what)
{
	return !strcmp(what, "stepper") || !strncmp(what, DEVICES, strlen(DEVICES) - 1);
}

static double velocity_steps_s(const struct stepper_motor *motor)
{
	return (double)motor->status.velocity / 65536;
}

static void put_bits(const char *title, uint32_t bits, const char *const *names, size_t n)
{
	printf("  %-10s", title);
	for (size_t i = 0; i < n; i++)
		if (bits & 1u << i)
			printf(" %s", names[i]);
	puts(bits ? "" : " none");
}

static void put_config(const struct incise_stepper_config *c)
{
	printf("  limits     steps %" PRId64 " to %" PRId64
	       ", %u steps/s, %u steps/s^2, jerk ",
	       (int64_t)c->position_min, (int64_t)c->position_max, c->velocity,
	       c->acceleration);
	if (c->jerk)
		printf("%" PRIu64 " steps/s^3\n", (uint64_t)c->jerk);
	else
		puts("not limited");
	printf("  pulses     high %g us, low %g us, direction set up %g us, held %g us%s\n",
	       c->high_ns * US, c->low_ns * US, c->setup_ns * US, c->hold_ns * US,
	       c->flags & INCISE_STEPPER_CONFIG_INVERT ? ", inverted" : "");
	printf("  times      tick %g us, deadman %g ms%s, enable %g ms, fault after %u late "
	       "edges in a row\n",
	       c->tick_ns * US, (double)c->deadman_ns * 1e-6,
	       c->flags & INCISE_STEPPER_CONFIG_RETRACT
		       ? " (then back to a safe position)"
		       : "",
	       (double)c->enable_ns * 1e-6, c->late_max);
}

static void put_histograms(const struct stepper_module *module,
			   const struct stepper_motor *motor)
{
	uint64_t firings = 0;

	for (int i = 0; i < module->bins; i++)
		firings += motor->lateness.count[i];
	printf("  timer      %" PRIu64
	       " firings, late by %.3f us in the mean and %.3f us at "
	       "most\n  callback   %.3f us in the mean, %.3f us at most\n",
	       firings, (double)motor->lateness.mean_ns * US,
	       (double)motor->lateness.max_ns * US, (double)motor->cost.mean_ns * US,
	       (double)motor->cost.max_ns * US);
	if (firings)
		puts("  from us    firings late    callbacks that took so long");
	for (int i = 0; i < module->bins; i++)
		if (motor->lateness.count[i] || motor->cost.count[i])
			printf("  %7u %15" PRIu64 " %15" PRIu64 "\n", module->from_us[i],
			       motor->lateness.count[i], motor->cost.count[i]);
}

static void put_motor(const struct stepper_module *module, uint32_t i)
{
	const struct stepper_motor *motor = &module->motor[i];
	const struct incise_stepper_motor_status *s = &motor->status;

	printf("motor %u: %s at step %" PRId64 ", target %" PRId64 ", %.0f steps/s, %s\n",
	       i, incise_stepper_state_name((enum incise_stepper_state)s->state),
	       (int64_t)s->position, (int64_t)s->target, velocity_steps_s(motor),
	       s->flags & INCISE_STEPPER_FLAG_HOMED ? "homed" : "not homed");
	put_bits("lines", module->info.lines[i], lines, LINES);
	put_bits("active", s->inputs, lines, LINES);
	put_bits("faults", s->faults, faults, FAULTS);
	put_config(&motor->config);
	printf("  steps      %" PRIu64 " up, %" PRIu64 " down; %" PRIu64
	       " edges late, the motion put off by %g us\n",
	       (uint64_t)s->steps_up, (uint64_t)s->steps_down, (uint64_t)s->late,
	       (double)s->shifted_ns * US);
	if (module->has_evidence)
		put_histograms(module, motor);
}

static void put_sync(const struct stepper_module *module)
{
	const struct incise_stepper_sync *sync = &module->sync;

	if (!module->has_sync)
		puts("sync       no line");
	else if (!sync->period_ns)
		puts("sync       off");
	else
		printf("sync       every %g ms for %g us: %" PRIu64 " pulses, %" PRIu64
		       " left out\n",
		       (double)sync->period_ns * 1e-6, sync->width_ns * US,
		       (uint64_t)sync->pulses, (uint64_t)sync->missed);
}

static void put_text(const struct stepper_module *module)
{
	const struct incise_stepper_controller *info = &module->info;

	printf("%s: %.*s, %u motor%s\n", module->path, (int)sizeof(info->name),
	       info->name, info->n_motors, info->n_motors == 1 ? "" : "s");
	printf("self-test  99 %% of timers at most %.3f us late, the latest %.3f us; an edge "
	       "takes %.3f us\n           so at most %.1f kHz, pulses of at least %.3f us; timers "
	       "of %u ns\n",
	       info->lateness_ns * US, info->lateness_max_ns * US, info->edge_ns * US,
	       info->rate_max * KHZ, info->pulse_ns * US, info->resolution_ns);
	put_sync(module);
	printf("force      %s\n", info->capabilities & INCISE_STEPPER_CAP_FIXED
					  ? "the integer model is built in"
					  : "no integer model");
	for (uint32_t i = 0; i < info->n_motors; i++)
		put_motor(module, i);
	if (!module->has_evidence)
		printf("no lateness and callback cost: %s\n", module->evidence);
}

static json_t *bits_json(uint32_t bits, const char *const *names, size_t n)
{
	json_t *list = json_array();

	for (size_t i = 0; i < n; i++)
		if (bits & 1u << i)
			json_array_append_new(list, json_string(names[i]));
	return list;
}

static json_t *config_json(const struct incise_stepper_config *c)
{
	return json_pack(
		"{sI sI sI sI sI sI sI sI sI sI sI sI sI sI sb sb}", "tick_ns",
		(json_int_t)c->tick_ns, "velocity_steps_s", (json_int_t)c->velocity,
		"acceleration_steps_s2", (json_int_t)c->acceleration, "jerk_steps_s3",
		(json_int_t)c->jerk, "position_min_steps", (json_int_t)c->position_min,
		"position_max_steps", (json_int_t)c->position_max, "safe_position_steps",
		(json_int_t)c->safe_position, "deadman_ns", (json_int_t)c->deadman_ns,
		"high_ns", (json_int_t)c->high_ns, "low_ns", (json_int_t)c->low_ns,
		"setup_ns", (json_int_t)c->setup_ns, "hold_ns", (json_int_t)c->hold_ns,
		"enable_ns", (json_int_t)c->enable_ns, "late_max",
		(json_int_t)c->late_max, "invert",
		(int)!!(c->flags & INCISE_STEPPER_CONFIG_INVERT), "retract",
		(int)!!(c->flags & INCISE_STEPPER_CONFIG_RETRACT));
}

/* Bins that are not empty: [from_us, count]. */
static json_t *histogram_json(const struct stepper_module *module,
			      const struct stepper_histogram *h)
{
	json_t *bins = json_array();

	if (!module->has_evidence) {
		json_decref(bins);
		return json_null();
	}
	for (int i = 0; i < module->bins; i++)
		if (h->count[i])
			json_array_append_new(
				bins, json_pack("[II]", (json_int_t)module->from_us[i],
						(json_int_t)h->count[i]));
	return json_pack("{sI sI so}", "mean_ns", (json_int_t)h->mean_ns, "max_ns",
			 (json_int_t)h->max_ns, "histogram_us", bins);
}

static json_t *motor_json(const struct stepper_module *module, uint32_t i)
{
	const struct stepper_motor *motor = &module->motor[i];
	const struct incise_stepper_motor_status *s = &motor->status;

	return json_pack("{ss sI sI sf sb so so so so sI sI sI sI so so so}", "state",
			 incise_stepper_state_name((enum incise_stepper_state)s->state),
			 "position_steps", (json_int_t)s->position, "target_steps",
			 (json_int_t)s->target, "velocity_steps_s",
			 velocity_steps_s(motor), "homed",
			 (int)!!(s->flags & INCISE_STEPPER_FLAG_HOMED), "lines",
			 bits_json(module->info.lines[i], lines, LINES), "inputs",
			 bits_json(s->inputs, lines, LINES), "faults",
			 bits_json(s->faults, faults, FAULTS), "config",
			 config_json(&motor->config), "steps_up", (json_int_t)s->steps_up,
			 "steps_down", (json_int_t)s->steps_down, "late_edges",
			 (json_int_t)s->late, "shifted_ns", (json_int_t)s->shifted_ns,
			 "edges",
			 module->has_evidence ? json_integer((json_int_t)motor->edges)
					      : json_null(),
			 "lateness", histogram_json(module, &motor->lateness), "callback",
			 histogram_json(module, &motor->cost));
}

static json_t *sync_json(const struct stepper_module *module)
{
	const struct incise_stepper_sync *sync = &module->sync;

	if (!module->has_sync)
		return json_null();
	return json_pack("{sI sI sI sI sI sI}", "period_ns", (json_int_t)sync->period_ns,
			 "width_ns", (json_int_t)sync->width_ns, "first_ns",
			 (json_int_t)sync->first_ns, "pulses", (json_int_t)sync->pulses,
			 "last_ns", (json_int_t)sync->last_ns, "missed",
			 (json_int_t)sync->missed);
}

static json_t *module_json(const struct stepper_module *module)
{
	const struct incise_stepper_controller *info = &module->info;
	json_t *motors = json_array();
	char name[sizeof(info->name) + 1] = {0};

	memcpy(name, info->name, sizeof(info->name));
	for (uint32_t i = 0; i < info->n_motors; i++)
		json_array_append_new(motors, motor_json(module, i));
	return json_pack("{so so s{sI sI sI sI sI sI} so sb so so}", "device",
			 json_text(module->path), "name", json_text(name), "self_test",
			 "rate_max_steps_s", (json_int_t)info->rate_max, "pulse_min_ns",
			 (json_int_t)info->pulse_ns, "edge_ns", (json_int_t)info->edge_ns,
			 "lateness_p99_ns", (json_int_t)info->lateness_ns,
			 "lateness_max_ns", (json_int_t)info->lateness_max_ns,
			 "resolution_ns", (json_int_t)info->resolution_ns, "sync",
			 sync_json(module), "fixed_point",
			 (int)!!(info->capabilities & INCISE_STEPPER_CAP_FIXED), "motors",
			 motors, "no_evidence",
			 module->evidence ? json_string(module->evidence) : json_null());
}

void stepper_module_show(const char *what, bool json)
{
	json_t *controllers = json_array();
	struct stepper_module module;
	glob_t found = {0};
	bool all = !strcmp(what, "stepper");

	if (all && glob(DEVICES, 0, NULL, &found))
		cli_fail(
			"there is no " DEVICES ": load the module with `modprobe "
			"incise_stepper`, and bind a controller as in incise-stepper(1)");
	for (size_t i = 0; i < (all ? found.gl_pathc : 1); i++) {
		stepper_module_read(&module, all ? found.gl_pathv[i] : what);
		if (json)
			json_array_append_new(controllers, module_json(&module));
		else
			put_text(&module);
	}
	if (json)
		json_print(json_pack("{ss sO}", "kind", "stepper", "controllers",
				     controllers));
	json_decref(controllers);
	if (all)
		globfree(&found);
}
