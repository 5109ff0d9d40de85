// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The conventions of all commands; see cli.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <libgen.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <syslog.h>
#include <unistd.h>
#include <incise/version.h>
#include "cli.h"

#define OPTIONS_MAX 40

static const struct cli_command *current;
static bool status_line, verbose;
static int status_above; /* lines above its last one */

volatile sig_atomic_t cli_stop;

static void print_help(const struct cli_command *command)
{
	printf("Usage: incise %s %s\n\n%s\n\nOptions:\n", command->name,
	       command->synopsis, command->summary);
	for (const struct cli_option *opt = command->options; opt->name; opt++) {
		char left[64];
		const char *help = opt->help;

		snprintf(left, sizeof(left), "  %c%c%s--%s%s%s",
			 opt->id < CLI_LONG ? '-' : ' ',
			 opt->id < CLI_LONG ? opt->id : ' ',
			 opt->id < CLI_LONG ? ", " : "  ", opt->name, opt->arg ? " " : "",
			 opt->arg ? opt->arg : "");
		printf("%-30s", left);
		if (strlen(left) >= 30)
			printf("\n%-30s", "");
		for (const char *c = help; *c; c++)
			*c == '\n' ? printf("\n%-30s", "") : putchar(*c);
		putchar('\n');
	}
	printf("  -h, --help                  show this\n"
	       "  -V, --version               show the version\n");
	if (command->notes)
		printf("\n%s\n", command->notes);
}

/*
 * If a standard stream is closed, the next open(2) takes its number, and a device would get
 * the program's output. A file that cannot be written to takes the number first.
 */
static void fill_streams(void)
{
	int fd;

	do
		fd = open("/dev/null", O_RDONLY);
	while (fd >= 0 && fd <= 2);
	if (fd > 2)
		close(fd);
}

int cli_next(const struct cli_command *command, int argc, char **argv)
{
	struct option longs[OPTIONS_MAX + 3] = {0};
	char shorts[3 * OPTIONS_MAX + 8] = ":hV";
	char *s = shorts + strlen(shorts);
	int n = 0;
	int id;

	if (!current)
		fill_streams();
	current = command;
	for (const struct cli_option *opt = command->options; opt->name; opt++) {
		if (n == OPTIONS_MAX)
			abort();
		longs[n++] = (struct option){opt->name,
					     opt->arg ? required_argument : no_argument,
					     NULL, opt->id};
		if (opt->id < CLI_LONG) {
			*s++ = opt->id;
			if (opt->arg)
				*s++ = ':';
		}
	}
	longs[n++] = (struct option){"help", no_argument, NULL, 'h'};
	longs[n++] = (struct option){"version", no_argument, NULL, 'V'};
	opterr = 0;
	id = getopt_long(argc, argv, shorts, longs, NULL);
	switch (id) {
	case 'h':
		print_help(command);
		cli_finish();
		exit(0);
	case 'V':
		printf("incise %s\n", incise_version());
		cli_finish();
		exit(0);
	case ':':
		cli_usage("option %s needs an argument", argv[optind - 1]);
	case '?':
		if (optopt && optopt < CLI_LONG && !strchr(shorts, optopt))
			cli_usage("there is no option -%c", optopt);
		cli_usage(
			"option %s is not known, or was given an argument it does not take",
			argv[optind - 1]);
	}
	return id;
}

/* Whether stderr is the journal, by the service manager's variable. */
static bool to_journal(void)
{
	const char *stream = getenv("JOURNAL_STREAM");
	unsigned long long device, inode;
	struct stat status;

	return stream && sscanf(stream, "%llu:%llu", &device, &inode) == 2 &&
	       !fstat(STDERR_FILENO, &status) && status.st_dev == device &&
	       status.st_ino == inode;
}

/* @level: of syslog(3) */
static void say(int level, const char *kind, const char *fmt, va_list args)
{
	char text[700], prefix[8] = "";

	cli_progress_end();
	vsnprintf(text, sizeof(text), fmt, args);
	/* Text from outside must not break the line or control the terminal. */
	for (char *c = text; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '?';
	fflush(stdout);
	if (to_journal())
		snprintf(prefix, sizeof(prefix), "<%d>", level);
	fprintf(stderr, "%sincise%s%s: %s%s\n", prefix, current ? " " : "",
		current ? current->name : "", kind, text);
}

void cli_fail(const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	say(LOG_ERR, "", fmt, args);
	va_end(args);
	exit(1);
}

void cli_fail_with(const struct incise_error *err)
{
	cli_fail("%s", err->text);
}

void cli_usage(const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	say(LOG_ERR, "", fmt, args);
	va_end(args);
	fprintf(stderr, "Try 'incise %s --help'.\n", current ? current->name : "");
	exit(2);
}

void cli_warn(const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	say(LOG_WARNING, "warning: ", fmt, args);
	va_end(args);
}

void cli_note(const char *fmt, ...)
{
	va_list args;

	if (!verbose)
		return;
	va_start(args, fmt);
	say(LOG_INFO, "", fmt, args);
	va_end(args);
}

void cli_be_verbose(void)
{
	verbose = true;
}

double cli_number(const char *option, const char *text, double min, double max)
{
	char *end;
	double value = strtod(text, &end);

	if (end == text || *end || !isfinite(value))
		cli_usage("--%s: '%s' is not a number", option, text);
	if (value < min || value > max)
		cli_usage("--%s: %s is not within %g to %g", option, text, min, max);
	return value;
}

long cli_integer(const char *option, const char *text, long min, long max)
{
	char *end;
	long value;

	errno = 0;
	value = strtol(text, &end, 10);
	if (end == text || *end)
		cli_usage("--%s: '%s' is not a whole number", option, text);
	if (errno || value < min || value > max)
		cli_usage("--%s: %s is not within %ld to %ld", option, text, min, max);
	return value;
}

/* A number, or a number and a unit. */
static bool in_units(const char *text, const struct cli_unit *units, double *value)
{
	char *end;

	*value = strtod(text, &end);
	if (end == text)
		return false;
	for (const struct cli_unit *unit = units; unit->name; unit++)
		if (!*end || !strcmp(end, unit->name)) {
			*value *= unit->factor;
			return true;
		}
	return false;
}

double cli_duration(const char *option, const char *text, double min, double max)
{
	static const struct cli_unit units[] = {
		{"s", 1}, {"ms", 1e-3}, {"min", 60}, {"h", 3600}, {0}};
	double value;

	if (!in_units(text, units, &value))
		cli_usage("--%s: '%s' is not a duration such as 10s, 500ms, 2min or 1h",
			  option, text);
	if (!(value >= min && value <= max))
		cli_usage("--%s: %s is not within %g s to %g s", option, text, min, max);
	return value;
}

double cli_quantity(const char *what, const char *text, const struct cli_unit *units,
		    double min, double max)
{
	double value;

	if (!in_units(text, units, &value))
		cli_usage("%s: '%s' is not a number, alone or with a unit as in 1%s or "
			  "1%s",
			  what, text, units[0].name, units[1].name);
	if (!(value >= min && value <= max))
		cli_usage("%s: %s is not within %g %s to %g %s", what, text, min,
			  units->name, max, units->name);
	return value;
}

void cli_negative_numbers(int argc, char **argv)
{
	for (int i = 1; i < argc && strcmp(argv[i], "--"); i++) {
		const char *arg = argv[i];
		char *spaced;

		if (arg[0] != '-' || !(arg[1] == '.' || (arg[1] >= '0' && arg[1] <= '9')))
			continue;
		/* getopt takes it for an operand, and strtod skips the space. */
		if (asprintf(&spaced, " %s", arg) < 0)
			abort();
		argv[i] = spaced;
	}
}

int cli_list(const char *option, char *text, char **items, int max)
{
	int n = 0;

	for (char *save, *item = strtok_r(text, ",", &save); item;
	     item = strtok_r(NULL, ",", &save)) {
		if (n == max)
			cli_usage("--%s: more than %d items", option, max);
		items[n++] = item;
	}
	if (!n)
		cli_usage("--%s: the list is empty", option);
	return n;
}

const char *cli_rig(const char *given)
{
	static const char *const places[] = {"rig.conf", "/etc/incise/rig.conf"};

	if (given)
		return given;
	for (size_t i = 0; i < sizeof(places) / sizeof(*places); i++)
		if (!access(places[i], F_OK))
			return places[i];
	cli_fail(
		"there is neither ./rig.conf nor /etc/incise/rig.conf; name the rig with "
		"--rig FILE, or try the virtual one: --rig sim:");
}

const char *cli_folder(void)
{
	static char path[PATH_MAX];
	ssize_t n = readlink("/proc/self/exe", path, sizeof(path) - 1);

	path[n > 0 ? n : 0] = 0;
	return dirname(path);
}

/* Another program has the terminal, and may have written to it. */
static bool in_background(void)
{
	pid_t front = tcgetpgrp(STDERR_FILENO);

	return front > 0 && front != getpgrp();
}

void cli_progress_forget(void)
{
	status_line = false;
	status_above = 0;
}

void cli_progress(const char *fmt, ...)
{
	va_list args;

	char text[4096], *line = text, *end;
	struct winsize window;
	int columns = 80, rows = 24;

	if (!isatty(STDERR_FILENO))
		return;
	if (in_background()) {
		cli_progress_forget();
		return;
	}
	va_start(args, fmt);
	vsnprintf(text, sizeof(text), fmt, args);
	va_end(args);
	if (!ioctl(STDERR_FILENO, TIOCGWINSZ, &window) && window.ws_col) {
		columns = window.ws_col;
		rows = window.ws_row ? window.ws_row : rows;
	}
	cli_progress_end();
	/* A line that wraps, or scrolled off the top, could not be overwritten. */
	for (;; line = end + 1) {
		size_t length = strcspn(line, "\n");

		end = line + length;
		fprintf(stderr, "%.*s",
			length < (size_t)columns ? (int)length : columns - 1, line);
		if (!*end || status_above + 1 >= rows)
			break;
		fputc('\n', stderr);
		status_above++;
	}
	fflush(stderr);
	status_line = true;
}

void cli_progress_end(void)
{
	if (status_line && status_above)
		fprintf(stderr, "\033[%dA", status_above);
	if (status_line)
		fputs("\r\033[J", stderr);
	status_line = false;
	status_above = 0;
}

static void on_signal(int number)
{
	cli_stop = number;
}

void cli_catch_signals(void)
{
	struct sigaction action = {.sa_handler = on_signal, .sa_flags = SA_RESETHAND};

	sigaction(SIGINT, &action, NULL);
	sigaction(SIGTERM, &action, NULL);
	/* When a terminal closes, the kernel and the shell each send one. */
	action.sa_flags = 0;
	sigaction(SIGHUP, &action, NULL);
}

void cli_finish(void)
{
	cli_progress_end();
	errno = 0;
	if (!ferror(stdout) && !fflush(stdout))
		return;
	if (errno == EPIPE)
		exit(1);
	/* The failed write was an earlier one. */
	if (!errno)
		cli_fail("standard output: writing failed; is the disk full?");
	cli_fail("standard output: %s", strerror(errno));
}
