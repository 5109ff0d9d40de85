/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Signers and authorities that vouch for a recording: its signatures and time-stamps, checked and
 * reported by incise verify.
 */
#ifndef INCISE_VOUCH_H
#define INCISE_VOUCH_H

#include <jansson.h>
#include <stdbool.h>
#include <incise/verify.h>
#include "seal.h"

/* Files that say who is trusted; NULL: not given. */
struct trust_files {
	const char *signers, *revoked, *ca;
};

struct trust {
	struct signers signers;		 /* path NULL: none */
	struct authorities *authorities; /* NULL: none */
};

/* Read them; fails the program. trust_free(). */
void trust_read(struct trust *trust, const struct trust_files *files);
void trust_free(struct trust *trust);

/* A signature or a time-stamp. */
struct vouch_line {
	char file[100]; /* in seal/ */
	enum seal_kind kind;
	int number; /* of its statement */
	enum { VOUCH_GOOD, VOUCH_BAD, VOUCH_UNCHECKED } verdict;
	struct signature signature;
	struct timestamp timestamp;
	char why[500]; /* if it is VOUCH_BAD */
};

/* A statement, and how the recording differs from it. */
struct vouch_statement {
	int number;
	int64_t commit;	 /* -1: it is no statement */
	bool complete;	 /* of a recording that was closed */
	bool recorded;	 /* what was recorded agrees */
	bool calibrated; /* and the calibration by which it is read */
	bool agrees;	 /* all of it does, with the name */
	bool is_signed;	 /* by a signer that may */
	bool reported;	 /* differences were findings of the verification */
	char name[256];	 /* of the recording when it was signed; "": of a join */
	int n_differences;
	char *differences[20]; /* texts; there may be more */
};

struct vouch {
	char *recording;
	char *join; /* the statement of the join as it is now; NULL: it is a plain recording */
	bool member; /* of a join, whose statement has its name */
	struct vouch_statement *statements;
	struct vouch_line *lines;
	int n_statements, n_lines;
	bool vouched; /* the newest statement with a good signature agrees */
	int bad;      /* signatures, time-stamps and statements that are not good */
};

/*
 * Verify a recording as incise_verify() does, and check its seal. If @report is NULL, as for a joined
 * one it must be, it was verified before. Without signers to trust, signatures are not checked.
 * Every failure ends the program.
 *
 * @member: of a joined recording
 */
void vouch_check(struct vouch *vouch, const char *recording, bool member,
		 const struct trust *trust, const struct incise_verify_watch *watch,
		 struct incise_verify_report *report);

void vouch_free(struct vouch *vouch);

/* A line for each signature, time-stamp and difference. */
void vouch_print(const struct vouch *vouch, const struct trust *trust);

json_t *vouch_json(const struct vouch *vouch);

/* The reason in one line why nobody vouches for it; fails the program with it. */
_Noreturn void vouch_fail(const struct vouch *vouch, const struct trust *trust);

#endif
