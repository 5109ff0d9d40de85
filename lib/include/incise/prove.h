/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Proof of a recording: whether it is what was recorded, and who vouches for it. Statements of the
 * recording (incise/seal.h), signatures of OpenSSH over them, and time-stamps of them (RFC 3161) lie
 * in its folder seal/:
 *
 *     1.statement              what the recording was at a commit, and behind its end its calibrations
 *     1.EGZJ73vrWy7tv62x.sig   a signature over it, by the key whose fingerprint starts so
 *     1.20261127T050000Z.tsr   a time-stamp of it
 *     2.statement …            another one, made after the recording or its calibration had changed
 *
 *   statement ── compared with ── recording
 *       └─ signature ── its key ── file of signers, at the time of a time-stamp that is trusted, else now
 *       └─ time-stamp ── its certificate ── file of authorities
 *
 * ssh-keygen makes and checks signatures. The recording may come from anybody. Part of libincise-record.
 */
#ifndef INCISE_PROVE_H
#define INCISE_PROVE_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/seal.h>
#include <incise/verify.h>

INCISE_BEGIN_DECLS

/** The depth of a verification. Tables and rows are those that a program is about to read: no seal is read. */
enum incise_prove_level {
	INCISE_PROVE_SEALS, /**< nothing: what is in seal/ is listed */
	/**
	 * The sealed tables, of which incise_recording_info() takes the summary, without a sample: its
	 * time does not grow with the recording. Of one without a summary it is INCISE_PROVE_ROWS.
	 */
	INCISE_PROVE_TABLES,
	INCISE_PROVE_ROWS, /**< rows, ledger and tables, neither camera.mkv nor all pages */
	INCISE_PROVE_ALL, /**< as incise_verify() */
};

/** Options of a proof; {0}: list the files in seal/. */
struct incise_prove_options {
	enum incise_prove_level level;
	/** Signers that are trusted, ALLOWED SIGNERS of ssh-keygen(1): compare statements and check. */
	const char *signers;
	const char *revoked; /**< keys that are not accepted, ssh-keygen -k; or NULL */
	const char *authorities; /**< certificates in PEM, for time-stamps; or NULL */
	const struct incise_verify_watch *watch; /**< of the verification; or NULL */
	/** Verify, make a statement and sign it: a private key, or the public one of one in the agent. */
	const char *key;
	/** The same with a time-stamp: http://…, a query FILE.tsq to write, or the reply FILE.tsr. */
	const char *timestamp;
	bool recorded; /**< it was recorded just now: sign without verifying it again */
	bool renew;    /**< also members of a joined recording that this key has signed */
	/** Called with each path before it is written; other than 0: stop. NULL: write all. */
	int (*write)(void *user, const char *path);
	void *user;
};

/** A file of the folder. */
enum incise_proof_kind {
	INCISE_PROOF_STATEMENT,
	INCISE_PROOF_SIGNATURE,
	INCISE_PROOF_TIMESTAMP,
};

/** The state of a signature or a time-stamp. */
enum incise_proof_verdict {
	INCISE_PROOF_UNCHECKED, /**< nobody to trust was given */
	INCISE_PROOF_GOOD,
	INCISE_PROOF_BAD,
};

/** A signature or a time-stamp. Texts have no control characters. */
struct incise_proof_voucher {
	char file[100]; /**< name in seal/ */
	enum incise_proof_kind kind;
	int statement; /**< its number */
	enum incise_proof_verdict verdict;
	bool made;    /**< by this call */
	char by[300]; /**< signer, or subject of the authority's certificate; "": unknown */
	char key[160]; /**< of a signature, "ED25519 SHA256:…"; "": unknown */
	char utc[32];  /**< of a time-stamp, "2026-11-27T05:00:00Z"; "": unknown */
	int64_t t_s;   /**< the same in seconds since 1970 */
	char why[500]; /**< of a bad one */
};

/** Differences of a statement that are kept. */
#define INCISE_PROOF_DIFFERENCES 20

/** A statement, and how the recording differs from it. */
struct incise_proof_statement {
	int number;
	int64_t commit;	 /**< of a join 0; -1: it is no statement */
	bool complete;	 /**< of a recording that was closed */
	bool recorded;	 /**< what was recorded agrees */
	bool calibrated; /**< and the calibration by which it is read */
	bool agrees;	 /**< all of it does, with the name */
	bool vouched;	 /**< by a signer that may */
	bool reported;	 /**< differences were findings of the verification, too */
	int n_differences;
	char *differences[INCISE_PROOF_DIFFERENCES]; /**< texts; there may be more */
};

/** The files in seal/ of a recording, of a member of a joined one, or of the join itself. */
struct incise_proof_seal {
	char *path;	   /**< folder of the recording */
	bool join;	   /**< its statement is incise_session_statement() */
	char identity[33]; /**< as incise_seal_head(); "": there is none */
	struct incise_seal_head head;
	char why[200]; /**< there is none; "": there is one, or it is that of a join */
	int n_statements, n_vouchers;
	struct incise_proof_statement
		*statements; /**< newest first; those compared or made */
	struct incise_proof_voucher *vouchers; /**< time-stamps first; or those made */
	int signatures, timestamps;	       /**< number of these */
	bool vouched; /**< the newest statement with a good signature agrees */
	int bad;      /**< number of vouchers and statements that are not good */
};

/** Result of incise_prove(). */
struct incise_proof {
	struct incise_verify_report report; /**< of the verification */
	/** The first finding by which it is not what was recorded; "": none. */
	char altered[400];
	int n;
	struct incise_proof_seal
		*seals; /**< of the members, then of the join; or the only one */
};

/**
 * Prove a recording, or make the files that prove it. Thread-safe for different recordings; starts
 * ssh-keygen for signatures, which may ask for a passphrase on the terminal, and waits up to 30 s for
 * a time-stamp authority.
 *
 * @param path  as for incise_recording_open(); of a joined recording each member is proved
 * @param proof result, to be freed with incise_proof_free() in any case; after an error it has
 *              what was made before
 * @return 0: the proof says whether it is good; -EBADMSG (differs from its seal: not signed; a
 *         time-stamp for something else), -EBUSY (it is being recorded), -E2BIG (too many files),
 *         -EACCES (the key did not sign; no time-stamp was granted), -EPROTO (no reply of RFC 3161),
 *         -EINVAL (no such file of signers, certificates, or key), -ECANCELED (stopped by write or
 *         watch), -ENOMEM, and the errors of incise_verify() and incise_seal_statement()
 */
INCISE_API int incise_prove(const char *path, const struct incise_prove_options *options,
			    struct incise_proof *proof, struct incise_error *err);

/** Free what a proof holds. */
INCISE_API void incise_proof_free(struct incise_proof *proof);

/**
 * Remove the folders seal/ and seal-before/ of a recording. Nothing else in them is removed.
 *
 * @return 0; negative errno of unlink(2) or rmdir(2): -ENOTEMPTY with another file in one
 */
INCISE_API int incise_proof_remove(const char *recording, struct incise_error *err);

INCISE_END_DECLS
#endif
