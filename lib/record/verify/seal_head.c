// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The last head of a recording's seal, and the texts beside it; see incise/seal.h. The file is untrusted.
 */
#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include "../schema.h"
#include "seal_walk.h"

void incise_seal_line(char *to, size_t size, const char *text)
{
	snprintf(to, size, "%s", text);
	for (char *c = to; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '?';
}

int incise_seal_key(struct incise_recording *recording, const char *key, char *to,
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
		incise_seal_line(to, size, text ? text : "");
	}
	return sqlite3_finalize(stmt) == SQLITE_OK
		       ? 0
		       : incise_schema_fail(recording->db, recording->path, err);
}

int incise_seal_identity(struct incise_recording *recording, char identity[33],
			 struct incise_error *err)
{
	int rc = incise_seal_key(recording, "identity", identity, 33, err);

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
	return 0;
}

int incise_seal_head(struct incise_recording *recording, char identity[33],
		     struct incise_seal_head *head, struct incise_error *err)
{
	sqlite3_stmt *stmt = NULL;
	int rc = incise_seal_possible(recording, err);
	bool has = false;

	if (!rc)
		rc = incise_seal_identity(recording, identity, err);
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
	return incise_schema_ask(
		       recording->db, 0,
		       "SELECT instr(value, ', head ' || %Q) FROM meta WHERE key "
		       "= 'converted_from'",
		       head) > 0;
}
