// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The statement of a recording, made of its rows; see incise/seal.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include "../frames.h"
#include "../schema.h"
#include "seal_walk.h"

/* --- making --------------------------------------------------------------------------- */

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

int incise_statement_make(struct incise_seal_statement *statement,
			  struct incise_recording *recording, bool known, int64_t upto,
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
		rc = incise_seal_identity(recording, statement->identity, err);
	if (!rc)
		rc = incise_seal_key(recording, "incise", statement->software,
				     sizeof(statement->software), err);
	if (!rc)
		rc = incise_seal_key(recording, "host", statement->host,
				     sizeof(statement->host), err);
	if (!rc)
		rc = incise_seal_key(recording, "started", statement->started,
				     sizeof(statement->started), err);
	incise_seal_line(statement->name, sizeof(statement->name), recording->name);
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
		rc = incise_statement_make(&statement, recording, false, -1, check_step,
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
