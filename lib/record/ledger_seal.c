// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Seals of tables and of the head of camera.mkv; see ledger_seal.h.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../base/crc32c.h"
#include "ledger_seal.h"

/* More than a writer puts before the first picture. */
#define HEAD_MAX 65536

const char *const incise_ledger_sealed[] = {"depth", "events",	"knots",
					    "meta",  "streams", NULL};

/* Columns by name and an order that readers see, so that a copy by .dump is as good. */
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

static uint32_t add_number(uint32_t crc, char type, uint64_t value)
{
	uint8_t bytes[9] = {type};

	for (int i = 0; i < 8; i++)
		bytes[1 + i] = value >> 8 * i;
	return incise_crc32c(crc, bytes, sizeof(bytes));
}

static uint32_t add_value(uint32_t crc, sqlite3_stmt *stmt, int column)
{
	uint64_t bits;
	double real;
	const void *bytes;
	int n;

	switch (sqlite3_column_type(stmt, column)) {
	case SQLITE_INTEGER:
		return add_number(crc, 'i', sqlite3_column_int64(stmt, column));
	case SQLITE_FLOAT:
		real = sqlite3_column_double(stmt, column);
		memcpy(&bits, &real, sizeof(bits));
		return add_number(crc, 'r', bits);
	case SQLITE_TEXT:
		bytes = sqlite3_column_text(stmt, column); /* before its length */
		n = sqlite3_column_bytes(stmt, column);
		crc = add_number(crc, 't', n);
		return bytes ? incise_crc32c(crc, bytes, n) : crc;
	case SQLITE_BLOB:
		bytes = sqlite3_column_blob(stmt, column);
		n = sqlite3_column_bytes(stmt, column);
		crc = add_number(crc, 'b', n);
		return bytes ? incise_crc32c(crc, bytes, n) : crc;
	default:
		return incise_crc32c(crc, "n", 1);
	}
}

int incise_ledger_seal(sqlite3 *db, const char *table, struct incise_ledger_block *block)
{
	sqlite3_stmt *stmt;
	size_t i = 0;
	int rc;

	while (i < sizeof(tables) / sizeof(*tables) && strcmp(tables[i].table, table))
		i++;
	if (i == sizeof(tables) / sizeof(*tables))
		return SQLITE_ERROR;
	rc = sqlite3_prepare_v2(db, tables[i].sql, -1, &stmt, NULL);
	if (rc != SQLITE_OK)
		return rc;
	*block = (struct incise_ledger_block){0};
	while ((rc = sqlite3_step(stmt)) == SQLITE_ROW) {
		block->count++;
		for (int j = 0; j < sqlite3_column_count(stmt); j++)
			block->crc = add_value(block->crc, stmt, j);
	}
	incise_ledger_seal_block(block);
	return sqlite3_finalize(stmt); /* tells of a failed step as well */
}

int incise_ledger_seal_head(int fd, struct incise_ledger_block *block)
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
	if (found)
		n = found - head;
	*block = (struct incise_ledger_block){
		.count = n,
		.crc = incise_crc32c(0, head, n),
	};
	free(head);
	incise_ledger_seal_block(block);
	return 0;
}
