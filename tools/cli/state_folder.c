// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The folders of state pages; see state_folder.h.
 */
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>
#include "cli.h"
#include "state_folder.h"

void state_folders(char *list[STATE_FOLDERS])
{
	const char *session = getenv("XDG_RUNTIME_DIR"), *temporary = getenv("TMPDIR");

	list[STATE_FOLDER_SYSTEM] = cli_text("/run/incise");
	list[STATE_FOLDER_SESSION] =
		session && *session == '/' ? cli_text("%s/incise", session) : NULL;
	list[STATE_FOLDER_TEMPORARY] =
		cli_text("%s/incise-%u",
			 temporary && *temporary == '/' ? temporary : "/tmp",
			 (unsigned int)geteuid());
}

void state_folders_free(char *list[STATE_FOLDERS])
{
	for (int i = 0; i < STATE_FOLDERS; i++)
		free(list[i]);
}

/* Not through a link, which another user may have put there. */
static bool is_own(const char *path)
{
	struct stat st;

	return !lstat(path, &st) && S_ISDIR(st.st_mode) && st.st_uid == geteuid() &&
	       !(st.st_mode & 022);
}

static bool is_folder(const char *path)
{
	struct stat st;

	return !stat(path, &st) && S_ISDIR(st.st_mode);
}

bool state_folder_trusted(char *const list[STATE_FOLDERS], int i)
{
	return list[i] && (i != STATE_FOLDER_TEMPORARY || is_own(list[i]));
}

int state_folder_choose(char *const list[STATE_FOLDERS])
{
	for (int i = 0; i < STATE_FOLDERS; i++) {
		if (!list[i])
			continue;
		/* The system's folder has a group, so the package makes it. */
		if (i != STATE_FOLDER_SYSTEM)
			mkdir(list[i], 0700);
		if (is_folder(list[i]) && state_folder_trusted(list, i) &&
		    !access(list[i], W_OK))
			return i;
	}
	return -1;
}
