/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * What stands in calibration.conf: keys in force and, below them, the history. Shared by
 * what reads the file (calibration.c) and what appends to it (calibration_history.c).
 */
#ifndef INCISE_CALIBRATION_FILE_H
#define INCISE_CALIBRATION_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <libconfig.h>
#include <incise/calibration.h>

/* One number of struct incise_calibration. */
struct calibration_key {
	const char *name; /* in the history; NULL ends the table */
	const char *unit;
	double low, high;
	size_t offset;	    /* in struct incise_calibration */
	const char *vector; /* key at the top of the file, if it is an element of one */
};

#define CALIBRATION_KEYS 17

extern const struct calibration_key incise_calibration_keys[CALIBRATION_KEYS + 1];

struct calibration_file {
	struct incise_calibration in_force;
	bool present[CALIBRATION_KEYS]; /* else nominal */
	struct incise_calibration_record *records;
	int n;
};

/* Where a key's number is. */
double *incise_calibration_at(struct incise_calibration *calibration,
			      const struct calibration_key *key);

/* Read all of a file; on 0 the caller frees file->records. */
int incise_calibration_file_read(struct calibration_file *file, const char *path,
				 struct incise_error *err);

/* Read the list `history` of a file, if it is there; on 0 the caller frees *records. */
int incise_calibration_history_read(const config_setting_t *root, const char *path,
				    struct incise_calibration_record **records, int *n,
				    struct incise_error *err);

/* Write all of a file; @notes are lines of comment to begin with. */
void incise_calibration_file_write(const struct calibration_file *file, const char *notes,
				   FILE *out);

#endif
