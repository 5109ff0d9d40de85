// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Instructions of a program; see instructions.h.
 */
#include <linux/perf_event.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>
#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#endif
#include "../cli/child.h"
#include "../cli/cli.h"
#include "instructions.h"

#define ARGUMENTS_MOST 16
/* Without its header at hand the program cannot say where to begin: it takes longer. */
#ifdef CALLGRIND_START_INSTRUMENTATION
#define FROM "--instr-atstart=no"
#else
#define FROM "--instr-atstart=yes"
#define CALLGRIND_START_INSTRUMENTATION
#endif

#define WAIT_S 120 /* callgrind takes some fifty times as long as the program */

bool instructions_open(struct instruction_counter *counter)
{
	struct perf_event_attr attr = {
		.type = PERF_TYPE_HARDWARE,
		.size = sizeof(attr),
		.config = PERF_COUNT_HW_INSTRUCTIONS,
		.exclude_kernel = 1,
		.exclude_hv = 1,
	};

	*counter = (struct instruction_counter){0};
	counter->fd =
		(int)syscall(SYS_perf_event_open, &attr, 0, -1, -1, PERF_FLAG_FD_CLOEXEC);
	if (counter->fd < 0)
		return false;
	instructions_begin(counter);
	instructions_end(counter);
	counter->empty = counter->sum;
	counter->sum = 0;
	return true;
}

static uint64_t now(const struct instruction_counter *counter)
{
	uint64_t value = 0;

	return read(counter->fd, &value, sizeof(value)) == sizeof(value) ? value : 0;
}

void instructions_begin(struct instruction_counter *counter)
{
	counter->begun = now(counter);
}

void instructions_end(struct instruction_counter *counter)
{
	counter->sum += now(counter) - counter->begun - counter->empty;
}

double instructions_close(struct instruction_counter *counter)
{
	close(counter->fd);
	return (double)counter->sum;
}

void callgrind_begin(struct callgrind *callgrind, const char *function,
		     char *const argv[])
{
	char toggle[100], out[100];
	/* Without vgdb there are no files of it in TMPDIR, which stay where it is killed. */
	char *all[ARGUMENTS_MOST] = {
		"valgrind", "-q", "--tool=callgrind", "--vgdb=no", FROM, toggle, out};
	int n = 7;

	callgrind->report = memory_file_begin("callgrind");
	snprintf(toggle, sizeof(toggle), "--toggle-collect=%s", function);
	/* Of this process: valgrind makes its files out of the program's sight. */
	snprintf(out, sizeof(out), "--callgrind-out-file=/proc/%d/fd/%d", (int)getpid(),
		 fileno(callgrind->report.file));
	for (int i = 0; argv[i] && n < ARGUMENTS_MOST - 1; i++)
		all[n++] = argv[i];
	callgrind->pid = child_start(all, -1, -1);
}

void callgrind_here(void)
{
	CALLGRIND_START_INSTRUMENTATION;
}

double callgrind_end(struct callgrind *callgrind)
{
	int status = child_end(callgrind->pid, WAIT_S);
	double count = NAN;
	char line[1000];

	rewind(callgrind->report.file);
	while (fgets(line, sizeof(line), callgrind->report.file))
		sscanf(line, "totals: %lf", &count);
	fclose(callgrind->report.file);
	return WIFEXITED(status) && !WEXITSTATUS(status) && count > 0 ? count : NAN;
}
