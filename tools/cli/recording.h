/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A recording that exists already: to read, to remove, to replace. Every failure ends the
 * program.
 */
#ifndef INCISE_TOOLS_RECORDING_H
#define INCISE_TOOLS_RECORDING_H

#include <incise/recording.h>

/* Open one. */
struct incise_recording *recording_open(const char *path);

/* Remove a recording; a folder with anything else in it stays. */
void recording_remove(const char *path);

/* Fail if recording_replace() could not replace what is at @path. */
void recording_check(const char *path);

/* Put the new recording in the place of the old one in one step, then remove that. */
void recording_replace(const char *new, const char *path);

#endif
