// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The statement of a recording, made of its rows; see incise/seal.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "../frames.h"
#include "../schema.h"
#include "seal_walk.h"

/* --- making --------------------------------------------------------------------------- */

/* A text for one line. */
static void set_line(char *to, size_t size, const char *text)
{
	snprintf(to, size, "%s", text);
	for (char *c = to; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '?';
}

/* Text of a key of table meta, "" if it has none. Returns 0 or -errno. */
static int read_key(struct incise_recording *recording, const char *key, char *to,
		    size_t size, struct incise_error *err)
{
	sqlite3_stmt *stmt;
	const char *text;

	*to = 0;
	if (sqlite3_prepare_v2(recording->db, "SELECT value FROM meta WHERE key = ?", -1,
			       &stmt, NULL) != SQLITE_OK)
		return incise_schema_fail(recording->db, recording->path, err);
	sqlite3_bind_text(stmt, 1, key, -1, SQLITE_STATIC);
	if (sqlite3_step(stmt) == SQLITE_ROW &&
	    sqlite3_column_type(stmt, 0) == SQLITE_TEXT) {
		text = (const char *)sqlite3_column_text(stmt, 0);
		set_line(to, size, text ? text : "");
	}
	return sqlite3_finalize(stmt) == SQLITE_OK
		       ? 0
		       : incise_schema_fail(recording->db, recording->path, err);
}

static int read_identity(struct incise_recording *recording, char identity[33],
			 struct incise_error *err)
{
	int rc = read_key(recording, "identity", identity, 33, err);

	/* A text of any other form is none, and so are all zeros. */
	if (!rc && !incise_statement_hex(identity, 32))
		memset(identity, '0', 32);
	identity[32] = 0;
	return rc;
}

int incise_seal_possible(const struct incise_recording *recording,
			 struct incise_error *err)
{
	/* The path of a session ends with the choice of its streams. */
	const char *choice = strrchr(recording->path, ':');
	const int n = (int)(choice ? choice - recording->path
				   : (ptrdiff_t)strlen(recording->path));

	if (recording->session)
		return incise_error_set(err, ENOTSUP,
					"%.*s: is a joined recording; each of its "
					"members has its own seal: give one, %.*s/NAME",
					n, recording->path, n, recording->path);
	if (recording->form < 4)
		return incise_error_set(
			err, ENODATA,
			"%s: made by an older incise (format %d), it has no seal",
			recording->path, recording->form);
	return 0;
}

/* Head and length of camera.mkv. */
static int make_file_part(struct incise_recording *recording, uint64_t *bytes,
			  uint8_t digest[INCISE_SEAL_BYTES], struct incise_error *err)
{
	struct stat st = {0};
	char *path;
	int fd, rc;

	*bytes = 0;
	memset(digest, 0, INCISE_SEAL_BYTES);
	if (asprintf(&path, "%s/" INCISE_FRAMES_FILE, recording->path) < 0)
		return incise_error_set(err, ENOMEM, "%s: out of memory",
					recording->path);
	fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
	free(path);
	if (fd < 0)
		return 0; /* without a camera */
	rc = fstat(fd, &st) ? -errno : 0;
	/* Before the end frames are ahead of their rows. */
	if (recording->meta.complete)
		*bytes = st.st_size;
	if (!rc)
		rc = incise_seal_file(fd, *bytes, digest);
	close(fd);
	return rc ? incise_error_set(err, -rc, "%s/" INCISE_FRAMES_FILE ": %s",
				     recording->path, strerror(-rc))
		  : 0;
}

static int make_parts(struct incise_seal_statement *statement,
		      struct incise_recording *recording, const struct incise_seal *seal,
		      struct incise_error *err)
{
	for (int i = 0; i < INCISE_SEAL_PARTS; i++) {
		struct incise_seal_part *part = &statement->parts[i];
		uint8_t digest[INCISE_SEAL_BYTES];
		int rc = 0;

		snprintf(part->name, sizeof(part->name), "%s", incise_seal_parts[i]);
		if (i >= INCISE_SEAL_STREAM && i < INCISE_SEAL_DEPTH)
			continue;
		if (i == INCISE_SEAL_FILE)
			rc = make_file_part(recording, &part->rows, digest, err);
		else if (incise_seal_table(seal, recording->db, i, &part->rows, digest))
			rc = incise_schema_fail(recording->db, recording->path, err);
		if (rc)
			return rc;
		incise_sha256_hex(digest, part->digest);
	}
	return 0;
}

/* The streams until here, and the head. */
static void take_commit(struct incise_seal_statement *statement,
			const struct incise_seal_walk *walk)
{
	const struct incise_seal *seal = &walk->seal;

	statement->last.commit = walk->number;
	statement->last.t_ns = walk->t_ns;
	incise_sha256_hex(seal->head, statement->last.head);
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
		statement->parts[INCISE_SEAL_STREAM + i].rows = seal->n_rows[i];
		incise_sha256_hex(seal->chain[i],
				  statement->parts[INCISE_SEAL_STREAM + i].digest);
	}
}

int incise_statement_make(struct incise_seal_statement *statement,
			  struct incise_recording *recording,
			  const struct incise_seal_digests *known, int64_t upto,
			  int (*step)(void *user, struct incise_seal_walk *walk),
			  void *user, struct incise_error *err)
{
	struct incise_seal_walk walk;
	int rc, at = 0;

	*statement = (struct incise_seal_statement){.complete = recording->meta.complete,
						    .last = {.commit = -1}};
	rc = incise_seal_walk_open(&walk, recording, known, err);
	if (upto < 0)
		upto = walk.last;
	if (!rc && upto < 0)
		rc = incise_error_set(err, ENODATA, "%s: its seal has no commit",
				      recording->path);
	if (!rc)
		rc = read_identity(recording, statement->identity, err);
	if (!rc)
		rc = read_key(recording, "incise", statement->software,
			      sizeof(statement->software), err);
	if (!rc)
		rc = read_key(recording, "host", statement->host, sizeof(statement->host),
			      err);
	if (!rc)
		rc = read_key(recording, "started", statement->started,
			      sizeof(statement->started), err);
	set_line(statement->name, sizeof(statement->name), recording->name);
	statement->n_earlier =
		upto < INCISE_STATEMENT_EARLIER ? upto : INCISE_STATEMENT_EARLIER;
	for (int i = 0; i < statement->n_earlier; i++)
		statement->earlier[i].commit =
			incise_statement_earlier(i, statement->n_earlier, upto);
	while (!rc && (rc = incise_seal_walk_next(&walk, err)) > 0) {
		struct incise_seal_head *earlier = &statement->earlier[at];

		if (walk.number <= upto)
			take_commit(statement, &walk);
		if (at < statement->n_earlier && earlier->commit == walk.number) {
			earlier->t_ns = walk.t_ns;
			memcpy(earlier->head, statement->last.head,
			       sizeof(earlier->head));
		}
		/* A table that was forged may leave out numbers. */
		while (at < statement->n_earlier &&
		       statement->earlier[at].commit <= walk.number)
			at++;
		rc = step ? step(user, &walk) : 0;
	}
	if (!rc)
		rc = make_parts(statement, recording, &walk.seal, err);
	incise_seal_walk_close(&walk);
	return rc;
}

/* --- interface ------------------------------------------------------------------------ */

static int check_step(void *user, struct incise_seal_walk *walk)
{
	bool *good = user;

	*good &= walk->good;
	return 0;
}

static size_t make_text(struct incise_recording *recording,
			char text[INCISE_STATEMENT_MAX], struct incise_error *err)
{
	struct incise_seal_statement statement;
	bool good = true;
	int rc = incise_seal_possible(recording, err);
	size_t n = 0;

	if (!rc)
		rc = incise_statement_make(&statement, recording, NULL, -1, check_step,
					   &good, err);
	if (!rc && !good)
		rc = incise_error_set(err, EBADMSG,
				      "%s: differs from its own seal; `incise verify` "
				      "lists where",
				      recording->path);
	if (!rc) {
		n = incise_statement_write(&statement, text);
		if (!n)
			rc = incise_error_set(err, EINVAL, "%s: damaged: table meta",
					      recording->path);
	}
	errno = -rc;
	return n;
}

char *incise_seal_statement(const char *path, struct incise_error *err)
{
	struct incise_recording *recording = incise_recording_open_original(path, err);
	char text[INCISE_STATEMENT_MAX], *copy;
	size_t n;
	int code;

	if (!recording)
		return NULL;
	n = make_text(recording, text, err);
	code = errno;
	incise_recording_close(recording);
	errno = code;
	copy = n ? strndup(text, n) : NULL;
	if (n && !copy)
		incise_error_set(err, ENOMEM, "%s: out of memory", path);
	return copy;
}

int incise_seal_head(struct incise_recording *recording, char identity[33],
		     struct incise_seal_head *head, struct incise_error *err)
{
	sqlite3_stmt *stmt = NULL;
	int rc = incise_seal_possible(recording, err);
	bool has = false;

	if (!rc)
		rc = read_identity(recording, identity, err);
	if (rc)
		return rc;
	if (sqlite3_prepare_v2(recording->db,
			       "SELECT number, t_ns, head FROM seal "
			       "ORDER BY number DESC LIMIT 1",
			       -1, &stmt, NULL) == SQLITE_OK &&
	    sqlite3_step(stmt) == SQLITE_ROW) {
		head->commit = sqlite3_column_int64(stmt, 0);
		head->t_ns = sqlite3_column_int64(stmt, 1);
		has = sqlite3_column_type(stmt, 2) == SQLITE_BLOB &&
		      sqlite3_column_bytes(stmt, 2) == INCISE_SEAL_BYTES;
		if (has)
			incise_sha256_hex(sqlite3_column_blob(stmt, 2), head->head);
	}
	if (sqlite3_finalize(stmt) != SQLITE_OK)
		return incise_schema_fail(recording->db, recording->path, err);
	return has ? 0
		   : incise_error_set(err, ENODATA, "%s: has no sealed commit",
				      recording->path);
}

bool incise_seal_before(struct incise_recording *recording, const char *head)
{
	sqlite3_stmt *stmt = NULL;
	bool is = false;

	if (sqlite3_prepare_v2(recording->db,
			       "SELECT instr(value, ', head ' || ?) FROM meta WHERE key "
			       "= 'converted_from'",
			       -1, &stmt, NULL) == SQLITE_OK &&
	    sqlite3_bind_text(stmt, 1, head, -1, SQLITE_STATIC) == SQLITE_OK &&
	    sqlite3_step(stmt) == SQLITE_ROW)
		is = sqlite3_column_int(stmt, 0) > 0;
	sqlite3_finalize(stmt);
	return is;
}
