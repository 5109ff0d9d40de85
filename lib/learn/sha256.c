// SPDX-License-Identifier: LGPL-2.1-or-later
/* SHA-256 by libcrypto; see sha256.h. */
#include <errno.h>
#include <fcntl.h>
#include <openssl/evp.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include "sha256.h"
#include "watch.h"

void incise_sha256_start(struct incise_sha256 *sha)
{
	sha->digest = EVP_MD_CTX_new();
	sha->failed = !sha->digest || !EVP_DigestInit_ex(sha->digest, EVP_sha256(), NULL);
}

void incise_sha256_add(struct incise_sha256 *sha, const void *bytes, size_t n)
{
	if (!sha->failed)
		sha->failed = !EVP_DigestUpdate(sha->digest, bytes, n);
}

int incise_sha256_end(struct incise_sha256 *sha, char hex[65])
{
	unsigned char bytes[EVP_MAX_MD_SIZE];

	if (!sha->failed)
		sha->failed = !EVP_DigestFinal_ex(sha->digest, bytes, NULL);
	EVP_MD_CTX_free(sha->digest);
	hex[0] = 0;
	if (sha->failed)
		return -ENOMEM;
	for (int i = 0; i < 32; i++)
		snprintf(hex + 2 * i, 3, "%02x", bytes[i]);
	return 0;
}

int incise_file_sha256_watched(const char *path, char hex[65], struct incise_watch *watch,
			       struct incise_error *err)
{
	int fd = open(path, O_RDONLY | O_CLOEXEC), code;
	struct incise_sha256 sha;
	char bytes[1 << 16];
	ssize_t n = -1;

	incise_sha256_start(&sha);
	while (fd >= 0 && (n = read(fd, bytes, sizeof(bytes))) > 0 &&
	       !incise_watch_count(watch, 16.0 * (double)n))
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

int incise_file_sha256(const char *path, char hex[65], struct incise_error *err)
{
	return incise_file_sha256_watched(path, hex, NULL, err);
}
