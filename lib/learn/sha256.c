// SPDX-License-Identifier: LGPL-2.1-or-later
/* SHA-256 by libcrypto; see sha256.h. */
#include <errno.h>
#include <openssl/evp.h>
#include <stdio.h>
#include "sha256.h"

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
