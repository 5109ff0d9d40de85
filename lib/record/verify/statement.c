// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The statement of a recording: made of it, written, and read; see incise/seal.h. A text that is
 * read comes from outside.
 */
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "../frames.h"
#include "../schema.h"
#include "seal_walk.h"

#define TITLE "incise statement 1\n"

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

static bool is_hex(const char *text, size_t n)
{
	return strlen(text) == n && strspn(text, "0123456789abcdef") == n;
}

static int read_identity(struct incise_recording *recording, char identity[33],
			 struct incise_error *err)
{
	int rc = read_key(recording, "identity", identity, 33, err);

	/* A text of any other form is none, and so are all zeros. */
	if (!rc && !is_hex(identity, 32))
		memset(identity, '0', 32);
	identity[32] = 0;
	return rc;
}

int incise_seal_possible(const struct incise_recording *recording,
			 struct incise_error *err)
{
	if (recording->session)
		return incise_error_set(err, ENOTSUP,
					"%s: is a joined recording; each of its members "
					"has its own seal: give one, %s/NAME",
					recording->path, recording->path);
	if (recording->form < 4)
		return incise_error_set(
			err, ENODATA,
			"%s: made by an older incise (format %d), it has no seal",
			recording->path, recording->form);
	return 0;
}

/* Head and length of camera.mkv. */
static int make_file_part(struct incise_recording *recording,
			  const struct incise_seal *seal, uint64_t *bytes,
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
		rc = incise_seal_file(seal, fd, *bytes, digest);
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
			rc = make_file_part(recording, seal, &part->rows, digest, err);
		else if (incise_seal_table(seal, recording->db, i, &part->rows, digest))
			rc = incise_schema_fail(recording->db, recording->path, err);
		if (rc)
			return rc;
		incise_seal_hex(digest, part->digest);
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
	incise_seal_hex(seal->head, statement->last.head);
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++) {
		statement->parts[INCISE_SEAL_STREAM + i].rows = seal->n_rows[i];
		incise_seal_hex(seal->chain[i],
				statement->parts[INCISE_SEAL_STREAM + i].digest);
	}
}

/* The number of the commit of an earlier head. */
static int64_t earlier_commit(int i, int n, int64_t last)
{
	return n < INCISE_STATEMENT_EARLIER ? i : last / n * i + last % n * i / n;
}

int incise_statement_make(struct incise_seal_statement *statement,
			  struct incise_recording *recording, int64_t upto,
			  int (*step)(void *user, struct incise_seal_walk *walk),
			  void *user, struct incise_error *err)
{
	struct incise_seal_walk walk;
	int rc, at = 0;

	*statement = (struct incise_seal_statement){.complete = recording->meta.complete,
						    .last = {.commit = -1}};
	rc = incise_seal_walk_open(&walk, recording, err);
	if (upto < 0)
		upto = walk.last;
	if (!rc && upto < 0)
		rc = incise_error_set(err, ENODATA, "%s: has no commit", recording->path);
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
			earlier_commit(i, statement->n_earlier, upto);
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

/* --- writing -------------------------------------------------------------------------- */

struct out {
	char *text;
	size_t n;
	bool full;
};

INCISE_PRINTF(2, 3) static void print(struct out *out, const char *fmt, ...)
{
	va_list args;
	int n;

	va_start(args, fmt);
	n = vsnprintf(out->text + out->n, INCISE_STATEMENT_MAX - out->n, fmt, args);
	va_end(args);
	out->full |= n < 0 || (size_t)n >= INCISE_STATEMENT_MAX - out->n;
	if (!out->full)
		out->n += n;
}

static void print_head(struct out *out, const char *what,
		       const struct incise_seal_head *head)
{
	print(out, "%s %" PRId64 " %" PRId64 " %s\n", what, head->commit, head->t_ns,
	      head->head);
}

size_t incise_statement_write(const struct incise_seal_statement *statement,
			      char text[INCISE_STATEMENT_MAX])
{
	struct out out = {.text = text};

	print(&out, TITLE);
	print(&out, "identity %s\n", statement->identity);
	print(&out, "name %s\n", statement->name);
	print(&out, "software %s\n", statement->software);
	print(&out, "host %s\n", statement->host);
	print(&out, "started %s\n", statement->started);
	print(&out, "complete %s\n", statement->complete ? "yes" : "no");
	print_head(&out, "commit", &statement->last);
	for (int i = 0; i < INCISE_STATEMENT_PARTS; i++)
		print(&out, "part %s %" PRIu64 " %s\n", statement->parts[i].name,
		      statement->parts[i].rows, statement->parts[i].digest);
	for (int i = 0; i < statement->n_earlier; i++)
		print_head(&out, "earlier", &statement->earlier[i]);
	print(&out, "end\n");
	return out.full ? 0 : out.n;
}

/* --- reading -------------------------------------------------------------------------- */

struct in {
	const char *at, *end;
	int line;
};

/* The rest of the line behind a word and a space, to a text. */
static bool take_line(struct in *in, const char *word, char *to, size_t size)
{
	const size_t skip = strlen(word) + 1;
	const char *end = memchr(in->at, '\n', in->end - in->at);
	size_t n = end ? end - in->at : 0;

	in->line++;
	if (n < skip || memcmp(in->at, word, skip - 1) != 0 || in->at[skip - 1] != ' ' ||
	    n - skip >= size)
		return false;
	n -= skip;
	memcpy(to, in->at + skip, n);
	to[n] = 0;
	in->at = end + 1;
	for (size_t i = 0; i < n; i++)
		if ((unsigned char)to[i] < ' ' || to[i] == 0x7f)
			return false;
	return true;
}

/* "NUMBER NUMBER DIGEST" */
static bool take_head(struct in *in, const char *word, struct incise_seal_head *head)
{
	char text[120];
	int n = 0;

	return take_line(in, word, text, sizeof(text)) &&
	       sscanf(text, "%" SCNd64 " %" SCNd64 " %64[0-9a-f]%n", &head->commit,
		      &head->t_ns, head->head, &n) == 3 &&
	       n == (int)strlen(text) && head->commit >= 0 && is_hex(head->head, 64);
}

static bool take_part(struct in *in, struct incise_seal_part *part, const char *name)
{
	char text[120];
	int n = 0;

	return take_line(in, "part", text, sizeof(text)) &&
	       sscanf(text, "%15s %" SCNu64 " %64[0-9a-f]%n", part->name, &part->rows,
		      part->digest, &n) == 3 &&
	       n == (int)strlen(text) && !strcmp(part->name, name) &&
	       is_hex(part->digest, 64);
}

static bool take_all(struct in *in, struct incise_seal_statement *s)
{
	char complete[8];

	in->line = 1;
	if (in->end - in->at < (ptrdiff_t)strlen(TITLE) ||
	    memcmp(in->at, TITLE, strlen(TITLE)) != 0)
		return false;
	in->at += strlen(TITLE);
	if (!take_line(in, "identity", s->identity, sizeof(s->identity)) ||
	    !is_hex(s->identity, 32) ||
	    !take_line(in, "name", s->name, sizeof(s->name)) ||
	    !take_line(in, "software", s->software, sizeof(s->software)) ||
	    !take_line(in, "host", s->host, sizeof(s->host)) ||
	    !take_line(in, "started", s->started, sizeof(s->started)) ||
	    !take_line(in, "complete", complete, sizeof(complete)) ||
	    !take_head(in, "commit", &s->last))
		return false;
	s->complete = !strcmp(complete, "yes");
	for (int i = 0; i < INCISE_STATEMENT_PARTS; i++)
		if (!take_part(in, &s->parts[i], incise_seal_parts[i]))
			return false;
	s->n_earlier = s->last.commit < INCISE_STATEMENT_EARLIER
			       ? (int)s->last.commit
			       : INCISE_STATEMENT_EARLIER;
	for (int i = 0; i < s->n_earlier; i++)
		if (!take_head(in, "earlier", &s->earlier[i]) ||
		    s->earlier[i].commit !=
			    earlier_commit(i, s->n_earlier, s->last.commit))
			return false;
	in->line++;
	return in->end - in->at == 4 && !memcmp(in->at, "end\n", 4);
}

int incise_seal_read(struct incise_seal_statement *statement, const char *text,
		     size_t length, struct incise_error *err)
{
	struct in in = {.at = text, .end = text + length};
	char again[INCISE_STATEMENT_MAX];

	*statement = (struct incise_seal_statement){0};
	/* A number in another form, such as 007, is found as the text is written again. */
	if (length < sizeof(again) && take_all(&in, statement) &&
	    incise_statement_write(statement, again) == length &&
	    !memcmp(again, text, length))
		return 0;
	return incise_error_set(err, EINVAL,
				"not a statement of a recording by incise, or altered: "
				"line %d",
				in.line);
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
		rc = incise_statement_make(&statement, recording, -1, check_step, &good,
					   err);
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
	struct incise_recording *recording = incise_recording_open_any(path, err);
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
			incise_seal_hex(sqlite3_column_blob(stmt, 2), head->head);
	}
	if (sqlite3_finalize(stmt) != SQLITE_OK)
		return incise_schema_fail(recording->db, recording->path, err);
	return has ? 0
		   : incise_error_set(err, ENODATA, "%s: has no sealed commit",
				      recording->path);
}
