// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * --help of a command; see help.h.
 */
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>
#include "help.h"

const struct cli_option *help_option(const struct cli_command *command, int i)
{
	static const struct cli_option common[] = {
		{0, "overwrite", NULL, "replace existing files", CLI_KIND_OVERWRITE},
		{'h', "help", NULL, "show this help", CLI_KIND_HELP},
		{'V', "version", NULL, "show the version", CLI_KIND_VERSION},
		{0},
	};
	const struct cli_option *opt = command->options;
	bool outputs = false;

	for (; opt->name; opt++, i--) {
		if (!i)
			return opt;
		outputs |= opt->kind == CLI_KIND_OUTPUT || opt->kind == CLI_KIND_OUTPUTS;
	}
	opt = &common[i + !outputs];
	return opt->name ? opt : NULL;
}

/* Columns of standard output; longer lines than 100 columns are hard to read. */
static int columns(void)
{
	const char *given = getenv("COLUMNS");
	struct winsize window = {0};
	int n = given ? atoi(given) : 0;

	if (n <= 0 && !ioctl(STDOUT_FILENO, TIOCGWINSZ, &window))
		n = window.ws_col;
	return n <= 0 ? 80 : n < 40 ? 40 : n > 100 ? 100 : n;
}

/* The next piece of a line that stays whole: a word; of a command an option and its argument. */
static size_t piece_of(const char *text, size_t length, bool command)
{
	size_t n = strcspn(text, " |\n");

	if (!command)
		return n + (text[n] == '|');
	while (n < length && strncmp(text + n, " -", 2) != 0)
		n++;
	return n;
}

/* A line of @length bytes; one of a command ends with a backslash where it goes on. */
static void print_line(const char *line, size_t length, int at, int indent, bool command)
{
	int width = columns() - 2 * command;

	for (size_t i = 0, n; i < length; i += n) {
		int gap = (int)strspn(line + i, " "), letters = 0;

		i += (size_t)gap;
		n = piece_of(line + i, length - i, command);
		for (size_t k = 0; k < n; k++)
			letters += (line[i + k] & 0xc0) != 0x80;
		if (at > indent && at + gap + letters > width) {
			printf("%s\n%*s", command ? " \\" : "", indent, "");
			at = indent;
			gap = 0;
		}
		printf("%*s%.*s", gap, "", (int)n, line + i);
		at += gap + letters;
	}
	putchar('\n');
}

void help_print_text(const char *text, int at, int indent)
{
	for (const char *line = text; *line; line += strspn(line, "\n")) {
		size_t length = strcspn(line, "\n");
		int below = indent;

		for (size_t i = 1; i < length; i++)
			if (line[i] != ' ' && line[i - 1] == ' ' && i > 2 &&
			    line[i - 2] == ' ')
				below = indent + (int)i;
		print_line(line, length, at, below, false);
		line += length;
		at = 0;
	}
}

static void print_option(const struct cli_option *opt)
{
	bool letter = opt->id;
	int indent = columns() < 72 ? 10 : 30;
	char *left = cli_text("  %c%c%s--%s%s%s", letter ? '-' : ' ',
			      letter ? opt->id : ' ', letter ? ", " : "  ", opt->name,
			      opt->arg ? " " : "", opt->arg ? opt->arg : "");

	printf("%-*s", indent, left);
	if ((int)strlen(left) >= indent)
		printf("\n%*s", indent, "");
	help_print_text(opt->help, indent, indent);
	free(left);
}

static const char *exit_meaning(const struct cli_command *command, int status)
{
	const char *meanings[] = {command->success ? command->success : "success",
				  command->failure ? command->failure : "failure",
				  "bad usage"};

	return meanings[status];
}

void help_print(const struct cli_command *command)
{
	const struct cli_option *opt;
	char *page = cli_text("incise-%s", command->name), *text;
	const char *example = command->examples;

	text = cli_text("Usage: incise %s %s", command->name, command->synopsis);
	help_print_text(text, 0, 8);
	free(text);
	putchar('\n');
	help_print_text(command->summary, 0, 0);
	printf("\nOptions:\n");
	for (int i = 0; (opt = help_option(command, i)); i++)
		print_option(opt);
	putchar('\n');
	if (command->notes) {
		help_print_text(command->notes, 0, 0);
		putchar('\n');
	}
	if (command->more) {
		text = command->more();
		*text = (char)toupper(*text);
		help_print_text(text, 0, 0);
		putchar('\n');
		free(text);
	}
	if (example)
		printf("Example%s:\n", strchr(example, '\n') ? "s" : "");
	for (; example && *example; example += strspn(example, "\n")) {
		size_t length = strcspn(example, "\n");

		printf("  ");
		print_line(example, length, 2, 6, true);
		example += length;
	}
	if (command->examples)
		putchar('\n');
	for (char *c = page; (c = strchr(c, ' '));)
		*c = '-';
	text = cli_text("Exit status: 0 %s; 1 %s; 2 %s. See %s(1).",
			exit_meaning(command, 0), exit_meaning(command, 1),
			exit_meaning(command, 2), page);
	help_print_text(text, 0, 0);
	free(text), free(page);
}

void help_print_table(const struct cli_command *command)
{
	const struct cli_option *opt;

	for (int i = 0; (opt = help_option(command, i)); i++)
		printf("option\t%.*s\t%s\t%s\t%s\n", opt->id != 0,
		       (char[]){(char)opt->id}, opt->name, opt->arg ? opt->arg : "",
		       opt->help);
	for (int status = 0; status <= 2; status++)
		printf("exit\t%d\t%s\n", status, exit_meaning(command, status));
}
