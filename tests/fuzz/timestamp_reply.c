// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Replies of time-stamp authorities, from anyone: each is taken, or refused with a reason in one
 * line; one that is taken is for the digest that was asked for, and no stranger is trusted.
 */
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/record/prove/prove.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* The starting points in tests/fuzz/timestamp_reply/ are for the digest of this text. */
static const char text[] = "a statement\n";

static void wrong(const char *what)
{
	fprintf(stderr, "timestamp_reply: %s\n", what);
	abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct incise_bytes reply = {malloc(size ? size : 1), size};
	uint8_t digest[INCISE_SHA256_BYTES];
	struct incise_proof_voucher taken = {.verdict = INCISE_PROOF_BAD};
	struct incise_error err = {0};
	int rc;

	memcpy(reply.bytes, data, size);
	incise_sha256_of(text, strlen(text), digest);
	rc = incise_timestamp_read(&reply, "input", digest, NULL, NULL, &taken, &err);
	if (rc &&
	    (!err.code || strncmp(err.text, "input: ", 7) || strchr(err.text, '\n')))
		wrong("refused without a reason in one line");
	if (!rc && strlen(taken.utc) < 20)
		wrong("taken without a time");
	if (!rc) {
		digest[0] ^= 1;
		if (incise_timestamp_read(&reply, "input", digest, NULL, NULL, &taken,
					  &err) != -EBADMSG)
			wrong("taken for another digest");
	}
	free(reply.bytes);
	return 0;
}
