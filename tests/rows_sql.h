/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * SQL on the samples of a recording, as a stranger changes them: before it runs, temporary tables force,
 * tracker, depth, frames and wall have a row a sample, of the blocks; what it changed in them is stored in
 * the blocks again, with fields and CRCs that agree, but with the digests of before.
 */
#ifndef TEST_ROWS_SQL_H
#define TEST_ROWS_SQL_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sqlite3.h>
#include "../lib/record/batch.h"
#include "../lib/record/read/source.h"

/* Whether a text has a word that is not quoted. */
static bool rows_has_word(const char *text, const char *word)
{
	const char *letters = "abcdefghijklmnopqrstuvwxyz_'";
	const char *at = text;
	size_t n = strlen(word);

	for (; (at = strstr(at, word)); at += n)
		if ((at == text || !strchr(letters, at[-1])) &&
		    (!at[n] || !strchr(letters, at[n])))
			return true;
	return false;
}

static int64_t rows_number(sqlite3 *db, const char *sql)
{
	sqlite3_stmt *stmt = NULL;
	int64_t value = -1;

	if (sqlite3_prepare_v2(db, sql, -1, &stmt, NULL) == SQLITE_OK &&
	    sqlite3_step(stmt) == SQLITE_ROW)
		value = sqlite3_column_int64(stmt, 0);
	sqlite3_finalize(stmt);
	return value;
}

static void rows_bind(sqlite3_stmt *stmt, const struct incise_batch *batch, size_t row)
{
	for (int i = 0; batch->form->types[i]; i++) {
		const union incise_column *column = &batch->column[i];

		switch (batch->form->types[i]) {
		case 'i':
			sqlite3_bind_int64(stmt, i + 1, column->i[row]);
			break;
		case 'c':
			sqlite3_bind_text(stmt, i + 1, &column->c[row], 1, SQLITE_STATIC);
			break;
		case 's':
			sqlite3_bind_text(stmt, i + 1, column->s[row], -1, SQLITE_STATIC);
			break;
		case 'h':
			sqlite3_bind_blob(stmt, i + 1, column->h[row], sizeof(*column->h),
					  SQLITE_STATIC);
			break;
		default: /* NaN becomes NULL */
			sqlite3_bind_double(stmt, i + 1, column->r[row]);
		}
	}
}

static void rows_take(sqlite3_stmt *stmt, struct incise_batch *batch)
{
	const size_t row = batch->n++;

	for (int i = 0; batch->form->types[i]; i++) {
		union incise_column *column = &batch->column[i];
		const char *text;

		switch (batch->form->types[i]) {
		case 'i':
			column->i[row] = sqlite3_column_int64(stmt, i);
			break;
		case 'c':
			text = (const char *)sqlite3_column_text(stmt, i);
			column->c[row] = text ? *text : '\0';
			break;
		case 's':
			text = (const char *)sqlite3_column_text(stmt, i);
			memset(column->s[row], 0, sizeof(*column->s));
			snprintf(column->s[row], sizeof(*column->s), "%s",
				 text ? text : "");
			break;
		case 'h':
			memset(column->h[row], 0, sizeof(*column->h));
			if (sqlite3_column_bytes(stmt, i) == sizeof(*column->h))
				memcpy(column->h[row], sqlite3_column_blob(stmt, i),
				       sizeof(*column->h));
			break;
		default:
			column->r[row] = sqlite3_column_type(stmt, i) == SQLITE_NULL
						 ? NAN
						 : sqlite3_column_double(stmt, i);
		}
	}
}

/* A temporary table of a form, and the statement that fills it. */
static sqlite3_stmt *rows_table(sqlite3 *db, const struct incise_ledger_form *form)
{
	char sql[1000], values[40] = "?1", *to = sql;
	sqlite3_stmt *stmt = NULL;
	const char *name = form->columns;

	to += sprintf(to, "CREATE TEMP TABLE %s(", form->table);
	for (int i = 0; form->types[i]; i++) {
		size_t n = strcspn(name, ",");

		to += sprintf(to, "%s%.*s %s", i ? ", " : "", (int)n, name,
			      !i			     ? "INTEGER PRIMARY KEY"
			      : form->types[i] == 'i'	     ? "INTEGER"
			      : strchr("rn", form->types[i]) ? "REAL"
			      : form->types[i] == 'h'	     ? "BLOB"
							     : "TEXT");
		name += n + strspn(name + n, ", ");
		if (i)
			strcat(values, ",?");
	}
	strcpy(to, ")");
	if (sqlite3_exec(db, sql, NULL, NULL, NULL) != SQLITE_OK)
		return NULL;
	sprintf(sql, "INSERT INTO temp.%s VALUES(%s)", form->table, values);
	sqlite3_prepare_v2(db, sql, -1, &stmt, NULL);
	return stmt;
}

static void rows_insert(sqlite3_stmt *insert, const struct incise_batch *batch)
{
	for (size_t row = 0; row < batch->n; row++) {
		rows_bind(insert, batch, row);
		sqlite3_step(insert);
		sqlite3_reset(insert);
	}
}

/* Depth is of no block: as readers find it. */
static void rows_load_depth(sqlite3_stmt *insert, const char *file)
{
	char *folder = strdup(file);
	struct incise_recording *recording;
	struct incise_source source;

	if (strrchr(folder, '/'))
		*strrchr(folder, '/') = '\0';
	recording = incise_recording_open(folder, NULL);
	if (recording &&
	    !incise_source_open(&source, recording, INCISE_SOURCE_DEPTH, NULL)) {
		while (incise_source_next(&source, NULL) > 0)
			rows_insert(insert, &source.batch);
		incise_source_close(&source);
	}
	incise_recording_close(recording);
	free(folder);
}

static void rows_load(sqlite3 *db, sqlite3_stmt *insert,
		      const struct incise_ledger_form *form)
{
	struct incise_batch batch = {.form = form};
	struct incise_ledger_block block;
	sqlite3_stmt *stmt = NULL;

	incise_ledger_select(db, form->stream, INT64_MIN, false, &stmt);
	while (sqlite3_step(stmt) == SQLITE_ROW) {
		incise_ledger_block_read(&block, stmt);
		if (block.count &&
		    !incise_batch_decode(&batch, &block, sqlite3_column_blob(stmt, 9),
					 sqlite3_column_bytes(stmt, 9)))
			rows_insert(insert, &batch);
	}
	sqlite3_finalize(stmt);
	incise_batch_free(&batch);
}

/* A block of the rows that are left of it; without any it is as it was, but empty. */
static void rows_store_block(sqlite3 *db, const struct incise_batch *batch,
			     struct incise_ledger_block *block, int64_t *before,
			     sqlite3_stmt *old)
{
	uint8_t *data = malloc(incise_batch_bound(batch) + 1);
	size_t n = batch->n ? incise_batch_encode(batch, data) : 0;
	sqlite3_stmt *stmt = NULL;

	if (batch->n) {
		block->first_seq = batch->column[0].i[0];
		block->last_seq = batch->column[0].i[batch->n - 1];
		block->first_ns = batch->column[1].i[0];
		block->last_ns = batch->column[1].i[batch->n - 1];
	}
	block->count = (int64_t)batch->n;
	if (batch->n) {
		block->lost = block->last_seq - block->first_seq + 1 - block->count;
		block->lost += *before >= 0 ? block->first_seq - *before - 1 : 0;
		*before = block->last_seq;
	}
	incise_ledger_crc(block, data, n);
	if (block->lost != sqlite3_column_int64(old, 6) ||
	    n != (size_t)sqlite3_column_bytes(old, 9) ||
	    memcmp(data, sqlite3_column_blob(old, 9), n) != 0) {
		sqlite3_prepare_v2(
			db,
			"UPDATE blocks SET first_seq = ?3, last_seq = ?4, "
			"first_ns = ?5, last_ns = ?6, count = ?7, crc = ?8, "
			"data = ?9, lost = ?10 WHERE stream = ?1 AND block = ?2",
			-1, &stmt, NULL);
		sqlite3_bind_text(stmt, 1, batch->form->stream, -1, SQLITE_STATIC);
		sqlite3_bind_int64(stmt, 2, block->block);
		sqlite3_bind_int64(stmt, 3, block->first_seq);
		sqlite3_bind_int64(stmt, 4, block->last_seq);
		sqlite3_bind_int64(stmt, 5, block->first_ns);
		sqlite3_bind_int64(stmt, 6, block->last_ns);
		sqlite3_bind_int64(stmt, 7, block->count);
		sqlite3_bind_int64(stmt, 8, block->crc);
		sqlite3_bind_blob(stmt, 9, data, (int)n, SQLITE_STATIC);
		sqlite3_bind_int64(stmt, 10, block->lost);
		sqlite3_step(stmt);
		sqlite3_finalize(stmt);
	}
	free(data);
}

/* A stream without rows gets a block for those that are new, before its end if it has one. */
static void rows_add_block(sqlite3 *db, const struct incise_ledger_form *form)
{
	char sql[400];

	snprintf(sql, sizeof(sql),
		 "UPDATE blocks SET block = block + 1 WHERE stream = '%s'; "
		 "INSERT INTO blocks SELECT '%s', 0, 0, 0, 0, 0, 1, 0, 0, zeroblob(32), "
		 "zeroblob(0) WHERE EXISTS(SELECT 1 FROM temp.%s)",
		 form->stream, form->stream, form->table);
	sqlite3_exec(db, sql, NULL, NULL, NULL);
}

/* Each block takes the rows up to its last number; the last one those behind it too. */
static void rows_store(sqlite3 *db, const struct incise_ledger_form *form)
{
	struct incise_batch batch = {.form = form};
	struct incise_ledger_block block;
	sqlite3_stmt *blocks = NULL, *rows = NULL;
	char sql[300];
	int64_t last = 0, before = -1;

	snprintf(sql, sizeof(sql),
		 "SELECT coalesce(max(block), -1) FROM blocks WHERE stream = '%s' "
		 "AND count > 0",
		 form->stream);
	if (rows_number(db, sql) < 0)
		rows_add_block(db, form);
	last = rows_number(db, sql);
	snprintf(sql, sizeof(sql), "SELECT %s FROM temp.%s ORDER BY seq", form->columns,
		 form->table);
	sqlite3_prepare_v2(db, sql, -1, &rows, NULL);
	incise_ledger_select(db, form->stream, INT64_MIN, false, &blocks);
	if (sqlite3_step(rows) != SQLITE_ROW) {
		sqlite3_finalize(rows);
		rows = NULL;
	}
	while (sqlite3_step(blocks) == SQLITE_ROW) {
		incise_ledger_block_read(&block, blocks);
		if (!block.count)
			continue;
		batch.n = 0;
		while (rows && (block.block == last ||
				sqlite3_column_int64(rows, 0) <= block.last_seq)) {
			if (!incise_batch_reserve(&batch, batch.n + 1))
				abort();
			rows_take(rows, &batch);
			if (sqlite3_step(rows) != SQLITE_ROW) {
				sqlite3_finalize(rows);
				rows = NULL;
			}
		}
		rows_store_block(db, &batch, &block, &before, blocks);
	}
	sqlite3_finalize(rows);
	sqlite3_finalize(blocks);
	incise_batch_free(&batch);
}

/* Note which tables SQL changes. */
static int rows_authorize(void *changed, int action, const char *table, const char *a,
			  const char *b, const char *c)
{
	const int stream = table ? incise_source_find(table) : -1;

	(void)a, (void)b, (void)c;
	if (stream >= 0 && (action == SQLITE_INSERT || action == SQLITE_UPDATE ||
			    action == SQLITE_DELETE))
		((bool *)changed)[stream] = true;
	return SQLITE_OK;
}

/*
 * Open a file, of a recording or not, with the tables that @sql names, NULL: all, and say which they are.
 * NULL: SQLite cannot.
 */
static sqlite3 *rows_open(const char *file, bool readonly, const char *sql,
			  bool loaded[INCISE_SOURCE_DEPTH + 1])
{
	sqlite3 *db;

	memset(loaded, 0, INCISE_SOURCE_DEPTH + 1);
	if (sqlite3_open_v2(file, &db,
			    readonly ? SQLITE_OPEN_READONLY
				     : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE,
			    NULL) != SQLITE_OK) {
		sqlite3_close(db);
		return NULL;
	}
	if (rows_number(db, "PRAGMA user_version") < 5 ||
	    rows_number(db, "SELECT count(*) FROM main.sqlite_master WHERE name = "
			    "'blocks'") != 1)
		return db;
	sqlite3_exec(db, "BEGIN", NULL, NULL, NULL);
	for (int i = 0; i <= INCISE_SOURCE_DEPTH; i++) {
		const struct incise_ledger_form *form = incise_source_form(i);
		sqlite3_stmt *insert;

		loaded[i] = !sql || rows_has_word(sql, form->table);
		insert = loaded[i] ? rows_table(db, form) : NULL;
		if (loaded[i] && i < INCISE_SOURCE_DEPTH)
			rows_load(db, insert, form);
		else if (loaded[i])
			rows_load_depth(insert, file);
		sqlite3_finalize(insert);
	}
	sqlite3_exec(db, "COMMIT", NULL, NULL, NULL);
	return db;
}

/* The same to look at all tables. */
__attribute__((unused)) static sqlite3 *rows_look(const char *file)
{
	bool loaded[INCISE_SOURCE_DEPTH + 1];

	return rows_open(file, true, NULL, loaded);
}

/*
 * Run SQL; @row is called with each row. Returns an SQLite code, and a message to be freed with
 * sqlite3_free().
 */
__attribute__((unused)) static int rows_sql(const char *file, bool readonly,
					    const char *sql,
					    void (*row)(void *user, sqlite3_stmt *stmt),
					    void *user, char **message)
{
	bool loaded[INCISE_SOURCE_DEPTH + 1], changed[INCISE_SOURCE_DEPTH + 1] = {false};
	sqlite3 *db = rows_open(file, readonly, sql, loaded);
	int rc = db ? SQLITE_OK : SQLITE_CANTOPEN;
	sqlite3_stmt *stmt;

	*message = NULL;
	if (db)
		sqlite3_set_authorizer(db, rows_authorize, changed);
	while (rc == SQLITE_OK && *sql) {
		rc = sqlite3_prepare_v2(db, sql, -1, &stmt, &sql);
		while (rc == SQLITE_OK && stmt && sqlite3_step(stmt) == SQLITE_ROW)
			if (row)
				row(user, stmt);
		if (rc == SQLITE_OK)
			rc = sqlite3_finalize(stmt);
	}
	if (rc != SQLITE_OK)
		*message =
			sqlite3_mprintf("%s", db ? sqlite3_errmsg(db) : "no such file");
	else
		sqlite3_exec(db, "BEGIN", NULL, NULL, NULL);
	for (int i = 0; i < INCISE_SOURCE_DEPTH && rc == SQLITE_OK && !readonly; i++)
		if (loaded[i] && changed[i])
			rows_store(db, incise_source_form(i));
	if (rc == SQLITE_OK)
		sqlite3_exec(db, "COMMIT", NULL, NULL, NULL);
	sqlite3_close(db);
	return rc;
}

#endif
