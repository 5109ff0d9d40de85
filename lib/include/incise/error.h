/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * An error as a value: a code for programs and one line for people. The function that detects
 * the cause writes the line; its callers pass it on unchanged.
 */
#ifndef INCISE_ERROR_H
#define INCISE_ERROR_H

#include <stdarg.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** An error with a line for people. Initialise it with {0}. */
struct incise_error {
	int code;	/**< positive errno, 0 without an error */
	char text[500]; /**< one line without a newline: what, where, what to do */
};

/**
 * Fill in an error and return its code in the convention of the library.
 *
 * Control characters are replaced by '?', so that text from a file cannot break the line.
 *
 * @param err  result, or NULL
 * @param code positive errno
 * @return -code; errno is set to code, too, for functions that return pointers.
 */
INCISE_API int incise_error_set(struct incise_error *err, int code, const char *fmt, ...)
	INCISE_PRINTF(3, 4);

/** The same in C for functions that return pointers: NULL, with errno set. */
#define INCISE_ERROR_NULL(err, code, ...) \
	((void)incise_error_set(err, code, __VA_ARGS__), (void *)0)

/**
 * Fill in the error of a shared library or module that cannot be loaded. The line names the
 * Debian package of the missing library.
 *
 * @param where start of the line: the object that is wrong
 * @param said  result of dlerror(3)
 * @return -ENOEXEC
 */
INCISE_API int incise_error_library(struct incise_error *err, const char *where,
				    const char *said);

/**
 * Find the known name nearest to a misspelt one: by the smallest number of omitted, added,
 * replaced or swapped letters, at most a third of the typed letters, or one.
 *
 * @param name  the name as typed
 * @param names the known names, which end with NULL
 * @return one of @names, or NULL if none is near enough.
 */
INCISE_API const char *incise_nearest_name(const char *name, const char *const *names);

INCISE_END_DECLS
#endif
