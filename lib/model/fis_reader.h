/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * MATLAB's .fis file as it is read: every number is checked and every error named by line.
 *
 *   [System]  Type='sugeno' NumInputs=2 NumRules=20 AndMethod='prod' …
 *   [Input1]  Name='depth_mm' Range=[0 20] NumMFs=5 MF1='in1mf1':'gaussmf',[2.1 0]
 *   [Output1] MF1='out1mf1':'linear',[p1 p2 p0]
 *   [Rules]   1 1, 1 (1) : 1
 */
#ifndef INCISE_FIS_READER_H
#define INCISE_FIS_READER_H

#include <stdio.h>
#include "model.h"

/* A consequent as the file has it; rules refer to it by number. */
struct incise_fis_consequent {
	bool seen, constant;
	double p[INCISE_MODEL_INPUTS_MAX + 1];
};

struct incise_fis_reader {
	FILE *file;
	const char *path;
	int line;
	char *text; /* of the line, without white space at its ends */
	size_t size;
	struct incise_error *err;
	struct incise_model *model;
	/* What has been seen so far; bits of MFs by number. */
	bool system, output, rules;
	int n_rules; /* promised */
	int n_out_mfs;
	uint32_t inputs_seen;
	uint32_t ranges_seen;
	uint64_t mfs_seen[INCISE_MODEL_INPUTS_MAX];
	struct incise_fis_consequent out[INCISE_MODEL_RULES_MAX];
};

/* The error with the place in front; returns -code. */
int incise_fis_fail(struct incise_fis_reader *in, int code, const char *fmt, ...)
	INCISE_PRINTF(3, 4);

/* Next line that says something: 1, or 0 at the end of the file. */
int incise_fis_next_line(struct incise_fis_reader *in);

/* 'NAME' at *text, which moves behind it. */
int incise_fis_quoted(struct incise_fis_reader *in, const char **text, char *name);

/* [a b c]: just n finite numbers, then the end of the line. */
int incise_fis_numbers(struct incise_fis_reader *in, const char *text, double *values,
		       int n);

/* A whole number from min to max, then the end of the line. */
int incise_fis_whole(struct incise_fis_reader *in, const char *key, const char *text,
		     int min, int max, int *value);

/* A key of [System]; those that do not change a Sugeno model's output are passed over. */
int incise_fis_system_key(struct incise_fis_reader *in, const char *key,
			  const char *value);

/* A key of an input's section, i from 0 on. */
int incise_fis_input_key(struct incise_fis_reader *in, int i, const char *key,
			 const char *value);

int incise_fis_output_key(struct incise_fis_reader *in, const char *key,
			  const char *value);

/* What must have been said before [Rules] can be read. */
int incise_fis_check_variables(struct incise_fis_reader *in);

/* "1 2, 3 (1) : 1" */
int incise_fis_rule(struct incise_fis_reader *in);

#endif
