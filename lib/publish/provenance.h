/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The provenance of exported data: pairs of key and text, in order, in the exported file
 * (attributes of HDF5, metadata of MCAP, comments of CSV).
 */
#ifndef INCISE_PROVENANCE_H
#define INCISE_PROVENANCE_H

#include <incise/calibration.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/recording.h>

#define INCISE_PROVENANCE_MAX 48

/* Set to {0} before use. */
struct incise_provenance {
	struct incise_provenance_item {
		const char *key; /* not owned */
		char *value;	 /* UTF-8, no control characters */
	} items[INCISE_PROVENANCE_MAX];
	int n;
	int rc; /* of the first addition that failed: -ENOMEM, -E2BIG */
};

/* Add a pair, unless its value is empty; nothing after a failure. */
void incise_provenance_add(struct incise_provenance *provenance, const char *key,
			   const char *fmt, ...) INCISE_PRINTF(3, 4);

/*
 * The provenance of an export: incise, date, sources, options, calibration; of the rows of a
 * table if @table is not NULL. Returns 0 or -errno with a message.
 */
int incise_provenance_of(struct incise_provenance *provenance,
			 struct incise_recording *const *recordings, int n,
			 const struct incise_export_options *options, const char *table,
			 struct incise_error *err);

void incise_provenance_free(struct incise_provenance *provenance);

#endif
