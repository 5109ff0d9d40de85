/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A file that is read: regular, a pipe or standard input. A device is refused and a pipe that
 * nobody writes to is not waited for. Each kind of file has a limit of its size, and each line
 * one of its length, which the error names, so that no input takes all memory.
 */
#ifndef INCISE_INFILE_H
#define INCISE_INFILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Bytes of a line at most. */
#define INCISE_INFILE_LINE_MAX (1 << 20)

/** A kind of file; it must outlive the files that are read as this kind. */
struct incise_infile_kind {
	const char *name; /**< with an article: "a .fis file" */
	const char *
		advice; /**< behind an error of the system: "give a .fis file"; or NULL */
	uint64_t size_max; /**< bytes; 0: read line by line, however long it is */
	bool regular;	   /**< no pipe and no standard input, "-" is a name */
};

struct incise_infile;

/**
 * Open a file for reading line by line. "-" is standard input. A pipe is given a second in
 * which its writer may open it.
 *
 * @param path must outlive the file
 * @return file, to be closed with incise_infile_close(); NULL with errno of open(2), EISDIR,
 *         EINVAL (a device, or a pipe where the kind has to be regular), EFBIG (larger than
 *         the limit), ENODATA (a pipe that nobody writes to), ENOMEM.
 */
INCISE_API struct incise_infile *incise_infile_open(const char *path,
						    const struct incise_infile_kind *kind,
						    struct incise_error *err);

/**
 * Read the next line.
 *
 * @param line set to the line without its newline; it may be changed, and is valid up to the
 *             next call
 * @return 1; 0 at the end of the file; a negative errno of read(2), -EINVAL (a NUL byte),
 *         -EFBIG (the line or the file is longer than its limit), -ENOMEM.
 */
INCISE_API int incise_infile_line(struct incise_infile *file, char **line,
				  struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_infile_close(struct incise_infile *file);

/**
 * Read a whole file, of a kind with a limit.
 *
 * @param size set to its number of bytes
 * @return its bytes with a NUL behind them, to be freed with free(3); NULL with errno of
 *         incise_infile_open() or read(2).
 */
INCISE_API char *incise_infile_read(const char *path,
				    const struct incise_infile_kind *kind, size_t *size,
				    struct incise_error *err);

/**
 * A number in text, as strtod(3) reads it with one difference: a hexadecimal one is none, and
 * @end is then @text. Real-time safe.
 */
INCISE_API double incise_decimal(const char *text, char **end);

INCISE_END_DECLS
#endif
