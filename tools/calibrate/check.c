// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate check: the state and age of each calibration, and whether tracker and camera
 * of a recording agree about the depth.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/redundancy.h>
#include "../cli/json.h"
#include "../cli/recording.h"
#include "../cli/uncertainty.h"
#include "calibrate.h"

/* Only a rig with a haptic device has it: listed where it was calibrated, or named by --only. */
#define FRAME "frame"

/* Kinds of calibration, the nominal values, and their keys. */
static const struct {
	const char *name, *nominal, *keys[7];
} kinds[] = {
	{"force", "1240 mV/N", {"force_mV_N", "force_zero_mV"}},
	{"depth", "0.11875 mm/px", {"depth_mm_px"}},
	{"tip", "0 0 0 mm", {"tip_x_mm", "tip_y_mm", "tip_z_mm"}},
	{"delay",
	 "as reported by the devices",
	 {"force_delay_ms", "force_delay_sd_ms", "tracker_delay_ms",
	  "tracker_delay_sd_ms", "camera_delay_ms", "camera_delay_sd_ms"}},
	{"stepper",
	 "not known",
	 {"stepper_N_step", "stepper_backlash_mm", "stepper_hysteresis_N",
	  "stepper_stiction_N", "stepper_steps_s"}},
	{FRAME,
	 "as rig.conf says",
	 {"frame_turn_x_deg", "frame_turn_y_deg", "frame_turn_z_deg", "frame_x_mm",
	  "frame_y_mm", "frame_z_mm"}},
};

enum { KINDS = sizeof(kinds) / sizeof(*kinds) };

/* The state of one kind. */
struct status {
	const struct incise_calibration_record *last, *passed;
	double age_s;	  /* of the one that passed; NAN: none */
	bool due, failed; /* failed: the last one did not pass */
	char why[400];
};

struct comparison {
	struct incise_redundancy redundancy;
	bool bad;
	char verdict[240];
};

struct check {
	struct calibrate common;
	const char *recording;
	double due_s;
	bool only[KINDS], named; /* by --only */
	struct status status[KINDS];
	struct comparison comparison;
};

static void parse_only(void *run, char *list)
{
	struct check *check = run;
	const char *names[KINDS + 1] = {NULL};
	char *items[KINDS];
	int n = cli_list("only", list, items, KINDS);

	for (int k = 0; k < KINDS; k++)
		names[k] = kinds[k].name;
	check->named = true;
	memset(check->only, 0, sizeof(check->only));
	for (int i = 0; i < n; i++)
		check->only[cli_choice("only", items[i], names)] = true;
}

static const struct cli_unit ages[] = {
	{"d", 86400}, {"h", 3600}, {"w", 7 * 86400}, {"y", 365.25 * 86400}, {0}};

static const struct cli_option option_table[] = {
	{'c', "calibration", "FILE",
	 "file to check (default: ./calibration.conf, else "
	 "/etc/incise/calibration.conf)",
	 CLI_INPUT(struct check, common.calibration)},
	{0, "due", "AGE", "age at which a calibration expires (default: 365d)",
	 CLI_QUANTITY(struct check, due_s, ages, 0, 1e10)},
	{0, "only", "LIST",
	 "calibrations that this rig needs, of force,depth,tip,delay,stepper,frame "
	 "(default: all that are known)",
	 CLI_PARSED_BY(parse_only)},
	{0, "recording", "NAME.rec",
	 "check whether its tracker and camera agree about the depth",
	 CLI_INPUT(struct check, recording)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct check, common.json)},
	{0}};

static const struct cli_command command = {
	.name = "calibrate check",
	.synopsis = "[-c FILE] [--due AGE] [--recording NAME.rec]",
	.summary =
		"Show the active calibrations, their age, and any that have expired; and "
		"whether the tracker and the camera of a recording agree about the depth.",
	.options = option_table,
	.success = "all is well",
	.failure = "a calibration has expired or failed, or tracker and camera disagree",
};

/* Seconds since a date of the history; negative: in the future. */
static double measure_age(const char *date)
{
	struct tm utc = {0};

	strptime(date, "%Y-%m-%dT%H:%M:%SZ", &utc);
	return difftime(time(NULL), timegm(&utc));
}

/* "KEY = VALUE, …" of a kind's keys that a person has written; "" if there are none. */
static void list_by_hand(const struct calibrate *c, int kind, char *text, size_t size)
{
	struct incise_calibration nominal;
	size_t used = 0;

	*text = '\0';
	incise_calibration_nominal(&nominal);
	for (const char *const *key = kinds[kind].keys; *key; key++) {
		const struct incise_calibration_value *last =
			incise_calibration_last(c->history, c->n_history, *key, NULL);
		const double now = incise_calibration_get(&c->found, *key);
		const double was =
			last ? last->left : incise_calibration_get(&nominal, *key);

		/* Both are NAN where nothing is known. */
		if (now == was || (isnan(now) && isnan(was)) || used >= size)
			continue;
		used += (size_t)snprintf(text + used, size - used, "%s%s = %.8g",
					 used ? ", " : "", *key, now);
	}
}

static void judge_kind(struct check *check, int kind)
{
	struct status *s = &check->status[kind];
	char hand[300], in_force[360];

	*s = (struct status){.age_s = NAN};
	for (int i = 0; i < check->common.n_history; i++) {
		const struct incise_calibration_record *r = &check->common.history[i];

		if (strcmp(r->kind, kinds[kind].name))
			continue;
		s->last = r;
		if (r->pass)
			s->passed = r;
	}
	s->failed = s->last && !s->last->pass;
	if (s->passed)
		s->age_s = measure_age(s->passed->date);
	s->due = true;
	list_by_hand(&check->common, kind, hand, sizeof(hand));
	if (*hand)
		snprintf(in_force, sizeof(in_force), "set by hand: %s; nominal: %s", hand,
			 kinds[kind].nominal);
	else
		snprintf(in_force, sizeof(in_force), "nominal, %s", kinds[kind].nominal);
	if (!s->passed)
		snprintf(s->why, sizeof(s->why), "%s: %s",
			 s->last ? "no calibration has passed" : "never calibrated",
			 in_force);
	else if (s->failed)
		snprintf(s->why, sizeof(s->why), "the last one, of %.10s, failed",
			 s->last->date);
	else if (*hand)
		snprintf(s->why, sizeof(s->why), "changed by hand since: %s", hand);
	else if (s->age_s < -60)
		snprintf(s->why, sizeof(s->why),
			 "its date is in the future: check the clock");
	else if (s->age_s > check->due_s)
		snprintf(s->why, sizeof(s->why), "older than %.4g days",
			 check->due_s / 86400);
	else
		s->due = false;
}

static void print_status(const struct incise_calibration *calibration, int kind,
			 const struct status *s)
{
	const struct incise_calibration_record *r = s->passed;
	char text[UNCERTAINTY_TEXT];

	printf("%-8s %s", kinds[kind].name,
	       s->due ? s->failed ? "FAILED" : "due" : "good");
	if (r) {
		printf(", %.10s, %.0f days old", r->date, floor(s->age_s / 86400));
		if (isfinite(r->low) && isfinite(r->high))
			printf(", for %.4g to %.4g %s", r->low, r->high, r->range_unit);
	}
	printf("%s%s\n", *s->why ? ": " : "", s->why);
	for (int i = 0; r && i < r->n; i++) {
		const struct incise_calibration_value *v = &r->values[i];
		double now = incise_calibration_get(calibration, v->key);

		printf("         %-22s %s (k = 2)", v->key,
		       uncertainty_text(v->left, 2 * v->u, v->unit, text));
		if (now != v->left)
			printf("; active: %.8g", now);
		putchar('\n');
	}
	if (s->last && *s->last->verdict)
		printf("         %s\n", s->last->verdict);
}

static json_t *json_status(const struct incise_calibration *calibration, int kind,
			   const struct status *s)
{
	const struct incise_calibration_record *r = s->passed;
	json_t *values = json_array(), *in_force = json_object();

	for (const char *const *key = kinds[kind].keys; *key; key++)
		json_set_number(in_force, *key,
				incise_calibration_get(calibration, *key));
	for (int i = 0; r && i < r->n; i++) {
		const struct incise_calibration_value *v = &r->values[i];

		json_array_append_new(
			values,
			json_pack(
				"{s:s, s:o, s:o, s:o, s:o, s:o}", "key", v->key, "unit",
				json_text(v->unit), "in_force",
				json_number(incise_calibration_get(calibration, v->key)),
				"found", json_number(v->found), "left",
				json_number(v->left), "U", json_number(2 * v->u)));
	}
	return json_pack("{s:s, s:b, s:b, s:s, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:o}",
			 "kind", kinds[kind].name, "due", s->due, "failed", s->failed,
			 "why", s->why, "date", r ? json_text(r->date) : json_null(),
			 "age_days", json_number(s->age_s / 86400), "low",
			 json_number(r ? r->low : NAN), "high",
			 json_number(r ? r->high : NAN), "range_unit",
			 json_text(r ? r->range_unit : ""), "verdict",
			 json_text(s->last ? s->last->verdict : ""), "values", values,
			 "in_force", in_force);
}

static void compare_depths(const char *path, struct comparison *c)
{
	struct incise_error err = {0};
	struct incise_recording *recording = recording_open(path);
	struct incise_redundancy *r = &c->redundancy;
	struct incise_depth_pair *pairs;
	int n;

	n = incise_depth_pairs(recording, &pairs, &err);
	if (n < 0)
		cli_fail_with(&err);
	if (incise_redundancy(pairs, n, r, &err))
		cli_fail("%s: %s", path, err.text);
	free(pairs);
	incise_recording_close(recording);
	c->bad = r->bias_bad || r->place_bad || r->trend_bad;
	if (r->place_bad)
		snprintf(c->verdict, sizeof(c->verdict),
			 "metal may be near: camera and tracker differ by %.2f mm "
			 "between places, more than %g mm; move steel away from tracker "
			 "and scalpel",
			 r->place_mm, INCISE_REDUNDANCY_PLACE_MM);
	else if (r->trend_bad)
		snprintf(c->verdict, sizeof(c->verdict),
			 "a scale may be wrong: they differ by %.1f %% of the depth, "
			 "more than %g %%; run incise calibrate depth",
			 100 * r->trend, 100 * INCISE_REDUNDANCY_TREND);
	else if (r->bias_bad)
		snprintf(c->verdict, sizeof(c->verdict),
			 "the camera may have moved: they differ by %+.2f mm "
			 "everywhere, more than %g mm; run incise calibrate depth and "
			 "tip, or check the surface in rig.conf",
			 r->bias_mm, INCISE_REDUNDANCY_BIAS_MM);
	else
		snprintf(c->verdict, sizeof(c->verdict), "camera and tracker agree");
}

static void print_comparison(const char *path, const struct comparison *c)
{
	const struct incise_redundancy *r = &c->redundancy;
	char text[UNCERTAINTY_TEXT];

	printf("\n"
	       "%s: camera minus tracker, in %s\n",
	       path, cli_count(r->n, "frame"));
	printf("         bias     %s (k = 2)\n",
	       uncertainty_text(r->bias_mm, 2 * r->bias_u_mm, "mm", text));
	if (isfinite(r->trend))
		printf("         trend    %s of the depth (k = 2), over %.1f to %.1f mm\n",
		       uncertainty_text(100 * r->trend, 200 * r->trend_u, "%", text),
		       r->depth_low_mm, r->depth_high_mm);
	printf("         places   %s apart (k = 2), over %.0f mm\n",
	       uncertainty_text(r->place_mm, 2 * r->place_u_mm, "mm", text),
	       r->travel_mm);
	printf("         scatter  sd %.3f mm\n         %s\n", r->scatter_sd_mm,
	       c->verdict);
}

static json_t *json_comparison(const struct comparison *c)
{
	const struct incise_redundancy *r = &c->redundancy;
	json_t *object = json_object();

	json_set_integer(object, "pictures", r->n);
	json_set_number(object, "bias_mm", r->bias_mm);
	json_set_number(object, "bias_U_mm", 2 * r->bias_u_mm);
	json_set_number(object, "trend", r->trend);
	json_set_number(object, "trend_U", 2 * r->trend_u);
	json_set_number(object, "place_mm", r->place_mm);
	json_set_number(object, "place_U_mm", 2 * r->place_u_mm);
	json_set_number(object, "travel_mm", r->travel_mm);
	json_set_number(object, "scatter_sd_mm", r->scatter_sd_mm);
	json_object_set_new(object, "agree", json_boolean(!c->bad));
	json_object_set_new(object, "verdict", json_string(c->verdict));
	return object;
}

static void print_check_json(const struct check *check, int due)
{
	json_t *list = json_array();

	for (int k = 0; k < KINDS; k++)
		if (check->only[k])
			json_array_append_new(list, json_status(&check->common.found, k,
								&check->status[k]));
	json_print(json_pack(
		"{s:o, s:i, s:i, s:o, s:o}", "path", json_text(check->common.calibration),
		"calibrations", check->common.n_history, "due", due, "kinds", list,
		"recording",
		check->recording ? json_comparison(&check->comparison) : json_null()));
}

static void print_text(const struct check *check)
{
	printf("%s: %s in its history\n", check->common.calibration,
	       cli_count(check->common.n_history, "calibration"));
	for (int k = 0; k < KINDS; k++)
		if (check->only[k])
			print_status(&check->common.found, k, &check->status[k]);
	if (check->recording)
		print_comparison(check->recording, &check->comparison);
}

int calibrate_check(int argc, char **argv)
{
	static struct check check = {.common.dry_run = true, .due_s = 365 * 86400.0};
	int due = 0;

	memset(check.only, 1, sizeof(check.only));
	cli_parse(&command, argc, argv, &check);
	cli_no_operands(argc, argv, "--recording");
	/* Without a name, nothing was ever calibrated here. */
	calibrate_find(&check.common, check.common.calibration);
	if (check.recording)
		compare_depths(check.recording, &check.comparison);
	for (int k = 0; k < KINDS; k++) {
		judge_kind(&check, k);
		check.only[k] &= check.named || check.status[k].last ||
				 strcmp(kinds[k].name, FRAME) != 0;
		due += check.only[k] && check.status[k].due;
	}
	if (check.common.json)
		print_check_json(&check, due);
	else
		print_text(&check);
	cli_finish();
	return due || check.comparison.bad;
}
