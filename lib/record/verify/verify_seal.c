// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What is sealed against its seals; see verify.h and ledger.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../frames.h"
#include "../ledger.h"
#include "verify.h"

/* Entries of @stream in the ledger; the first in @entry. -1: it cannot be read. */
static int read_entry(struct incise_verification *verify, const char *stream,
		      struct incise_ledger_block *entry)
{
	int64_t *const to[] = {&entry->block,	 &entry->first_seq, &entry->last_seq,
			       &entry->first_ns, &entry->last_ns,   &entry->count,
			       &entry->lost};
	sqlite3_stmt *stmt = NULL;
	int n = 0, rc;

	*entry = (struct incise_ledger_block){0};
	if (sqlite3_prepare_v2(
		    verify->recording->db,
		    "SELECT block, first_seq, last_seq, first_ns, last_ns, count, lost, "
		    "crc FROM ledger WHERE stream = ? ORDER BY block",
		    -1, &stmt, NULL) != SQLITE_OK)
		return -1;
	sqlite3_bind_text(stmt, 1, stream, -1, SQLITE_STATIC);
	while ((rc = sqlite3_step(stmt)) == SQLITE_ROW && n++ == 0) {
		int64_t crc = sqlite3_column_int64(stmt, 7);

		for (int i = 0; i < 7; i++)
			*to[i] = sqlite3_column_int64(stmt, i);
		entry->crc = crc;
		if (crc != (int64_t)entry->crc)
			n = 2; /* as bad as a second one */
	}
	sqlite3_finalize(stmt);
	return rc == SQLITE_ROW || rc == SQLITE_DONE ? n : -1;
}

/* @stream is what the ledger calls it, @what people do. */
static void compare(struct incise_verification *verify, const char *stream,
		    const char *what, const char *units,
		    const struct incise_ledger_block *made)
{
	struct incise_verify_finding found = incise_verify_finding(INCISE_VERIFY_ALTERED);
	struct incise_ledger_block entry;
	int n = read_entry(verify, stream, &entry);

	if (n < 0) {
		incise_verify_unreadable(verify, "", "ledger");
		return;
	}
	if (!n) {
		found.kind = INCISE_VERIFY_LEDGER;
		incise_verify_found(verify, &found, "%s has no seal in the ledger", what);
		return;
	}
	found.count = entry.count;
	if (n == 1 && incise_ledger_same(made, &entry))
		return;
	if (n == 1 && made->count != entry.count)
		incise_verify_found(verify, &found, "%s has %lld %s of %lld", what,
				    (long long)made->count, units,
				    (long long)entry.count);
	else
		incise_verify_found(verify, &found,
				    "%s is altered: its %s or its seal are not what was "
				    "written",
				    what, units);
}

static void check_head(struct incise_verification *verify)
{
	struct incise_verify_finding found = incise_verify_finding(INCISE_VERIFY_DAMAGED);
	struct incise_ledger_block made, entry;
	char *path;
	int fd, rc;

	if (asprintf(&path, "%s/" INCISE_FRAMES_FILE, verify->recording->path) < 0)
		return;
	fd = open(path, O_RDONLY | O_CLOEXEC);
	free(path);
	if (fd < 0) {
		/* that it is missing is told where its pictures are looked for */
		if (read_entry(verify, INCISE_LEDGER_HEAD, &entry) && !verify->frames)
			incise_verify_found(verify, &found,
					    "camera: " INCISE_FRAMES_FILE " is missing");
		return;
	}
	rc = incise_ledger_seal_head(fd, &made);
	close(fd);
	if (rc)
		incise_verify_found(verify, &found,
				    INCISE_FRAMES_FILE " cannot be read: %s",
				    strerror(-rc));
	else
		compare(verify, INCISE_LEDGER_HEAD, "the head of " INCISE_FRAMES_FILE,
			"bytes", &made);
}

int incise_verify_seals(struct incise_verification *verify)
{
	int rc = 0;

	for (int i = 0; incise_ledger_sealed[i] && !rc; i++) {
		const char *table = incise_ledger_sealed[i];
		struct incise_ledger_block made;
		char stream[40], what[40];

		snprintf(stream, sizeof(stream), INCISE_LEDGER_TABLE "%s", table);
		snprintf(what, sizeof(what), "table %s", table);
		if (incise_ledger_seal(verify->recording->db, table, &made) != SQLITE_OK)
			incise_verify_unreadable(verify, "", table);
		else
			compare(verify, stream, what, "rows", &made);
		rc = incise_verify_progress(verify, 1);
	}
	if (!rc && verify->camera)
		check_head(verify);
	return rc;
}
