// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A GPIO chip by its name or label; see gpio_lines.h. Labels are not unique: two adapters of one kind have one.
 */
#include <errno.h>
#include <glob.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include "gpio_lines.h"

#define SAME_MAX 16

/* Whether another name of a device was seen; a Raspberry Pi 4 has two for one chip. */
static bool was_seen(dev_t device, const dev_t *seen, size_t n)
{
	for (size_t i = 0; i < n; i++)
		if (seen[i] == device)
			return true;
	return false;
}

int gpio_chip_find(const char *name, char path[GPIO_PATH_MAX],
		   char several[GPIO_SEVERAL_MAX])
{
	dev_t seen[SAME_MAX];
	size_t n = 0, used = 0;
	int rc = -ENOENT;
	glob_t found;

	if (strchr(name, '/'))
		return snprintf(path, GPIO_PATH_MAX, "%s", name) < GPIO_PATH_MAX
			       ? 0
			       : -ENOENT;
	if (glob("/dev/gpiochip*", 0, NULL, &found))
		return -ENOENT;
	*several = 0;
	for (size_t i = 0; i < found.gl_pathc && n < SAME_MAX; i++) {
		const char *at = found.gl_pathv[i];
		int is = gpio_chip_called(at, name);
		struct stat st;

		if (is == -EACCES && rc == -ENOENT)
			rc = -EACCES;
		if (is <= 0 || stat(at, &st) || was_seen(st.st_rdev, seen, n))
			continue;
		seen[n++] = st.st_rdev;
		snprintf(path, GPIO_PATH_MAX, "%s", at);
		if (used < GPIO_SEVERAL_MAX)
			used += (size_t)snprintf(several + used, GPIO_SEVERAL_MAX - used,
						 "%s%s", used ? ", " : "", at);
	}
	globfree(&found);
	return n == 1 ? 0 : n ? -ENOTUNIQ : rc;
}
