// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The history in calibration.conf: each calibration with what was found and what it left,
 * below the keys that are in force. Nothing in the file is trusted.
 *
 *   force_mV_N = 1238.6;          in force
 *   history = ( { kind = "force"; …; values = ( { key = "force_mV_N"; … } ); }, … );
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/calibration.h>
#include <incise/outfile.h>
#include "crc32c.h"
#include "calibration_file.h"
#include "conf.h"

enum { COVARIANCES = INCISE_CALIBRATION_VALUES * (INCISE_CALIBRATION_VALUES + 1) / 2 };

static const struct calibration_key *find_key(const char *name)
{
	const struct calibration_key *key = incise_calibration_keys;

	while (key->name && strcmp(key->name, name))
		key++;
	return key->name ? key : NULL;
}

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

static bool in_range(const struct calibration_key *key, double value)
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
 * What is wrong with a record, as words behind the name of its key; NULL: nothing. The same
 * for what a file says and for what is to be appended.
 */
static const char *fault(const struct incise_calibration_record *record)
{
	const int n = record->n;

	if (!is_kind(record->kind))
		return "kind: expected a word of letters a to z, such as force";
	if (!is_date(record->date))
		return "date: expected a date and time as 2026-11-21T14:48:16Z";
	if (n < 1 || n > INCISE_CALIBRATION_VALUES)
		return "values: expected 1 to 16 of them";
	for (int i = 0; i < n; i++) {
		const struct incise_calibration_value *value = &record->values[i];
		const struct calibration_key *key = find_key(value->key);

		if (!key)
			return "values: key: expected a key of calibration.conf";
		/* What failed may be far out, and is kept to be read. */
		if (!isfinite(value->left) ||
		    (record->pass && !in_range(key, value->left)))
			return "values: left: expected a number in the range of its key";
		if (isinf(value->found))
			return "values: found: expected a number that is finite";
		if (!isfinite(value->u) || value->u < 0)
			return "values: u: expected a standard uncertainty, not below 0";
	}
	if (record->n_covariance && record->n_covariance != n * (n + 1) / 2)
		return "covariance: expected n (n + 1)/2 numbers for n values";
	for (int i = 0; i < record->n_covariance; i++)
		if (!isfinite(record->covariance[i]))
			return "covariance: expected numbers that are finite";
	if (isinf(record->low) || isinf(record->high) || record->low > record->high)
		return "low: expected a range from low to high";
	return NULL;
}

/* libconfig gives a group in a list the line before it: its first key tells better. */
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

int incise_calibration_history_read(const config_setting_t *root, const char *path,
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

int incise_calibration_history(const char *path,
			       struct incise_calibration_record **records,
			       struct incise_error *err)
{
	struct calibration_file file;
	int rc = incise_calibration_file_read(&file, path, err);

	*records = rc ? NULL : file.records;
	return rc ? rc : file.n;
}

int incise_calibration_raw(struct incise_calibration_record *record, const char *path,
			   struct incise_error *err)
{
	const char *name = strrchr(path, '/');
	FILE *in = fopen(path, "re");
	char bytes[4096];
	uint32_t crc = 0;
	size_t n;
	int rc = 0;

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

static void put_in_force(struct calibration_file *file,
			 const struct incise_calibration_record *record)
{
	for (int i = 0; i < record->n; i++) {
		const struct calibration_key *key = find_key(record->values[i].key);

		*incise_calibration_at(&file->in_force, key) = record->values[i].left;
		file->present[key - incise_calibration_keys] = true;
	}
}

/* @file with a record behind its history. */
static int add(struct calibration_file *file, const char *path,
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
			err, EINVAL, "%.100s: nothing appended: of the calibration, %s",
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

static int write_file(const struct calibration_file *file, const char *path,
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
	incise_calibration_file_write(file, notes, incise_outfile_stream(out));
	free(notes);
	return incise_outfile_commit(out, err);
}

int incise_calibration_append(const char *path,
			      const struct incise_calibration_record *record,
			      struct incise_error *err)
{
	struct incise_error failed = {0};
	struct calibration_file file;
	int rc = incise_calibration_file_read(&file, path, &failed);

	if (rc == -ENOENT) {
		file = (struct calibration_file){0};
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
