/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The conventions of all commands: options and --help from one table, numbers with units,
 * one line per error, progress and colour on a terminal, signals that end a run cleanly.
 *
 * Exit codes: 0 success, 1 failure, 2 bad usage. If stderr is the journal of systemd, lines
 * begin with a level as of sd-daemon(3).
 */
#ifndef INCISE_CLI_H
#define INCISE_CLI_H

#include <getopt.h> /* optind */
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <incise/error.h>
#include <incise/export.h>

/* The way cli_parse() stores the argument of an option; see the macros below. */
enum cli_kind {
	CLI_KIND_FLAG,
	CLI_KIND_TEXT,
	CLI_KIND_INPUT,
	CLI_KIND_OUTPUT,
	CLI_KIND_OUTPUTS,
	CLI_KIND_INTEGER,
	CLI_KIND_NUMBER,
	CLI_KIND_DURATION,
	CLI_KIND_QUANTITY,
	CLI_KIND_CHOICE,
	CLI_KIND_PARSED,
	/* those of all commands */
	CLI_KIND_OVERWRITE,
	CLI_KIND_HELP,
	CLI_KIND_VERSION,
};

#pragma GCC diagnostic ignored "-Wmissing-field-initializers"

/* An option; a table of them ends with {0}. */
struct cli_option {
	int id;		  /* its letter, or 0 */
	const char *name; /* long name */
	const char *arg;  /* name of its argument, or NULL */
	const char *help; /* a sentence without a full stop, which --help wraps */

	/* For cli_parse(), by one of the macros below. */
	enum cli_kind kind;
	size_t offset, size; /* of the member in the command's struct */
	double min, max;
	const struct cli_unit *units;
	const char *const *names; /* choices; of other kinds for completion only */
	void (*parse)(void *member, char *text);
	const char *extensions; /* of a file that is written, as of cli_extension() */
};

/* The compiler warns when the member has another type. */
#define CLI_MEMBER(type, member, of)                                                    \
	.offset = offsetof(type, member) + 0 * sizeof(&((type *)0)->member == (of *)0), \
	.size = sizeof(((type *)0)->member)

/* bool: becomes true. */
#define CLI_FLAG(type, member) .kind = CLI_KIND_FLAG, CLI_MEMBER(type, member, bool)

/* const char *: the argument. */
#define CLI_TEXT(type, member) \
	.kind = CLI_KIND_TEXT, CLI_MEMBER(type, member, const char *)

/*
 * const char *: the path of a file or recording that is read; of a file that is written; the
 * name of several files, or of a folder, for which the command calls cli_output(). A command
 * with outputs has the option --overwrite. Behind it, .parse checks the argument, and .extensions
 * lists those that a CLI_OUTPUT may have.
 */
#define CLI_INPUT(type, member) \
	.kind = CLI_KIND_INPUT, CLI_MEMBER(type, member, const char *)
#define CLI_OUTPUT(type, member) \
	.kind = CLI_KIND_OUTPUT, CLI_MEMBER(type, member, const char *)
#define CLI_OUTPUTS(type, member) \
	.kind = CLI_KIND_OUTPUTS, CLI_MEMBER(type, member, const char *)

/* Any integer type of 4 or 8 bytes, as of cli_integer(). */
#define CLI_INTEGER(type, member, low, high)                                    \
	.kind = CLI_KIND_INTEGER, CLI_MEMBER(type, member, void), .min = (low), \
	.max = (high)

/* double, as of cli_number(), cli_duration() and cli_quantity(). */
#define CLI_NUMBER(type, member, low, high)                                      \
	.kind = CLI_KIND_NUMBER, CLI_MEMBER(type, member, double), .min = (low), \
	.max = (high)
#define CLI_DURATION(type, member, low, high)                                      \
	.kind = CLI_KIND_DURATION, CLI_MEMBER(type, member, double), .min = (low), \
	.max = (high)
#define CLI_QUANTITY(type, member, of, low, high)                                   \
	.kind = CLI_KIND_QUANTITY, CLI_MEMBER(type, member, double), .units = (of), \
	.min = (low), .max = (high)

/* An enum, as of cli_choice(). */
#define CLI_CHOICE(type, member, of) \
	.kind = CLI_KIND_CHOICE, CLI_MEMBER(type, member, void), .names = (of)

/* A function parses it into the member, or into the command's whole struct. */
#define CLI_PARSED(type, member, function) \
	.kind = CLI_KIND_PARSED, CLI_MEMBER(type, member, void), .parse = (function)
#define CLI_PARSED_BY(function) .kind = CLI_KIND_PARSED, .parse = (function)

/* The row of the rig to use, without its braces. */
#define CLI_RIG_OPTION(type, member)                                         \
	'r', "rig", "RIG",                                                   \
		"file rig.conf, or sim:KEY=VALUE,… for the simulated rig " \
		"(default: ./rig.conf, else /etc/incise/rig.conf)",          \
		CLI_INPUT(type, member)

struct cli_command {
	const char *name;     /* "train" */
	const char *synopsis; /* "DATA.csv -o MODEL.fis" */
	const char *summary;  /* for --help, as of help_print_text() */
	const struct cli_option *options;
	const char *notes;    /* the same, below the options; or NULL */
	char *(*more)(void);  /* one more line below them, free(3); or NULL */
	const char *examples; /* a command a line; or NULL */
	/* Meaning of exit status 0 and 1; NULL: "success" and "failure". */
	const char *success, *failure;
	/* All operands as a synopsis, "move MM | home", if .synopsis does not have them; or NULL. */
	const char *operands;
};

/*
 * Store all options in the command's struct *options, and leave optind at the first operand.
 * Handles --help, --version and --overwrite; a wrong option ends the program with 2. Operands
 * that are files, and paths of CLI_INPUT, are inputs; those of CLI_OUTPUT are outputs.
 */
void cli_parse(const struct cli_command *command, int argc, char **argv, void *options);

/*
 * A file or recording that is read. If an output is it, or would lie in it, the program fails,
 * whichever is noted first. Files that do not exist are ignored.
 */
void cli_input(const char *path);

/*
 * A file that will be written, before anything is. Fails the program if it is an input, by
 * device and inode, or lies in a recording that is read; or if it exists, without --overwrite.
 * "-", pipes and devices may always be written. The same path may be noted again.
 */
void cli_output(const char *path);

/* The same for one that is no other output either. */
void cli_output_once(const char *path);

/* The same for a file that is added to a recording, which may be the one that is read. */
void cli_output_within(const char *path);

/* The same for a file that cli_written() leaves out unless it was noted before. */
void cli_output_part(const char *path);

/*
 * Print "wrote A, B and C": all outputs that were noted and are there as new or changed files. Of
 * more than a few in a folder it names the folder. A command calls it at the end of a report for
 * people, and not if an output is standard output.
 */
void cli_written(void);

/*
 * Bad usage if the name of a file to write ends with an extension that is not in the list, for
 * example ".png .svg .pdf". "-", a name without a dot, pipes and devices have none.
 */
void cli_extension(const char *option, const char *path, const char *list);

/*
 * A command that writes several files has several rows of one name, one after the other, such as
 * "output": each with its own member and .extensions, one without for a folder. Returns the row
 * that takes this path: that of its extension; of "csv:PATH", which is cut to PATH, that of .csv;
 * of "-", a pipe or a device the first file; of a folder or a name without an extension the one
 * without a list, else the first.
 */
const struct cli_option *cli_output_row(const struct cli_option *first, char **path);

/* The extensions of all these rows, ".fis .csv": free(3). */
char *cli_output_extensions(const struct cli_option *first);

/* Whether it ends with an extension of the list. */
bool cli_extension_in(const char *path, const char *list);

/* Whether --overwrite was given; and the same as if it was. */
bool cli_overwrite(void);
void cli_allow_overwrite(void);

/* The only operand; another number of them is bad usage: "missing NAME (WHAT)". */
char *cli_operand(int argc, char **argv, const char *name, const char *what);

/* An operand is bad usage: "unexpected argument 'OPERAND'; did you mean OPTION OPERAND?". */
void cli_no_operands(int argc, char **argv, const char *option);

/* Fail with one line "incise COMMAND: …": exit 1. */
_Noreturn void cli_fail(const char *fmt, ...) INCISE_PRINTF(1, 2);

/* Fail with the text of an error: exit 1. */
_Noreturn void cli_fail_with(const struct incise_error *err);

/* Returns @result; NULL: fails with the text of the error. The same of a call that failed. */
void *cli_require(void *result, const struct incise_error *err);
void cli_check(bool failed, const struct incise_error *err);

/* Bad usage: one line and a hint to --help; exit 2. */
_Noreturn void cli_usage(const char *fmt, ...) INCISE_PRINTF(1, 2);

/* The same line as cli_fail(), and the program goes on. */
void cli_error(const char *fmt, ...) INCISE_PRINTF(1, 2);

/* A line "incise COMMAND: warning: …" on stderr. */
void cli_warn(const char *fmt, ...) INCISE_PRINTF(1, 2);

/* A line "incise COMMAND: …" on stderr, printed only after cli_be_verbose(). */
void cli_note(const char *fmt, ...) INCISE_PRINTF(1, 2);
void cli_be_verbose(void);

/* Bad usage: "unknown WHAT 'NAME'", and the nearest of @names, which end with NULL. */
_Noreturn void cli_unknown(const char *what, const char *name, const char *const *names);

/* Arguments of options; out of range or malformed is bad usage. */
double cli_number(const char *option, const char *text, double min, double max);
long cli_integer(const char *option, const char *text, long min, long max);

/* "10", "10s", "500ms", "2min", "1h" in seconds. */
double cli_duration(const char *option, const char *text, double min, double max);

/*
 * A quantity such as "10", "10mm", "-500um", in the first of these units, which end with {0};
 * @what: its name in messages, for example "--range".
 */
struct cli_unit {
	const char *name;
	double factor; /* to the first, whose own is 1 */
};
double cli_quantity(const char *what, const char *text, const struct cli_unit *units,
		    double min, double max);

/* Read "-5" as a number, not as options: for commands whose operands are numbers. */
void cli_negative_numbers(int argc, char **argv);

/* Index of @text in @names, which end with NULL. */
int cli_choice(const char *option, const char *text, const char *const *names);

/* "2s..4.5s", "90s.." (to: INFINITY), "..1min" (from: 0), in seconds. */
void cli_time_range(const char *option, char *text, double *from_s, double *to_s);

/*
 * "key=value,flag": the rows @keys, which end with {0}, are options without an own name, stored in
 * *options; .name is "OPTION key". Another key is bad usage.
 */
void cli_keys(char *text, const struct cli_option *keys, void *options);

/* "a,b,c" to at most max strings; the text is cut in place. Returns how many. */
int cli_list(const char *option, char *text, char **items, int max);

/* The rig to use: @given, else ./rig.conf, else /etc/incise/rig.conf, else fail. */
const char *cli_rig(const char *given);

/* ./rig.conf, else /etc/incise/rig.conf, else NULL. */
const char *cli_default_rig(void);

/* The places before that one with the reason, "rig.conf: No such file …"; NULL beyond the last. */
const char *cli_rig_passed_over(int i);

/*
 * Open that rig with some devices (INCISE_RIG_TRACKER, …), or fail. An owner of a haptic device that is not
 * ready yet is waited for, with a warning.
 */
struct incise_rig *cli_open_rig(const char *given, unsigned int devices);

/* Name of the command that runs, such as "calibrate force"; "" before cli_parse(). */
const char *cli_command_name(void);

/* The folder of this program, and of the other commands; lives as long as the program. */
const char *cli_folder(void);

/* Memory that is zeroed, memory that grows, formatted text: free(3), or fail the program. */
void *cli_alloc(size_t n, size_t size);
void *cli_resize(void *memory, size_t n, size_t size);

/* An array of n elements, which has grown by this alone, with capacity for one more. */
void *cli_grow(void *memory, size_t n, size_t size);
char *cli_text(const char *fmt, ...) INCISE_PRINTF(1, 2);

/* "1 cut", "3 cuts"; it lasts for seven more calls. */
const char *cli_count(uint64_t n, const char *noun);

bool cli_ends_with(const char *text, const char *end);

/* Columns and lines of the terminal at stderr; 80 and 24 where they are not known. */
void cli_terminal_size(int *columns, int *lines);

/* CLOCK_MONOTONIC, ns. */
int64_t cli_now_ns(void);

/*
 * Replace the status lines on stderr, UTF-8, by one write, cut to the terminal's size; does nothing
 * if that is not a terminal.
 */
void cli_progress(const char *fmt, ...) INCISE_PRINTF(1, 2);

/* A bar with the time left, redrawn when the percentage changes, and once a second. */
struct cli_bar { /* begins with zeros */
	int percent;
	int64_t begin_ns, drawn_ns;
};
void cli_progress_bar(const char *name, double share, struct cli_bar *bar);

/* Remove them. */
void cli_progress_end(void);

/* Keep them on the screen: others have written below them. */
void cli_progress_forget(void);

/* SIGINT, SIGTERM and SIGHUP set cli_stop. A second SIGINT or SIGTERM kills. */
void cli_catch_signals(void);
extern volatile sig_atomic_t cli_stop;

/*
 * Ask on standard error, and read the answer from standard input, without its line's end; one that is
 * longer than @size - 2 is refused and asked for again. Returns false if the input ends or a caught
 * signal comes.
 */
bool cli_ask(const char *question, char *answer, int size);

/*
 * The escape sequence that begins a colour, or with CLI_PLAIN ends it; "" unless the stream is a
 * terminal with colours. NO_COLOR, not empty, turns them off (no-color.org), TERM=dumb as well.
 */
enum cli_colour { CLI_PLAIN, CLI_BOLD, CLI_RED, CLI_YELLOW, CLI_GREEN };
const char *cli_colour(FILE *stream, enum cli_colour colour);

/* Flush standard output; a failed write is exit 1 (a closed pipe is quiet). */
void cli_finish(void);

#endif
