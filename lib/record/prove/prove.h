/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Inside a proof; for lib/record/prove/ only.
 *
 *     prove.c        the recording, its statements, and who vouches for them
 *     sign.c         a statement, a signature and a time-stamp of the recording as it is
 *     seal_files.c   the folder seal/, and the text of a statement in it
 *     signature.c    ssh-keygen
 *     timestamp.c    RFC 3161, by libcrypto
 *     lineage.c      the files that a file was made of
 */
#ifndef INCISE_PROVE_PRIVATE_H
#define INCISE_PROVE_PRIVATE_H

#include <limits.h>
#include <incise/origin.h>
#include <incise/prove.h>
#include "../../base/crypto/sha256.h"

/* With calibrations. */
#define INCISE_SEAL_STATEMENT_MAX (16 * INCISE_STATEMENT_MAX)
#define INCISE_SIGNATURE_MAX 65536	  /* bytes */
#define INCISE_TIMESTAMP_MAX (256 * 1024) /* bytes of a reply */

/* Any bytes. */
struct incise_bytes {
	char *bytes; /* with a NUL behind them; free(3); NULL: none */
	size_t n;
};

/* --- prove.c ---------------------------------------------------------------------------- */

/* The folder of a recording, without its choice: free(3). NULL and the reason. */
char *incise_proof_folder(const char *path, struct incise_error *err);

/* --- lineage.c -------------------------------------------------------------------------- */

/* Append an origin at @at to @text, of @size; nothing if it does not fit. Returns the new length. */
size_t incise_origin_put(const struct incise_origin *origin, char *text, size_t size,
			 size_t at);

/* --- seal_files.c ----------------------------------------------------------------------- */

struct incise_seal_file {
	char name[100]; /* letters, digits, '.', '_' and '-' */
	int number;	/* of its statement, from 1 */
	enum incise_proof_kind kind;
	struct incise_bytes content; /* none: not read, see why */
	char why[100];
};

struct incise_seal_files {
	struct incise_seal_file *all; /* by number, statements first */
	int n;
};

/*
 * Read the files in a folder of a recording. Those of other names are passed over; links, devices and
 * too large ones are listed, but not read. Returns 0, also if there is no such folder, or -errno;
 * incise_seal_files_free() in both cases.
 */
int incise_seal_files_read(struct incise_seal_files *files, const char *recording,
			   const char *name, struct incise_error *err);
void incise_seal_files_free(struct incise_seal_files *files);

/*
 * A line for each calibration after the fact of a recording (incise/recalibration.h), which stand
 * behind the end of its statement; the last one is that by which it is read:
 *
 *     calibration calibration/0001-20261127T054012Z.conf 0123…    SHA-256 of the file
 *
 * free(3); NULL and the reason.
 */
char *incise_proof_calibrations(const char *recording, struct incise_error *err);

/* The bytes of a statement before these lines; 0: it has no end. */
size_t incise_proof_statement_length(const struct incise_bytes *text);

/* --- sign.c ----------------------------------------------------------------------------- */

/*
 * Sign and time-stamp a recording, a member of a joined one, or a join, whose statement is @join. Adds
 * to seal->statements and seal->vouchers, which have room, what it made. Returns 0 or -errno.
 *
 * @watch: of the verification before; sets @altered to its first finding that is no loss
 */
int incise_proof_sign(struct incise_proof_seal *seal,
		      const struct incise_seal_files *files, const char *join,
		      bool member, const struct incise_prove_options *options,
		      const struct incise_verify_watch *watch, const char *altered,
		      struct incise_error *err);

/* --- signature.c ------------------------------------------------------------------------ */

/* Files that say who may sign, each read once and whole; from pipes, too. */
struct incise_signers {
	struct incise_bytes allowed, revoked;
};

/* @revoked: or NULL. Returns 0 or -errno; incise_signers_free() in both cases. */
int incise_signers_read(struct incise_signers *signers, const char *path,
			const char *revoked, struct incise_error *err);
void incise_signers_free(struct incise_signers *signers);

/* Sign a text: lines of ASCII. Returns 0 or -errno. */
int incise_signature_make(const char *key, const struct incise_bytes *text,
			  struct incise_bytes *signature, struct incise_error *err);

/*
 * Check a signature, which may be any bytes: sets verdict, by, key and why.
 *
 * @signers: NULL: its key is not compared with any, and a right one is INCISE_PROOF_UNCHECKED
 * @at_s: seconds since 1970 at which its key must be valid; -1: now
 * Returns 0, or -errno and the reason if it could not be checked.
 */
int incise_signature_check(struct incise_proof_voucher *voucher,
			   const struct incise_bytes *text,
			   const struct incise_bytes *signature,
			   const struct incise_signers *signers, int64_t at_s,
			   struct incise_error *err);

/* --- timestamp.c ------------------------------------------------------------------------ */

#define INCISE_TIMESTAMP_QUERY 69

/* Make a query of RFC 3161 with a random nonce, for the certificates, too. Returns 0 or -errno. */
int incise_timestamp_query(const uint8_t digest[INCISE_SHA256_BYTES],
			   uint8_t query[INCISE_TIMESTAMP_QUERY],
			   struct incise_error *err);

/*
 * Send a query to a server, http://HOST[:PORT]/PATH, also through the proxy in http_proxy. An answer
 * takes 30 s at most. Returns 0 or -errno.
 */
int incise_timestamp_ask(const char *server, const uint8_t query[INCISE_TIMESTAMP_QUERY],
			 struct incise_bytes *reply, struct incise_error *err);

/* Certificates of authorities that are trusted, in PEM, as libcrypto keeps them. NULL and the reason. */
struct x509_store_st *incise_authorities_read(const char *path, struct incise_error *err);
void incise_authorities_free(struct x509_store_st *authorities);

/*
 * Read a reply, which may be any bytes, into verdict, utc, t_s and by: it must grant a time-stamp for
 * this digest, answer the query, and be signed by one of the authorities. Without these nothing in it
 * is trusted, as anybody may have made it.
 *
 * @name: for messages
 * @query, @authorities: or NULL
 * Returns 0, or -errno: EPROTO (no reply), EACCES (not granted, not trusted), EBADMSG (for something else).
 */
int incise_timestamp_read(const struct incise_bytes *reply, const char *name,
			  const uint8_t digest[INCISE_SHA256_BYTES], const uint8_t *query,
			  struct x509_store_st *authorities,
			  struct incise_proof_voucher *voucher, struct incise_error *err);

#endif
