// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise COMMAND …: runs incise-COMMAND, the one next to this program first, then the one on
 * PATH, so that anyone can add a command. Where there is a program
 * incise-COMMAND-SUBCOMMAND next to this one, incise COMMAND SUBCOMMAND … runs that.
 */
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/error.h>
#include <incise/version.h>
#include "cli/cli.h"

#define LETTERS "abcdefghijklmnopqrstuvwxyz"

static const struct {
	const char *name, *does;
} commands[] = {
	{"calibrate", "measure what turns readings into mm, N and s"},
	{"capture", "record the streams of a rig in sync"},
	{"verify", "prove that a recording is complete"},
	{"export", "make a dataset of recordings, raw or averaged"},
	{"train", "learn a fuzzy force model from a dataset"},
	{"compile", "turn a model or a scene into integers with a certified error"},
	{"eval", "print the force of a model at given depth and velocity"},
	{"info", "say what a recording, model, plan or stepper module holds"},
	{"plan", "show what a scene runs and what it leaves out"},
	{"haptic", "run the real-time loop of a scene"},
	{"feed", "let the kernel render a scene, and hand it the poses"},
	{"status", "say what the loops on this machine do, or did last"},
	{"tool", "set or print the tool in the hand of a running loop"},
	{"view", "show a scene: tissue, wound, blood, instrument"},
	{"assess", "report what happened in sessions, against criteria"},
	{"replay", "run the loop on a recording, predicted beside measured"},
	{"stepper", "look at the actuator and move it by hand"},
	{"bench", "measure error against run time"},
	{"demo", "walk the whole path on the virtual rig"},
};

static void help(void)
{
	printf("Usage: incise VERB [ARGUMENTS]\n\n"
	       "A toolkit for haptic cutting: record, model and render how tissue resists a "
	       "scalpel.\n\nVerbs:\n");
	for (size_t i = 0; i < sizeof(commands) / sizeof(*commands); i++)
		printf("  %-10s %s\n", commands[i].name, commands[i].does);
	printf("\n'incise VERB --help' lists a verb's options, 'incise help VERB' opens its "
	       "manual.\n'incise demo' is a good start.\n");
}

/* Whether PATH leads to a file of this name, runnable or not. */
static bool on_path(const char *name)
{
	const char *path = getenv("PATH");
	char *folders = strdup(path ? path : ""), *save, *file;
	bool found = false;

	for (char *folder = strtok_r(folders, ":", &save); folder && !found;
	     folder = strtok_r(NULL, ":", &save)) {
		if (asprintf(&file, "%s/%s", folder, name) < 0)
			break;
		found = !access(file, F_OK);
		free(file);
	}
	free(folders);
	errno = EACCES;
	return found;
}

static bool known(const char *command)
{
	for (size_t i = 0; i < sizeof(commands) / sizeof(*commands); i++)
		if (!strcmp(command, commands[i].name))
			return true;
	return false;
}

/* The manual page, from the source tree when this runs in a build tree. */
static int manual(const char *command, const char *subcommand)
{
	char folder[PATH_MAX];
	char *name, *page;

	snprintf(folder, sizeof(folder), "%s", cli_folder());
	if (command && !known(command)) {
		fprintf(stderr,
			"incise: there is no verb '%.64s'; 'incise --help' lists them\n",
			command);
		return 2;
	}
	if (asprintf(&name, "incise%s%s%s%.64s", command ? "-" : "",
		     command ? command : "", subcommand ? "-" : "",
		     subcommand ? subcommand : "") < 0 ||
	    asprintf(&page, "%s/../../man/%s.1", folder, name) < 0)
		return 1;
	if (!access(page, R_OK))
		execlp("man", "man", page, (char *)NULL);
	else
		execlp("man", "man", name, (char *)NULL);
	fprintf(stderr, "incise: man: %s; try 'incise %s --help'\n", strerror(errno),
		command ? command : "");
	return 1;
}

static int finish(void)
{
	if (!fflush(stdout))
		return 0;
	fprintf(stderr, "incise: standard output: %s\n", strerror(errno));
	return 1;
}

/*
 * A program whose libraries are only recommended may lack one, which ld.so reports without the
 * package. Load them here first, and say which.
 */
static bool has_libraries(const char *program)
{
	const char *name = strrchr(program, '/');
	struct incise_error err = {0};

	name = name ? name + 1 : program;
	if ((strcmp(name, "incise-view") && strcmp(name, "incise-bench-view")) ||
	    dlopen(VIEW_LIBRARY, RTLD_LAZY | RTLD_LOCAL))
		return true;
	incise_error_library(&err, name + strlen("incise-"), dlerror());
	fprintf(stderr, "incise %s\n", err.text);
	return false;
}

int main(int argc, char **argv)
{
	const char *command = argv[1];
	char folder[PATH_MAX], program[PATH_MAX + 80];

	if (argc < 2) {
		fprintf(stderr, "incise: which verb? 'incise --help' lists them\n");
		return 2;
	}
	if (!strcmp(command, "-h") || !strcmp(command, "--help")) {
		help();
		return finish();
	}
	if (!strcmp(command, "-V") || !strcmp(command, "--version")) {
		printf("incise %s\n", incise_version());
		return finish();
	}
	if (!strcmp(command, "help")) {
		if (argc > 2)
			return manual(argv[2], argv[3]);
		help();
		return finish();
	}
	if (strchr(command, '/') || *command == '-' || strlen(command) > 64) {
		fprintf(stderr,
			"incise: '%.64s' is no verb; 'incise --help' lists them\n",
			command);
		return 2;
	}
	snprintf(folder, sizeof(folder), "%s", cli_folder());
	if (argc > 2 && argv[2][strspn(argv[2], LETTERS)] == 0 && *argv[2]) {
		snprintf(program, sizeof(program), "%s/incise-%s-%.64s", folder, command,
			 argv[2]);
		if (!access(program, X_OK)) {
			if (!has_libraries(program))
				return 1;
			execv(program, argv + 2);
		}
	}
	snprintf(program, sizeof(program), "%s/incise-%s", folder, command);
	if (!access(program, X_OK) && !has_libraries(program))
		return 1;
	execv(program, argv + 1);
	snprintf(program, sizeof(program), "incise-%s", command);
	if (errno == ENOENT)
		execvp(program, argv + 1);
	/* A folder on PATH that may not be searched makes execvp say EACCES as well. */
	if (errno == ENOENT || (errno == EACCES && !on_path(program))) {
		fprintf(stderr,
			"incise: there is no verb '%s'; 'incise --help' lists them\n",
			command);
		return 2;
	}
	fprintf(stderr, "incise: %s: %s\n", program, strerror(errno));
	return 1;
}
