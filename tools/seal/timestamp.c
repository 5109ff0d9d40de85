// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Time-stamps of RFC 3161 by libcrypto; see timestamp.h.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <incise/infile.h>
#include <openssl/err.h>
#include <openssl/http.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/sha.h>
#include <openssl/ts.h>
#include "../cli/control_character.h"
#include "timestamp.h"

#define NONCE_BYTES 8
#define WAIT_S 30
#define AUTHORITIES_MAX (1024 * 1024) /* bytes of a file of certificates */

bool timestamp_is_server(const char *text)
{
	return !strncmp(text, "http://", 7) || !strncmp(text, "https://", 8);
}

void timestamp_digest(const char *text, size_t n, unsigned char digest[TIMESTAMP_DIGEST])
{
	SHA256((const unsigned char *)text, n, digest);
}

/* The last error of libcrypto, and forget them all. */
static const char *reason(char text[160])
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

/* --- query ----------------------------------------------------------------------------- */

static TS_MSG_IMPRINT *make_imprint(const unsigned char digest[TIMESTAMP_DIGEST])
{
	TS_MSG_IMPRINT *imprint = TS_MSG_IMPRINT_new();
	X509_ALGOR *algorithm = X509_ALGOR_new();
	bool good =
		imprint && algorithm &&
		X509_ALGOR_set0(algorithm, OBJ_nid2obj(NID_sha256), V_ASN1_NULL, NULL) &&
		TS_MSG_IMPRINT_set_algo(imprint, algorithm) &&
		TS_MSG_IMPRINT_set_msg(imprint, (unsigned char *)digest,
				       TIMESTAMP_DIGEST);

	X509_ALGOR_free(algorithm);
	if (good)
		return imprint;
	TS_MSG_IMPRINT_free(imprint);
	return NULL;
}

static ASN1_INTEGER *make_nonce(void)
{
	unsigned char bytes[NONCE_BYTES];
	ASN1_INTEGER *nonce = NULL;
	BIGNUM *number;

	if (RAND_bytes(bytes, sizeof(bytes)) != 1)
		return NULL;
	bytes[0] |= 1; /* no nonce of 0 */
	number = BN_bin2bn(bytes, sizeof(bytes), NULL);
	if (number)
		nonce = BN_to_ASN1_INTEGER(number, NULL);
	BN_free(number);
	return nonce;
}

int timestamp_query(const unsigned char digest[TIMESTAMP_DIGEST], struct der *query,
		    struct incise_error *err)
{
	TS_MSG_IMPRINT *imprint = make_imprint(digest);
	ASN1_INTEGER *nonce = make_nonce();
	TS_REQ *request = TS_REQ_new();
	char text[160];
	int n = -1;

	*query = (struct der){0};
	if (imprint && nonce && request && TS_REQ_set_version(request, 1) &&
	    TS_REQ_set_msg_imprint(request, imprint) &&
	    TS_REQ_set_nonce(request, nonce) && TS_REQ_set_cert_req(request, 1))
		n = i2d_TS_REQ(request, NULL);
	if (n > 0)
		query->bytes = malloc((size_t)n);
	if (query->bytes) {
		unsigned char *to = query->bytes;

		query->n = (size_t)i2d_TS_REQ(request, &to);
	}
	TS_MSG_IMPRINT_free(imprint);
	ASN1_INTEGER_free(nonce);
	TS_REQ_free(request);
	return query->bytes ? 0
			    : incise_error_set(err, EIO, "a query for a time-stamp: %s",
					       reason(text));
}

/* --- server ---------------------------------------------------------------------------- */

/* All of a stream of libcrypto, up to TIMESTAMP_MAX. Returns 0 or -errno. */
static int read_all(BIO *bio, struct der *to)
{
	size_t n = 0;

	to->bytes = malloc(TIMESTAMP_MAX + 1);
	if (!to->bytes)
		return -ENOMEM;
	for (int got;
	     n <= TIMESTAMP_MAX &&
	     (got = BIO_read(bio, to->bytes + n, (int)(TIMESTAMP_MAX + 1 - n))) > 0;)
		n += (size_t)got;
	to->n = n;
	if (n <= TIMESTAMP_MAX)
		return 0;
	free(to->bytes);
	*to = (struct der){0};
	return -EFBIG;
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

int timestamp_ask(const char *server, const struct der *query, struct der *reply,
		  struct incise_error *err)
{
	char *host = NULL, *port = NULL, *path = NULL, text[160];
	BIO *in = NULL, *out = NULL, *line = NULL;
	bool proxy;
	int tls = 0, rc;

	*reply = (struct der){0};
	ERR_clear_error(); /* of others, before: reason() names the first */
	if (!OSSL_HTTP_parse_url(server, &tls, NULL, &host, &port, NULL, &path, NULL,
				 NULL))
		return incise_error_set(err, EINVAL, "%s: %s; give http://HOST/PATH",
					server, reason(text));
	if (tls) {
		rc = incise_error_set(
			err, EOPNOTSUPP,
			"%s: https is not supported, and a time-stamp needs "
			"none, as it is signed; give the authority's http:// "
			"address, or send a query FILE.tsq yourself",
			server);
	} else {
		in = BIO_new_mem_buf(query->bytes, (int)query->n);
		proxy = OSSL_HTTP_adapt_proxy(NULL, NULL, host, 0);
		line = in && !proxy ? connect_once(host, port) : NULL;
		if (in && (line || proxy))
			out = OSSL_HTTP_transfer(NULL, host, port, path, 0, NULL, NULL,
						 line, NULL, NULL, NULL, 0, NULL,
						 "application/timestamp-query", in,
						 "application/timestamp-reply", 1,
						 TIMESTAMP_MAX, WAIT_S, 0);
		rc = out ? read_all(out, reply) : -EIO;
		if (rc)
			incise_error_set(err, -rc,
					 "%s: no time-stamp: %s; try again, or another "
					 "authority",
					 server, out ? strerror(-rc) : reason(text));
	}
	BIO_free(in);
	BIO_free_all(out);
	BIO_free(line);
	OPENSSL_free(host);
	OPENSSL_free(port);
	OPENSSL_free(path);
	return rc;
}

/* --- reply ----------------------------------------------------------------------------- */

static TS_RESP *parse(const struct der *reply)
{
	const unsigned char *from = reply->bytes;
	TS_RESP *response = NULL;

	if (reply->n && reply->n <= TIMESTAMP_MAX)
		response = d2i_TS_RESP(NULL, &from, (long)reply->n);
	/* Bytes behind it would be stored and shown to nobody. */
	if (response && from != reply->bytes + reply->n) {
		TS_RESP_free(response);
		response = NULL;
	}
	ERR_clear_error();
	return response;
}

/* Why an authority refused, by its own text; "" without one. */
static void refusal(const TS_RESP *response, char *text, size_t size)
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

static bool is_for(const TS_TST_INFO *info, const unsigned char digest[TIMESTAMP_DIGEST])
{
	TS_MSG_IMPRINT *imprint = TS_TST_INFO_get_msg_imprint((TS_TST_INFO *)info);
	const ASN1_OBJECT *algorithm = NULL;
	const ASN1_OCTET_STRING *message;

	X509_ALGOR_get0(&algorithm, NULL, NULL, TS_MSG_IMPRINT_get_algo(imprint));
	message = TS_MSG_IMPRINT_get_msg(imprint);
	return OBJ_obj2nid(algorithm) == NID_sha256 &&
	       ASN1_STRING_length(message) == TIMESTAMP_DIGEST &&
	       !memcmp(ASN1_STRING_get0_data(message), digest, TIMESTAMP_DIGEST);
}

static bool answers(const TS_TST_INFO *info, const struct der *query)
{
	const unsigned char *from = query->bytes;
	TS_REQ *request = d2i_TS_REQ(NULL, &from, (long)query->n);
	const ASN1_INTEGER *asked = request ? TS_REQ_get_nonce(request) : NULL;
	const ASN1_INTEGER *nonce = TS_TST_INFO_get_nonce(info);
	bool same = asked && nonce && !ASN1_INTEGER_cmp(asked, nonce);

	TS_REQ_free(request);
	return same;
}

/* Subject of the certificate that signed it, if the reply has it. */
static void copy_authority(PKCS7 *token, struct timestamp *timestamp)
{
	STACK_OF(X509) *signers = PKCS7_get0_signers(token, NULL, 0);
	BIO *text = BIO_new(BIO_s_mem());
	int n = 0;

	if (signers && sk_X509_num(signers) && text &&
	    X509_NAME_print_ex(text, X509_get_subject_name(sk_X509_value(signers, 0)), 0,
			       XN_FLAG_ONELINE & ~ASN1_STRFLGS_ESC_MSB &
				       ~XN_FLAG_SPC_EQ) > 0)
		n = BIO_read(text, timestamp->authority,
			     sizeof(timestamp->authority) - 1);
	timestamp->authority[n > 0 ? n : 0] = 0;
	control_characters_hide(timestamp->authority);
	sk_X509_free(signers);
	BIO_free(text);
	ERR_clear_error();
}

/* Its time, and whether there is one. */
static bool copy_time(const TS_TST_INFO *info, struct timestamp *timestamp)
{
	const ASN1_GENERALIZEDTIME *time = TS_TST_INFO_get_time(info);
	struct tm tm;

	if (!time || !ASN1_TIME_to_tm(time, &tm))
		return false;
	timestamp->t_s = timegm(&tm);
	return strftime(timestamp->utc, sizeof(timestamp->utc), "%Y-%m-%dT%H:%M:%SZ",
			&tm) > 0;
}

int timestamp_read(const struct der *reply, const char *name,
		   const unsigned char digest[TIMESTAMP_DIGEST], const struct der *query,
		   struct timestamp *timestamp, struct incise_error *err)
{
	TS_RESP *response = parse(reply);
	TS_TST_INFO *info = response ? TS_RESP_get_tst_info(response) : NULL;
	char why[200];
	long status = -1;
	int rc = 0;

	*timestamp = (struct timestamp){0};
	if (response)
		status = ASN1_INTEGER_get(
			TS_STATUS_INFO_get0_status(TS_RESP_get_status_info(response)));
	if (!response) {
		rc = incise_error_set(err, EPROTO,
				      "%s: not a reply of RFC 3161; give one of a "
				      "time-stamp authority, FILE.tsr",
				      name);
	} else if (status != TS_STATUS_GRANTED && status != TS_STATUS_GRANTED_WITH_MODS) {
		refusal(response, why, sizeof(why));
		rc = incise_error_set(err, EACCES,
				      "%s: the authority refused a time-stamp%s", name,
				      why);
	} else if (!info || !copy_time(info, timestamp)) {
		rc = incise_error_set(err, EPROTO, "%s: a reply without a time", name);
	} else if (!is_for(info, digest)) {
		rc = incise_error_set(err, EBADMSG,
				      "%s: a time-stamp for something else, not for this "
				      "statement",
				      name);
	} else if (query && !answers(info, query)) {
		rc = incise_error_set(
			err, EBADMSG,
			"%s: the reply to another query: its nonce differs; "
			"try again",
			name);
	} else {
		copy_authority(TS_RESP_get_token(response), timestamp);
	}
	TS_RESP_free(response);
	ERR_clear_error();
	return rc;
}

/* --- trust ----------------------------------------------------------------------------- */

struct authorities {
	STACK_OF(X509) * certificates;
};

void authorities_free(struct authorities *authorities)
{
	if (authorities)
		sk_X509_pop_free(authorities->certificates, X509_free);
	free(authorities);
}

struct authorities *authorities_read(const char *path, struct incise_error *err)
{
	static const struct incise_infile_kind kind = {
		.name = "a file of certificates",
		.advice = "give certificates of authorities in PEM",
		.size_max = AUTHORITIES_MAX,
	};
	struct authorities *authorities = calloc(1, sizeof(*authorities));
	size_t n;
	char *text = incise_infile_read(path, &kind, &n, err);
	BIO *in = text ? BIO_new_mem_buf(text, (int)n) : NULL;
	X509 *one;

	if (authorities)
		authorities->certificates = sk_X509_new_null();
	while (in && authorities && authorities->certificates &&
	       (one = PEM_read_bio_X509(in, NULL, NULL, NULL)))
		if (!sk_X509_push(authorities->certificates, one))
			X509_free(one);
	BIO_free(in);
	ERR_clear_error();
	if (text && authorities && authorities->certificates &&
	    sk_X509_num(authorities->certificates)) {
		free(text);
		return authorities;
	}
	if (text)
		incise_error_set(err, EINVAL,
				 "%s: no certificate in it; give those of authorities in "
				 "PEM",
				 path);
	free(text);
	authorities_free(authorities);
	return NULL;
}

/* They, and at which time theirs and those below them must be valid. */
static X509_STORE *make_store(const struct authorities *authorities, int64_t t_s)
{
	X509_STORE *store = X509_STORE_new();

	for (int i = 0; store && i < sk_X509_num(authorities->certificates); i++)
		X509_STORE_add_cert(store, sk_X509_value(authorities->certificates, i));
	/* One that has expired since then was good. */
	if (store)
		X509_VERIFY_PARAM_set_time(X509_STORE_get0_param(store), t_s);
	return store;
}

/* The context owns what is set. */
static TS_VERIFY_CTX *make_context(const struct authorities *authorities, int64_t t_s,
				   const unsigned char digest[TIMESTAMP_DIGEST])
{
	TS_VERIFY_CTX *context = TS_VERIFY_CTX_new();
	X509_STORE *store = make_store(authorities, t_s);
	unsigned char *imprint = OPENSSL_memdup(digest, TIMESTAMP_DIGEST);

	if (!context || !store || !imprint) {
		TS_VERIFY_CTX_free(context);
		X509_STORE_free(store);
		OPENSSL_free(imprint);
		return NULL;
	}
	TS_VERIFY_CTX_set_flags(context,
				TS_VFY_VERSION | TS_VFY_IMPRINT | TS_VFY_SIGNATURE);
#if OPENSSL_VERSION_NUMBER >= 0x30400000L
	TS_VERIFY_CTX_set0_store(context, store);
	TS_VERIFY_CTX_set0_imprint(context, imprint, TIMESTAMP_DIGEST);
#else
	TS_VERIFY_CTX_set_store(context, store);
	TS_VERIFY_CTX_set_imprint(context, imprint, TIMESTAMP_DIGEST);
#endif
	return context;
}

int timestamp_check(const struct der *reply, const char *name,
		    const unsigned char digest[TIMESTAMP_DIGEST],
		    const struct authorities *authorities, struct incise_error *err)
{
	struct timestamp timestamp = {0};
	TS_RESP *response = parse(reply);
	TS_TST_INFO *info = response ? TS_RESP_get_tst_info(response) : NULL;
	TS_VERIFY_CTX *context =
		info && copy_time(info, &timestamp)
			? make_context(authorities, timestamp.t_s, digest)
			: NULL;
	bool good = context && TS_RESP_verify_response(context, response) == 1;
	char text[160];

	if (!good)
		incise_error_set(err, EACCES,
				 "%s: not by an authority that is trusted: %s", name,
				 reason(text));
	TS_VERIFY_CTX_free(context);
	TS_RESP_free(response);
	ERR_clear_error();
	return good ? 0 : -EACCES;
}
