/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Reports as JSON: what --json prints, and what is read of that again. Numbers that are not
 * finite become null.
 */
#ifndef INCISE_JSON_H
#define INCISE_JSON_H

#include <jansson.h>
#include <stdio.h>
#include <incise/error.h>

/* A real number, or null when it is not finite. */
json_t *json_number(double value);

/* Text that may hold any bytes: those that are not UTF-8 become '?'. */
json_t *json_text(const char *text);

/* Print one object to standard output and release it. */
void json_print(json_t *object);

/* A report of a file, which may hold anything; NULL and the reason. */
json_t *json_read(const char *path, struct incise_error *err);

/* The same of what is open, and called so. */
json_t *json_read_from(FILE *file, const char *name, struct incise_error *err);

#endif
