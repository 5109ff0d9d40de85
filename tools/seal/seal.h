/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * The folder NAME.rec/seal/: statements of the recording (incise/seal.h), and who vouches for them.
 *
 *     1.statement              what the recording was at a commit
 *     1.EGZJ73vrWy7tv62x.sig   a signature over it, by the key whose fingerprint starts so
 *     1.20261127T050000Z.tsr   a time-stamp of it
 *     2.statement …            another one, made after the recording or its calibration had changed
 */
#ifndef INCISE_TOOLS_SEAL_H
#define INCISE_TOOLS_SEAL_H

#include <stdbool.h>
#include <stddef.h>
#include <incise/error.h>
#include <incise/seal.h>
#include "signature.h"
#include "timestamp.h"

#define SEAL_FILES_MAX 1000

enum seal_kind { SEAL_STATEMENT, SEAL_SIGNATURE, SEAL_TIMESTAMP };

/* A file of the folder: any bytes. */
struct seal_file {
	char name[100]; /* letters, digits, '.', '_' and '-' */
	int number;	/* of its statement, from 1 */
	enum seal_kind kind;
	char *bytes; /* with a NUL behind them; NULL: not read, see why */
	size_t n;
	char why[100];
};

struct seal_files {
	struct seal_file *all; /* by number: the statement, signatures, time-stamps */
	int n;
};

/* The folder of a recording without its choice: @path, or @path.part if only that is there: free(3). */
char *seal_recording(const char *path);

/*
 * Read the files in the folder seal/ of a recording, or another of its folders. Those of other names are passed over; links,
 * devices and too large ones are listed, but not read. Returns 0, also if there is no such folder,
 * or -errno; seal_files_free() in both cases.
 */
int seal_files_read(struct seal_files *files, const char *recording, const char *name,
		    struct incise_error *err);

void seal_files_free(struct seal_files *files);

/*
 * Identity and last head of a recording, as its tables have them. False, and the reason without the
 * recording's name: it has none. Every other failure ends the program.
 */
bool seal_head(const char *recording, char identity[33], struct incise_seal_head *head,
	       char why[200]);

/*
 * A file N.statement is a statement of incise/seal.h, and behind its end a line for each calibration
 * after the fact (incise/recalibration.h), by the last of which the recording is read:
 *
 *     calibration calibration/0001-20261127T054012Z.conf 0123…    SHA-256 of the file
 *
 * Length of the former; 0: it has no end.
 */
size_t seal_statement_length(const char *text, size_t n);

/* These lines for a recording as it is now: free(3). NULL and the reason. */
char *seal_calibrations(const char *recording, struct incise_error *err);

/*
 * The statement of a join, incise_session_statement(), of a joined recording as it is now: free(3).
 * NULL: it is a plain one. Every failure ends the program.
 */
char *seal_join(const char *recording);

/* The present statement of a recording, or of a join. */
struct seal {
	char *recording; /* its folder */
	int number;
	bool stored; /* it is in seal/ already */
	bool joined;
	char *text;
	size_t n;
	struct incise_seal_statement statement; /* not of a join */
};

/*
 * Verify a recording, and make its statement, or find it in seal/. Refuses one that is being written,
 * damaged, or has no seal. @frames: also compare the camera's file, as incise verify does. Returns 0 or
 * -errno; seal_close() in both cases.
 */
int seal_open(struct seal *seal, const char *recording, bool frames,
	      struct incise_error *err);

void seal_close(struct seal *seal);

/* "all of it, statement of commit 97", or of what else: free(3). */
char *seal_extent(const struct seal *seal);

/* Path of the statement, and of a signature or a time-stamp of it: free(3). */
char *seal_statement_path(const struct seal *seal);
char *seal_signature_path(const struct seal *seal, const struct signature *signature);
char *seal_timestamp_path(const struct seal *seal, const struct timestamp *timestamp);

/*
 * Write the statement if it is not stored, and then a file of it; @path NULL: the statement alone.
 * Links are not followed. Returns 0 or -errno.
 */
int seal_write(struct seal *seal, const char *path, const void *bytes, size_t n,
	       struct incise_error *err);

/*
 * Sign the statement, and check what ssh-keygen made. Returns the signature, free(3), with its key in
 * *signature; NULL and the reason.
 */
char *seal_sign(const struct seal *seal, const char *key, struct signature *signature,
		struct incise_error *err);

#endif
