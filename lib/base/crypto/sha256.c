// SPDX-License-Identifier: LGPL-2.1-or-later
/* SHA-256 by libcrypto; see sha256.h. */
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <unistd.h>
#include <openssl/evp.h>
#include "sha256.h"

void incise_sha256_start(struct incise_sha256 *sha)
{
	/* libcrypto looks up the algorithm, which takes long, the first time only. */
	const EVP_MD *type = sha->digest ? NULL : EVP_sha256();

	if (!sha->digest)
		sha->digest = EVP_MD_CTX_new();
	sha->failed |= !sha->digest || !EVP_DigestInit_ex(sha->digest, type, NULL);
}

void incise_sha256_add(struct incise_sha256 *sha, const void *bytes, size_t n)
{
	if (!sha->failed)
		sha->failed = !EVP_DigestUpdate(sha->digest, bytes, n);
}

void incise_sha256_take(struct incise_sha256 *sha, uint8_t bytes[INCISE_SHA256_BYTES])
{
	if (!sha->failed)
		sha->failed = !EVP_DigestFinal_ex(sha->digest, bytes, NULL);
}

void incise_sha256_free(struct incise_sha256 *sha)
{
	EVP_MD_CTX_free(sha->digest);
	*sha = (struct incise_sha256){0};
}

void incise_sha256_hex(const uint8_t bytes[INCISE_SHA256_BYTES],
		       char hex[INCISE_SHA256_TEXT])
{
	static const char digits[] = "0123456789abcdef";

	for (int i = 0; i < INCISE_SHA256_BYTES; i++) {
		hex[2 * i] = digits[bytes[i] >> 4];
		hex[2 * i + 1] = digits[bytes[i] & 15];
	}
	hex[2 * INCISE_SHA256_BYTES] = 0;
}

int incise_sha256_end(struct incise_sha256 *sha, char hex[INCISE_SHA256_TEXT])
{
	uint8_t bytes[INCISE_SHA256_BYTES];
	bool failed;

	incise_sha256_take(sha, bytes);
	failed = sha->failed;
	incise_sha256_free(sha);
	*hex = 0;
	if (failed)
		return -ENOMEM;
	incise_sha256_hex(bytes, hex);
	return 0;
}

int incise_sha256_of(const void *bytes, size_t n, uint8_t digest[INCISE_SHA256_BYTES])
{
	return EVP_Digest(bytes, n, digest, NULL, EVP_sha256(), NULL) ? 0 : -ENOMEM;
}

int incise_sha256_text(const void *bytes, size_t n, char hex[INCISE_SHA256_TEXT])
{
	struct incise_sha256 sha = {0};

	incise_sha256_start(&sha);
	incise_sha256_add(&sha, bytes, n);
	return incise_sha256_end(&sha, hex);
}

int incise_sha256_file(const char *path, char hex[INCISE_SHA256_TEXT],
		       bool (*stop)(void *user, size_t n), void *user,
		       struct incise_error *err)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC), code;
	struct incise_sha256 sha = {0};
	char bytes[1 << 16];
	ssize_t n = -1;

	incise_sha256_start(&sha);
	while (fd >= 0 && (n = read(fd, bytes, sizeof(bytes))) > 0 &&
	       !(stop && stop(user, (size_t)n)))
		incise_sha256_add(&sha, bytes, (size_t)n);
	code = errno;
	if (fd >= 0)
		close(fd);
	if (incise_sha256_end(&sha, hex) && n >= 0) {
		n = -1;
		code = ENOMEM;
	}
	return n < 0 ? incise_error_set(err, code, "%s: %s", path, strerror(code)) : 0;
}
