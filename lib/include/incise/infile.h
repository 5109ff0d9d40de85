/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Input files: regular files, pipes and standard input. Devices are rejected, and a pipe
 * without a writer is an error. Each kind of file has a size limit and each line a length
 * limit, so that no input takes all memory; the error names the limit.
 */
#ifndef INCISE_INFILE_H
#define INCISE_INFILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** Largest number of bytes in a line. */
#define INCISE_INFILE_LINE_MAX (1 << 20)

/** A kind of file; it must outlive the files of this kind. */
struct incise_infile_kind {
	const char *name;   /**< with an article: "a .fis file" */
	const char *advice; /**< end of a system error: "give a .fis file"; or NULL */
	uint64_t size_max;  /**< bytes; 0: no limit, read line by line */
	bool regular;	    /**< reject pipes and standard input; "-" is a name */
};

struct incise_infile;

/**
 * Open a file for reading line by line. "-" is standard input. The writer of a pipe has one
 * second to open it.
 *
 * @param path must outlive the file
 * @return file, to be closed with incise_infile_close(); NULL with errno of open(2), EISDIR,
 *         EINVAL (a device, or a pipe if the kind is regular), EFBIG (larger than the limit),
 *         ENODATA (a pipe without a writer), ENOMEM.
 */
INCISE_API struct incise_infile *incise_infile_open(const char *path,
						    const struct incise_infile_kind *kind,
						    struct incise_error *err);

/**
 * Read the next line. A byte order mark of UTF-8 before the first one is passed over.
 *
 * @param line set to the line without its newline; it may be modified and is valid until the
 *             next call
 * @return 1; 0 at the end of the file; a negative errno of read(2), -EINVAL (a NUL byte),
 *         -EFBIG (the line or the file is longer than its limit), -ENOMEM.
 */
INCISE_API int incise_infile_line(struct incise_infile *file, char **line,
				  struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_infile_close(struct incise_infile *file);

/**
 * Read a whole file of a kind with a size limit.
 *
 * @param size set to its number of bytes
 * @return its bytes followed by a NUL, to be freed with free(3); NULL with errno of
 *         incise_infile_open() or read(2).
 */
INCISE_API char *incise_infile_read(const char *path,
				    const struct incise_infile_kind *kind, size_t *size,
				    struct incise_error *err);

/**
 * Read a number like strtod(3), but reject hexadecimal numbers: @end is then @text. Real-time
 * safe.
 */
INCISE_API double incise_decimal(const char *text, char **end);

INCISE_END_DECLS
#endif
