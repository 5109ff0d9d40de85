// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * An export to a file, whose extension chooses the format; see incise/recording.h and formats.h.
 *
 *     recordings ──► export.c, resample.c: rows ──────► CSV, HDF5
 *     recording  ──► streams.c: rows of its streams ──► MCAP
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <incise/outfile.h>
#include "../base/module.h"
#include "streams.h"
#include "writers.h"

#define BINS_MAX 1000 /* in one direction; all of them are held in memory */

static const struct format {
	const char *name, *extensions;
	enum { CHOICE, ALWAYS } lineage;
	const struct incise_table_format *built_in; /* NULL: of a module */
	const char *id;
} formats[] = {
#define FORMAT(id, name, extensions, magic, lineage) \
	{name, extensions, lineage, &incise_table_##id, #id},
#define MODULE(id, name, extensions, magic, lineage) \
	{name, extensions, lineage, NULL, #id},
	INCISE_FORMATS(FORMAT, MODULE)};

/* Number of the formats that hold rows: the first ones. */
#define ONE(...) +1
#define ROWS (0 INCISE_FORMATS_OF_ROWS(ONE, ONE))
#define FORMATS (sizeof(formats) / sizeof(*formats))

/* By the extension, in either case. */
static const struct format *find_format(const char *path)
{
	const char *dot = strrchr(path, '.');
	size_t length = dot && dot > path ? strlen(dot) : 0;

	for (size_t i = 0; i < FORMATS && length; i++)
		for (const char *at = formats[i].extensions; *at;) {
			size_t n = strcspn(at, " ");

			if (n == length && !strncasecmp(at, dot, n))
				return &formats[i];
			at += n + strspn(at + n, " ");
		}
	return formats;
}

/*
 * The module is loaded at first use, so that only programs that write such a file map its library. It
 * stays loaded: libhdf5 runs code at the program's end. NULL with errno: ENOENT (not built or not found), ENOEXEC.
 */
static const struct incise_table_format *load_format(const struct format *format,
						     struct incise_error *err)
{
	char file[40], symbol[40];

	if (format->built_in)
		return format->built_in;
	snprintf(file, sizeof(file), "export_%s.so", format->id);
	snprintf(symbol, sizeof(symbol), "incise_table_%s", format->id);
	return incise_module_load(file, symbol, INCISE_TABLE_ABI, format->name, err);
}

void incise_export_options_init(struct incise_export_options *options)
{
	*options = (struct incise_export_options){.min_count = 50};
}

int incise_export_check(const struct incise_export_options *o, struct incise_error *err)
{
	if (!(o->rate_hz >= 0 && o->rate_hz <= 1e9))
		return incise_error_set(err, EINVAL,
					"rate of export %g Hz: expected 0 to 1e9",
					o->rate_hz);
	if (!(o->from_s >= 0 && o->to_s >= 0) || (o->to_s > 0 && o->to_s <= o->from_s) ||
	    o->cut < 0)
		return incise_error_set(err, EINVAL,
					"part from %g s to %g s, cut %d: the end is not "
					"behind the beginning, or there is none",
					o->from_s, o->to_s, o->cut);
	if (o->depth_bins < 0 || o->depth_bins > BINS_MAX || o->velocity_bins < 0 ||
	    o->velocity_bins > BINS_MAX || !o->depth_bins != !o->velocity_bins)
		return incise_error_set(err, EINVAL,
					"%d × %d bins: expected 1 to %d each, or both 0",
					o->depth_bins, o->velocity_bins, BINS_MAX);
	if (!(o->depth_max_mm >= 0 && o->depth_max_mm < 1e9) ||
	    !(o->velocity_max_mm_s >= 0 && o->velocity_max_mm_s < 1e12))
		return incise_error_set(
			err, EINVAL,
			"upper ends of the bins, %g mm and %g mm/s, must be "
			"positive, or 0 for the largest in the data",
			o->depth_max_mm, o->velocity_max_mm_s);
	if (o->resample && (o->depth_bins || (o->rate_hz > 0 && o->rate_hz < 1)))
		return incise_error_set(err, EINVAL,
					"resampling needs a rate of 1 Hz or more, and "
					"no averages");
	if (o->tai && (o->depth_bins || o->ros2))
		return incise_error_set(err, EINVAL,
					"TAI is of rows, not of averages in bins, and "
					"messages of ROS 2 have UTC");
	if (o->uncertainty && o->ros2)
		return incise_error_set(err, EINVAL,
					"messages of ROS 2 have no place for "
					"uncertainties");
	if (o->min_count < 0)
		return incise_error_set(err, EINVAL, "smallest count %d is negative",
					o->min_count);
	return 0;
}

/* Refuse what a format of rows, or of messages, does not hold. */
static int check_format(const struct format *format, bool messages,
			const struct incise_export_options *o, const char *path, int n,
			struct incise_error *err)
{
	if (o->ros2 && !messages)
		return incise_error_set(err, EINVAL,
					"%s: messages of ROS 2 need one of these "
					"extensions:" INCISE_MESSAGE_EXTENSIONS,
					path);
	if (messages && n > 1)
		return incise_error_set(
			err, EINVAL,
			"%s: %s holds one recording, and %d are given; export each to a "
			"file of its own, or give one of these "
			"extensions:" INCISE_ROW_EXTENSIONS,
			path, format->name, n);
	if (messages && (o->rate_hz > 0 || o->depth_bins || o->resample))
		return incise_error_set(
			err, EINVAL,
			"%s: %s has every row as it was recorded; for a rate, averages "
			"or resampled rows give one of these "
			"extensions:" INCISE_ROW_EXTENSIONS,
			path, format->name);
	return 0;
}

int incise_export(struct incise_recording *const *recordings, int n,
		  const struct incise_export_options *options, const char *path,
		  struct incise_export_report *report, struct incise_error *err)
{
	const struct format *format = find_format(path);
	const struct incise_table_format *sink;
	struct incise_provenance provenance = {0};
	struct incise_export_pass pass = {recordings, n, options, .err = err};
	bool messages = format >= formats + ROWS;
	bool lineage = format->lineage == ALWAYS || options->provenance;
	struct incise_outfile *file;
	int rc = incise_export_check(options, err);

	if (rc)
		return rc;
	if (n < 1)
		return incise_error_set(err, EINVAL, "no recording to export");
	rc = check_format(format, messages, options, path, n, err);
	if (rc)
		return rc;
	sink = load_format(format, err);
	file = sink ? incise_outfile_open(path, err) : NULL;
	if (!file)
		return -errno;
	rc = incise_provenance_of(&provenance, recordings, n, options, NULL, err);
	if (!rc)
		rc = (messages ? incise_export_messages : incise_export_rows)(
			&pass, sink, incise_outfile_stream(file),
			lineage ? &provenance : NULL);
	incise_provenance_free(&provenance);
	if (!rc && report)
		*report = pass.report;
	if (!rc)
		return incise_outfile_commit(file, err);
	incise_outfile_abort(file);
	errno = -rc;
	return rc;
}
