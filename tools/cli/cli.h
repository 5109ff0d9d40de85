/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The conventions of all commands: options and --help from one table, numbers with units,
 * one line per error, progress on a terminal, signals that end a run cleanly.
 *
 * Exit codes: 0 success, 1 failure, 2 bad usage. If stderr is the journal of systemd, lines
 * begin with a level as of sd-daemon(3).
 */
#ifndef INCISE_CLI_H
#define INCISE_CLI_H

#include <signal.h>
#include <stdbool.h>
#include <incise/error.h>
#include <incise/export.h>

/* An option; a table of them ends with {0}. */
struct cli_option {
	int id;		  /* its letter, or a number from CLI_LONG on */
	const char *name; /* long name */
	const char *arg;  /* name of its argument, or NULL */
	const char *help; /* one line; may hold newlines */
};

#define CLI_LONG 256 /* first id of options without a letter */
#define CLI_END (-1)

struct cli_command {
	const char *name;     /* "train" */
	const char *synopsis; /* "DATA.csv -o MODEL.fis" */
	const char *summary;  /* one sentence for --help */
	const struct cli_option *options;
	const char *notes; /* examples and exit codes, below the options; or NULL */
};

/*
 * Next option's id, or CLI_END with optind at the first operand. Handles --help and
 * --version itself; a wrong option ends the program with 2.
 */
int cli_next(const struct cli_command *command, int argc, char **argv);

/* Fail with one line "incise COMMAND: …": exit 1. */
_Noreturn void cli_fail(const char *fmt, ...) INCISE_PRINTF(1, 2);

/* Fail with the text of an error: exit 1. */
_Noreturn void cli_fail_with(const struct incise_error *err);

/* Bad usage: one line and a hint to --help; exit 2. */
_Noreturn void cli_usage(const char *fmt, ...) INCISE_PRINTF(1, 2);

/* A line "incise COMMAND: warning: …" on stderr. */
void cli_warn(const char *fmt, ...) INCISE_PRINTF(1, 2);

/* A line "incise COMMAND: …" on stderr, printed only after cli_be_verbose(). */
void cli_note(const char *fmt, ...) INCISE_PRINTF(1, 2);
void cli_be_verbose(void);

/* Arguments of options; out of range or malformed is bad usage. */
double cli_number(const char *option, const char *text, double min, double max);
long cli_integer(const char *option, const char *text, long min, long max);

/* "10", "10s", "500ms", "2min", "1h" in seconds. */
double cli_duration(const char *option, const char *text, double min, double max);

/*
 * A quantity such as "10", "10mm", "-500um", in the first of these units, which end with {0};
 * @what: its name in messages, for example "--for".
 */
struct cli_unit {
	const char *name;
	double factor; /* to the first, whose own is 1 */
};
double cli_quantity(const char *what, const char *text, const struct cli_unit *units,
		    double min, double max);

/* Read "-5" as a number, not as options: for commands whose operands are numbers. */
void cli_negative_numbers(int argc, char **argv);

/* "a,b,c" to at most max strings; the text is cut in place. Returns how many. */
int cli_list(const char *option, char *text, char **items, int max);

/* The rig to use: @given, else ./rig.conf, else /etc/incise/rig.conf, else fail. */
const char *cli_rig(const char *given);

/* The folder of this program, and of the other commands; lives as long as the program. */
const char *cli_folder(void);

/* Replace the status lines on stderr; does nothing if that is not a terminal. */
void cli_progress(const char *fmt, ...) INCISE_PRINTF(1, 2);

/* Remove them. */
void cli_progress_end(void);

/* Keep them on the screen: others have written below them. */
void cli_progress_forget(void);

/* SIGINT, SIGTERM and SIGHUP set cli_stop. A second SIGINT or SIGTERM kills. */
void cli_catch_signals(void);
extern volatile sig_atomic_t cli_stop;

/* Flush standard output; a failed write is exit 1 (a closed pipe is quiet). */
void cli_finish(void);

#endif
