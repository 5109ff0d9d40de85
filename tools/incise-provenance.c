// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise provenance: the way from a figure, a model or an export back to its recordings.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/factor.h>
#include <incise/model.h>
#include <incise/origin.h>
#include <incise/recalibration.h>
#include <incise/recording.h>
#include <incise/seal.h>
#include "cli/cli.h"
#include "../lib/base/control_character.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "cli/recording.h"

struct provenance_job {
	const char *recording;
	bool json;
};

static const struct cli_option options[] = {
	{0, "recording", "NAME.rec",
	 "compare with this recording; others are sought next to FILE",
	 CLI_INPUT(struct provenance_job, recording)},
	{0, "json", NULL, "report as one JSON object",
	 CLI_FLAG(struct provenance_job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "provenance",
	.synopsis = "FILE [--recording NAME.rec] [OPTIONS]",
	.summary = "Print what a figure, a model or an export was made of, back to the "
		   "recordings, and compare it with the files of these names next to it.",
	.options = options,
	.examples = "incise provenance liver.png",
	.failure =
		"FILE says nothing of its origin, or a file differs from the one it was "
		"made of",
};

enum state { SAME, OTHER, LATER, MISSING, STATES };

static const char *const states[STATES] = {"same", "other", "later", "missing"};

/* An origin, and the file of its name that is here. */
struct step {
	struct incise_origin *origin;
	enum state state;
	char *why; /* of a recording with this head that is not what it was; NULL: none */
	char *found;	/* path; NULL: none */
	int64_t commit; /* of the recording that was found */
	bool converted; /* it had this head in an older format */
};

/* --- comparison --------------------------------------------------------------------------- */

/* Compare a recording at @path; false: there is none, or it has another identity. */
static bool compare_recording(struct step *step, const char *path)
{
	const struct incise_origin *origin = step->origin;
	struct incise_recording *recording = incise_recording_open(path, NULL);
	struct incise_seal_head head;
	char identity[33];
	bool known = recording && !incise_seal_head(recording, identity, &head, NULL);

	step->converted = known && incise_seal_before(recording, origin->sha256);
	incise_recording_close(recording);
	if (!known)
		return false;
	step->commit = head.commit;
	if (strcmp(identity, origin->identity))
		step->state = OTHER;
	else if (step->converted || (!strcmp(head.head, origin->sha256) &&
				     (uint64_t)head.commit == origin->commit))
		step->state = SAME;
	else
		step->state = (uint64_t)head.commit > origin->commit ? LATER : OTHER;
	return !strcmp(identity, origin->identity);
}

/* SHA-256 of the calibration by which a recording is read; "": that of its capture. */
static void find_active(const char *path, char sha256[65])
{
	struct incise_recalibration *list = NULL;
	int n = incise_recalibrations(path, &list, NULL);

	strcpy(sha256, n > 1 ? list[n - 1].sha256 : "");
	free(list);
}

/*
 * A head stays when rows are changed, and when another calibration is given: the rows of a recording that was
 * found, and the calibration by which it was read then, of which there is a step behind its own.
 */
static void compare_rows(struct step *step, const struct step *next)
{
	struct incise_error err = {0};
	char active[65];
	const char *then = "";

	if (next && !strcmp(next->origin->kind, "calibration") &&
	    next->origin->depth == step->origin->depth + 1)
		then = next->origin->sha256;
	find_active(step->found, active);
	if (recording_altered(step->found, true, &err))
		step->why = cli_text("%s", err.text);
	else if (strcmp(active, then))
		step->why =
			cli_text("%s: is read by another calibration now", step->found);
	if (step->why)
		step->state = OTHER;
}

static void compare_file(struct step *step, const char *path)
{
	char hash[65];

	step->state =
		incise_file_sha256(path, hash, NULL) || strcmp(hash, step->origin->sha256)
			? OTHER
			: SAME;
}

/* "FOLDER/day.rec/a" of the member "day.rec:a" of a joined recording: free(3). */
static char *beside(const char *file, const char *name)
{
	const char *slash = strrchr(file, '/');
	char *path = cli_text("%.*s%s", slash ? (int)(slash + 1 - file) : 0, file, name);
	char *colon = strrchr(path + (slash ? slash + 1 - file : 0), ':');
	struct stat st;

	if (colon && stat(path, &st))
		*colon = '/';
	return path;
}

static void compare_provenance(struct step *step, const struct provenance_job *job,
			       const char *file)
{
	bool recording = !strcmp(step->origin->kind, "recording");
	char *path = beside(file, step->origin->name);
	struct stat st;

	step->state = MISSING;
	if (recording && job->recording && compare_recording(step, job->recording)) {
		step->found = cli_text("%s", job->recording);
		free(path);
		return;
	}
	step->state = MISSING;
	/* A pipe would be waited for. */
	if (stat(path, &st) ||
	    (recording ? !S_ISDIR(st.st_mode) : !S_ISREG(st.st_mode))) {
		free(path);
		return;
	}
	step->found = path;
	if (!recording)
		compare_file(step, path);
	else if (!compare_recording(step, path) && step->state == MISSING)
		step->state = OTHER;
}

/* The recording that a calibration is of: the step before. NULL: it is of none, but a file. */
static struct step *find_recording(struct step *steps, int i)
{
	return i && !strcmp(steps[i].origin->kind, "calibration") &&
			       !strcmp(steps[i - 1].origin->kind, "recording") &&
			       steps[i].origin->depth == steps[i - 1].origin->depth + 1
		       ? &steps[i - 1]
		       : NULL;
}

/* It is in the recording's own folder, where it stays when another one becomes active. */
static void compare_calibration(struct step *step, const struct step *recording)
{
	char *path;

	step->state = MISSING;
	if (!recording->found)
		return;
	path = cli_text("%s/calibration/%s", recording->found, step->origin->name);
	if (access(path, F_OK)) {
		free(path);
		return;
	}
	step->found = path;
	compare_file(step, path);
}

/* The command that trained a model, by its notes: free(3). NULL: none is noted. */
static char *find_command(const char *path)
{
	static const char key[] = "options: --";
	char *notes =
		file_kind_of(path) == FILE_MODEL ? incise_model_notes(path, NULL) : NULL;
	char *at = notes ? strstr(notes, key) : NULL, *command = NULL;

	if (at) {
		at[strcspn(at, "\n")] = 0;
		control_characters_hide(at);
		command = cli_text("incise train … --%s", at + strlen(key));
	}
	free(notes);
	return command;
}

/* --- report ------------------------------------------------------------------------------- */

static void print_step(struct step *step)
{
	struct incise_origin *origin = step->origin;
	bool recording = !strcmp(origin->kind, "recording");
	char *found = step->found ? step->found : origin->name;

	control_characters_hide(origin->name);
	control_characters_hide(found);
	printf("%*s%s %s, ", 2 * origin->depth, "", origin->kind, origin->name);
	if (recording)
		printf("commit %llu, head %.16s…: ", (unsigned long long)origin->commit,
		       origin->sha256);
	else
		printf("SHA-256 %.16s…: ", origin->sha256);
	switch (step->state) {
	case SAME:
		printf(step->converted ? "%s was converted since, and had this head\n"
		       : recording     ? "%s has this head\n"
				       : "%s is this file\n",
		       found);
		break;
	case OTHER:
		if (step->why) {
			control_characters_hide(step->why);
			printf("%s\n", step->why);
			break;
		}
		printf(recording ? "%s is another recording, or was changed\n"
				 : "%s is another file, or was changed\n",
		       found);
		break;
	case LATER:
		printf("%s has gone on to commit %lld\n", found, (long long)step->commit);
		break;
	default:
		printf("not here\n");
	}
}

static json_t *step_json(const struct step *step)
{
	const struct incise_origin *origin = step->origin;
	bool recording = !strcmp(origin->kind, "recording");

	return json_pack(
		"{si ss so ss so so so ss}", "depth", origin->depth, "kind", origin->kind,
		"name", json_text(origin->name), "sha256", origin->sha256, "commit",
		recording ? json_integer((json_int_t)origin->commit) : json_null(),
		"identity", recording ? json_text(origin->identity) : json_null(),
		"found", step->found ? json_text(step->found) : json_null(), "state",
		states[step->state]);
}

static void report_provenance(const struct provenance_job *job, const char *path,
			      struct step *steps, int n, bool cut)
{
	char *command = find_command(path);
	json_t *list = json_array();

	if (!job->json)
		printf("%s was made%s%s of\n", path, command ? " by " : "",
		       command ? command : "");
	for (int i = 0; i < n; i++)
		if (job->json)
			json_array_append_new(list, step_json(&steps[i]));
		else
			print_step(&steps[i]);
	if (cut)
		cli_warn("%s: names more than %d files; the others are left out", path,
			 INCISE_ORIGINS_MAX);
	if (job->json)
		json_print(json_pack("{so so sb so}", "path", json_text(path), "origins",
				     list, "cut", cut, "command",
				     command ? json_text(command) : json_null()));
	else
		json_decref(list);
	free(command);
}

/* --- the command -------------------------------------------------------------------------- */

_Noreturn static void fail_without(const char *path)
{
	switch (file_kind_of(path)) {
	case FILE_RECORDING:
		cli_fail("%s: a recording is where every way back ends; 'incise verify "
			 "%s' checks it",
			 path, path);
	case FILE_COMPILED:
		cli_fail("%s: a compiled model has no room for its origin; give the .fis "
			 "file that it was compiled from",
			 path);
	case FILE_DEVIATION:
	case FILE_TEXTURE:
		cli_fail("%s: a .%s file belongs to its model; give that", path,
			 file_kind_of(path) == FILE_TEXTURE ? "tex" : "sd");
	case FILE_TABLE:
		cli_fail("%s: says nothing of its origin; 'incise export' without "
			 "--no-lineage writes it into a CSV",
			 path);
	case FILE_MODEL:
		cli_fail(
			"%s: says nothing of its origin: Python's incise.train() of a table, "
			"another program or an older incise made it; train it from files",
			path);
	case FILE_SESSION:
		cli_fail(
			"%s: a session has its origin in keys source and scene; 'incise assess "
			"%s' reports on it",
			path, path);
	default:
		cli_fail(
			"%s: says nothing of its origin: it is a page of sessions, or another "
			"program or an older incise made it",
			path);
	}
}

int main(int argc, char **argv)
{
	struct incise_origins origins = {0};
	struct incise_error err = {0};
	struct provenance_job job = {0};
	bool recorded = false, differs = false;
	struct step *steps;
	const char *path;

	cli_parse(&command, argc, argv, &job);
	path = cli_operand(argc, argv, "FILE", "figure, model or export");
	if (job.recording)
		file_expect(job.recording, FILE_RECORDING);
	cli_check(incise_origins_read(&origins, path, file_kind_of(path) == FILE_MODEL,
				      &err),
		  &err);
	cli_catch_signals();
	if (!origins.n)
		fail_without(path);
	steps = cli_alloc((size_t)origins.n, sizeof(*steps));
	for (int i = 0; i < origins.n; i++)
		steps[i].origin = &origins.all[i];
	for (int i = 0; i < origins.n && !cli_stop; i++) {
		struct step *recording = find_recording(steps, i);

		if (recording)
			compare_calibration(&steps[i], recording);
		else
			compare_provenance(&steps[i], &job, path);
		if (!strcmp(origins.all[i].kind, "recording") && steps[i].found &&
		    steps[i].state != OTHER)
			compare_rows(&steps[i], i + 1 < origins.n ? &steps[i + 1] : NULL);
		recorded |= !strcmp(origins.all[i].kind, "recording");
		differs |= steps[i].state == OTHER;
	}
	if (cli_stop)
		cli_fail("interrupted");
	report_provenance(&job, path, steps, origins.n, origins.cut);
	for (int i = 0; i < origins.n; i++)
		free(steps[i].found);
	free(steps);
	incise_origins_free(&origins);
	cli_finish();
	if (differs)
		cli_fail("%s: a file here differs from the one that it was made of",
			 path);
	if (!recorded)
		cli_fail("%s: its way back ends before a recording; 'incise export' "
			 "without --no-lineage writes the origin into a CSV",
			 path);
	return 0;
}
