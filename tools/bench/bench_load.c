// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What keeps the machine busy; see bench_load.h.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include "bench_load.h"
#include "../cli/child.h"
#include "../cli/cli.h"
#include "../cli/folder.h"

#define UNDER_WAY_US 500000
#define BLEEDING_S 4
#define LONGER_S 30 /* than it is needed: the end of one whose bench was killed */

/* One worker per processor, and one at the disk. */
static const struct {
	const char *name;
	const char *arguments[6]; /* of stress-ng */
} loads[LOADS] = {
	[LOAD_IDLE] = {"idle", {NULL}},
	[LOAD_CPU] = {"cpu", {"--cpu", "0"}},
	[LOAD_MEMORY] = {"memory", {"--vm", "0", "--vm-bytes", "128m"}},
	[LOAD_DISK] = {"disk", {"--hdd", "1", "--hdd-bytes", "64m"}},
	[LOAD_VIEW] = {"view", {NULL}},
};

const char *load_name(enum load load)
{
	return loads[load].name;
}

static const char *begin_stress(enum load load, double seconds, struct load_run *run)
{
	const char *argv[16] = {"stress-ng", "--quiet", "--timeout"};
	char time[24];
	int n = 3;

	if (!child_possible("stress-ng"))
		return "stress-ng is not installed: apt-get install stress-ng";
	snprintf(time, sizeof(time), "%.0f", seconds + LONGER_S);
	argv[n++] = time;
	for (int i = 0; i < 6 && loads[load].arguments[i]; i++)
		argv[n++] = loads[load].arguments[i];
	/* It makes a folder there for any of its workers. */
	folder_make(run->folder, sizeof(run->folder), "to keep the disk busy in");
	argv[n++] = "--temp-path";
	argv[n++] = run->folder;
	run->pid = child_start((char *const *)argv, -1, -1);
	return NULL;
}

static const char *begin_view(const char *scene, double seconds, struct load_run *run)
{
	char path[PATH_MAX + 20], time[24];
	const char *argv[] = {path,	    scene, "--procedure", "--no-output",
			      "--duration", time,  NULL};

	snprintf(path, sizeof(path), "%s/incise-view", cli_folder());
	if (access(path, X_OK))
		return "incise-view is not there";
	snprintf(time, sizeof(time), "%.0f", seconds + LONGER_S);
	run->said = memory_file_begin("view");
	run->pid = child_start((char *const *)argv, fileno(run->said.file), -1);
	/* Until the skin is painted and the cut bleeds. */
	sleep(BLEEDING_S);
	return NULL;
}

const char *load_begin(enum load load, const char *scene, double seconds,
		       struct load_run *run)
{
	const char *why;
	int status;

	*run = (struct load_run){0};
	if (load == LOAD_IDLE)
		return NULL;
	why = load == LOAD_VIEW ? begin_view(scene, seconds, run)
				: begin_stress(load, seconds, run);
	if (why)
		return why;
	usleep(UNDER_WAY_US);
	if (child_ended(run->pid, &status)) {
		run->pid = 0;
		load_end(run);
		return "it ended at once; run it by hand to see why";
	}
	return NULL;
}

double load_end(struct load_run *run)
{
	double frames_hz = NAN;

	if (run->pid)
		child_end(run->pid, 0);
	if (run->said.file) {
		rewind(run->said.file);
		if (fscanf(run->said.file, "%lf", &frames_hz) != 1)
			frames_hz = NAN;
		fclose(run->said.file);
	}
	if (*run->folder)
		folder_remove(run->folder);
	*run = (struct load_run){0};
	return frames_hz;
}
