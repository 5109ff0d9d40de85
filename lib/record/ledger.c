// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Rows, blocks and seals of the ledger; see ledger.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../base/crc32c.h"
#include "ledger.h"

const struct incise_ledger_form incise_ledger_forms[INCISE_LEDGER_FORMS] = {
	[INCISE_LEDGER_FORCE] = {"force", "force", "seq, t_ns, code", "iii"},
	[INCISE_LEDGER_TRACKER] = {"tracker", "tracker",
				   "seq, t_ns, arrival_ns, x_mm, y_mm, z_mm, qw, qx, qy, "
				   "qz, status, station, button",
				   "iiirrrrrrrcii"},
	[INCISE_LEDGER_CAMERA] = {"camera", "frames",
				  "seq, t_ns, arrival_ns, pts, bytes, crc, length_px, "
				  "sd_px, depth_mm, quality, sha256",
				  "iiiiiinnnnh"},
	[INCISE_LEDGER_WALL] = {"wall", "wall",
				"seq, t_ns, tai_ns, uncertainty_ns, rate_ppb, "
				"rate_uncertainty_ppb, utc_offset_s, held, source, "
				"reference, leap, restart",
				"iiinrriissss"},
};

static uint8_t *put_ledger(uint8_t *to, uint64_t value)
{
	for (int i = 0; i < 8; i++)
		to[i] = value >> 8 * i;
	return to + 8;
}

/* --- blocks ------------------------------------------------------------------------ */

void incise_ledger_init(struct incise_ledger *ledger)
{
	*ledger = (struct incise_ledger){.last_seq = -1};
}

void incise_ledger_count(struct incise_ledger *ledger, int64_t seq, int64_t t_ns)
{
	struct incise_ledger_block *open = &ledger->open;

	if (!open->count) {
		open->first_seq = seq;
		open->first_ns = t_ns;
		open->lost = 0;
	}
	/* Unsigned: the difference is defined for any damaged row. */
	if (ledger->started)
		open->lost += (uint64_t)seq - (uint64_t)ledger->last_seq - 1;
	open->count++;
	ledger->started = true;
	ledger->last_seq = seq;
	ledger->last_ns = t_ns;
}

int incise_ledger_select(sqlite3 *db, const char *stream, int64_t from_block,
			 bool from_end, sqlite3_stmt **stmt)
{
	const bool blocks = !strchr(stream, ':');
	char sql[200];
	int rc;

	snprintf(sql, sizeof(sql),
		 "SELECT block, first_seq, last_seq, first_ns, last_ns, count, lost, "
		 "crc%s WHERE stream = ? AND block >= ? ORDER BY block%s",
		 blocks ? ", sha256, data FROM blocks" : " FROM ledger",
		 from_end ? " DESC" : "");
	rc = sqlite3_prepare_v2(db, sql, -1, stmt, NULL);
	if (rc != SQLITE_OK)
		return rc;
	sqlite3_bind_text(*stmt, 1, stream, -1, SQLITE_STATIC);
	return sqlite3_bind_int64(*stmt, 2, from_block);
}

#define FROM_BLOCK " FROM blocks WHERE stream = ? AND block >= ? ORDER BY block LIMIT 1"

int64_t incise_ledger_find(sqlite3 *db, const char *stream, bool by_time, int64_t value)
{
	int64_t low = 0, high = INT64_MAX; /* it is from low to high */
	sqlite3_stmt *stmt = NULL;

	if (sqlite3_prepare_v2(db,
			       by_time ? "SELECT block, last_ns" FROM_BLOCK
				       : "SELECT block, last_seq" FROM_BLOCK,
			       -1, &stmt, NULL) != SQLITE_OK)
		return INT64_MIN;
	sqlite3_bind_text(stmt, 1, stream, -1, SQLITE_STATIC);
	while (low < high) {
		const int64_t middle = low + (high - low) / 2;

		sqlite3_bind_int64(stmt, 2, middle);
		/* The way gets shorter with each step, with forged rows too. */
		if (sqlite3_step(stmt) == SQLITE_ROW &&
		    sqlite3_column_int64(stmt, 1) < value &&
		    sqlite3_column_int64(stmt, 0) >= middle &&
		    sqlite3_column_int64(stmt, 0) < high)
			low = sqlite3_column_int64(stmt, 0) + 1;
		else
			high = middle;
		sqlite3_reset(stmt);
	}
	sqlite3_finalize(stmt);
	return low;
}

bool incise_ledger_block_read(struct incise_ledger_block *block, sqlite3_stmt *stmt)
{
	int64_t *const to[] = {&block->block,	 &block->first_seq, &block->last_seq,
			       &block->first_ns, &block->last_ns,   &block->count,
			       &block->lost};
	int64_t crc = sqlite3_column_int64(stmt, 7);
	bool good = sqlite3_column_type(stmt, 7) == SQLITE_INTEGER && crc >= 0 &&
		    crc <= UINT32_MAX;

	for (int i = 0; i < 7; i++) {
		good &= sqlite3_column_type(stmt, i) == SQLITE_INTEGER;
		*to[i] = sqlite3_column_int64(stmt, i);
	}
	block->crc = crc;
	return good;
}

bool incise_ledger_data(sqlite3_stmt *stmt, const struct incise_ledger_block *block,
			const void **data, size_t *size)
{
	struct incise_ledger_block made = *block;

	*data = sqlite3_column_blob(stmt, 9);
	*size = sqlite3_column_bytes(stmt, 9);
	incise_ledger_crc(&made, *data, *size);
	return made.crc == block->crc && sqlite3_column_type(stmt, 9) == SQLITE_BLOB;
}

const uint8_t *incise_ledger_digest(sqlite3_stmt *stmt)
{
	return sqlite3_column_type(stmt, 8) == SQLITE_BLOB &&
			       sqlite3_column_bytes(stmt, 8) == INCISE_LEDGER_DIGEST
		       ? sqlite3_column_blob(stmt, 8)
		       : NULL;
}

bool incise_ledger_same(const struct incise_ledger_block *a,
			const struct incise_ledger_block *b)
{
	return a->block == b->block && a->first_seq == b->first_seq &&
	       a->last_seq == b->last_seq && a->first_ns == b->first_ns &&
	       a->last_ns == b->last_ns && a->count == b->count && a->lost == b->lost &&
	       a->crc == b->crc;
}

/* Take the fields of an entry into its CRC, which so far is that of its rows. */
static void seal_block(struct incise_ledger_block *block)
{
	uint8_t bytes[7 * 8], *to = bytes;

	to = put_ledger(to, block->block);
	to = put_ledger(to, block->first_seq);
	to = put_ledger(to, block->last_seq);
	to = put_ledger(to, block->first_ns);
	to = put_ledger(to, block->last_ns);
	to = put_ledger(to, block->count);
	put_ledger(to, block->lost);
	block->crc = incise_crc32c(block->crc, bytes, sizeof(bytes));
}

void incise_ledger_crc(struct incise_ledger_block *block, const void *data, size_t size)
{
	block->crc = incise_crc32c(0, data, size);
	seal_block(block);
}

/* End the open block; the next one goes on from its CRC. */
static void end_block(struct incise_ledger *ledger, struct incise_ledger_block *block)
{
	struct incise_ledger_block *open = &ledger->open;

	seal_block(open);
	*block = *open;
	ledger->lost += open->lost;
	open->block++;
	open->count = 0;
}

bool incise_ledger_end(struct incise_ledger *ledger, struct incise_ledger_block *block)
{
	if (!ledger->open.count)
		return false;
	ledger->open.last_seq = ledger->last_seq;
	ledger->open.last_ns = ledger->last_ns;
	end_block(ledger, block);
	return true;
}

void incise_ledger_close(struct incise_ledger *ledger, uint64_t lost,
			 struct incise_ledger_block *block)
{
	struct incise_ledger_block *open = &ledger->open;

	open->first_seq = (uint64_t)ledger->last_seq + 1;
	open->last_seq = (uint64_t)ledger->last_seq + lost;
	open->first_ns = open->last_ns = ledger->last_ns;
	open->lost = lost;
	end_block(ledger, block);
}

/* --- seals ------------------------------------------------------------------------- */

/* More than a writer puts before the first frame. */
#define HEAD_MAX 65536

const char *const incise_ledger_sealed[] = {"depth", "events",	"knots",
					    "meta",  "streams", NULL};

/* Columns by name, in a defined order: a copy by .dump has the same seals. */
static const struct {
	const char *table, *sql;
} tables[] = {
	{"depth", "SELECT seq, t_ns, depth_mm, velocity_mm_s FROM depth ORDER BY seq"},
	{"events", "SELECT t_ns, kind, text FROM events ORDER BY rowid"},
	{"knots", "SELECT stream, knot, seq, t_ns, sd_ns, begins FROM knots "
		  "ORDER BY stream, knot"},
	{"meta", "SELECT key, value FROM meta ORDER BY key"},
	{"streams",
	 "SELECT name, device, stamped, nominal_hz, delay_ns, delay_sd_ns, grain_ns, "
	 "rows, lost, late, rate_hz, drift_ppm, drift_sd_ppm, jitter_ns, jitter_max_ns, "
	 "offset_ns, offset_sd_ns, ended FROM streams ORDER BY rowid"},
};

const char *incise_ledger_sql(const char *table)
{
	for (size_t i = 0; i < sizeof(tables) / sizeof(*tables); i++)
		if (!strcmp(tables[i].table, table))
			return tables[i].sql;
	return NULL;
}

static void add_number(incise_ledger_sink sink, void *user, char type, uint64_t value)
{
	uint8_t bytes[9] = {type};

	put_ledger(bytes + 1, value);
	sink(user, bytes, sizeof(bytes));
}

static void add_value(incise_ledger_sink sink, void *user, sqlite3_stmt *stmt, int column)
{
	const int type = sqlite3_column_type(stmt, column);
	uint64_t bits;
	double real;
	const void *bytes;
	int n;

	switch (type) {
	case SQLITE_INTEGER:
		add_number(sink, user, 'i', sqlite3_column_int64(stmt, column));
		break;
	case SQLITE_FLOAT:
		real = sqlite3_column_double(stmt, column);
		memcpy(&bits, &real, sizeof(bits));
		add_number(sink, user, 'r', bits);
		break;
	case SQLITE_TEXT:
	case SQLITE_BLOB:
		/* before its length */
		bytes = type == SQLITE_TEXT
				? (const void *)sqlite3_column_text(stmt, column)
				: sqlite3_column_blob(stmt, column);
		n = sqlite3_column_bytes(stmt, column);
		add_number(sink, user, type == SQLITE_TEXT ? 't' : 'b', n);
		if (bytes)
			sink(user, bytes, n);
		break;
	default:
		sink(user, "n", 1);
	}
}

int incise_ledger_values(sqlite3 *db, const char *sql, incise_ledger_sink sink,
			 void *user, uint64_t *rows)
{
	sqlite3_stmt *stmt;
	int rc = sql ? sqlite3_prepare_v2(db, sql, -1, &stmt, NULL) : SQLITE_ERROR;

	*rows = 0;
	if (rc != SQLITE_OK)
		return rc;
	while ((rc = sqlite3_step(stmt)) == SQLITE_ROW) {
		++*rows;
		for (int j = 0; j < sqlite3_column_count(stmt); j++)
			add_value(sink, user, stmt, j);
	}
	return sqlite3_finalize(stmt); /* reports a failed step too */
}

static void to_crc(void *user, const void *bytes, size_t n)
{
	uint32_t *crc = user;

	*crc = incise_crc32c(*crc, bytes, n);
}

int incise_ledger_seal(sqlite3 *db, const char *table, struct incise_ledger_block *block)
{
	uint64_t rows;
	int rc;

	*block = (struct incise_ledger_block){0};
	rc = incise_ledger_values(db, incise_ledger_sql(table), to_crc, &block->crc,
				  &rows);
	block->count = rows;
	seal_block(block);
	return rc;
}

int incise_ledger_file_head(int fd, uint8_t **bytes, size_t *size)
{
	static const uint8_t cluster[] = {0x1f, 0x43, 0xb6,
					  0x75}; /* its ID in Matroska */
	uint8_t *head = malloc(HEAD_MAX), *found;
	size_t n = 0;
	ssize_t got;

	if (!head)
		return -ENOMEM;
	while (n < HEAD_MAX && (got = pread(fd, head + n, HEAD_MAX - n, n)) != 0) {
		if (got < 0 && errno != EINTR) {
			free(head);
			return -errno;
		}
		n += got > 0 ? got : 0;
	}
	found = memmem(head, n, cluster, sizeof(cluster));
	*size = found ? (size_t)(found - head) : n;
	*bytes = head;
	return 0;
}

int incise_ledger_seal_file(int fd, int64_t length, struct incise_ledger_block *block)
{
	uint8_t *head;
	size_t n;
	int rc = incise_ledger_file_head(fd, &head, &n);

	if (rc)
		return rc;
	*block = (struct incise_ledger_block){
		.last_seq = length,
		.count = n,
		.crc = incise_crc32c(0, head, n),
	};
	free(head);
	seal_block(block);
	return 0;
}
