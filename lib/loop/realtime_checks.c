// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The kernel's answers judged for a loop, in sentences and commands: first everything that is
 * needed, then advice against lateness. Pure text: nothing is changed here.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "proc_file.h"
#include "realtime.h"

#define CPUS "/sys/devices/system/cpu/"
#define CLOCKSOURCE "/sys/devices/system/clocksource/clocksource0/"

/* Raises both limits: a user who needs one needs the other. */
#define GRANT "sudo prlimit --pid $$ --rtprio=90 --memlock=unlimited"
#define GRANT_FOR_GOOD                                                       \
	"printf '%s - rtprio 90\\n%s - memlock unlimited\\n' $USER $USER | " \
	"sudo tee /etc/security/limits.d/incise.conf # then log in again"

/* Bit of CAP_SYS_NICE in /proc/self/status. */
#define CAP_SYS_NICE_BIT 23

struct judgement {
	const struct incise_realtime_setup *setup;
	const struct realtime_answers *answers;
	const char *root;
};

/* Text that is too long is cut. */
INCISE_PRINTF(2, 3)
static void set_found(struct incise_realtime_check *check, const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	vsnprintf(check->found, sizeof(check->found), fmt, args);
	va_end(args);
}

INCISE_PRINTF(2, 3)
static void set_fix(struct incise_realtime_check *check, const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	vsnprintf(check->fix, sizeof(check->fix), fmt, args);
	va_end(args);
}

static void set_keep(struct incise_realtime_check *check, const char *command)
{
	snprintf(check->keep, sizeof(check->keep), "%s", command);
}

/* The first line of a file below the root; false and "" without one. */
static bool read_realtime_checks_line(const struct judgement *j, const char *path,
				      char *text, size_t size)
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

/* Denied in spite of a sufficient limit: by a control group or a sandbox. */
static void fifo_group(const struct judgement *j, struct incise_realtime_check *check)
{
	char text[32];
	bool v2 = proc_file_read(j->root, "/sys/fs/cgroup/cgroup.procs", text,
				 sizeof(text)) >= 0;

	set_found(check,
		  "SCHED_FIFO is denied by the control group (no real-time share) or a "
		  "sandbox (RestrictRealtime=), not by RLIMIT_RTPRIO");
	set_fix(check, "echo $$ | sudo tee /sys/fs/cgroup/%scgroup.procs",
		v2 ? "" : "cpu/");
}

static void check_fifo(const struct judgement *j, struct incise_realtime_check *check)
{
	int error = j->answers->policy_error, priority = j->setup->priority;

	check->ok = !error;
	if (!error) {
		set_found(check, "SCHED_FIFO at priority %d", priority);
	} else if (error == EPERM && j->answers->rtprio < (rlim_t)priority) {
		set_found(check,
			  "SCHED_FIFO at priority %d is denied: RLIMIT_RTPRIO is %llu",
			  priority, (unsigned long long)j->answers->rtprio);
		set_fix(check, "%s", GRANT);
		set_keep(check, GRANT_FOR_GOOD);
	} else if (error == EPERM) {
		fifo_group(j, check);
	} else {
		set_found(check, "SCHED_FIFO at priority %d: %s", priority,
			  strerror(error));
	}
}

/* A shell with the capability. On the program's file it would disable the rpath. */
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
		set_found(check, "SCHED_DEADLINE, half of each period of %lld us",
			  (long long)j->setup->period_ns / 1000);
	} else if (lacks_nice(j)) {
		set_found(check, "SCHED_DEADLINE is denied: it needs CAP_SYS_NICE");
		set_fix(check, "%s", NICE_SHELL);
		set_keep(check, NICE_SERVICE);
	} else if (error == EPERM) {
		set_found(check,
			  "SCHED_DEADLINE is denied: this program may not run on all "
			  "CPUs, or a sandbox denies it");
		/* Only a list of numbers goes into a command, whatever the file says. */
		if (read_realtime_checks_line(j, CPUS "online", cpus, sizeof(cpus)) &&
		    !cpus[strspn(cpus, "0123456789,-")])
			set_fix(check, "taskset -pc %s $$", cpus);
	} else if (error == EBUSY) {
		set_found(check,
			  "SCHED_DEADLINE is denied: other programs have reserved too "
			  "much of the CPUs");
		set_fix(check, "ps -eo pid,cls,comm | grep -w DLN");
	} else {
		set_found(check, "SCHED_DEADLINE: %s", strerror(error));
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
		set_found(check, "%llu MiB of addresses can be locked", need_MiB);
		return;
	}
	if (a->memlock == RLIM_INFINITY)
		set_found(check, "%llu MiB of addresses cannot be locked: %s", need_MiB,
			  strerror(a->lock_error));
	else
		set_found(
			check,
			"%llu MiB of addresses cannot be locked: RLIMIT_MEMLOCK is %llu "
			"KiB",
			need_MiB, (unsigned long long)a->memlock >> 10);
	/* The shell that may use SCHED_DEADLINE may lock memory as well. */
	set_fix(check, "%s", lacks_nice(j) ? NICE_SHELL : GRANT);
	set_keep(check, GRANT_FOR_GOOD);
}

static void check_cpu(const struct judgement *j, struct incise_realtime_check *check)
{
	int error = j->answers->cpu_error, cpu = j->setup->cpu;
	char cpus[64];

	check->ok = !error;
	if (!error)
		set_found(check, "CPU %d", cpu);
	else if (error != EINVAL)
		set_found(check, "CPU %d is not available: %s", cpu, strerror(error));
	else if (!read_realtime_checks_line(j, CPUS "online", cpus, sizeof(cpus)) ||
		 proc_file_lists(cpus, cpu))
		set_found(check,
			  "CPU %d is not available: it is not in the cpuset of this "
			  "program",
			  cpu);
	else
		set_found(check, "CPU %d is not available: there are %s", cpu, cpus);
}

static void check_kernel(const struct judgement *j, struct incise_realtime_check *check)
{
	char text[16];

	check->ok = read_realtime_checks_line(j, "/sys/kernel/realtime", text,
					      sizeof(text)) &&
		    !strcmp(text, "1");
	if (check->ok) {
		set_found(check, "PREEMPT_RT");
		return;
	}
	set_found(check, "not PREEMPT_RT: a busy kernel delays wake-ups (then: reboot)");
#if defined(__x86_64__)
	set_fix(check, "sudo apt-get install linux-image-rt-amd64");
#elif defined(__aarch64__)
	set_fix(check, "sudo apt-get install linux-image-rt-arm64");
#endif
}

/* Throttling is welcome as long as it stops only a loop that hangs. */
static void check_throttling(const struct judgement *j,
			     struct incise_realtime_check *check)
{
	char text[32];
	long long runtime_us, period_us;

	check->ok = true;
	if (!read_realtime_checks_line(j, "/proc/sys/kernel/sched_rt_runtime_us", text,
				       sizeof(text))) {
		set_found(check, "the kernel has none");
		return;
	}
	if (!proc_file_integer(text, &runtime_us) || runtime_us < -1)
		runtime_us = 0;
	if (!read_realtime_checks_line(j, "/proc/sys/kernel/sched_rt_period_us", text,
				       sizeof(text)) ||
	    !proc_file_integer(text, &period_us) || period_us < 1)
		period_us = 1000000;
	if (runtime_us == -1) {
		set_found(check, "off: only RLIMIT_RTTIME ends a hanging loop");
		return;
	}
	check->ok = runtime_us >= 0.9 * (double)period_us;
	set_found(check, "real-time threads get at most %.0f %% of a CPU",
		  100 * (double)runtime_us / (double)period_us);
	if (check->ok)
		return;
	set_fix(check, "sudo sysctl -w kernel.sched_rt_period_us=1000000 "
		       "kernel.sched_rt_runtime_us=950000");
	set_keep(check, "printf 'kernel.sched_rt_period_us=1000000\\n"
			"kernel.sched_rt_runtime_us=950000\\n' | "
			"sudo tee /etc/sysctl.d/60-incise.conf");
}

/* Look at the set-up's CPU, or at all. */
static void check_governor(const struct judgement *j, struct incise_realtime_check *check)
{
	char online[256], path[128], text[32], other[32] = "";
	int seen = 0, slow = 0, of = -1;

	if (!read_realtime_checks_line(j, CPUS "online", online, sizeof(online)))
		snprintf(online, sizeof(online), "0");
	for (int cpu = 0; cpu < 1024; cpu++) {
		if (j->setup->cpu >= 0 ? cpu != j->setup->cpu
				       : !proc_file_lists(online, cpu))
			continue;
		snprintf(path, sizeof(path), CPUS "cpu%d/cpufreq/scaling_governor", cpu);
		if (!read_realtime_checks_line(j, path, text, sizeof(text)))
			continue;
		seen++;
		if (!strcmp(text, "performance"))
			continue;
		if (!slow++) {
			snprintf(other, sizeof(other), "%s", text);
			of = cpu;
		}
	}
	check->ok = !slow;
	if (!seen) {
		set_found(check, "the kernel does not change frequencies here");
	} else if (!slow) {
		set_found(check, "performance");
	} else {
		set_found(check,
			  "%s, of CPU %d and %d others: it slows down between ticks",
			  other, of, slow - 1);
		set_fix(check, "echo performance | sudo tee "
			       "/sys/devices/system/cpu/cpu*/cpufreq/scaling_governor");
		set_keep(
			check,
			"echo 'w /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor - - "
			"- - performance' | sudo tee /etc/tmpfiles.d/incise-governor.conf");
	}
}

static void check_idle(const struct judgement *j, struct incise_realtime_check *check)
{
	int error = j->answers->idle_error;
	char driver[32];

	check->ok = true;
	if (!read_realtime_checks_line(j, CPUS "cpuidle/current_driver", driver,
				       sizeof(driver)) ||
	    !strcmp(driver, "none")) {
		set_found(check, "the kernel has no deep idle states here");
	} else if (!error) {
		set_found(check, "/dev/cpu_dma_latency can be held at 0");
	} else {
		check->ok = false;
		set_found(check,
			  "/dev/cpu_dma_latency: %s: deep idle states delay wake-ups",
			  strerror(error));
		if (error != EACCES && error != EPERM)
			return;
		set_fix(check, "sudo chown $USER /dev/cpu_dma_latency");
		set_keep(
			check,
			"echo 'KERNEL==\"cpu_dma_latency\", GROUP=\"incise\", "
			"MODE=\"0660\"' | sudo tee /etc/udev/rules.d/70-incise-latency.rules "
			"&& sudo udevadm trigger /dev/cpu_dma_latency && sudo usermod -aG "
			"incise $USER");
	}
}

static void check_clock(const struct judgement *j, struct incise_realtime_check *check)
{
	static const char *const slow[] = {"hpet", "acpi_pm", "pit", "jiffies",
					   "refined-jiffies"};
	int64_t resolution_ns = j->answers->clock_resolution_ns;
	char source[32];

	check->ok = true;
	if (resolution_ns > 1000) {
		check->ok = false;
		set_found(check,
			  "timers have a resolution of only %.3g ms: the kernel was "
			  "started with highres=off, or lacks a better clock",
			  (double)resolution_ns * 1e-6);
		return;
	}
	if (!read_realtime_checks_line(j, CLOCKSOURCE "current_clocksource", source,
				       sizeof(source)))
		snprintf(source, sizeof(source), "unknown");
	for (size_t i = 0; i < sizeof(slow) / sizeof(*slow); i++)
		check->ok &= !!strcmp(source, slow[i]);
	if (check->ok) {
		set_found(check, "%s", source);
	} else {
		set_found(check,
			  "%s: reading it needs a system call, about a microsecond or "
			  "more per tick",
			  source);
		set_fix(check, "cat " CLOCKSOURCE "available_clocksource");
	}
}

static void check_isolated(const struct judgement *j, struct incise_realtime_check *check)
{
	int cpu = j->setup->cpu;
	char cpus[256];

	check->ok = read_realtime_checks_line(j, CPUS "isolated", cpus, sizeof(cpus)) &&
		    proc_file_lists(cpus, cpu);
	if (check->ok) {
		set_found(check, "CPU %d is isolated", cpu);
		return;
	}
	set_found(check,
		  "CPU %d is not isolated: other programs run on it, too (then: "
		  "reboot)",
		  cpu);
	set_fix(check,
		"echo 'GRUB_CMDLINE_LINUX=\"$GRUB_CMDLINE_LINUX "
		"isolcpus=managed_irq,domain,%d nohz_full=%d\"' | sudo tee "
		"/etc/default/grub.d/incise.cfg && sudo update-grub",
		cpu, cpu);
}

static const struct {
	const char *name;
	void (*look)(const struct judgement *j, struct incise_realtime_check *check);
	bool needed, of_cpu;
} looks[] = {
	{"scheduling", check_scheduling, true, false},
	{"memory", check_memory, true, false},
	{"cpu", check_cpu, true, true},
	{"kernel", check_kernel, false, false},
	{"throttling", check_throttling, false, false},
	{"governor", check_governor, false, false},
	{"idle", check_idle, false, false},
	{"clock", check_clock, false, false},
	{"isolated", check_isolated, false, true},
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

/* Append a text, each only once. */
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
	/* mlock(2) returns ENOMEM for a missing right. */
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
	/* Half a command is worse than none. */
	if (err && *keeps &&
	    (size_t)length + strlen(keeps) + sizeof("; to make it permanent: ``") <=
		    sizeof(err->text))
		snprintf(text + length, sizeof(text) - (size_t)length,
			 "; to make it permanent: `%s`", keeps);
	return incise_error_set(err, error, "%s", text);
}
