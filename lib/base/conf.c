// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Strict reading of libconfig files; see conf.h.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/infile.h>
#include "conf.h"
#include "utf8.h"

#define UNIT_LETTERS 3 /* of each part, as in mPa_s */

/* "sim.seed": the setting's name behind the names of its groups. */
static void setting_name(const config_setting_t *setting, const char *key, char *name,
			 size_t size)
{
	const char *own = setting ? config_setting_name(setting) : NULL;
	size_t length = 0;

	if (own || (setting && !config_setting_is_root(setting))) {
		setting_name(config_setting_parent(setting), NULL, name, size);
		length = strlen(name);
		if (own)
			snprintf(name + length, size - length, "%s%s", length ? "." : "",
				 own);
		else
			snprintf(name + length, size - length, "[%d]",
				 config_setting_index(setting) + 1);
	} else {
		name[0] = '\0';
	}
	length = strlen(name);
	if (key)
		snprintf(name + length, size - length, "%s%s", length ? "." : "", key);
}

/* A setting's value as it was written, as far as one line can show it. */
static void setting_value(const config_setting_t *setting, char *text, size_t size)
{
	int n = config_setting_length(setting);
	size_t length;

	switch (config_setting_type(setting)) {
	case CONFIG_TYPE_INT:
	case CONFIG_TYPE_INT64:
		snprintf(text, size, "%lld", config_setting_get_int64(setting));
		return;
	case CONFIG_TYPE_FLOAT:
		snprintf(text, size, "%.10g", config_setting_get_float(setting));
		return;
	case CONFIG_TYPE_STRING:
		snprintf(text, size, "\"%.40s\"", config_setting_get_string(setting));
		return;
	case CONFIG_TYPE_BOOL:
		snprintf(text, size, "%s",
			 config_setting_get_bool(setting) ? "true" : "false");
		return;
	case CONFIG_TYPE_GROUP:
		snprintf(text, size, "a group");
		return;
	}
	if (n && config_setting_is_group(config_setting_get_elem(setting, 0))) {
		snprintf(text, size, "a list of %d", n);
		return;
	}
	length = snprintf(text, size, "[");
	for (int i = 0; i < n && length < size - 1; i++) {
		if (i == 4 && n > 5) {
			snprintf(text + length, size - length, ", … %d values]", n);
			return;
		}
		length += snprintf(text + length, size - length, "%s", i ? ", " : "");
		if (length < size - 1)
			setting_value(config_setting_get_elem(setting, i), text + length,
				      size - length);
		length = strlen(text);
	}
	if (length < size - 1)
		strcpy(text + length, "]");
}

/* An included file is named instead of the one that includes it. */
static const char *file_of(const config_setting_t *setting, const char *path)
{
	const char *file = config_setting_source_file(setting);

	return file ? file : path;
}

/* libconfig gives a group in a list the line before it; its first key has the right one. */
int incise_conf_line(const config_setting_t *setting)
{
	const config_setting_t *around = config_setting_parent(setting);

	if (around && config_setting_is_list(around) &&
	    config_setting_is_group(setting) && config_setting_length(setting))
		setting = config_setting_get_elem(setting, 0);
	return (int)config_setting_source_line(setting);
}

int incise_conf_error(const config_setting_t *group, const char *key, const char *path,
		      struct incise_error *err, const char *fmt, ...)
{
	const config_setting_t *setting =
		key ? config_setting_get_member(group, key) : group;
	char name[120], found[100] = "its default", expected[400];
	va_list args;

	va_start(args, fmt);
	vsnprintf(expected, sizeof(expected), fmt, args);
	va_end(args);
	setting_name(group, key, name, sizeof(name));
	if (setting)
		setting_value(setting, found, sizeof(found));
	else
		setting = group;
	return incise_error_set(err, EINVAL,
				"%.100s:%d: %s: expected %s, found %s; correct it",
				file_of(setting, path), incise_conf_line(setting), name,
				expected, found);
}

/*
 * The line of an @include, or 0. The reader refuses includes: a configuration is one
 * file, and libconfig's parser ends the process on an include of a folder.
 */
static int include_line(FILE *stream)
{
	char *text = NULL;
	size_t size = 0;
	int line = 0, found = 0;

	while (!found && getline(&text, &size, stream) >= 0) {
		line++;
		if (!strncmp(text + strspn(text, " \t"), "@include", 8))
			found = line;
	}
	free(text);
	return found;
}

static int parse_conf(config_t *config, const char *path, FILE *stream,
		      struct incise_error *err)
{
	int rc = 0;

	config_init(config);
	if (!config_read(config, stream)) {
		const char *file = config_error_file(config);
		const char *text = config_error_text(config);
		bool syntax = !strcmp(text, "syntax error");

		rc = incise_error_set(err, EINVAL, "%.200s:%d: %s%s; correct it",
				      file ? file : path, config_error_line(config), text,
				      syntax ? ": expected `key = value;`" : "");
		config_destroy(config);
	}
	return rc;
}

int incise_conf_read_text(config_t *config, const char *path, char *text, size_t size,
			  struct incise_error *err)
{
	/* The parser ends the process where a disk fails to read; memory does not fail. */
	int mark = utf8_mark(text);
	FILE *stream = fmemopen(text + mark, size - (size_t)mark, "r");
	int line = stream ? include_line(stream) : 0, rc;

	if (line)
		rc = incise_error_set(err, EINVAL,
				      "%.200s:%d: @include is not supported; write all "
				      "keys in one file",
				      path, line);
	else if (!stream || fseek(stream, 0, SEEK_SET))
		rc = incise_error_set(err, ENOMEM, "%.200s: no memory to read it", path);
	else
		rc = parse_conf(config, path, stream, err);
	if (stream)
		fclose(stream);
	return rc;
}

int incise_conf_read(config_t *config, const char *path, struct incise_error *err)
{
	static const struct incise_infile_kind kind = {
		.name = "a configuration file",
		.advice = "give the path of a configuration file",
		.size_max = 4 << 20,
		.regular = true,
	};
	size_t size;
	char *text = incise_infile_read(path, &kind, &size, err);
	int rc;

	if (!text)
		return -errno;
	rc = incise_conf_read_text(config, path, text, size, err);
	free(text);
	return rc;
}

/*
 * The number of characters that two keys have in common at their start, if they are one
 * quantity in two units ("radius_cm" and "radius_mm"); else 0.
 */
static size_t other_unit(const char *a, const char *b)
{
	size_t n = strcspn(a, "_"), same = 0;

	if (n != strcspn(b, "_") || strncmp(a, b, n) || !b[n])
		return 0;
	while (a[same] && a[same] == b[same])
		same++;
	if (!a[same])
		return same;
	/* The parts of a unit are short: "noize_mV" is no unit of "noise_mV". */
	for (n = same; n && a[n - 1] != '_';)
		n--;
	return strcspn(a + n, "_") <= UNIT_LETTERS ? same : 0;
}

static int unknown_key(const config_setting_t *setting, const char *path,
		       const char *const *keys, struct incise_error *err)
{
	const char *own = config_setting_name(setting);
	const char *meant = NULL, *nearest = incise_nearest_name(own, keys);
	char name[120], known[360] = "";
	size_t length = 0, alike = 0;

	for (const char *const *key = keys; *key && length < sizeof(known); key++) {
		length += snprintf(known + length, sizeof(known) - length, "%s%s",
				   key == keys ? "" : ", ", *key);
		if (other_unit(own, *key) > alike) {
			alike = other_unit(own, *key);
			meant = *key;
		}
	}
	setting_name(setting, NULL, name, sizeof(name));
	if (meant && !config_setting_is_group(setting))
		return incise_error_set(
			err, EINVAL,
			"%.100s:%d: %s: unknown key; expected %s, in the unit of its "
			"name",
			file_of(setting, path), config_setting_source_line(setting), name,
			meant);
	if (nearest)
		return incise_error_set(err, EINVAL,
					"%.100s:%d: %s: unknown key; did you mean %s?",
					file_of(setting, path),
					config_setting_source_line(setting), name,
					nearest);
	return incise_error_set(err, EINVAL,
				"%.100s:%d: %s: unknown key; expected one of %s",
				file_of(setting, path),
				config_setting_source_line(setting), name, known);
}

int incise_conf_known(const config_setting_t *group, const char *path,
		      const char *const *keys, struct incise_error *err)
{
	if (!config_setting_is_group(group))
		return incise_conf_error(group, NULL, path, err,
					 "a group { KEY = VALUE; … }");
	for (int i = 0; i < config_setting_length(group); i++) {
		const config_setting_t *setting = config_setting_get_elem(group, i);
		const char *const *key = keys;

		while (*key && strcmp(config_setting_name(setting), *key))
			key++;
		if (!*key)
			return unknown_key(setting, path, keys, err);
	}
	return 0;
}

int incise_conf_missing(const config_setting_t *group, const char *path, const char *key,
			struct incise_error *err)
{
	char name[120];

	setting_name(group, key, name, sizeof(name));
	return incise_error_set(err, EINVAL, "%.100s:%d: %s: missing; add it",
				file_of(group, path), incise_conf_line(group), name);
}
