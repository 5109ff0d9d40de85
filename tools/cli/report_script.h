/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The scripts that make reports of JSON, tools/report/report.py with jinja2, and those of incise bench,
 * which compare two, tools/report/compare.py, and print one, tools/report/tables.py.
 */
#ifndef INCISE_REPORT_SCRIPT_H
#define INCISE_REPORT_SCRIPT_H

#include <jansson.h>
#include <stdio.h>
#include <incise/error.h>

#define REPORT_PYTHON "/usr/bin/python3"

/* Path of a script, "measure": free(3). */
char *report_script_path(const char *name);

/*
 * Run it until it ends. @what: "check", whether it can run; "bench", report.json of a folder as
 * report.md and report.html; "page" and "demo", @data as HTML into @out, with the plots of the folder;
 * "compare", two reports of @data as their comparison; "tables", the report @data as text.
 * Returns 0, or a negative errno with the script's last line.
 */
int report_script(const char *what, const char *folder, const json_t *data, FILE *out,
		  struct incise_error *err);

#endif
