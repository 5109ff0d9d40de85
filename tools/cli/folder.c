// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Folders for a while; see folder.h.
 */
#include <errno.h>
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include "cli.h"
#include "folder.h"

void folder_make(char *path, size_t size, const char *purpose)
{
	const char *where = getenv("TMPDIR");
	int length = snprintf(path, size, "%s/incise.XXXXXX",
			      where && *where ? where : "/tmp");

	if (length >= (int)size)
		cli_fail("TMPDIR: its path is too long; set another");
	if (!mkdtemp(path))
		cli_fail("%s: no folder %s: %s; set TMPDIR", path, purpose,
			 strerror(errno));
}

void folder_make_all(const char *path)
{
	char *folder = cli_text("%s", path);

	for (char *slash = folder; slash; *slash = '/') {
		slash = strchr(slash + 1, '/');
		if (slash)
			*slash = 0;
		if (mkdir(folder, 0777) && errno != EEXIST)
			cli_fail("%s: %s", folder, strerror(errno));
		if (!slash)
			break;
	}
	free(folder);
}

static int remove_one(const char *path, const struct stat *about, int kind,
		      struct FTW *place)
{
	(void)about, (void)kind, (void)place;
	return remove(path);
}

int folder_remove(const char *path)
{
	return nftw(path, remove_one, 16, FTW_DEPTH | FTW_PHYS) ? -errno : 0;
}
