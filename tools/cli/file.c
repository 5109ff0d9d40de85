// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Files of commands; see file.h.
 */
#include <errno.h>
#include <string.h>
#include <sys/mman.h>
#include "cli.h"
#include "file.h"

FILE *whole_file_begin(const char *path, struct incise_outfile **file)
{
	struct incise_error err = {0};

	cli_output(path);
	*file = cli_require(incise_outfile_open(path, &err), &err);
	return incise_outfile_stream(*file);
}

void whole_file_end(struct incise_outfile *file)
{
	struct incise_error err = {0};

	cli_check(file && incise_outfile_commit(file, &err), &err);
}

struct memory_file memory_file_begin(const char *name)
{
	struct memory_file file;
	/* Not closed on exec: a program that is started finds it by the same path. */
	int fd = memfd_create(name, 0);

	file.file = fd < 0 ? NULL : fdopen(fd, "w+");
	if (!file.file)
		cli_fail("%s: no memory: %s", name, strerror(errno));
	snprintf(file.path, sizeof(file.path), "/proc/self/fd/%d", fd);
	return file;
}

void memory_file_written(const struct memory_file *file)
{
	if (fflush(file->file))
		cli_fail("no memory for a file: %s", strerror(errno));
}
