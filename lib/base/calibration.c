// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * calibration.conf: the keys in force and, below them, the history: each calibration with its
 * values before and after. Nothing in the file is trusted. It is written so that a person can
 * read it, with unit, uncertainty and date behind each key: libconfig's own writer has no
 * comments and rounds numbers to six decimals.
 *
 *   force_mV_N = 1238.6;          in force
 *   history = ( { kind = "force"; …; values = ( { key = "force_mV_N"; … } ); }, … );
 */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <libconfig.h>
#include <incise/calibration.h>
#include <incise/outfile.h>
#include "c_locale.h"
#include "crc32c.h"
#include "settings.h"
#include "vector.h"

#define SETTINGS_OF struct incise_calibration
#define DELAY(key, initial, help) \
	SETTING_NUMBER(key, key, "ms", -1000, 1000, initial, help)
#define DELAY_SD(key)                                                                \
	SETTING_NUMBER(key, key, "ms", 0, 1000, "(none)",                            \
		       "standard uncertainty of that delay; without it a recording " \
		       "reports the delay as not calibrated")

/* The numbers are all double. Without a default they are NAN. */
const struct incise_setting incise_calibration_settings[] = {
	SETTING_NUMBER(force_mV_N, force_mV_N, "mV/N", 1, 100000, "1240",
		       "sensitivity of the force channel after its amplifier"),
	SETTING_NUMBER(
		force_zero_mV, force_zero_mV, "mV", -10000, 10000, "(measured)",
		"reading of the force channel without load; else measured at the start of each "
		"recording, while the scalpel is in the air"),
	SETTING_NUMBER(
		depth_mm_px, depth_mm_px, "mm/px", 0.0001, 10, "0.11875",
		"scale of the camera in the plane of the scalpel; 47.5 mm over 400 pixels"),
	SETTING_VECTOR(
		tip_mm, tip_mm, "mm", "[0, 0, 0]",
		"tip of the blade in the sensor's frame, relative to the tracked point: the sensor, "
		"or the point set with offset_mm in rig.conf"),
	SETTING_NUMBER(
		surface_u_mm, surface_u_mm, "mm", 0, 1000, "(none)",
		"standard uncertainty of the tissue surface of rig.conf along its normal, with that of "
		"the tip that it was touched with; without it that of a depth is not stated"),
	/* a camera may timestamp the end of an exposure: later than its middle, or not */
	DELAY(force_delay_ms, "(0)",
	      "delay of the force from acquisition to the earliest arrival, or to the timestamp if the "
	      "device sends one"),
	DELAY_SD(force_delay_sd_ms),
	DELAY(tracker_delay_ms, "(data sheet)", "the same of the poses"),
	DELAY_SD(tracker_delay_sd_ms),
	DELAY(camera_delay_ms, "(0)", "the same of the frames"),
	DELAY_SD(camera_delay_sd_ms),
	SETTING_NUMBER(
		stepper_N_step, stepper_N_step, "N", -100, 100, "(none)",
		"force per microstep of the actuator; the sign is that of the direction"),
	SETTING_NUMBER(stepper_backlash_mm, stepper_backlash_mm, "mm", 0, 100, "(none)",
		       "travel lost at a reversal of the actuator"),
	SETTING_NUMBER(stepper_hysteresis_N, stepper_hysteresis_N, "N", 0, 1000, "(none)",
		       "force difference between both directions"),
	SETTING_NUMBER(stepper_stiction_N, stepper_stiction_N, "N", 0, 1000, "(none)",
		       "force at which the actuator starts to move"),
	SETTING_NUMBER(stepper_steps_s, stepper_steps_s, "1/s", 0, 1e7, "(none)",
		       "largest rate without lost steps, microsteps per second"),
	SETTING_NUMBER(
		frame_turn_deg, frame_turn_deg, "degrees", -180, 180, "(none)",
		"turn of a haptic device's frame into the scene's: its axis, in the scene, times the "
		"angle; else that of haptic_setup in rig.conf"),
	SETTING_VECTOR(frame_mm, frame_mm, "mm", "(none)",
		       "origin of that frame in the scene"),
	SETTING_OWN(history, "", "(none)", "list of all calibrations, oldest first"),
	{0},
};

static const struct incise_setting *const settings = incise_calibration_settings;

#define N_KEYS ((int)(sizeof(incise_calibration_settings) / sizeof(*settings)) - 2)

struct file_content {
	struct incise_calibration in_force;
	bool present[N_KEYS]; /* else nominal */
	struct incise_calibration_record *records;
	int n;
};

static double *number_at(struct incise_calibration *calibration,
			 const struct incise_setting *row)
{
	return (double *)((char *)calibration + row->offset);
}

static int count_numbers(const struct incise_setting *row)
{
	return (int)(row->size / sizeof(double));
}

void incise_calibration_nominal(struct incise_calibration *calibration)
{
	for (int i = 0; i < N_KEYS; i++)
		for (int k = 0; k < count_numbers(&settings[i]); k++)
			number_at(calibration, &settings[i])[k] = NAN;
	incise_settings_init(settings, calibration);
}

/* Number @k of a row has a key of its own in the history: tip_y_mm of tip_mm. */
static void name_number(const struct incise_setting *row, int k, char name[40])
{
	const char *unit = strrchr(row->key, '_');

	if (count_numbers(row) == 1)
		snprintf(name, 40, "%s", row->key);
	else
		snprintf(name, 40, "%.*s_%c%s", (int)(unit - row->key), row->key, 'x' + k,
			 unit);
}

/* A key of the history. */
static const struct incise_setting *find_key(const char *key, int *element)
{
	char name[40];

	for (int i = 0; i < N_KEYS; i++)
		for (*element = 0; *element < count_numbers(&settings[i]); ++*element) {
			name_number(&settings[i], *element, name);
			if (!strcmp(name, key))
				return &settings[i];
		}
	return NULL;
}

bool incise_calibration_has_key(const char *key)
{
	return incise_setting_of(settings, key);
}

double incise_calibration_get(const struct incise_calibration *calibration,
			      const char *name)
{
	struct incise_calibration copy = *calibration;
	int element;
	const struct incise_setting *row = find_key(name, &element);

	return row ? number_at(&copy, row)[element] : NAN;
}

bool incise_calibration_frame(const struct incise_calibration *calibration,
			      double turn[4], double origin_mm[3])
{
	const double *deg = calibration->frame_turn_deg;
	double size_deg = v3_length(deg), half = size_deg * M_PI / 360;

	if (!v3_finite(deg) || !v3_finite(calibration->frame_mm))
		return false;
	turn[0] = cos(half);
	for (int k = 0; k < 3; k++)
		turn[1 + k] = size_deg > 0 ? sin(half) * deg[k] / size_deg : 0;
	v3_copy(origin_mm, calibration->frame_mm);
	return true;
}

/* --- reading --- */

/* 2026-11-21T14:48:16Z, and nothing behind it. */
static bool is_date(const char *text)
{
	static const char form[] = "dddd-dd-ddTdd:dd:ddZ";

	if (strlen(text) != sizeof(form) - 1)
		return false;
	for (size_t i = 0; i < sizeof(form) - 1; i++)
		if (form[i] == 'd' ? text[i] < '0' || text[i] > '9' : text[i] != form[i])
			return false;
	return atoi(text + 5) >= 1 && atoi(text + 5) <= 12 && atoi(text + 8) >= 1 &&
	       atoi(text + 8) <= 31 && atoi(text + 11) < 24 && atoi(text + 14) < 60 &&
	       atoi(text + 17) <= 60;
}

static bool is_kind(const char *text)
{
	return *text && !text[strspn(text, "abcdefghijklmnopqrstuvwxyz")];
}

static void make_printable(char *text)
{
	for (; *text; text++)
		if ((unsigned char)*text < ' ' || *text == 127)
			*text = '?';
}

/*
 * The fault of a record, as words behind the name of its key; NULL: no fault. For records of a
 * file and for one to be appended.
 */
static const char *fault(const struct incise_calibration_record *record)
{
	const int n = record->n;

	if (!is_kind(record->kind))
		return "kind: expected letters a to z, for example force";
	if (!is_date(record->date))
		return "date: expected a date and time as 2026-11-21T14:48:16Z";
	if (n < 1 || n > INCISE_CALIBRATION_VALUES)
		return "values: expected 1 to 16 values";
	for (int i = 0; i < n; i++) {
		const struct incise_calibration_value *value = &record->values[i];
		int element;
		const struct incise_setting *row = find_key(value->key, &element);

		if (!row)
			return "values: key: expected a key of calibration.conf";
		/* A failed calibration may be far out; the file keeps it for readers. */
		if (!isfinite(value->left) ||
		    (record->pass &&
		     !(value->left >= row->min && value->left <= row->max)))
			return "values: left: expected a number in the range of its key";
		if (isinf(value->found))
			return "values: found: expected a finite number";
		if (!isfinite(value->u) || value->u < 0)
			return "values: u: expected a standard uncertainty of at least "
			       "0";
	}
	if (record->n_covariance && record->n_covariance != n * (n + 1) / 2)
		return "covariance: expected n (n + 1)/2 numbers for n values";
	for (int i = 0; i < record->n_covariance; i++)
		if (!isfinite(record->covariance[i]))
			return "covariance: expected finite numbers";
	if (isinf(record->low) || isinf(record->high) || record->low > record->high)
		return "low: expected a range from low to high";
	return NULL;
}

/* A calibration in the history, and each of its values. */
#undef SETTINGS_OF
#define SETTINGS_OF struct incise_calibration_value
#define ANY 1e300
static const struct incise_setting value_settings[] = {
	SETTING_TEXT(key, key, SETTING_REQUIRED, ""),
	SETTING_TEXT(unit, unit, "", ""),
	SETTING_NUMBER(found, found, "", -ANY, ANY, "nan", ""),
	SETTING_NUMBER(left, left, "", -ANY, ANY, SETTING_REQUIRED, ""),
	SETTING_NUMBER(u, u, "", 0, ANY, SETTING_REQUIRED, ""),
	{0},
};

static int read_values(void *to, const config_setting_t *list, const char *path,
		       struct incise_error *err)
{
	struct incise_calibration_record *record = to;
	int rc = 0;

	if (!config_setting_is_list(list) || config_setting_length(list) < 1 ||
	    config_setting_length(list) > INCISE_CALIBRATION_VALUES)
		return incise_conf_error(
			list, NULL, path, err,
			"a list of 1 to 16 groups ( { key = …; left = …; "
			"u = …; }, … )");
	record->n = config_setting_length(list);
	for (int i = 0; i < record->n && !rc; i++) {
		incise_settings_init(value_settings, &record->values[i]);
		rc = incise_settings_read(value_settings,
					  config_setting_get_elem(list, i), path,
					  &record->values[i], err);
	}
	return rc;
}

/* The CRC is text: libconfig's whole numbers end at 2^31 - 1. */
static int read_crc(void *to, const config_setting_t *setting, const char *path,
		    struct incise_error *err)
{
	const char *text = config_setting_get_string(setting);

	if (!text || strlen(text) != 8 || text[strspn(text, "0123456789abcdef")])
		return incise_conf_error(setting, NULL, path, err,
					 "eight digits 0 to f in quotes");
	((struct incise_calibration_record *)to)->raw_crc = strtoul(text, NULL, 16);
	return 0;
}

#undef SETTINGS_OF
#define SETTINGS_OF struct incise_calibration_record
static const struct incise_setting record_settings[] = {
	SETTING_TEXT(kind, kind, "", ""),
	SETTING_TEXT(date, date, "", ""),
	SETTING_TEXT(device, device, "", ""),
	SETTING_TEXT(method, method, "", ""),
	SETTING_TEXT(raw, raw, "", ""),
	SETTING_OWN(raw_crc32c, "", "", "", .read = read_crc),
	SETTING_OWN(values, "", SETTING_REQUIRED, "", .read = read_values),
	SETTING_NUMBER(covariance, covariance, "", -ANY, ANY, "(none)", "",
		       .count = offsetof(struct incise_calibration_record, n_covariance)),
	SETTING_NUMBER(low, low, "", -ANY, ANY, "nan", ""),
	SETTING_NUMBER(high, high, "", -ANY, ANY, "nan", ""),
	SETTING_TEXT(range_unit, range_unit, "", ""),
	SETTING_TRUTH(pass, pass, SETTING_REQUIRED, ""),
	SETTING_TEXT(verdict, verdict, "", ""),
	{0},
};

static void make_all_printable(struct incise_calibration_record *record)
{
	make_printable(record->device);
	make_printable(record->method);
	make_printable(record->raw);
	make_printable(record->range_unit);
	make_printable(record->verdict);
	for (int i = 0; i < record->n; i++)
		make_printable(record->values[i].unit);
}

static int read_entry(const config_setting_t *entry, const char *path,
		      struct incise_calibration_record *record, struct incise_error *err)
{
	const char *wrong;
	int rc;

	incise_settings_init(record_settings, record);
	rc = incise_settings_read(record_settings, entry, path, record, err);
	if (rc)
		return rc;
	make_all_printable(record);
	wrong = fault(record);
	return wrong ? incise_error_set(err, EINVAL, "%.100s:%d: history: %s; correct it",
					path, incise_conf_line(entry), wrong)
		     : 0;
}

/* Read the list `history` of a file, if it is there; on 0 the caller frees *records. */
static int read_history(const config_setting_t *root, const char *path,
			struct incise_calibration_record **records, int *n,
			struct incise_error *err)
{
	const config_setting_t *list = config_setting_get_member(root, "history");
	int rc = 0, length;

	*records = NULL;
	*n = 0;
	if (!list)
		return 0;
	if (!config_setting_is_list(list))
		return incise_conf_error(list, NULL, path, err, "a list ( { … }, … )");
	length = config_setting_length(list);
	if (!length)
		return 0;
	*records = calloc(length, sizeof(**records));
	if (!*records)
		return incise_error_set(err, ENOMEM, "%.100s: no memory for its history",
					path);
	for (int i = 0; i < length && !rc; i++)
		rc = read_entry(config_setting_get_elem(list, i), path, &(*records)[i],
				err);
	if (rc) {
		free(*records);
		*records = NULL;
		return rc;
	}
	*n = length;
	return 0;
}

/*
 * Read all of a configuration, and destroy it; absent keys have the values of @base, or nominal ones
 * if that is NULL. On 0 the caller frees file->records.
 */
static int read_config(struct file_content *file, const char *path,
		       const struct incise_calibration *base, config_t *config,
		       struct incise_error *err)
{
	const config_setting_t *root = config_root_setting(config);
	int rc;

	incise_calibration_nominal(&file->in_force);
	if (base)
		file->in_force = *base;
	for (int i = 0; i < N_KEYS; i++)
		file->present[i] = config_setting_get_member(root, settings[i].key);
	rc = incise_settings_read(settings, root, path, &file->in_force, err);
	if (!rc)
		rc = read_history(root, path, &file->records, &file->n, err);
	config_destroy(config);
	if (rc) {
		/* One errno for every fault of the file, as the header promises. */
		if (err)
			err->code = EINVAL;
		errno = EINVAL;
		return -EINVAL;
	}
	return 0;
}

static int read_onto(struct file_content *file, const char *path,
		     const struct incise_calibration *base, struct incise_error *err)
{
	config_t config;
	int rc = incise_conf_read(&config, path, err);

	*file = (struct file_content){0};
	return rc ? rc : read_config(file, path, base, &config, err);
}

static int read_calibration_file(struct file_content *file, const char *path,
				 struct incise_error *err)
{
	return read_onto(file, path, NULL, err);
}

int incise_calibration_text(const char *text, const char *name,
			    struct incise_calibration *calibration,
			    struct incise_calibration_record **records,
			    struct incise_error *err)
{
	struct file_content file = {0};
	char *copy = strdup(*text ? text : "\n");
	config_t config;
	int rc;

	if (records)
		*records = NULL;
	if (!copy)
		return incise_error_set(err, ENOMEM, "%.100s: no memory to read it",
					name);
	rc = incise_conf_read_text(&config, name, copy, strlen(copy), err);
	free(copy);
	if (!rc)
		rc = read_config(&file, name, NULL, &config, err);
	if (rc)
		return rc;
	*calibration = file.in_force;
	if (!records) {
		free(file.records);
		return 0;
	}
	*records = file.records;
	return file.n;
}

static int load(const char *path, const struct incise_calibration *base,
		struct incise_calibration *calibration, struct incise_error *err)
{
	struct file_content file;
	int rc = read_onto(&file, path, base, err);

	if (rc)
		return rc;
	free(file.records);
	*calibration = file.in_force;
	return 0;
}

int incise_calibration_load(const char *path, struct incise_calibration *calibration,
			    struct incise_error *err)
{
	return load(path, NULL, calibration, err);
}

int incise_calibration_update(const char *path, struct incise_calibration *calibration,
			      struct incise_error *err)
{
	const struct incise_calibration base = *calibration;

	return load(path, &base, calibration, err);
}

int incise_calibration_history(const char *path,
			       struct incise_calibration_record **records,
			       struct incise_error *err)
{
	struct file_content file;
	int rc = read_calibration_file(&file, path, err);

	*records = rc ? NULL : file.records;
	return rc ? rc : file.n;
}

const struct incise_calibration_value *incise_calibration_last(
	const struct incise_calibration_record *records, int n, const char *key,
	const struct incise_calibration_record **record)
{
	while (n--)
		for (int i = 0; records[n].pass && i < records[n].n; i++)
			if (!strcmp(records[n].values[i].key, key)) {
				if (record)
					*record = &records[n];
				return &records[n].values[i];
			}
	return NULL;
}

/* --- writing --- */

/* The shortest number that reads back the same; libconfig recognizes floats by their point. */
static void put_calibration_number(double value, FILE *out)
{
	char text[40];
	int digits = 6;

	do
		snprintf(text, sizeof(text), "%.*g", digits, value);
	while (digits++ < 17 && strtod(text, NULL) != value);
	fprintf(out, "%s%s", text, strpbrk(text, ".e") ? "" : ".0");
}

static void put_quoted(const char *key, const char *text, FILE *out)
{
	fprintf(out, "%s = \"", key);
	for (; *text; text++)
		fprintf(out, *text == '"' || *text == '\\' ? "\\%c" : "%c", *text);
	fputs("\";", out);
}

/*
 * "force_mV_N = 1238.6; ## mV/N, U = 2.4 (k = 2), 2026-11-21": a key with its unit and where it is
 * from. Two signs: it is rewritten.
 */
static void put_key(const struct file_content *file, const struct incise_setting *row,
		    const double *value, FILE *out)
{
	const int n = count_numbers(row);
	const struct incise_calibration_record *from;
	const struct incise_calibration_value *last;
	char first[40];

	name_number(row, 0, first);
	last = incise_calibration_last(file->records, file->n, first, &from);
	fprintf(out, "%s = ", row->key);
	for (int i = 0; i < n; i++) {
		fputs(n == 1 ? "" : i ? ", " : "[", out);
		put_calibration_number(value[i], out);
	}
	fprintf(out, "%s; ## %s", n > 1 ? "]" : "", row->unit);
	/* Else a person wrote it. */
	if (last && last->left == *value)
		fprintf(out, ", U = %.2g (k = 2), %s, %.10s", 2 * last->u, from->kind,
			from->date);
	fputc('\n', out);
}

static void put_keys(const struct file_content *file, FILE *out)
{
	struct incise_calibration in_force = file->in_force;

	for (int i = 0; i < N_KEYS; i++) {
		const double *value = number_at(&in_force, &settings[i]);

		if (file->present[i] && isfinite(*value))
			put_key(file, &settings[i], value, out);
	}
}

/* A row of a record or of one of its values, unless it has none: texts and numbers alone. */
static void put_row(const struct incise_setting *row, const void *of, const char *before,
		    const char *after, FILE *out)
{
	const char *text = (const char *)of + row->offset;
	const double *number = (const double *)text;
	int n = row->count ? *(const int *)((const char *)of + row->count) : 1;

	if (row->kind == SETTING_IS_TEXT ? !*text : n < 1 || !isfinite(*number))
		return;
	fputs(before, out);
	if (row->kind == SETTING_IS_TEXT) {
		put_quoted(row->key, text, out);
	} else {
		fprintf(out, "%s = %s", row->key, row->count ? "[" : "");
		for (int i = 0; i < n; i++) {
			fputs(i ? ", " : "", out);
			put_calibration_number(number[i], out);
		}
		fputs(row->count ? "];" : ";", out);
	}
	fputs(after, out);
}

static void put_values(const struct incise_calibration_record *record, FILE *out)
{
	fputs("  values = (\n", out);
	for (int i = 0; i < record->n; i++) {
		fputs("    { ", out);
		for (const struct incise_setting *row = value_settings; row->key; row++)
			put_row(row, &record->values[i], "", " ", out);
		fputs(i + 1 < record->n ? "},\n" : "} );\n", out);
	}
}

static void put_record(const struct incise_calibration_record *record, FILE *out)
{
	for (const struct incise_setting *row = record_settings; row->key; row++)
		if (row->read == read_values)
			put_values(record, out);
		else if (row->read == read_crc && *record->raw)
			fprintf(out, "  raw_crc32c = \"%08x\";\n", record->raw_crc);
		else if (row->kind == SETTING_IS_TRUTH)
			fprintf(out, "  pass = %s;\n", record->pass ? "true" : "false");
		else if (row->kind != SETTING_IS_OWN)
			put_row(row, record, "  ", "\n", out);
}

/* Write all of a file; @notes are lines of comment to begin with. */
static void put_file(const struct file_content *file, const char *notes, FILE *out)
{
	struct incise_c_locale locale = incise_c_locale_begin();

	fputs("## Calibration of a haptic cutting rig, kept by 'incise calibrate'; see "
	      "calibration.conf(5).\n",
	      out);
	fputs(notes, out);
	fputs("\n## Active values; absent keys have their nominal value.\n", out);
	put_keys(file, out);
	fputs("\n## Each calibration, oldest first; u is a standard uncertainty (k = 1).\n"
	      "history = (",
	      out);
	for (int i = 0; i < file->n; i++) {
		fputs(i ? ", {\n" : "\n{\n", out);
		put_record(&file->records[i], out);
		fputs("}", out);
	}
	fputs("\n);\n", out);
	incise_c_locale_end(locale);
}

/* --- appending --- */

int incise_calibration_raw(struct incise_calibration_record *record, const char *path,
			   struct incise_error *err)
{
	const char *name = strrchr(path, '/');
	char bytes[4096];
	uint32_t crc = 0;
	struct stat st;
	FILE *in;
	size_t n;
	int rc = 0;

	/* A pipe has been read, and does not return its bytes again. */
	if (!stat(path, &st) && !S_ISREG(st.st_mode) && !S_ISDIR(st.st_mode)) {
		*record->raw = '\0';
		return 0;
	}
	in = fopen(path, "re");
	if (!in)
		return incise_error_set(err, errno, "%.200s: cannot be read: %s", path,
					strerror(errno));
	while ((n = fread(bytes, 1, sizeof(bytes), in)))
		crc = incise_crc32c(crc, bytes, n);
	if (ferror(in))
		rc = incise_error_set(err, errno, "%.200s: cannot be read: %s", path,
				      strerror(errno));
	fclose(in);
	if (rc)
		return rc;
	snprintf(record->raw, sizeof(record->raw), "%s", name ? name + 1 : path);
	record->raw_crc = crc;
	return 0;
}

/*
 * The lines of comment that a person wrote above the history; ours begin with "##". NULL:
 * no memory. A file that vanishes meanwhile has no lines.
 */
static char *read_notes(const char *path)
{
	FILE *in = fopen(path, "re"), *out;
	char *notes = NULL, *line = NULL;
	size_t size = 0, notes_size = 0;

	out = open_memstream(&notes, &notes_size);
	while (in && out && getline(&line, &size, in) >= 0) {
		const char *first = line + strspn(line, " \t");

		if (!strncmp(first, "history", 7))
			break;
		if (*first == '#' && first[1] != '#')
			fprintf(out, "%s%s", first, strchr(first, '\n') ? "" : "\n");
	}
	free(line);
	if (in)
		fclose(in);
	if (out && fclose(out)) {
		free(notes);
		notes = NULL;
	}
	return notes;
}

static void put_in_force(struct file_content *file,
			 const struct incise_calibration_record *record)
{
	for (int i = 0; i < record->n; i++) {
		int element;
		const struct incise_setting *row =
			find_key(record->values[i].key, &element);

		number_at(&file->in_force, row)[element] = record->values[i].left;
		file->present[row - settings] = true;
	}
}

/* @file with a record behind its history. */
static int add(struct file_content *file, const char *path,
	       const struct incise_calibration_record *record, struct incise_error *err)
{
	struct incise_calibration_record *more, *last;
	const char *wrong;

	more = realloc(file->records, (file->n + 1) * sizeof(*more));
	if (!more)
		return incise_error_set(err, ENOMEM, "%.100s: no memory for its history",
					path);
	file->records = more;
	last = &more[file->n++];
	*last = *record;
	if (!*last->date) {
		const time_t now = time(NULL);
		struct tm utc;

		strftime(last->date, sizeof(last->date), "%Y-%m-%dT%H:%M:%SZ",
			 gmtime_r(&now, &utc));
	}
	wrong = fault(last);
	if (wrong)
		return incise_error_set(
			err, EINVAL,
			"%.100s: nothing appended: the calibration has an "
			"invalid field: %s",
			path, wrong);
	make_all_printable(last);
	if (last->pass)
		put_in_force(file, last);
	return 0;
}

static int write_file(const struct file_content *file, const char *path,
		      struct incise_error *err)
{
	struct incise_outfile *out;
	char *notes = read_notes(path);

	if (!notes)
		return incise_error_set(err, ENOMEM, "%.100s: no memory to write it",
					path);
	out = incise_outfile_open(path, err);
	if (!out) {
		free(notes);
		return -errno;
	}
	put_file(file, notes, incise_outfile_stream(out));
	free(notes);
	return incise_outfile_commit(out, err);
}

int incise_calibration_append(const char *path,
			      const struct incise_calibration_record *record,
			      struct incise_error *err)
{
	struct incise_error failed = {0};
	struct file_content file;
	int rc = read_calibration_file(&file, path, &failed);

	if (rc == -ENOENT) {
		file = (struct file_content){0};
		incise_calibration_nominal(&file.in_force);
		rc = 0;
	}
	if (!rc)
		rc = add(&file, path, record, &failed);
	if (!rc)
		rc = write_file(&file, path, &failed);
	free(file.records);
	if (rc)
		return incise_error_set(err, failed.code, "%s", failed.text);
	return 0;
}
