/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The recordings of a joined recording, each of which has a seal of its own, and behind them the
 * joined recording itself, whose seal is that of the join.
 */
#ifndef INCISE_MEMBERS_H
#define INCISE_MEMBERS_H

#include <stdbool.h>

struct members {
	bool joined;
	int n;
	char **path; /* folders; of a recording that is not joined the only one */
};

/* Those of the recording @path. Every failure ends the program. */
void members_find(struct members *members, const char *path);

void members_free(struct members *members);

#endif
