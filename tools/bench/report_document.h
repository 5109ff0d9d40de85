/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The report of incise bench all, put together from what the words said.
 */
#ifndef INCISE_REPORT_DOCUMENT_H
#define INCISE_REPORT_DOCUMENT_H

#include <jansson.h>
#include "document.h"

/*
 * @report is report.json, see incise-bench-all(1); pictures are looked for in the folder.
 * The caller frees the document.
 */
struct document *report_document(const json_t *report, const char *folder);

#endif
