// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The machine that a bench ran on; see machine.h.
 */
#include <stdio.h>
#include <string.h>
#include <sys/utsname.h>
#include "machine.h"

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

void machine_init(struct machine *m)
{
	struct utsname name;

	memset(m, 0, sizeof(*m));
	if (!uname(&name)) {
		snprintf(m->kernel, sizeof(m->kernel), "%s %s %s", name.sysname,
			 name.release, name.machine);
		snprintf(m->cpu, sizeof(m->cpu), "%s", name.machine);
	}
	read_cpu(m->cpu, sizeof(m->cpu));
#if defined(__clang__)
	snprintf(m->compiler, sizeof(m->compiler), "%s", __VERSION__);
#else
	snprintf(m->compiler, sizeof(m->compiler), "gcc %s", __VERSION__);
#endif
	snprintf(m->vectors, sizeof(m->vectors), "none");
#if defined(__x86_64__)
	if (__builtin_cpu_supports("avx2"))
		snprintf(m->vectors, sizeof(m->vectors), "AVX2");
#endif
}

json_t *machine_json(const struct machine *m)
{
	return json_pack("{ss ss ss ss}", "cpu", m->cpu, "compiler", m->compiler,
			 "kernel", m->kernel, "vectors", m->vectors);
}
