// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A part of a recording; see range.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "cut.h"
#include "range.h"
#include "source.h"

/* Until filters have settled; the smoother needs 40 to 72 records. */
#define SETTLED_NS 2000000000LL
#define SETTLED_RECORDS 100
/* Places outside of tissue, of which the newest that is old enough counts. */
#define PLACES 16
/* Clear of the tissue. */
#define CLEAR_MM -0.5
#define CLEAR_NS 300000000LL
/* Force as slow as this, in rates of the tracker, may miss a cut of the poses. */
#define FORCE_LEAST 4.0
/* Behind the end, for filters that look ahead. */
#define BEHIND_NS 1000000000LL

struct range_walk {
	int64_t settled_ns;
	struct place {
		int64_t t_ns;
		int cuts;
	} place[PLACES], begin;
	int n;
	struct incise_cut_count cut;
	int64_t clear_ns; /* last time that it was not clear */
};

/*
 * Note a place outside, where the blade has been clear of the tissue for a while, so that its smoothed depth is,
 * too; in a cut the one before it stays.
 */
static void note_range(struct range_walk *walk, int64_t t_ns, double depth_mm)
{
	const int64_t apart_ns = walk->settled_ns / (PLACES / 4);

	for (int i = 0; i < walk->n && walk->place[i].t_ns <= t_ns - walk->settled_ns;
	     i++)
		walk->begin = walk->place[i];
	if (depth_mm > CLEAR_MM)
		walk->clear_ns = t_ns;
	if (walk->cut.inside || t_ns - walk->clear_ns < CLEAR_NS ||
	    (walk->n && t_ns - walk->place[walk->n - 1].t_ns < apart_ns))
		return;
	if (walk->n == PLACES) {
		for (int i = 1; i < PLACES; i++)
			walk->place[i - 1] = walk->place[i];
		walk->n--;
	}
	walk->place[walk->n++] = (struct place){t_ns, walk->cut.count};
}

static void init_walk(struct range_walk *walk, double tracker_hz)
{
	*walk = (struct range_walk){.settled_ns = SETTLED_NS, .begin.t_ns = INT64_MIN};
	if (tracker_hz > 0 && SETTLED_RECORDS / tracker_hz * 1e9 > SETTLED_NS)
		walk->settled_ns =
			(int64_t)fmin(SETTLED_RECORDS / tracker_hz * 1e9, 1e12);
}

/* Add a depth. Returns whether the range begins there, or the cut that is asked for has ended. */
static bool step_range(struct range_walk *walk, struct incise_recording_range *range,
		       int64_t from_ns, int64_t t_ns, double depth_mm)
{
	const bool inside = walk->cut.inside;

	incise_cut_step(&walk->cut, depth_mm);
	if (!inside)
		note_range(walk, t_ns, depth_mm);
	else
		walk->clear_ns = t_ns;
	if (!range->cut)
		return t_ns >= from_ns;
	range->end_ns = t_ns + BEHIND_NS;
	return inside && !walk->cut.inside && walk->cut.count == range->cut;
}

/* Follow the depths behind a time, when the blade was outside, to where the range begins. */
static int follow_range(struct incise_recording *recording, struct range_walk *walk,
			int64_t behind_ns, struct incise_recording_range *range,
			int64_t from_ns, struct incise_error *err)
{
	struct incise_source source;
	bool found = false;
	int rc = incise_source_open_at(&source, recording, INCISE_SOURCE_DEPTH,
				       incise_source_seek(recording, "depth", behind_ns),
				       err);

	if (rc)
		return rc;
	while (!found && (rc = incise_source_next(&source, err)) > 0)
		for (size_t k = 0; k < source.batch.n && !found; k++) {
			const int64_t t_ns = source.batch.column[1].i[k];

			found = t_ns > behind_ns &&
				step_range(walk, range, from_ns, t_ns,
					   source.batch.column[2].r[k]);
		}
	incise_source_close(&source);
	return rc < 0 ? rc : 0;
}

/* When cuts ended, as the recorder has noted it; without, none. To be freed. */
static size_t read_cut_ends(struct incise_recording *recording, int64_t **ends_ns)
{
	sqlite3_stmt *stmt = NULL;
	size_t n = 0;

	*ends_ns = NULL;
	if (sqlite3_prepare_v2(recording->db,
			       "SELECT value FROM meta WHERE key = 'cut_ends_ns'", -1,
			       &stmt, NULL) == SQLITE_OK &&
	    sqlite3_step(stmt) == SQLITE_ROW &&
	    sqlite3_column_type(stmt, 0) == SQLITE_BLOB)
		n = (size_t)sqlite3_column_bytes(stmt, 0) / sizeof(**ends_ns);
	if (n)
		*ends_ns = malloc(n * sizeof(**ends_ns));
	if (*ends_ns)
		memcpy(*ends_ns, sqlite3_column_blob(stmt, 0), n * sizeof(**ends_ns));
	sqlite3_finalize(stmt);
	return *ends_ns ? n : 0;
}

/*
 * Find where the range begins to be read, or the end of the cut that is asked for: from the end of a cut on that
 * is far enough before it, else from one before that, at last from the first sample on.
 */
static int find_begin(struct incise_recording *recording,
		      struct incise_recording_range *range, int64_t from_ns,
		      struct incise_error *err)
{
	struct range_walk walk;
	int64_t *ends_ns;
	size_t n = read_cut_ends(recording, &ends_ns), at = 0;
	int rc = 0;

	while (at < n &&
	       (range->cut ? at + 1 < (size_t)range->cut : ends_ns[at] < from_ns))
		at++;
	for (size_t back = 1; !rc; back *= 8) {
		at = at > back ? at - back : 0;
		init_walk(&walk, recording->numbers.tracker_hz);
		walk.cut.count = (int)at;
		walk.clear_ns = at ? ends_ns[at - 1] : 0;
		rc = follow_range(recording, &walk, at ? ends_ns[at - 1] : INT64_MIN,
				  range, from_ns, err);
		if (!at || walk.begin.t_ns != INT64_MIN)
			break;
	}
	free(ends_ns);
	if (rc)
		return rc;
	/* A cut may go on to the end of the recording. */
	if (range->cut > walk.cut.count)
		return incise_error_set(err, ENODATA,
					"%s: has no cut %d, but %d; `incise info` counts "
					"them",
					recording->path, range->cut, walk.cut.count);
	range->begin_ns = walk.begin.t_ns;
	range->cuts = walk.begin.cuts;
	return 0;
}

static bool is_read_whole(struct incise_recording *recording,
			  const struct incise_export_options *options)
{
	const struct incise_recording_numbers *numbers = &recording->numbers;

	return recording->meta.force_lost || options->calibration ||
	       recording->recalibrated ||
	       (incise_recording_has_force(recording) &&
		!(numbers->force_hz >= FORCE_LEAST * numbers->tracker_hz));
}

static int64_t after(double s)
{
	return s > 9e9 ? INT64_MAX / 4 : (int64_t)(s * 1e9);
}

/* Where filters settle before the first row. */
static int64_t settle_before(const struct incise_recording *recording, int64_t from_ns)
{
	struct range_walk walk;

	init_walk(&walk, recording->numbers.tracker_hz);
	return from_ns - walk.settled_ns;
}

int incise_recording_limit(struct incise_recording *recording,
			   const struct incise_export_options *options, bool cuts,
			   struct incise_error *err)
{
	struct incise_recording_range range = {
		.limited = options->from_s > 0 || options->to_s > 0 || options->cut > 0,
		.begin_ns = INT64_MIN,
		.end_ns = INT64_MAX,
		.from_ns = after(options->from_s),
		.to_ns = options->to_s > 0 ? after(options->to_s) : after(INFINITY),
		.cut = options->cut,
		.every_ns = cuts || recording->old ? 0 : after(options->every_s),
	};
	const char *table = incise_recording_has_force(recording) ? "force" : "tracker";
	int64_t seq, first_ns;
	int rc;

	recording->range = (struct incise_recording_range){.every_ns = range.every_ns};
	if (!range.limited)
		return 0;
	rc = recording->session ? 0
				: incise_source_end(recording, table, false, &seq,
						    &first_ns, NULL, err);
	if (rc < 0)
		return rc;
	if (rc) {
		if (cuts || range.cut)
			rc = find_begin(recording, &range, first_ns + range.from_ns, err);
		else
			rc = 0, range.begin_ns = settle_before(recording,
							       first_ns + range.from_ns);
		if (!range.cut)
			range.end_ns = first_ns + range.to_ns + BEHIND_NS;
		/* Cuts count by the force, and delays move its rows: then all are read. */
		if (!rc && is_read_whole(recording, options)) {
			range.begin_ns = INT64_MIN;
			range.end_ns = INT64_MAX;
		}
		if (range.begin_ns == INT64_MIN)
			range.cuts = 0;
	}
	if (!rc)
		recording->range = range;
	return rc;
}

bool incise_range_has(const struct incise_recording_range *range, int64_t since_ns,
		      int cut)
{
	return !range->limited ||
	       (since_ns >= range->from_ns && since_ns < range->to_ns &&
		(!range->cut || cut == range->cut));
}
