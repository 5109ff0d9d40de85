// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Words that may follow in a command line; see complete.h.
 */
#include <ctype.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/rig.h>
#include "complete.h"
#include "help.h"
#include "scene_argument.h"
#include "state_folder.h"

/* The part of the word that is completed that stays in front: "--rig=", "force,". */
static const char *front = "";

void complete_word(const char *word, const char *description)
{
	printf("%s%s\t%s\n", front, word, description ? description : "");
}

static void files(const char *globs)
{
	printf(":files%s%s\n", *globs ? " " : "", globs);
}

/* --- values that machine, folders and library have --- */

/* Each file of a pattern, without folder and ending. */
static void names_of(const char *folder, const char *pattern, const char *description)
{
	char *path = cli_text("%s/%s", folder, pattern);
	glob_t found;

	if (!glob(path, 0, NULL, &found)) {
		for (size_t i = 0; i < found.gl_pathc; i++) {
			const char *name = strrchr(found.gl_pathv[i], '/') + 1;
			char *word =
				cli_text("%.*s", (int)(strrchr(name, '.') - name), name);

			complete_word(word, description);
			free(word);
		}
		globfree(&found);
	}
	free(path);
}

static void scenes(void)
{
	names_of(".", "*.scene", "scene in this folder");
	names_of("/etc/incise/scenes", "*.scene", "scene of this machine");
	names_of(scene_argument_shipped(), "*.scene", "installed scene");
	files("*.scene");
}

static void loops(void)
{
	char *folders[STATE_FOLDERS];

	state_folders(folders);
	for (int i = 0; i < STATE_FOLDERS; i++)
		if (folders[i] && state_folder_trusted(folders, i))
			names_of(folders[i], "*.state", "loop of this machine");
	state_folders_free(folders);
	files("*.state");
}

/* Interfaces of CAN, by the number of linux/if_arp.h: "can:can0". */
static void can_interfaces(void)
{
	glob_t found;

	if (glob("/sys/class/net/*/type", 0, NULL, &found))
		return;
	for (size_t i = 0; i < found.gl_pathc; i++) {
		FILE *file = fopen(found.gl_pathv[i], "r");
		int type = 0;

		if (file && fscanf(file, "%d", &type) == 1 && type == 280) {
			char *name = found.gl_pathv[i] + strlen("/sys/class/net/");
			char *word = cli_text("can:%.*s", (int)strcspn(name, "/"), name);

			complete_word(word, "CAN interface");
			free(word);
		}
		if (file)
			fclose(file);
	}
	globfree(&found);
}

static void devices(const char *before, const char *pattern)
{
	glob_t found;

	if (glob(pattern, 0, NULL, &found))
		return;
	for (size_t i = 0; i < found.gl_pathc; i++) {
		char *word = cli_text("%s%s", before, found.gl_pathv[i]);

		complete_word(word, NULL);
		free(word);
	}
	globfree(&found);
}

static int sim_key(void *context, const struct incise_key *key)
{
	bool own = !strncmp(key->name, "sim.", 4);
	char *word = cli_text("%s=", key->name + (own ? 4 : 0)), *value;

	(void)context;
	value = cli_text("default: %s", key->value);
	if (own || !strcmp(key->name, "clock"))
		complete_word(word, value);
	free(word);
	free(value);
	return 0;
}

/* A rig: a file, or KEY=VALUE of the simulated one behind "sim:" and each comma. */
static void rig(const char *text)
{
	if (!strncmp(text, "sim:", 4)) {
		const char *comma = strrchr(text, ',');

		front = cli_text("%s%.*s", front, comma ? (int)(comma - text) + 1 : 4,
				 text);
		complete_word("mouse", "moved by the mouse of incise view");
		incise_rig_keys("sim:", sim_key, NULL, NULL);
		printf(":nospace\n");
		return;
	}
	complete_word("sim:", "the simulated rig");
	complete_word("sim:clock=simulated", "the simulated rig, in simulated time");
	files("*.conf");
}

/* --- what an argument may be, by its name in the synopsis --- */

/* One alternative, such as "stepper", "can:IFACE", "MODEL.fis", "SCENE". */
static void alternative(const char *name, const char *text)
{
	const char *dot = strrchr(name, '.');
	char *globs;

	if (name[strspn(name, "abcdefghijklmnopqrstuvwxyz-")] == 0) {
		complete_word(name, NULL);
	} else if (islower((unsigned char)*name) && strchr(name, ':')) {
		size_t length = strcspn(name, ":") + 1;

		if (strncmp(text, name, length)) {
			char *word = cli_text("%.*s", (int)length, name);

			complete_word(word, NULL);
			printf(":nospace\n");
			free(word);
		} else if (!strncmp(name, "can:", length)) {
			can_interfaces();
		} else {
			devices("slcan:", "/dev/ttyACM*");
			devices("slcan:", "/dev/ttyUSB*");
		}
	} else if (*name == '/') {
		devices("", "/dev/incise-stepper*");
	} else if (!strcmp(name, "SCENE")) {
		scenes();
	} else if (!strcmp(name, "LOOP") || !strcmp(name, "NAME")) {
		loops();
	} else if (!strcmp(name, "DIR")) {
		printf(":folders\n");
	} else if (!strcmp(name, "FILE")) {
		files("");
	} else if (dot && dot[1]) {
		globs = cli_text("*%s", dot);
		files(globs);
		free(globs);
	}
}

/* "[blade|handle|tube]", "NAME.rec…": brackets and dots that repeat do not count. */
static void argument(const char *token, const char *text)
{
	char *copy = cli_text("%.*s", (int)strcspn(token + (*token == '['), "]"),
			      token + (*token == '['));
	char *save, *end = strstr(copy, "…");

	if (!end)
		end = strstr(copy, "...");
	if (end)
		*end = '\0';
	for (char *name = strtok_r(copy, "|", &save); name;
	     name = strtok_r(NULL, "|", &save))
		alternative(name, text);
	free(copy);
}

static void value(const struct cli_option *option, const char *text,
		  void (*choices)(const struct cli_option *option))
{
	static const struct {
		const char *name, *globs;
	} kinds[] = {
		{"calibration", "*.conf"},
		{"model", "*.fis *.fx"},
		{"data", "*.csv"},
		{"reference", "*.session"},
	};
	const char *comma = strrchr(text, ',');

	for (size_t i = 0; !option->names && i < sizeof(kinds) / sizeof(*kinds); i++)
		if (!strcmp(option->name, kinds[i].name)) {
			files(kinds[i].globs);
			return;
		}
	if (!strcmp(option->name, "rig")) {
		rig(text);
	} else if (!strcmp(option->name, "scene")) {
		scenes();
	} else if (option->names || option->kind == CLI_KIND_PARSED) {
		/* of a list the last item */
		if (comma)
			front = cli_text("%s%.*s", front, (int)(comma - text) + 1, text);
		for (int i = 0; option->names && option->names[i]; i++)
			complete_word(option->names[i], NULL);
		if (!option->names)
			choices(option);
	} else if (strcmp(option->arg, "NAME")) { /* of files that are written */
		argument(option->arg, text);
	}
}

/* --- options and operands --- */

static void options(const struct cli_command *command, bool letters)
{
	const struct cli_option *opt;
	const char *before = "";

	for (int i = 0; (opt = help_option(command, i)); before = opt->name, i++) {
		char *word;

		if (!strcmp(opt->name, before)) /* another of its rows */
			continue;
		word = cli_text("--%s", opt->name);
		complete_word(word, opt->help);
		free(word);
		word = cli_text("-%c", opt->id);
		if (letters && opt->id)
			complete_word(word, opt->help);
		free(word);
	}
}

/* The option that a word is, "--name", "--name=…" or "-x"; NULL: none of this command. */
static const struct cli_option *option_of(const struct cli_command *command,
					  const char *word)
{
	size_t length = strcspn(word, "=");

	for (const struct cli_option *opt = command->options; opt->name; opt++)
		if ((!strncmp(word, "--", 2) && strlen(opt->name) == length - 2 &&
		     !strncmp(word + 2, opt->name, length - 2)) ||
		    (*word == '-' && opt->id && word[1] == opt->id && !word[2]))
			return opt;
	return NULL;
}

/* The next token of a synopsis, up to a blank outside of brackets; NULL: none. */
static char *next_token(const char **text)
{
	const char *begin = *text + strspn(*text, " "), *end = begin;
	int depth = 0;

	for (; *end && (depth || *end != ' '); end++)
		depth += (*end == '[') - (*end == ']');
	*text = end;
	return end > begin ? cli_text("%.*s", (int)(end - begin), begin) : NULL;
}

/* Whether there is a "|" outside of brackets. */
static bool has_alternatives(const char *synopsis)
{
	char *token;

	while ((token = next_token(&synopsis))) {
		bool found = !strcmp(token, "|");

		free(token);
		if (found)
			return true;
	}
	return false;
}

/*
 * Operand @k of a synopsis, whose alternatives stand behind " | ": "move MM | home [OPTIONS]". The
 * alternative is the one that begins with the first operand. The last token repeats if it ends
 * with dots.
 */
static void operand(const char *synopsis, const char *first, int k, const char *text)
{
	bool several = has_alternatives(synopsis), chosen = true, dots = false;
	int at = 0; /* within the alternative */
	char *token;

	while ((token = next_token(&synopsis))) {
		if (!strcmp(token, "|")) {
			at = 0;
			dots = false;
			chosen = true;
		} else if (*token != '-' && strncmp(token, "[-", 2) &&
			   strcmp(token, "[OPTIONS]")) {
			if (at == 0 && k > 0 && several)
				chosen = !strcmp(token, first);
			dots = strstr(token, "…") || strstr(token, "...");
			if (chosen && (at == k || (dots && at < k)))
				argument(token, text);
			at++;
		}
		free(token);
	}
}

void complete_command(const struct cli_command *command, int n, char **words,
		      void (*choices)(const struct cli_option *option))
{
	const char *text = n ? words[n - 1] : "", *first = "";
	const struct cli_option *option = NULL;
	int operands = 0;

	for (int i = 0; i < n - 1; i++) {
		if (option) { /* this is its argument */
			option = NULL;
		} else if (*words[i] == '-' && words[i][1]) {
			option = option_of(command, words[i]);
			if (option && (!option->arg || strchr(words[i], '=')))
				option = NULL;
		} else if (!operands++) {
			first = words[i];
		}
	}
	if (!option && !strncmp(text, "--", 2) && strchr(text, '=')) {
		option = option_of(command, text);
		front = cli_text("%.*s", (int)strcspn(text, "=") + 1, text);
		text += strcspn(text, "=") + 1;
		if (!option || !option->arg)
			return;
	}
	if (option)
		for (const char *name = option->name;
		     option->name && !strcmp(option->name, name); option++)
			value(option, text, choices);
	else if (*text == '-')
		options(command, !text[1]);
	else
		operand(command->operands ? command->operands : command->synopsis, first,
			operands, text);
}
