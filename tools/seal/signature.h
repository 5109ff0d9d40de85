/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Signatures of OpenSSH over a text: ssh-keygen makes and checks them, so that its agent, hardware
 * keys, certificates and files of allowed signers work here as they do there.
 */
#ifndef INCISE_SIGNATURE_H
#define INCISE_SIGNATURE_H

#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>

/* The purpose that a signature is for, which ssh-keygen calls its namespace. */
#define SIGNATURE_NAMESPACE "incise"
#define SIGNATURE_MAX 65536	  /* bytes of one */
#define SIGNERS_MAX (1024 * 1024) /* bytes of a file of signers */

enum signature_verdict {
	SIGNATURE_GOOD,
	SIGNATURE_UNKNOWN, /* right, but no signer of the file may have made it now */
	SIGNATURE_WRONG,   /* over another text, or no signature */
};

struct signature {
	enum signature_verdict verdict;
	char signer[256]; /* as the file of signers has it; "" if not SIGNATURE_GOOD */
	char key[160];	  /* "ED25519 SHA256:…"; "" if SIGNATURE_WRONG */
	char why[300];	  /* "" if SIGNATURE_GOOD */
};

/* Files that say who may sign, each read once and whole; from pipes, too. */
struct signers {
	char *text, *revoked; /* revoked NULL: none */
	size_t n, n_revoked;
	const char *path;
};

/*
 * Sign @text with a private key, or with the agent if @key is a public one. ssh-keygen may ask for
 * a passphrase on the terminal.
 *
 * Returns the signature in lines of ASCII, free(3); NULL and the reason.
 */
char *signature_make(const char *key, const char *text, size_t n,
		     struct incise_error *err);

/*
 * Read the files of signers, in the format of ALLOWED SIGNERS of ssh-keygen(1), and of revoked keys,
 * or NULL. Returns 0 or -errno; signers_free() in both cases.
 */
int signers_read(struct signers *signers, const char *path, const char *revoked,
		 struct incise_error *err);

void signers_free(struct signers *signers);

/*
 * Check a signature, which may be any bytes, over @text.
 *
 * @signers: NULL: its key is not compared with any, and a right signature is SIGNATURE_UNKNOWN
 * @at_s: seconds since 1970 at which its key must be valid; -1: now
 * Returns 0, or -errno and the reason if it could not be checked.
 */
int signature_check(struct signature *signature, const char *text, size_t n,
		    const char *bytes, size_t n_bytes, const struct signers *signers,
		    int64_t at_s, struct incise_error *err);

#endif
