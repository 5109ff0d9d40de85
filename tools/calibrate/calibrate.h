/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The driver of the incise calibrate commands: what all of them do alike. A command brings its
 * options, and a table of what is its own. Every failure ends the program.
 *
 *   options ─▶ read | measure ─▶ fit ─▶ text, JSON, plots ─▶ calibration.conf ─▶ verdict
 *                      └─▶ write (-o FILE.csv)
 */
#ifndef INCISE_CALIBRATE_H
#define INCISE_CALIBRATE_H

#include <stdbool.h>
#include <stdio.h>
#include <jansson.h>
#include <incise/calibration.h>
#include "../cli/cli.h"

/* A calibration under way; a command's struct begins with it, as `common`. */
struct calibrate {
	const char *rig, *calibration, *from, *keep, *report;
	bool dry_run, json;
	const char *raw;     /* file of the data, for the record; NULL: none */
	const char *refused; /* reason why there is no result; NULL: there is one */
	struct incise_calibration found; /* active before */
	struct incise_calibration_record *history;
	int n_history;
	struct incise_calibration_record record; /* the result */
};

/* Rows of the table of options: the first ones, and the last. */
#define CALIBRATE_RIG_OPTIONS(type)                                                    \
	{CLI_RIG_OPTION(type, common.rig)},                                            \
	{                                                                              \
		'c', "calibration", "FILE",                                            \
			"calibration to read and write (default: ./calibration.conf, " \
			"else /etc/incise/calibration.conf where that is)",            \
			CLI_INPUT(type, common.calibration)                            \
	}
#define CALIBRATE_REPORT_OPTIONS(type)                                                \
	{'o', "output", "DIR",                                                        \
	 "write report.txt, report.json and plots into this folder",                  \
	 CLI_OUTPUTS(type, common.report)},                                           \
		{0, "dry-run", NULL, "do everything except writing calibration.conf", \
		 CLI_FLAG(type, common.dry_run)},                                     \
	{                                                                             \
		0, "json", NULL, "report as JSON", CLI_FLAG(type, common.json)        \
	}

/* The functions of one kind of calibration; @run is the command's struct. */
struct calibrate_kind {
	const char *name; /* of the record */
	const struct cli_command *command;
	/* Options that do not go together, and operands, are bad usage. */
	void (*check)(void *run, int argc, char **argv);
	/* Data from --from, or without it from a rig; and as a file, or NULL. */
	void (*read)(void *run, const char *path);
	void (*measure)(void *run);
	void (*write)(const void *run, FILE *out);
	/* Fit, and fill in the record. Returns 0, or a negative errno and the reason. */
	int (*fit)(void *run, struct incise_error *err);
	/* Whether a fit without a result has a report, too. */
	bool reports_refusal;
	void (*text)(const void *run, FILE *out);    /* of report.txt */
	void (*summary)(const void *run, FILE *out); /* on standard output; or NULL */
	json_t *(*json)(const void *run);
	/* Data and plots of the report's folder; or NULL. */
	void (*draw)(const void *run, const char *folder);
};

/* The commands. */
int calibrate_force(int argc, char **argv);
int calibrate_depth(int argc, char **argv);
int calibrate_tip(int argc, char **argv);
int calibrate_delay(int argc, char **argv);
int calibrate_stepper(int argc, char **argv);
int calibrate_frame(int argc, char **argv);
int calibrate_check(int argc, char **argv);

/*
 * Read the active calibration and its history; a missing file is the nominal one, if it need not
 * be there.
 */
void calibrate_find(struct calibrate *calibrate, bool required);

/*
 * Reject --from with --rig, -o FILE.csv or --duration, of which @source ("the file") has its own; and
 * neither of --from and --duration (0: not given) without a terminal.
 */
void calibrate_check_source(const struct calibrate *calibrate, double time_s,
			    const char *source);

/* All of it; @run has the defaults of the options. Returns 0: it passed. */
int calibrate_run(const struct calibrate_kind *kind, int argc, char **argv, void *run);

/* Add a coefficient to the record, by its key; its previous value is the active one. */
void calibrate_value(struct calibrate *calibrate, const char *key, const char *unit,
		     double left, double u);

/* State the covariance of its n values, from all of it, row by row. */
void calibrate_covariance(struct incise_calibration_record *record, const double *all,
			  int n);

/*
 * Add a standard uncertainty that is not measured here, but known to who calibrates: @given, or, if
 * that is NAN and the file does not state it, the answer on a terminal, where an empty line leaves it out.
 */
void calibrate_stated(struct calibrate *calibrate, double given, const char *key,
		      const char *unit, const char *question);

/* Set words of the record. */
#define calibrate_words(field, ...) snprintf(field, sizeof(field), __VA_ARGS__)

/* A budget as JSON, with its sensitivities or without, its contributions under a key of their own. */
json_t *calibrate_budget(const struct incise_calibration_budget *budget,
			 bool sensitivities, const char *contribution);

/* The whole report as JSON, with @details, of a calibration that has no other keys. */
json_t *calibrate_json(const struct calibrate *calibrate, json_t *details);

/* Fail after a signal. */
void calibrate_check_stop(void);

/* Wait for Enter; fail at a signal and at the end of the input. */
void calibrate_await_enter(void);

/* Close a plot's script and draw it; warns if that fails. */
void calibrate_draw(FILE *script, const char *folder, const char *name);

#endif
