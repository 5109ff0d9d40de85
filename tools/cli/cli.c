// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The conventions of all commands; see cli.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <limits.h>
#include <math.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <syslog.h>
#include <time.h>
#include <unistd.h>
#include <incise/infile.h>
#include <incise/rig.h>
#include <incise/version.h>
#include "cli.h"
#include "../../lib/base/control_character.h"
#include "../../lib/base/monotonic.h"
#include "complete.h"
#include "file_kind.h"
#include "help.h"

#define OPTIONS_MAX 40
#define KEYS_MAX 16
#define OWNER_S 30 /* in which the owner of a haptic device gets ready */
#define OWNER_LOOK_NS 200000000
#define LONG 256 /* first of the numbers of long options */

static const struct cli_command *current;
static bool status_line, verbose;
static int status_above; /* lines above its last one */
static void *completed;	 /* the command's struct, while a command line is completed */

volatile sig_atomic_t cli_stop;

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

/* Options that had another name up to 0.1, of all commands or of those named. */
static const struct {
	const char *command, *old, *now;
} renamed[] = {
	{"assess", "--csv", "-o FILE.csv"},
	{"bench", "--plot", "-o NAME"},
	{"bench all", "--report", "-o DIR"},
	{"bench view", "--plot", "-o NAME"},
	{"calibrate delay", "--keep", "-o NAME.rec"},
	{"calibrate delay", "--range", "--max-delay"},
	{"calibrate delay", "--report", "-o DIR"},
	{"calibrate delay", "--time", "--duration"},
	{"calibrate delay", "--u-reference", "--given-u reference=MS"},
	{"calibrate delay", "--with-camera", "--camera frames"},
	{"calibrate depth", "--axis", "--handle"},
	{"calibrate depth", "--gauge-u", "--given-u gauge=VALUE"},
	{"calibrate depth", "--keep", "-o FILE.csv"},
	{"calibrate depth", "--length-u", "--given-u length=VALUE"},
	{"calibrate depth", "--pictures", "--images"},
	{"calibrate depth", "--pixels-u", "--given-u pixels=VALUE"},
	{"calibrate depth", "--plane-u", "--given-u plane=VALUE"},
	{"calibrate depth", "--report", "-o DIR"},
	{"calibrate depth", "--square", "--board COLSxROWS,LENGTH"},
	{"calibrate depth", "--square-u", "--given-u square=VALUE"},
	{"calibrate depth", "--zero-u", "--given-u zero=VALUE"},
	{"calibrate force", "--altitude", "--gravity latitude=DEG,altitude=M"},
	{"calibrate force", "--keep", "-o FILE.csv"},
	{"calibrate force", "--latitude", "--gravity latitude=DEG"},
	{"calibrate force", "--range", "--input-range"},
	{"calibrate force", "--report", "-o DIR"},
	{"calibrate force", "--series", "--repeat"},
	{"calibrate force", "--time", "--duration"},
	{"calibrate stepper", "--keep", "-o FILE.csv"},
	{"calibrate stepper", "--report", "-o DIR"},
	{"calibrate stepper", "--strokes", "--repeat"},
	{"calibrate tip", "--keep", "-o FILE.csv"},
	{"calibrate tip", "--report", "-o DIR"},
	{"calibrate tip", "--time", "--duration"},
	{"calibrate tip", "--u-surface", "--given-u surface=MM"},
	{"compile", "--arith", "--method"},
	{"compile", "--c-source", "-o FILE.c"},
	{"compile", "--cells", "--method KIND:CELLS"},
	{"demo", "--loop", "--duration"},
	{"demo", "--report", "-o"},
	{"eval", "--parts", "--uncertainty parts"},
	{"eval", "--sd", "--uncertainty total"},
	{"export", "--by-cut", "--average NxM,by-cut"},
	{"export", "--depth-max", "--average NxM,depth=MM"},
	{"export", "--from", "--range TIME..TIME"},
	{"export", "--min-count", "--average NxM,count=N"},
	{"export", "--to", "--range TIME..TIME"},
	{"export", "--velocity-max", "--average NxM,velocity=MM_S"},
	{"export", "-r", "--rate"},
	{"haptic", "--log", "-o FILE.csv"},
	{"haptic", "--priority", "--policy fifo:N"},
	{"haptic", "--session", "-o FILE.session"},
	{"info", "--plot", "incise plot MODEL.fis -o NAME.png"},
	{"join", "--within", "--tolerance"},
	{"replay", "--at", "--poses"},
	{"replay", "--csv", "-o FILE.csv"},
	{"replay", "--log", "-o FILE.csv"},
	{"replay", "--plot", "-o NAME.png"},
	{"serve", "--igtl-version", "--igtl PORT/VERSION"},
	{"stepper", "--for", "--duration"},
	{"train", "--classic", "--search classic"},
	{"train", "--factor", "-o FILE.fac"},
	{"train", "--from", "--range TIME..TIME"},
	{"train", "--history", "-o FILE.csv"},
	{"train", "--initial", "-o FILE.initial.fis"},
	{"train", "--mf-type", "--search type=KIND"},
	{"train", "--mpi", "--share mpi"},
	{"train", "--output-model", "--output"},
	{"train", "--sample", "--search sample=N"},
	{"train", "--shard", "--share I/N"},
	{"train", "--starts", "--search starts=N"},
	{"train", "--step", "--search classic,step=K"},
	{"train", "--to", "--range TIME..TIME"},
	{"view", "--camera", "--viewpoint"},
	{"view", "--fps", "--rate"},
	{"view", "--frames", "-o DIR"},
	{"view", "--no-output", "-o none"},
	{"view", "--session", "-o FILE.session"},
	{"view", "--strip", "-o FILE.png"},
	{"view", "--video", "-o FILE.mp4"},
};

/* Bad usage if @option, "-x" or "--name", is an old name. */
static void refuse_renamed(const struct cli_command *command, const char *option)
{
	for (size_t i = 0; i < sizeof(renamed) / sizeof(*renamed); i++)
		if (!strcmp(command->name, renamed[i].command) &&
		    !strcmp(option, renamed[i].old))
			cli_usage("%s: this option is now %s", option, renamed[i].now);
}

/* The name of what option @given, "-x" or "--name", takes. */
static const char *argument_of(const struct cli_command *command, const char *given)
{
	const struct cli_option *opt;
	char letter = given[strlen(given) - 1];

	for (int i = 0; (opt = help_option(command, i)); i++)
		if (!strncmp(given, "--", 2)
			    ? !strncmp(given + 2, opt->name, strlen(given + 2))
			    : letter == opt->id)
			return opt->arg ? opt->arg : "none";
	return "see --help";
}

/* Bad usage: option @given, or its letter @letter, is no option of this command. */
_Noreturn static void refuse_cli(const struct cli_command *command, const char *given,
				 int letter)
{
	const char *names[OPTIONS_MAX + 4] = {0}, *nearest;
	char *option = cli_text("%.*s", (int)strcspn(given, "="), given);
	int n = 0;

	if (strncmp(given, "--", 2) && letter)
		option = cli_text("-%c", letter);
	refuse_renamed(command, option);
	if (*option != '-' || option[1] != '-')
		cli_usage("%s: no such option", option);
	for (const struct cli_option *opt; (opt = help_option(command, n)); n++)
		names[n] = opt->name;
	for (int i = 0; i < n; i++) {
		size_t length = strlen(option + 2);

		if (!strcmp(names[i], option + 2))
			cli_usage("%s: this option takes no argument; remove '='",
				  option);
		/* The beginning of two or more names. */
		if (length && !strncmp(names[i], option + 2, length))
			cli_usage("%s: ambiguous: more than one option begins like "
				  "this, for example --%s",
				  option, names[i]);
	}
	nearest = incise_nearest_name(option + 2, names);
	if (nearest)
		cli_usage("%s: no such option; did you mean --%s?", option, nearest);
	cli_usage("%s: no such option", option);
}

/* The next option, with its argument in optarg; NULL: none is left. */
static const struct cli_option *next(const struct cli_command *command, int argc,
				     char **argv)
{
	struct option longs[OPTIONS_MAX + 4] = {0};
	char shorts[3 * OPTIONS_MAX + 8] = ":";
	char *s = shorts + strlen(shorts);
	const struct cli_option *opt;
	int id;

	if (!current)
		fill_streams();
	current = command;
	/* getopt would take an old name that begins a new one for that, such as --time. */
	for (int i = optind; i < argc && strcmp(argv[i], "--"); i++)
		if (!strncmp(argv[i], "--", 2))
			refuse_renamed(command, argv[i]);
	for (int n = 0; (opt = help_option(command, n)); n++) {
		if (n == OPTIONS_MAX)
			abort();
		if (n &&
		    !strcmp(opt->name, longs[n - 1].name)) { /* another of its rows */
			longs[n] = longs[n - 1];
			continue;
		}
		/* Each has a number of its own, or getopt would complete "--m" to any. */
		longs[n] = (struct option){opt->name,
					   opt->arg ? required_argument : no_argument,
					   NULL, LONG + n};
		if (opt->id) {
			*s++ = (char)opt->id;
			if (opt->arg)
				*s++ = ':';
		}
	}
	opterr = 0;
	id = getopt_long(argc, argv, shorts, longs, NULL);
	if (id == -1)
		return NULL;
	if (id == ':')
		cli_usage("%s: missing argument %s", argv[optind - 1],
			  argument_of(command, argv[optind - 1]));
	for (int n = 0; (opt = help_option(command, n)); n++)
		if (id == LONG + n || id == opt->id)
			return opt;
	refuse_cli(command, argv[optind - 1], optopt);
}

static void store_integer(const struct cli_option *opt, void *member)
{
	long value = cli_integer(opt->name, optarg, (long)opt->min, (long)opt->max);

	if (opt->size == sizeof(int))
		*(int *)member = (int)value;
	else
		*(long *)member = value;
}

static void store(const struct cli_option *opt, void *member)
{
	char what[64];

	switch (opt->kind) {
	case CLI_KIND_FLAG:
		*(bool *)member = true;
		break;
	case CLI_KIND_TEXT:
	case CLI_KIND_INPUT:
	case CLI_KIND_OUTPUT:
	case CLI_KIND_OUTPUTS:
		if (opt->parse)
			opt->parse(member, optarg);
		*(const char **)member = optarg;
		break;
	case CLI_KIND_INTEGER:
		store_integer(opt, member);
		break;
	case CLI_KIND_NUMBER:
		*(double *)member = cli_number(opt->name, optarg, opt->min, opt->max);
		break;
	case CLI_KIND_DURATION:
		*(double *)member = cli_duration(opt->name, optarg, opt->min, opt->max);
		break;
	case CLI_KIND_QUANTITY:
		snprintf(what, sizeof(what), "--%s", opt->name);
		*(double *)member =
			cli_quantity(what, optarg, opt->units, opt->min, opt->max);
		break;
	case CLI_KIND_CHOICE:
		*(int *)member = cli_choice(opt->name, optarg, opt->names);
		break;
	case CLI_KIND_PARSED:
		opt->parse(member, optarg);
		break;
	case CLI_KIND_OVERWRITE:
		cli_allow_overwrite();
		break;
	case CLI_KIND_HELP:
		help_print(current);
		cli_finish();
		exit(0);
	case CLI_KIND_VERSION:
		printf("incise %s\n", incise_version());
		cli_finish();
		exit(0);
	}
}

void cli_keys(char *text, const struct cli_option *keys, void *options)
{
	size_t prefix = strcspn(keys->name, " ");
	char *option = cli_text("%.*s", (int)prefix, keys->name), *items[KEYS_MAX];
	const char *names[KEYS_MAX + 1] = {0};
	int n = cli_list(option, text, items, KEYS_MAX);

	for (int k = 0; keys[k].name; k++) {
		names[k] = keys[k].name + prefix + 1;
		if (completed)
			complete_word(keys[k].arg ? cli_text("%s=", names[k]) : names[k],
				      NULL);
	}
	if (completed) {
		puts(":nospace");
		exit(0);
	}
	for (int i = 0, k; i < n; i++) {
		char *value = strchr(items[i], '=');

		if (value)
			*value++ = '\0';
		for (k = 0; names[k] && strcmp(names[k], items[i]) != 0; k++)
			;
		if (!names[k])
			cli_unknown(cli_text("key of --%s", option), items[i], names);
		if (!value != (keys[k].kind == CLI_KIND_FLAG))
			cli_usage("--%s: %s", option,
				  value ? cli_text("%s takes no value", names[k])
					: cli_text("%s needs a value, %s=%s", names[k],
						   names[k], keys[k].arg));
		optarg = value;
		store(&keys[k], (char *)options + keys[k].offset);
	}
	free(option);
}

static void note_paths(const struct cli_command *command, enum cli_kind kind,
		       const void *options, void (*note)(const char *path))
{
	for (const struct cli_option *opt = command->options; opt->name; opt++) {
		const char *path = NULL;

		if (opt->kind == kind)
			path = *(const char *const *)((const char *)options +
						      opt->offset);
		if (path)
			note(path);
	}
}

/* "none", and what calibrations write, need not be there. */
static bool is_new_calibration(const struct cli_command *command, const char *path)
{
	return !strcmp(path, "none") ||
	       (!strncmp(command->name, "calibrate ", 10) &&
		strcmp(command->name, "calibrate check") != 0 && access(path, F_OK));
}

/* The kind of file that an option names, which is the same in all commands. */
static void expect(const struct cli_command *command, const void *options)
{
	static const struct {
		const char *name;
		unsigned int kinds;
	} named[] = {
		{"against", FILE_REPORT},
		{"calibration", FILE_CALIBRATION},
		{"model", FILE_MODEL | FILE_COMPILED},
		{"recording", FILE_RECORDING},
		{"reference", FILE_SESSION},
		{"rig", FILE_RIG},
	};

	for (const struct cli_option *opt = command->options; opt->name; opt++) {
		const char *path = NULL;

		if (opt->kind == CLI_KIND_INPUT)
			path = *(const char *const *)((const char *)options +
						      opt->offset);
		if (path && !strcmp(opt->name, "calibration") &&
		    is_new_calibration(command, path))
			continue;
		for (size_t i = 0; path && i < sizeof(named) / sizeof(*named); i++)
			if (!strcmp(opt->name, named[i].name))
				file_expect(path, named[i].kinds);
	}
}

/* The choices of an option: what cli_choice() expects in the function that parses it. */
static void list_choices(const struct cli_option *opt)
{
	char nothing[] = "\001";

	opt->parse((char *)completed + opt->offset, nothing);
}

static void complete_cli(const struct cli_command *command, int n, char **words,
			 void *options)
{
	current = command;
	completed = options;
	complete_command(command, n, words, list_choices);
	exit(0);
}

/* While a command line is completed, names that are expected are the answer. */
static void answer_completion(const char *const *names)
{
	if (!completed)
		return;
	for (int i = 0; names[i]; i++)
		complete_word(names[i], NULL);
	exit(0);
}

static void check_extensions(const struct cli_command *command, const void *options)
{
	const struct cli_option *first = command->options;

	for (const struct cli_option *opt = first; opt->name; opt++) {
		const char *path = NULL;
		char *all;

		if (strcmp(opt->name, first->name))
			first = opt;
		if (opt->extensions)
			path = *(const char *const *)((const char *)options +
						      opt->offset);
		if (!path)
			continue;
		all = cli_output_extensions(first);
		cli_extension(opt->name, path, all);
		free(all);
	}
}

/* The row of the output in optarg, of several; each may be given once. */
static const struct cli_option *choose_output(const struct cli_command *command,
					      const struct cli_option *first)
{
	static uint64_t given;
	const struct cli_option *row = cli_output_row(first, &optarg);
	uint64_t bit = UINT64_C(1) << (row - command->options);

	if (given & bit)
		cli_usage("--%s %s: %s is given twice", row->name, optarg, row->arg);
	given |= bit;
	return row;
}

void cli_parse(const struct cli_command *command, int argc, char **argv, void *options)
{
	const struct cli_option *opt;

	if (argc > 1 && !strcmp(argv[1], "--complete"))
		complete_cli(command, argc - 2, argv + 2, options);
	if (argc > 1 && !strcmp(argv[1], "--table")) {
		help_print_table(command);
		cli_finish();
		exit(0);
	}
	while ((opt = next(command, argc, argv))) {
		if (opt[1].name && !strcmp(opt->name, opt[1].name))
			opt = choose_output(command, opt);
		store(opt, (char *)options + opt->offset);
	}
	cli_input("-");
	for (int i = optind; i < argc; i++)
		cli_input(argv[i]);
	note_paths(command, CLI_KIND_INPUT, options, cli_input);
	note_paths(command, CLI_KIND_OUTPUT, options, cli_output_once);
	expect(command, options);
	check_extensions(command, options);
}

char *cli_operand(int argc, char **argv, const char *name, const char *what)
{
	if (optind == argc)
		cli_usage("missing %s (%s)", name, what);
	if (optind + 1 < argc)
		cli_usage("unexpected argument '%s'; give one %s at a time",
			  argv[optind + 1], name);
	return argv[optind];
}

void cli_no_operands(int argc, char **argv, const char *option)
{
	if (optind < argc)
		cli_usage("unexpected argument '%s'; did you mean %s %s?", argv[optind],
			  option, argv[optind]);
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

const char *cli_colour(FILE *stream, enum cli_colour colour)
{
	static const char *const sequences[] = {
		[CLI_PLAIN] = "\033[0m",  [CLI_BOLD] = "\033[1m",
		[CLI_RED] = "\033[1;31m", [CLI_YELLOW] = "\033[1;33m",
		[CLI_GREEN] = "\033[32m",
	};
	const char *refused = getenv("NO_COLOR"), *term = getenv("TERM");

	if ((refused && *refused) || !term || !*term || !strcmp(term, "dumb") ||
	    !isatty(fileno(stream)))
		return "";
	return sequences[colour];
}

/* @level: of syslog(3) */
static void say(int level, const char *fmt, va_list args)
{
	const char *plain = cli_colour(stderr, CLI_PLAIN);
	char text[700], prefix[8] = "";
	enum cli_colour colour = level == LOG_ERR	? CLI_RED
				 : level == LOG_WARNING ? CLI_BOLD
							: CLI_PLAIN;

	if (completed) /* there is no answer */
		exit(0);
	cli_progress_end();
	vsnprintf(text, sizeof(text), fmt, args);
	/* Text from outside must not break the line or control the terminal. */
	control_characters_hide(text);
	fflush(stdout);
	if (to_journal())
		snprintf(prefix, sizeof(prefix), "<%d>", level);
	fprintf(stderr, "%s%sincise%s%s:%s ", prefix, cli_colour(stderr, colour),
		current ? " " : "", current ? current->name : "", plain);
	if (level == LOG_WARNING)
		fprintf(stderr, "%swarning:%s ", cli_colour(stderr, CLI_YELLOW), plain);
	fprintf(stderr, "%s\n", text);
}

void cli_error(const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	say(LOG_ERR, fmt, args);
	va_end(args);
}

void cli_fail(const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	say(LOG_ERR, fmt, args);
	va_end(args);
	exit(1);
}

void cli_fail_with(const struct incise_error *err)
{
	cli_fail("%s", err->text);
}

void cli_check(bool failed, const struct incise_error *err)
{
	if (failed)
		cli_fail_with(err);
}

void *cli_require(void *result, const struct incise_error *err)
{
	cli_check(!result, err);
	return result;
}

void cli_usage(const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	say(LOG_ERR, fmt, args);
	va_end(args);
	fprintf(stderr, "Try 'incise %s --help'.\n", current ? current->name : "");
	exit(2);
}

void cli_warn(const char *fmt, ...)
{
	va_list args;

	va_start(args, fmt);
	say(LOG_WARNING, fmt, args);
	va_end(args);
}

void cli_note(const char *fmt, ...)
{
	va_list args;

	if (!verbose)
		return;
	va_start(args, fmt);
	say(LOG_INFO, fmt, args);
	va_end(args);
}

void cli_be_verbose(void)
{
	verbose = true;
}

/* "a, b or c": free(3). */
static char *one_of(const char *const *names)
{
	char *list = cli_text("%s", *names);

	while (*++names) {
		char *before = list;

		list = cli_text("%s%s%s", before, names[1] ? ", " : " or ", *names);
		free(before);
	}
	return list;
}

void cli_unknown(const char *what, const char *name, const char *const *names)
{
	const char *nearest = incise_nearest_name(name, names);

	answer_completion(names);
	if (nearest)
		cli_usage("unknown %s '%s'; did you mean '%s'?", what, name, nearest);
	cli_usage("unknown %s '%s'; expected %s", what, name, one_of(names));
}

double cli_number(const char *option, const char *text, double min, double max)
{
	char *end;
	double value = incise_decimal(text, &end);

	if (end == text || *end || !(value >= min && value <= max))
		cli_usage("--%s: expected a number from %.10g to %.10g, found '%s'",
			  option, min, max, text);
	return value;
}

long cli_integer(const char *option, const char *text, long min, long max)
{
	char *end;
	long value;

	errno = 0;
	value = strtol(text, &end, 10);
	if (end == text || *end || errno || value < min || value > max)
		cli_usage("--%s: expected a whole number from %ld to %ld, found '%s'",
			  option, min, max, text);
	return value;
}

/* A number, or a number and a unit. */
static bool in_units(const char *text, const struct cli_unit *units, double *value)
{
	char *end;

	*value = incise_decimal(text, &end);
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
		cli_usage(
			"--%s: expected a duration, for example 10s, 500ms, 2min or 1h, "
			"found '%s'",
			option, text);
	if (!(value >= min && value <= max))
		cli_usage("--%s: expected %g s to %g s, found '%s'", option, min, max,
			  text);
	return value;
}

void cli_time_range(const char *option, char *text, double *from_s, double *to_s)
{
	char *dots = strstr(text, "..");

	if (!dots || (dots == text && !dots[2]))
		cli_usage("--%s: expected two times such as 2s..4.5s, got '%.40s'",
			  option, text);
	*dots = '\0';
	*from_s = *text ? cli_duration(option, text, 0, 1e9) : 0;
	*to_s = dots[2] ? cli_duration(option, dots + 2, 0, 1e9) : INFINITY;
	if (!(*from_s < *to_s))
		cli_usage("--%s: it ends at %g s, where it begins or before", option,
			  *to_s);
}

double cli_quantity(const char *what, const char *text, const struct cli_unit *units,
		    double min, double max)
{
	double value;

	if (!in_units(text, units, &value))
		cli_usage("%s: expected a number, alone or with a unit, for example 1%s "
			  "or 1%s, found '%s'",
			  what, units[0].name, units[1].name, text);
	if (!(value >= min && value <= max))
		cli_usage("%s: expected %g %s to %g %s, found '%s'", what, min,
			  units->name, max, units->name, text);
	return value;
}

void cli_negative_numbers(int argc, char **argv)
{
	for (int i = 1; i < argc && strcmp(argv[i], "--"); i++) {
		const char *arg = argv[i];

		if (arg[0] != '-' || !(arg[1] == '.' || (arg[1] >= '0' && arg[1] <= '9')))
			continue;
		/* getopt takes it for an operand, and strtod skips the space. */
		argv[i] = cli_text(" %s", arg);
	}
}

int cli_choice(const char *option, const char *text, const char *const *names)
{
	const char *nearest = incise_nearest_name(text, names);

	answer_completion(names);
	for (int i = 0; names[i]; i++)
		if (!strcmp(text, names[i]))
			return i;
	if (nearest)
		cli_usage("--%s: expected %s, found '%s'; did you mean '%s'?", option,
			  one_of(names), text, nearest);
	cli_usage("--%s: expected %s, found '%s'", option, one_of(names), text);
}

int cli_list(const char *option, char *text, char **items, int max)
{
	int n = 0;

	for (char *save, *item = strtok_r(text, ",", &save); item;
	     item = strtok_r(NULL, ",", &save)) {
		if (n == max)
			cli_usage("--%s: more than %d items, separated by commas", option,
				  max);
		items[n++] = item;
	}
	if (!n)
		cli_usage("--%s: the list is empty; separate its items by commas",
			  option);
	return n;
}

static const char *const rig_places[] = {"rig.conf", "/etc/incise/rig.conf", NULL};

const char *cli_default_rig(void)
{
	const char *const *place = rig_places;

	while (*place && access(*place, F_OK))
		place++;
	return *place;
}

const char *cli_rig_passed_over(int i)
{
	static char reason[120];
	const char *used = cli_default_rig();

	if (!rig_places[i] || rig_places[i] == used || (used == rig_places[0]))
		return NULL;
	errno = 0;
	if (!access(rig_places[i], F_OK))
		return NULL;
	snprintf(reason, sizeof(reason), "%s: %s", rig_places[i], strerror(errno));
	return reason;
}

const char *cli_rig(const char *given)
{
	const char *found = given ? given : cli_default_rig();

	if (found) {
		cli_input(found);
		return found;
	}
	cli_fail("no rig: there is no ./rig.conf and no /etc/incise/rig.conf; give "
		 "--rig FILE, or --rig sim: for the simulated rig");
}

struct incise_rig *cli_open_rig(const char *given, unsigned int devices)
{
	const struct timespec pause = {.tv_nsec = OWNER_LOOK_NS};
	int64_t end_ns = cli_now_ns() + OWNER_S * INCISE_NS_PER_S;
	const char *spec = cli_rig(given);
	struct incise_error err = {0};
	struct incise_rig *rig = incise_rig_open(spec, devices, &err);

	if (!rig && err.code == EAGAIN)
		cli_warn("%s; waiting for it, at most %d s", err.text, OWNER_S);
	while (!rig && err.code == EAGAIN && !cli_stop && cli_now_ns() < end_ns) {
		nanosleep(&pause, NULL);
		rig = incise_rig_open(spec, devices, &err);
	}
	if (!rig && err.code == EAGAIN && !cli_stop)
		cli_fail("%s; it was not ready after %d s", err.text, OWNER_S);
	return cli_require(rig, &err);
}

const char *cli_command_name(void)
{
	return current ? current->name : "";
}

void *cli_alloc(size_t n, size_t size)
{
	void *memory = calloc(n ? n : 1, size);

	if (!memory)
		cli_fail("out of memory");
	return memory;
}

void *cli_resize(void *memory, size_t n, size_t size)
{
	memory = reallocarray(memory, n, size);
	if (!memory)
		cli_fail("out of memory");
	return memory;
}

void *cli_grow(void *memory, size_t n, size_t size)
{
	/* Full at 64, 128, … */
	if (n && (n < 64 || n & (n - 1)))
		return memory;
	return cli_resize(memory, n ? 2 * n : 64, size);
}

char *cli_text(const char *fmt, ...)
{
	va_list args;
	char *text;

	va_start(args, fmt);
	if (vasprintf(&text, fmt, args) < 0)
		cli_fail("out of memory");
	va_end(args);
	return text;
}

const char *cli_count(uint64_t n, const char *noun)
{
	static char texts[8][48];
	static unsigned int calls;
	char *text = texts[calls++ % 8];

	snprintf(text, sizeof(texts[0]), "%llu %s%s", (unsigned long long)n, noun,
		 n == 1 ? "" : "s");
	return text;
}

bool cli_ends_with(const char *text, const char *end)
{
	size_t n = strlen(text), m = strlen(end);

	return n >= m && !strcmp(text + n - m, end);
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

/* Go to the first of the status lines, and clear from there. */
static void put_progress_end(FILE *out)
{
	if (status_line && status_above)
		fprintf(out, "\033[%dA", status_above);
	if (status_line)
		fputs("\r\033[J", out);
	status_line = false;
	status_above = 0;
}

int64_t cli_now_ns(void)
{
	return incise_monotonic_ns();
}

void cli_terminal_size(int *columns, int *lines)
{
	struct winsize window = {0};

	ioctl(STDERR_FILENO, TIOCGWINSZ, &window);
	*columns = window.ws_col ? window.ws_col : 80;
	*lines = window.ws_row ? window.ws_row : 24;
}

/* Bytes of at most so many characters of a line in UTF-8, each a column wide. */
static int bytes_of(const char *line, int characters)
{
	int n = 0;

	for (; line[n] && line[n] != '\n'; n++)
		if ((line[n] & 0xc0) != 0x80 && !characters--)
			break;
	return n;
}

void cli_progress(const char *fmt, ...)
{
	char *text, *shown = NULL;
	int columns, lines;
	va_list args;
	size_t size;
	FILE *out;

	if (!isatty(STDERR_FILENO))
		return;
	if (in_background()) {
		cli_progress_forget();
		return;
	}
	va_start(args, fmt);
	if (vasprintf(&text, fmt, args) < 0)
		text = NULL;
	va_end(args);
	out = open_memstream(&shown, &size);
	if (!text || !out)
		cli_fail("out of memory");
	cli_terminal_size(&columns, &lines);
	put_progress_end(out);
	/* A line that wraps, or scrolled off the top, could not be overwritten. */
	for (const char *line = text;; line += strcspn(line, "\n") + 1) {
		fprintf(out, "%.*s", bytes_of(line, columns - 1), line);
		if (!line[strcspn(line, "\n")] || status_above + 1 >= lines)
			break;
		fputc('\n', out);
		status_above++;
	}
	if (fclose(out))
		cli_fail("out of memory");
	fputs(shown, stderr);
	fflush(stderr);
	free(shown), free(text);
	status_line = true;
}

void cli_progress_bar(const char *name, double share, struct cli_bar *bar)
{
	static const char full[] = "##############################";
	int percent = (int)(100 * share), n = (int)(share * (sizeof(full) - 1));
	int64_t now_ns = cli_now_ns();
	char left[40] = "";
	double left_s;

	if (!bar->begin_ns)
		bar->begin_ns = now_ns;
	else if (percent == bar->percent && now_ns - bar->drawn_ns < INCISE_NS_PER_S)
		return;
	bar->percent = percent;
	bar->drawn_ns = now_ns;
	left_s = 1e-9 * (double)(now_ns - bar->begin_ns) * (1 - share) / share;
	/* The first share tells no time yet. */
	if (share > 0 && share < 1 && now_ns > bar->begin_ns)
		snprintf(left, sizeof(left),
			 left_s < 100 ? ", %.0f s left" : ", %.0f min left",
			 left_s < 100 ? left_s : left_s / 60);
	cli_progress("%s [%-*.*s] %d %%%s", name, (int)sizeof(full) - 1, n, full, percent,
		     left);
}

void cli_progress_end(void)
{
	put_progress_end(stderr);
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

/* Wait for input; false: a caught signal came, however shortly before. */
static bool await_input(void)
{
	struct pollfd input = {STDIN_FILENO, POLLIN, 0};
	sigset_t caught, before;
	int n;

	sigemptyset(&caught);
	sigaddset(&caught, SIGINT);
	sigaddset(&caught, SIGTERM);
	sigaddset(&caught, SIGHUP);
	sigprocmask(SIG_BLOCK, &caught, &before);
	n = cli_stop ? -1 : ppoll(&input, 1, NULL, &before);
	sigprocmask(SIG_SETMASK, &before, NULL);
	return n > 0;
}

bool cli_ask(const char *question, char *answer, int size)
{
	for (;;) {
		int rest;

		fputs(question, stderr);
		if (!await_input() || !fgets(answer, size, stdin) || cli_stop)
			return false;
		if (strchr(answer, '\n') || feof(stdin))
			break;
		/* It would answer the next question. */
		do
			rest = getchar();
		while (rest != '\n' && rest != EOF);
		cli_warn("an answer has up to %d letters; this one was not taken",
			 size - 2);
	}
	answer[strcspn(answer, "\n")] = '\0';
	return true;
}

void cli_finish(void)
{
	struct pollfd reader = {.fd = STDOUT_FILENO};

	cli_progress_end();
	errno = 0;
	if (!ferror(stdout) && !fflush(stdout))
		return;
	if (errno == EPIPE)
		exit(1);
	/* The failed write was an earlier one: of a pipe it is the reader that has gone. */
	if (!errno && poll(&reader, 1, 0) == 1 && reader.revents & POLLERR)
		exit(1);
	if (!errno)
		cli_fail("standard output: writing failed; see whether the disk is full");
	cli_fail("standard output: %s", strerror(errno));
}
