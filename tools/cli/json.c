// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Reports as JSON; see json.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/infile.h>
#include "cli.h"
#include "json.h"

/* Version of every report; a report whose keys change their meaning gets another. */
#define SCHEMA_VERSION 1

#define READ_MOST (16 << 20) /* a report of all benches has less than 1 */

static const struct incise_infile_kind report_kind = {
	.name = "a report of incise bench",
	.size_max = READ_MOST,
};

json_t *json_number(double value)
{
	return isfinite(value) ? json_real(value) : json_null();
}

json_t *json_numbers(const double *values, int n)
{
	json_t *list = json_array();

	for (int i = 0; i < n; i++)
		json_array_append_new(list, json_number(values[i]));
	return list;
}

json_t *json_bits(unsigned int bits, const char *const *names, size_t n)
{
	json_t *list = json_array();

	for (size_t i = 0; i < n; i++)
		if (bits & 1u << i)
			json_array_append_new(list, json_string(names[i]));
	return list;
}

void json_set_number(json_t *object, const char *key, double value)
{
	json_object_set_new(object, key, json_number(value));
}

void json_set_integer(json_t *object, const char *key, json_int_t value)
{
	json_object_set_new(object, key, json_integer(value));
}

json_t *json_text(const char *text)
{
	json_t *string = json_string(text);
	char *clean;

	if (string)
		return string;
	clean = strdup(text);
	for (char *c = clean; c && *c; c++)
		if ((unsigned char)*c >= 0x80)
			*c = '?';
	string = clean ? json_string(clean) : NULL;
	free(clean);
	return string;
}

json_t *json_taken(char *text)
{
	json_t *made = json_text(text);

	free(text);
	return made;
}

json_t *json_text_or_null(const char *text)
{
	return *text ? json_text(text) : json_null();
}

json_t *json_with_schema(json_t *object, const char *command)
{
	char name[80];
	json_t *keys;

	if (!object || json_object_get(object, "schema"))
		return object;
	snprintf(name, sizeof(name), "incise/%s/%d",
		 command ? command : cli_command_name(), SCHEMA_VERSION);
	for (char *c = name; *c; c++)
		if (*c == ' ')
			*c = '/';
	/* Keys are written in the order in which they were set. */
	keys = json_copy(object);
	json_object_clear(object);
	if (!keys || json_object_set_new(object, "schema", json_string(name)) ||
	    json_object_update(object, keys))
		cli_fail("no memory");
	json_decref(keys);
	return object;
}

int json_write(FILE *out, json_t *object, size_t form)
{
	/* The digits are in the bits above the indent and the flags. */
	if (!(form >> 11 & 0x1f))
		form |= JSON_REAL_PRECISION(12);
	if (!object || json_dumpf(json_with_schema(object, NULL), out, form))
		return -1;
	return putc('\n', out) == EOF ? -1 : 0;
}

void json_print(json_t *object)
{
	/* It is NULL if any part of it could not be made. */
	if (!object)
		cli_fail("the report cannot be written as JSON: out of memory, or a "
			 "name is not UTF-8");
	json_write(stdout, object, JSON_INDENT(2));
	json_decref(object);
	cli_finish();
}

json_t *json_parse(const char *text, size_t n, const char *path, struct incise_error *err)
{
	json_error_t wrong;
	/* A byte order mark of a Windows editor is no content. */
	size_t mark = n > 3 && !memcmp(text, "\xef\xbb\xbf", 3) ? 3 : 0;
	json_t *report =
		json_loadb(text + mark, n - mark, JSON_REJECT_DUPLICATES, &wrong);

	if (report)
		return report;
	if (!*wrong.text)
		return INCISE_ERROR_NULL(err, ENOMEM, "%s: out of memory", path);
	for (char *c = wrong.text; *c; c++)
		if ((unsigned char)*c < ' ' || (unsigned char)*c >= 0x7f)
			*c = '?';
	return INCISE_ERROR_NULL(err, EINVAL, "%s:%d: not JSON: %s", path, wrong.line,
				 wrong.text);
}

json_t *json_read_from(FILE *file, const char *path, struct incise_error *err)
{
	char *text = malloc(READ_MOST + 1);
	json_t *report = NULL;
	size_t n;

	if (!text)
		return INCISE_ERROR_NULL(err, ENOMEM, "%s: out of memory", path);
	n = fread(text, 1, READ_MOST + 1, file);
	if (ferror(file))
		incise_error_set(err, errno, "%s: %s", path, strerror(errno));
	else if (n > READ_MOST)
		incise_error_set(err, EFBIG, "%s: larger than %d MiB, the limit of %s",
				 path, READ_MOST >> 20, report_kind.name);
	else
		report = json_parse(text, n, path, err);
	free(text);
	return report;
}

json_t *json_read(const char *path, struct incise_error *err)
{
	size_t n;
	char *text = incise_infile_read(path, &report_kind, &n, err);
	json_t *report = text ? json_parse(text, n, path, err) : NULL;

	free(text);
	return report;
}
