/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside a recording that was opened for reading; for lib/record only.
 */
#ifndef INCISE_RECORDING_PRIVATE_H
#define INCISE_RECORDING_PRIVATE_H

#include <sqlite3.h>
#include <incise/recording.h>

struct incise_recording {
	sqlite3 *db; /* read-only, in one transaction: a snapshot, even of a live one */
	char *path;  /* of the folder that was opened */
	char *name;  /* "liver" of dir/liver.rec and of dir/liver.rec.part */
	int form;    /* of its tables, see schema.h */
	uint64_t depth_rows;
	struct incise_recording_info meta; /* as far as the table `meta` says */
};

#endif
