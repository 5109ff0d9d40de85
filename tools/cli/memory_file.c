// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A file in memory; see memory_file.h.
 */
#include <errno.h>
#include <string.h>
#include <sys/mman.h>
#include "cli.h"
#include "memory_file.h"

struct memory_file memory_file_begin(const char *name)
{
	struct memory_file file;
	/* Not closed on exec: a program that is started finds it by the same path. */
	int fd = memfd_create(name, 0);

	file.file = fd < 0 ? NULL : fdopen(fd, "w+");
	if (!file.file)
		cli_fail("no room for %s in memory: %s", name, strerror(errno));
	snprintf(file.path, sizeof(file.path), "/proc/self/fd/%d", fd);
	return file;
}

void memory_file_written(const struct memory_file *file)
{
	if (fflush(file->file))
		cli_fail("no room for a file in memory: %s", strerror(errno));
}
