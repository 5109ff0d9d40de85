// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The one reader and the one printer of settings; see settings.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/infile.h>
#include "c_locale.h"
#include "settings.h"
#include "vector.h"

/* A value of a file or of a text, before it is known what it should be. */
struct value {
	enum { NUMBERS, TRUTH, TEXT, OTHER } form;
	int n; /* numbers */
	bool array;
	double number[SETTING_NUMBERS_MAX];
	const char *text;
};

/* --- members ------------------------------------------------------------------------------ */

static size_t element_size(const struct incise_setting *row)
{
	static const size_t sizes[] = {
		[SETTING_STORES_DOUBLE] = sizeof(double),
		[SETTING_STORES_INT] = sizeof(int),
		[SETTING_STORES_U8] = 1,
		[SETTING_STORES_U32] = 4,
		[SETTING_STORES_U64] = 8,
		[SETTING_STORES_BOOL] = sizeof(bool),
		[SETTING_STORES_CHARS] = 1,
		[SETTING_STORES_POINTER] = sizeof(char *),
	};

	return sizes[row->store];
}

static int elements(const struct incise_setting *row)
{
	return (int)(row->size / element_size(row));
}

static bool is_array(const struct incise_setting *row)
{
	return row->kind <= SETTING_IS_DIRECTION && elements(row) > 1;
}

static double scale_of(const struct incise_setting *row)
{
	return row->scale > 0 ? row->scale : 1;
}

static void put_settings_number(const struct incise_setting *row, void *to, int i,
				double value)
{
	void *at = (char *)to + row->offset;

	value *= scale_of(row);
	switch (row->store) {
	case SETTING_STORES_INT:
		((int *)at)[i] = (int)value;
		break;
	case SETTING_STORES_U8:
		((uint8_t *)at)[i] = (uint8_t)value;
		break;
	case SETTING_STORES_U32:
		((uint32_t *)at)[i] = (uint32_t)lround(value);
		break;
	case SETTING_STORES_U64:
		((uint64_t *)at)[i] = (uint64_t)llround(value);
		break;
	case SETTING_STORES_BOOL:
		((bool *)at)[i] = value != 0;
		break;
	default:
		((double *)at)[i] = value;
	}
}

static double get_number(const struct incise_setting *row, const void *of, int i)
{
	const void *at = (const char *)of + row->offset;
	double value;

	switch (row->store) {
	case SETTING_STORES_INT:
		value = ((const int *)at)[i];
		break;
	case SETTING_STORES_U8:
		value = ((const uint8_t *)at)[i];
		break;
	case SETTING_STORES_U32:
		value = ((const uint32_t *)at)[i];
		break;
	case SETTING_STORES_U64:
		value = (double)((const uint64_t *)at)[i];
		break;
	case SETTING_STORES_BOOL:
		value = ((const bool *)at)[i];
		break;
	default:
		value = ((const double *)at)[i];
	}
	return value / scale_of(row);
}

static const char *get_text(const struct incise_setting *row, const void *of)
{
	const void *at = (const char *)of + row->offset;
	const char *text =
		row->store == SETTING_STORES_POINTER ? *(const char *const *)at : at;

	return text ? text : "";
}

static int *counter(const struct incise_setting *row, const void *of)
{
	return (int *)((char *)of + row->count);
}

static int count_of(const struct incise_setting *row, const void *of)
{
	return row->count ? *counter(row, of) : elements(row);
}

/* --- values ------------------------------------------------------------------------------- */

static bool read_number(const config_setting_t *setting, double *number)
{
	switch (config_setting_type(setting)) {
	case CONFIG_TYPE_INT:
	case CONFIG_TYPE_INT64:
		*number = (double)config_setting_get_int64(setting);
		return true;
	case CONFIG_TYPE_FLOAT:
		*number = config_setting_get_float(setting);
		return true;
	default:
		return false;
	}
}

static void value_of_setting(struct value *value, const config_setting_t *setting)
{
	int length;

	value->form = OTHER;
	value->n = 1;
	value->array = false;
	if (read_number(setting, &value->number[0])) {
		value->form = NUMBERS;
	} else if (config_setting_type(setting) == CONFIG_TYPE_BOOL) {
		value->form = TRUTH;
		value->number[0] = config_setting_get_bool(setting);
	} else if (config_setting_type(setting) == CONFIG_TYPE_STRING) {
		value->form = TEXT;
		value->text = config_setting_get_string(setting);
	} else if (!config_setting_is_group(setting)) {
		length = config_setting_length(setting);
		value->array = true;
		for (value->n = 0; value->n < length && value->n < SETTING_NUMBERS_MAX;
		     value->n++)
			if (!read_number(config_setting_get_elem(setting, value->n),
					 &value->number[value->n]))
				return;
		value->form = value->n == length ? NUMBERS : OTHER;
	}
}

/* "[a, b]": of a default; users write no arrays as text. */
static void value_of_array(struct value *value, const char *text)
{
	char *end = (char *)text;

	*value = (struct value){.form = NUMBERS, .array = true};
	for (; *end == '[' || *end == ','; value->n++)
		value->number[value->n] = incise_decimal(end + 1, &end);
}

/* A text of the kind of @row. */
static void value_of_text(struct value *value, const struct incise_setting *row,
			  const char *text)
{
	char *end;

	*value = (struct value){.form = TEXT, .n = 1, .text = text};
	if (row->kind == SETTING_IS_TEXT || row->kind == SETTING_IS_WORD)
		return;
	if (row->kind == SETTING_IS_TRUTH) {
		value->number[0] = !strcmp(text, "true");
		if (*value->number || !strcmp(text, "false"))
			value->form = TRUTH;
	} else {
		value->number[0] = incise_decimal(text, &end);
		if (end != text && !*end)
			value->form = NUMBERS;
		value->array = row->count; /* the only one of them */
	}
}

static int word_index(const struct incise_setting *row, const char *word)
{
	for (int i = 0; row->words[i]; i++)
		if (!strcmp(row->words[i], word))
			return i;
	return -1;
}

/* Whether the index of a member is an index of a word. */
static bool has_word(const struct incise_setting *row, double index)
{
	for (int i = 0; row->words[i]; i++)
		if (i == index)
			return true;
	return false;
}

static bool numbers_fit(const struct incise_setting *row, const struct value *value)
{
	double unit[3];
	int most = elements(row);

	if (value->form != NUMBERS || value->array != is_array(row) || value->n > most ||
	    (!row->count && value->n != most) || (value->n < 1 && *row->initial != '('))
		return false;
	for (int i = 0; i < value->n; i++)
		if (!(value->number[i] >= row->min && value->number[i] <= row->max) ||
		    (row->kind == SETTING_IS_WHOLE &&
		     value->number[i] != floor(value->number[i])))
			return false;
	/* Shorter than this, its direction is more rounding than intent. */
	return row->kind != SETTING_IS_DIRECTION || v3_unit(unit, value->number, 1e-6);
}

static bool fits_settings(const struct incise_setting *row, const struct value *value)
{
	bool good;

	switch (row->kind) {
	case SETTING_IS_TRUTH:
		good = value->form == TRUTH &&
		       (value->number[0] == 0 || value->number[0] == 1);
		break;
	case SETTING_IS_WORD:
		good = value->form == TEXT && word_index(row, value->text) >= 0;
		break;
	case SETTING_IS_TEXT:
		good = value->form == TEXT && (row->store == SETTING_STORES_POINTER ||
					       strlen(value->text) < row->size);
		break;
	default:
		good = numbers_fit(row, value);
	}
	return good && (!row->fits || row->fits(value->number, value->n, value->text));
}

/* Numbers, true and false, or the index of a word. */
static void value_of_member(struct value *value, const struct incise_setting *row,
			    const void *of)
{
	value->form = row->kind == SETTING_IS_TRUTH ? TRUTH : NUMBERS;
	value->array = is_array(row);
	value->n = count_of(row, of);
	for (int i = 0; i < value->n && i < elements(row); i++)
		value->number[i] = get_number(row, of, i);
}

/* A value that fits. */
static void store(const struct incise_setting *row, const struct value *value, void *to)
{
	if (row->kind == SETTING_IS_TEXT) {
		if (row->store == SETTING_STORES_POINTER)
			memcpy((char *)to + row->offset, &value->text,
			       sizeof(value->text));
		else
			strcpy((char *)to + row->offset, value->text);
	} else if (row->kind == SETTING_IS_WORD) {
		put_settings_number(row, to, 0, word_index(row, value->text));
	} else if (row->kind == SETTING_IS_DIRECTION) {
		v3_unit((double *)((char *)to + row->offset), value->number, 1e-6);
	} else {
		for (int i = 0; i < value->n; i++)
			put_settings_number(row, to, i, value->number[i]);
		if (row->count)
			*counter(row, to) = value->n;
	}
}

/* The condition of a value, in words. */
static void say_expected(const struct incise_setting *row, char *text, size_t size)
{
	const char *whole = row->kind == SETTING_IS_WHOLE ? "whole " : "";
	int n = elements(row);
	size_t length = 0;

	if (row->expected)
		snprintf(text, size, "%s", row->expected);
	else if (row->kind == SETTING_IS_TRUTH)
		snprintf(text, size, "true or false");
	else if (row->kind == SETTING_IS_TEXT && row->store == SETTING_STORES_POINTER)
		snprintf(text, size, "text in quotes");
	else if (row->kind == SETTING_IS_TEXT)
		snprintf(text, size, "text in quotes, of at most %zu bytes",
			 row->size - 1);
	else if (row->kind == SETTING_IS_DIRECTION)
		snprintf(text, size, "a direction [x, y, z] that is not 0");
	else if (is_array(row))
		snprintf(text, size, "%s%d %snumbers %s from %.10g to %.10g",
			 row->count ? "1 to " : "", n, whole,
			 n == 3 ? "[x, y, z]" : "[a, b, …]", row->min, row->max);
	else if (row->kind != SETTING_IS_WORD)
		snprintf(text, size, "a %snumber from %.10g to %.10g", whole, row->min,
			 row->max);
	for (int i = 0; row->kind == SETTING_IS_WORD && !row->expected && row->words[i] &&
			length < size;
	     i++)
		length += snprintf(text + length, size - length, "%s%s",
				   i ? ", " : "one of ", row->words[i]);
}

/* --- defaults, files and texts ------------------------------------------------------------- */

const struct incise_setting *incise_setting_of(const struct incise_setting *rows,
					       const char *key)
{
	for (; rows->key; rows++)
		if (!strcmp(rows->key, key))
			return rows;
	return NULL;
}

static void init(const struct incise_setting *row, void *to)
{
	struct value value;

	if (row->kind == SETTING_IS_GROUP) {
		for (row = row->rows; row->key; row++)
			init(row, to);
	} else if (row->kind != SETTING_IS_OWN && *row->initial != '(') {
		if (*row->initial == '[')
			value_of_array(&value, row->initial);
		else
			value_of_text(&value, row, row->initial);
		store(row, &value, to);
	}
}

void incise_settings_init(const struct incise_setting *rows, void *to)
{
	struct incise_c_locale locale = incise_c_locale_begin();

	for (; rows->key; rows++)
		init(rows, to);
	incise_c_locale_end(locale);
}

static void names_of(const struct incise_setting *rows, const char **names)
{
	int n = 0;

	for (; rows->key && n < SETTING_ROWS_MAX; rows++)
		names[n++] = rows->key;
	names[n] = NULL;
}

static int read_one(const struct incise_setting *row, const config_setting_t *setting,
		    const char *path, void *to, struct incise_error *err)
{
	struct value value;
	char expected[200];

	if (row->kind == SETTING_IS_GROUP)
		return incise_settings_read(row->rows, setting, path, to, err);
	if (row->kind == SETTING_IS_OWN)
		return row->read ? row->read(to, setting, path, err) : 0;
	value_of_setting(&value, setting);
	if (fits_settings(row, &value)) {
		store(row, &value, to);
		return 0;
	}
	if (row->read)
		return row->read(to, setting, path, err);
	say_expected(row, expected, sizeof(expected));
	return incise_conf_error(setting, NULL, path, err, "%s", expected);
}

int incise_settings_read(const struct incise_setting *rows, const config_setting_t *group,
			 const char *path, void *to, struct incise_error *err)
{
	const char *names[SETTING_ROWS_MAX + 1];
	int rc;

	if (!group)
		return 0;
	names_of(rows, names);
	rc = incise_conf_known(group, path, names, err);
	for (; rows->key && !rc; rows++) {
		const config_setting_t *setting =
			config_setting_get_member(group, rows->key);

		if (setting)
			rc = read_one(rows, setting, path, to, err);
		else if (!strcmp(rows->initial, SETTING_REQUIRED))
			rc = incise_conf_missing(group, path, rows->key, err);
	}
	return rc;
}

/* @key may have an index. */
static const struct incise_setting *find_row(const struct incise_setting *rows,
					     const char *key, int *index)
{
	const struct incise_setting *row;
	char name[80];
	int end = 0;

	*index = -1;
	snprintf(name, sizeof(name), "%.*s", (int)strcspn(key, "["), key);
	row = incise_setting_of(rows, name);
	if (!row || row->kind >= SETTING_IS_GROUP)
		return NULL;
	if (!key[strlen(name)])
		return row;
	if (!row->count || sscanf(key + strlen(name), "[%1d]%n", index, &end) != 1 ||
	    !end || key[strlen(name) + end] || *index >= elements(row))
		return NULL;
	return row;
}

int incise_settings_set(const struct incise_setting *rows, const char *group,
			const char *key, const char *text, void *to,
			struct incise_error *err)
{
	const char *names[SETTING_ROWS_MAX + 1], *nearest;
	const struct incise_setting *row;
	struct incise_c_locale locale;
	struct value value;
	char expected[200];
	int index;

	row = find_row(rows, key, &index);
	if (!row) {
		names_of(rows, names);
		nearest = incise_nearest_name(key, names);
		return incise_error_set(err, ENOENT, "%s.%.60s: unknown key; %s%s%s",
					group, key,
					nearest ? "did you mean " : "rig.conf(5)",
					nearest ? nearest : " lists them",
					nearest ? "?" : "");
	}
	locale = incise_c_locale_begin();
	value_of_text(&value, row, text);
	incise_c_locale_end(locale);
	if (!fits_settings(row, &value)) {
		say_expected(row, expected, sizeof(expected));
		return incise_error_set(err, EINVAL,
					"%s.%.60s: expected %s, found %.40s; correct it",
					group, key, expected, text);
	}
	if (index < 0) {
		store(row, &value, to);
		return 0;
	}
	put_settings_number(row, to, index, value.number[0]);
	if (*counter(row, to) <= index)
		*counter(row, to) = index + 1;
	return 0;
}

int incise_settings_check(const struct incise_setting *rows, const char *group,
			  const void *of, struct incise_error *err)
{
	struct value value;
	char expected[200], found[SETTING_TEXT_MAX];

	for (; rows->key; rows++) {
		if (rows->kind > SETTING_IS_WORD)
			continue;
		value_of_member(&value, rows, of);
		if (rows->kind == SETTING_IS_WORD ? has_word(rows, *value.number)
						  : fits_settings(rows, &value))
			continue;
		say_expected(rows, expected, sizeof(expected));
		snprintf(found, sizeof(found), "%d numbers", value.n);
		if (value.n >= 1 && value.n <= elements(rows))
			incise_setting_text(rows, of, found, sizeof(found));
		return incise_error_set(err, EINVAL,
					"%s.%s: expected %s, found %s; correct it", group,
					rows->key, expected, found);
	}
	return 0;
}

/* --- printing ------------------------------------------------------------------------------ */

/* In libconfig either all numbers of an array are whole, or no number is. */
static void numbers_text(const struct incise_setting *row, const void *of, char *text,
			 size_t size)
{
	int n = count_of(row, of);
	bool whole = true;
	char one[32];
	size_t length = 0;

	for (int i = 0; i < n; i++) {
		snprintf(one, sizeof(one), "%.15g", get_number(row, of, i));
		whole &=
			!strpbrk(one, ".en") && fabs(get_number(row, of, i)) <= INT32_MAX;
	}
	for (int i = 0; i < n && length < size; i++) {
		snprintf(one, sizeof(one), "%.15g", get_number(row, of, i));
		length += snprintf(text + length, size - length, "%s%s%s",
				   !is_array(row) ? ""
				   : i		  ? ", "
						  : "[",
				   one, whole || strpbrk(one, ".en") ? "" : ".0");
	}
	if (is_array(row) && length < size)
		snprintf(text + length, size - length, "%s]", n ? "" : "[");
}

void incise_setting_quoted(const char *from, char *text, size_t size)
{
	size_t length = 0;

	text[length++] = '"';
	for (; *from && length + 4 < size; from++) {
		if (*from == '"' || *from == '\\')
			text[length++] = '\\';
		text[length++] = (unsigned char)*from < ' ' || *from == 127 ? '?' : *from;
	}
	text[length++] = '"';
	text[length] = '\0';
}

/* A value that no file can set is no value, if the key has no default. */
static bool is_none(const struct incise_setting *row, const void *of)
{
	struct value value;

	if (row->kind == SETTING_IS_TEXT)
		return !*get_text(row, of);
	if (*row->initial != '(' || row->kind > SETTING_IS_TRUTH)
		return false;
	value_of_member(&value, row, of);
	return !fits_settings(row, &value);
}

void incise_setting_text(const struct incise_setting *row, const void *of, char *text,
			 size_t size)
{
	struct incise_c_locale locale = incise_c_locale_begin();

	*text = '\0';
	if (is_none(row, of))
		;
	else if (row->kind == SETTING_IS_TEXT)
		incise_setting_quoted(get_text(row, of), text, size);
	else if (row->kind == SETTING_IS_WORD && has_word(row, get_number(row, of, 0)))
		incise_setting_quoted(row->words[(int)get_number(row, of, 0)], text,
				      size);
	else if (row->kind == SETTING_IS_TRUTH)
		snprintf(text, size, "%s", get_number(row, of, 0) ? "true" : "false");
	else if (row->kind <= SETTING_IS_WORD)
		numbers_text(row, of, text, size);
	incise_c_locale_end(locale);
}

/* Text, or an array of texts; "" for NULL. */
static void as_written(const config_setting_t *setting, char *text, size_t size)
{
	int n = setting && config_setting_is_aggregate(setting)
			? config_setting_length(setting)
			: 0;
	size_t length = 0;

	*text = '\0';
	if (setting && config_setting_type(setting) == CONFIG_TYPE_STRING)
		incise_setting_quoted(config_setting_get_string(setting), text, size);
	for (int i = 0; i < n && length + 8 < size; i++) {
		length += snprintf(text + length, size - length, "%s", i ? ", " : "[");
		incise_setting_quoted(config_setting_get_string_elem(setting, i),
				      text + length, size - length);
		length = strlen(text);
	}
	if (setting && config_setting_is_aggregate(setting) && length + 3 < size)
		strcpy(text + length, n ? "]" : "[]");
}

void incise_settings_put(struct incise_settings_list *list,
			 const struct incise_setting *row,
			 const config_setting_t *setting, const char *prefix,
			 const char *name, const char *text)
{
	struct incise_key key = {
		.unit = row->unit,
		.help = row->help,
		.given = setting,
		.line = setting ? incise_conf_line(setting) : 0,
	};

	snprintf(key.name, sizeof(key.name), "%s%s%s", prefix, *prefix ? "." : "", name);
	snprintf(key.value, sizeof(key.value), "%s", text);
	if (!list->rc)
		list->rc = list->found(list->context, &key);
}

void incise_settings_list(struct incise_settings_list *list,
			  const struct incise_setting *rows, const void *of,
			  const config_setting_t *group, const char *prefix)
{
	char text[SETTING_TEXT_MAX];

	for (; rows->key; rows++) {
		const config_setting_t *setting =
			group ? config_setting_get_member(group, rows->key) : NULL;

		if (rows->kind == SETTING_IS_GROUP ||
		    (setting && config_setting_is_group(setting)))
			continue;
		if (rows->kind == SETTING_IS_OWN && !setting && *rows->initial &&
		    *rows->initial != '(')
			incise_setting_quoted(rows->initial, text, sizeof(text));
		else if (rows->kind == SETTING_IS_OWN ||
			 (setting && config_setting_type(setting) == CONFIG_TYPE_STRING))
			as_written(setting, text, sizeof(text));
		else
			incise_setting_text(rows, of, text, sizeof(text));
		incise_settings_put(list, rows, setting, prefix, rows->key, text);
	}
}
