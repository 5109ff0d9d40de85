// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A file that is there whole; see whole_file.h.
 */
#include "cli.h"
#include "whole_file.h"

FILE *whole_file_begin(const char *path, struct incise_outfile **file)
{
	struct incise_error err = {0};

	*file = incise_outfile_open(path, &err);
	if (!*file)
		cli_fail_with(&err);
	return incise_outfile_stream(*file);
}

void whole_file_end(struct incise_outfile *file)
{
	struct incise_error err = {0};

	if (file && incise_outfile_commit(file, &err))
		cli_fail_with(&err);
}
