/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The folder of a recording that stands there already. All of these fail the program.
 */
#ifndef INCISE_RECORDING_FOLDER_H
#define INCISE_RECORDING_FOLDER_H

/* Remove a recording; anything that is not part of one keeps its folder standing. */
void recording_folder_remove(const char *path);

/* Fail before anything is recorded if that could not be replaced in the end. */
void recording_folder_check(const char *path);

/* Put the new recording in the place of the old one in one step, then drop that. */
void recording_folder_replace(const char *new, const char *path);

#endif
