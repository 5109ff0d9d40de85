/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * An error as a value: a code for programs and one line for people. The line is made
 * once, where the cause is known, and handed up unchanged.
 */
#ifndef INCISE_ERROR_H
#define INCISE_ERROR_H

#include <stdarg.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** An error that a person can act on. Set it to {0} before use. */
struct incise_error {
	int code;	/**< positive errno, 0 for none */
	char text[500]; /**< one line without a newline: what, where, what to do */
};

/**
 * Fill in an error and return its code as the callers of the library expect it.
 *
 * Control characters are replaced by '?', so that text from a file cannot break the line.
 *
 * @param err  where to leave the line, or NULL
 * @param code positive errno
 * @return -code; errno is set to code as well, for functions that return pointers.
 */
INCISE_API int incise_error_set(struct incise_error *err, int code, const char *fmt, ...)
	INCISE_PRINTF(3, 4);

/**
 * Fill in the error of a shared library or module that cannot be loaded, with the Debian
 * package of the library that is missing.
 *
 * @param where the object in front of the line
 * @param said  what dlerror(3) returned
 * @return -ENOEXEC
 */
INCISE_API int incise_error_library(struct incise_error *err, const char *where,
				    const char *said);

/**
 * Find the name that a person meant who typed another one: the fewest letters left out, added,
 * replaced or swapped, at most a third of those typed, or one.
 *
 * @param name  the name as typed
 * @param names the known names, which end with NULL
 * @return one of @names, or NULL if none is that near.
 */
INCISE_API const char *incise_nearest_name(const char *name, const char *const *names);

INCISE_END_DECLS
#endif
