// SPDX-License-Identifier: GPL-2.0-or-later
/* Sources of pairs; see sources.h. */
#include <errno.h>
#include <glob.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/arrow.h>
#include <incise/infile.h>
#include <incise/recalibration.h>
#include <incise/origin.h>
#include <incise/recording.h>
#include "../cli/cli.h"
#include "../cli/file_kind.h"
#include "../cli/recording.h"
#include "sources.h"

#define ORIGINS_TEXT 480 /* bytes of a recording's origins in its text */

/* The column that is 0 where the blade did not advance. */
static const char *where(const struct source *source)
{
	return source->options->all_rows ? NULL : "advancing";
}

/* The column with the groups of rows, or NULL. */
static const char *group_column(const struct source *source)
{
	return source->corpus.group ? NULL : source->options->group;
}

#define PROGRESS_ROWS (1 << 16)

static void report(const struct source *source, uint64_t rows)
{
	if (source->options->progress && rows)
		source->options->progress(source->options->user, rows);
}

static int count_row(void *user, const double *row, const char *group,
		     struct incise_error *err)
{
	struct source *source = user;

	if (!(++source->taken % PROGRESS_ROWS))
		report(source, PROGRESS_ROWS);
	return source->take(source->taker, row, group, err);
}

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

char *source_state(const struct source *source)
{
	char *whole = file_without_choice(source->path), *text = NULL;
	size_t size;
	FILE *out = open_memstream(&text, &size);

	if (!out)
		cli_fail("no memory");
	if (source->recording)
		print_recording(out, whole);
	else
		print_file(out, whole);
	free(whole);
	fclose(out);
	return text;
}

/* Fail if it is not what it was before it was first read. */
static int check_unchanged(const struct source *source, struct incise_error *err)
{
	char *state = source_state(source);
	bool same = !strcmp(source->state, state);

	free(state);
	return same ? 0
		    : incise_error_set(err, ESTALE,
				       "%s: has changed while it was read; train from a "
				       "file that nobody writes",
				       source->path);
}

static void begin(struct source *source, incise_row_taker take, void *taker)
{
	if (!source->state)
		source->state = source_state(source);
	source->take = take;
	source->taker = taker;
	source->taken = 0;
}

static int end(struct source *source, int rc, struct incise_error *err)
{
	report(source, source->taken % PROGRESS_ROWS);
	return rc ? rc : check_unchanged(source, err);
}

static const char *file_of(const struct source *source)
{
	return source->pipe.file ? source->pipe.path : source->path;
}

static int each_row(struct source *source, incise_row_taker take, void *taker,
		    struct incise_error *err)
{
	int rc = incise_dataset_each(file_of(source), source->options->columns,
				     source->options->n_columns, group_column(source),
				     where(source), take, taker, &source->left_out, err);
	struct incise_error own = {0};
	size_t n = strlen(source->pipe.path);

	if (rc && err)
		own = *err;
	return source->pipe.file && !strncmp(own.text, source->pipe.path, n)
		       ? incise_error_set(err, own.code, "%s%s",
					  strcmp(source->path, "-") ? source->path
								    : "standard input",
					  own.text + n)
		       : rc;
}

static int read_file(void *user, incise_row_taker take, void *taker,
		     struct incise_error *err)
{
	struct source *source = user;

	begin(source, take, taker);
	return end(source, each_row(source, count_row, source, err), err);
}

/* A message of the rows, with the recording in front. */
static int name_it(const struct source *source, int rc, struct incise_error *err)
{
	static const char stream[] = "Arrow stream: ";
	struct incise_error own = *err;
	size_t known = sizeof(stream) - 1;

	/* The stream is one of the recording, which its own message names. */
	if (rc && !strncmp(own.text, stream, known) &&
	    !strncmp(own.text + known, source->path, strlen(source->path)))
		return incise_error_set(err, own.code, "%s", own.text + known);
	return rc && strncmp(own.text, source->path, strlen(source->path))
		       ? incise_error_set(err, own.code, "%s: %.300s", source->path,
					  own.text)
		       : rc;
}

static int read_recording(void *user, incise_row_taker take, void *taker,
			  struct incise_error *err)
{
	struct source *source = user;
	struct incise_recording *recording = incise_recording_open(source->path, err);
	struct incise_export_options options;
	struct ArrowArrayStream stream;
	int rc;

	if (!recording)
		return -errno;
	incise_export_options_init(&options);
	options.rate_hz = source->options->rate_hz;
	options.uncertainty =
		source->options->uncertainty ? INCISE_EXPORT_PARTS : INCISE_EXPORT_NONE;
	begin(source, take, taker);
	rc = incise_recording_stream(recording, "table", &options, &stream, err);
	incise_recording_close(recording);
	if (!rc)
		rc = incise_dataset_each_arrow(&stream, source->options->columns,
					       source->options->n_columns,
					       group_column(source), where(source),
					       count_row, source, &source->left_out, err);
	return name_it(source, end(source, rc, err), err);
}

static const char *name_of(const char *path)
{
	size_t n = strlen(path);

	while (n > 1 && path[n - 1] == '/')
		n--;
	while (n && path[n - 1] != '/')
		n--;
	return path + n;
}

static bool is_pipe(const char *path)
{
	struct stat st;

	return !strcmp(path, "-") ||
	       (!stat(path, &st) && !S_ISREG(st.st_mode) && !S_ISDIR(st.st_mode));
}

/* A recording may be named without its extension. */
static const char *find(const char *path)
{
	enum file_kind kind = file_kind_of(path);
	char *whole = cli_text("%s.rec", path);
	bool recording =
		kind == FILE_RECORDING || (access(path, F_OK) && !access(whole, F_OK));

	free(whole);
	return file_operand(path, recording ? FILE_RECORDING : FILE_TABLE);
}

static int stop(void *user, const double *row, const char *group,
		struct incise_error *err)
{
	(void)user;
	(void)row;
	(void)group;
	(void)err;
	return 1;
}

static bool has_cuts(const struct source *source)
{
	return incise_dataset_each(file_of(source), source->options->columns,
				   source->options->n_columns, "cut", where(source), stop,
				   NULL, NULL, NULL) == 0;
}

/* A pipe can be read once only: as a file in memory it is read like any other. */
static void keep_pipe(struct source *source)
{
	static const struct incise_infile_kind kind = {
		.name = "a CSV file",
		.advice = "give a CSV file with a header row",
	};
	struct incise_error err = {0};
	struct incise_infile *in =
		cli_require(incise_infile_open(source->path, &kind, &err), &err);
	char *line;
	int rc;

	source->pipe = memory_file_begin("pipe");
	while ((rc = incise_infile_line(in, &line, &err)) > 0)
		fprintf(source->pipe.file, "%s\n", line);
	if (rc)
		cli_fail_with(&err);
	incise_infile_close(in);
	memory_file_written(&source->pipe);
}

struct source *sources_new(char **paths, int n, struct source_options *options)
{
	struct source *sources = cli_alloc(n, sizeof(*sources));
	bool all = !options->group; /* have cuts */

	if (options->group && !strcmp(options->group, "none"))
		options->group = NULL;
	for (int i = 0; i < n; i++) {
		struct source *source = &sources[i];

		source->path = find(paths[i]);
		source->recording = file_kind_of(source->path) == FILE_RECORDING;
		source->options = options;
		if (!source->recording && is_pipe(source->path))
			keep_pipe(source);
		all = all && (source->recording || has_cuts(source));
		source->corpus = (struct incise_corpus_source){
			.name = strcmp(source->path, "-") ? source->path
							  : "standard input",
			.hash = source->hash,
			.text = source->text,
			.read = source->recording ? read_recording : read_file,
			.user = source,
		};
	}
	if (all)
		options->group = "cut";
	for (int i = 0; i < n && options->group; i++) {
		struct source *source = &sources[i];

		/* Cuts are numbered in each recording; other names mean the same everywhere. */
		source->corpus.own_groups = !strcmp(options->group, "cut");
		if (!strcmp(options->group, "recording"))
			source->corpus.group = source->hash;
		else if (source->recording && !strcmp(options->group, "rig"))
			source->corpus.group = source->rig;
	}
	return sources;
}

static int open_recording(struct source *source, struct incise_error *err)
{
	struct incise_recalibration active;
	struct incise_recording_info info;
	struct incise_recording *recording;
	char *database, *whole, *text, origins[ORIGINS_TEXT];
	int rc;

	/* Says itself what is wrong, as a warning, where damaged ones are used. */
	if (!recording_intact(source->path, true, source->options->damaged, err) &&
	    err->code)
		return -err->code;
	recording = incise_recording_open(source->path, err);
	if (!recording)
		return -errno;
	rc = incise_recording_info(recording, &info, err);
	incise_recording_recalibration(recording, &active);
	incise_recording_origins(recording, origins, sizeof(origins));
	incise_recording_close(recording);
	if (rc)
		return name_it(source, rc, err);
	whole = file_without_choice(source->path);
	database = cli_text("%s/recording.db", whole);
	rc = incise_file_sha256(database, source->hash, err);
	free(whole);
	free(database);
	snprintf(source->rig, sizeof(source->rig), "%s", info.rig);
	text = cli_text(
		"%.100s, %s%srecorded %s, rig %.*s, force %.9g mV/N, zero %.9g mV, camera "
		"%.9g mm/px%s%s%s%s",
		name_of(source->path), origins, *origins ? ", " : "", info.started,
		*active.file ? 40 : 120, info.rig, info.force_mV_N, info.zero_mV,
		info.depth_mm_px, *active.file ? ", by " : "", active.file,
		*active.file ? ", SHA-256 " : "", active.sha256);
	snprintf(source->text, sizeof(source->text), "%s", text);
	free(text);
	text = cli_text("%s; %.17g mV/N; tip %.17g %.17g %.17g; %s", info.rig,
			info.force_mV_N, info.tip_mm[0], info.tip_mm[1], info.tip_mm[2],
			active.sha256);
	snprintf(source->calibration, sizeof(source->calibration), "%s", text);
	source->corpus.calibration = source->calibration;
	free(text);
	return rc;
}

/* Its name, and the origins that the file carries, as many as fit. */
static int name_file(struct source *source, struct incise_error *err)
{
	size_t at =
		(size_t)snprintf(source->text, sizeof(source->text), "%.300s",
				 source->pipe.file ? "a pipe" : name_of(source->path));
	struct incise_origins origins = {0};
	char text[INCISE_ORIGIN_TEXT];
	int rc = incise_origins_read(&origins, file_of(source),
				     file_kind_of(file_of(source)) == FILE_MODEL, err);

	for (int i = 0; i < origins.n; i++) {
		origins.all[i].depth++;
		if (incise_origin_text(&origins.all[i], text) <= 0)
			continue;
		if (at + strlen(text) + 2 >= sizeof(source->text))
			break;
		at += (size_t)sprintf(source->text + at, "%s%s", i ? " " : ", ", text);
	}
	incise_origins_free(&origins);
	return rc;
}

int source_open(struct source *source, struct incise_error *err)
{
	int rc;

	source->state = source_state(source);
	if (source->recording)
		return open_recording(source, err);
	/* A file of another kind is refused before all of it is hashed. */
	rc = each_row(source, stop, NULL, err);
	if (!rc)
		rc = incise_file_sha256(file_of(source), source->hash, err);
	return rc ? rc : name_file(source, err);
}

void sources_free(struct source *sources, int n)
{
	for (int i = 0; i < n; i++) {
		if (sources[i].pipe.file)
			fclose(sources[i].pipe.file);
		free(sources[i].state);
	}
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

/* The next field of a line of CSV, without quotes; NULL: there is none. */
static char *next_field(char **at)
{
	char *field = *at, *end;

	if (!field)
		return NULL;
	end = strchr(field, ',');
	*at = end ? end + 1 : NULL;
	if (end)
		*end = '\0';
	field += strspn(field, " \t\"");
	field[strcspn(field, "\"\r\n")] = '\0';
	return field;
}

/* The next line that is no comment: 1, 0 at the end or on an error, which reading finds again. */
static int next_line(struct incise_infile *in, char **line)
{
	int rc;

	do
		rc = incise_infile_line(in, line, NULL);
	while (rc > 0 && (**line == '#' || !(*line)[strspn(*line, " \t\r")]));
	return rc > 0;
}

/* The columns that a file has; *stated: its first row has numbers there. */
static void look_for_parts(const char *path, const struct uncertainties *all, bool *has,
			   bool *stated)
{
	static const struct incise_infile_kind kind = {.name = "a table",
						       .advice = "give a CSV file"};
	struct incise_infile *in = incise_infile_open(path, &kind, NULL);
	int column[INCISE_BUDGET_PARTS], n = 0;
	char *line, *field, *end;

	memset(has, 0, INCISE_BUDGET_PARTS * sizeof(*has));
	*stated = true;
	if (!in)
		return; /* its reader says why */
	if (next_line(in, &line))
		for (int at = 0; (field = next_field(&line)); at++)
			for (int i = 0; i < all->n; i++)
				if (!strcmp(field, all->columns[i])) {
					has[i] = true;
					column[i] = at;
					n++;
				}
	if (n && next_line(in, &line))
		for (int at = 0; (field = next_field(&line)); at++)
			for (int i = 0; i < all->n; i++)
				if (has[i] && column[i] == at) {
					double value = strtod(field, &end);

					*stated &= end > field && value - value == 0;
				}
	incise_infile_close(in);
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
			look_for_parts(path, &all, has, &stated);
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
