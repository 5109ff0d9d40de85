// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A statement of a recording as it is, a signature and a time-stamp of it; see prove.h.
 */
#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/infile.h>
#include <incise/outfile.h>
#include "../read/database.h"
#include "../read/recording.h"
#include "prove.h"

#define NUMBER_MAX 9999
#define FINGERPRINT_CHARACTERS 16

struct signing {
	struct incise_proof_seal *seal;
	const struct incise_prove_options *options;
	const struct incise_verify_watch *watch; /* which sets altered */
	const char *altered;
	struct incise_bytes text; /* of the statement */
	bool stored;		  /* it is in seal/ already */
	struct incise_error *err;
};

/* --- the statement ---------------------------------------------------------------------- */

static int check_rows(const struct signing *s)
{
	const char *path = s->seal->path;
	struct incise_verify_report report;
	int rc = incise_seal_compare(path, s->text.bytes,
				     incise_proof_statement_length(&s->text), s->watch,
				     &report, s->err);

	if (rc || (report.intact && report.sealed))
		return rc;
	return incise_error_set(s->err, EBADMSG,
				"%s: not as it was recorded: %s; it is not signed", path,
				*s->altered ? s->altered : "see incise verify");
}

/* Statement and calibrations of a recording. Returns 0 or -errno. */
static int make_text(struct signing *s, struct incise_proof_statement *statement)
{
	const char *path = s->seal->path;
	char *text = incise_seal_statement(path, s->err), *calibrations = NULL;
	struct incise_seal_statement read;
	int rc = text ? 0 : -errno, n;

	if (!rc) {
		calibrations = incise_proof_calibrations(path, s->err);
		rc = calibrations ? 0 : -errno;
	}
	if (!rc) {
		n = asprintf(&s->text.bytes, "%s%s", text, calibrations);
		if (n < 0)
			rc = incise_error_set(s->err, ENOMEM, "%s: out of memory", path);
		else
			s->text.n = (size_t)n;
	}
	if (!rc && s->text.n > INCISE_SEAL_STATEMENT_MAX)
		rc = incise_error_set(s->err, E2BIG, "%s: too many calibrations to sign",
				      path);
	if (!rc)
		rc = incise_seal_read(&read, text, strlen(text), s->err);
	if (!rc) {
		statement->commit = read.last.commit;
		statement->complete = read.complete;
	}
	free(text);
	free(calibrations);
	return rc;
}

/* Its number is that of a stored statement that says the same. Returns 0 or -errno. */
static int find_stored(struct signing *s, const struct incise_seal_files *files,
		       struct incise_proof_statement *statement)
{
	statement->number = 1;
	for (int i = 0; i < files->n && !s->stored; i++) {
		const struct incise_seal_file *file = &files->all[i];

		s->stored = file->kind == INCISE_PROOF_STATEMENT && file->content.bytes &&
			    file->content.n == s->text.n &&
			    !memcmp(file->content.bytes, s->text.bytes, s->text.n);
		if (s->stored)
			statement->number = file->number;
		else if (file->number >= statement->number)
			statement->number = file->number + 1;
	}
	return statement->number > NUMBER_MAX
		       ? incise_error_set(s->err, E2BIG, "%s/seal: too many statements",
					  s->seal->path)
		       : 0;
}

/* Returns 0 or -errno. */
static int make_statement(struct signing *s, const struct incise_seal_files *files,
			  const char *join)
{
	struct incise_proof_seal *seal = s->seal;
	struct incise_proof_statement *statement =
		&seal->statements[seal->n_statements++];
	int rc = 0;

	*statement = (struct incise_proof_statement){
		.complete = true, .recorded = true, .calibrated = true, .agrees = true};
	/* A .part that a recorder still writes has a lock on its folder. */
	if (incise_recording_is_written(seal->path))
		rc = incise_error_set(s->err, EBUSY,
				      "%s: another incise capture is writing it; sign it "
				      "when that has ended",
				      seal->path);
	if (!rc && join) {
		s->text = (struct incise_bytes){strdup(join), strlen(join)};
		if (!s->text.bytes)
			rc = incise_error_set(s->err, ENOMEM, "%s: out of memory",
					      seal->path);
	} else if (!rc) {
		rc = make_text(s, statement);
	}
	if (!rc)
		rc = find_stored(s, files, statement);
	return rc || s->options->recorded || join ? rc : check_rows(s);
}

/* --- writing ---------------------------------------------------------------------------- */

/* Write a file into seal/, which is made if it is not there. Links are not followed. 0 or -errno. */
static int write_file(const char *recording, const char *name,
		      const struct incise_bytes *content, struct incise_error *err)
{
	char folder[PATH_MAX], path[PATH_MAX + 100];
	struct incise_outfile *file;
	struct stat st;

	snprintf(folder, sizeof(folder), "%s/seal", recording);
	snprintf(path, sizeof(path), "%s/%s", folder, name);
	if (mkdir(folder, 0777) && errno != EEXIST)
		return incise_error_set(err, errno, "%s: %s", folder, strerror(errno));
	if (lstat(folder, &st) || !S_ISDIR(st.st_mode))
		return incise_error_set(err, ENOTDIR, "%s: not a folder; remove it",
					folder);
	if (!lstat(path, &st) && !S_ISREG(st.st_mode))
		return incise_error_set(err, EEXIST, "%s: not a regular file; remove it",
					path);
	file = incise_outfile_open(path, err);
	if (!file)
		return -errno;
	fwrite(content->bytes, 1, content->n, incise_outfile_stream(file));
	return incise_outfile_commit(file, err);
}

/* Returns 0, or -ECANCELED: the caller does not want this file. */
static int announce_file(const struct signing *s, const char *name)
{
	char path[PATH_MAX];

	snprintf(path, sizeof(path), "%s/seal/%s", s->seal->path, name);
	return s->options->write && s->options->write(s->options->user, path)
		       ? incise_error_set(s->err, ECANCELED, "%s: not written", path)
		       : 0;
}

/* Write the statement if it is not stored, and then a file of it; @name NULL: the statement alone. */
static int store_file(struct signing *s, const char *name,
		      const struct incise_bytes *content)
{
	const char *path = s->seal->path;
	char statement[40];
	int rc;

	sprintf(statement, "%d.statement", s->seal->statements->number);
	rc = s->stored ? 0 : announce_file(s, statement);
	if (!rc && name)
		rc = announce_file(s, name);
	if (!rc && !s->stored)
		rc = write_file(path, statement, &s->text, s->err);
	if (rc)
		return rc;
	s->stored = true;
	return name ? write_file(path, name, content, s->err) : 0;
}

/* The next voucher; it counts once it is good. */
static struct incise_proof_voucher *start_voucher(const struct signing *s,
						  enum incise_proof_kind kind)
{
	struct incise_proof_voucher *voucher = &s->seal->vouchers[s->seal->n_vouchers];

	*voucher = (struct incise_proof_voucher){
		.kind = kind, .statement = s->seal->statements->number, .made = true};
	return voucher;
}

/* --- signature -------------------------------------------------------------------------- */

/* "1.EGZJ73vrWy7tv62x.sig", of the fingerprint. */
static void name_signature(struct incise_proof_voucher *voucher)
{
	char word[FINGERPRINT_CHARACTERS + 1] = "key";
	const char *fingerprint = strchr(voucher->key, ':');

	if (fingerprint)
		snprintf(word, sizeof(word), "%s", fingerprint + 1);
	for (char *c = word; *c; c++)
		*c = *c == '/' ? '_' : isalnum((unsigned char)*c) ? *c : '-';
	sprintf(voucher->file, "%d.%s.sig", voucher->statement, word);
}

/* @member: of a joined recording; one that the same key has signed keeps that signature. */
static int sign_statement(struct signing *s, bool member)
{
	struct incise_proof_voucher *voucher = start_voucher(s, INCISE_PROOF_SIGNATURE);
	const char *key = s->options->key;
	struct incise_bytes bytes = {0};
	char path[PATH_MAX];
	int rc = incise_signature_make(key, &s->text, &bytes, s->err);

	if (!rc)
		rc = incise_signature_check(voucher, &s->text, &bytes, NULL, -1, s->err);
	if (!rc && voucher->verdict == INCISE_PROOF_BAD)
		rc = incise_error_set(s->err, EIO,
				      "%s: ssh-keygen made a signature that it does "
				      "not accept: %s",
				      key, voucher->why);
	if (!rc) {
		name_signature(voucher);
		snprintf(path, sizeof(path), "%s/seal/%s", s->seal->path, voucher->file);
		if (!member || s->options->renew || access(path, F_OK))
			rc = store_file(s, voucher->file, &bytes);
	}
	s->seal->n_vouchers += !rc;
	free(bytes.bytes);
	return rc;
}

/* --- time-stamp ------------------------------------------------------------------------- */

static bool ends_with(const char *text, const char *end)
{
	size_t n = strlen(text), length = strlen(end);

	return n >= length && !strcmp(text + n - length, end);
}

static bool is_server(const char *text)
{
	return !strncmp(text, "http://", 7) || !strncmp(text, "https://", 8);
}

static int write_query(struct signing *s, const uint8_t query[INCISE_TIMESTAMP_QUERY])
{
	struct incise_outfile *file;
	int rc = store_file(s, NULL, NULL);

	if (rc)
		return rc;
	file = incise_outfile_open(s->options->timestamp, s->err);
	if (!file)
		return -errno;
	fwrite(query, 1, INCISE_TIMESTAMP_QUERY, incise_outfile_stream(file));
	return incise_outfile_commit(file, s->err);
}

/* "1.20261127T050000Z.tsr", of its time. */
static void name_timestamp(struct incise_proof_voucher *voucher)
{
	char *to = voucher->file + sprintf(voucher->file, "%d.", voucher->statement);

	for (const char *c = voucher->utc; *c; c++)
		if (*c != '-' && *c != ':')
			*to++ = *c;
	strcpy(to, ".tsr");
}

/* A reply from a file, or from a server that has got the query. */
static int get_reply(const struct signing *s, const uint8_t *query,
		     struct incise_bytes *reply)
{
	static const struct incise_infile_kind kind = {
		.name = "a reply of RFC 3161",
		.advice = "give the reply of a time-stamp authority",
		.size_max = INCISE_TIMESTAMP_MAX,
	};

	if (query)
		return incise_timestamp_ask(s->options->timestamp, query, reply, s->err);
	reply->bytes =
		incise_infile_read(s->options->timestamp, &kind, &reply->n, s->err);
	return reply->bytes ? 0 : -errno;
}

static int stamp_statement(struct signing *s)
{
	struct incise_proof_voucher *voucher = start_voucher(s, INCISE_PROOF_TIMESTAMP);
	const char *at = s->options->timestamp;
	uint8_t digest[INCISE_SHA256_BYTES], query[INCISE_TIMESTAMP_QUERY];
	bool asks = !ends_with(at, ".tsr");
	struct incise_bytes reply = {0};
	int rc = incise_sha256_of(s->text.bytes, s->text.n, digest);

	if (rc)
		return incise_error_set(s->err, -rc, "%s: out of memory", s->seal->path);
	if (asks)
		rc = incise_timestamp_query(digest, query, s->err);
	if (!rc && asks && !is_server(at))
		return write_query(s, query);
	if (!rc)
		rc = get_reply(s, asks ? query : NULL, &reply);
	if (!rc)
		rc = incise_timestamp_read(&reply, at, digest, asks ? query : NULL, NULL,
					   voucher, s->err);
	if (!rc) {
		name_timestamp(voucher);
		rc = store_file(s, voucher->file, &reply);
	}
	s->seal->n_vouchers += !rc;
	free(reply.bytes);
	return rc;
}

int incise_proof_sign(struct incise_proof_seal *seal,
		      const struct incise_seal_files *files, const char *join,
		      bool member, const struct incise_prove_options *options,
		      const struct incise_verify_watch *watch, const char *altered,
		      struct incise_error *err)
{
	struct signing s = {.seal = seal,
			    .options = options,
			    .watch = watch,
			    .altered = altered,
			    .err = err};
	int rc = make_statement(&s, files, join);

	if (!rc && options->key)
		rc = sign_statement(&s, member);
	/* A file is one time-stamp: of the join, whose statement names the members'. */
	if (!rc && options->timestamp && (!member || is_server(options->timestamp)))
		rc = stamp_statement(&s);
	free(s.text.bytes);
	return rc;
}
