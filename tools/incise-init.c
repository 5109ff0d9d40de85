// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise init: a rig.conf for the devices of this machine, then the calibrations that its rig needs.
 *
 *   preset ─┬─▶ devices: options ▶ answers ▶ what is attached ─▶ rig.conf ─▶ calibrations ─▶ next
 *           └── a rig.conf that is there is kept ──────────────────┘   (those that did not pass yet)
 */
#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <incise/calibration.h>
#include <incise/rig.h>
#include <incise/scan.h>
#include "cli/calibration.h"
#include "cli/child.h"
#include "cli/cli.h"
#include "cli/json.h"

#define RIG "rig.conf"
#define CALIBRATION "calibration.conf"

enum device { TRACKER, FORCE, CAMERA, STEPPER, HAPTIC, DEVICES };

/* Devices of a rig: key of rig.conf, where one is attached, and its backend. */
static const struct {
	const char *key, *what, *pattern, *spec;
} devices[DEVICES] = {
	[TRACKER] = {"tracker", "Tracker of the scalpel", "/dev/ttyUSB*", "tty:%s"},
	[FORCE] = {"force", "Force channel", "/sys/bus/iio/devices/iio:device*",
		   "iio:%s"},
	[CAMERA] = {"camera", "Camera", "/dev/video*", "v4l2:%s"},
	[STEPPER] = {"stepper", "Actuator of the handle", "/dev/incise-stepper*",
		     "kernel:%s"},
	[HAPTIC] = {"haptic", "Haptic device", NULL, NULL},
};

/* Numbers of an actuator that have no default: its maker knows them. */
static const struct {
	const char *option, *key, *what, *value;
} mechanics[] = {
	{"spring", "spring_N_mm", "Stiffness of the spring, N/mm", "2.0"},
	{"travel", "travel_mm", "Travel of the nut, mm", "20.0"},
	{"lead", "lead_mm", "Lead of the screw, mm per turn", "4.0"},
};

enum { MECHANICS = sizeof(mechanics) / sizeof(*mechanics) };

#define MECHANIC_MIN 1e-3
#define MECHANIC_MAX 1e3

struct init {
	const char *folder, *device[DEVICES];
	double mechanic[MECHANICS]; /* 0: asked for */
	enum preset { UNSET, SIM, PAPER, HAPLY } preset;
	bool yes, no_calibration, json;
	FILE *out; /* of all text: with --json standard error */
	json_t *calibrations, *next;
};

/* Devices that are not asked for: "" for none. NULL: asked for. */
static const struct {
	const char *clock, *device[DEVICES];
} presets[] = {
	[SIM] = {"simulated", {"sim:", "sim:", "sim:", "sim:", ""}},
	[PAPER] = {"real", {NULL, NULL, NULL, NULL, ""}},
	[HAPLY] = {"real", {"", "", "", "", "haply:"}},
};

/* Calibrations in their order. */
static const struct calibration {
	const char *kind;
	const char *what, *posture, *real, *simulated;
} calibrations[] = {
	{"force", "volts to newtons",
	 "put known weights on the sensor when it asks for them", "",
	 "--weights 0,50g,100g,200g,300g"},
	{"depth", "pixels to millimetres",
	 "hold the scalpel in the air, with its whole black handle in view",
	 "two-point --images 50", "two-point --images 20"},
	{"tip", "where the blade's tip is on the sensor",
	 "rest the tip in a dimple and rotate the tool by 60 degrees", "--duration 20s",
	 "--rig sim:clock=simulated,motion=1 --duration 20s --given-u surface=0.1"},
	{"delay", "how late each stream comes",
	 "press the tip on foam and lift off, irregularly", "--duration 15s",
	 "--rig sim:clock=simulated,motion=2 --duration 15s --given-u reference=0.01"},
	{"stepper", "what the actuator loses to friction and play",
	 "put the handle on the force sensor, hands off", "--repeat 3",
	 "--rig sim:clock=simulated,bench=1 --repeat 2"},
	{"frame", "where the device is in the scene",
	 "touch three to six points that the scene knows", NULL, NULL},
};

enum { CALIBRATIONS = sizeof(calibrations) / sizeof(*calibrations) };

static const char *const preset_names[] = {"", "sim", "paper", "haply", NULL};

static const struct cli_option options[] = {
	{0, "preset", "NAME",
	 "sim (all simulated), paper (tracker, force, camera and actuator of Song et al., "
	 "2006) or haply (Haply Inverse3)",
	 CLI_CHOICE(struct init, preset, preset_names)},
	{0, "tracker", "DEVICE", "tracker, as in rig.conf(5); none for no tracker",
	 CLI_TEXT(struct init, device[TRACKER])},
	{0, "force", "DEVICE", "force channel, or none",
	 CLI_TEXT(struct init, device[FORCE])},
	{0, "camera", "DEVICE", "camera, or none", CLI_TEXT(struct init, device[CAMERA])},
	{0, "stepper", "DEVICE", "actuator of the handle, or none",
	 CLI_TEXT(struct init, device[STEPPER])},
	{0, "haptic", "DEVICE", "haptic device in place of tracker and actuator",
	 CLI_TEXT(struct init, device[HAPTIC])},
	{0, "spring", "STIFFNESS", "stiffness of the actuator's spring, in N/mm",
	 CLI_NUMBER(struct init, mechanic[0], MECHANIC_MIN, MECHANIC_MAX)},
	{0, "travel", "MM", "travel of its nut",
	 CLI_NUMBER(struct init, mechanic[1], MECHANIC_MIN, MECHANIC_MAX)},
	{0, "lead", "MM", "lead of its screw per turn",
	 CLI_NUMBER(struct init, mechanic[2], MECHANIC_MIN, MECHANIC_MAX)},
	{0, "no-calibration", NULL, "only write rig.conf",
	 CLI_FLAG(struct init, no_calibration)},
	{'y', "yes", NULL, "take the default of each question; calibrate a simulated rig",
	 CLI_FLAG(struct init, yes)},
	{0, "json", NULL, "report as JSON; all else goes to standard error",
	 CLI_FLAG(struct init, json)},
	{0}};

static const struct cli_command command = {
	.name = "init",
	.synopsis = "[FOLDER] [OPTIONS]",
	.summary =
		"Write a rig.conf with comments for the devices of this machine, and lead "
		"through the calibrations that its rig needs. Run it again to go on where it "
		"stopped.",
	.options = options,
	.notes = "A rig.conf that is there is never changed.",
	.examples = "incise init lab --preset sim --yes",
	.success = "rig.conf is there, and no calibration failed",
};

/* --- questions --------------------------------------------------------------------------- */

static bool on_terminal(void)
{
	return isatty(STDIN_FILENO) && isatty(STDERR_FILENO);
}

/* An answer, or the default for an empty one and with --yes. */
static char *ask_for(const struct init *init, const char *question, const char *usual)
{
	char line[300] = "", *text = cli_text("%s [%s] ", question, usual);

	if (!init->yes && !cli_ask(text, line, sizeof(line)))
		cli_fail(
			"stopped; nothing more was written, and 'incise init' goes on here");
	free(text);
	return cli_text("%s", *line ? line : usual);
}

/* The first device of a kind that is attached, as a spec; or "none". */
static char *find_attached(enum device device)
{
	glob_t found;
	char *spec = cli_text("none");

	if (!devices[device].pattern || glob(devices[device].pattern, 0, NULL, &found))
		return spec;
	free(spec);
	spec = cli_text(devices[device].spec,
			device == FORCE ? strrchr(found.gl_pathv[0], '/') + 1
					: found.gl_pathv[0]);
	globfree(&found);
	return spec;
}

static enum preset choose_preset(const struct init *init)
{
	enum preset usual = init->device[HAPTIC] ? HAPLY : SIM;
	char *answer;

	if (init->preset)
		return init->preset;
	for (int i = 0; usual == SIM && i < HAPTIC; i++) {
		char *attached = find_attached(i);

		if (strcmp(attached, "none") || init->device[i])
			usual = PAPER;
		free(attached);
	}
	answer = ask_for(init, "Rig: sim, paper or haply?", preset_names[usual]);
	usual = (enum preset)cli_choice("preset", answer, preset_names);
	free(answer);
	return usual;
}

/* --- rig.conf ---------------------------------------------------------------------------- */

/* Each key with what it means above it, as rig.conf's own table says. */
static int add_key(void *context, const struct incise_key *key)
{
	struct commented {
		FILE *out;
		char group[80];
	} *to = context;
	const char *dot = strchr(key->name, '.');
	int length = dot ? (int)(dot - key->name) : 0;

	if (*to->group && (!dot || strncmp(to->group, key->name, (size_t)length + 1))) {
		fputs("};\n", to->out);
		*to->group = '\0';
	}
	if (!key->given)
		return 0;
	if (dot && !*to->group) {
		snprintf(to->group, sizeof(to->group), "%.*s.", length, key->name);
		fprintf(to->out, "\n%.*s = {\n", length, key->name);
	}
	fprintf(to->out, "%s# %s%s%s\n%s%s = %s;\n", dot ? "\t" : "\n", key->help,
		*key->unit ? ", " : "", key->unit, dot ? "\t" : "",
		dot ? dot + 1 : key->name, key->value);
	return 0;
}

/*
 * As libconfig wants it: text in quotes. A quote or a backslash would end it. The backend has to be
 * there, but not the device: it may be attached later.
 */
static void put_device(FILE *draft, const char *key, const char *spec)
{
	struct incise_error err = {0};

	if (strpbrk(spec, "\"\\\n"))
		cli_fail(
			"%s: '%s' has a quote, a backslash or a line's end; name the device "
			"without one",
			key, spec);
	if (incise_scan(key, spec, NULL, NULL, &err))
		cli_fail("%s: %s", key, err.text);
	fprintf(draft, "%s = \"%s\";\n", key, spec);
}

/* The draft of a rig: keys without comments. */
static void put_draft(const struct init *init, FILE *draft)
{
	enum preset preset = choose_preset(init);
	bool stepper = false, any = false;

	fprintf(draft, "clock = \"%s\";\n", presets[preset].clock);
	for (int i = 0; i < DEVICES; i++) {
		char *usual = find_attached(i);
		char *spec = init->device[i] ? cli_text("%s", init->device[i])
			     : presets[preset].device[i]
				     ? cli_text("%s", presets[preset].device[i])
				     : ask_for(init, devices[i].what, usual);

		if (*spec && strcmp(spec, "none")) {
			put_device(draft, devices[i].key, spec);
			any = true;
			stepper |= i == STEPPER && strncmp(spec, "sim:", 4);
		} else if (init->yes && *spec && !init->device[i]) {
			fprintf(init->out, "%s: none is attached; name it in %s later\n",
				devices[i].key, RIG);
		}
		free(usual), free(spec);
	}
	if (!any)
		cli_fail(
			"%s: the rig has no device, as none is attached; name what will be, "
			"for example --tracker tty:/dev/ttyUSB0, or give --preset sim",
			RIG);
	if (stepper)
		fputs("actuator = {\n", draft);
	for (int i = 0; i < MECHANICS && stepper; i++) {
		double number = init->mechanic[i];
		char *answer;

		if (!(number > 0)) {
			answer = ask_for(init, mechanics[i].what, mechanics[i].value);
			number = cli_number(mechanics[i].option, answer, MECHANIC_MIN,
					    MECHANIC_MAX);
			free(answer);
		}
		fprintf(draft, "%s = %#.9g;\n", mechanics[i].key, number);
	}
	if (stepper)
		fputs("};\n", draft);
	fputs("surface = { point_mm = [0.0, 0.0, 0.0]; normal = [0.0, 0.0, 1.0]; };\n",
	      draft);
}

static void write_rig(const struct init *init)
{
	struct {
		FILE *out;
		char group[80];
	} to = {0};
	/* The draft is in memory: it is read as any rig.conf, and leaves no file. */
	int fd = memfd_create(RIG, MFD_CLOEXEC), rc;
	char *path = cli_text("/proc/self/fd/%d", fd);
	struct incise_error err = {0};
	FILE *draft = fd < 0 ? NULL : fdopen(fd, "w");
	char *text = NULL;
	size_t size;

	if (!draft)
		cli_fail("no memory");
	put_draft(init, draft);
	if (fflush(draft))
		cli_fail("no memory");
	to.out = open_memstream(&text, &size);
	if (!to.out)
		cli_fail("no memory");
	fputs("# SPDX-License-Identifier: CC0-1.0\n# Made by incise init; rig.conf(5) has "
	      "every key with its range.\n",
	      to.out);
	rc = incise_rig_keys(path, add_key, &to, &err);
	fclose(draft);
	free(path);
	cli_check(rc, &err);
	if (*to.group)
		fputs("};\n", to.out);
	if (fclose(to.out))
		cli_fail("no memory");
	fd = open(RIG, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
	if (fd < 0)
		cli_fail("%s: %s", RIG, strerror(errno));
	errno = ENOSPC; /* of a short write */
	if (write(fd, text, size) != (ssize_t)size || fsync(fd) || close(fd)) {
		int code = errno;

		/* The next run would take a part of it for a rig. */
		unlink(RIG);
		cli_fail("%s: %s", RIG, strerror(code));
	}
	free(text);
	fprintf(init->out, "wrote %s\n", RIG);
}

/* --- calibrations ------------------------------------------------------------------------ */

/* Whether a calibration of this kind has passed, and none since has failed. */
static bool has_passed(const char *kind)
{
	struct incise_calibration_record *record = NULL;
	struct incise_error err = {0};
	int n = access(CALIBRATION, F_OK)
			? 0
			: incise_calibration_history(CALIBRATION, &record, &err);
	bool passed = false;

	cli_check(n < 0, &err);
	for (int i = 0; i < n; i++)
		if (!strcmp(record[i].kind, kind))
			passed = record[i].pass;
	free(record);
	return passed;
}

#define WORDS_MAX 16

/* Run it in the foreground. Returns whether it passed. */
static bool run_calibration(const struct init *init, const struct calibration *c,
			    const char *given)
{
	char *program = cli_text("%s/incise-calibrate-%s", cli_folder(), c->kind);
	char *words = cli_text("%s", given), *argv[WORDS_MAX] = {program}, *rest = NULL;
	int n = 1, status;

	for (char *word = strtok_r(words, " ", &rest); word && n < WORDS_MAX - 3;
	     word = strtok_r(NULL, " ", &rest))
		argv[n++] = word;
	argv[n++] = "-c";
	argv[n++] = CALIBRATION;
	fflush(init->out);
	status = child_run(argv, STDIN_FILENO, fileno(init->out), STDERR_FILENO);
	if (status < 0)
		cli_fail("%s: %s", program, strerror(errno));
	free(words), free(program);
	return WIFEXITED(status) && !WEXITSTATUS(status);
}

/* Lead through one, which is the command @line; returns false where it is left for later. */
static bool calibrate(const struct init *init, const struct calibration *c,
		      bool simulated, const char *line)
{
	const char *given = simulated ? c->simulated : c->real;
	char *answer;
	bool go;

	fprintf(init->out, "\n%s: %s\n", c->kind, c->what);
	if (!simulated)
		fprintf(init->out, "  %s\n", c->posture);
	fprintf(init->out, "  %s\n", line);
	fflush(init->out);
	if (!given || (init->yes && !simulated))
		return false;
	answer = ask_for(init, "Run it now: yes, later?", "yes");
	go = *answer == 'y';
	free(answer);
	if (go && (!run_calibration(init, c, given) || cli_stop))
		cli_fail("calibrate %s %s; 'incise init' goes on here", c->kind,
			 cli_stop ? "was stopped" : "did not pass");
	return go;
}

/* Returns the number of those that are left. */
static int calibrate_all(const struct init *init, unsigned int has)
{
	int left = 0;

	for (int i = 0; i < CALIBRATIONS; i++) {
		const struct calibration *c = &calibrations[i];
		bool simulated = has & CALIBRATION_SIMULATED, passed;
		const char *given = simulated ? c->simulated : c->real;
		char *line;

		if (!calibration_needed(c->kind, has))
			continue;
		line = cli_text("incise calibrate %s%s%s", c->kind,
				given && *given ? " " : "",
				given ? given : " --point X,Y,Z …");
		passed = has_passed(c->kind);
		if (passed)
			fprintf(init->out, "%s: passed\n", c->kind);
		else if (!init->no_calibration)
			passed = calibrate(init, c, simulated, line);
		left += !passed;
		json_array_append_new(init->calibrations,
				      json_pack("{ss ss sb}", "kind", c->kind, "command",
						line, "passed", passed));
		free(line);
	}
	return left;
}

/* --- all of it --------------------------------------------------------------------------- */

static void enter_folder(const struct init *init)
{
	if (!init->folder)
		return;
	if (mkdir(init->folder, 0777) && errno != EEXIST)
		cli_fail("%s: %s", init->folder, strerror(errno));
	if (chdir(init->folder))
		cli_fail("%s: %s", init->folder, strerror(errno));
}

static void check_init(const struct init *init)
{
	bool there = !access(RIG, F_OK), given = init->preset != UNSET;

	for (int i = 0; i < DEVICES; i++)
		given |= init->device[i] != NULL;
	for (int i = 0; i < MECHANICS; i++)
		given |= init->mechanic[i] > 0;
	if (there && given)
		cli_fail(
			"%s is there and stays as it is; leave out --preset and devices to "
			"go on with it, or move it away",
			RIG);
}

/* A command to type next, and what it is for or "". */
static void put_next(const struct init *init, const char *line, const char *what)
{
	json_array_append_new(init->next, json_string(line));
	fprintf(init->out, "  %s%s%s\n", line, *what ? "    # " : "", what);
}

static void name_next(const struct init *init, unsigned int has, int left)
{
	char *enter = cli_text("cd %s", init->folder ? init->folder : ""),
	     *what = cli_text("%s left", cli_count(left, "calibration"));

	fputs("\nNext:\n", init->out);
	if (init->folder)
		put_next(init, enter, "");
	if (left)
		put_next(init, "incise init", what);
	put_next(init, "incise doctor", "what this machine still lacks");
	if (has & INCISE_RIG_TRACKER && has & INCISE_RIG_FORCE) {
		put_next(init, "incise capture -o first.rec", "");
		put_next(init, "incise train first.rec", "");
		put_next(init, "incise haptic liver --model first.fis --duration 10s",
			 "");
	} else {
		put_next(init, "incise haptic liver", "");
	}
	free(enter), free(what);
}

int main(int argc, char **argv)
{
	static struct init init;
	unsigned int has;
	struct incise_error err = {0};
	bool there;

	cli_parse(&command, argc, argv, &init);
	if (argc - optind > 1)
		cli_usage("%s: give one folder", argv[optind + 1]);
	init.folder = argv[optind];
	init.out = init.json ? stderr : stdout;
	init.calibrations = json_array();
	init.next = json_array();
	if (!init.yes && !on_terminal())
		cli_fail(
			"there is no terminal for its questions; give --yes, and --preset or "
			"devices");
	cli_catch_signals();
	enter_folder(&init);
	check_init(&init);
	there = !access(RIG, F_OK);
	if (there)
		fprintf(init.out, "%s is there\n", RIG);
	else
		write_rig(&init);
	has = calibration_devices(RIG, &err);
	cli_check(!has, &err);
	name_next(&init, has, calibrate_all(&init, has));
	if (init.json)
		json_print(json_pack("{sb so so}", "written", !there, "calibrations",
				     init.calibrations, "next", init.next));
	cli_finish();
	return 0;
}
