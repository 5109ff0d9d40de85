// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The provenance of exported data; see provenance.h.
 */
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <incise/origin.h>
#include <incise/seal.h>
#include <incise/version.h>
#include <incise/wall.h>
#include "../record/prove/prove.h"
#include "writers.h"
#include "../base/crypto/sha256.h"
#include "../record/read/recalibration.h"
#include "../record/read/recording.h"
#include "../record/read/session.h"

void incise_provenance_add(struct incise_provenance *provenance, const char *key,
			   const char *fmt, ...)
{
	struct incise_provenance_item *item = &provenance->items[provenance->n];
	va_list args;
	int length;

	if (!provenance->rc && provenance->n == INCISE_PROVENANCE_MAX)
		provenance->rc = -E2BIG;
	if (provenance->rc)
		return;
	va_start(args, fmt);
	length = vasprintf(&item->value, fmt, args);
	va_end(args);
	if (length < 0)
		provenance->rc = -ENOMEM;
	if (!length)
		free(item->value);
	if (length <= 0)
		return;
	/* A single line in CSV, whatever characters a recording's name has. */
	for (char *c = item->value; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '_';
	item->key = key;
	provenance->n++;
}

/* Add to the value of the last pair, with ", " between, if that has this key; else a pair. */
INCISE_PRINTF(3, 4)
static void append_value(struct incise_provenance *to, const char *key, const char *fmt,
			 ...)
{
	char *before = NULL, *text;
	va_list args;
	int length;

	va_start(args, fmt);
	length = vasprintf(&text, fmt, args);
	va_end(args);
	if (length < 0)
		to->rc = -ENOMEM;
	if (to->rc)
		return;
	if (to->n && !strcmp(to->items[to->n - 1].key, key))
		before = to->items[--to->n].value;
	incise_provenance_add(to, key, "%s%s%s", before ? before : "", before ? ", " : "",
			      text);
	free(before);
	free(text);
}

static const char *state_of(const struct incise_recording *recording)
{
	const struct incise_recording_info *meta = &recording->meta;
	bool lost = meta->force_lost || meta->tracker_lost;

	if (!meta->complete)
		return lost ? "interrupted, with losses" : "interrupted";
	return lost ? "complete, with losses" : "complete";
}

static void add_sources(struct incise_provenance *provenance,
			struct incise_recording *const *recordings, int n)
{
	for (int k = 0; k < n; k++)
		append_value(provenance, "source", "%s", recordings[k]->path);
	for (int k = 0; k < n; k++)
		append_value(provenance, "recorded", "%s", recordings[k]->meta.started);
	for (int k = 0; k < n; k++)
		append_value(provenance, "rig", "%s", recordings[k]->meta.rig);
	for (int k = 0; k < n; k++)
		append_value(provenance, "state", "%s", state_of(recordings[k]));
}

/* Append a calibration that was given for the export, a file; one that is a pipe was read already. */
static size_t put_given(const char *path, char *text, size_t size, size_t at)
{
	struct incise_origin origin = {.depth = 1, .kind = "calibration"};
	struct stat st;

	if (stat(path, &st) || !S_ISREG(st.st_mode) ||
	    incise_sha256_file(path, origin.sha256, NULL, NULL, NULL))
		return at;
	snprintf(origin.name, sizeof(origin.name), "%s", basename(path));
	return incise_origin_put(&origin, text, size, at);
}

/* The origins of an export. */
static void add_origins(struct incise_provenance *provenance,
			struct incise_recording *const *recordings, int n,
			const char *calibration_path)
{
	const size_t most = INCISE_SESSION_MEMBERS_MAX * INCISE_ORIGIN_TEXT;
	char *all = malloc((size_t)n * most + INCISE_ORIGIN_TEXT), *to = all;

	if (!all) {
		provenance->rc = -ENOMEM;
		return;
	}
	*all = 0;
	for (int i = 0; i < n; i++) {
		if (to > all)
			*to++ = ' ';
		to += incise_recording_origins(recordings[i], to, most);
	}
	if (calibration_path)
		put_given(calibration_path, all, (size_t)n * most + INCISE_ORIGIN_TEXT,
			  (size_t)(to - all));
	incise_provenance_add(provenance, "origin", "%s", all);
	free(all);
}

/* The mapping to TAI of one recording: its first and last point, which have all that is constant. */
static void add_wall(struct incise_provenance *provenance,
		     struct incise_recording *recording)
{
	static const char *const keys[][4] = {{"wall_start_t_ns", "wall_start_tai_ns",
					       "wall_start_u_ns", "wall_start_utc"},
					      {"wall_end_t_ns", "wall_end_tai_ns",
					       "wall_end_u_ns", "wall_end_utc"}};
	struct incise_error none = {0};
	struct incise_wall *wall = incise_recording_wall(recording, &none);
	const struct incise_wall_point *points;
	size_t n;

	/* A damaged table stops the export only where its times are asked for. */
	if (!wall && errno == ENOMEM)
		provenance->rc = -ENOMEM;
	if (!wall)
		return;
	n = incise_wall_points(wall, &points);
	for (int i = 0; i < 2; i++) {
		const struct incise_wall_point *p = &points[i ? n - 1 : 0];
		char utc[INCISE_WALL_TEXT];
		int64_t tai_ns, u_ns;

		incise_wall_tai(wall, p->t_ns, &tai_ns, &u_ns);
		incise_wall_utc_text(tai_ns, p->utc_offset_s, utc);
		incise_provenance_add(provenance, keys[i][0], "%lld", (long long)p->t_ns);
		incise_provenance_add(provenance, keys[i][1], "%lld", (long long)tai_ns);
		if (u_ns == INCISE_WALL_UNKNOWN)
			incise_provenance_add(provenance, keys[i][2], "unknown");
		else
			incise_provenance_add(provenance, keys[i][2], "%lld",
					      (long long)u_ns);
		incise_provenance_add(provenance, keys[i][3], "%s", utc);
	}
	incise_provenance_add(provenance, "wall_source", "%s, time of %s", points->source,
			      points->reference);
	incise_wall_free(wall);
}

/* Say which calibration of each recording is active; of a joined one, of each member. */
static void add_active(struct incise_provenance *provenance,
		       struct incise_recording *const *recordings, int n)
{
	for (int i = 0; i < n; i++) {
		const struct incise_session *session = recordings[i]->session;
		int members = session ? session->n : 1;

		for (int k = 0; k < members; k++) {
			const struct incise_recording *member =
				session ? session->members[k] : recordings[i];
			char *text = incise_recalibration_text(member);

			if (!text)
				provenance->rc = -ENOMEM;
			else
				append_value(provenance, "calibration", "%s%s%s%s%s",
					     n > 1 && !k ? recordings[i]->name : "",
					     n > 1 && !k ? ": " : "",
					     members > 1 ? member->name : "",
					     members > 1 ? ": " : "", text);
			free(text);
		}
	}
}

static bool is_recalibrated(const struct incise_recording *recording)
{
	const struct incise_session *session = recording->session;
	bool is = recording->recalibrated;

	for (int i = 0; session && i < session->n; i++)
		is |= session->members[i]->recalibrated != NULL;
	return is;
}

/* Say which calibration is in use. */
static void add_choice(struct incise_provenance *provenance,
		       struct incise_recording *const *recordings, int n,
		       const struct incise_calibration *given)
{
	bool any = false;

	for (int i = 0; i < n; i++)
		any |= is_recalibrated(recordings[i]);
	if (any && !given)
		add_active(provenance, recordings, n);
	else
		incise_provenance_add(provenance, "calibration", "%s",
				      given ? "given for the export"
					    : "of the recording");
}

/* Add the camera's scale, and delays of a given calibration, or of an active one. */
static void add_lengths(struct incise_provenance *provenance,
			struct incise_recording *const *recordings, int n,
			const struct incise_calibration *given)
{
	double mm_px = given ? given->depth_mm_px : recordings[0]->meta.depth_mm_px;
	const struct incise_calibration *of =
		given || n > 1 || !recordings[0]->recalibrated
			? given
			: &recordings[0]->recalibrated->calibration;
	const struct {
		const char *key;
		double ms;
	} delays[] = {
		{"force_delay_ms", of ? of->force_delay_ms : NAN},
		{"tracker_delay_ms", of ? of->tracker_delay_ms : NAN},
		{"camera_delay_ms", of ? of->camera_delay_ms : NAN},
	};

	for (int i = 1; i < n && !given; i++)
		if (recordings[i]->meta.depth_mm_px != mm_px)
			return;
	incise_provenance_add(provenance, "depth_mm_px", "%.9g", mm_px);
	for (size_t i = 0; i < sizeof(delays) / sizeof(*delays); i++)
		if (!isnan(delays[i].ms))
			incise_provenance_add(provenance, delays[i].key, "%.9g",
					      delays[i].ms);
}

/* Add the given calibration, or the recordings' own if all have the same. */
static void add_calibration(struct incise_provenance *provenance,
			    struct incise_recording *const *recordings, int n,
			    const struct incise_calibration *given)
{
	/* A device in newtons was not calibrated in mV/N. */
	bool volts = given && !recordings[0]->meta.newtons;
	double mV_N = volts ? given->force_mV_N : recordings[0]->meta.force_mV_N;
	double zero_mV = recordings[0]->meta.zero_mV;
	bool own = !volts || isnan(given->force_zero_mV);

	if (!own)
		zero_mV = given->force_zero_mV;
	add_choice(provenance, recordings, n, given);
	for (int i = 1; i < n && own; i++) {
		if (!given && recordings[i]->meta.force_mV_N != mV_N)
			return;
		if (recordings[i]->meta.zero_mV != zero_mV)
			zero_mV = NAN;
	}
	incise_provenance_add(provenance, "force_mV_N", "%.17g", mV_N);
	if (isnan(zero_mV))
		incise_provenance_add(provenance, "force_zero_mV",
				      "each recording's own");
	else
		incise_provenance_add(provenance, "force_zero_mV", "%.17g", zero_mV);
	add_lengths(provenance, recordings, n, given);
}

static const struct {
	const char *name, *unit; /* as in calibration.conf, and of what it has no key */
} sources[INCISE_BUDGET_SOURCES] = {
	[INCISE_BUDGET_GAIN] = {"force_mV_N", "mV/N"},
	[INCISE_BUDGET_ZERO] = {"force_zero_mV", "mV"},
	[INCISE_BUDGET_TIP_X] = {"tip_x_mm", "mm"},
	[INCISE_BUDGET_TIP_Y] = {"tip_y_mm", "mm"},
	[INCISE_BUDGET_TIP_Z] = {"tip_z_mm", "mm"},
	[INCISE_BUDGET_SURFACE] = {"surface_mm", "mm"},
	[INCISE_BUDGET_ALIGNMENT] = {"alignment_s", "s"},
	[INCISE_BUDGET_DELAY] = {"delay_s", "s"},
};

/* Add standard uncertainties and covariances of the common sources. */
static void describe_budget(struct incise_provenance *to,
			    const struct incise_budget *budget)
{
	for (int i = 0; i < INCISE_BUDGET_SOURCES; i++) {
		double u = incise_budget_u(budget, i);

		if (sources[i].name && isnan(u))
			append_value(to, "calibration_u", "%s not stated",
				     sources[i].name);
		else if (sources[i].name)
			append_value(to, "calibration_u", "%s %.9g %s", sources[i].name,
				     u, sources[i].unit);
	}
	for (int i = 0; i < INCISE_BUDGET_SOURCES; i++)
		for (int k = 0; k < i && sources[i].name; k++) {
			double value = incise_budget_covariance(budget, k, i);

			if (sources[k].name && !isnan(value) && value != 0)
				append_value(to, "calibration_covariance", "%s %s %.9g",
					     sources[k].name, sources[i].name, value);
		}
}

static bool are_same(const struct incise_provenance *a, const struct incise_provenance *b)
{
	bool same = a->n == b->n;

	for (int i = 0; i < a->n && same; i++)
		same = !strcmp(a->items[i].value, b->items[i].value);
	return same;
}

/* The uncertainties that the calibrations state, with their covariances; of several recordings
 * only if they are the same. */
static int add_budget(struct incise_provenance *provenance,
		      struct incise_recording *const *recordings, int n,
		      const struct incise_export_options *options,
		      struct incise_error *err)
{
	static const char *const words[] = {"none", "total", "parts"};
	struct incise_provenance first = {0}, other = {0};
	bool same = true;
	int rc = 0;

	if (!options->uncertainty)
		return 0;
	for (int i = 0; i < n && !rc && same; i++) {
		struct incise_budget *budget =
			incise_budget_open(recordings[i], options, false, err);

		rc = budget ? 0 : -errno;
		if (budget)
			describe_budget(i ? &other : &first, budget);
		same = !i || are_same(&first, &other);
		incise_budget_free(budget);
		incise_provenance_free(&other);
	}
	incise_provenance_add(provenance, "uncertainty",
			      "%s: standard uncertainties, 2 u holds 95 %%",
			      words[options->uncertainty]);
	if (!same)
		incise_provenance_add(provenance, "calibration_u",
				      "each recording's own");
	for (int i = 0; i < first.n && same; i++)
		incise_provenance_add(provenance, first.items[i].key, "%s",
				      first.items[i].value);
	rc = rc ? rc : first.rc;
	incise_provenance_free(&first);
	return rc;
}

/* Seconds from the first sample; no end: to that of the recording. */
static void add_provenance_part(struct incise_provenance *provenance,
				const struct incise_export_options *o)
{
	char end[40] = "", cut[40] = "";

	if (!(o->from_s > 0) && !(o->to_s > 0) && !o->cut)
		return;
	if (o->to_s > 0)
		snprintf(end, sizeof(end), " to %.9g s", o->to_s);
	if (o->cut)
		snprintf(cut, sizeof(cut), ", cut %d", o->cut);
	incise_provenance_add(provenance, "part", "from %.9g s%s%s", o->from_s, end, cut);
}

static void add_options(struct incise_provenance *provenance,
			const struct incise_export_options *o)
{
	const char *rows = o->resample ? "resampled" : "raw";

	add_provenance_part(provenance, o);
	if (o->depth_bins)
		incise_provenance_add(provenance, "options",
				      "averaged in %dx%d bins, at least %d samples%s",
				      o->depth_bins, o->velocity_bins, o->min_count,
				      o->by_cut ? ", by cut" : "");
	else if (o->rate_hz > 0)
		incise_provenance_add(provenance, "options", "%s at %.9g Hz", rows,
				      o->rate_hz);
	else
		incise_provenance_add(provenance, "options", "%s, every force sample",
				      rows);
}

int incise_provenance_of(struct incise_provenance *provenance,
			 struct incise_recording *const *recordings, int n,
			 const struct incise_export_options *options, const char *table,
			 struct incise_error *err)
{
	int rc = 0;

	/* The time of the export is left out: equal rows are equal bytes. */
	incise_provenance_add(provenance, "incise", "%s", incise_version());
	add_sources(provenance, recordings, n);
	add_origins(provenance, recordings, n, table ? NULL : options->calibration_path);
	if (table)
		incise_provenance_add(provenance, "options", "rows of table %s", table);
	else
		add_options(provenance, options);
	add_calibration(provenance, recordings, n, options->calibration);
	if (!table)
		rc = add_budget(provenance, recordings, n, options, err);
	if (n == 1)
		add_wall(provenance, recordings[0]);
	rc = rc ? rc : provenance->rc;
	return rc ? incise_error_set(err, -rc, "lineage: %s", strerror(-rc)) : 0;
}

void incise_provenance_free(struct incise_provenance *provenance)
{
	for (int i = 0; i < provenance->n; i++)
		free(provenance->items[i].value);
	provenance->n = 0;
}
