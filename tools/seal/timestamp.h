/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Time-stamps of RFC 3161: an authority signs the SHA-256 of a text together with the time. Queries
 * and replies are those of openssl-ts(1), in DER.
 */
#ifndef INCISE_TIMESTAMP_H
#define INCISE_TIMESTAMP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>

#define TIMESTAMP_MAX (256 * 1024) /* bytes of a query or a reply */
#define TIMESTAMP_DIGEST 32

struct timestamp {
	int64_t t_s;  /* seconds since 1970, UTC */
	char utc[32]; /* the same as text, "2026-11-27T05:00:00Z" */
	char authority
		[300]; /* subject of the certificate that signed it; "" if it is not in the reply */
};

/* Any bytes: free(3) them. NULL: none. */
struct der {
	unsigned char *bytes;
	size_t n;
};

/* Whether this text names a server rather than a file: it begins with "http://" or "https://". */
bool timestamp_is_server(const char *text);

/* SHA-256 of a text. */
void timestamp_digest(const char *text, size_t n, unsigned char digest[TIMESTAMP_DIGEST]);

/*
 * Make a query with a random nonce that asks for the certificates, too. Returns 0 or -errno.
 */
int timestamp_query(const unsigned char digest[TIMESTAMP_DIGEST], struct der *query,
		    struct incise_error *err);

/*
 * Send a query to a server, http://HOST[:PORT]/PATH, also through the proxy in http_proxy. An answer
 * takes 30 s at most. Returns 0 or -errno.
 */
int timestamp_ask(const char *server, const struct der *query, struct der *reply,
		  struct incise_error *err);

/*
 * Read a reply, which may be any bytes: it must grant a time-stamp for this digest, and, if @query is
 * not NULL, answer that one. Nothing in it is trusted yet, as anybody may have made it.
 *
 * @name: for messages
 * Returns 0, or -errno: EPROTO (no reply), EACCES (not granted), EBADMSG (for something else).
 */
int timestamp_read(const struct der *reply, const char *name,
		   const unsigned char digest[TIMESTAMP_DIGEST], const struct der *query,
		   struct timestamp *timestamp, struct incise_error *err);

/* Certificates of authorities that are trusted. */
struct authorities;

/* Read them from a file in PEM. authorities_free(). NULL and the reason. */
struct authorities *authorities_read(const char *path, struct incise_error *err);

void authorities_free(struct authorities *authorities);

/*
 * Check a reply that timestamp_read() took: one of the authorities, or a certificate that they issued
 * for time-stamping and that was valid at that time, has signed it. Returns 0, or -EACCES and the reason.
 */
int timestamp_check(const struct der *reply, const char *name,
		    const unsigned char digest[TIMESTAMP_DIGEST],
		    const struct authorities *authorities, struct incise_error *err);

#endif
