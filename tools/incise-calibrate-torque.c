// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise calibrate torque: friction and cogging of a haptic device along a line, from the force that
 * moves its free handle slowly, there and back:
 *
 *   force ▲  ╭─╮ ╭─╮ ╭─    there: friction + cogging
 *         │ ─╯ ╰─╯ ╰─╯
 *         │  ╭─╮ ╭─╮ ╭─    back: cogging - friction
 *         │ ─╯ ╰─╯ ╰─╯
 *         ╰─────────────▶ position
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../lib/base/vector.h"
#include "cli/cli.h"
#include "cli/handle.h"
#include "cli/json.h"

#define PASSES 3
#define SPEED_MM_S 10.0
#define BINS 36
#define EDGE 0.1 /* of the span at each end, where the handle turns */
/* A spring draws the handle along the line, and keeps it there. */
#define SPRING_N_MM 0.3
#define DAMPING_N_S_MM 0.002
#define SHARE 0.5 /* of the device's largest force */

struct torque_job {
	const char *rig;
	double direction[3], span_mm;
	int enable; /* button, from 1, that must be pressed; 0: none */
	bool json;
	struct handle handle;
	double start_mm[3];
	double sum_N[PASSES][2][BINS], n[PASSES][2][BINS]; /* there, and back */
	double friction_N, u_friction_N, cogging_N;
};

static void parse_direction(void *member, char *text)
{
	char *items[4];
	double *direction = member;

	if (cli_list("direction", text, items, 4) != 3)
		cli_usage("--direction: expected X,Y,Z; give three numbers");
	for (int k = 0; k < 3; k++)
		direction[k] = cli_number("direction", items[k], -1e3, 1e3);
	if (!v3_unit(direction, direction, 1e-6))
		cli_usage(
			"--direction: expected a direction; give one that is not 0,0,0");
}

static const struct cli_option options[] = {
	{CLI_RIG_OPTION(struct torque_job, rig)},
	{0, "direction", "X,Y,Z",
	 "line of the handle in the device's frame, such as a motor's (default: 1,0,0)",
	 CLI_PARSED(struct torque_job, direction, parse_direction)},
	{0, "span", "MM",
	 "length of the line, such as a turn of the motor, forwards from where the handle "
	 "is (default: 20)",
	 CLI_NUMBER(struct torque_job, span_mm, 1, 1000)},
	{0, "json", NULL, "report as JSON", CLI_FLAG(struct torque_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "calibrate torque",
	.synopsis = "[OPTIONS]",
	.summary =
		"Measure friction and cogging of a haptic device along a line. Its motors "
		"move the free handle slowly, three times there and back. Let go of the "
		"handle, and keep the line clear.",
	.options = options,
	.examples = "incise calibrate torque --rig rig.conf --direction 0,0,1 --span 60",
	.success = "measured",
	.failure = "the device failed, or the handle did not follow",
};

/* --- motion ------------------------------------------------------------------------------ */

/* Set the force that draws the handle to @target_mm along the line, which moves. */
static int draw_handle(struct torque_job *job, double target_mm, double speed_mm_s,
		       struct incise_error *err)
{
	struct handle *handle = &job->handle;
	double most_N = SHARE * handle->info.peak_N;

	for (int k = 0; k < 3; k++) {
		double slow_mm_s =
			speed_mm_s * job->direction[k] - handle->last.velocity_mm_s[k];

		handle->force_N[k] =
			SPRING_N_MM * (job->start_mm[k] + target_mm * job->direction[k] -
				       handle->last.position_mm[k]);
		if (isfinite(slow_mm_s))
			handle->force_N[k] += DAMPING_N_S_MM * slow_mm_s;
	}
	if (v3_length(handle->force_N) <= most_N)
		return 0;
	return incise_error_set(
		err, EDOM,
		"the handle does not follow a force of %.3g N; clear its way, or "
		"choose another --direction or a shorter --span",
		most_N);
}

static double find_place(const struct torque_job *job)
{
	double away_mm[3];

	v3_sub(away_mm, job->handle.last.position_mm, job->start_mm);
	return v3_dot(away_mm, job->direction);
}

static void add_force(struct torque_job *job, int pass, int back)
{
	double share = (find_place(job) / job->span_mm - EDGE) / (1 - 2 * EDGE);

	if (!(share >= 0 && share < 1))
		return;
	job->sum_N[pass][back][(int)(share * BINS)] +=
		v3_dot(job->handle.force_N, job->direction);
	job->n[pass][back][(int)(share * BINS)]++;
}

/* Whether the device may move now. */
static int check_handle(const struct torque_job *job, struct incise_error *err)
{
	const struct handle *handle = &job->handle;

	if (job->enable && !(handle->last.buttons >> (job->enable - 1) & 1))
		return incise_error_set(
			err, EPERM,
			"%s: button %d, haptic_setup.enable, is not pressed; press it "
			"before the command starts, until it ends",
			handle->info.name, job->enable);
	return handle_check(handle, err);
}

/* Until the handle is there: friction stretches the spring first. */
static int move_once(struct torque_job *job, int pass, int back, struct incise_error *err)
{
	struct incise_clock *clock = job->handle.clock;
	int64_t start_ns = incise_clock_now(clock);
	double from_mm = find_place(job), speed_mm_s = back ? -SPEED_MM_S : SPEED_MM_S;
	double end_mm = job->span_mm * (back ? EDGE / 2 : 1 - EDGE / 2);
	int rc = check_handle(job, err);

	while (!rc && (find_place(job) - end_mm) * speed_mm_s < 0) {
		double t_s = (double)(incise_clock_now(clock) - start_ns) * 1e-9;

		rc = draw_handle(job, from_mm + speed_mm_s * t_s, speed_mm_s, err);
		if (rc)
			break;
		add_force(job, pass, back);
		rc = handle_poll(&job->handle, false, err);
		if (!rc)
			rc = check_handle(job, err);
	}
	return rc;
}

static int find_enable(void *context, const struct incise_key *key)
{
	struct torque_job *job = context;

	if (!strcmp(key->name, "haptic_setup.enable"))
		job->enable = atoi(key->value);
	return 0;
}

static void measure_torque(struct torque_job *job)
{
	struct incise_rig *rig = cli_open_rig(job->rig, INCISE_RIG_HAPTIC);
	struct incise_error err = {0};
	int rc;

	if (!incise_rig_haptic(rig))
		cli_fail("the rig has no haptic device; name one in rig.conf");
	/* A device alone, such as "haply:", has no settings. */
	incise_rig_keys(cli_rig(job->rig), find_enable, job, NULL);
	handle_begin(&job->handle, rig);
	if (!(job->handle.info.peak_N > 0))
		cli_fail(
			"%s: its largest force is not known; set haptic_setup.peak_N in rig.conf",
			job->handle.info.name);
	rc = handle_record(&job->handle, 0.3, &err);
	/* While it starts a device is not ready. */
	job->handle.flags = job->handle.last.flags;
	v3_copy(job->start_mm, job->handle.last.position_mm);
	for (int i = 0; !rc && i < 2 * PASSES; i++)
		rc = move_once(job, i / 2, i % 2, &err);
	handle_release(&job->handle);
	if (rc)
		cli_fail_with(&err);
	incise_rig_close(rig);
}

/* --- the result -------------------------------------------------------------------------- */

/* Mean of @n values; *spread: their standard deviation. */
static double mean_values(const double *values, int n, double *spread)
{
	double mean = 0, sum2 = 0;

	for (int i = 0; i < n; i++)
		mean += values[i] / n;
	for (int i = 0; i < n; i++)
		sum2 += (values[i] - mean) * (values[i] - mean);
	*spread = sqrt(sum2 / (n - 1));
	return mean;
}

/* The uncertainty is by the spread of the passes. Weight, the mean of both ways, is no cogging. */
static void fit_torque(struct torque_job *job)
{
	double friction_N[PASSES] = {0}, cogging_N[BINS] = {0};

	for (int i = 0; i < PASSES * BINS; i++) {
		int pass = i / BINS, bin = i % BINS;
		double there_N = job->sum_N[pass][0][bin] / job->n[pass][0][bin];
		double back_N = job->sum_N[pass][1][bin] / job->n[pass][1][bin];

		friction_N[pass] += (there_N - back_N) / 2 / BINS;
		cogging_N[bin] += (there_N + back_N) / 2 / PASSES;
	}
	job->friction_N = mean_values(friction_N, PASSES, &job->u_friction_N);
	job->u_friction_N /= sqrt(PASSES);
	mean_values(cogging_N, BINS, &job->cogging_N);
	if (!isfinite(job->friction_N))
		cli_fail("no sample in a part of the line; choose a longer --span");
}

static void print_result(const struct torque_job *job)
{
	json_t *report;

	if (!job->json) {
		printf("friction       %.4f N, u %.4f N\n"
		       "cogging (rms)  %.4f N\n"
		       "in rig.conf: haptic_setup = { coulomb_N = %.4f; };\n",
		       job->friction_N, job->u_friction_N, job->cogging_N,
		       job->friction_N);
		return;
	}
	report = json_object();
	json_set_number(report, "coulomb_N", job->friction_N);
	json_set_number(report, "u_coulomb_N", job->u_friction_N);
	json_set_number(report, "cogging_N", job->cogging_N);
	json_print(report);
}

int main(int argc, char **argv)
{
	static struct torque_job job = {.direction = {1}, .span_mm = 20};

	cli_parse(&command, argc, argv, &job);
	cli_no_operands(argc, argv, "--rig");
	cli_catch_signals();
	measure_torque(&job);
	fit_torque(&job);
	print_result(&job);
	return 0;
}
