// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The files of a calibration's report; see calibrate_report.h.
 */
#include <stdlib.h>
#include "calibrate_report.h"
#include "cli.h"

static struct incise_outfile *begin(const char *folder, const char *name)
{
	struct incise_error err = {0};
	struct incise_outfile *file;
	char *path;

	if (asprintf(&path, "%s/%s", folder, name) < 0)
		cli_fail("no memory");
	file = incise_outfile_open(path, &err);
	if (!file)
		cli_fail_with(&err);
	free(path);
	return file;
}

FILE *calibrate_report_text(const char *folder, struct incise_outfile **file)
{
	*file = folder ? begin(folder, "report.txt") : NULL;
	return *file ? incise_outfile_stream(*file) : NULL;
}

void calibrate_report_end(struct incise_outfile *file)
{
	struct incise_error err = {0};

	if (file && incise_outfile_commit(file, &err))
		cli_fail_with(&err);
}

void calibrate_report_json(const char *folder, const json_t *object)
{
	struct incise_outfile *file = begin(folder, "report.json");
	FILE *out = incise_outfile_stream(file);

	if (!object || json_dumpf(object, out, JSON_INDENT(2) | JSON_REAL_PRECISION(12)))
		cli_fail("%s/report.json: no memory", folder);
	fputc('\n', out);
	calibrate_report_end(file);
}
