// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The chain of SHA-256 over the commits of a recording; see seal_chain.h.
 */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "seal_chain.h"
#include "statement.h"

/* Of rows, or of blocks. */
#define GENESIS(old) ((old) ? "incise seal 1\n" : "incise seal 2\n")
/* Of table depth, which today's format has not. */
#define NO_ROWS "SELECT 1 WHERE 0"

/*
 * Table meta in four parts: the keys of START and CALIBRATION, those that are rewritten, and all
 * others, which are the configuration: a new key is in one of them whatever it is.
 */
#define START "'boot', 'host', 'identity', 'incise', 'kernel', 'started'"
#define CALIBRATION \
	"'calibration_conf', 'depth_mm_px', 'force_mV_N', 'tip_x_mm', 'tip_y_mm', 'tip_z_mm'"
#define REWRITTEN                                                                            \
	"'complete', 'cut_ends_ns', 'cuts', 'depth_max_mm', 'depth_rows', 'force_clipped', " \
	"'force_lost', 'force_max_N', 'force_rows', "                                        \
	"'force_zero_mV', 'force_zero_samples', 'force_zero_sd_mV', 'frames_lost', "         \
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

static void add(bool *failed, EVP_MD_CTX *to, const void *bytes, size_t n)
{
	*failed |= !EVP_DigestUpdate(to, bytes, n);
}

static void add_integer(bool *failed, EVP_MD_CTX *to, uint64_t value)
{
	uint8_t bytes[8];

	for (int i = 0; i < 8; i++)
		bytes[i] = value >> 8 * i;
	add(failed, to, bytes, sizeof(bytes));
}

static void start(const struct incise_seal *seal, bool *failed, EVP_MD_CTX *digest)
{
	*failed |= !EVP_DigestInit_ex(digest, seal->sha256, NULL);
}

static void end(bool *failed, EVP_MD_CTX *digest, uint8_t bytes[INCISE_SEAL_BYTES])
{
	*failed |= !EVP_DigestFinal_ex(digest, bytes, NULL);
}

void incise_seal_hex(const uint8_t bytes[INCISE_SEAL_BYTES],
		     char hex[2 * INCISE_SEAL_BYTES + 1])
{
	static const char digits[] = "0123456789abcdef";

	for (int i = 0; i < INCISE_SEAL_BYTES; i++) {
		hex[2 * i] = digits[bytes[i] >> 4];
		hex[2 * i + 1] = digits[bytes[i] & 15];
	}
	hex[2 * INCISE_SEAL_BYTES] = '\0';
}

struct sink {
	EVP_MD_CTX *digest;
	bool failed;
};

static void to_digest(void *user, const void *bytes, size_t n)
{
	struct sink *sink = user;

	add(&sink->failed, sink->digest, bytes, n);
}

int incise_seal_table(const struct incise_seal *seal, sqlite3 *db,
		      enum incise_seal_number part, uint64_t *rows,
		      uint8_t digest[INCISE_SEAL_BYTES])
{
	const char *sql = meta_sql[part] ? meta_sql[part]
			  : part == INCISE_SEAL_DEPTH && !seal->old
				  ? NO_ROWS
				  : incise_ledger_sql(incise_seal_parts[part]);
	struct sink sink = {.digest = EVP_MD_CTX_new()};
	int rc = SQLITE_NOMEM;

	if (sink.digest) {
		start(seal, &sink.failed, sink.digest);
		rc = incise_ledger_values(db, sql, to_digest, &sink, rows);
		end(&sink.failed, sink.digest, digest);
	}
	EVP_MD_CTX_free(sink.digest);
	return rc == SQLITE_OK && sink.failed ? SQLITE_NOMEM : rc;
}

int incise_seal_file(const struct incise_seal *seal, int fd, int64_t length,
		     uint8_t digest[INCISE_SEAL_BYTES])
{
	EVP_MD_CTX *context = EVP_MD_CTX_new();
	bool failed = !context;
	size_t n;
	uint8_t *head;
	int rc;

	if (failed)
		return -ENOMEM;
	rc = incise_ledger_file_head(fd, &head, &n);
	if (!rc) {
		start(seal, &failed, context);
		add(&failed, context, head, n);
		add_integer(&failed, context, length);
		end(&failed, context, digest);
		free(head);
	}
	EVP_MD_CTX_free(context);
	return !rc && failed ? -ENOMEM : rc;
}

/* --- the chain ------------------------------------------------------------------------ */

int incise_seal_init(struct incise_seal *seal)
{
	*seal = (struct incise_seal){0};
	seal->sha256 = EVP_MD_fetch(NULL, "SHA256", NULL);
	if (!seal->sha256)
		return -ENOTSUP;
	seal->commit = EVP_MD_CTX_new();
	seal->failed = !seal->commit;
	for (int i = 0; i < INCISE_LEDGER_FORMS && !seal->failed; i++) {
		seal->rows[i] = EVP_MD_CTX_new();
		seal->failed = !seal->rows[i];
		if (!seal->failed)
			start(seal, &seal->failed, seal->rows[i]);
	}
	return seal->failed ? -ENOMEM : 0;
}

void incise_seal_free(struct incise_seal *seal)
{
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++)
		EVP_MD_CTX_free(seal->rows[i]);
	EVP_MD_CTX_free(seal->commit);
	EVP_MD_free(seal->sha256);
	*seal = (struct incise_seal){0};
}

void incise_seal_resume(struct incise_seal *seal, const uint8_t head[INCISE_SEAL_BYTES])
{
	memmove(seal->head, head, INCISE_SEAL_BYTES);
	start(seal, &seal->failed, seal->commit);
	add(&seal->failed, seal->commit, seal->head, INCISE_SEAL_BYTES);
}

int incise_seal_start(struct incise_seal *seal, sqlite3 *db)
{
	uint8_t head[INCISE_SEAL_BYTES], part[INCISE_SEAL_BYTES];
	uint64_t rows;
	int rc = SQLITE_OK;

	start(seal, &seal->failed, seal->commit);
	add(&seal->failed, seal->commit, GENESIS(seal->old), strlen(GENESIS(seal->old)));
	for (int i = INCISE_SEAL_START; i < INCISE_SEAL_STREAM && rc == SQLITE_OK; i++) {
		rc = incise_seal_table(seal, db, i, &rows, part);
		add(&seal->failed, seal->commit, part, sizeof(part));
	}
	end(&seal->failed, seal->commit, head);
	incise_seal_resume(seal, head);
	return rc == SQLITE_OK && seal->failed ? SQLITE_NOMEM : rc;
}

void incise_seal_row(struct incise_seal *seal, int stream, const void *bytes, size_t n)
{
	add(&seal->failed, seal->rows[stream], bytes, n);
	seal->n_rows[stream]++;
}

void incise_seal_rows_block(struct incise_seal *seal, int stream,
			    const struct incise_ledger_block *block,
			    const uint8_t digest[INCISE_SEAL_BYTES])
{
	const uint64_t values[] = {block->block,    block->first_seq, block->last_seq,
				   block->first_ns, block->last_ns,   block->count,
				   block->lost,	    block->crc};
	EVP_MD_CTX *rows = seal->rows[stream]; /* it has none now */
	bool *failed = &seal->failed;

	add_integer(failed, seal->commit, stream);
	add(failed, rows, seal->chain[stream], INCISE_SEAL_BYTES);
	for (size_t i = 0; i < sizeof(values) / sizeof(*values); i++) {
		add_integer(failed, seal->commit, values[i]);
		add_integer(failed, rows, values[i]);
	}
	add(failed, seal->commit, digest, INCISE_SEAL_BYTES);
	add(failed, rows, digest, INCISE_SEAL_BYTES);
	end(failed, rows, seal->chain[stream]);
	start(seal, failed, rows);
	seal->blocks[stream]++;
}

void incise_seal_block(struct incise_seal *seal, int stream,
		       const struct incise_ledger_block *block,
		       uint8_t digest[INCISE_SEAL_BYTES])
{
	end(&seal->failed, seal->rows[stream], digest);
	start(seal, &seal->failed, seal->rows[stream]);
	incise_seal_rows_block(seal, stream, block, digest);
}

void incise_seal_data(struct incise_seal *seal, int stream,
		      const struct incise_ledger_block *block, const void *data,
		      size_t size, uint8_t digest[INCISE_SEAL_BYTES])
{
	add(&seal->failed, seal->rows[stream], data, size);
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
		add(&seal->failed, seal->commit, digest, sizeof(digest));
	}
	if (rc != SQLITE_OK || fd < 0)
		return rc;
	if (incise_seal_file(seal, fd, length, digest))
		return SQLITE_IOERR;
	add(&seal->failed, seal->commit, digest, sizeof(digest));
	return SQLITE_OK;
}

bool incise_seal_commit(struct incise_seal *seal, int64_t t_ns)
{
	uint8_t head[INCISE_SEAL_BYTES];

	add_integer(&seal->failed, seal->commit, seal->next++);
	add_integer(&seal->failed, seal->commit, t_ns);
	for (int i = 0; i < INCISE_LEDGER_FORMS; i++)
		add_integer(&seal->failed, seal->commit, seal->blocks[i]);
	end(&seal->failed, seal->commit, head);
	incise_seal_resume(seal, head);
	return !seal->failed;
}
