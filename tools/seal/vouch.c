// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Signers and authorities that vouch for a recording; see vouch.h.
 *
 *   statement ── compared with ── recording
 *       └─ signature ── its key ── file of signers, at the time of a time-stamp that is trusted, else now
 *       └─ time-stamp ── its certificate ── file of authorities
 */
#include <ctype.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/recording.h>
#include "../cli/cli.h"
#include "../cli/control_character.h"
#include "../cli/json.h"
#include "vouch.h"

void trust_read(struct trust *trust, const struct trust_files *files)
{
	struct incise_error err = {0};

	*trust = (struct trust){0};
	if (files->signers &&
	    signers_read(&trust->signers, files->signers, files->revoked, &err))
		cli_fail_with(&err);
	if (files->ca)
		trust->authorities = cli_require(authorities_read(files->ca, &err), &err);
}

void trust_free(struct trust *trust)
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

static void found(void *user, const struct incise_verify_finding *finding)
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

static int progress(void *user, double share)
{
	const struct comparison *comparison = user;

	if (comparison->watch)
		return comparison->watch->progress(comparison->watch->user, share);
	return cli_stop;
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
	found((void *)(uintptr_t)comparison, &finding);
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
	const struct incise_verify_watch own = {found, progress, &comparison};
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
static void judge(struct vouch *vouch)
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

void vouch_check(struct vouch *vouch, const char *recording, bool member,
		 const struct trust *trust, const struct incise_verify_watch *watch,
		 struct incise_verify_report *report)
{
	struct incise_error err = {0};
	struct seal_files files;
	bool verified = !report;

	*vouch = (struct vouch){.recording = seal_recording(recording), .member = member};
	vouch->join = seal_join(vouch->recording);
	if (seal_files_read(&files, vouch->recording, &err))
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
	judge(vouch);
	seal_files_free(&files);
}

void vouch_free(struct vouch *vouch)
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

void vouch_print(const struct vouch *vouch, const struct trust *trust)
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
		printf("%s: %d signature%s and %d time-stamp%s, not checked: give "
		       "--signers FILE\n",
		       vouch->recording, kinds[0], cli_s(kinds[0]), kinds[1],
		       cli_s(kinds[1]));
}

static json_t *text_or_null(const char *text)
{
	return *text ? json_text(text) : json_null();
}

json_t *vouch_json(const struct vouch *vouch)
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
				  text_or_null(line->why));

		json_object_set_new(object, stamp ? "utc" : "signer",
				    text_or_null(stamp ? line->timestamp.utc
						       : line->signature.signer));
		json_object_set_new(object, stamp ? "authority" : "key",
				    text_or_null(stamp ? line->timestamp.authority
						       : line->signature.key));
		json_array_append_new(lines[stamp], object);
	}
	return json_pack("{so sb so so so}", "path", json_text(vouch->recording),
			 "vouched", vouch->vouched, "statements", statements,
			 "signatures", lines[0], "timestamps", lines[1]);
}

void vouch_fail(const struct vouch *vouch, const struct trust *trust)
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
		cli_fail("%s: not signed: %s", vouch->recording,
			 seal_head(vouch->recording, identity, &head, why)
				 ? "'incise sign' signs it"
				 : why);
	cli_fail("%s: nobody in %s signed what it is now", vouch->recording,
		 trust->signers.path);
}
