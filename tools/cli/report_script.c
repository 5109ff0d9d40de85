// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Runs the scripts of reports; see report_script.h. They run in Debian's Python, whose packages
 * have jinja2, and not in one that a virtual environment puts first in PATH.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "child.h"
#include "cli.h"
#include "features.h"
#include "file.h"
#include "report_script.h"

/* The last line that it said. */
static int failed_report_script(FILE *said, struct incise_error *err)
{
	char line[400] = "it failed", text[400];

	rewind(said);
	while (fgets(text, sizeof(text), said)) {
		text[strcspn(text, "\n")] = 0;
		if (*text)
			strcpy(line, text);
	}
	return incise_error_set(err, EIO, "report: %s", line);
}

char *report_script_path(const char *name)
{
	return cli_text("%s/../share/incise/report/%s.py", cli_folder(), name);
}

int report_script(const char *what, const char *folder, const json_t *data, FILE *out,
		  struct incise_error *err)
{
	bool own = !strcmp(what, "compare") || !strcmp(what, "tables");
	char *script = report_script_path(own ? what : "report");
	char *const argv[] = {REPORT_PYTHON, "-B",	     script,
			      (char *)what,  (char *)folder, NULL};
	struct memory_file in = memory_file_begin("page"),
			   said = memory_file_begin("said");
	int status, rc = 0;

	if (data)
		json_dumpf(data, in.file, JSON_COMPACT);
	rewind(in.file);
	if (out)
		fflush(out);
	status = child_run(argv, fileno(in.file), out ? fileno(out) : -1,
			   fileno(said.file));
	if (status < 0)
		rc = incise_error_set(err, errno, "report: %s: %s; %s", REPORT_PYTHON,
				      strerror(errno), features_remedy("jinja2"));
	else if (status)
		rc = failed_report_script(said.file, err);
	fclose(in.file);
	fclose(said.file);
	free(script);
	return rc;
}
