// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Time-stamps of RFC 3161 by libcrypto: an authority signs the SHA-256 of a text together with the
 * time. Queries and replies are those of openssl-ts(1), in DER.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <incise/infile.h>
#include <openssl/err.h>
#include <openssl/http.h>
#include <openssl/pem.h>
#include <openssl/ts.h>
#include "../../base/control_character.h"
#include "prove.h"

#define NONCE_BYTES 8
#define WAIT_S 30
#define AUTHORITIES_MAX (1024 * 1024) /* bytes of a file of certificates */

/* The last error of libcrypto, and forget them all. */
static const char *take_reason(char text[160])
{
	unsigned long code = ERR_peek_last_error();
	const char *data = "", *said = ERR_reason_error_string(code);
	int flags = 0;

	ERR_peek_last_error_data(&data, &flags);
	if (ERR_SYSTEM_ERROR(ERR_peek_error()))
		snprintf(text, 160, "%s", strerror(ERR_GET_REASON(ERR_peek_error())));
	else
		snprintf(text, 160, "%s%s%s", said ? said : "not possible",
			 flags & ERR_TXT_STRING && *data ? ": " : "",
			 flags & ERR_TXT_STRING ? data : "");
	ERR_clear_error();
	return text;
}

/*
 * --- query: TimeStampReq of RFC 3161, whose length never changes ----------------------------
 *
 *     30 43                                          what follows
 *        02 01 01                                    version 1
 *        30 31 30 0d 06 09 … 05 00 04 20  digest     SHA-256 and the digest
 *        02 08  nonce                                8 bytes, positive, none of them left out
 *        01 01 ff                                    with the certificates
 */

static const uint8_t before_digest[] = {0x30, 0x43, 0x02, 0x01, 0x01, 0x30, 0x31, 0x30,
					0x0d, 0x06, 0x09, 0x60, 0x86, 0x48, 0x01, 0x65,
					0x03, 0x04, 0x02, 0x01, 0x05, 0x00, 0x04, 0x20};
#define NONCE (sizeof(before_digest) + INCISE_SHA256_BYTES + 2)

int incise_timestamp_query(const uint8_t digest[INCISE_SHA256_BYTES],
			   uint8_t query[INCISE_TIMESTAMP_QUERY],
			   struct incise_error *err)
{
	static const uint8_t before_nonce[] = {0x02, NONCE_BYTES},
			     behind[] = {0x01, 0x01, 0xff};

	memcpy(query, before_digest, sizeof(before_digest));
	memcpy(query + sizeof(before_digest), digest, INCISE_SHA256_BYTES);
	memcpy(query + NONCE - 2, before_nonce, sizeof(before_nonce));
	if (getentropy(query + NONCE, NONCE_BYTES))
		return incise_error_set(err, errno, "a query for a time-stamp: %s",
					strerror(errno));
	query[NONCE] = (query[NONCE] & 0x7f) | 1;
	memcpy(query + NONCE + NONCE_BYTES, behind, sizeof(behind));
	return 0;
}

/* --- server ---------------------------------------------------------------------------- */

/* The reply, which libcrypto has read into memory. Returns 0 or -errno. */
static int copy_reply(BIO *bio, struct incise_bytes *to)
{
	char *bytes;
	long n = BIO_get_mem_data(bio, &bytes);

	to->bytes = n > 0 ? malloc((size_t)n) : NULL;
	if (!to->bytes)
		return n > 0 ? -ENOMEM : -EIO;
	memcpy(to->bytes, bytes, (size_t)n);
	to->n = (size_t)n;
	return 0;
}

/*
 * A connection to a server, at the first try: OSSL_HTTP_transfer() asks one that refuses again and
 * again until its time is over. NULL and an error of libcrypto.
 */
static BIO *connect_once(const char *host, const char *port)
{
	const time_t end = time(NULL) + WAIT_S;
	BIO *bio = BIO_new(BIO_s_connect());
	int rc = -1;

	if (!bio)
		return NULL;
	BIO_set_conn_hostname(bio, host);
	BIO_set_conn_port(bio, port);
	BIO_set_nbio(bio, 1);
	ERR_set_mark();
	while ((rc = BIO_do_connect(bio)) <= 0 && BIO_should_retry(bio) &&
	       BIO_wait(bio, end, 100) > 0)
		;
	if (rc > 0) {
		ERR_pop_to_mark();
		return bio;
	}
	ERR_clear_last_mark();
	BIO_free(bio);
	return NULL;
}

int incise_timestamp_ask(const char *server, const uint8_t query[INCISE_TIMESTAMP_QUERY],
			 struct incise_bytes *reply, struct incise_error *err)
{
	char *host = NULL, *port = NULL, *path = NULL, text[160];
	BIO *in = NULL, *out = NULL, *line = NULL;
	bool proxy;
	int tls = 0, rc;

	*reply = (struct incise_bytes){0};
	ERR_clear_error(); /* of others, before: take_reason() names the first */
	if (!OSSL_HTTP_parse_url(server, &tls, NULL, &host, &port, NULL, &path, NULL,
				 NULL))
		return incise_error_set(err, EINVAL, "%s: %s; give http://HOST/PATH",
					server, take_reason(text));
	if (tls) {
		rc = incise_error_set(
			err, EOPNOTSUPP,
			"%s: https is not supported, and a time-stamp needs "
			"none, as it is signed; give the authority's http:// "
			"address, or send a query FILE.tsq yourself",
			server);
	} else {
		in = BIO_new_mem_buf(query, INCISE_TIMESTAMP_QUERY);
		proxy = OSSL_HTTP_adapt_proxy(NULL, NULL, host, 0);
		line = in && !proxy ? connect_once(host, port) : NULL;
		if (in && (line || proxy))
			out = OSSL_HTTP_transfer(NULL, host, port, path, 0, NULL, NULL,
						 line, NULL, NULL, NULL, 0, NULL,
						 "application/timestamp-query", in,
						 "application/timestamp-reply", 1,
						 INCISE_TIMESTAMP_MAX, WAIT_S, 0);
		rc = out ? copy_reply(out, reply) : -EIO;
		if (rc)
			incise_error_set(err, -rc,
					 "%s: no time-stamp: %s; try again, or another "
					 "authority",
					 server, out ? strerror(-rc) : take_reason(text));
	}
	BIO_free(in);
	BIO_free_all(out);
	BIO_free(line);
	OPENSSL_free(host);
	OPENSSL_free(port);
	OPENSSL_free(path);
	return rc;
}

/* --- trust ----------------------------------------------------------------------------- */

void incise_authorities_free(struct x509_store_st *authorities)
{
	X509_STORE_free(authorities);
}

struct x509_store_st *incise_authorities_read(const char *path, struct incise_error *err)
{
	static const struct incise_infile_kind kind = {
		.name = "a file of certificates",
		.advice = "give certificates of authorities in PEM",
		.size_max = AUTHORITIES_MAX,
	};
	size_t n;
	char *text = incise_infile_read(path, &kind, &n, err);
	BIO *in = text ? BIO_new_mem_buf(text, (int)n) : NULL;
	X509_STORE *store = text ? X509_STORE_new() : NULL;
	int added = 0;

	for (X509 *one; in && store && (one = PEM_read_bio_X509(in, NULL, NULL, NULL));
	     X509_free(one))
		added += X509_STORE_add_cert(store, one);
	BIO_free(in);
	ERR_clear_error();
	if (text && !added) {
		X509_STORE_free(store);
		store = NULL;
		incise_error_set(err, EINVAL,
				 "%s: no certificate in it; give those of authorities in "
				 "PEM",
				 path);
	}
	free(text);
	return store;
}

/*
 * Whether one of the authorities, or a certificate that they issued for time-stamping, has signed it;
 * one that has expired since then was good.
 */
static bool is_trusted(TS_RESP *response, int64_t t_s,
		       const uint8_t digest[INCISE_SHA256_BYTES], X509_STORE *store)
{
	TS_VERIFY_CTX *context = TS_VERIFY_CTX_new();
	unsigned char *imprint = OPENSSL_memdup(digest, INCISE_SHA256_BYTES);
	bool good;

	/* The context owns what is set. */
	if (!context || !imprint || !X509_STORE_up_ref(store)) {
		TS_VERIFY_CTX_free(context);
		OPENSSL_free(imprint);
		return false;
	}
	X509_VERIFY_PARAM_set_time(X509_STORE_get0_param(store), t_s);
	TS_VERIFY_CTX_set_flags(context,
				TS_VFY_VERSION | TS_VFY_IMPRINT | TS_VFY_SIGNATURE);
#if OPENSSL_VERSION_NUMBER >= 0x30400000L
	TS_VERIFY_CTX_set0_store(context, store);
	TS_VERIFY_CTX_set0_imprint(context, imprint, INCISE_SHA256_BYTES);
#else
	TS_VERIFY_CTX_set_store(context, store);
	TS_VERIFY_CTX_set_imprint(context, imprint, INCISE_SHA256_BYTES);
#endif
	good = TS_RESP_verify_response(context, response) == 1;
	TS_VERIFY_CTX_free(context);
	return good;
}

/* --- reply ----------------------------------------------------------------------------- */

static TS_RESP *parse_reply(const struct incise_bytes *reply)
{
	const unsigned char *start = (const unsigned char *)reply->bytes, *from = start;
	TS_RESP *response = NULL;

	if (reply->n && reply->n <= INCISE_TIMESTAMP_MAX)
		response = d2i_TS_RESP(NULL, &from, (long)reply->n);
	/* Bytes behind it would be stored and shown to nobody. */
	if (response && from != start + reply->n) {
		TS_RESP_free(response);
		response = NULL;
	}
	ERR_clear_error();
	return response;
}

/* Why an authority refused, by its own text; "" without one. */
static void copy_refusal(const TS_RESP *response, char *text, size_t size)
{
	const STACK_OF(ASN1_UTF8STRING) *lines =
		TS_STATUS_INFO_get0_text(TS_RESP_get_status_info((TS_RESP *)response));
	const ASN1_UTF8STRING *line = lines && sk_ASN1_UTF8STRING_num(lines)
					      ? sk_ASN1_UTF8STRING_value(lines, 0)
					      : NULL;

	*text = 0;
	if (line)
		snprintf(text, size, ": %.*s", ASN1_STRING_length(line),
			 (const char *)ASN1_STRING_get0_data(line));
}

static bool is_for_digest(const TS_TST_INFO *info,
			  const uint8_t digest[INCISE_SHA256_BYTES])
{
	TS_MSG_IMPRINT *imprint = TS_TST_INFO_get_msg_imprint((TS_TST_INFO *)info);
	const ASN1_OBJECT *algorithm = NULL;
	const ASN1_OCTET_STRING *message;

	X509_ALGOR_get0(&algorithm, NULL, NULL, TS_MSG_IMPRINT_get_algo(imprint));
	message = TS_MSG_IMPRINT_get_msg(imprint);
	return OBJ_obj2nid(algorithm) == NID_sha256 &&
	       ASN1_STRING_length(message) == INCISE_SHA256_BYTES &&
	       !memcmp(ASN1_STRING_get0_data(message), digest, INCISE_SHA256_BYTES);
}

static bool answers_query(const TS_TST_INFO *info, const uint8_t *query)
{
	const ASN1_INTEGER *nonce = TS_TST_INFO_get_nonce(info);

	return nonce && ASN1_STRING_type(nonce) == V_ASN1_INTEGER &&
	       ASN1_STRING_length(nonce) == NONCE_BYTES &&
	       !memcmp(ASN1_STRING_get0_data(nonce), query + NONCE, NONCE_BYTES);
}

/* Subject of the certificate that signed it, if the reply has it. */
static void copy_authority(PKCS7 *token, struct incise_proof_voucher *voucher)
{
	STACK_OF(X509) *signers = PKCS7_get0_signers(token, NULL, 0);
	BIO *text = BIO_new(BIO_s_mem());
	int n = 0;

	if (signers && sk_X509_num(signers) && text &&
	    X509_NAME_print_ex(text, X509_get_subject_name(sk_X509_value(signers, 0)), 0,
			       XN_FLAG_ONELINE & ~ASN1_STRFLGS_ESC_MSB &
				       ~XN_FLAG_SPC_EQ) > 0)
		n = BIO_read(text, voucher->by, sizeof(voucher->by) - 1);
	voucher->by[n > 0 ? n : 0] = 0;
	control_characters_hide(voucher->by);
	sk_X509_free(signers);
	BIO_free(text);
	ERR_clear_error();
}

/* Its time, and whether there is one. */
static bool copy_time(const TS_TST_INFO *info, struct incise_proof_voucher *voucher)
{
	const ASN1_GENERALIZEDTIME *time = TS_TST_INFO_get_time(info);
	struct tm tm;

	if (!time || !ASN1_TIME_to_tm(time, &tm))
		return false;
	voucher->t_s = timegm(&tm);
	return strftime(voucher->utc, sizeof(voucher->utc), "%Y-%m-%dT%H:%M:%SZ", &tm) >
	       0;
}

int incise_timestamp_read(const struct incise_bytes *reply, const char *name,
			  const uint8_t digest[INCISE_SHA256_BYTES], const uint8_t *query,
			  struct x509_store_st *authorities,
			  struct incise_proof_voucher *voucher, struct incise_error *err)
{
	TS_RESP *response = parse_reply(reply);
	TS_TST_INFO *info = response ? TS_RESP_get_tst_info(response) : NULL;
	char why[200], text[160];
	long status = -1;
	int rc = 0;

	if (response)
		status = ASN1_INTEGER_get(
			TS_STATUS_INFO_get0_status(TS_RESP_get_status_info(response)));
	if (!response) {
		rc = incise_error_set(err, EPROTO,
				      "%s: not a reply of RFC 3161; give one of a "
				      "time-stamp authority, FILE.tsr",
				      name);
	} else if (status != TS_STATUS_GRANTED && status != TS_STATUS_GRANTED_WITH_MODS) {
		copy_refusal(response, why, sizeof(why));
		rc = incise_error_set(err, EACCES,
				      "%s: the authority refused a time-stamp%s", name,
				      why);
	} else if (!info || !copy_time(info, voucher)) {
		rc = incise_error_set(err, EPROTO, "%s: a reply without a time", name);
	} else if (!is_for_digest(info, digest)) {
		rc = incise_error_set(err, EBADMSG,
				      "%s: a time-stamp for something else, not for this "
				      "statement",
				      name);
	} else if (query && !answers_query(info, query)) {
		rc = incise_error_set(
			err, EBADMSG,
			"%s: the reply to another query: its nonce differs; "
			"try again",
			name);
	} else {
		copy_authority(TS_RESP_get_token(response), voucher);
	}
	if (!rc && authorities &&
	    !is_trusted(response, voucher->t_s, digest, authorities))
		rc = incise_error_set(err, EACCES,
				      "%s: not by an authority that is trusted: %s", name,
				      take_reason(text));
	voucher->verdict = rc		 ? INCISE_PROOF_BAD
			   : authorities ? INCISE_PROOF_GOOD
					 : INCISE_PROOF_UNCHECKED;
	TS_RESP_free(response);
	ERR_clear_error();
	return rc;
}
