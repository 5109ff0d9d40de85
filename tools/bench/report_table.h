/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Tables of the report out of the JSON of a bench; see report_sections.h.
 */
#ifndef INCISE_REPORT_TABLE_H
#define INCISE_REPORT_TABLE_H

#include <jansson.h>
#include <stdbool.h>
#include "document.h"
#include "report_sections.h"

/* Append it; nothing, where the JSON has no such rows. */
void report_table_put(struct document *d, const struct report_table *table,
		      const json_t *word);

/* A fact's figure with so many digits; false where there is none. */
bool report_fact_text(const struct report_fact *fact, const json_t *word, char *text,
		      size_t size);

/* A number for people: 0.0123, 45678, 1.3×10⁻¹⁵; "–" where there is none. */
void report_number(double value, int digits, char *text, size_t size);

#endif
