/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Rows on their way into an ArrowArray: columns with name, type, unit and description, filled row
 * by row, handed over a batch at a time. See incise/arrow.h.
 *
 *     put, put, put … ──► end of the row ──► take: a struct array, whose columns are the
 *                                             consumer's to free
 */
#ifndef INCISE_ARROW_BATCH_H
#define INCISE_ARROW_BATCH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/arrow.h>
#include "../export/provenance.h"

/* Types of columns: the letters of Arrow's formats. */
enum incise_arrow_type {
	INCISE_ARROW_INT64 = 'l',
	INCISE_ARROW_INT32 = 'i',
	INCISE_ARROW_REAL = 'g',   /* float64 */
	INCISE_ARROW_SINGLE = 'f', /* float32 */
	INCISE_ARROW_FLAG = 'b',
	INCISE_ARROW_TEXT = 'u', /* UTF-8 */
};

struct incise_arrow_field {
	const char *name, *unit, *about; /* unit "1": none */
	enum incise_arrow_type type;
	bool nullable;
	const struct incise_provenance *calibration; /* that enters the values, or NULL */
};

/* Values of a column so far. */
struct incise_arrow_values {
	void *data;		      /* numbers; bits of flags; bytes of texts */
	size_t bytes, bytes_capacity; /* of texts */
	int32_t *offsets;	      /* of texts */
	uint8_t *valid;		      /* a bit each; NULL while no value is missing */
	int64_t missing;
};

struct incise_arrow_batch {
	const struct incise_arrow_field *fields;
	int n;
	size_t capacity, rows; /* rows so far */
	struct incise_arrow_values *values;
	bool failed; /* no memory */
};

/*
 * The schema of a table; its metadata is the provenance. The fields are copied. Returns 0 or
 * -ENOMEM.
 */
int incise_arrow_schema(struct ArrowSchema *schema,
			const struct incise_arrow_field *fields, int n,
			const struct incise_provenance *provenance);

/* For batches of at most @capacity rows; fields must outlive it. Returns 0 or -ENOMEM. */
int incise_arrow_batch_open(struct incise_arrow_batch *batch,
			    const struct incise_arrow_field *fields, int n,
			    size_t capacity);
void incise_arrow_batch_close(struct incise_arrow_batch *batch);

/* Start a batch with no rows. Returns 0 or -ENOMEM. */
int incise_arrow_batch_start(struct incise_arrow_batch *batch);

/* Put the value of a column in the present row, by the column's type. */
void incise_arrow_put_int(struct incise_arrow_batch *batch, int column, int64_t value);
void incise_arrow_put_real(struct incise_arrow_batch *batch, int column, double value);
void incise_arrow_put_text(struct incise_arrow_batch *batch, int column,
			   const char *text);
void incise_arrow_put_missing(struct incise_arrow_batch *batch, int column);

/* Hand the rows over. Returns 0, or -ENOMEM (also of any put before). */
int incise_arrow_batch_take(struct incise_arrow_batch *batch, struct ArrowArray *array);

/* --- streams ------------------------------------------------------------------------- */

/* A source of batches, which incise_arrow_stream() makes a stream of. */
struct incise_arrow_source {
	const struct incise_arrow_field *fields;
	int n_fields;
	struct incise_provenance provenance; /* freed with the source */
	/* Fill @array, or leave its release NULL at the end. Returns 0 or -errno. */
	int (*next)(struct incise_arrow_source *source, struct ArrowArray *array,
		    struct incise_error *err);
	void (*close)(struct incise_arrow_source *source); /* also frees it */
};

/* The output of an export, as a source; takes @recording. NULL with errno. See arrow_table.c. */
struct incise_arrow_source *incise_arrow_table(
	struct incise_recording *recording, const struct incise_export_options *options,
	struct incise_error *err);

#endif
