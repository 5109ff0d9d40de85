// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The files of a calibration's report; see calibrate_report.h.
 */
#include <stdlib.h>
#include "calibrate_report.h"
#include "../cli/cli.h"

static FILE *begin(const char *folder, const char *name, struct incise_outfile **file)
{
	FILE *out;
	char *path;

	if (asprintf(&path, "%s/%s", folder, name) < 0)
		cli_fail("no memory");
	out = whole_file_begin(path, file);
	free(path);
	return out;
}

FILE *calibrate_report_text(const char *folder, struct incise_outfile **file)
{
	*file = NULL;
	return folder ? begin(folder, "report.txt", file) : NULL;
}

void calibrate_report_json(const char *folder, const json_t *object)
{
	struct incise_outfile *file;
	FILE *out = begin(folder, "report.json", &file);

	if (!object || json_dumpf(object, out, JSON_INDENT(2) | JSON_REAL_PRECISION(12)))
		cli_fail("%s/report.json: no memory", folder);
	fputc('\n', out);
	whole_file_end(file);
}
