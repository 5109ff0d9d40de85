/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A folder in the place of /, with files of /proc and /sys that a test chooses. */
#ifndef INCISE_TEST_ROOT_FOLDER_H
#define INCISE_TEST_ROOT_FOLDER_H

#include <errno.h>
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

struct root_folder {
	char path[40];
};

static inline void root_folder_make(struct root_folder *root)
{
	strcpy(root->path, "/tmp/incise-root-XXXXXX");
	if (!mkdtemp(root->path))
		abort();
}

static inline int root_folder_unlink(const char *path, const struct stat *status,
				     int kind, struct FTW *level)
{
	(void)status;
	(void)kind;
	(void)level;
	return remove(path);
}

static inline void root_folder_remove(const struct root_folder *root)
{
	nftw(root->path, root_folder_unlink, 16, FTW_DEPTH | FTW_PHYS);
}

/* Write a file, with its folders. */
static inline void root_folder_put(const struct root_folder *root, const char *path,
				   const void *data, size_t n)
{
	char whole[512];
	FILE *out;

	snprintf(whole, sizeof(whole), "%s%s", root->path, path);
	for (char *c = whole + strlen(root->path) + 1; *c; c++)
		if (*c == '/') {
			*c = 0;
			if (mkdir(whole, 0700) && errno != EEXIST)
				abort();
			*c = '/';
		}
	out = fopen(whole, "w");
	if (!out || fwrite(data, 1, n, out) != n || fclose(out))
		abort();
}

static inline void root_folder_say(const struct root_folder *root, const char *path,
				   const char *text)
{
	root_folder_put(root, path, text, strlen(text));
}

#endif
