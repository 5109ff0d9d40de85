// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * StallGuard's values by speed; see tune.h.
 *
 *   0 ──┤start          at the speed: samples          end├── travel
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "../cli/cli.h"
#include "../cli/json.h"
#include "tune.h"

#define START 0.05 /* of the travel */
#define END 0.95
#define AT_SPEED 0.02 /* of it */
#define SAMPLES_LEAST 10
/* For a chip whose stall is a load of 0: bounds of the least load in free motion. */
#define LOAD_LOW 20
#define LOAD_HIGH 100

struct tuned {
	double mm_s, sum;
	int n, least, most;
	int threshold; /* advised */
};

static void go_to_start(struct stepper_drive *drive)
{
	double start_mm = START * drive->info.travel_mm;

	do {
		stepper_drive_to(drive, start_mm);
	} while (!cli_stop &&
		 !(stepper_drive_rests(drive) &&
		   fabs(drive->status.position_mm - start_mm) <= drive->info.step_mm));
}

static struct incise_stepper_chip read_chip(struct stepper_drive *drive)
{
	struct incise_stepper_chip chip;
	int rc = incise_stepper_chip(drive->stepper, &chip);

	if (rc == -EOPNOTSUPP)
		stepper_drive_fail(drive,
				   "%s: rig.conf names no driver chip; add driver = "
				   "\"tmc2209:TTY:NODE\" and its group to actuator",
				   drive->info.name);
	if (rc)
		stepper_drive_fail(drive, "%s: reading its driver chip: %s",
				   drive->info.name, strerror(-rc));
	return chip;
}

/* A stall at half of the least load leaves room on both sides. */
static int advised(const struct tuned *t, const struct incise_stepper_chip *chip)
{
	if (chip->threshold_load)
		return t->least / (2 * chip->threshold_load);
	return chip->threshold + (t->least < LOAD_LOW) - (t->least > LOAD_HIGH);
}

static void measure_speed(struct stepper_drive *drive, struct tuned *t)
{
	struct incise_stepper_chip chip = {0};

	go_to_start(drive);
	while (!cli_stop && drive->status.position_mm < END * drive->info.travel_mm) {
		stepper_drive_at(drive, t->mm_s);
		if (fabs(drive->status.velocity_mm_s - t->mm_s) > AT_SPEED * t->mm_s)
			continue;
		chip = read_chip(drive);
		t->least = t->n ? (int)fmin(t->least, chip.load) : chip.load;
		t->most = (int)fmax(t->most, chip.load);
		t->sum += chip.load;
		t->n++;
	}
	if (!cli_stop && t->n < SAMPLES_LEAST)
		stepper_drive_fail(drive,
				   "%g mm/s: only %s at this speed in the travel; give a "
				   "lower speed",
				   t->mm_s, cli_count(t->n, "value"));
	t->threshold = advised(t, &chip);
}

static json_t *tuned_json(const struct tuned *t)
{
	return json_pack("{so si si so si si}", "velocity_mm_s", json_number(t->mm_s),
			 "values", t->n, "load_min", t->least, "load_mean",
			 json_number(t->sum / t->n), "load_max", t->most,
			 "stall_threshold", t->threshold);
}

void stepper_tune(struct stepper_drive *drive, const double *speeds, int n,
		  json_t *report)
{
	struct incise_stepper_chip chip = read_chip(drive);
	json_t *rows = json_array();
	int threshold = 0;

	if (!report)
		puts("    mm/s  values  load min   mean   max  stall_threshold");
	for (int i = 0; i < n && !cli_stop; i++) {
		struct tuned t = {.mm_s = speeds[i]};

		measure_speed(drive, &t);
		if (cli_stop)
			break;
		/* The one that trips at no speed. */
		threshold = !i			  ? t.threshold
			    : chip.threshold_load ? (int)fmin(threshold, t.threshold)
						  : (int)fmax(threshold, t.threshold);
		json_array_append_new(rows, tuned_json(&t));
		cli_progress_end();
		if (!report)
			printf("%8g  %6d  %8d  %5.0f  %4d  %15d\n", t.mm_s, t.n, t.least,
			       t.sum / t.n, t.most, t.threshold);
	}
	if (report) {
		json_object_set(report, "speeds", rows);
		json_object_set_new(report, "stall_threshold", json_integer(threshold));
	} else if (!cli_stop)
		printf("advised: stall_threshold = %d; now %d\n", threshold,
		       chip.threshold);
	json_decref(rows);
}
