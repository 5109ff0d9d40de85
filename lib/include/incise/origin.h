/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The origin of a file: the files that it was made of, named in the file itself. Exports, models and
 * figures carry a token for each file that they were made of, and for those that these were made of, up to
 * the recordings. A token is ASCII without blanks or quotes, so that each format holds it as it is, and a
 * reader finds it in the bytes of any file:
 *
 *     incise:2:recording:4f1c…9a:97:4e1b…02:liver.rec;
 *            │     │       │    │    │        └ name, other bytes than A-Z a-z 0-9 - . _ ~ as %XX
 *            │     │       │    │    └ identity of the recording, or "-"
 *            │     │       │    └ its commit; 0 of other files
 *            │     │       └ its head at that commit, of other files SHA-256 of their bytes, in hex
 *            │     └ recording, export, model …
 *            └ depth: 1 for what the file was made of, 2 for what that was made of
 *
 * A token proves nothing by itself. The SHA-256 shows whether a file or recording at hand is the right
 * one. Part of libincise-record.
 */
#ifndef INCISE_ORIGIN_H
#define INCISE_ORIGIN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Largest depth of an origin. */
#define INCISE_ORIGIN_DEPTH_MAX 9
/** Bytes of the longest token, with the final NUL. */
#define INCISE_ORIGIN_TEXT 960

/** A file that another was made of. */
struct incise_origin {
	int depth;	 /**< 1 … INCISE_ORIGIN_DEPTH_MAX */
	char kind[16];	 /**< small letters: "recording", "export", "model", … */
	char sha256[65]; /**< 64 small hexadecimal digits */
	uint64_t
		commit; /**< of a recording: the commit that sha256 is the head of; else 0 */
	char identity[65]; /**< of a recording: letters, digits and '-'; else "" */
	char name
		[256]; /**< of the file or folder, without its folder; any bytes but '/' */
};

/**
 * Write an origin as a token. Thread safe.
 *
 * @param text INCISE_ORIGIN_TEXT bytes
 * @return its length, or -EINVAL: a member is none of those above
 */
INCISE_API int incise_origin_text(const struct incise_origin *origin, char *text);

/**
 * Find the next token in any bytes. Malformed tokens are passed over. Thread safe.
 *
 * @param bytes  n bytes
 * @param at     place to search from; moved behind the token that was found, or to n
 * @param origin the token
 * @return whether there is one
 */
INCISE_API bool incise_origin_next(const char *bytes, size_t n, size_t *at,
				   struct incise_origin *origin);

struct incise_recording;

/**
 * Write the origin of an open recording: its head at its last commit, of depth 1, and of depth 2 the
 * calibration by which it is read, unless the capture's is active; for a joined one the same for each
 * member, named "day.rec:a". A recording of an older format, without a seal, has no origin.
 *
 * @param text tokens with a blank between them, as many as fit, and a NUL
 * @param size at least 1
 * @return number of bytes before the NUL
 */
INCISE_API size_t incise_recording_origins(struct incise_recording *recording, char *text,
					   size_t size);

/** Largest number of origins that are kept. */
#define INCISE_ORIGINS_MAX 4096

/**
 * The files that a file was made of, in its order: each is followed by those of a larger depth that
 * it was made of. Begins as {0}; incise_origins_free().
 */
struct incise_origins {
	struct incise_origin *all;
	int n;
	bool cut; /**< there were more than were kept */
};

/**
 * Add those that a file carries; one that is not regular carries none. Thread safe.
 *
 * @param model whether it is a .fis file, which has them in its notes
 * @return 0; negative errno of open(2) and read(2), -ENOMEM
 */
INCISE_API int incise_origins_read(struct incise_origins *origins, const char *path,
				   bool model, struct incise_error *err);

/**
 * Add a file as one that something is made of, and below it those that it carries; or a recording at its
 * present commit, each member of a joined one, as incise_recording_origins(). Thread safe.
 *
 * @param kind "recording", "model", "table", "export", …, as of struct incise_origin
 * @return as incise_origins_read()
 */
INCISE_API int incise_origins_add(struct incise_origins *origins, const char *path,
				  const char *kind, struct incise_error *err);

/** Bytes for incise_source_text(). */
#define INCISE_SOURCE_TEXT 1000

/**
 * Describe a source of training in one line, which factors and models keep: of a recording its name,
 * origins, start, rig and calibration; of another file its name and the origins that it carries, one
 * deeper, as many as fit. Thread safe.
 *
 * @param recording open, of this path; NULL: a file
 * @param text      INCISE_SOURCE_TEXT bytes
 * @return as incise_origins_read() and incise_recording_info()
 */
INCISE_API int incise_source_text(const char *path, struct incise_recording *recording,
				  char *text, struct incise_error *err);

/** Free what origins hold. */
INCISE_API void incise_origins_free(struct incise_origins *origins);

INCISE_END_DECLS
#endif
