// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise device: owns a haptic device, and serves it to one user over a page in shared memory. It does
 * nothing else, outlives its user, and gives no force without that user's heartbeat.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include <incise/haptic_owner.h>
#include <incise/outfile.h>
#include <incise/realtime.h>
#include "cli/cli.h"

/* A user that starts an owner is given time to attach. */
#define FIRST_USER_S 5
#define LOG_BUFFER (1 << 20)

struct device_job {
	const char *rig, *log;
	bool background, no_rt;
};

static const struct cli_option options[] = {
	{CLI_RIG_OPTION(struct device_job, rig)},
	{0, "background", NULL,
	 "return when the device is ready; the owner continues in a session of its own",
	 CLI_FLAG(struct device_job, background)},
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

/* --- background ------------------------------------------------------------------------- */

/*
 * The caller gets the status of the owner's start: 0 when it is ready. The device is opened in the process
 * that keeps it. Returns a descriptor for tell_ready().
 */
static int go_to_background(void)
{
	int fds[2], status;
	char byte;
	pid_t pid;

	if (pipe2(fds, O_CLOEXEC))
		cli_fail("--background: %s", strerror(errno));
	pid = fork();
	if (pid < 0)
		cli_fail("--background: %s", strerror(errno));
	if (!pid) {
		close(fds[0]);
		setsid();
		return fds[1];
	}
	close(fds[1]);
	if (read(fds[0], &byte, 1) == 1)
		_exit(0);
	waitpid(pid, &status, 0);
	/* The owner has printed the reason. */
	_exit(1);
}

static void tell_ready(int fd)
{
	int null = open("/dev/null", O_RDWR | O_CLOEXEC);

	for (int i = 0; null >= 0 && i <= STDERR_FILENO; i++)
		dup2(null, i);
	if (write(fd, "", 1) != 1)
		exit(1);
	close(fd);
}

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

/* The reason why the owner ends; NULL: it goes on. */
static const char *find_end(const struct device_job *job,
			    const struct incise_haptic_owner_tick *tick, double lost_s)
{
	double first_s = lost_s > FIRST_USER_S ? lost_s : FIRST_USER_S;

	if (cli_stop)
		return strsignal(cli_stop);
	if (tick->end)
		return "its user asked for that";
	if (tick->had_user ? tick->unused_s > lost_s
			   : job->background && tick->unused_s > first_s)
		return "it had no user any more";
	return NULL;
}

/* Returns the reason for the user; NULL: the device failed. */
static const char *serve_device(const struct device_job *job,
				struct incise_haptic_owner *owner, FILE *log,
				struct incise_error *err)
{
	struct incise_haptic_owner_tick tick = {0};
	struct incise_haptic_setup setup;
	const char *end = NULL;
	int rc;

	incise_haptic_owner_setup(owner, &setup);
	while (!end) {
		rc = incise_haptic_owner_tick(owner, &tick, err);
		if (rc && rc != -EINTR)
			return NULL;
		if (!rc && log)
			log_tick(log, &tick);
		end = find_end(job, &tick, setup.lost_s);
	}
	return end;
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
	int ready = -1;

	/* Before there is another thread. */
	incise_realtime_prepare();
	cli_parse(&command, argc, argv, &job);
	if (optind < argc && job.rig)
		cli_usage("--rig and DEVICE name two devices; give one of them");
	if (argc - optind > 1)
		cli_usage("unexpected argument '%s'; give one DEVICE", argv[optind + 1]);
	if (optind < argc)
		job.rig = argv[optind];
	if (job.background)
		ready = go_to_background();
	cli_catch_signals();
	note = prepare_real_time(&job, &realtime);
	if (job.log)
		file = cli_require(incise_outfile_open(job.log, &err), &err);
	owner = cli_require(incise_haptic_owner_open(cli_rig(job.rig), note, &err), &err);
	if (realtime && incise_realtime_enter(realtime, &err))
		cli_warn("normal scheduling, ticks may be late: %s", err.text);
	if (ready >= 0)
		tell_ready(ready);
	end = serve_device(&job, owner, file ? begin_log(file) : NULL, &err);
	incise_haptic_owner_close(owner, end);
	incise_realtime_free(realtime);
	if (file && incise_outfile_commit(file, end ? &err : NULL) && end)
		cli_fail_with(&err);
	if (!end)
		cli_fail_with(&err);
	return 0;
}
