/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Files beside a model, which belong to its parameters: lines KEY VALUE in a fixed order, the kind with its
 * version and the checksum of the model first. Empty lines and comments (#) are skipped. Functions
 * return 0 or a negative errno, with the error in the lines.
 */
#ifndef INCISE_COMPANION_H
#define INCISE_COMPANION_H

#include <stdint.h>
#include <stdio.h>
#include <incise/model.h>
#include "../base/lines.h"

/* FNV-1a of the numbers that the output depends on, in the machine's double format. */
uint64_t incise_model_checksum(const struct incise_model *model);

/* The first two lines. *checksum: of the model; 0: of any, and then set. -ESTALE: of another one. */
int incise_companion_head(struct incise_lines *in, const char *kind, int version,
			  uint64_t *checksum);

/* The line "KEY VALUE": its value, or NULL with errno. */
char *incise_companion_value(struct incise_lines *in, const char *key);

int incise_companion_whole(struct incise_lines *in, const char *key, long least,
			   long most, long *value);

/* The line "KEY NUMBERS…" of so many finite ones. */
int incise_companion_numbers(struct incise_lines *in, const char *key, double *to, int n);

/* A line of n numbers. */
int incise_companion_row(struct incise_lines *in, double *to, int n);

/* Write such a line. */
void incise_companion_write_row(FILE *out, const double *row, int n);

/* Nothing follows. */
int incise_companion_end(struct incise_lines *in);

#endif
