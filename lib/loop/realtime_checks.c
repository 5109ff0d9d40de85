// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What the kernel's answers mean for a loop, in words and commands: what is needed, and all
 * checks in their order; see realtime_checks.h. Pure text: nothing is changed here.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "proc_file.h"
#include "realtime_checks.h"

/* One for both limits: who needs the one needs the other. */
#define GRANT "sudo prlimit --pid $$ --rtprio=90 --memlock=unlimited"
#define GRANT_FOR_GOOD                                                       \
	"printf '%s - rtprio 90\\n%s - memlock unlimited\\n' $USER $USER | " \
	"sudo tee /etc/security/limits.d/incise.conf"

/* Bit of CAP_SYS_NICE in /proc/self/status. */
#define CAP_SYS_NICE_BIT 23

void realtime_found(struct incise_realtime_check *check, const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	vsnprintf(check->found, sizeof(check->found), fmt, args);
	va_end(args);
}

void realtime_fix(struct incise_realtime_check *check, const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	vsnprintf(check->fix, sizeof(check->fix), fmt, args);
	va_end(args);
}

void realtime_keep(struct incise_realtime_check *check, const char *command)
{
	snprintf(check->keep, sizeof(check->keep), "%s", command);
}

bool realtime_line(const struct judgement *j, const char *path, char *text, size_t size)
{
	int length = proc_file_read(j->root, path, text, size);

	text[strcspn(text, "\n")] = 0;
	for (char *c = strchr(text, '\t'); c; c = strchr(c, '\t'))
		*c = ' ';
	return length > 0;
}

static bool has_cap_sys_nice(const struct judgement *j)
{
	char text[8192], *at;

	proc_file_read(j->root, "/proc/self/status", text, sizeof(text));
	at = strstr(text, "\nCapEff:");
	return at && strtoull(at + 8, NULL, 16) >> CAP_SYS_NICE_BIT & 1;
}

/* Denied though the limit is wide: by a control group or a sandbox. */
static void fifo_group(const struct judgement *j, struct incise_realtime_check *check)
{
	char text[32];
	bool v2 = proc_file_read(j->root, "/sys/fs/cgroup/cgroup.procs", text,
				 sizeof(text)) >= 0;

	realtime_found(
		check,
		"SCHED_FIFO is denied by the control group (no real-time share) or a "
		"sandbox (RestrictRealtime=), not by RLIMIT_RTPRIO");
	realtime_fix(check, "echo $$ | sudo tee /sys/fs/cgroup/%scgroup.procs",
		     v2 ? "" : "cpu/");
}

static void check_fifo(const struct judgement *j, struct incise_realtime_check *check)
{
	int error = j->answers->policy_error, priority = j->setup->priority;

	check->ok = !error;
	if (!error) {
		realtime_found(check, "SCHED_FIFO at priority %d", priority);
	} else if (error == EPERM && j->answers->rtprio < (rlim_t)priority) {
		realtime_found(
			check,
			"SCHED_FIFO at priority %d is denied: RLIMIT_RTPRIO is %llu",
			priority, (unsigned long long)j->answers->rtprio);
		realtime_fix(check, "%s", GRANT);
		realtime_keep(check, GRANT_FOR_GOOD);
	} else if (error == EPERM) {
		fifo_group(j, check);
	} else {
		realtime_found(check, "SCHED_FIFO at priority %d: %s", priority,
			       strerror(error));
	}
}

/* A shell that may. As a file's capability it would hide the library from the program. */
#define NICE_SHELL                                                      \
	"sudo setpriv --reuid=$(id -u) --regid=$(id -g) --init-groups " \
	"--inh-caps=+sys_nice,+ipc_lock --ambient-caps=+sys_nice,+ipc_lock $SHELL"
#define NICE_SERVICE                                                               \
	"printf '[Service]\\nAmbientCapabilities=CAP_SYS_NICE\\n"                  \
	"CapabilityBoundingSet=CAP_SYS_NICE\\n' | sudo install -Dm644 /dev/stdin " \
	"/etc/systemd/system/incise-haptic@.service.d/deadline.conf"

static bool lacks_nice(const struct judgement *j)
{
	return j->setup->policy == INCISE_REALTIME_DEADLINE &&
	       j->answers->policy_error == EPERM && !has_cap_sys_nice(j);
}

static void check_deadline(const struct judgement *j, struct incise_realtime_check *check)
{
	int error = j->answers->policy_error;
	char cpus[64];

	check->ok = !error;
	if (!error) {
		realtime_found(check, "SCHED_DEADLINE, half of each period of %lld us",
			       (long long)j->setup->period_ns / 1000);
	} else if (lacks_nice(j)) {
		realtime_found(check, "SCHED_DEADLINE is denied: it needs CAP_SYS_NICE");
		realtime_fix(check, "%s", NICE_SHELL);
		realtime_keep(check, NICE_SERVICE);
	} else if (error == EPERM) {
		realtime_found(
			check,
			"SCHED_DEADLINE is denied: this program may not run on all "
			"CPUs, or a sandbox refuses it");
		/* What goes into a command is a list of numbers, whatever the file says. */
		if (realtime_line(j, CPUS "online", cpus, sizeof(cpus)) &&
		    !cpus[strspn(cpus, "0123456789,-")])
			realtime_fix(check, "taskset -pc %s $$", cpus);
	} else if (error == EBUSY) {
		realtime_found(
			check,
			"SCHED_DEADLINE is denied: too much of the CPUs is promised to "
			"others already");
		realtime_fix(check, "ps -eo pid,cls,comm | grep -w DLN");
	} else {
		realtime_found(check, "SCHED_DEADLINE: %s", strerror(error));
	}
}

static void check_scheduling(const struct judgement *j,
			     struct incise_realtime_check *check)
{
	if (j->setup->policy == INCISE_REALTIME_DEADLINE)
		check_deadline(j, check);
	else
		check_fifo(j, check);
}

static void check_memory(const struct judgement *j, struct incise_realtime_check *check)
{
	const struct realtime_answers *a = j->answers;
	unsigned long long need_MiB = (a->lock_bytes >> 20) + 1;

	check->ok = !a->lock_error;
	if (check->ok) {
		realtime_found(check, "%llu MiB of addresses can be locked", need_MiB);
		return;
	}
	if (a->memlock == RLIM_INFINITY)
		realtime_found(check, "%llu MiB of addresses cannot be locked: %s",
			       need_MiB, strerror(a->lock_error));
	else
		realtime_found(
			check,
			"%llu MiB of addresses cannot be locked: RLIMIT_MEMLOCK is %llu "
			"KiB",
			need_MiB, (unsigned long long)a->memlock >> 10);
	/* The shell that may use SCHED_DEADLINE may lock memory as well. */
	realtime_fix(check, "%s", lacks_nice(j) ? NICE_SHELL : GRANT);
	realtime_keep(check, GRANT_FOR_GOOD);
}

static void check_cpu(const struct judgement *j, struct incise_realtime_check *check)
{
	int error = j->answers->cpu_error, cpu = j->setup->cpu;
	char cpus[64];

	check->ok = !error;
	if (!error)
		realtime_found(check, "CPU %d", cpu);
	else if (error != EINVAL)
		realtime_found(check, "CPU %d cannot be had: %s", cpu, strerror(error));
	else if (!realtime_line(j, CPUS "online", cpus, sizeof(cpus)) ||
		 proc_file_lists(cpus, cpu))
		realtime_found(
			check,
			"CPU %d cannot be had: it is not in the cpuset of this program",
			cpu);
	else
		realtime_found(check, "CPU %d cannot be had: there are %s", cpu, cpus);
}

static const struct {
	const char *name;
	void (*look)(const struct judgement *j, struct incise_realtime_check *check);
	bool needed, of_cpu;
} looks[] = {
	{"scheduling", check_scheduling, true, false},
	{"memory", check_memory, true, false},
	{"cpu", check_cpu, true, true},
	{"kernel", realtime_check_kernel, false, false},
	{"throttling", realtime_check_throttling, false, false},
	{"governor", realtime_check_governor, false, false},
	{"idle", realtime_check_idle, false, false},
	{"clock", realtime_check_clock, false, false},
	{"isolated", realtime_check_isolated, false, true},
};
_Static_assert(sizeof(looks) / sizeof(*looks) == INCISE_REALTIME_CHECKS, "all of them");

int realtime_judge(const struct incise_realtime_setup *setup,
		   const struct realtime_answers *answers, const char *root,
		   struct incise_realtime_check *checks, int n)
{
	struct judgement judgement = {setup, answers, root};
	int count = 0;

	for (int i = 0; i < INCISE_REALTIME_CHECKS; i++) {
		if (looks[i].of_cpu && setup->cpu < 0)
			continue;
		if (count < n) {
			checks[count] = (struct incise_realtime_check){
				.name = looks[i].name, .needed = looks[i].needed};
			looks[i].look(&judgement, &checks[count]);
		}
		count++;
	}
	return count;
}

/* Commands of all that is denied, each once, to be run one after the other. */
static void collect(char *text, size_t size, const char *command)
{
	size_t length = strlen(text);

	if (!*command || strstr(text, command))
		return;
	snprintf(text + length, size - length, "%s%s", length ? "; " : "", command);
}

static int code(const struct incise_realtime_check *check,
		const struct realtime_answers *answers)
{
	if (!strcmp(check->name, "scheduling"))
		return answers->policy_error;
	if (!strcmp(check->name, "cpu"))
		return answers->cpu_error;
	/* mlock(2) says ENOMEM where it means that it is not allowed. */
	return EPERM;
}

int realtime_denied(const struct realtime_answers *answers,
		    const struct incise_realtime_check *checks, int n,
		    struct incise_error *err)
{
	char reasons[500] = "", fixes[500] = "", keeps[500] = "", text[1600];
	int error = 0, length;

	for (int i = 0; i < n; i++) {
		if (!checks[i].needed || checks[i].ok)
			continue;
		if (!error)
			error = code(&checks[i], answers);
		collect(reasons, sizeof(reasons), checks[i].found);
		collect(fixes, sizeof(fixes), checks[i].fix);
		collect(keeps, sizeof(keeps), checks[i].keep);
	}
	if (!error)
		return 0;
	length = snprintf(text, sizeof(text), "no real time: %s%s%s%s", reasons,
			  *fixes ? "; run `" : "", fixes,
			  *fixes ? "` and start again" : "");
	/* Of a command a half is worse than none. */
	if (err && *keeps &&
	    (size_t)length + strlen(keeps) + sizeof("; to make it last: ``") <=
		    sizeof(err->text))
		snprintf(text + length, sizeof(text) - (size_t)length,
			 "; to make it last: `%s`", keeps);
	return incise_error_set(err, error, "%s", text);
}
