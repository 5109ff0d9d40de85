/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Folders: made, for a while too, and taken away with all that is in them.
 */
#ifndef INCISE_FOLDER_H
#define INCISE_FOLDER_H

#include <stddef.h>

/*
 * Make one of a name that is new, in TMPDIR or /tmp; @purpose: what it is for, in a message.
 * Fails the program when it cannot.
 */
void folder_make(char *path, size_t size, const char *purpose);

/* Make a folder, and those above it, where they are missing; fails the program if it cannot. */
void folder_make_all(const char *path);

/* With all that is in it; links are not followed. 0, or -errno: some of it stays. */
int folder_remove(const char *path);

#endif
