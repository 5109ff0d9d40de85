// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Rows as the ledger and the seal of formats 2 to 4 have them; see old.h.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "../../base/crc32c.h"
#include "old.h"

/* Before format 4 frames had no digest. */
static const struct incise_ledger_form camera_3 = {
	"camera", "frames",
	"seq, t_ns, arrival_ns, pts, bytes, crc, length_px, sd_px, depth_mm, quality",
	"iiiiiinnnn"};

static void put_integer(struct incise_old_rows *row, int64_t value)
{
	for (int i = 0; i < 8; i++)
		row->bytes[row->n++] = (uint64_t)value >> 8 * i;
}

static void put_real(struct incise_old_rows *row, double value)
{
	uint64_t bits = 0x7ff8000000000000;

	value += 0.0; /* -0 becomes 0 */
	if (!isnan(value))
		memcpy(&bits, &value, sizeof(bits));
	put_integer(row, bits);
}

static void put_digest(struct incise_old_rows *row, const uint8_t *bytes)
{
	memcpy(row->bytes + row->n, bytes, INCISE_FRAMES_DIGEST);
	row->n += INCISE_FRAMES_DIGEST;
}

static void put_old_ledger_text(struct incise_old_rows *row, const char *text,
				size_t length)
{
	memset(row->bytes + row->n, 0, INCISE_LEDGER_TEXT + 1);
	memcpy(row->bytes + row->n, text, length);
	row->n += INCISE_LEDGER_TEXT + 1;
}

/* Encode the row of the statement. False: a column has a wrong type. */
static bool read_row(struct incise_old_rows *row)
{
	const struct incise_ledger_form *form = row->form;
	sqlite3_stmt *stmt = row->stmt;

	row->n = 0;
	row->seq = sqlite3_column_int64(stmt, 0);
	row->t_ns = sqlite3_column_int64(stmt, 1);
	for (int i = 0; form->types[i]; i++) {
		int type = sqlite3_column_type(stmt, i);

		switch (form->types[i]) {
		case 'i':
			if (type != SQLITE_INTEGER)
				return false;
			put_integer(row, sqlite3_column_int64(stmt, i));
			break;
		case 'n':
			if (type == SQLITE_NULL) {
				put_real(row, NAN);
				break;
			}
			/* fall through */
		case 'r':
			if (type != SQLITE_FLOAT)
				return false;
			put_real(row, sqlite3_column_double(stmt, i));
			break;
		case 'c':
			if (type != SQLITE_TEXT || !sqlite3_column_text(stmt, i) ||
			    sqlite3_column_bytes(stmt, i) != 1)
				return false;
			row->bytes[row->n++] = *sqlite3_column_text(stmt, i);
			break;
		case 'h':
			if (type != SQLITE_BLOB ||
			    sqlite3_column_bytes(stmt, i) != INCISE_FRAMES_DIGEST ||
			    !sqlite3_column_blob(stmt, i))
				return false;
			put_digest(row, sqlite3_column_blob(stmt, i));
			break;
		case 's':
			if (type != SQLITE_TEXT || !sqlite3_column_text(stmt, i) ||
			    sqlite3_column_bytes(stmt, i) > INCISE_LEDGER_TEXT)
				return false;
			put_old_ledger_text(row,
					    (const char *)sqlite3_column_text(stmt, i),
					    sqlite3_column_bytes(stmt, i));
			break;
		}
	}
	return true;
}

int incise_old_rows_open(struct incise_old_rows *rows, struct incise_recording *recording,
			 int stream)
{
	char sql[300];

	*rows = (struct incise_old_rows){
		.form = stream == INCISE_LEDGER_CAMERA && recording->form < 4
				? &camera_3
				: &incise_ledger_forms[stream],
	};
	snprintf(sql, sizeof(sql), "SELECT %s FROM %s ORDER BY seq", rows->form->columns,
		 rows->form->table);
	return sqlite3_prepare_v2(recording->db, sql, -1, &rows->stmt, NULL);
}

int incise_old_rows_next(struct incise_old_rows *rows)
{
	int rc = sqlite3_step(rows->stmt);

	rows->has_row = rc == SQLITE_ROW;
	if (rows->has_row)
		rows->good = read_row(rows);
	return rc == SQLITE_ROW || rc == SQLITE_DONE ? SQLITE_OK : rc;
}

void incise_old_rows_close(struct incise_old_rows *rows)
{
	sqlite3_finalize(rows->stmt);
}

void incise_old_ledger_add(struct incise_ledger *ledger,
			   const struct incise_old_rows *rows)
{
	incise_ledger_count(ledger, rows->seq, rows->t_ns);
	ledger->open.crc = incise_crc32c(ledger->open.crc, rows->bytes, rows->n);
}
