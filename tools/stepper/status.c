// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * State of an actuator as text and JSON; see status.h.
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include "../cli/json.h"
#include "status.h"

static const char *const inputs[] = {"limit at 0", "limit at the end", "home", "e-stop",
				     "alarm"};
#define INPUTS (sizeof(inputs) / sizeof(*inputs))

const char *const stepper_line_keys[STEPPER_LINES] = {
	"limit_min", "limit_max", "home", "estop", "alarm", "enable", "dir"};

const char *const stepper_fault_keys[INCISE_STEPPER_FAULTS] = {
	"deadman",  "limit_min", "limit_max", "estop", "alarm",	    "late",
	"setpoint", "owner",	 "suspend",   "gone",  "line",	    "bus",
	"lost",	    "following", "travel",    "plan",  "lost_steps"};

static const char *fault_text(int bit)
{
	return incise_stepper_fault_text((enum incise_stepper_fault)(1U << bit));
}

json_t *stepper_counters_json(struct incise_stepper *stepper)
{
	struct incise_stepper_counter counter;
	json_t *object = json_object();

	for (int i = 0; !incise_stepper_counter(stepper, i, &counter); i++)
		json_object_set_new(object, counter.key,
				    json_integer((json_int_t)counter.value));
	return object;
}

/* A line for each counter. */
static void stepper_counters_text(struct incise_stepper *stepper)
{
	struct incise_stepper_counter counter;

	for (int i = 0; !incise_stepper_counter(stepper, i, &counter); i++)
		printf("%-10s %s: %llu\n", i ? "" : "counted", counter.text,
		       (unsigned long long)counter.value);
}

void stepper_counters_line(struct incise_stepper *stepper)
{
	struct incise_stepper_counter counter;
	const char *before = "actuator   ";

	for (int i = 0; !incise_stepper_counter(stepper, i, &counter); i++)
		if (counter.trouble && counter.value) {
			printf("%s%s: %llu", before, counter.text,
			       (unsigned long long)counter.value);
			before = ", ";
		}
	if (*before == ',')
		putchar('\n');
}

long long stepper_steps(const struct incise_stepper_info *info, double mm)
{
	return info->step_mm > 0 ? llround(mm / info->step_mm) : 0;
}

static const char *faults_text(unsigned int faults, char *text, size_t size)
{
	size_t used = 0;

	text[0] = 0;
	for (int i = 0; i < INCISE_STEPPER_FAULTS && used < size; i++)
		if (faults & 1U << i)
			used += snprintf(text + used, size - used, "%s%s",
					 used ? "; " : "", fault_text(i));
	return text;
}

/* Remove the device's name from the beginning: it is printed before. */
static void drop_name(struct incise_stepper *stepper, char *text)
{
	const char *rest = strstr(text, ": ");
	struct incise_stepper_info info = {0};

	incise_stepper_info(stepper, &info);
	/* The name may be longer than in the text: "… (not real-time)". */
	if (rest && !strncmp(text, info.name, (size_t)(rest - text)))
		memmove(text, rest + 2, strlen(rest + 2) + 1);
}

/* The device's own text for its fault; false if it only has the bit's text. */
static bool own_cause(struct incise_stepper *stepper, unsigned int faults, char *text,
		      size_t size)
{
	if (!faults || incise_stepper_cause(stepper, text, size) <= 0)
		return false;
	for (int i = 0; i < INCISE_STEPPER_FAULTS; i++)
		if (!strcmp(text, fault_text(i)))
			return false;
	drop_name(stepper, text);
	return true;
}

const char *stepper_why(struct incise_stepper *stepper, unsigned int faults, char *text,
			size_t size)
{
	return own_cause(stepper, faults, text, size) ? text
						      : faults_text(faults, text, size);
}

/* "home, e-stop", or @none. */
static void put_inputs(unsigned int bits, const char *none)
{
	const char *comma = "";

	for (unsigned int i = 0; i < INPUTS; i++)
		if (bits & 1u << i) {
			printf("%s%s", comma, inputs[i]);
			comma = ", ";
		}
	if (!bits)
		fputs(none, stdout);
}

static void put_limits(const struct incise_stepper_info *info)
{
	printf("limits     0 to %g mm in steps of %g um, up to %g mm/s and %g mm/s^2",
	       info->travel_mm, info->step_mm * 1e3, info->velocity_mm_s,
	       info->acceleration_mm_s2);
	if (info->jerk_mm_s3 > 0)
		printf(" and %g mm/s^3", info->jerk_mm_s3);
	if (info->rate_max_hz > 0 && info->step_mm > 0)
		printf("; %g steps/s of at most %g",
		       round(info->velocity_mm_s / info->step_mm), info->rate_max_hz);
	putchar('\n');
}

/* A line about the driver chip, if there is one. */
static void put_chip(struct incise_stepper *stepper)
{
	struct incise_stepper_chip chip;
	int rc = incise_stepper_chip(stepper, &chip);

	if (rc == -EBUSY)
		puts("driver     not read: the program that drives the actuator uses it");
	else if (rc && rc != -EOPNOTSUPP)
		printf("driver     cannot be read: %s\n", strerror(-rc));
	if (rc)
		return;
	printf("driver     %s: %.2f A, %.2f A at rest, %d microsteps, %s, %s, StallGuard %d "
	       "(threshold %d)\n",
	       chip.name, chip.run_A, chip.hold_A, chip.microsteps,
	       chip.stealthchop ? "StealthChop" : "SpreadCycle",
	       chip.warm ? "too warm: cool it or give a smaller run_A"
			 : "temperature normal",
	       chip.load, chip.threshold);
}

/* Null without a chip that can be read. */
static json_t *chip_json(struct incise_stepper *stepper)
{
	struct incise_stepper_chip chip;

	if (incise_stepper_chip(stepper, &chip))
		return json_null();
	return json_pack("{so so so si sb sb sb si si}", "name", json_text(chip.name),
			 "run_A", json_number(chip.run_A), "hold_A",
			 json_number(chip.hold_A), "microsteps", chip.microsteps,
			 "stealthchop", chip.stealthchop, "standstill", chip.standstill,
			 "warm", chip.warm, "load", chip.load, "stall_threshold",
			 chip.threshold);
}

void stepper_status_text(struct incise_stepper *stepper,
			 const struct incise_stepper_info *info,
			 const struct incise_stepper_status *status)
{
	char cause[300];

	printf("%s: %s at %.4f mm (step %lld), %s\n", info->name,
	       incise_stepper_state_name(status->state), status->position_mm,
	       stepper_steps(info, status->position_mm),
	       status->homed ? "homed"
			     : "not homed: a count, until `incise stepper home`");
	printf("velocity   %.3f mm/s\n", status->velocity_mm_s);
	if (info->measures_handle)
		printf("handle     at %.4f mm, %.4f N on the hand\n", status->handle_mm,
		       status->force_N);
	printf("inputs     ");
	put_inputs(status->inputs, info->inputs ? "none active" : "none wired");
	if (info->inputs) {
		printf(" (wired: ");
		put_inputs(info->inputs, "");
		putchar(')');
	}
	putchar('\n');
	for (int i = 0; i < INCISE_STEPPER_FAULTS; i++)
		if (status->faults & 1U << i)
			printf("fault      %s\n", fault_text(i));
	if (!status->faults)
		puts("faults     none");
	if (own_cause(stepper, status->faults, cause, sizeof(cause)))
		printf("cause      %s\n", cause);
	put_limits(info);
	printf("deadman    %g ms without a target\nlate       %llu steps\n",
	       info->deadman_s * 1e3, (unsigned long long)status->late);
	put_chip(stepper);
	stepper_counters_text(stepper);
}

void stepper_status_line(struct incise_stepper *stepper,
			 const struct incise_stepper_status *status, double t_s)
{
	char text[400];

	printf("%.3f s  %s at %.4f mm, %.3f mm/s, %s; inputs ", t_s,
	       incise_stepper_state_name(status->state), status->position_mm,
	       status->velocity_mm_s, status->homed ? "homed" : "not homed");
	put_inputs(status->inputs, "none");
	if (status->faults)
		printf("; %s", stepper_why(stepper, status->faults, text, sizeof(text)));
	putchar('\n');
}

static json_t *faults_json(unsigned int faults)
{
	json_t *list = json_array();

	for (int i = 0; i < INCISE_STEPPER_FAULTS; i++)
		if (faults & 1U << i)
			json_array_append_new(list, json_pack("{ss ss}", "fault",
							      stepper_fault_keys[i],
							      "text", fault_text(i)));
	return list;
}

/* Null unless the device measures its handle. */
static json_t *measured(const struct incise_stepper_info *info, double value)
{
	return info->measures_handle ? json_number(value) : json_null();
}

/* The device's own text, else the text of its first fault; null without a fault. */
static json_t *cause_json(struct incise_stepper *stepper, unsigned int faults)
{
	char text[300];

	return faults && incise_stepper_cause(stepper, text, sizeof(text)) > 0
		       ? json_text(text)
		       : json_null();
}

json_t *stepper_status_json(struct incise_stepper *stepper,
			    const struct incise_stepper_info *info,
			    const struct incise_stepper_status *status)
{
	return json_pack(
		"{so sI ss so sI so sb so so so so so so sI so so so so so so so so so so}",
		"name", json_text(info->name), "t_ns", (json_int_t)status->t_ns, "state",
		incise_stepper_state_name(status->state), "position_mm",
		json_number(status->position_mm), "position_steps",
		(json_int_t)stepper_steps(info, status->position_mm), "velocity_mm_s",
		json_number(status->velocity_mm_s), "homed", status->homed, "handle_mm",
		measured(info, status->handle_mm), "force_N",
		measured(info, status->force_N), "inputs",
		json_bits(status->inputs, stepper_line_keys, INPUTS), "inputs_wired",
		json_bits(info->inputs, stepper_line_keys, INPUTS), "faults",
		faults_json(status->faults), "cause", cause_json(stepper, status->faults),
		"late_steps", (json_int_t)status->late, "travel_mm",
		json_number(info->travel_mm), "step_mm", json_number(info->step_mm),
		"velocity_max_mm_s", json_number(info->velocity_mm_s),
		"acceleration_max_mm_s2", json_number(info->acceleration_mm_s2),
		"jerk_max_mm_s3",
		info->jerk_mm_s3 > 0 ? json_number(info->jerk_mm_s3) : json_null(),
		"deadman_s", json_number(info->deadman_s), "rate_max_hz",
		info->rate_max_hz > 0 ? json_number(info->rate_max_hz) : json_null(),
		"spring_N_mm", json_number(info->spring_N_mm), "counters",
		stepper_counters_json(stepper), "driver", chip_json(stepper));
}
