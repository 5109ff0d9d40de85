/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The words of incise bench, run one after the other as programs of their own.
 */
#ifndef INCISE_REPORT_MEASURE_H
#define INCISE_REPORT_MEASURE_H

#include <jansson.h>
#include <stdbool.h>
#include "report_sections.h"

struct report_measure {
	const char *folder; /* has data/ and pictures/ */
	bool quick;
	json_t *report; /* gets words, runs and failed */
};

/*
 * Measure @section's word into the folder and the report; number so many of so many. On a
 * signal it ends the program that measures and returns.
 */
void report_measure(const struct report_measure *measure,
		    const struct report_section *section, int number, int of);

#endif
