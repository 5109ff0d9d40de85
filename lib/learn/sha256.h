/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* SHA-256 (FIPS 180-4): names of recordings and premises that do not depend on a path. */
#ifndef INCISE_SHA256_H
#define INCISE_SHA256_H

#include <stdbool.h>
#include <stddef.h>
#include <incise/factor.h>

struct incise_sha256 {
	void *digest; /* EVP_MD_CTX of libcrypto */
	bool failed;
};

/* Each start needs its end, which frees it. */
void incise_sha256_start(struct incise_sha256 *sha);
void incise_sha256_add(struct incise_sha256 *sha, const void *bytes, size_t n);

/* 64 lower-case hexadecimal digits and a 0; the state is freed. 0; or -ENOMEM and no digits. */
int incise_sha256_end(struct incise_sha256 *sha, char hex[65]);

struct incise_watch;

/* As incise_file_sha256(), of a part where the watch ends the training. */
int incise_file_sha256_watched(const char *path, char hex[65], struct incise_watch *watch,
			       struct incise_error *err);

#endif
