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
#include "conf.h"
#include "crc32c.h"

/* One number of struct incise_calibration. */
struct known_key {
	const char *name; /* in the history */
	const char *unit;
	double low, high;
	size_t offset;	    /* in struct incise_calibration */
	const char *vector; /* key at the top of the file, if it is an element of one */
};

#define NUMBER(key, unit, low, high)                                                  \
	{                                                                             \
#key, unit, low, high, offsetof(struct incise_calibration, key), NULL \
	}
#define TIP(axis, i)                                                             \
	{                                                                        \
		"tip_" axis "_mm", "mm", -1e6, 1e6,                              \
			offsetof(struct incise_calibration, tip_mm[i]), "tip_mm" \
	}

static const struct known_key known_keys[] = {
	NUMBER(force_mV_N, "mV/N", 1, 100000),
	NUMBER(force_zero_mV, "mV", -10000, 10000),
	NUMBER(depth_mm_px, "mm/px", 0.0001, 10),
	TIP("x", 0),
	TIP("y", 1),
	TIP("z", 2),
	NUMBER(surface_u_mm, "mm", 0, 1000),
	/* a camera may timestamp the end of an exposure: later than its middle, or not */
	NUMBER(force_delay_ms, "ms", -1000, 1000),
	NUMBER(force_delay_sd_ms, "ms", 0, 1000),
	NUMBER(tracker_delay_ms, "ms", -1000, 1000),
	NUMBER(tracker_delay_sd_ms, "ms", 0, 1000),
	NUMBER(camera_delay_ms, "ms", -1000, 1000),
	NUMBER(camera_delay_sd_ms, "ms", 0, 1000),
	NUMBER(stepper_N_step, "N", -100, 100),
	NUMBER(stepper_backlash_mm, "mm", 0, 100),
	NUMBER(stepper_hysteresis_N, "N", 0, 1000),
	NUMBER(stepper_stiction_N, "N", 0, 1000),
	NUMBER(stepper_steps_s, "1/s", 0, 1e7),
};

#define N_KEYS (sizeof(known_keys) / sizeof(*known_keys))

struct file_content {
	struct incise_calibration in_force;
	bool present[N_KEYS]; /* else nominal */
	struct incise_calibration_record *records;
	int n;
};

void incise_calibration_nominal(struct incise_calibration *calibration)
{
	*calibration = (struct incise_calibration){
		.force_mV_N = 1240,
		.force_zero_mV = NAN,
		.depth_mm_px = 47.5 / 400,
		.force_delay_ms = NAN,
		.force_delay_sd_ms = NAN,
		.tracker_delay_ms = NAN,
		.tracker_delay_sd_ms = NAN,
		.camera_delay_ms = NAN,
		.camera_delay_sd_ms = NAN,
		.surface_u_mm = NAN,
		.stepper_N_step = NAN,
		.stepper_backlash_mm = NAN,
		.stepper_hysteresis_N = NAN,
		.stepper_stiction_N = NAN,
		.stepper_steps_s = NAN,
	};
}

static const struct known_key *find_key(const char *name)
{
	for (size_t k = 0; k < N_KEYS; k++)
		if (!strcmp(known_keys[k].name, name))
			return &known_keys[k];
	return NULL;
}

static double *number_at(struct incise_calibration *calibration,
			 const struct known_key *key)
{
	return (double *)((char *)calibration + key->offset);
}

double incise_calibration_get(const struct incise_calibration *calibration,
			      const char *name)
{
	struct incise_calibration copy = *calibration;
	const struct known_key *key = find_key(name);

	return key ? *number_at(&copy, key) : NAN;
}

/* --- reading --- */

enum { COVARIANCES = INCISE_CALIBRATION_VALUES * (INCISE_CALIBRATION_VALUES + 1) / 2 };

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

static bool in_range(const struct known_key *key, double value)
{
	return value >= key->low && value <= key->high;
}

static void make_printable(char *text)
{
	for (; *text; text++)
		if ((unsigned char)*text < ' ' || *text == 127)
			*text = '?';
}

/*
 * The fault of a record, as words behind the name of its key; NULL: none. For records of a
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
		const struct known_key *key = find_key(value->key);

		if (!key)
			return "values: key: expected a key of calibration.conf";
		/* A failed calibration may be far out, and is kept to be read. */
		if (!isfinite(value->left) ||
		    (record->pass && !in_range(key, value->left)))
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

/* libconfig gives a group in a list the line before it; its first key has the right one. */
static int entry_error(const config_setting_t *entry, const char *path, const char *what,
		       struct incise_error *err)
{
	const config_setting_t *first =
		config_setting_is_group(entry) ? config_setting_get_elem(entry, 0) : NULL;

	return incise_error_set(err, EINVAL, "%.100s:%d: history: %s; correct it", path,
				config_setting_source_line(first ? first : entry), what);
}

static int read_value(const config_setting_t *group, const char *path,
		      struct incise_calibration_value *value, struct incise_error *err)
{
	static const char *const keys[] = {"key", "unit", "found", "left", "u", NULL};
	const double most = 1e300;
	int rc;

	*value = (struct incise_calibration_value){.found = NAN};
	if (!config_setting_is_group(group))
		return entry_error(group, path, "values: expected groups { key = …; }",
				   err);
	rc = incise_conf_known(group, path, keys, err);
	if (!rc)
		rc = incise_conf_need(group, path, "key", err);
	if (!rc)
		rc = incise_conf_need(group, path, "left", err);
	if (!rc)
		rc = incise_conf_need(group, path, "u", err);
	if (!rc)
		rc = incise_conf_text(group, path, "key", value->key, sizeof(value->key),
				      err);
	if (!rc)
		rc = incise_conf_text(group, path, "unit", value->unit,
				      sizeof(value->unit), err);
	if (!rc)
		rc = incise_conf_number(group, path, "found", -most, most, &value->found,
					err);
	if (!rc)
		rc = incise_conf_number(group, path, "left", -most, most, &value->left,
					err);
	if (!rc)
		rc = incise_conf_number(group, path, "u", 0, most, &value->u, err);
	make_printable(value->unit);
	return rc;
}

static int read_values(const config_setting_t *entry, const char *path,
		       struct incise_calibration_record *record, struct incise_error *err)
{
	const config_setting_t *list = config_setting_get_member(entry, "values");
	int rc = 0;

	if (!list || !config_setting_is_list(list) || config_setting_length(list) < 1 ||
	    config_setting_length(list) > INCISE_CALIBRATION_VALUES)
		return entry_error(list ? list : entry, path,
				   "values: expected a list of 1 to 16 groups "
				   "( { key = …; left = …; u = …; }, … )",
				   err);
	record->n = config_setting_length(list);
	for (int i = 0; i < record->n && !rc; i++)
		rc = read_value(config_setting_get_elem(list, i), path,
				&record->values[i], err);
	return rc;
}

/* The CRC is text: libconfig's whole numbers end at 2^31 - 1. */
static int read_crc(const config_setting_t *entry, const char *path, uint32_t *crc,
		    struct incise_error *err)
{
	char text[9] = "00000000";
	int rc = incise_conf_text(entry, path, "raw_crc32c", text, sizeof(text), err);

	if (rc)
		return rc;
	if (strlen(text) != 8 || text[strspn(text, "0123456789abcdef")])
		return entry_error(config_setting_get_member(entry, "raw_crc32c"), path,
				   "raw_crc32c: expected eight digits 0 to f in quotes",
				   err);
	*crc = strtoul(text, NULL, 16);
	return 0;
}

static int read_entry(const config_setting_t *entry, const char *path,
		      struct incise_calibration_record *record, struct incise_error *err)
{
	static const char *const keys[] = {"kind",	 "date",       "pass",
					   "verdict",	 "values",     "device",
					   "method",	 "raw",	       "low",
					   "high",	 "range_unit", "raw_crc32c",
					   "covariance", NULL};
	const struct {
		const char *key;
		char *to;
		size_t size;
	} texts[] = {
		{"kind", record->kind, sizeof(record->kind)},
		{"date", record->date, sizeof(record->date)},
		{"device", record->device, sizeof(record->device)},
		{"method", record->method, sizeof(record->method)},
		{"raw", record->raw, sizeof(record->raw)},
		{"range_unit", record->range_unit, sizeof(record->range_unit)},
		{"verdict", record->verdict, sizeof(record->verdict)},
	};
	const char *wrong;
	int rc;

	*record = (struct incise_calibration_record){.low = NAN, .high = NAN};
	if (!config_setting_is_group(entry))
		return entry_error(entry, path, "expected groups { kind = …; … }", err);
	rc = incise_conf_known(entry, path, keys, err);
	for (size_t i = 0; i < sizeof(texts) / sizeof(*texts) && !rc; i++) {
		rc = incise_conf_text(entry, path, texts[i].key, texts[i].to,
				      texts[i].size, err);
		make_printable(texts[i].to);
	}
	if (!rc)
		rc = incise_conf_need(entry, path, "pass", err);
	if (!rc)
		rc = incise_conf_bool(entry, path, "pass", &record->pass, err);
	if (!rc)
		rc = incise_conf_number(entry, path, "low", -1e300, 1e300, &record->low,
					err);
	if (!rc)
		rc = incise_conf_number(entry, path, "high", -1e300, 1e300, &record->high,
					err);
	if (!rc)
		rc = read_crc(entry, path, &record->raw_crc, err);
	if (!rc)
		rc = read_values(entry, path, record, err);
	if (!rc)
		rc = incise_conf_numbers(entry, path, "covariance", record->covariance,
					 COVARIANCES, &record->n_covariance, err);
	if (rc)
		return rc;
	wrong = fault(record);
	return wrong ? entry_error(entry, path, wrong, err) : 0;
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
		return entry_error(list, path, "expected a list ( { … }, … )", err);
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
	const char *names[N_KEYS + 2] = {NULL};
	const struct known_key *key;
	const config_setting_t *root = config_root_setting(config);
	int rc, n = 0;

	incise_calibration_nominal(&file->in_force);
	if (base)
		file->in_force = *base;
	for (key = known_keys; key < known_keys + N_KEYS; key++) {
		const char *name = key->vector ? key->vector : key->name;

		file->present[key - known_keys] = config_setting_get_member(root, name);
		if (!n || names[n - 1] != name)
			names[n++] = name;
	}
	names[n] = "history";
	rc = incise_conf_known(root, path, names, err);
	for (key = known_keys; key < known_keys + N_KEYS && !rc; key++)
		if (!key->vector)
			rc = incise_conf_number(root, path, key->name, key->low,
						key->high,
						number_at(&file->in_force, key), err);
	if (!rc)
		rc = incise_conf_vector(root, path, "tip_mm", file->in_force.tip_mm, err);
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

static int read_file(struct file_content *file, const char *path,
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
	int rc = read_file(&file, path, err);

	*records = rc ? NULL : file.records;
	return rc ? rc : file.n;
}

/* --- writing --- */

/* The shortest number that reads back the same; libconfig recognizes floats by their point. */
static void put_number(double value, FILE *out)
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

static void put_text(const char *key, const char *text, FILE *out)
{
	fputs("  ", out);
	put_quoted(key, text, out);
	fputc('\n', out);
}

/* The last calibration that put a key's value in force; NULL: a person did. */
static const struct incise_calibration_record *origin(const struct file_content *file,
						      const struct known_key *key,
						      double value, double *u)
{
	for (int i = file->n - 1; i >= 0; i--)
		for (int j = 0; j < file->records[i].n && file->records[i].pass; j++) {
			const struct incise_calibration_value *v =
				&file->records[i].values[j];

			if (strcmp(v->key, key->name))
				continue;
			*u = v->u;
			return v->left == value ? &file->records[i] : NULL;
		}
	return NULL;
}

/* "# mV/N, U = 2.4 (k = 2), 2026-11-21": behind a key. Two signs: it is rewritten. */
static void put_origin(const struct file_content *file, const struct known_key *key,
		       double value, FILE *out)
{
	double u = 0;
	const struct incise_calibration_record *from = origin(file, key, value, &u);

	fprintf(out, " ## %s", key->unit);
	if (from)
		fprintf(out, ", U = %.2g (k = 2), %s, %.10s", 2 * u, from->kind,
			from->date);
	fputc('\n', out);
}

static void put_keys(const struct file_content *file, FILE *out)
{
	const struct known_key *key = known_keys;
	struct incise_calibration in_force = file->in_force;

	for (; key < known_keys + N_KEYS; key++) {
		const double value = *number_at(&in_force, key);

		if (!file->present[key - known_keys] || !isfinite(value))
			continue;
		if (!key->vector) {
			fprintf(out, "%s = ", key->name);
			put_number(value, out);
			fputc(';', out);
		} else if (key->offset == offsetof(struct incise_calibration, tip_mm)) {
			fprintf(out, "%s = [", key->vector);
			for (int i = 0; i < 3; i++) {
				fputs(i ? ", " : "", out);
				put_number(in_force.tip_mm[i], out);
			}
			fputs("];", out);
		} else {
			continue; /* written with the first of them */
		}
		put_origin(file, key, value, out);
	}
}

static void put_value(const struct incise_calibration_value *value, FILE *out)
{
	fprintf(out, "    { key = \"%s\"; ", value->key);
	if (*value->unit) {
		put_quoted("unit", value->unit, out);
		fputc(' ', out);
	}
	if (isfinite(value->found)) {
		fputs("found = ", out);
		put_number(value->found, out);
		fputs("; ", out);
	}
	fputs("left = ", out);
	put_number(value->left, out);
	fputs("; u = ", out);
	put_number(value->u, out);
	fputs("; }", out);
}

static void put_record(const struct incise_calibration_record *record, FILE *out)
{
	put_text("kind", record->kind, out);
	put_text("date", record->date, out);
	if (*record->device)
		put_text("device", record->device, out);
	if (*record->method)
		put_text("method", record->method, out);
	if (*record->raw) {
		put_text("raw", record->raw, out);
		fprintf(out, "  raw_crc32c = \"%08x\";\n", record->raw_crc);
	}
	fputs("  values = (\n", out);
	for (int i = 0; i < record->n; i++) {
		put_value(&record->values[i], out);
		fputs(i + 1 < record->n ? ",\n" : " );\n", out);
	}
	for (int i = 0; i < record->n_covariance; i++) {
		fputs(i ? ", " : "  covariance = [", out);
		put_number(record->covariance[i], out);
	}
	if (record->n_covariance)
		fputs("];\n", out);
	if (isfinite(record->low)) {
		fputs("  low = ", out);
		put_number(record->low, out);
		fputs(";\n", out);
	}
	if (isfinite(record->high)) {
		fputs("  high = ", out);
		put_number(record->high, out);
		fputs(";\n", out);
	}
	if (*record->range_unit)
		put_text("range_unit", record->range_unit, out);
	fprintf(out, "  pass = %s;\n", record->pass ? "true" : "false");
	if (*record->verdict)
		put_text("verdict", record->verdict, out);
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
 * no memory. A file that vanishes meanwhile has none.
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
		const struct known_key *key = find_key(record->values[i].key);

		*number_at(&file->in_force, key) = record->values[i].left;
		file->present[key - known_keys] = true;
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
	make_printable(last->device);
	make_printable(last->method);
	make_printable(last->raw);
	make_printable(last->range_unit);
	make_printable(last->verdict);
	for (int i = 0; i < last->n; i++)
		make_printable(last->values[i].unit);
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
	int rc = read_file(&file, path, &failed);

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
