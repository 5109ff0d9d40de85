// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Memory and mapped libraries of programs; see process_cost.h.
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
#include "../cli/mapped_libraries.h"
#include "process_cost.h"

/* --- a loop's process --- */

#define LOOK_US 20000

/* Long enough that it is looked at some times while it loops. */
#define RUN "0.4s"

void loop_process_start(struct loop_process *process, const char *scene)
{
	char *program = cli_text("%s/incise-haptic", cli_folder());
	char *argv[] = {program, (char *)scene, "--rig", "sim:",   "--no-rt", "--state",
			"none",	 "--duration",	RUN,	 "--json", NULL};

	*process = (struct loop_process){.report = memory_file_begin("report")};
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

#define TARGET_BYTES 4096

/* Where a descriptor of a process leads; "" if it is none. */
static void read_descriptor(pid_t pid, const char *name, char target[TARGET_BYTES])
{
	char path[320];
	ssize_t length;

	snprintf(path, sizeof(path), "/proc/%d/fd/%s", (int)pid, name);
	length = readlink(path, target, TARGET_BYTES - 1);
	target[length > 0 ? length : 0] = 0;
}

/* Beyond standard input and output, and what it was started with, which we have too. */
static json_t *open_files(pid_t pid)
{
	json_t *list = json_array();
	char path[64], target[TARGET_BYTES], ours[TARGET_BYTES];
	struct dirent *entry;
	DIR *folder;

	snprintf(path, sizeof(path), "/proc/%d/fd", (int)pid);
	folder = opendir(path);
	while (folder && (entry = readdir(folder))) {
		if (atoi(entry->d_name) < 3)
			continue;
		read_descriptor(pid, entry->d_name, target);
		read_descriptor(getpid(), entry->d_name, ours);
		if (*target && strcmp(ours, target))
			json_array_append_new(list, json_text(target));
	}
	if (folder)
		closedir(folder);
	return list;
}

/* Look at a process while it is there; its libraries and files are gone before it. */
static void look(struct loop_process *process)
{
	json_t *libraries = mapped_libraries(process->pid);
	json_t *files = open_files(process->pid);
	long own_KiB = number(process->pid, "smaps_rollup", "Private_");
	/* Last: of a process that has ended meanwhile it is none. */
	long peak_KiB = number(process->pid, "status", "VmHWM");

	/* Before it is the loop it is what starts it, and has less. */
	if (!peak_KiB || !json_array_size(libraries) ||
	    json_array_size(libraries) < json_array_size(process->libraries)) {
		json_decref(libraries);
		json_decref(files);
		return;
	}
	json_decref(process->libraries);
	json_decref(process->files);
	process->libraries = libraries;
	process->files = files;
	process->peak_KiB = peak_KiB;
	process->own_KiB = own_KiB;
}

/* Read from its report which devices its stages use. */
static void take_report(struct loop_process *process)
{
	json_t *report, *stages, *stage;
	size_t i;

	rewind(process->report.file);
	report = json_loadf(process->report.file, 0, NULL);
	stages = json_object_get(report, "stages");
	if (stages)
		process->devices = json_array();
	else
		snprintf(process->failed, sizeof(process->failed),
			 "its loop gave no report");
	json_array_foreach(stages, i, stage)
	{
		if (!strcmp(json_string_value(stage), "pose"))
			json_array_append_new(process->devices, json_string("tracker"));
		else if (!strcmp(json_string_value(stage), "actuate"))
			json_array_append_new(process->devices, json_string("stepper"));
	}
	json_decref(report);
}

static void ended(struct loop_process *process, int status)
{
	process->pid = 0;
	if (!WIFEXITED(status) || WEXITSTATUS(status))
		snprintf(
			process->failed, sizeof(process->failed),
			"its loop fails on the simulated rig; run incise haptic to see the reason");
	else if (!process->libraries)
		snprintf(process->failed, sizeof(process->failed),
			 "its loop was not seen in /proc");
	else
		take_report(process);
}

void loop_processes_watch(struct loop_process *const *processes, int n)
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
