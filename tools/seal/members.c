// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The recordings of a joined recording; see members.h.
 */
#include <stdlib.h>
#include <incise/session.h>
#include "../cli/cli.h"
#include "members.h"
#include "seal.h"

void members_find(struct members *members, const char *path)
{
	const struct incise_session_info *info;
	char *folder = seal_recording(path), *all = cli_text("%s:*", folder);
	/* A stream of each member that has it; a plain recording opens so, too, or says why not later. */
	struct incise_recording *recording = incise_recording_open(all, NULL);
	int n = recording ? incise_session_members(recording, &info) : 0;

	*members = (struct members){.joined = n > 0, .n = n + 1};
	members->path = cli_alloc((size_t)members->n, sizeof(*members->path));
	for (int i = 0; i < n; i++)
		members->path[i] = cli_text("%s/%s", folder, info[i].name);
	members->path[n] = folder;
	incise_recording_close(recording);
	free(all);
}

void members_free(struct members *members)
{
	for (int i = 0; i < members->n; i++)
		free(members->path[i]);
	free(members->path);
}
