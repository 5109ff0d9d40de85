// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise device: owns a haptic device, and serves it to one user over a page in shared memory. It does
 * nothing else, outlives its user, and gives no force without that user's heartbeat.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include <incise/haptic_owner.h>
#include <incise/outfile.h>
#include <incise/realtime.h>
#include "cli/cli.h"

/* A program that starts an owner is given time to attach, a person all of it. */
#define FIRST_USER_S 5
#define YEARS_S 1e9
#define LOG_BUFFER (1 << 20)

struct device_job {
	const char *rig, *log;
	bool detach, no_rt;
};

static const struct cli_option options[] = {
	{CLI_RIG_OPTION(struct device_job, rig)},
	{0, "detach", NULL,
	 "for a program that starts it: print `ready` on standard error, and leave the "
	 "terminal and its session; or fail behind a line `errno N`",
	 CLI_FLAG(struct device_job, detach)},
	{0, "log", "FILE",
	 "write each tick to this CSV file: the age of the user's heartbeat and the "
	 "force given",
	 CLI_OUTPUT(struct device_job, log)},
	{0, "no-rt", NULL, "run with normal scheduling: ticks may be late",
	 CLI_FLAG(struct device_job, no_rt)},
	{0},
};

static const struct cli_command command = {
	.name = "device",
	.synopsis = "[DEVICE] [OPTIONS]",
	.summary =
		"Own a haptic device, and serve it to one program at a time over shared "
		"memory. It gives no force when that program stops, is killed or sends "
		"no valid force. incise haptic starts it by itself. Not a safety device.",
	.options = options,
	.notes = "DEVICE is BACKEND:ARGUMENTS, as in rig.conf; without it the haptic "
		 "device of the rig is served.",
	.examples = "incise device --rig rig.conf",
	.success = "ended as requested, or without a user",
	.failure = "the device cannot be opened, or failed",
};

/* --- the owner --------------------------------------------------------------------------- */

/* Without the privilege the owner runs all the same, and says so: a text for the user. */
static const char *prepare_real_time(const struct device_job *job,
				     struct incise_realtime **realtime)
{
	const struct incise_realtime_setup setup = {
		.priority = INCISE_REALTIME_PRIORITY,
		.cpu = INCISE_REALTIME_ANY_CPU,
		.period_ns = 1000000,
	};
	struct incise_error err = {0};

	*realtime = job->no_rt ? NULL : incise_realtime_new(&setup, &err);
	if (*realtime)
		return "";
	if (!job->no_rt)
		cli_warn("normal scheduling, ticks may be late: %s", err.text);
	return "its owner runs with normal scheduling: ticks may be late";
}

static void leave_terminal(void)
{
	int null = open("/dev/null", O_RDWR | O_CLOEXEC);

	fputs("ready\n", stderr);
	for (int i = 0; null >= 0 && i <= STDERR_FILENO; i++)
		dup2(null, i);
}

static void log_tick(FILE *log, const struct incise_haptic_owner_tick *tick)
{
	fprintf(log, "%lld,%lld,%lld,%s", (long long)tick->t_ns, (long long)tick->age_ns,
		(long long)tick->period_ns, *tick->off ? tick->off : "on");
	for (int i = 0; i < 3; i++)
		fprintf(log, ",%.9g", tick->force_N[i]);
	for (int i = 0; i < 3; i++)
		fprintf(log, ",%.9g", tick->torque_N_mm[i]);
	fputc('\n', log);
}

/* Returns the reason for the user; NULL: the device failed. */
static const char *serve_device(struct incise_haptic_owner *owner, FILE *log,
				struct incise_error *err)
{
	struct incise_haptic_owner_tick tick = {0};
	int rc;

	while (!cli_stop && !tick.end) {
		rc = incise_haptic_owner_tick(owner, &tick, err);
		if (rc && rc != -EINTR)
			return NULL;
		if (!rc && log)
			log_tick(log, &tick);
	}
	return cli_stop ? strsignal(cli_stop) : tick.end;
}

static FILE *begin_log(struct incise_outfile *file)
{
	FILE *log = incise_outfile_stream(file);

	setvbuf(log, NULL, _IOFBF, LOG_BUFFER);
	fputs("t_ns,age_ns,period_ns,state,force_x_N,force_y_N,force_z_N,torque_x_N_mm,"
	      "torque_y_N_mm,torque_z_N_mm\n",
	      log);
	return log;
}

int main(int argc, char **argv)
{
	struct device_job job = {0};
	struct incise_error err = {0};
	struct incise_realtime *realtime;
	struct incise_haptic_owner *owner;
	struct incise_outfile *file = NULL;
	const char *note, *end;

	/* Before there is another thread. */
	incise_realtime_prepare();
	cli_parse(&command, argc, argv, &job);
	if (optind < argc && job.rig)
		cli_usage("--rig and DEVICE name two devices; give one of them");
	if (argc - optind > 1)
		cli_usage("unexpected argument '%s'; give one DEVICE", argv[optind + 1]);
	if (optind < argc)
		job.rig = argv[optind];
	if (job.detach)
		setsid();
	cli_catch_signals();
	note = prepare_real_time(&job, &realtime);
	if (job.log)
		file = cli_require(incise_outfile_open(job.log, &err), &err);
	owner = incise_haptic_owner_open(cli_rig(job.rig), note,
					 job.detach ? FIRST_USER_S : YEARS_S, &err);
	if (!owner && job.detach)
		fprintf(stderr, "errno %d\n", errno);
	cli_require(owner, &err);
	if (realtime && incise_realtime_enter(realtime, &err))
		cli_warn("normal scheduling, ticks may be late: %s", err.text);
	if (job.detach)
		leave_terminal();
	end = serve_device(owner, file ? begin_log(file) : NULL, &err);
	incise_haptic_owner_close(owner, end);
	incise_realtime_free(realtime);
	if (file && incise_outfile_commit(file, end ? &err : NULL) && end)
		cli_fail_with(&err);
	if (!end)
		cli_fail_with(&err);
	return 0;
}
