// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Links of udev to a device's file; see stable_path.h.
 */
#include <glob.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include "stable_path.h"

bool incise_stable_path(const char *pattern, const char *path, char *link, size_t size)
{
	char real[PATH_MAX], own[PATH_MAX];
	bool is = false;
	glob_t links;

	if (!realpath(path, own) || glob(pattern, 0, NULL, &links))
		return false;
	for (size_t i = 0; i < links.gl_pathc && !is; i++) {
		const char *one = links.gl_pathv[i];

		is = strlen(one) < size && realpath(one, real) && !strcmp(real, own);
		if (is)
			memcpy(link, one, strlen(one) + 1);
	}
	globfree(&links);
	return is;
}
