// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise COMMAND …: runs incise-COMMAND, the one next to this program first, then the one on
 * PATH, so that anyone can add a command. Where there is a program
 * incise-COMMAND-SUBCOMMAND next to this one, incise COMMAND SUBCOMMAND … runs that.
 */
#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>
#include <incise/error.h>
#include <incise/version.h>
#include "cli/cli.h"
#include "cli/complete.h"
#include "cli/features.h"
#include "cli/help.h"

#define LETTERS "abcdefghijklmnopqrstuvwxyz"

static const struct {
	const char *name, *does, *group; /* NULL: of the command before */
} commands[] = {
	{"demo", "run the whole path on the simulated rig", "Start"},
	{"init", "write a rig.conf for this machine, and lead through its calibrations"},
	{"doctor", "check this machine and its rig, and print a remedy for each finding"},
	{"calibrate", "measure the scale factors, delays and offsets of a rig", "Record"},
	{"capture", "record the streams of a rig in sync"},
	{"verify", "check that a recording is complete and unaltered"},
	{"train", "learn a fuzzy force model from recordings or datasets", "Learn"},
	{"eval", "print the force of a model at given depth and velocity"},
	{"export", "make a dataset from recordings, raw or averaged"},
	{"haptic", "run the real-time loop of a scene", "Render"},
	{"plan",
	 "show the stages that a scene runs, their cost, and the stability of the scene"},
	{"replay", "run the loop on a recording and compare it with the measured force"},
	{"status", "report the state of the loops on this machine"},
	{"info",
	 "describe a recording, model, scene, rig, stepper module, CAN bus or attached device",
	 "Look"},
	{"plot", "draw a recording, dataset, model, session or calibration"},
	{"view", "show a scene: tissue, wound, blood, instrument"},
	{"assess", "evaluate sessions against the criteria of their scene", "Share"},
	{"serve", "send poses, forces and frames live to other programs"},
	{"sign", "sign and time-stamp a recording"},
	{"stepper", "show the state of the actuator and move it by hand", "Administer"},
	{"bench", "measure error, run time and stability", "Advanced"},
	{"compile", "convert a model or a scene to fixed point with a certified error"},
	{"device", "own a haptic device, so that it gives no force when its user ends"},
	{"feed", "load a scene into the kernel and send it the poses"},
	{"join", "put recordings of several machines on one timeline"},
	{"merge", "make one model of the factors of several laboratories or machines"},
	{"provenance", "print the way from a figure or model back to its recordings"},
	{"recalibrate", "give a recording another calibration after the fact"},
	{"recover",
	 "save what an interrupted recording has, or convert one of an older format"},
	{"tool", "set or print the tool in the hand of a running loop"},
};

#define COMMANDS (sizeof(commands) / sizeof(*commands))
#define ADVANCED "Advanced"

/* The commands in groups: all but the advanced ones, or these. */
static void list_commands(bool advanced)
{
	const char *group = NULL;

	for (size_t i = 0; i < COMMANDS; i++) {
		char *line;

		group = commands[i].group ? commands[i].group : group;
		if (advanced != !strcmp(group, ADVANCED))
			continue;
		if (commands[i].group)
			printf("%s%s:\n", advanced ? "" : "\n", group);
		line = cli_text("  %-11s  %s", commands[i].name, commands[i].does);
		help_print_text(line, 0, 0);
		free(line);
	}
}

static void help(void)
{
	help_print_text("Usage: incise COMMAND [ARGUMENTS]\n", 0, 0);
	putchar('\n');
	help_print_text(
		"A toolkit for haptic cutting: record, model and render how tissue "
		"resists a scalpel.",
		0, 0);
	list_commands(false);
	putchar('\n');
	help_print_text(
		"'incise COMMAND --help' lists the options of a command, 'incise "
		"help COMMAND' opens its manual, 'incise help advanced' lists what few "
		"need: several machines, old recordings, benchmarks. New here? Start with "
		"'incise demo'.",
		0, 0);
#ifdef PROJECT /* mk/project.mk */
	printf("\n%s", PROJECT);
#endif
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

/* Names of commands in other programs. */
static const char *const synonyms[][2] = {
	{"record", "capture"}, {"learn", "train"},    {"run", "haptic"},
	{"show", "view"},      {"convert", "export"}, {"check", "verify"},
};

/* One line on stderr about a word that is no command, with the nearest one: 2. */
static int unknown_command(const char *word)
{
	const char *names[COMMANDS + 2] = {"help"}, *nearest;
	const char *remedy;
	char *program = cli_text("incise-%.64s", word);

	if (!strcmp(word, "rig")) {
		cli_error("'rig': is now 'incise info rig'");
		return 2;
	}
	for (size_t i = 0; i < COMMANDS; i++)
		names[i + 1] = commands[i].name;
	nearest = incise_nearest_name(word, names);
	for (size_t i = 0; i < sizeof(synonyms) / sizeof(*synonyms); i++)
		if (!strcmp(word, synonyms[i][0]))
			nearest = synonyms[i][1];
	remedy = features_remedy(program);
	free(program);
	if (nearest && !strcmp(nearest, word) && remedy)
		cli_error(
			"'%s': this incise was built without it; %s, and build it again",
			word, remedy);
	else if (nearest && !strcmp(nearest, word))
		cli_error("'%s': its program is not beside incise; install incise again",
			  word);
	else if (nearest)
		cli_error("'%.64s': no such command; did you mean 'incise %s'?", word,
			  nearest);
	else
		cli_error("'%.64s': no such command; 'incise --help' lists them", word);
	return 2;
}

/* Pages of the manual that are no command's, as people name them. */
static const struct {
	const char *name, *page;
} topics[] = {
	{"rig.conf", "rig.conf.5"},
	{"stepper.conf", "stepper.conf.5"},
	{"calibration.conf", "calibration.conf.5"},
	{"calibration", "calibration.conf.5"},
	{"scene", "incise-scene.5"},
	{"recording", "incise-recording.5"},
	{"session", "incise-session.5"},
	{"state", "incise-state.5"},
	{"fis", "incise-fis.5"},
	{"model", "incise-fis.5"},
	{"fx", "incise-fx.5"},
	{"sd", "incise-sd.5"},
	{"library", "libincise.3"},
	{"libincise", "libincise.3"},
	{"tex", "incise-tex.5"},
	{"fac", "incise-fac.5"},
	{"service", "incise-haptic@.service.8"},
	{"haptic@.service", "incise-haptic@.service.8"},
	{"serve.service", "incise-serve.service.8"},
	{"lesson", "lesson.md"}, /* a document: its path is printed */
	{"glossary", "glossary.md"},
	{"faq", "faq.md"},
};

#define TOPICS (sizeof(topics) / sizeof(*topics))

/* The page "NAME.SECTION" of a topic, or of a command and its subcommand; NULL: there is none. */
static char *page_of(const char *topic, const char *subcommand)
{
	size_t length = strcspn(topic, "-");
	char *page = NULL;

	if (!strncmp(topic, "incise-", 7))
		return page_of(topic + 7, subcommand);
	for (size_t i = 0; i < TOPICS && !subcommand; i++)
		if (!strcasecmp(topic, topics[i].name))
			return strdup(topics[i].page);
	for (size_t i = 0; i < COMMANDS; i++)
		if (strlen(commands[i].name) == length &&
		    !strncmp(topic, commands[i].name, length))
			return asprintf(&page, "incise-%.64s%s%.64s.1", topic,
					subcommand ? "-" : "",
					subcommand ? subcommand : "") < 0
				       ? NULL
				       : page;
	return NULL;
}

/* Print the path of a document: of the source, to which the link of the scenes leads, or installed. */
static int document(const char *name)
{
	static const char *const folders[] = {"incise/scenes/../doc", "doc/incise"};
	char *path, found[PATH_MAX];

	for (size_t i = 0; i < sizeof(folders) / sizeof(*folders); i++) {
		path = cli_text("%s/../share/%s/%s", cli_folder(), folders[i], name);
		if (!access(path, R_OK) && realpath(path, found))
			return printf("%s\n", found) < 0;
		free(path);
	}
	cli_error("help: doc/%s is not installed; it is in the source of incise", name);
	return 1;
}

/* The page of the build tree if this runs in one, else the installed one. */
static int manual(const char *topic, const char *subcommand)
{
	char *page = topic ? page_of(topic, subcommand) : strdup("incise.1");
	char *dot, *path;

	if (!page) {
		const char *names[COMMANDS + TOPICS + 1] = {0}, *nearest;

		for (size_t i = 0; i < COMMANDS; i++)
			names[i] = commands[i].name;
		for (size_t i = 0; i < TOPICS; i++)
			names[COMMANDS + i] = topics[i].name;
		nearest = incise_nearest_name(topic, names);
		if (nearest)
			cli_error("help %.64s: no such command or file format; did you "
				  "mean 'incise help %s'?",
				  topic, nearest);
		else
			cli_error("help %.64s: no such command or file format; "
				  "'incise --help' lists the commands",
				  topic);
		return 2;
	}
	dot = strrchr(page, '.');
	if (!strcmp(dot, ".md"))
		return document(page);
	if (asprintf(&path, "%s/../man/%s", cli_folder(), page) < 0)
		return 1;
	if (!access(path, R_OK))
		execlp("man", "man", path, (char *)NULL);
	*dot = 0;
	execlp("man", "man", dot + 1, page, (char *)NULL);
	cli_error("man: %s; install the package man-db%s%.64s%s", strerror(errno),
		  topic ? ", or try 'incise " : "", topic ? topic : "",
		  topic ? " --help'" : "");
	return 1;
}

static int finish(void)
{
	if (!fflush(stdout))
		return 0;
	cli_error("standard output: %s", strerror(errno));
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

/* The program of a command, and of its subcommand if there is one: free(3); NULL: none here. */
static char *program_of(const char *command, const char *subcommand)
{
	char *program = cli_text("%s/incise-%.64s%s%.64s", cli_folder(), command,
				 subcommand ? "-" : "", subcommand ? subcommand : "");

	if (!strchr(command, '/') && (!subcommand || !strchr(subcommand, '/')) &&
	    !access(program, X_OK))
		return program;
	free(program);
	return NULL;
}

/* Print what the last of @n words may be, which follow "incise". */
static int complete_incise(int n, char **words)
{
	char *program = n > 2 ? program_of(words[0], words[1]) : NULL;
	bool help = n > 1 && !strcmp(words[0], "help");
	int used = program ? 2 : 1;

	if (n < 2 || (help && n == 2)) {
		for (size_t i = 0; i < COMMANDS; i++)
			complete_word(commands[i].name, commands[i].does);
		for (size_t i = 0; help && i < TOPICS; i++)
			complete_word(topics[i].name, topics[i].page);
	}
	if (n < 2) {
		complete_word("help", "open the manual page of a command or file format");
		complete_word("--help", "list the commands");
		complete_word("--version", "print version and features");
	}
	if (!program && n > 1 && !help)
		program = program_of(words[0], NULL);
	if (program && !fflush(stdout) && has_libraries(program)) {
		char **argv = cli_alloc((size_t)(n - used) + 3, sizeof(*argv));

		argv[0] = program;
		argv[1] = "--complete";
		memcpy(argv + 2, words + used, (size_t)(n - used) * sizeof(*argv));
		execv(program, argv);
	}
	return 0;
}

int main(int argc, char **argv)
{
	const char *command = argv[1];
	char folder[PATH_MAX], program[PATH_MAX + 80];

	if (argc < 2) {
		dup2(STDERR_FILENO, STDOUT_FILENO);
		help();
		return 2;
	}
	if (!strcmp(command, "-h") || !strcmp(command, "--help")) {
		help();
		return finish();
	}
	if (!strcmp(command, "-V") || !strcmp(command, "--version")) {
		printf("incise %s\n", incise_version());
		features_print(stdout);
		return finish();
	}
	if (!strcmp(command, "--complete"))
		return complete_incise(argc - 2, argv + 2);
	if (!strcmp(command, "--table")) { /* for the manual page */
		for (size_t i = 0; i < COMMANDS; i++)
			printf("command\t%s\t%s\n", commands[i].name, commands[i].does);
		return finish();
	}
	if (!strcmp(command, "help")) {
		if (argc == 3 && !strcmp(argv[2], "advanced")) {
			list_commands(true);
			return finish();
		}
		if (argc > 2)
			return manual(argv[2], argv[3]);
		help();
		return finish();
	}
	if (strchr(command, '/') || *command == '-' || strlen(command) > 64)
		return unknown_command(command);
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
	if (errno == ENOENT || (errno == EACCES && !on_path(program)))
		return unknown_command(command);
	cli_error("%s: %s", program, strerror(errno));
	return 1;
}
