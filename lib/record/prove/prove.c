// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Proof of a recording; see incise/prove.h.
 */
#include <ctype.h>
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../base/control_character.h"
#include "../read/database.h"
#include "../read/session.h"
#include "../verify/verify.h"
#include "prove.h"

struct prove {
	const char *path; /* as it was given */
	const struct incise_prove_options *options;
	struct incise_proof *proof;
	char *join; /* the statement of the join as it is now; NULL: it is a plain recording */
	struct incise_verify_watch
		watch; /* ours, which passes on to that of the options */
	bool verified; /* all findings are known */
	struct incise_proof_statement *statement; /* that is compared; NULL: none */
	struct incise_signers signers;
	struct x509_store_st *authorities; /* NULL: none */
	struct incise_error *err;
};

static int fail_memory(const struct prove *prove)
{
	return incise_error_set(prove->err, ENOMEM, "out of memory for a proof");
}

/* --- statements ------------------------------------------------------------------------- */

static void keep_difference(struct incise_proof_statement *s, const char *text)
{
	char *copy = s->n_differences < INCISE_PROOF_DIFFERENCES ? strdup(text) : NULL;

	if (!copy)
		return;
	control_characters_hide(copy);
	s->differences[s->n_differences++] = copy;
}

/* Keep what differs from a statement, and the first finding that is no loss, which was counted. */
static void take_finding(void *user, const struct incise_verify_finding *finding)
{
	const struct prove *prove = user;
	const struct incise_verify_watch *watch = prove->options->watch;
	char *altered = prove->proof->altered;
	/* Programs read rows that agree with their ledger; a statement may be of another state. */
	bool seal_counts = !prove->statement &&
			   prove->options->level != INCISE_PROVE_TABLES &&
			   prove->options->level != INCISE_PROVE_ROWS;

	if (watch && watch->found && !prove->verified)
		watch->found(watch->user, finding);
	if (prove->statement && finding->kind == INCISE_VERIFY_SEAL)
		keep_difference(prove->statement, finding->text);
	if (!*altered && finding->kind != INCISE_VERIFY_LOST &&
	    finding->kind != INCISE_VERIFY_INTERRUPTED &&
	    finding->kind != INCISE_VERIFY_ENDED &&
	    finding->kind != INCISE_VERIFY_TIMES &&
	    (seal_counts || finding->kind != INCISE_VERIFY_SEAL))
		snprintf(altered, sizeof(prove->proof->altered), "%s", finding->text);
}

static int pass_progress(void *user, double share)
{
	const struct incise_verify_watch *watch =
		((const struct prove *)user)->options->watch;

	return watch && watch->progress ? watch->progress(watch->user, share) : 0;
}

/* A finding of ours about a statement. */
static void report_difference(struct prove *prove, const char *fmt, ...)
	INCISE_PRINTF(2, 3);
static void report_difference(struct prove *prove, const char *fmt, ...)
{
	char text[600];
	struct incise_verify_finding finding = incise_verify_finding(INCISE_VERIFY_SEAL);
	va_list args;

	va_start(args, fmt);
	vsnprintf(text, sizeof(text), fmt, args);
	va_end(args);
	finding.count = 1;
	finding.text = text;
	take_finding(prove, &finding);
}

/* The line behind this one; "" behind the last, which may end without a newline in a forgery. */
static const char *next_prove_line(const char *line)
{
	line = strchrnul(line, '\n');
	return line + (*line != 0);
}

/* SHA-256 of the last calibration of a list, which is the active one; "": that of the capture. */
static void find_active(const char *list, char sha256[65])
{
	*sha256 = 0;
	for (const char *line = list; *line; line = next_prove_line(line))
		if (sscanf(line, "calibration %*s %64[0-9a-f]", sha256) != 1)
			*sha256 = 0;
}

/* Whether the recording is read by the calibration of the statement; it is a finding if not. */
static bool compare_calibration(const char *now, const char *then, struct prove *prove)
{
	bool kept = !strncmp(now, then, strlen(then)), known;
	char read_by[65], signed_as[65], name[200] = "";

	for (const char *line = now; *line; line = next_prove_line(line))
		sscanf(line, "calibration %199s", name);
	find_active(now, read_by);
	find_active(then, signed_as);
	known = kept && !strcmp(read_by, signed_as);
	if (!kept)
		report_difference(prove,
				  "calibrations that are in the statement were removed "
				  "or changed");
	else if (!known)
		report_difference(
			prove, "%s, by which it is read, is not in the statement", name);
	return known;
}

/* The name is that of the cuts in what is exported. A member's is in the statement of the join. */
static bool compare_name(const char *now, const char *name, bool member,
			 struct prove *prove)
{
	const char *then = name;
	bool same;

	/* A statement has '?' for characters that are not printed. */
	for (; *now && (*now == *then || (*then == '?' && iscntrl((unsigned char)*now)));
	     now++)
		then++;
	same = member || *now == *then;
	if (!same)
		report_difference(
			prove,
			"it was signed under the name %s; give it that name again, or "
			"sign it under this one",
			name);
	return same;
}

/* The text says all: the first line that differs does where. */
static void compare_join(struct prove *prove, const struct incise_seal_file *file)
{
	struct incise_proof_statement *s = prove->statement;
	static const char first[] = "incise statement 1 of a join\n";
	const char *then = file->content.bytes, *now = prove->join, *member = "";
	size_t n = strlen(first);

	if (!then || strncmp(then, first, n)) {
		report_difference(prove, "seal/%s: %s", file->name,
				  then ? "no statement of a join" : file->why);
		return;
	}
	s->commit = 0;
	s->complete = true;
	s->agrees = s->calibrated = s->recorded =
		file->content.n == strlen(now) && !memcmp(then, now, file->content.n);
	if (s->agrees)
		return;
	for (; *now && !strncmp(now, then, n); n = strcspn(now, "\n") + 1) {
		now += n;
		then += n;
		if (!strncmp(now, "member ", 7))
			member = now;
	}
	report_difference(prove, "%.*s: '%.*s' was signed, and is '%.*s' now",
			  (int)strcspn(member, "\n"), member, (int)strcspn(then, "\n"),
			  then, (int)strcspn(now, "\n"), now);
}

/* Calibration and name, which are no rows. Returns 0 or -errno. */
static int compare_rest(struct prove *prove, const char *path, const char *name,
			bool member, const char *calibrations)
{
	struct incise_proof_statement *s = prove->statement;
	char *now = incise_proof_calibrations(path, prove->err);
	struct incise_recording *recording =
		now ? incise_recording_open(path, prove->err) : NULL;
	int rc = recording ? 0 : -errno;

	if (!rc) {
		s->calibrated = compare_calibration(now, calibrations, prove);
		s->agrees = compare_name(incise_recording_name(recording), name, member,
					 prove) &&
			    s->calibrated && s->recorded;
	}
	incise_recording_close(recording);
	free(now);
	return rc;
}

/* The first one is compared while the recording is verified. Returns 0 or -errno. */
static int compare_recording(struct prove *prove, const char *path,
			     const struct incise_seal_file *file, bool member)
{
	struct incise_proof_statement *s = prove->statement;
	const char *text = file->content.bytes;
	size_t n = text ? incise_proof_statement_length(&file->content) : 0;
	struct incise_seal_statement statement;
	struct incise_verify_report report;
	struct incise_error err = {.text = ""};
	char why[700];
	int rc;

	if (!text || incise_seal_read(&statement, text, n, &err)) {
		snprintf(why, sizeof(why), "seal/%s: %s", file->name,
			 text ? err.text : file->why);
		keep_difference(s, why);
		return 0;
	}
	s->commit = statement.last.commit;
	s->complete = statement.complete;
	rc = incise_seal_compare(path, text, n, &prove->watch, &report, prove->err);
	if (rc)
		return rc;
	s->recorded = report.sealed;
	rc = compare_rest(prove, path, statement.name, member, text + n);
	if (!prove->verified) {
		prove->proof->report = report;
		s->reported = prove->options->watch != NULL;
	}
	prove->verified = true;
	return rc;
}

/* The last one is that of the present: the recording is verified with it. Returns 0 or -errno. */
static int compare_statements(struct prove *prove, struct incise_proof_seal *seal,
			      const struct incise_seal_files *files, bool member)
{
	int rc = 0;

	for (int i = files->n - 1; i >= 0 && !rc; i--) {
		const struct incise_seal_file *file = &files->all[i];
		struct incise_proof_statement *s = &seal->statements[seal->n_statements];

		if (file->kind != INCISE_PROOF_STATEMENT)
			continue;
		*s = (struct incise_proof_statement){.number = file->number,
						     .commit = -1};
		seal->n_statements++;
		prove->statement = s;
		if (seal->join)
			compare_join(prove, file);
		else
			rc = compare_recording(prove, seal->path, file, member);
	}
	prove->statement = NULL;
	return rc;
}

/* --- signatures and time-stamps --------------------------------------------------------- */

static int check_timestamp(const struct prove *prove,
			   struct incise_proof_voucher *voucher,
			   const struct incise_seal_file *file,
			   const struct incise_bytes *statement)
{
	uint8_t digest[INCISE_SHA256_BYTES];
	struct incise_error err = {0};

	if (incise_sha256_of(statement->bytes, statement->n, digest))
		return fail_memory(prove);
	if (incise_timestamp_read(&file->content, "not valid", digest, NULL,
				  prove->authorities, voucher, &err))
		snprintf(voucher->why, sizeof(voucher->why), "%s", err.text);
	return 0;
}

/* The earliest time at which a trusted authority saw the statement; -1: none. */
static int64_t find_time(const struct incise_proof_seal *seal, int number)
{
	int64_t t_s = -1;

	for (int i = 0; i < seal->n_vouchers; i++) {
		const struct incise_proof_voucher *v = &seal->vouchers[i];

		if (v->statement == number && v->kind == INCISE_PROOF_TIMESTAMP &&
		    v->verdict == INCISE_PROOF_GOOD && (t_s < 0 || v->t_s < t_s))
			t_s = v->t_s;
	}
	return t_s;
}

static const struct incise_seal_file *find_statement(
	const struct incise_seal_files *files, int number)
{
	for (int i = 0; i < files->n; i++)
		if (files->all[i].kind == INCISE_PROOF_STATEMENT &&
		    files->all[i].number == number)
			return &files->all[i];
	return NULL;
}

/* Returns 0 or -errno. */
static int check_voucher(const struct prove *prove, struct incise_proof_seal *seal,
			 const struct incise_seal_files *files,
			 const struct incise_seal_file *file)
{
	struct incise_proof_voucher *voucher = &seal->vouchers[seal->n_vouchers];
	const struct incise_seal_file *statement = find_statement(files, file->number);
	int rc = 0;

	*voucher = (struct incise_proof_voucher){.kind = file->kind,
						 .statement = file->number,
						 .verdict = INCISE_PROOF_BAD};
	strcpy(voucher->file, file->name);
	if (!file->content.bytes)
		strcpy(voucher->why, file->why);
	else if (!statement || !statement->content.bytes)
		strcpy(voucher->why, "its statement is missing");
	else if (file->kind == INCISE_PROOF_TIMESTAMP)
		rc = check_timestamp(prove, voucher, file, &statement->content);
	else if (prove->options->signers)
		rc = incise_signature_check(voucher, &statement->content, &file->content,
					    &prove->signers,
					    find_time(seal, file->number), prove->err);
	else
		voucher->verdict = INCISE_PROOF_UNCHECKED;
	seal->n_vouchers++;
	seal->bad += voucher->verdict == INCISE_PROOF_BAD;
	return rc;
}

/* Time-stamps first: they say when a key had to be valid. Returns 0 or -errno. */
static int check_vouchers(const struct prove *prove, struct incise_proof_seal *seal,
			  const struct incise_seal_files *files)
{
	int rc = 0;

	for (int kind = INCISE_PROOF_TIMESTAMP; kind >= INCISE_PROOF_SIGNATURE; kind--)
		for (int i = 0; i < files->n && !rc; i++)
			if ((int)files->all[i].kind == kind)
				rc = check_voucher(prove, seal, files, &files->all[i]);
	return rc;
}

/* Statements are newest first. An older state that was signed, too, does not replace a newer one. */
static void judge_seal(struct incise_proof_seal *seal)
{
	bool newest = true;

	for (int i = 0; i < seal->n_statements; i++) {
		struct incise_proof_statement *s = &seal->statements[i];

		for (int k = 0; k < seal->n_vouchers; k++)
			s->vouched |= seal->vouchers[k].statement == s->number &&
				      seal->vouchers[k].kind == INCISE_PROOF_SIGNATURE &&
				      seal->vouchers[k].verdict == INCISE_PROOF_GOOD;
		seal->vouched |= newest && s->agrees && s->vouched;
		newest &= !s->vouched;
		seal->bad += s->commit < 0;
	}
}

/* --- the recording ---------------------------------------------------------------------- */

/* Identity and last head, as its tables have them, or the reason without its name. 0 or -errno. */
static int read_head(struct incise_proof_seal *seal, struct incise_error *err)
{
	struct incise_recording *recording = incise_recording_open(seal->path, err);
	size_t name = strlen(seal->path);
	int rc = recording ? incise_seal_head(recording, seal->identity, &seal->head, err)
			   : -errno;

	incise_recording_close(recording);
	if (!rc)
		return 0;
	*seal->identity = 0;
	snprintf(seal->why, sizeof(seal->why), "%.199s",
		 !strncmp(err->text, seal->path, name) &&
				 !strncmp(err->text + name, ": ", 2)
			 ? err->text + name + 2
			 : err->text);
	return rc == -ENODATA ? 0 : rc;
}

static int check_seal(struct prove *prove, struct incise_proof_seal *seal,
		      const struct incise_seal_files *files, bool member)
{
	const struct incise_prove_options *options = prove->options;
	struct incise_error err = {.text = ""};
	int rc = seal->join ? 0 : read_head(seal, &err);

	/* A recording that cannot be read is a finding of its verification. */
	if (rc && options->level == INCISE_PROVE_SEALS) {
		*prove->err = err;
		return rc;
	}
	rc = options->signers ? compare_statements(prove, seal, files, member) : 0;
	if (!rc && options->level == INCISE_PROVE_ALL && !prove->verified)
		rc = incise_verify(prove->path, &prove->watch, &prove->proof->report,
				   prove->err);
	prove->verified = true;
	if (!rc)
		rc = check_vouchers(prove, seal, files);
	judge_seal(seal);
	return rc;
}

static int prove_seal(struct prove *prove, struct incise_proof_seal *seal, bool member)
{
	const struct incise_prove_options *options = prove->options;
	struct incise_seal_files files;
	int rc = incise_seal_files_read(&files, seal->path, "seal", prove->err);

	/* A statement, a signature and a time-stamp may be made. */
	seal->statements = calloc((size_t)files.n + 1, sizeof(*seal->statements));
	seal->vouchers = calloc((size_t)files.n + 2, sizeof(*seal->vouchers));
	for (int i = 0; i < files.n; i++) {
		seal->signatures += files.all[i].kind == INCISE_PROOF_SIGNATURE;
		seal->timestamps += files.all[i].kind == INCISE_PROOF_TIMESTAMP;
	}
	if (!rc && (!seal->statements || !seal->vouchers))
		rc = fail_memory(prove);
	if (!rc)
		rc = options->key || options->timestamp
			     ? incise_proof_sign(seal, &files,
						 seal->join ? prove->join : NULL, member,
						 options, &prove->watch,
						 prove->proof->altered, prove->err)
			     : check_seal(prove, seal, &files, member);
	incise_seal_files_free(&files);
	return rc;
}

char *incise_proof_folder(const char *path, struct incise_error *err)
{
	const char *slash = strrchr(path, '/'),
		   *colon = strrchr(slash ? slash : path, ':');
	char *folder = incise_recording_folder(path, colon ? NULL : err), *whole;

	if (folder || !colon)
		return folder;
	whole = strndup(path, (size_t)(colon - path));
	if (!whole)
		incise_error_set(err, ENOMEM, "%s: out of memory", path);
	folder = whole ? incise_recording_folder(whole, err) : NULL;
	free(whole);
	return folder;
}

/* A seal for each member, and the last one for the recording. Returns 0 or -errno. */
static int find_seals(struct prove *prove)
{
	struct incise_proof *proof = prove->proof;
	char *folder = incise_proof_folder(prove->path, prove->err);
	/* A recording that does not open is plain, and says why later. */
	struct incise_recording *recording =
		folder ? incise_recording_open_as(folder, INCISE_RECORDING_ACTIVE, NULL)
		       : NULL;
	const struct incise_session *session = recording ? recording->session : NULL;
	const int n = session ? session->n : 0;
	int rc = folder ? 0 : -errno;

	if (folder && strlen(folder) > PATH_MAX - 200)
		rc = incise_error_set(prove->err, ENAMETOOLONG, "%.100s…: %s", folder,
				      strerror(ENAMETOOLONG));
	proof->seals = calloc((size_t)n + 1, sizeof(*proof->seals));
	if (!rc && !proof->seals)
		rc = fail_memory(prove);
	for (int i = 0; i < n && !rc; i++, proof->n++)
		if (asprintf(&proof->seals[i].path, "%s/%s", folder,
			     session->info[i].name) < 0)
			rc = fail_memory(prove);
	if (!rc) {
		proof->seals[proof->n++] = (struct incise_proof_seal){
			.path = folder, .join = session != NULL};
		folder = NULL;
	}
	if (!rc && session) {
		prove->join = incise_session_statement(recording, prove->err);
		rc = prove->join ? 0 : -errno;
	}
	incise_recording_close(recording);
	free(folder);
	return rc;
}

/* Returns 0 or -errno. */
static int read_trust(struct prove *prove)
{
	const struct incise_prove_options *options = prove->options;
	int rc = options->signers ? incise_signers_read(&prove->signers, options->signers,
							options->revoked, prove->err)
				  : 0;

	if (!rc && options->authorities) {
		prove->authorities =
			incise_authorities_read(options->authorities, prove->err);
		rc = prove->authorities ? 0 : -errno;
	}
	return rc;
}

int incise_prove(const char *path, const struct incise_prove_options *options,
		 struct incise_proof *proof, struct incise_error *err)
{
	struct incise_error none = {0};
	struct prove prove = {.path = path,
			      .options = options,
			      .proof = proof,
			      .watch = {take_finding, pass_progress, &prove},
			      .err = err ? err : &none};
	int rc;

	*proof = (struct incise_proof){.n = 0};
	if (options->level == INCISE_PROVE_TABLES || options->level == INCISE_PROVE_ROWS)
		return incise_verify_level(path,
					   options->level == INCISE_PROVE_ROWS
						   ? INCISE_VERIFY_ROWS
						   : INCISE_VERIFY_TABLES,
					   &prove.watch, &proof->report, err);
	rc = read_trust(&prove);
	if (!rc)
		rc = find_seals(&prove);
	if (!rc && prove.join && options->level == INCISE_PROVE_ALL)
		rc = incise_verify(path, &prove.watch, &proof->report, err);
	prove.verified = prove.join;
	for (int i = 0; i < proof->n && !rc; i++)
		rc = prove_seal(&prove, &proof->seals[i], i < proof->n - 1);
	incise_signers_free(&prove.signers);
	incise_authorities_free(prove.authorities);
	free(prove.join);
	return rc;
}

void incise_proof_free(struct incise_proof *proof)
{
	for (int i = 0; i < proof->n; i++) {
		struct incise_proof_seal *seal = &proof->seals[i];

		for (int k = 0; k < seal->n_statements; k++)
			for (int d = 0; d < seal->statements[k].n_differences; d++)
				free(seal->statements[k].differences[d]);
		free(seal->statements);
		free(seal->vouchers);
		free(seal->path);
	}
	free(proof->seals);
	*proof = (struct incise_proof){.n = 0};
}
