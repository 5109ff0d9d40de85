// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The chain of SHA-256 over the commits of a recording; see seal_chain.h.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "seal_chain.h"
#include "statement.h"

/* The first line of a chain over rows, or over blocks. */
#define GENESIS(old) ((old) ? "incise seal 1\n" : "incise seal 2\n")
/* Reads nothing in place of table depth, which today's format has not. */
#define NO_ROWS "SELECT 1 WHERE 0"

/*
 * Table meta in four parts: the keys of START and CALIBRATION, those that are rewritten, and all
 * others, which are the configuration: a new key is in one of them whatever it is.
 */
#define START "'boot', 'host', 'identity', 'incise', 'kernel', 'started'"
#define CALIBRATION \
	"'calibration_conf', 'depth_mm_px', 'force_mV_N', 'tip_x_mm', 'tip_y_mm', 'tip_z_mm'"
#define REWRITTEN                                                                                           \
	"'camera_note', 'complete', 'cut_ends_ns', 'cuts', 'depth_max_mm', 'depth_rows', 'force_clipped', " \
	"'force_lost', 'force_max_N', 'force_rows', "                                                       \
	"'force_zero_mV', 'force_zero_samples', 'force_zero_sd_mV', 'frames_lost', "                        \
	"'frames_rows', 'frames_unlooked', 'tracker_lost', 'tracker_rows', 'wall_rows'"
#define KEYS(which) "SELECT key, value FROM meta WHERE key " which " ORDER BY key"

static const char *const meta_sql[INCISE_SEAL_PARTS] = {
	[INCISE_SEAL_START] = KEYS("IN (" START ")"),
	[INCISE_SEAL_CONFIGURATION] =
		KEYS("NOT IN (" START ", " CALIBRATION ", " REWRITTEN ")"),
	[INCISE_SEAL_CALIBRATION] = KEYS("IN (" CALIBRATION ")"),
	[INCISE_SEAL_META] = KEYS("IN (" REWRITTEN ")"),
};

/* --- digests -------------------------------------------------------------------------- */

static void add_integer(struct incise_sha256 *to, uint64_t value)
{
	uint8_t bytes[8];

	for (int i = 0; i < 8; i++)
		bytes[i] = value >> 8 * i;
	incise_sha256_add(to, bytes, sizeof(bytes));
}

static void to_digest(void *user, const void *bytes, size_t n)
{
	incise_sha256_add(user, bytes, n);
}

int incise_seal_table(const struct incise_seal *seal, sqlite3 *db,
		      enum incise_seal_number part, uint64_t *rows,
		      uint8_t digest[INCISE_SEAL_BYTES])
{
	const char *sql = meta_sql[part] ? meta_sql[part]
			  : part == INCISE_SEAL_DEPTH && !seal->old
				  ? NO_ROWS
				  : incise_ledger_sql(incise_seal_parts[part]);
	struct incise_sha256 sha = {0};
	int rc;

	incise_sha256_start(&sha);
	rc = incise_ledger_values(db, sql, to_digest, &sha, rows);
	incise_sha256_take(&sha, digest);
	if (rc == SQLITE_OK && sha.failed)
		rc = SQLITE_NOMEM;
	incise_sha256_free(&sha);
	return rc;
}

int incise_seal_file(int fd, int64_t length, uint8_t digest[INCISE_SEAL_BYTES])
{
	struct incise_sha256 sha = {0};
	size_t n;
	uint8_t *head;
	int rc = incise_ledger_file_head(fd, &head, &n);

	if (rc)
		return rc;
	incise_sha256_start(&sha);
	incise_sha256_add(&sha, head, n);
	add_integer(&sha, length);
	incise_sha256_take(&sha, digest);
	free(head);
	rc = sha.failed ? -ENOMEM : 0;
	incise_sha256_free(&sha);
	return rc;
}

/* --- the chain ------------------------------------------------------------------------ */

/* Libcrypto did, which has no memory then. */
static bool has_failed(const struct incise_seal *seal)
{
	bool failed = seal->commit.failed;

	for (int i = 0; i < INCISE_LEDGER_FORMS; i++)
		failed |= seal->rows[i].failed;
	return failed;
}

int incise_seal_init(struct incise_seal *seal)
{
	*seal = (struct incise_seal){0};
	incise_sha256_start(&seal->commit);
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++)
		incise_sha256_start(&seal->rows[i]);
	return has_failed(seal) ? -ENOMEM : 0;
}

void incise_seal_free(struct incise_seal *seal)
{
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++)
		incise_sha256_free(&seal->rows[i]);
	incise_sha256_free(&seal->commit);
	*seal = (struct incise_seal){0};
}

void incise_seal_resume(struct incise_seal *seal, const uint8_t head[INCISE_SEAL_BYTES])
{
	memmove(seal->head, head, INCISE_SEAL_BYTES);
	incise_sha256_start(&seal->commit);
	incise_sha256_add(&seal->commit, seal->head, INCISE_SEAL_BYTES);
}

int incise_seal_start(struct incise_seal *seal, sqlite3 *db)
{
	uint8_t head[INCISE_SEAL_BYTES], part[INCISE_SEAL_BYTES];
	uint64_t rows;
	int rc = SQLITE_OK;

	incise_sha256_start(&seal->commit);
	incise_sha256_add(&seal->commit, GENESIS(seal->old), strlen(GENESIS(seal->old)));
	for (int i = INCISE_SEAL_START; i < INCISE_SEAL_STREAM && rc == SQLITE_OK; i++) {
		rc = incise_seal_table(seal, db, i, &rows, part);
		incise_sha256_add(&seal->commit, part, sizeof(part));
	}
	incise_sha256_take(&seal->commit, head);
	incise_seal_resume(seal, head);
	return rc == SQLITE_OK && has_failed(seal) ? SQLITE_NOMEM : rc;
}

void incise_seal_row(struct incise_seal *seal, int stream, const void *bytes, size_t n)
{
	incise_sha256_add(&seal->rows[stream], bytes, n);
	seal->n_rows[stream]++;
}

void incise_seal_rows_block(struct incise_seal *seal, int stream,
			    const struct incise_ledger_block *block,
			    const uint8_t digest[INCISE_SEAL_BYTES])
{
	const uint64_t values[] = {block->block,    block->first_seq, block->last_seq,
				   block->first_ns, block->last_ns,   block->count,
				   block->lost,	    block->crc};
	struct incise_sha256 *rows = &seal->rows[stream]; /* it has none now */

	add_integer(&seal->commit, stream);
	incise_sha256_add(rows, seal->chain[stream], INCISE_SEAL_BYTES);
	for (size_t i = 0; i < sizeof(values) / sizeof(*values); i++) {
		add_integer(&seal->commit, values[i]);
		add_integer(rows, values[i]);
	}
	incise_sha256_add(&seal->commit, digest, INCISE_SEAL_BYTES);
	incise_sha256_add(rows, digest, INCISE_SEAL_BYTES);
	incise_sha256_take(rows, seal->chain[stream]);
	incise_sha256_start(rows);
	seal->blocks[stream]++;
}

void incise_seal_block(struct incise_seal *seal, int stream,
		       const struct incise_ledger_block *block,
		       uint8_t digest[INCISE_SEAL_BYTES])
{
	incise_sha256_take(&seal->rows[stream], digest);
	incise_sha256_start(&seal->rows[stream]);
	incise_seal_rows_block(seal, stream, block, digest);
}

void incise_seal_data(struct incise_seal *seal, int stream,
		      const struct incise_ledger_block *block, const void *data,
		      size_t size, uint8_t digest[INCISE_SEAL_BYTES])
{
	incise_sha256_add(&seal->rows[stream], data, size);
	seal->n_rows[stream] += block->count;
	incise_seal_block(seal, stream, block, digest);
}

int incise_seal_tables(struct incise_seal *seal, sqlite3 *db, int fd, int64_t length)
{
	uint8_t digest[INCISE_SEAL_BYTES];
	int rc = SQLITE_OK;
	uint64_t rows;

	for (int i = INCISE_SEAL_DEPTH; i < INCISE_SEAL_FILE && rc == SQLITE_OK; i++) {
		rc = incise_seal_table(seal, db, i, &rows, digest);
		incise_sha256_add(&seal->commit, digest, sizeof(digest));
	}
	if (rc != SQLITE_OK || fd < 0)
		return rc;
	if (incise_seal_file(fd, length, digest))
		return SQLITE_IOERR;
	incise_sha256_add(&seal->commit, digest, sizeof(digest));
	return SQLITE_OK;
}

bool incise_seal_commit(struct incise_seal *seal, int64_t t_ns)
{
	uint8_t head[INCISE_SEAL_BYTES];

	add_integer(&seal->commit, seal->next++);
	add_integer(&seal->commit, t_ns);
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++)
		add_integer(&seal->commit, seal->blocks[i]);
	incise_sha256_take(&seal->commit, head);
	incise_seal_resume(seal, head);
	return !has_failed(seal);
}
