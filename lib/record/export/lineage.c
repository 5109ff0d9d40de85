// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Where exported data comes from; see lineage.h.
 */
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/version.h>
#include "lineage.h"
#include "../read/recording.h"

int incise_lineage_add(struct incise_lineage *lineage, const char *key, const char *fmt,
		       ...)
{
	struct incise_lineage_item *item = &lineage->items[lineage->n];
	va_list args;
	int length;

	if (lineage->n == INCISE_LINEAGE_MAX)
		return -E2BIG;
	va_start(args, fmt);
	length = vasprintf(&item->value, fmt, args);
	va_end(args);
	if (length < 0)
		return -ENOMEM;
	if (!length) {
		free(item->value);
		return 0;
	}
	/* A line of its own in CSV, whatever a recording has in its name. */
	for (char *c = item->value; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '_';
	item->key = key;
	lineage->n++;
	return 0;
}

/* "a, b, c" of one text per recording; to be freed. */
static char *join(struct incise_recording *const *recordings, int n,
		  const char *(*text)(const struct incise_recording *recording))
{
	size_t size = 1;
	char *all, *to;

	for (int i = 0; i < n; i++)
		size += strlen(text(recordings[i])) + 2;
	all = to = malloc(size);
	if (!all)
		return NULL;
	*to = 0;
	for (int i = 0; i < n; i++)
		to += sprintf(to, "%s%s", i ? ", " : "", text(recordings[i]));
	return all;
}

static const char *path_of(const struct incise_recording *recording)
{
	return recording->path;
}

static const char *start_of(const struct incise_recording *recording)
{
	return recording->meta.started;
}

/* What is missing in it, so that who reads the table is not left in the dark. */
static const char *state_of(const struct incise_recording *recording)
{
	const struct incise_recording_info *meta = &recording->meta;
	bool lost = meta->force_lost || meta->tracker_lost;

	if (!meta->complete)
		return lost ? "interrupted, with losses" : "interrupted";
	return lost ? "complete, with losses" : "complete";
}

static const char *rig_of(const struct incise_recording *recording)
{
	return recording->meta.rig;
}

static int add_sources(struct incise_lineage *lineage,
		       struct incise_recording *const *recordings, int n)
{
	const struct {
		const char *key;
		const char *(*text)(const struct incise_recording *recording);
	} items[] = {{"source", path_of},
		     {"recorded", start_of},
		     {"rig", rig_of},
		     {"state", state_of}};
	int rc = 0;

	for (size_t i = 0; i < sizeof(items) / sizeof(*items) && !rc; i++) {
		char *text = join(recordings, n, items[i].text);

		rc = text ? incise_lineage_add(lineage, items[i].key, "%s", text)
			  : -ENOMEM;
		free(text);
	}
	return rc;
}

/* What turns pixels into depth, and delays that are given. */
static int add_lengths(struct incise_lineage *lineage,
		       struct incise_recording *const *recordings, int n,
		       const struct incise_calibration *given)
{
	double mm_px = given ? given->depth_mm_px : recordings[0]->meta.depth_mm_px;
	const struct {
		const char *key;
		double ms;
	} delays[] = {
		{"force_delay_ms", given ? given->force_delay_ms : NAN},
		{"tracker_delay_ms", given ? given->tracker_delay_ms : NAN},
		{"camera_delay_ms", given ? given->camera_delay_ms : NAN},
	};
	int rc;

	for (int i = 1; i < n && !given; i++)
		if (recordings[i]->meta.depth_mm_px != mm_px)
			return 0;
	rc = incise_lineage_add(lineage, "depth_mm_px", "%.9g", mm_px);
	for (size_t i = 0; i < sizeof(delays) / sizeof(*delays) && !rc; i++)
		if (!isnan(delays[i].ms))
			rc = incise_lineage_add(lineage, delays[i].key, "%.9g",
						delays[i].ms);
	return rc;
}

/* Without one that is given, each recording's own; told where it is one for all. */
static int add_calibration(struct incise_lineage *lineage,
			   struct incise_recording *const *recordings, int n,
			   const struct incise_calibration *given)
{
	double mV_N = given ? given->force_mV_N : recordings[0]->meta.force_mV_N;
	double zero_mV = recordings[0]->meta.zero_mV;
	bool own = !given || isnan(given->force_zero_mV);
	int rc;

	if (!own)
		zero_mV = given->force_zero_mV;

	rc = incise_lineage_add(lineage, "calibration", "%s",
				given ? "given for the export" : "of the recording");
	for (int i = 1; i < n && own; i++) {
		if (!given && recordings[i]->meta.force_mV_N != mV_N)
			return rc;
		if (recordings[i]->meta.zero_mV != zero_mV)
			zero_mV = NAN;
	}
	if (!rc)
		rc = incise_lineage_add(lineage, "force_mV_N", "%.17g", mV_N);
	if (!rc)
		rc = isnan(zero_mV) ? incise_lineage_add(lineage, "force_zero_mV",
							 "each recording's own")
				    : incise_lineage_add(lineage, "force_zero_mV",
							 "%.17g", zero_mV);
	return rc ? rc : add_lengths(lineage, recordings, n, given);
}

static int add_options(struct incise_lineage *lineage,
		       const struct incise_export_options *o)
{
	const char *rows = o->resample ? "resampled" : "raw";

	if (o->depth_bins)
		return incise_lineage_add(lineage, "options",
					  "averaged in %dx%d bins, at least %d "
					  "samples%s",
					  o->depth_bins, o->velocity_bins, o->min_count,
					  o->by_cut ? ", by cut" : "");
	if (o->rate_hz > 0)
		return incise_lineage_add(lineage, "options", "%s at %.9g Hz", rows,
					  o->rate_hz);
	return incise_lineage_add(lineage, "options", "%s, every force sample", rows);
}

int incise_lineage_of(struct incise_lineage *lineage,
		      struct incise_recording *const *recordings, int n,
		      const struct incise_export_options *options,
		      struct incise_error *err)
{
	time_t now = time(NULL);
	char date[32] = "";
	struct tm utc;
	int rc;

	if (gmtime_r(&now, &utc))
		strftime(date, sizeof(date), "%Y-%m-%dT%H:%M:%SZ", &utc);
	rc = incise_lineage_add(lineage, "incise", "%s", incise_version());
	if (!rc)
		rc = incise_lineage_add(lineage, "date", "%s", date);
	if (!rc)
		rc = add_sources(lineage, recordings, n);
	if (!rc)
		rc = add_options(lineage, options);
	if (!rc)
		rc = add_calibration(lineage, recordings, n, options->calibration);
	return rc ? incise_error_set(err, -rc, "lineage: %s", strerror(-rc)) : 0;
}

void incise_lineage_free(struct incise_lineage *lineage)
{
	for (int i = 0; i < lineage->n; i++)
		free(lineage->items[i].value);
	lineage->n = 0;
}
