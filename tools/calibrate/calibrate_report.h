/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The files of a calibration's --report DIR: each is there whole, or not at all.
 */
#ifndef INCISE_CALIBRATE_REPORT_H
#define INCISE_CALIBRATE_REPORT_H

#include <stdio.h>
#include <jansson.h>
#include "../cli/file.h"

/* DIR/report.txt, for whole_file_end(); both NULL without a DIR. Fails the program. */
FILE *calibrate_report_text(const char *folder, struct incise_outfile **file);

/* DIR/report.json. */
void calibrate_report_json(const char *folder, const json_t *object);

#endif
