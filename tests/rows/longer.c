// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A long recording in a minute: the force and the poses of a short one, again and again, written by the library's
 * writer of blocks.
 *
 *     longer SHORT.rec COPY.rec TIMES		COPY.rec is a copy (cp -r), and becomes TIMES as long
 *
 * The tool must be out of the tissue at both ends, for its cuts to be TIMES as many.
 */
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <incise/recording.h>
#include "../../lib/record/read/source.h"
#include "../../lib/record/schema.h"
#include "../../lib/record/write/block_writer.h"

#define FORCE_NS 100000 /* 10 kHz */
#define KNOTS 60

static sqlite3 *db;
static struct incise_error err;

static void need(bool good, const char *what)
{
	if (good)
		return;
	fprintf(stderr, "longer: %s: %s\n", what,
		*err.text ? err.text : sqlite3_errmsg(db));
	exit(1);
}

/* All rows of a stream, and where its blocks begin. */
struct rows {
	struct incise_batch batch, block; /* all; a block that is written */
	size_t *blocks, n_blocks;
	struct incise_ledger ledger;
};

static void append(struct incise_batch *to, const struct incise_batch *from, size_t at,
		   size_t n)
{
	const struct incise_ledger_form *form = from->form;

	to->form = form;
	need(incise_batch_reserve(to, to->n + n), "out of memory");
	for (int c = 0; form->types[c]; c++) {
		const size_t size = form->types[c] == 'c' ? 1 : 8;

		memcpy((char *)to->column[c].any + to->n * size,
		       (const char *)from->column[c].any + at * size, n * size);
	}
	to->n += n;
}

static void read_rows(struct rows *rows, struct incise_recording *recording, int stream)
{
	struct incise_source source;
	int rc = incise_source_open(&source, recording, stream, &err);

	need(!rc, "open");
	incise_ledger_init(&rows->ledger);
	while ((rc = incise_source_next(&source, &err)) > 0) {
		rows->blocks =
			realloc(rows->blocks, (rows->n_blocks + 2) * sizeof(size_t));
		need(rows->blocks, "out of memory");
		rows->blocks[rows->n_blocks++] = rows->batch.n;
		append(&rows->batch, &source.batch, 0, source.batch.n);
		rows->blocks[rows->n_blocks] = rows->batch.n;
	}
	need(!rc, "read");
	incise_source_close(&source);
}

/* Leave out rows behind the span, which are those of the next repetition. */
static void cut_rows(struct rows *rows, int64_t span_ns)
{
	const int64_t *t_ns = rows->batch.column[1].i;

	while (rows->batch.n && t_ns[rows->batch.n - 1] - t_ns[0] >= span_ns - FORCE_NS)
		rows->batch.n--;
	while (rows->n_blocks && rows->blocks[rows->n_blocks - 1] >= rows->batch.n)
		rows->n_blocks--;
	rows->blocks[rows->n_blocks] = rows->batch.n;
}

/* Block @i of a stream, in a repetition. */
static void put(struct incise_block_writer *writer, struct rows *rows, int stream,
		size_t i, int64_t times, int64_t shift_ns)
{
	struct incise_batch *batch = &rows->block;
	struct incise_ledger_block block;
	const int n_times = stream == INCISE_LEDGER_TRACKER ? 2 : 1;

	batch->n = 0;
	append(batch, &rows->batch, rows->blocks[i],
	       rows->blocks[i + 1] - rows->blocks[i]);
	for (size_t k = 0; k < batch->n; k++) {
		batch->column[0].i[k] += times * (int64_t)rows->batch.n;
		for (int c = 1; c <= n_times; c++)
			batch->column[c].i[k] += shift_ns;
		incise_ledger_count(&rows->ledger, batch->column[0].i[k],
				    batch->column[1].i[k]);
	}
	incise_ledger_end(&rows->ledger, &block);
	need(incise_block_writer_put(writer, stream, batch, &block) == SQLITE_OK,
	     "block");
}

static void run(const char *sql, int64_t a, int64_t b, int64_t c)
{
	sqlite3_stmt *stmt;

	need(sqlite3_prepare_v2(db, sql, -1, &stmt, NULL) == SQLITE_OK, sql);
	sqlite3_bind_int64(stmt, 1, a);
	sqlite3_bind_int64(stmt, 2, b);
	sqlite3_bind_int64(stmt, 3, c);
	sqlite3_step(stmt);
	need(sqlite3_finalize(stmt) == SQLITE_OK, sql);
}

/* When the cuts of all repetitions ended. */
static void repeat_cut_ends(int64_t times, int64_t span_ns)
{
	sqlite3_stmt *stmt;
	int64_t *all;
	size_t n;

	need(sqlite3_prepare_v2(db, "SELECT value FROM meta WHERE key = 'cut_ends_ns'",
				-1, &stmt, NULL) == SQLITE_OK &&
		     sqlite3_step(stmt) == SQLITE_ROW,
	     "cut_ends_ns");
	n = (size_t)sqlite3_column_bytes(stmt, 0) / sizeof(*all);
	all = malloc((size_t)times * n * sizeof(*all));
	need(all, "out of memory");
	memcpy(all, sqlite3_column_blob(stmt, 0), n * sizeof(*all));
	for (size_t i = n; i < n * (size_t)times; i++)
		all[i] = all[i - n] + span_ns;
	need(sqlite3_finalize(stmt) == SQLITE_OK &&
		     sqlite3_prepare_v2(
			     db, "UPDATE meta SET value = ? WHERE key = 'cut_ends_ns'",
			     -1, &stmt, NULL) == SQLITE_OK,
	     "cut_ends_ns");
	sqlite3_bind_blob64(stmt, 1, all, (size_t)times * n * sizeof(*all),
			    SQLITE_STATIC);
	sqlite3_step(stmt);
	need(sqlite3_finalize(stmt) == SQLITE_OK, "cut_ends_ns");
	free(all);
}

int main(int argc, char **argv)
{
	static struct rows streams[2];
	struct incise_block_writer writer = {0};
	struct incise_recording *recording;
	int64_t times, span_ns, t_ns = 0;
	char path[4096];
	int folder;

	if (argc != 4 || (times = atoll(argv[3])) < 1)
		return fputs("usage: longer SHORT.rec COPY.rec TIMES\n", stderr), 2;
	recording = incise_recording_open(argv[1], &err);
	need(recording, argv[1]);
	for (int s = 0; s < 2; s++)
		read_rows(&streams[s], recording, s);
	incise_recording_close(recording);
	span_ns = (int64_t)streams[0].batch.n * FORCE_NS;
	cut_rows(&streams[1], span_ns);

	snprintf(path, sizeof(path), "%s/" INCISE_SCHEMA_DB, argv[2]);
	folder = open(argv[2], O_RDONLY | O_DIRECTORY);
	need(folder >= 0 &&
		     sqlite3_open_v2(path, &db, SQLITE_OPEN_READWRITE, NULL) == SQLITE_OK,
	     path);
	run("PRAGMA synchronous = OFF", 0, 0, 0);
	run("BEGIN", 0, 0, 0);
	run("DELETE FROM blocks", 0, 0, 0);
	run("DELETE FROM ledger", 0, 0, 0);
	run("DELETE FROM seal", 0, 0, 0);
	run("UPDATE streams SET rows = iif(name = 'force', ?1, ?2)", streams[0].batch.n,
	    streams[1].batch.n, 0);
	/* The line of arrivals is the same from repetition to repetition; a timeline has so many knots at most. */
	run("DELETE FROM knots WHERE knot", 0, 0, 0);
	run("CREATE TEMP TABLE once AS SELECT k.*, s.rows FROM knots AS k JOIN streams AS s ON s.name = k.stream",
	    0, 0, 0);
	for (int64_t n = 1, step = times / KNOTS + 1; n * step < times; n++)
		run("INSERT INTO knots SELECT stream, ?1, seq + ?2 * rows, t_ns + ?2 * ?3, sd_ns, 0 FROM once",
		    n, n * step, span_ns);
	run("UPDATE streams SET rows = rows * ?1", times, 0, 0);
	run("UPDATE meta SET value = (SELECT rows FROM streams WHERE name || '_rows' = key OR (key = 'depth_rows' AND "
	    "name = 'tracker')) WHERE key IN ('force_rows', 'tracker_rows', 'depth_rows')",
	    0, 0, 0);
	run("UPDATE meta SET value = value * ?1 WHERE key = 'cuts'", times, 0, 0);
	repeat_cut_ends(times, span_ns);
	run("UPDATE events SET t_ns = t_ns + (?1 - 1) * ?2 WHERE kind = 'end'", times,
	    span_ns, 0);
	need(!incise_seal_init(&writer.seal), "SHA-256");
	need(incise_block_writer_start(&writer, db) == SQLITE_OK, "start");
	for (int64_t k = 0; k < times; k++)
		for (size_t i = 0; i < streams[0].n_blocks || i < streams[1].n_blocks;
		     i++) {
			for (int s = 0; s < 2; s++)
				if (i < streams[s].n_blocks)
					put(&writer, &streams[s], s, i, k, k * span_ns);
			t_ns += 100000000;
			need(incise_block_writer_commit(&writer, t_ns) == SQLITE_OK,
			     "commit");
		}
	for (int s = 0; s < 2; s++) {
		struct incise_batch none = {.form = streams[s].batch.form};
		struct incise_ledger_block block;

		incise_ledger_close(&streams[s].ledger, 0, &block);
		need(incise_block_writer_put(&writer, s, &none, &block) == SQLITE_OK,
		     "end");
	}
	need(incise_block_writer_seal(&writer, folder, true, t_ns) == SQLITE_OK, "seal");
	incise_block_writer_free(&writer);
	run("COMMIT", 0, 0, 0);
	return sqlite3_close(db) == SQLITE_OK ? 0 : 1;
}
