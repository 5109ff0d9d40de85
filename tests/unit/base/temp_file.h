/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * One file in a folder of its own, for tests of readers; temp_file_free() removes both.
 */
#ifndef INCISE_TEST_TEMP_FILE_H
#define INCISE_TEST_TEMP_FILE_H

#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

struct temp_file {
	char dir[200], path[256];
};

static inline struct temp_file temp_file_new(const char *name, const char *text)
{
	const char *base = getenv("TMPDIR");
	struct temp_file file;
	FILE *stream;

	snprintf(file.dir, sizeof(file.dir), "%s/incise-XXXXXX", base ? base : "/tmp");
	if (!mkdtemp(file.dir))
		abort();
	snprintf(file.path, sizeof(file.path), "%s/%s", file.dir, name);
	stream = fopen(file.path, "w");
	if (!stream || fputs(text, stream) < 0 || fclose(stream))
		abort();
	return file;
}

static inline void temp_file_free(const struct temp_file *file)
{
	unlink(file->path);
	rmdir(file->dir);
}

#endif
