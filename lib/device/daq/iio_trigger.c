// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * An hrtimer trigger of our own; see iio_trigger.h.
 */
#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "iio_trigger.h"

#define OURS_MAX 16 /* of one process */

int iio_trigger_make(const char *folder, char *name, size_t size)
{
	char path[PATH_MAX];

	for (int i = 0; i < OURS_MAX; i++) {
		snprintf(name, size, "incise-%ld-%d", (long)getpid(), i);
		snprintf(path, sizeof(path), "%s/%s", folder, name);
		if (!mkdir(path, 0755))
			return 0;
		if (errno != EEXIST)
			break;
	}
	name[0] = '\0';
	return -errno;
}

void iio_trigger_remove(const char *folder, const char *name)
{
	char path[PATH_MAX];

	if (!*name)
		return;
	snprintf(path, sizeof(path), "%s/%s", folder, name);
	rmdir(path);
}

void iio_trigger_sweep(const char *folder)
{
	DIR *dir = opendir(folder);
	struct dirent *entry;
	int pid, number, end;

	while (dir && (entry = readdir(dir))) {
		end = 0;
		if (sscanf(entry->d_name, "incise-%9d-%2d%n", &pid, &number, &end) == 2 &&
		    !entry->d_name[end] && pid > 0 && kill(pid, 0) && errno == ESRCH)
			iio_trigger_remove(folder, entry->d_name);
	}
	if (dir)
		closedir(dir);
}
