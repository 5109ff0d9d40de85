/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Reports as JSON: printed for --json, and read back. Numbers that are not finite become
 * null.
 */
#ifndef INCISE_JSON_H
#define INCISE_JSON_H

#include <jansson.h>
#include <stdio.h>
#include <incise/error.h>

/* A real number, or null if it is not finite; and an array of them. */
json_t *json_number(double value);
json_t *json_numbers(const double *values, int n);

/* Text that may hold any bytes: those that are not UTF-8 become '?'; and null for an empty one. */
json_t *json_text(const char *text);
json_t *json_text_or_null(const char *text);

/* The same of a text that it frees. */
json_t *json_taken(char *text);

/* An array of the names of the bits that are set, from the lowest on. */
json_t *json_bits(unsigned int bits, const char *const *names, size_t n);

/* Set a key of an object to a number, by json_number(), or to an integer. */
void json_set_number(json_t *object, const char *key, double value);
void json_set_integer(json_t *object, const char *key, json_int_t value);

/*
 * Put "schema": "incise/COMMAND/1" in front of the keys of an object that is a whole report, and
 * return it; NULL stays NULL. One that has its schema keeps it. @command: for example "bench loop", whose
 * blanks become slashes, or NULL for the command that runs. schema/COMMAND.rows describes it.
 */
json_t *json_with_schema(json_t *object, const char *command);

/*
 * Write one report with its schema, and a newline. @form: JSON_INDENT(n) or JSON_COMPACT, with
 * JSON_REAL_PRECISION(n) if not 12 digits. Returns 0, or -1 if the object is NULL or cannot be
 * written.
 */
int json_write(FILE *out, json_t *object, size_t form);

/* Print one report with its schema to standard output and release it. */
void json_print(json_t *object);

/* Read JSON text, which may hold anything; @name: for messages; NULL and the reason. */
json_t *json_parse(const char *text, size_t n, const char *name,
		   struct incise_error *err);

/* Read a report from a file, which may hold anything; NULL and the reason. */
json_t *json_read(const char *path, struct incise_error *err);

/* The same from an open file; @name: for messages. */
json_t *json_read_from(FILE *file, const char *name, struct incise_error *err);

#endif
