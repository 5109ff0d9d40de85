/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A name of a device's file that stays when devices are plugged in or out: a link by
 * udev.
 */
#ifndef INCISE_STABLE_PATH_H
#define INCISE_STABLE_PATH_H

#include <stdbool.h>
#include <stddef.h>

/*
 * The first link to @path, by name, that matches @pattern as of glob(3). False, and @link
 * is unchanged, if no path fits into @size.
 */
bool incise_stable_path(const char *pattern, const char *path, char *link, size_t size);

#endif
