// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The folder of the programs; see cli.h. It is an object of its own, so that a program elsewhere
 * (tests/bench) can name the folder itself.
 */
#include <libgen.h>
#include <limits.h>
#include <unistd.h>
#include "cli.h"

const char *cli_folder(void)
{
	static char path[PATH_MAX];
	ssize_t n = readlink("/proc/self/exe", path, sizeof(path) - 1);

	path[n > 0 ? n : 0] = 0;
	return dirname(path);
}
