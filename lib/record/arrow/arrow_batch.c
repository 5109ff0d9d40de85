// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Arrow's schemas and arrays; see arrow_batch.h. A consumer may move columns out of an array and
 * free them later: each column owns its buffers.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "../../base/utf8.h"
#include "arrow_batch.h"

/* --- schema -------------------------------------------------------------------------- */

/* Bytes of metadata, written if @to is not NULL: a count, then a length before each text. */
static size_t put_count(char *to, size_t at, int32_t count)
{
	if (to)
		memcpy(to + at, &count, sizeof(count));
	return at + sizeof(count);
}

static size_t put_word(char *to, size_t at, const char *text)
{
	size_t length = strlen(text);

	at = put_count(to, at, (int32_t)length);
	if (to)
		memcpy(to + at, text, length);
	return at + length;
}

static size_t put_items(char *to, size_t at, const struct incise_provenance *items)
{
	for (int i = 0; items && i < items->n; i++) {
		at = put_word(to, at, items->items[i].key);
		at = put_word(to, at, items->items[i].value);
	}
	return at;
}

static size_t field_metadata(char *to, const struct incise_arrow_field *field)
{
	int n = 2 + (field->calibration ? field->calibration->n : 0);
	size_t at = put_count(to, 0, n);

	at = put_word(to, at, "unit");
	at = put_word(to, at, field->unit);
	at = put_word(to, at, "description");
	at = put_word(to, at, field->about);
	return put_items(to, at, field->calibration);
}

static size_t table_metadata(char *to, const struct incise_provenance *provenance)
{
	return put_items(to, put_count(to, 0, provenance->n), provenance);
}

static void schema_release(struct ArrowSchema *schema)
{
	for (int64_t i = 0; i < schema->n_children; i++) {
		if (schema->children[i] && schema->children[i]->release)
			schema->children[i]->release(schema->children[i]);
		free(schema->children[i]);
	}
	free(schema->children);
	free((char *)schema->format);
	free((char *)schema->name);
	free((char *)schema->metadata);
	schema->release = NULL;
}

/* A schema without metadata. False: no memory; it has to be released all the same. */
static bool schema_open(struct ArrowSchema *schema, const char *format, const char *name,
			size_t metadata)
{
	*schema = (struct ArrowSchema){
		.format = strdup(format),
		.name = strdup(name),
		.metadata = malloc(metadata),
		.release = schema_release,
	};
	return schema->format && schema->name && schema->metadata;
}

static bool schema_child(struct ArrowSchema *schema,
			 const struct incise_arrow_field *field)
{
	const char format[] = {(char)field->type, '\0'};
	struct ArrowSchema *child = calloc(1, sizeof(*child));

	if (!child)
		return false;
	schema->children[schema->n_children++] = child;
	if (!schema_open(child, format, field->name, field_metadata(NULL, field)))
		return false;
	field_metadata((char *)child->metadata, field);
	child->flags = field->nullable ? ARROW_FLAG_NULLABLE : 0;
	return true;
}

int incise_arrow_schema(struct ArrowSchema *schema,
			const struct incise_arrow_field *fields, int n,
			const struct incise_provenance *provenance)
{
	bool made = schema_open(schema, "+s", "", table_metadata(NULL, provenance));

	if (made) {
		table_metadata((char *)schema->metadata, provenance);
		schema->children = calloc((size_t)n, sizeof(*schema->children));
		made = schema->children;
	}
	for (int i = 0; i < n && made; i++)
		made = schema_child(schema, &fields[i]);
	if (made)
		return 0;
	schema_release(schema);
	return -ENOMEM;
}

/* --- batches ------------------------------------------------------------------------- */

#define BITS(n) (((n) + 7) / 8)

static size_t size_of(enum incise_arrow_type type)
{
	return type == INCISE_ARROW_INT64 || type == INCISE_ARROW_REAL ? 8 : 4;
}

static void values_free(struct incise_arrow_values *values)
{
	free(values->data);
	free(values->offsets);
	free(values->valid);
	*values = (struct incise_arrow_values){0};
}

/* Room for a batch of one column. */
static bool values_open(struct incise_arrow_values *values, enum incise_arrow_type type,
			size_t capacity)
{
	*values = (struct incise_arrow_values){0};
	if (type == INCISE_ARROW_FLAG) {
		values->data = calloc(1, BITS(capacity));
	} else if (type == INCISE_ARROW_TEXT) {
		values->bytes_capacity = capacity;
		values->data = malloc(values->bytes_capacity);
		values->offsets = calloc(capacity + 1, sizeof(*values->offsets));
		return values->data && values->offsets;
	} else {
		values->data = malloc(capacity * size_of(type));
	}
	return values->data;
}

int incise_arrow_batch_start(struct incise_arrow_batch *batch)
{
	batch->rows = 0;
	for (int i = 0; i < batch->n && !batch->failed; i++)
		if (!batch->values[i].data)
			batch->failed =
				!values_open(&batch->values[i], batch->fields[i].type,
					     batch->capacity);
	return batch->failed ? -ENOMEM : 0;
}

int incise_arrow_batch_open(struct incise_arrow_batch *batch,
			    const struct incise_arrow_field *fields, int n,
			    size_t capacity)
{
	*batch = (struct incise_arrow_batch){
		.fields = fields,
		.n = n,
		.capacity = capacity,
		.values = calloc((size_t)n, sizeof(*batch->values)),
	};
	return batch->values ? 0 : -ENOMEM;
}

void incise_arrow_batch_close(struct incise_arrow_batch *batch)
{
	for (int i = 0; batch->values && i < batch->n; i++)
		values_free(&batch->values[i]);
	free(batch->values);
	batch->values = NULL;
}

static void set_bit(uint8_t *bits, size_t at)
{
	bits[at / 8] |= (uint8_t)(1 << at % 8);
}

void incise_arrow_put_int(struct incise_arrow_batch *batch, int column, int64_t value)
{
	struct incise_arrow_values *values = &batch->values[column];

	if (values->valid)
		set_bit(values->valid, batch->rows);
	switch (batch->fields[column].type) {
	case INCISE_ARROW_INT64:
		((int64_t *)values->data)[batch->rows] = value;
		break;
	case INCISE_ARROW_INT32:
		((int32_t *)values->data)[batch->rows] = (int32_t)value;
		break;
	default: /* a flag */
		if (value)
			set_bit(values->data, batch->rows);
	}
}

void incise_arrow_put_real(struct incise_arrow_batch *batch, int column, double value)
{
	struct incise_arrow_values *values = &batch->values[column];

	if (values->valid)
		set_bit(values->valid, batch->rows);
	if (batch->fields[column].type == INCISE_ARROW_SINGLE)
		((float *)values->data)[batch->rows] = (float)value;
	else
		((double *)values->data)[batch->rows] = value;
}

/* Control characters and bytes that are not UTF-8 become '?'. Returns the bytes, as many. */
static size_t copy_text(char *to, const char *text)
{
	const char *from = text;

	while (*text) {
		int length = utf8_printable(text);

		*to++ = length ? *text : '?';
		text++;
		for (int i = 1; i < length; i++)
			*to++ = *text++;
	}
	return (size_t)(text - from);
}

void incise_arrow_put_text(struct incise_arrow_batch *batch, int column, const char *text)
{
	struct incise_arrow_values *values = &batch->values[column];
	size_t length = strlen(text), needed = values->bytes + length;

	if (values->valid)
		set_bit(values->valid, batch->rows);
	if (needed > values->bytes_capacity && !batch->failed) {
		size_t capacity = 2 * needed;
		void *data =
			capacity < INT32_MAX ? realloc(values->data, capacity) : NULL;

		batch->failed = !data;
		if (data) {
			values->data = data;
			values->bytes_capacity = capacity;
		}
	}
	if (!batch->failed)
		values->bytes += copy_text((char *)values->data + values->bytes, text);
	values->offsets[batch->rows + 1] = (int32_t)values->bytes;
}

void incise_arrow_put_missing(struct incise_arrow_batch *batch, int column)
{
	struct incise_arrow_values *values = &batch->values[column];

	if (!values->valid) { /* all before are there */
		values->valid = calloc(1, BITS(batch->capacity));
		batch->failed |= !values->valid;
		for (size_t i = 0; values->valid && i < batch->rows; i++)
			set_bit(values->valid, i);
	}
	values->missing++;
	if (batch->fields[column].type == INCISE_ARROW_TEXT)
		values->offsets[batch->rows + 1] = (int32_t)values->bytes;
	else if (batch->fields[column].type != INCISE_ARROW_FLAG)
		memset((char *)values->data +
			       batch->rows * size_of(batch->fields[column].type),
		       0, size_of(batch->fields[column].type));
}

struct column_buffers {
	const void *buffers[3];
};

static void column_release(struct ArrowArray *array)
{
	for (int64_t i = 0; i < array->n_buffers; i++)
		free((void *)array->buffers[i]);
	free(array->private_data);
	array->release = NULL;
}

static void array_release(struct ArrowArray *array)
{
	for (int64_t i = 0; i < array->n_children; i++) {
		if (array->children[i] && array->children[i]->release)
			array->children[i]->release(array->children[i]);
		free(array->children[i]);
	}
	free(array->children);
	free(array->buffers);
	array->release = NULL;
}

/* Move a column's values into a child. */
static bool give(struct incise_arrow_values *values, enum incise_arrow_type type,
		 struct ArrowArray *child, size_t rows)
{
	struct column_buffers *own = calloc(1, sizeof(*own));
	bool text = type == INCISE_ARROW_TEXT;

	if (!own)
		return false;
	own->buffers[0] = values->valid;
	own->buffers[1] = text ? (const void *)values->offsets : values->data;
	own->buffers[2] = text ? values->data : NULL;
	*child = (struct ArrowArray){
		.length = (int64_t)rows,
		.null_count = values->missing,
		.n_buffers = text ? 3 : 2,
		.buffers = own->buffers,
		.release = column_release,
		.private_data = own,
	};
	*values = (struct incise_arrow_values){0};
	return true;
}

int incise_arrow_batch_take(struct incise_arrow_batch *batch, struct ArrowArray *array)
{
	int rc;

	if (batch->failed)
		return -ENOMEM;
	*array = (struct ArrowArray){
		.length = (int64_t)batch->rows,
		.n_buffers = 1,
		.buffers = calloc(1, sizeof(*array->buffers)), /* no value is missing */
		.children = calloc((size_t)batch->n, sizeof(*array->children)),
		.release = array_release,
	};
	rc = array->buffers && array->children ? 0 : -ENOMEM;
	for (int i = 0; i < batch->n && !rc; i++) {
		struct ArrowArray *child = calloc(1, sizeof(*child));

		array->children[array->n_children] = child;
		array->n_children += child != NULL;
		if (!child ||
		    !give(&batch->values[i], batch->fields[i].type, child, batch->rows))
			rc = -ENOMEM;
	}
	if (rc)
		array_release(array);
	return rc;
}
