/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The report of incise bench all: report.md, a template of Markdown, with the figures of
 * report.json in its places.
 */
#ifndef INCISE_REPORT_H
#define INCISE_REPORT_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

/* A benchmark's section of the template. */
struct report_section {
	char benchmark[32], title[100];
	char program[32]; /* that has the benchmark */
	bool plots;
};

/* In the order of the template; the last one has no benchmark. */
const struct report_section *report_sections(void);

/* Write report.json, and what else the template names, as Markdown; plots are looked for in its
 * folder. */
void report_markdown(const json_t *report, const char *folder, FILE *out);

/* A number for people: 0.0123, 45678, 1.3×10⁻¹⁵; "–" where there is none. */
void report_number(double value, int digits, char *text, size_t size);

extern const char text_report_md[];

#endif
