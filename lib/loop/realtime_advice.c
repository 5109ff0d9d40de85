// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What makes a loop late though nothing is denied: what the kernel's files say of it, in
 * words and commands; see realtime_checks.h.
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include "proc_file.h"
#include "realtime_checks.h"

#define CLOCKSOURCE "/sys/devices/system/clocksource/clocksource0/"

void realtime_check_kernel(const struct judgement *j, struct incise_realtime_check *check)
{
	char text[16];

	check->ok = realtime_line(j, "/sys/kernel/realtime", text, sizeof(text)) &&
		    !strcmp(text, "1");
	if (check->ok) {
		realtime_found(check, "PREEMPT_RT");
		return;
	}
	realtime_found(
		check,
		"not PREEMPT_RT: a busy kernel makes wake-ups late (then: reboot)");
#if defined(__x86_64__)
	realtime_fix(check, "sudo apt-get install linux-image-rt-amd64");
#elif defined(__aarch64__)
	realtime_fix(check, "sudo apt-get install linux-image-rt-arm64");
#endif
}

/*
 * That a loop which hangs leaves some of a CPU to others is welcome; one whose ticks are
 * kept waiting by it is not.
 */
void realtime_check_throttling(const struct judgement *j,
			       struct incise_realtime_check *check)
{
	char text[32];
	long long runtime_us, period_us;

	check->ok = true;
	if (!realtime_line(j, "/proc/sys/kernel/sched_rt_runtime_us", text,
			   sizeof(text))) {
		realtime_found(check, "the kernel has none");
		return;
	}
	if (!proc_file_integer(text, &runtime_us) || runtime_us < -1)
		runtime_us = 0;
	if (!realtime_line(j, "/proc/sys/kernel/sched_rt_period_us", text,
			   sizeof(text)) ||
	    !proc_file_integer(text, &period_us) || period_us < 1)
		period_us = 1000000;
	if (runtime_us == -1) {
		realtime_found(check, "off: only RLIMIT_RTTIME ends a loop that hangs");
		return;
	}
	check->ok = runtime_us >= 0.9 * (double)period_us;
	realtime_found(check, "real-time threads have %.0f %% of a CPU at most",
		       100 * (double)runtime_us / (double)period_us);
	if (check->ok)
		return;
	realtime_fix(check, "sudo sysctl -w kernel.sched_rt_period_us=1000000 "
			    "kernel.sched_rt_runtime_us=950000");
	realtime_keep(check, "printf 'kernel.sched_rt_period_us=1000000\\n"
			     "kernel.sched_rt_runtime_us=950000\\n' | "
			     "sudo tee /etc/sysctl.d/60-incise.conf");
}

/* Of the CPU of the set-up, or of all. */
void realtime_check_governor(const struct judgement *j,
			     struct incise_realtime_check *check)
{
	char online[256], path[128], text[32], other[32] = "";
	int seen = 0, slow = 0, of = -1;

	if (!realtime_line(j, CPUS "online", online, sizeof(online)))
		snprintf(online, sizeof(online), "0");
	for (int cpu = 0; cpu < 1024; cpu++) {
		if (j->setup->cpu >= 0 ? cpu != j->setup->cpu
				       : !proc_file_lists(online, cpu))
			continue;
		snprintf(path, sizeof(path), CPUS "cpu%d/cpufreq/scaling_governor", cpu);
		if (!realtime_line(j, path, text, sizeof(text)))
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
		realtime_found(check, "the kernel does not change frequencies here");
	} else if (!slow) {
		realtime_found(check, "performance");
	} else {
		realtime_found(check,
			       "%s, of CPU %d and %d others: it slows down between ticks",
			       other, of, slow - 1);
		realtime_fix(check,
			     "echo performance | sudo tee "
			     "/sys/devices/system/cpu/cpu*/cpufreq/scaling_governor");
		realtime_keep(
			check,
			"echo 'w /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor - - "
			"- - performance' | sudo tee /etc/tmpfiles.d/incise-governor.conf");
	}
}

void realtime_check_idle(const struct judgement *j, struct incise_realtime_check *check)
{
	int error = j->answers->idle_error;
	char driver[32];

	check->ok = true;
	if (!realtime_line(j, CPUS "cpuidle/current_driver", driver, sizeof(driver)) ||
	    !strcmp(driver, "none")) {
		realtime_found(check, "the kernel knows no deep idle states here");
	} else if (!error) {
		realtime_found(check, "/dev/cpu_dma_latency can be held at 0");
	} else {
		check->ok = false;
		realtime_found(
			check,
			"/dev/cpu_dma_latency: %s: deep idle states make wake-ups late",
			strerror(error));
		if (error != EACCES && error != EPERM)
			return;
		realtime_fix(check, "sudo chown $USER /dev/cpu_dma_latency");
		realtime_keep(
			check,
			"echo 'KERNEL==\"cpu_dma_latency\", GROUP=\"incise\", "
			"MODE=\"0660\"' | sudo tee /etc/udev/rules.d/70-incise-latency.rules "
			"&& sudo udevadm trigger /dev/cpu_dma_latency && sudo usermod -aG "
			"incise $USER");
	}
}

void realtime_check_clock(const struct judgement *j, struct incise_realtime_check *check)
{
	static const char *const slow[] = {"hpet", "acpi_pm", "pit", "jiffies",
					   "refined-jiffies"};
	int64_t resolution_ns = j->answers->clock_resolution_ns;
	char source[32];

	check->ok = true;
	if (resolution_ns > 1000) {
		check->ok = false;
		realtime_found(
			check,
			"timers come every %.3g ms only: the kernel was started with "
			"highres=off, or its clock cannot do better",
			(double)resolution_ns * 1e-6);
		return;
	}
	if (!realtime_line(j, CLOCKSOURCE "current_clocksource", source, sizeof(source)))
		snprintf(source, sizeof(source), "unknown");
	for (size_t i = 0; i < sizeof(slow) / sizeof(*slow); i++)
		check->ok &= !!strcmp(source, slow[i]);
	if (check->ok) {
		realtime_found(check, "%s", source);
	} else {
		realtime_found(
			check,
			"%s: to read it takes a system call, about a microsecond or "
			"more of each tick",
			source);
		realtime_fix(check, "cat " CLOCKSOURCE "available_clocksource");
	}
}

void realtime_check_isolated(const struct judgement *j,
			     struct incise_realtime_check *check)
{
	int cpu = j->setup->cpu;
	char cpus[256];

	check->ok = realtime_line(j, CPUS "isolated", cpus, sizeof(cpus)) &&
		    proc_file_lists(cpus, cpu);
	if (check->ok) {
		realtime_found(check, "CPU %d is kept for those who ask for it", cpu);
		return;
	}
	realtime_found(check,
		       "CPU %d is not isolated: others run on it too (then: reboot)",
		       cpu);
	realtime_fix(check,
		     "echo 'GRUB_CMDLINE_LINUX=\"$GRUB_CMDLINE_LINUX "
		     "isolcpus=managed_irq,domain,%d nohz_full=%d\"' | sudo tee "
		     "/etc/default/grub.d/incise.cfg && sudo update-grub",
		     cpu, cpu);
}
