// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The machine that a bench ran on; see machine.h.
 */
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <sys/utsname.h>
#include <incise/version.h>
#include "harness.h"
#include "../cli/json.h"
#include "machine.h"
#if defined(__x86_64__)
#include <cpuid.h>
#endif

/* As the kernel names the first processor; other than x86 has no such line. */
static void read_cpu(char *cpu, size_t size)
{
	FILE *in = fopen("/proc/cpuinfo", "re");
	char line[256];

	while (in && fgets(line, sizeof(line), in)) {
		char *at = strchr(line, ':');

		if (strncmp(line, "model name", 10) || !at)
			continue;
		at += 1 + strspn(at + 1, " \t");
		at[strcspn(at, "\n")] = 0;
		snprintf(cpu, size, "%s", at);
		break;
	}
	if (in)
		fclose(in);
}

/* The first line of a small file; empty without it. */
static void read_line(const char *path, char *line, int size)
{
	FILE *in = fopen(path, "re");

	*line = 0;
	if (!in)
		return;
	if (fgets(line, size, in))
		line[strcspn(line, "\n")] = 0;
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
	read_line("/sys/hypervisor/type", name, (int)size);
#endif
}

static void read_kernel(struct machine *m)
{
	struct utsname name;
	char realtime[8];

	if (uname(&name))
		return;
	snprintf(m->kernel, sizeof(m->kernel), "%s %s %s", name.sysname, name.release,
		 name.machine);
	snprintf(m->cpu, sizeof(m->cpu), "%s", name.machine);
	read_line("/sys/kernel/realtime", realtime, sizeof(realtime));
	m->realtime = *realtime == '1' || strstr(name.version, "PREEMPT_RT");
}

static void read_processors(struct machine *m)
{
	cpu_set_t cpus;
	char path[80];

	m->processors = (int)sysconf(_SC_NPROCESSORS_ONLN);
	if (!sched_getaffinity(0, sizeof(cpus), &cpus))
		m->processors = CPU_COUNT(&cpus);
	m->timed_on = harness_cpu();
	snprintf(path, sizeof(path),
		 "/sys/devices/system/cpu/cpu%d/cpufreq/scaling_governor", m->timed_on);
	read_line(path, m->governor, sizeof(m->governor));
}

void machine_init(struct machine *m)
{
	time_t now = time(NULL);
	struct tm utc;

	memset(m, 0, sizeof(*m));
	snprintf(m->version, sizeof(m->version), "%s", INCISE_VERSION);
	snprintf(m->flags, sizeof(m->flags), "%s", BUILD_FLAGS);
#if defined(__clang__)
	snprintf(m->compiler, sizeof(m->compiler), "%s", __VERSION__);
#else
	snprintf(m->compiler, sizeof(m->compiler), "gcc %s", __VERSION__);
#endif
	read_kernel(m);
	read_cpu(m->cpu, sizeof(m->cpu));
	snprintf(m->vectors, sizeof(m->vectors), "none");
#if defined(__x86_64__)
	if (__builtin_cpu_supports("avx2"))
		snprintf(m->vectors, sizeof(m->vectors), "AVX2");
#endif
	read_hypervisor(m->hypervisor, sizeof(m->hypervisor));
	read_processors(m);
	m->memory_MB =
		(double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE) / 1e6;
	if (getloadavg(&m->load_average, 1) < 1)
		m->load_average = -1;
	if (gmtime_r(&now, &utc))
		strftime(m->date, sizeof(m->date), "%Y-%m-%dT%H:%M:%SZ", &utc);
}

static json_t *text_or_null(const char *text)
{
	return *text ? json_text(text) : json_null();
}

json_t *machine_json(const struct machine *m)
{
	json_t *load = m->load_average < 0 ? json_null() : json_number(m->load_average);

	return json_pack("{ss so so so ss ss sb so so si si so so ss}", "version",
			 m->version, "cpu", json_text(m->cpu), "compiler",
			 json_text(m->compiler), "flags", json_text(m->flags), "kernel",
			 m->kernel, "vectors", m->vectors, "preempt_rt", m->realtime,
			 "hypervisor", text_or_null(m->hypervisor), "governor",
			 text_or_null(m->governor), "processors", m->processors,
			 "timed_on", m->timed_on, "memory_MB", json_number(m->memory_MB),
			 "load_average", load, "date", m->date);
}
