/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The Arrow C data and stream interfaces: another library reads the columns in place, without
 * a copy and without an Arrow library. The structs follow the Arrow specification; other
 * headers may define the same ones, under the same guards.
 *
 *     recording ──► incise_recording_stream() ──► ArrowArrayStream ──► pyarrow, polars, DuckDB …
 *     ArrowArrayStream ──► incise_dataset_from_arrow() ──► training
 */
#ifndef INCISE_ARROW_H
#define INCISE_ARROW_H

#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

#ifndef ARROW_C_DATA_INTERFACE
#define ARROW_C_DATA_INTERFACE /**< the two structs are defined */

#define ARROW_FLAG_DICTIONARY_ORDERED 1 /**< the order of the dictionary has a meaning */
#define ARROW_FLAG_NULLABLE 2		/**< the column may have missing values */
#define ARROW_FLAG_MAP_KEYS_SORTED 4	/**< of a map */

/** Type, name and metadata of a column, or of a table: a struct of columns. */
struct ArrowSchema {
	const char *
		format; /**< type: "l" int64, "g" float64, "b" bool, "u" text, "+s" struct … */
	const char *name;     /**< of the column */
	const char *metadata; /**< pairs of key and text, in the specification's form */
	int64_t flags;	      /**< ARROW_FLAG_ bits */
	int64_t n_children;   /**< columns of a struct */
	struct ArrowSchema **children; /**< n_children of them */
	struct ArrowSchema *
		dictionary; /**< of the values that a column of numbers stands for; or NULL */
	void (*release)(struct ArrowSchema *schema); /**< NULL: released */
	void *private_data;			     /**< of the producer */
};

/** The values of a column, or of some rows of a table. */
struct ArrowArray {
	int64_t length;	    /**< rows */
	int64_t null_count; /**< missing values; -1: not known */
	int64_t offset;	    /**< of the first row in the buffers */
	int64_t n_buffers;  /**< 1 of a struct, 2 of numbers, 3 of text */
	int64_t n_children; /**< columns of a struct */
	const void **
		buffers; /**< bits of the values that are there or NULL; then the values, or offsets and text */
	struct ArrowArray **children;  /**< n_children of them */
	struct ArrowArray *dictionary; /**< values that the numbers stand for; or NULL */
	void (*release)(struct ArrowArray *array); /**< NULL: released */
	void *private_data;			   /**< of the producer */
};
#endif

#ifndef ARROW_C_STREAM_INTERFACE
#define ARROW_C_STREAM_INTERFACE /**< the struct is defined */

/** A table in batches of rows; get_ functions return 0 or a positive errno. */
struct ArrowArrayStream {
	/** The columns; out is the caller's to release. */
	int (*get_schema)(struct ArrowArrayStream *stream, struct ArrowSchema *out);
	/** At the end out->release is NULL. */
	int (*get_next)(struct ArrowArrayStream *stream, struct ArrowArray *out);
	/** One line, valid until the next call; NULL without an error. */
	const char *(*get_last_error)(struct ArrowArrayStream *stream);
	void (*release)(struct ArrowArrayStream *stream); /**< NULL: released */
	void *private_data;				  /**< of the producer */
};
#endif

struct incise_export_options;
struct incise_recording;

/**
 * Open a stream of a recording's rows, in order of time, as columns. Part of libincise-record.
 *
 * | what | columns | | --- | --- | | "force" | seq, t_ns, code, force_N (NaN while the zero is
 * not known), clipped | | "tracker" | seq, t_ns, arrival_ns, x_mm y_mm z_mm, qw qx qy qz (as
 * received, without the calibrated tip), status, station, button | | "depth" | seq, t_ns,
 * depth_mm, velocity_mm_s | | "frames" | seq, t_ns, arrival_ns, pts, bytes, and the result of
 * vision or null: length_px, sd_px, depth_mm, quality | | "events" | t_ns, kind, text | |
 * "table" | the columns of incise_export() with these options |
 *
 * t_ns is the best time of acquisition, CLOCK_MONOTONIC. Fields have the metadata "unit" and
 * "description", fields by a calibration also its values, with the uncertainties that it states and
 * their covariances; fields of a table with uncertainties "uncertainty_variables", "uncertainty_of"
 * and "correlation". The table has the provenance of an export. Memory holds a few batches of at most
 * 16384 rows, whatever the length.
 *
 * The stream reads by a connection of its own: the recording may be closed before, and several
 * streams of one recording may be read by turns or from several threads, each by one thread at a
 * time. For a recording that is being written it has the rows up to the last commit before this call.
 * A stream that was opened before fork(2) fails in the child with EINVAL.
 *
 * @param what    as above
 * @param options calibration, from_s and to_s of any stream, and all of "table"; progress is called for "table"
 *                only, from a thread of the stream; copied. NULL: the defaults
 * @param stream  result; the caller calls its release. Its get_next() returns EINVAL (an
 *                impossible row), EIO, ENODATA (no cut), EINTR (stopped by progress), ENOMEM
 * @return 0; -EINVAL (no such stream, impossible options, a damaged recording), -EIO, -ENOMEM, -EAGAIN (no thread).
 */
INCISE_API int incise_recording_stream(struct incise_recording *recording,
				       const char *what,
				       const struct incise_export_options *options,
				       struct ArrowArrayStream *stream,
				       struct incise_error *err);

/**
 * Release a stream that is in a PyCapsule "arrow_array_stream" of Python, unless a consumer has
 * taken it, and free(3) its struct. It is the capsule's destructor, for bindings without compiled
 * code: an exception may be on its way when a capsule goes, so no code in Python may run. Part of
 * libincise-record.
 *
 * @param capsule PyObject of a process that has PyCapsule_GetPointer(); in others without effect
 */
INCISE_API void incise_arrow_capsule_free(void *capsule);

INCISE_END_DECLS
#endif
