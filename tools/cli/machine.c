// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The machine that a bench ran on; see machine.h.
 */
#include <math.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <sys/utsname.h>
#include <incise/version.h>
#include "json.h"
#include "machine.h"
#if defined(__x86_64__)
#include <cpuid.h>
#endif

void machine_line(const char *path, const char *key, char *line, int size)
{
	FILE *in = fopen(path, "re");
	char text[256];

	while (in && fgets(text, sizeof(text), in))
		if (!strncmp(text, key, strlen(key))) {
			text[strcspn(text, "\n")] = 0;
			snprintf(line, (size_t)size, "%s", text + strlen(key));
			break;
		}
	if (in)
		fclose(in);
}

static void read_hypervisor(char *name, size_t size)
{
#if defined(__x86_64__)
	unsigned int eax, word[4] = {0};

	if (__get_cpuid(1, &eax, &word[0], &word[1], &word[2]) && word[1] >> 31) {
		__cpuid(0x40000000, eax, word[0], word[1], word[2]);
		word[3] = 0;
		/* Twelve letters, or fewer and then zeros. */
		snprintf(name, size, "%s", *(char *)word ? (char *)word : "unnamed");
	}
#else
	machine_line("/sys/hypervisor/type", "", name, (int)size);
#endif
}

/* Also whether it has PREEMPT_RT; and the kind of processor, where /proc/cpuinfo has no name. */
static void set_kernel(json_t *machine)
{
	char cpu[128] = "", kernel[200] = "", realtime[8] = "";
	struct utsname name = {0};

	if (!uname(&name)) {
		snprintf(kernel, sizeof(kernel), "%s %s %s", name.sysname, name.release,
			 name.machine);
		snprintf(cpu, sizeof(cpu), "%s", name.machine);
		machine_line("/sys/kernel/realtime", "", realtime, sizeof(realtime));
	}
	/* Other than x86 has no such line. */
	machine_line("/proc/cpuinfo", "model name\t: ", cpu, sizeof(cpu));
	json_object_set_new(machine, "cpu", json_text(cpu));
	json_object_set_new(machine, "kernel", json_string(kernel));
	json_object_set_new(machine, "preempt_rt",
			    json_boolean(*realtime == '1' ||
					 strstr(name.version, "PREEMPT_RT")));
}

int machine_cpu(void)
{
	cpu_set_t set;
	int last = 0;

	if (sched_getaffinity(0, sizeof(set), &set))
		return 0;
	for (int i = 0; i < CPU_SETSIZE; i++)
		if (CPU_ISSET(i, &set))
			last = i;
	return last;
}

/* Processors that are granted to this process, and the governor of the timed one. */
static void set_processors(json_t *machine)
{
	int cpu = machine_cpu(), n = (int)sysconf(_SC_NPROCESSORS_ONLN);
	char path[80], governor[32] = "";
	cpu_set_t cpus;

	if (!sched_getaffinity(0, sizeof(cpus), &cpus))
		n = CPU_COUNT(&cpus);
	snprintf(path, sizeof(path),
		 "/sys/devices/system/cpu/cpu%d/cpufreq/scaling_governor", cpu);
	machine_line(path, "", governor, sizeof(governor));
	if (*governor)
		json_object_set_new(machine, "governor", json_text(governor));
	json_set_integer(machine, "processors", n);
	json_set_integer(machine, "timed_on", cpu);
}

static const char *vectors(void)
{
#if defined(__x86_64__)
	if (__builtin_cpu_supports("avx2"))
		return "AVX2";
#endif
	return "none";
}

json_t *machine_json(void)
{
#if defined(__clang__)
	static const char compiler[] = __VERSION__;
#else
	static const char compiler[] = "gcc " __VERSION__;
#endif
	double load = NAN, pages = (double)sysconf(_SC_PHYS_PAGES);
	char hypervisor[32] = "", date[32] = "";
	time_t now = time(NULL);
	json_t *machine;
	struct tm utc;

	if (getloadavg(&load, 1) < 1)
		load = NAN;
	if (gmtime_r(&now, &utc))
		strftime(date, sizeof(date), "%Y-%m-%dT%H:%M:%SZ", &utc);
	read_hypervisor(hypervisor, sizeof(hypervisor));
	/* In the order of incise-bench(1); those that are null here are set below. */
	machine = json_pack("{ss sn so so sn ss sn so? sn sn sn so so ss}", "version",
			    INCISE_VERSION, "cpu", "compiler", json_text(compiler),
			    "flags", json_text(BUILD_FLAGS), "kernel", "vectors",
			    vectors(), "preempt_rt", "hypervisor",
			    *hypervisor ? json_text(hypervisor) : NULL, "governor",
			    "processors", "timed_on", "memory_MB",
			    json_number(pages * (double)sysconf(_SC_PAGESIZE) / 1e6),
			    "load_average", json_number(load), "date", date);
	set_kernel(machine);
	set_processors(machine);
	return machine;
}
