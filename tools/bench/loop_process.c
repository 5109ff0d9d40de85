// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A haptic loop's process; see loop_process.h.
 */
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include "../cli/child.h"
#include "../cli/cli.h"
#include "../cli/json.h"
#include "loop_process.h"
#include "../cli/mapped_libraries.h"

#define LOOK_US 20000

/* Long enough that it is looked at some times while it loops. */
#define RUN "0.4s"

void loop_process_begin(struct loop_process *process, const char *scene)
{
	char program[4096];
	char *argv[] = {program, (char *)scene, "--rig", "sim:",   "--no-rt", "--state",
			"none",	 "--duration",	RUN,	 "--json", NULL};

	*process = (struct loop_process){.report = memory_file_begin("report")};
	snprintf(program, sizeof(program), "%s/incise-haptic", cli_folder());
	process->pid = child_start(argv, fileno(process->report.file), -1);
}

/* A number of a file of /proc, in KiB: the sum of its lines with that word. */
static long number(pid_t pid, const char *file, const char *word)
{
	char line[256];
	long sum = 0;
	FILE *in;

	snprintf(line, sizeof(line), "/proc/%d/%s", (int)pid, file);
	in = fopen(line, "re");
	while (in && fgets(line, sizeof(line), in))
		if (!strncmp(line, word, strlen(word)))
			sum += atol(strchr(line, ':') ? strchr(line, ':') + 1 : "");
	if (in)
		fclose(in);
	return sum;
}

static bool same_in_ours(const char *name, const char *target)
{
	char path[64], ours[4096];
	ssize_t length;

	snprintf(path, sizeof(path), "/proc/self/fd/%d", atoi(name));
	length = readlink(path, ours, sizeof(ours) - 1);
	if (length < 0)
		return false;
	ours[length] = 0;
	return !strcmp(ours, target);
}

/* Beyond standard input and output, and what it was started with, which we have too. */
static json_t *open_files(pid_t pid)
{
	json_t *list = json_array();
	char path[320], target[4096];
	struct dirent *entry;
	ssize_t length;
	DIR *folder;

	snprintf(path, sizeof(path), "/proc/%d/fd", (int)pid);
	folder = opendir(path);
	while (folder && (entry = readdir(folder))) {
		snprintf(path, sizeof(path), "/proc/%d/fd/%s", (int)pid, entry->d_name);
		length = readlink(path, target, sizeof(target) - 1);
		if (length < 0 || atoi(entry->d_name) < 3)
			continue;
		target[length] = 0;
		if (!same_in_ours(entry->d_name, target))
			json_array_append_new(list, json_text(target));
	}
	if (folder)
		closedir(folder);
	return list;
}

static void keep_last(json_t **kept, json_t *seen)
{
	json_decref(*kept);
	*kept = seen;
}

/* What was seen of a process that is still there; libraries and files are gone before it. */
static void look(struct loop_process *process)
{
	json_t *libraries = mapped_libraries(process->pid);
	long peak_KiB = number(process->pid, "status", "VmHWM");

	/* Before it is the loop it is what starts it, and has less. */
	if (!peak_KiB || !json_array_size(libraries) ||
	    json_array_size(libraries) < json_array_size(process->libraries)) {
		json_decref(libraries);
		return;
	}
	keep_last(&process->libraries, libraries);
	keep_last(&process->files, open_files(process->pid));
	process->peak_KiB = peak_KiB;
	process->own_KiB = number(process->pid, "smaps_rollup", "Private_");
}

static bool in(const json_t *list, const char *word)
{
	for (size_t i = 0; i < json_array_size(list); i++) {
		const char *text = json_string_value(json_array_get(list, i));

		if (text && !strcmp(text, word))
			return true;
	}
	return false;
}

/* What its report says of its stages. */
static void take_report(struct loop_process *process)
{
	json_t *report, *stages;

	rewind(process->report.file);
	report = json_loadf(process->report.file, 0, NULL);
	stages = json_object_get(report, "stages");
	if (!stages) {
		snprintf(process->failed, sizeof(process->failed),
			 "its loop gave no report");
	} else {
		process->devices = json_array();
		if (in(stages, "pose"))
			json_array_append_new(process->devices, json_string("tracker"));
		if (in(stages, "actuate"))
			json_array_append_new(process->devices, json_string("stepper"));
	}
	json_decref(report);
}

static void ended(struct loop_process *process, int status)
{
	process->pid = 0;
	if (!WIFEXITED(status) || WEXITSTATUS(status))
		snprintf(process->failed, sizeof(process->failed),
			 "its loop fails on the virtual rig: incise haptic says why");
	else if (!process->libraries)
		snprintf(process->failed, sizeof(process->failed),
			 "its loop was not seen in /proc");
	else
		take_report(process);
}

void loop_process_watch(struct loop_process *const *processes, int n)
{
	int running, status;

	do {
		running = 0;
		for (int i = 0; i < n; i++) {
			struct loop_process *process = processes[i];

			if (!process->pid)
				continue;
			look(process);
			if (child_ended(process->pid, &status))
				ended(process, status);
			else
				running++;
		}
		usleep(LOOK_US);
	} while (running && !cli_stop);
	for (int i = 0; i < n; i++)
		if (processes[i]->pid)
			ended(processes[i], child_end(processes[i]->pid, 0));
}

void loop_process_free(struct loop_process *process)
{
	json_decref(process->libraries);
	json_decref(process->files);
	json_decref(process->devices);
	if (process->report.file)
		fclose(process->report.file);
}
