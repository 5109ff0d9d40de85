/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Where exported data comes from: pairs of key and text, in order, that a file carries
 * along (attributes of HDF5, metadata of MCAP, comments of CSV).
 */
#ifndef INCISE_LINEAGE_H
#define INCISE_LINEAGE_H

#include <incise/calibration.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/recording.h>

/* An export of some thousand recordings stays within. */
#define INCISE_LINEAGE_MAX 32

/* Set to {0} before use. */
struct incise_lineage {
	struct incise_lineage_item {
		const char *key; /* not owned */
		char *value;	 /* UTF-8, no control characters */
	} items[INCISE_LINEAGE_MAX];
	int n;
};

/* Add a pair; an empty value is left out. Returns 0 or -ENOMEM, -E2BIG. */
int incise_lineage_add(struct incise_lineage *lineage, const char *key, const char *fmt,
		       ...) INCISE_PRINTF(3, 4);

/*
 * What an export of recordings has to say: incise, date, sources, options, calibration.
 * Returns 0 or -errno with a message.
 */
int incise_lineage_of(struct incise_lineage *lineage,
		      struct incise_recording *const *recordings, int n,
		      const struct incise_export_options *options,
		      struct incise_error *err);

void incise_lineage_free(struct incise_lineage *lineage);

#endif
