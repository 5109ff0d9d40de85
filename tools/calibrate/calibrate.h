/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The common part of all incise calibrate commands: options, the calibration before, the
 * files of --report DIR, and the end with a result. Every failure ends the program.
 */
#ifndef INCISE_CALIBRATE_H
#define INCISE_CALIBRATE_H

#include <stdbool.h>
#include <stdio.h>
#include <jansson.h>
#include <incise/calibration.h>
#include <incise/infile.h>
#include "../cli/cli.h"
#include "../cli/file.h"

/* -r, -c, --from, --keep, --report, --dry-run and --json of a command. */
struct calibrate_options {
	const char *rig, *calibration, *from, *keep, *report;
	bool dry_run, json;
	struct incise_calibration found; /* active before */
	struct incise_calibration_record *history;
	int n_history;
};

/* The option -c of a command, whose options begin with these as `common`. */
#define CALIBRATE_FILE_OPTION(type)                                            \
	'c', "calibration", "FILE",                                            \
		"calibration to read and write (default: ./calibration.conf, " \
		"else /etc/incise/calibration.conf where that is)",            \
		CLI_INPUT(type, common.calibration)

/* Read the active calibration and its history; a missing file is the nominal one. */
void calibrate_find(struct calibrate_options *options);

/* Reject options that exclude each other, read the calibration, make the report's folder. */
void calibrate_begin(struct calibrate_options *options);

/* Add a coefficient to the record. */
void calibrate_value(struct incise_calibration_record *record, const char *key,
		     const char *unit, double found, double left, double u);

/*
 * Add a standard uncertainty that is not measured here, but known to who calibrates: @given, or, if
 * that is NAN and the file does not state it, the answer on a terminal, where an empty line leaves it out.
 */
void calibrate_stated(const struct calibrate_options *options,
		      struct incise_calibration_record *record, double given,
		      const char *key, const char *unit, const char *question);

/* DIR/report.txt, for whole_file_end(); both NULL without a DIR. Each file appears whole. */
FILE *calibrate_report_text(const char *folder, struct incise_outfile **file);

/* DIR/report.json; releases @object. */
void calibrate_report_json(const char *folder, json_t *object);

/* Make DIR/plot; false with a warning: gnuplot is not installed. */
bool calibrate_can_plot(const char *folder);

/*
 * The block that ends each report: per value of the record its U, the previous value with its
 * date, and the change; pass or FAIL with the limits of the verdict.
 */
void calibrate_result_text(const struct calibrate_options *options,
			   const struct incise_calibration_record *record, FILE *out);

/* The same on standard output, with the file written, or why it was not. */
void calibrate_result(const struct calibrate_options *options,
		      const struct incise_calibration_record *record);

/* Append the record unless it is a dry run; fails after a signal. */
void calibrate_append(const struct calibrate_options *options,
		      const struct incise_calibration_record *record);

/* Flush the report, and fail if the calibration did not pass. */
void calibrate_require_pass(const struct incise_calibration_record *record);

/*
 * End with a result that passed: append it unless it is a dry run, write report.json, and print it as
 * text or JSON, with @details in the JSON.
 */
void calibrate_end(const struct calibrate_options *options,
		   const struct incise_calibration_record *record, json_t *details);

/* A CSV file of the data of a calibration; ends the program where it cannot be read. */
struct incise_infile *calibrate_open(const char *path);

/* Read its next line; false at its end. Ends the program on an error. */
bool calibrate_line(struct incise_infile *file, char **line);

/*
 * Cut a line of CSV at its commas, in place, and strip the characters of @before and @after
 * around each field. Returns the number of fields; more than @max end the program.
 */
int calibrate_cut(const char *path, int number, char *line, char **fields, int max,
		  const char *before, const char *after);

/* The place of a column among the names of a header, or -1; ends the program if it is there twice. */
int calibrate_column(const char *path, int line, char **fields, int n, const char *name);

/* End the program unless a row has a field for each column. */
void calibrate_width(const char *path, int line, int n, int columns);

#endif
