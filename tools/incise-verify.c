// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * incise verify: proves that a recording is complete, or says what is missing and where.
 */
#include <ctype.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <incise/recalibration.h>
#include <incise/recording.h>
#include <incise/verify.h>
#include "cli/cli.h"
#include "cli/control_character.h"
#include "cli/file_kind.h"
#include "cli/json.h"
#include "seal/members.h"
#include "seal/seal.h"

#define FINDINGS_MAX 1000 /* in the JSON object */

/* Files that say who is trusted; NULL: not given. */
struct trust_files {
	const char *signers, *revoked, *ca;
};

struct job {
	struct trust_files trust;
	bool json;
};

static const struct cli_option options[] = {
	{0, "signers", "FILE",
	 "check signatures and say who vouches for what; FILE lists who may sign, "
	 "in the format ALLOWED SIGNERS of ssh-keygen(1)",
	 CLI_INPUT(struct job, trust.signers)},
	{0, "revoked", "FILE",
	 "keys that are not accepted: public keys, or a list of ssh-keygen -k",
	 CLI_INPUT(struct job, trust.revoked)},
	{0, "ca", "FILE", "certificates of authorities in PEM: check time-stamps by them",
	 CLI_INPUT(struct job, trust.ca)},
	{0, "json", NULL, "report as one JSON object", CLI_FLAG(struct job, json)},
	{0},
};

static const struct cli_command command = {
	.name = "verify",
	.synopsis = "NAME.rec [OPTIONS]",
	.summary =
		"Check that a recording is complete and as it was written: recompute its "
		"ledger and seal, and check the pages of its database. Lists what is "
		"missing or altered, and where.",
	.options = options,
	.examples = "incise verify liver.rec",
	.success = "complete, and signed if --signers is given",
	.failure = "something is missing, altered or not signed",
};

/* Findings are printed as lines, or kept in a list. */
struct sink {
	json_t *list; /* NULL: lines */
	const char *path;
	uint64_t left_out;
	uint64_t times; /* rows whose times are not to be trusted */
};

static json_t *known(int64_t value, bool is)
{
	return is ? json_integer(value) : json_null();
}

static json_t *as_json(const struct incise_verify_finding *finding)
{
	static const char *const kinds[] = {
		[INCISE_VERIFY_LOST] = "lost",
		[INCISE_VERIFY_ALTERED] = "altered",
		[INCISE_VERIFY_LEDGER] = "ledger",
		[INCISE_VERIFY_EXTRA] = "extra",
		[INCISE_VERIFY_COUNT] = "count",
		[INCISE_VERIFY_INTERRUPTED] = "interrupted",
		[INCISE_VERIFY_FRAMES] = "pictures",
		[INCISE_VERIFY_UNVERIFIED] = "unverified",
		[INCISE_VERIFY_DAMAGED] = "damaged",
		[INCISE_VERIFY_ENDED] = "ended",
		[INCISE_VERIFY_TIMES] = "times",
		[INCISE_VERIFY_SEAL] = "seal",
	};
	bool numbers = finding->last_seq >= finding->first_seq;
	bool blocks = finding->first_block >= 0;

	return json_pack("{ss so so so so so so so sI so}", "kind", kinds[finding->kind],
			 "stream", json_text_or_null(finding->stream), "first_block",
			 known(finding->first_block, blocks), "last_block",
			 known(finding->last_block, blocks), "first_seq",
			 known(finding->first_seq, numbers), "last_seq",
			 known(finding->last_seq, numbers), "first_ns",
			 known(finding->first_ns, finding->first_ns >= 0), "last_ns",
			 known(finding->last_ns, finding->last_ns >= 0), "count",
			 (json_int_t)finding->count, "text", json_text(finding->text));
}

static void found(void *user, const struct incise_verify_finding *finding)
{
	struct sink *sink = user;

	if (finding->kind == INCISE_VERIFY_TIMES)
		sink->times += finding->count;
	if (!sink->list) {
		cli_progress_end();
		printf("%s: %s\n", sink->path, finding->text);
	} else if (json_array_size(sink->list) < FINDINGS_MAX) {
		json_array_append_new(sink->list, as_json(finding));
	} else {
		sink->left_out++;
	}
}

static int progress(void *user, double share)
{
	(void)user;
	if (share < 0)
		cli_progress("checking the pages of the database");
	else
		cli_progress("verifying %.0f %%", 100 * share);
	return cli_stop;
}

/* Of the camera's file; null where the recording has none. */
static json_t *pictures(const struct incise_verify_report *report)
{
	const struct incise_verify_frames *frames = &report->frames;

	if (!report->n_streams ||
	    strcmp(report->streams[report->n_streams - 1].name, "camera"))
		return json_null();
	return json_pack("{sb sI sI sI sI sI}", "checked", frames->checked, "present",
			 (json_int_t)frames->present, "missing",
			 (json_int_t)frames->missing, "altered",
			 (json_int_t)frames->altered, "extra", (json_int_t)frames->extra,
			 "ahead", (json_int_t)frames->ahead);
}

/* The calibration that is active in place of that of the capture; false: none is. */
static bool recalibrated(const char *path, struct incise_recalibration *active)
{
	struct incise_recalibration *list;
	int n = incise_recalibrations(path, &list, NULL);
	bool is = n > 0 && !list[0].active;

	if (is)
		*active = list[n - 1];
	free(list);
	return is;
}

static void print_json(const struct incise_verify_report *report, const struct sink *sink,
		       json_t *vouches)
{
	struct incise_recalibration active;
	json_t *streams = json_array();

	for (int i = 0; i < report->n_streams; i++) {
		const struct incise_verify_stream *stream = &report->streams[i];

		json_array_append_new(
			streams, json_pack("{ss sI sI sI sI sI sI}", "name", stream->name,
					   "expected", (json_int_t)stream->expected,
					   "present", (json_int_t)stream->present, "lost",
					   (json_int_t)stream->lost, "lost_at_capture",
					   (json_int_t)stream->lost_at_capture, "blocks",
					   (json_int_t)stream->blocks, "altered_blocks",
					   (json_int_t)stream->altered));
	}
	json_print(json_pack(
		"{so sb sb sb sb sb sI so so so so sI so}", "path", json_text(sink->path),
		"complete", report->complete, "intact", report->intact, "unverified",
		report->unverified, "interrupted", report->interrupted, "sealed",
		report->sealed, "commits", (json_int_t)report->commits, "pictures",
		pictures(report), "recalibrated",
		recalibrated(sink->path, &active) ? json_text(active.file) : json_null(),
		"streams", streams, "findings", sink->list, "findings_left_out",
		(json_int_t)sink->left_out, "seals", vouches));
}

static void print_table(const struct incise_verify_report *report, const char *path)
{
	struct incise_recalibration active;

	for (int i = 0; i < report->n_streams; i++) {
		const struct incise_verify_stream *stream = &report->streams[i];

		printf("%-8s %llu expected, %llu present, %llu lost, in %s", stream->name,
		       (unsigned long long)stream->expected,
		       (unsigned long long)stream->present,
		       (unsigned long long)stream->lost,
		       cli_count(stream->blocks, "block"));
		if (stream->altered)
			printf(", %llu of them altered",
			       (unsigned long long)stream->altered);
		printf("\n");
	}
	if (report->frames.checked)
		printf("%-8s %s as written, %llu missing, %llu altered, %llu without a row\n",
		       "", cli_count(report->frames.present, "frame"),
		       (unsigned long long)report->frames.missing,
		       (unsigned long long)report->frames.altered,
		       (unsigned long long)report->frames.extra);
	if (report->sealed)
		printf("%-8s %s, chained\n", "seal",
		       cli_count(report->commits, "commit"));
	if (recalibrated(path, &active))
		printf("%s: read by another calibration than that of the capture: %s\n",
		       path, active.file);
	if (report->complete)
		printf("%s: complete, and as it was written\n", path);
}

/*
 * --- signers and authorities that vouch for a recording: its signatures and time-stamps ------
 *
 *   statement ── compared with ── recording
 *       └─ signature ── its key ── file of signers, at the time of a time-stamp that is trusted, else now
 *       └─ time-stamp ── its certificate ── file of authorities
 */

struct trust {
	struct signers signers;		 /* path NULL: none */
	struct authorities *authorities; /* NULL: none */
};

/* A signature or a time-stamp. */
struct vouch_line {
	char file[100]; /* in seal/ */
	enum seal_kind kind;
	int number; /* of its statement */
	enum { VOUCH_GOOD, VOUCH_BAD, VOUCH_UNCHECKED } verdict;
	struct signature signature;
	struct timestamp timestamp;
	char why[500]; /* if it is VOUCH_BAD */
};

/* A statement, and how the recording differs from it. */
struct vouch_statement {
	int number;
	int64_t commit;	 /* -1: it is no statement */
	bool complete;	 /* of a recording that was closed */
	bool recorded;	 /* what was recorded agrees */
	bool calibrated; /* and the calibration by which it is read */
	bool agrees;	 /* all of it does, with the name */
	bool is_signed;	 /* by a signer that may */
	bool reported;	 /* differences were findings of the verification */
	char name[256];	 /* of the recording when it was signed; "": of a join */
	int n_differences;
	char *differences[20]; /* texts; there may be more */
};

struct vouch {
	char *recording;
	char *join; /* the statement of the join as it is now; NULL: it is a plain recording */
	bool member; /* of a join, whose statement has its name */
	struct vouch_statement *statements;
	struct vouch_line *lines;
	int n_statements, n_lines;
	bool vouched; /* the newest statement with a good signature agrees */
	int bad;      /* signatures, time-stamps and statements that are not good */
};

/* Read them; fails the program. trust_free(). */
static void trust_read(struct trust *trust, const struct trust_files *files)
{
	struct incise_error err = {0};

	*trust = (struct trust){0};
	if (files->signers &&
	    signers_read(&trust->signers, files->signers, files->revoked, &err))
		cli_fail_with(&err);
	if (files->ca)
		trust->authorities = cli_require(authorities_read(files->ca, &err), &err);
}

static void trust_free(struct trust *trust)
{
	signers_free(&trust->signers);
	authorities_free(trust->authorities);
}

/* --- statements ---------------------------------------------------------------------------- */

struct comparison {
	const struct incise_verify_watch
		*watch; /* of the caller, for all findings; or NULL */
	struct vouch_statement *statement;
};

static void found_in_seal(void *user, const struct incise_verify_finding *finding)
{
	const struct comparison *comparison = user;
	struct vouch_statement *s = comparison->statement;

	if (comparison->watch)
		comparison->watch->found(comparison->watch->user, finding);
	if (finding->kind != INCISE_VERIFY_SEAL ||
	    s->n_differences == (int)(sizeof(s->differences) / sizeof(*s->differences)))
		return;
	s->differences[s->n_differences] = cli_text("%s", finding->text);
	control_characters_hide(s->differences[s->n_differences++]);
}

/* A finding of ours about a statement. */
static void differs(const struct comparison *comparison, const char *fmt, ...)
	INCISE_PRINTF(2, 3);
static void differs(const struct comparison *comparison, const char *fmt, ...)
{
	char text[600];
	struct incise_verify_finding finding = {
		.kind = INCISE_VERIFY_SEAL,
		.stream = "",
		.first_block = -1,
		.last_block = -1,
		.last_seq = -1,
		.first_ns = -1,
		.last_ns = -1,
		.count = 1,
		.text = text,
	};
	va_list args;

	va_start(args, fmt);
	vsnprintf(text, sizeof(text), fmt, args);
	va_end(args);
	found_in_seal((void *)(uintptr_t)comparison, &finding);
}

/* SHA-256 of the last calibration of a list, which is the active one; "": that of the capture. */
static void find_active(const char *list, char sha256[65])
{
	*sha256 = 0;
	for (const char *line = list; *line; line = strchr(line, '\n') + 1)
		if (sscanf(line, "calibration %*s %64[0-9a-f]", sha256) != 1)
			*sha256 = 0;
}

/* Whether the recording is read by the calibration of the statement; it is a finding if not. */
static bool compare_calibration(struct vouch *vouch, const struct seal_file *file,
				const struct comparison *comparison)
{
	struct incise_error err = {0};
	char *now = cli_require(seal_calibrations(vouch->recording, &err), &err);
	const char *then = file->bytes + seal_statement_length(file->bytes, file->n);
	bool kept = !strncmp(now, then, strlen(then)), known;
	char read_by[65], signed_as[65], name[200] = "";

	for (char *line = now; *line; line = strchr(line, '\n') + 1)
		sscanf(line, "calibration %199s", name);
	find_active(now, read_by);
	find_active(then, signed_as);
	known = kept && !strcmp(read_by, signed_as);
	if (!kept)
		differs(comparison, "calibrations that are in the statement were removed "
				    "or changed");
	else if (!known)
		differs(comparison, "%s, by which it is read, is not in the statement",
			name);
	free(now);
	return known;
}

/* The name is that of the cuts in what is exported. A member's is in the statement of the join. */
static bool compare_name(struct vouch *vouch, const char *name,
			 const struct comparison *comparison)
{
	struct incise_error err = {0};
	struct incise_recording *recording =
		cli_require(incise_recording_open(vouch->recording, &err), &err);
	const char *now = incise_recording_name(recording), *then = name;
	bool same;

	/* A statement has '?' for characters that are not printed. */
	for (; *now && (*now == *then || (*then == '?' && iscntrl((unsigned char)*now)));
	     now++)
		then++;
	same = vouch->member || *now == *then;
	incise_recording_close(recording);
	if (!same)
		differs(comparison,
			"it was signed under the name %s; give it that name again, or "
			"sign it under this one",
			name);
	return same;
}

/* The text says all: the first line that differs does where. */
static void compare_join(struct vouch *vouch, const struct seal_file *file)
{
	static const char first[] = "incise statement 1 of a join\n";
	struct vouch_statement *s = &vouch->statements[vouch->n_statements++];
	struct comparison comparison = {NULL, s};
	const char *then = file->bytes, *now = vouch->join, *member = "";
	size_t n = strlen(first);

	*s = (struct vouch_statement){.number = file->number, .commit = -1};
	if (!file->bytes || strncmp(then, first, n)) {
		differs(&comparison, "seal/%s: %s", file->name,
			file->bytes ? "no statement of a join" : file->why);
		return;
	}
	s->commit = 0;
	s->complete = true;
	s->agrees = s->calibrated = s->recorded =
		file->n == strlen(now) && !memcmp(then, now, file->n);
	if (s->agrees)
		return;
	for (; *now && !strncmp(now, then, n); n = strcspn(now, "\n") + 1) {
		now += n;
		then += n;
		if (!strncmp(now, "member ", 7))
			member = now;
	}
	differs(&comparison, "%.*s: '%.*s' was signed, and is '%.*s' now",
		(int)strcspn(member, "\n"), member, (int)strcspn(then, "\n"), then,
		(int)strcspn(now, "\n"), now);
}

/* Returns whether the recording was verified with it. */
static bool compare_recording(struct vouch *vouch, const struct seal_file *file,
			      const struct incise_verify_watch *watch,
			      struct incise_verify_report *report)
{
	struct vouch_statement *s = &vouch->statements[vouch->n_statements++];
	struct comparison comparison = {watch, s};
	const struct incise_verify_watch own = {found_in_seal, progress, &comparison};
	struct incise_seal_statement *statement = cli_alloc(1, sizeof(*statement));
	struct incise_verify_report unused;
	struct incise_error err = {.text = ""};
	bool is;

	*s = (struct vouch_statement){.number = file->number, .commit = -1};
	is = file->bytes &&
	     !incise_seal_read(statement, file->bytes,
			       seal_statement_length(file->bytes, file->n), &err);
	if (!is) {
		s->differences[s->n_differences++] = cli_text(
			"seal/%s: %s", file->name, file->bytes ? err.text : file->why);
		control_characters_hide(s->differences[0]);
	} else {
		s->commit = statement->last.commit;
		s->complete = statement->complete;
		report = report ? report : &unused;
		if (incise_seal_compare(vouch->recording, file->bytes,
					seal_statement_length(file->bytes, file->n), &own,
					report, &err))
			cli_fail_with(&err);
		s->recorded = report->sealed;
		strcpy(s->name, statement->name);
		s->calibrated = compare_calibration(vouch, file, &comparison);
		s->agrees = compare_name(vouch, s->name, &comparison) && s->calibrated &&
			    s->recorded;
		s->reported = watch;
	}
	free(statement);
	return is;
}

/* --- signatures and time-stamps -------------------------------------------------------------- */

static void check_timestamp(struct vouch_line *line, const struct seal_file *file,
			    const struct seal_file *statement, const struct trust *trust)
{
	struct der reply = {(unsigned char *)file->bytes, file->n};
	unsigned char digest[TIMESTAMP_DIGEST];
	struct incise_error err = {0};
	int rc;

	timestamp_digest(statement->bytes, statement->n, digest);
	rc = timestamp_read(&reply, "not valid", digest, NULL, &line->timestamp, &err);
	if (!rc && trust->authorities)
		rc = timestamp_check(&reply, "not valid", digest, trust->authorities,
				     &err);
	if (rc)
		line->verdict = VOUCH_BAD;
	else
		line->verdict = trust->authorities ? VOUCH_GOOD : VOUCH_UNCHECKED;
	snprintf(line->why, sizeof(line->why), "%s", rc ? err.text : "");
}

static void check_signature(struct vouch_line *line, const struct seal_file *file,
			    const struct seal_file *statement, const struct trust *trust,
			    int64_t at_s)
{
	struct incise_error err = {0};

	if (!trust->signers.path) {
		line->verdict = VOUCH_UNCHECKED;
		return;
	}
	if (signature_check(&line->signature, statement->bytes, statement->n, file->bytes,
			    file->n, &trust->signers, at_s, &err))
		cli_fail_with(&err);
	line->verdict =
		line->signature.verdict == SIGNATURE_GOOD ? VOUCH_GOOD : VOUCH_BAD;
	snprintf(line->why, sizeof(line->why), "%s", line->signature.why);
}

/* The earliest time at which a trusted authority saw the statement; -1: none. */
static int64_t stamped_s(const struct vouch *vouch, int number)
{
	int64_t t_s = -1;

	for (int i = 0; i < vouch->n_lines; i++) {
		const struct vouch_line *line = &vouch->lines[i];

		if (line->number == number && line->kind == SEAL_TIMESTAMP &&
		    line->verdict == VOUCH_GOOD && (t_s < 0 || line->timestamp.t_s < t_s))
			t_s = line->timestamp.t_s;
	}
	return t_s;
}

static void check_line(struct vouch *vouch, const struct seal_file *file,
		       const struct seal_file *statement, const struct trust *trust)
{
	struct vouch_line *line = &vouch->lines[vouch->n_lines];

	*line = (struct vouch_line){
		.kind = file->kind, .number = file->number, .verdict = VOUCH_BAD};
	strcpy(line->file, file->name);
	if (!file->bytes)
		strcpy(line->why, file->why);
	else if (!statement || !statement->bytes)
		strcpy(line->why, "its statement is missing");
	else if (file->kind == SEAL_TIMESTAMP)
		check_timestamp(line, file, statement, trust);
	else
		check_signature(line, file, statement, trust,
				stamped_s(vouch, file->number));
	vouch->n_lines++;
	vouch->bad += line->verdict == VOUCH_BAD;
}

static const struct seal_file *statement_of(const struct seal_files *files, int number)
{
	for (int i = 0; i < files->n; i++)
		if (files->all[i].kind == SEAL_STATEMENT &&
		    files->all[i].number == number)
			return &files->all[i];
	return NULL;
}

/* Statements are newest first. An older state that was signed, too, does not replace a newer one. */
static void judge_vouch(struct vouch *vouch)
{
	bool newest = true;

	for (int i = 0; i < vouch->n_statements; i++) {
		struct vouch_statement *s = &vouch->statements[i];

		for (int k = 0; k < vouch->n_lines; k++)
			s->is_signed |= vouch->lines[k].number == s->number &&
					vouch->lines[k].kind == SEAL_SIGNATURE &&
					vouch->lines[k].verdict == VOUCH_GOOD;
		vouch->vouched |= newest && s->agrees && s->is_signed;
		newest &= !s->is_signed;
		vouch->bad += s->commit < 0;
	}
}

/*
 * Verify a recording as incise_verify() does, and check its seal. If @report is NULL, as for a joined
 * one it must be, it was verified before. Without signers to trust, signatures are not checked.
 * Every failure ends the program.
 *
 * @member: of a joined recording
 */
static void vouch_check(struct vouch *vouch, const char *recording, bool member,
			const struct trust *trust,
			const struct incise_verify_watch *watch,
			struct incise_verify_report *report)
{
	struct incise_error err = {0};
	struct seal_files files;
	bool verified = !report;

	*vouch = (struct vouch){.recording = seal_recording(recording), .member = member};
	vouch->join = seal_join(vouch->recording);
	if (seal_files_read(&files, vouch->recording, "seal", &err))
		cli_fail_with(&err);
	vouch->statements = cli_alloc((size_t)files.n + 1, sizeof(*vouch->statements));
	vouch->lines = cli_alloc((size_t)files.n + 1, sizeof(*vouch->lines));
	/* The last one is that of the present: the recording is verified with it. */
	for (int i = files.n - 1; i >= 0 && trust->signers.path; i--)
		if (files.all[i].kind != SEAL_STATEMENT)
			continue;
		else if (vouch->join)
			compare_join(vouch, &files.all[i]);
		else
			verified |= compare_recording(vouch, &files.all[i],
						      verified ? NULL : watch,
						      verified ? NULL : report);
	if (!verified && incise_verify(recording, watch, report, &err))
		cli_fail_with(&err);
	/* Time-stamps first: they say when a key had to be valid. */
	for (int kind = SEAL_TIMESTAMP; kind >= SEAL_SIGNATURE; kind--)
		for (int i = 0; i < files.n; i++)
			if ((int)files.all[i].kind == kind)
				check_line(vouch, &files.all[i],
					   statement_of(&files, files.all[i].number),
					   trust);
	judge_vouch(vouch);
	seal_files_free(&files);
}

static void vouch_free(struct vouch *vouch)
{
	for (int i = 0; i < vouch->n_statements; i++)
		for (int k = 0; k < vouch->statements[i].n_differences; k++)
			free(vouch->statements[i].differences[k]);
	free(vouch->statements);
	free(vouch->lines);
	free(vouch->recording);
	free(vouch->join);
}

/* --- report -------------------------------------------------------------------------------- */

static const struct vouch_statement *numbered(const struct vouch *vouch, int number)
{
	for (int i = 0; i < vouch->n_statements; i++)
		if (vouch->statements[i].number == number)
			return &vouch->statements[i];
	return NULL;
}

/* "all of it, statement of commit 97". */
static char *extent(const struct vouch *vouch, int number)
{
	const struct vouch_statement *s = numbered(vouch, number);

	if (!s || s->commit < 0)
		return cli_text("statement %d", number);
	if (vouch->join)
		return cli_text(s->agrees ? "the times of the join"
					  : "but not for what it is now");
	return cli_text("%s%s, statement of commit %lld",
			!s->recorded	 ? "but not for what it is now"
			: !s->calibrated ? "what was recorded, but not its calibration"
			: s->complete	 ? "all of it"
					 : "all of it up to the interruption",
			s->recorded && s->calibrated && !s->agrees
				? ", but under another name"
				: "",
			(long long)s->commit);
}

static void print_line(const struct vouch *vouch, const struct vouch_line *line)
{
	const struct timestamp *stamp = &line->timestamp;
	char *what = extent(vouch, line->number);

	if (line->verdict == VOUCH_BAD)
		printf("%s: seal/%s: %s%s%s%s\n", vouch->recording, line->file, line->why,
		       *line->signature.key ? " (" : "", line->signature.key,
		       *line->signature.key ? ")" : "");
	else if (line->kind == SEAL_SIGNATURE)
		printf("%s: signed by %s (%s), %s\n", vouch->recording,
		       line->signature.signer, line->signature.key, what);
	else
		printf("%s: time-stamped %s by %s%s, %s\n", vouch->recording, stamp->utc,
		       *stamp->authority ? stamp->authority : "an unnamed authority",
		       line->verdict == VOUCH_GOOD ? "" : ", not checked: give --ca FILE",
		       what);
	free(what);
}

/* A line for each signature, time-stamp and difference. */
static void vouch_print(const struct vouch *vouch, const struct trust *trust)
{
	int kinds[2] = {0};

	for (int i = vouch->n_statements - 1; i >= 0; i--) {
		const struct vouch_statement *s = &vouch->statements[i];

		for (int k = 0; k < s->n_differences && !s->reported; k++)
			printf("%s: statement %d: %s\n", vouch->recording, s->number,
			       s->differences[k]);
	}
	for (int i = 0; i < vouch->n_lines; i++) {
		const struct vouch_line *line = &vouch->lines[i];

		kinds[line->kind == SEAL_TIMESTAMP]++;
		if (trust->signers.path)
			print_line(vouch, line);
	}
	if (vouch->n_lines && !trust->signers.path)
		printf("%s: %s and %s, not checked: give --signers FILE\n",
		       vouch->recording, cli_count(kinds[0], "signature"),
		       cli_count(kinds[1], "time-stamp"));
}

static json_t *vouch_json(const struct vouch *vouch)
{
	static const char *const verdicts[] = {[VOUCH_GOOD] = "good",
					       [VOUCH_BAD] = "bad",
					       [VOUCH_UNCHECKED] = "unchecked"};
	json_t *statements = json_array(), *lines[2] = {json_array(), json_array()};

	for (int i = 0; i < vouch->n_statements; i++) {
		const struct vouch_statement *s = &vouch->statements[i];
		json_t *differences = json_array();

		for (int k = 0; k < s->n_differences; k++)
			json_array_append_new(differences, json_text(s->differences[k]));
		json_array_append_new(
			statements,
			json_pack("{si so sb sb so}", "statement", s->number, "commit",
				  s->commit < 0 || vouch->join
					  ? json_null()
					  : json_integer((json_int_t)s->commit),
				  "agrees", s->agrees, "signed", s->is_signed,
				  "differences", differences));
	}
	for (int i = 0; i < vouch->n_lines; i++) {
		const struct vouch_line *line = &vouch->lines[i];
		bool stamp = line->kind == SEAL_TIMESTAMP;
		json_t *object =
			json_pack("{ss si ss so}", "file", line->file, "statement",
				  line->number, "verdict", verdicts[line->verdict], "why",
				  json_text_or_null(line->why));

		json_object_set_new(object, stamp ? "utc" : "signer",
				    json_text_or_null(stamp ? line->timestamp.utc
							    : line->signature.signer));
		json_object_set_new(object, stamp ? "authority" : "key",
				    json_text_or_null(stamp ? line->timestamp.authority
							    : line->signature.key));
		json_array_append_new(lines[stamp], object);
	}
	return json_pack("{so sb so so so}", "path", json_text(vouch->recording),
			 "vouched", vouch->vouched, "statements", statements,
			 "signatures", lines[0], "timestamps", lines[1]);
}

/* The reason in one line why nobody vouches for it; fails the program with it. */
_Noreturn static void vouch_fail(const struct vouch *vouch, const struct trust *trust)
{
	struct incise_seal_head head;
	char identity[33], why[200];

	if (vouch->join && !vouch->n_lines)
		cli_fail("%s: its members are signed, the times of the join are not: "
			 "'incise sign %s' signs them",
			 vouch->recording, vouch->recording);
	if (vouch->bad)
		cli_fail("%s: not everyone who vouches for it may: bad signatures, "
			 "time-stamps or statements: %d",
			 vouch->recording, vouch->bad);
	if (!vouch->n_lines)
		cli_fail("%s: not signed: %s%s", vouch->recording,
			 seal_head(vouch->recording, identity, &head, why)
				 ? "'incise sign' signs it"
				 : why,
			 access(cli_text("%s/seal-before", vouch->recording), F_OK)
				 ? ""
				 : "; seal-before/ has signatures of it before its "
				   "conversion");
	cli_fail("%s: nobody in %s signed what it is now", vouch->recording,
		 trust->signers.path);
}

/* --- who vouches for it --------------------------------------------------------------- */

/* The seal of each member: verify the recording, too. */
struct seals {
	struct trust trust;
	struct members members;
	struct vouch *vouches;
};

static void seals_check(struct seals *seals, const char *path,
			const struct incise_verify_watch *watch,
			struct incise_verify_report *report)
{
	struct incise_error err = {0};
	struct members *members = &seals->members;

	members_find(members, path);
	seals->vouches = cli_alloc((size_t)members->n, sizeof(*seals->vouches));
	if (members->joined && incise_verify(path, watch, report, &err))
		cli_fail_with(&err);
	for (int i = 0; i < members->n; i++)
		vouch_check(&seals->vouches[i], members->joined ? members->path[i] : path,
			    i < members->n - 1, &seals->trust,
			    members->joined ? NULL : watch,
			    members->joined ? NULL : report);
}

static json_t *seals_json(const struct seals *seals)
{
	json_t *list = json_array();

	for (int i = 0; i < seals->members.n; i++)
		json_array_append_new(list, vouch_json(&seals->vouches[i]));
	return list;
}

/* Fails if someone was to be named who vouches for it, and nobody does. */
static void seals_judge(struct seals *seals)
{
	for (int i = 0; i < seals->members.n && seals->trust.signers.path; i++)
		if (!seals->vouches[i].vouched || seals->vouches[i].bad)
			vouch_fail(&seals->vouches[i], &seals->trust);
}

static void seals_free(struct seals *seals)
{
	for (int i = 0; i < seals->members.n; i++)
		vouch_free(&seals->vouches[i]);
	free(seals->vouches);
	members_free(&seals->members);
	trust_free(&seals->trust);
}

int main(int argc, char **argv)
{
	struct incise_verify_report report;
	struct seals seals;
	struct sink sink = {0};
	struct incise_verify_watch watch = {found, progress, &sink};
	unsigned long long lost = 0;
	struct job job = {0};

	cli_parse(&command, argc, argv, &job);
	if (optind == argc)
		cli_usage("missing NAME.rec (recording to check)");
	if (optind + 1 < argc)
		cli_usage("unexpected argument '%s'; give one NAME.rec at a time",
			  argv[optind + 1]);
	if ((job.trust.ca || job.trust.revoked) && !job.trust.signers)
		cli_usage("--%s goes with --signers FILE",
			  job.trust.ca ? "ca" : "revoked");
	sink.path = file_operand(argv[optind], FILE_RECORDING);
	trust_read(&seals.trust, &job.trust);
	sink.list = job.json ? json_array() : NULL;
	cli_catch_signals();
	seals_check(&seals, sink.path, &watch, &report);
	cli_progress_end();
	for (int i = 0; i < report.n_streams; i++)
		lost += report.streams[i].lost;
	if (job.json)
		print_json(&report, &sink, seals_json(&seals));
	else
		print_table(&report, sink.path);
	for (int i = 0; i < seals.members.n && !job.json; i++)
		vouch_print(&seals.vouches[i], &seals.trust);
	cli_finish();
	if (report.complete) {
		seals_judge(&seals);
		seals_free(&seals);
		return 0;
	}
	if (report.unverified)
		cli_fail("%s: not all of it could be verified; %llu samples missing, "
			 "findings: %llu",
			 sink.path, lost, (unsigned long long)report.findings);
	if (!report.intact)
		cli_fail("%s: not as it was recorded: %llu samples missing, findings: "
			 "%llu; copy it before you do anything else with it",
			 sink.path, lost, (unsigned long long)report.findings);
	if (report.interrupted)
		cli_fail("%s: interrupted: its end is missing; the committed part is as "
			 "it was written, %llu samples were lost",
			 sink.path, lost);
	if (sink.times && !lost)
		cli_fail("%s: %llu rows of the tracker have an unreliable time; the "
			 "rest is as it was written",
			 sink.path, (unsigned long long)sink.times);
	if (!lost)
		cli_fail("%s: a device was disconnected before the end; the rest is as "
			 "it was written",
			 sink.path);
	cli_fail("%s: %llu samples were lost during the capture; the rest is as it was "
		 "written",
		 sink.path, lost);
}
