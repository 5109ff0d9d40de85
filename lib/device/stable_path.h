/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A name of a device's file that stays when others are plugged in, out or elsewhere: one of
 * the links that udev makes.
 */
#ifndef INCISE_STABLE_PATH_H
#define INCISE_STABLE_PATH_H

#include <stdbool.h>
#include <stddef.h>

/*
 * The first link, in the order of their names, that leads to @path, of those that @pattern
 * has, as in glob(3). Without one, or where it is longer than @size has room for: false, and
 * @link is as it was.
 */
bool incise_stable_path(const char *pattern, const char *path, char *link, size_t size);

#endif
