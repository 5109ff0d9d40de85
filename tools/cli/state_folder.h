/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The folders of state pages, for the loop that puts its page there and for readers of it:
 *
 *     /run/incise                  of the service and its group
 *     $XDG_RUNTIME_DIR/incise      of this user
 *     /tmp/incise-UID              of this user, where there is neither; $TMPDIR instead of /tmp
 */
#ifndef INCISE_STATE_FOLDER_H
#define INCISE_STATE_FOLDER_H

#include <stdbool.h>

enum { STATE_FOLDER_SYSTEM, STATE_FOLDER_SESSION, STATE_FOLDER_TEMPORARY, STATE_FOLDERS };

/* Their paths, in this order; NULL: there is none. */
void state_folders(char *list[STATE_FOLDERS]);
void state_folders_free(char *list[STATE_FOLDERS]);

/*
 * Whether pages in it are what they say: anybody may make the temporary one, so that counts only
 * if it is this user's and nobody else may write there.
 */
bool state_folder_trusted(char *const list[STATE_FOLDERS], int i);

/* The first that this user may write to, made if it is missing; -1: none. */
int state_folder_choose(char *const list[STATE_FOLDERS]);

#endif
