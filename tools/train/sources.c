// SPDX-License-Identifier: GPL-2.0-or-later
/* Sources of pairs; see sources.h. */
#include <glob.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <errno.h>
#include <incise/arrow.h>
#include <incise/dataset.h>
#include <incise/infile.h>
#include <incise/recalibration.h>
#include <incise/origin.h>
#include <incise/recording.h>
#include "../cli/cli.h"
#include "../cli/file.h"
#include "../cli/file_kind.h"
#include "../cli/recording.h"
#include "sources.h"

/* The part of a source that is its own, user of incise_train_source. */
struct own {
	const struct recording_rows *rows;
	char text[INCISE_SOURCE_TEXT], rig[256], calibration[512];
	char *database;		 /* of a recording */
	struct memory_file pipe; /* of a source that can be read once only */
};

static void print_file(FILE *out, const char *file)
{
	struct stat st = {0};

	stat(file, &st);
	fprintf(out, "%s %jd %jd.%09ld %ju\n", file, (intmax_t)st.st_size,
		(intmax_t)st.st_mtim.tv_sec, st.st_mtim.tv_nsec, (uintmax_t)st.st_ino);
}

/* Its rows and the calibration by which they are read, and those of its members. */
static void print_recording(FILE *out, const char *path)
{
	char *pattern = cli_text("%s/*/recording.db", path);
	char *files[] = {cli_text("%s/recording.db", path),
			 cli_text("%s/recording.db-wal", path)};
	struct incise_recalibration *list = NULL;
	int n = incise_recalibrations(path, &list, NULL);
	glob_t found = {0};

	for (size_t i = 0; i < 2; i++) {
		print_file(out, files[i]);
		free(files[i]);
	}
	fprintf(out, "%s %s\n", n > 0 ? list[n - 1].file : "",
		n > 0 ? list[n - 1].sha256 : "");
	free(list);
	if (!glob(pattern, 0, NULL, &found))
		for (size_t i = 0; i < found.gl_pathc; i++) {
			*strrchr(found.gl_pathv[i], '/') = 0;
			print_recording(out, found.gl_pathv[i]);
		}
	globfree(&found);
	free(pattern);
}

/* Describe all files of a recording, and the rows that are read. */
static char *recording_state(const struct incise_train_source *source)
{
	const struct own *own = source->user;
	char *whole = file_without_choice(source->name), *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	if (!out)
		cli_fail("no memory");
	fprintf(out, "rate %.17g; damaged %d; from %.17g to %.17g; cut %d\n",
		own->rows->rate_hz, own->rows->damaged, own->rows->from_s,
		own->rows->to_s, own->rows->cut);
	print_recording(out, whole);
	free(whole);
	fclose(out);
	return text;
}

static int stream_recording(struct incise_train_source *source,
			    struct ArrowArrayStream *stream, struct incise_error *err)
{
	const struct own *own = source->user;
	struct incise_recording *recording = incise_recording_open(source->name, err);
	struct incise_export_options options;
	int rc;

	if (!recording)
		return -errno;
	incise_export_options_init(&options);
	options.rate_hz = own->rows->rate_hz;
	options.from_s = own->rows->from_s;
	options.to_s = own->rows->to_s;
	options.cut = own->rows->cut;
	options.uncertainty =
		own->rows->uncertainty ? INCISE_EXPORT_PARTS : INCISE_EXPORT_NONE;
	rc = incise_recording_stream(recording, "table", &options, stream, err);
	incise_recording_close(recording);
	return rc;
}

static bool is_part(const struct recording_rows *rows)
{
	return rows->from_s > 0 || rows->to_s > 0 || rows->cut;
}

/* Append the options that choose rows to the text that a model notes. */
static void note_rows(struct own *own)
{
	const struct recording_rows *rows = own->rows;
	char *text = cli_text("%s", own->text), rate[40] = "", range[80] = "",
	     cut[20] = "";

	if (rows->rate_hz > 0)
		snprintf(rate, sizeof(rate), " --rate %g", rows->rate_hz);
	if (rows->to_s > 0)
		snprintf(range, sizeof(range), " --range %.9gs..%.9gs", rows->from_s,
			 rows->to_s);
	else if (rows->from_s > 0)
		snprintf(range, sizeof(range), " --range %.9gs..", rows->from_s);
	if (rows->cut)
		snprintf(cut, sizeof(cut), " --cut %d", rows->cut);
	if (*rate || *range || *cut)
		snprintf(own->text, sizeof(own->text), "%s, read with%s%s%s", text, rate,
			 range, cut);
	free(text);
}

static int open_recording(struct incise_train_source *source, struct incise_error *err)
{
	struct own *own = source->user;
	struct incise_recalibration active;
	struct incise_recording_info info;
	struct incise_recording *recording;
	char *text;
	int rc;

	/* It prints a warning where damaged recordings are used. */
	if (!recording_intact(source->name, !is_part(own->rows), own->rows->damaged,
			      err) &&
	    err->code)
		return -err->code;
	recording = incise_recording_open(source->name, err);
	if (!recording)
		return -errno;
	rc = incise_source_text(source->name, recording, own->text, err);
	if (!rc)
		rc = incise_recording_info(recording, &info, err);
	incise_recording_recalibration(recording, &active);
	incise_recording_close(recording);
	if (rc)
		return rc;
	note_rows(own);
	snprintf(own->rig, sizeof(own->rig), "%s", info.rig);
	text = cli_text("%s; %.17g mV/N; tip %.17g %.17g %.17g; %s", info.rig,
			info.force_mV_N, info.tip_mm[0], info.tip_mm[1], info.tip_mm[2],
			active.sha256);
	snprintf(own->calibration, sizeof(own->calibration), "%s", text);
	free(text);
	source->rig = own->rig;
	source->calibration = own->calibration;
	return 0;
}

static int open_sources_file(struct incise_train_source *source, struct incise_error *err)
{
	struct own *own = source->user;

	if (!source_is_pipe(source))
		return incise_source_text(source->path, NULL, own->text, err);
	strcpy(own->text, "a pipe");
	return 0;
}

/* A pipe can be read once only: as a file in memory it is read like any other. */
static void keep_pipe(struct incise_train_source *source)
{
	static const struct incise_infile_kind kind = {
		.name = "a CSV file",
		.advice = "give a CSV file with a header row",
	};
	struct own *own = source->user;
	struct incise_error err = {0};
	struct incise_infile *in =
		cli_require(incise_infile_open(source->path, &kind, &err), &err);
	char *line;
	int rc;

	own->pipe = memory_file_begin("pipe");
	while ((rc = incise_infile_line(in, &line, &err)) > 0)
		fprintf(own->pipe.file, "%s\n", line);
	cli_check(rc, &err);
	incise_infile_close(in);
	memory_file_written(&own->pipe);
	source->name = strcmp(source->path, "-") ? source->path : "standard input";
	source->path = own->pipe.path;
}

bool source_is_pipe(const struct incise_train_source *source)
{
	return ((const struct own *)source->user)->pipe.file;
}

/* A recording may be named without its extension. */
static const char *find_path(const char *path)
{
	enum file_kind kind = file_kind_of(path);
	char *whole = cli_text("%s.rec", path);
	bool recording =
		kind == FILE_RECORDING || (access(path, F_OK) && !access(whole, F_OK));

	free(whole);
	return file_operand(path, recording ? FILE_RECORDING : FILE_TABLE);
}

static void name_recording(struct incise_train_source *source)
{
	struct own *own = source->user;
	char *whole = file_without_choice(source->name);

	own->database = cli_text("%s/recording.db", whole);
	free(whole);
	/* A part is known by the name of its recording: its hash would read all of it. */
	source->hashed = is_part(own->rows) ? NULL : own->database;
	source->cuts = true;
	source->stream = stream_recording;
	source->open = open_recording;
	source->state = recording_state;
}

struct incise_train_source *sources_new(char **paths, int n,
					const struct recording_rows *rows)
{
	struct incise_train_source *sources = cli_alloc(n, sizeof(*sources));
	struct own *own = cli_alloc(n, sizeof(*own));
	struct stat st;

	for (int i = 0; i < n; i++) {
		struct incise_train_source *source = &sources[i];

		own[i].rows = rows;
		source->user = &own[i];
		source->text = own[i].text;
		source->name = find_path(paths[i]);
		if (file_kind_of(source->name) == FILE_RECORDING) {
			name_recording(source);
			continue;
		}
		source->path = source->name;
		source->open = open_sources_file;
		if (!strcmp(source->path, "-") ||
		    (!stat(source->path, &st) && !S_ISREG(st.st_mode) &&
		     !S_ISDIR(st.st_mode)))
			keep_pipe(source);
	}
	return sources;
}

void sources_free(struct incise_train_source *sources, int n)
{
	struct own *own = sources[0].user;

	for (int i = 0; i < n; i++) {
		if (own[i].pipe.file)
			fclose(own[i].pipe.file);
		free(own[i].database);
	}
	free(own);
	free(sources);
}

/* --- uncertainties: the parts of incise export --uncertainty parts, of a model's columns ----- */

/* All that there are of the columns of a model. */
static void list_parts(struct uncertainties *all, const char *const *columns,
		       int n_inputs)
{
	const struct incise_budget_part *parts = incise_budget_parts();
	const struct incise_budget_value *values = incise_budget_values();

	all->n = 0;
	for (int i = 0; i < INCISE_BUDGET_PARTS; i++)
		for (int c = 0; c <= n_inputs; c++) {
			if (strcmp(values[parts[i].quantity].value, columns[c]))
				continue;
			all->columns[all->n] = parts[i].column;
			all->parts[all->n++] = (struct incise_propagation_part){
				.of = c,
				.source = parts[i].scope == INCISE_BUDGET_OWN
						  ? -1
						  : parts[i].source,
				.calibration =
					parts[i].scope == INCISE_BUDGET_CALIBRATION,
			};
			break;
		}
}

/* Fail unless a recording states the uncertainties of all columns that have parts. */
static void need_stated(const char *path, const char *const *columns, int n_inputs)
{
	const struct incise_budget_value *values = incise_budget_values();
	struct incise_error err = {0};
	struct incise_recording *recording =
		cli_require(incise_recording_open(path, &err), &err);
	struct incise_budget *budget =
		cli_require(incise_budget_new(recording, NULL, NULL, &err), &err);

	for (int q = 0; q < INCISE_BUDGET_QUANTITIES; q++)
		for (int c = 0; c <= n_inputs; c++) {
			const char *missing = incise_budget_missing(budget, q);

			if (!strcmp(values[q].value, columns[c]) && missing)
				cli_fail("%s: the uncertainty of %s is not stated: %s",
					 path, columns[c], missing);
		}
	incise_budget_free(budget);
	incise_recording_close(recording);
}

static void take_parts(struct uncertainties *found, const struct uncertainties *all,
		       const bool *has)
{
	found->n = 0;
	for (int i = 0; i < all->n; i++)
		if (has[i]) {
			found->columns[found->n] = all->columns[i];
			found->parts[found->n++] = all->parts[i];
		}
}

void uncertainties_find(struct uncertainties *found, enum uncertainties_wanted wanted,
			const char *const *columns, int n_inputs, char **paths, int n)
{
	bool has[INCISE_BUDGET_PARTS], first[INCISE_BUDGET_PARTS] = {0}, stated;
	struct uncertainties all;

	found->n = 0;
	if (wanted == UNCERTAINTIES_NONE)
		return;
	list_parts(&all, columns, n_inputs);
	for (int s = 0; s < n; s++) {
		const char *path = paths[s];

		memset(has, 0, sizeof(has));
		stated = true;
		if (file_kind_of(path) == FILE_RECORDING) {
			if (wanted == UNCERTAINTIES_PARTS)
				need_stated(path, columns, n_inputs);
			for (int i = 0; i < all.n; i++)
				has[i] = wanted == UNCERTAINTIES_PARTS;
		} else if (strcmp(path, "-") && file_kind_of(path) == FILE_TABLE) {
			for (int i = 0; i < all.n; i++)
				has[i] =
					incise_dataset_has(path, all.columns[i], &stated);
		}
		if (!stated && wanted == UNCERTAINTIES_PARTS)
			cli_fail("%s: an uncertainty is not stated (nan); calibrate what "
				 "`incise export` names, or leave out --uncertainty",
				 path);
		if (!stated) {
			cli_warn(
				"%s: its uncertainties are not all stated (nan), so none "
				"is used",
				path);
			memset(has, 0, sizeof(has));
		}
		if (wanted == UNCERTAINTIES_PARTS && !memchr(has, true, sizeof(has)))
			cli_fail("%s: has no uncertainties of these columns; export it "
				 "with --uncertainty parts",
				 path);
		if (!s)
			memcpy(first, has, sizeof(has));
		else if (memcmp(first, has, sizeof(has)))
			cli_fail("%s: has other uncertainties than %s; export both with "
				 "--uncertainty parts, or give --uncertainty none",
				 path, paths[0]);
	}
	take_parts(found, &all, first);
}
