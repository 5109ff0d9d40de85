/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * SHA-256 (FIPS 180-4) by libcrypto. It has a folder of its own, as libincise, which the haptic loop
 * maps, has no libcrypto; the libraries and modules that need it hold it.
 */
#ifndef INCISE_SHA256_H
#define INCISE_SHA256_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>

#define INCISE_SHA256_BYTES 32
#define INCISE_SHA256_TEXT (2 * INCISE_SHA256_BYTES + 1)

/* Begins as {0}; may be started any number of times. */
struct incise_sha256 {
	void *digest; /* EVP_MD_CTX of libcrypto */
	bool failed;  /* libcrypto did, which has no memory then; stays */
};

void incise_sha256_start(struct incise_sha256 *sha);
void incise_sha256_add(struct incise_sha256 *sha, const void *bytes, size_t n);
void incise_sha256_take(struct incise_sha256 *sha, uint8_t bytes[INCISE_SHA256_BYTES]);
void incise_sha256_free(struct incise_sha256 *sha);

/* Take it as text, and free it. Returns 0; or -ENOMEM and no digits. */
int incise_sha256_end(struct incise_sha256 *sha, char hex[INCISE_SHA256_TEXT]);

/* The digest of some bytes, and as text. Returns 0 or -ENOMEM. */
int incise_sha256_of(const void *bytes, size_t n, uint8_t digest[INCISE_SHA256_BYTES]);
int incise_sha256_text(const void *bytes, size_t n, char hex[INCISE_SHA256_TEXT]);

/*
 * That of a file. @stop, or NULL, is asked after each @n bytes and ends it, with the digest of a part. Returns
 * 0, or the negative errno of open(2) or read(2).
 */
int incise_sha256_file(const char *path, char hex[INCISE_SHA256_TEXT],
		       bool (*stop)(void *user, size_t n), void *user,
		       struct incise_error *err);

/* 64 lower-case hexadecimal digits and a NUL. */
void incise_sha256_hex(const uint8_t bytes[INCISE_SHA256_BYTES],
		       char hex[INCISE_SHA256_TEXT]);

#endif
