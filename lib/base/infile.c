// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Reading of all input files; see incise/infile.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <incise/infile.h>
#include "utf8.h"

#define BUFFER_FIRST (1 << 16)
/* Time for the writer of a named pipe to open it, when both are started together. */
#define WRITER_MS 1000

struct incise_infile {
	const char *path; /* for messages */
	const struct incise_infile_kind *kind;
	int fd;
	int line;
	uint64_t size; /* bytes read so far */
	bool ended;
	char *data;	/* bytes that are read and not returned: from @at to @end */
	size_t at, end; /* followed by one byte for a NUL */
	size_t capacity;
};

static int fail_infile(const struct incise_infile *file, struct incise_error *err,
		       int code, const char *why)
{
	const char *advice = code == EACCES ? "change its permissions (chmod), or run as "
					      "its owner"
					    : file->kind->advice;

	return incise_error_set(err, code, "%.200s: %s%s%s", file->path, why,
				advice ? "; " : "", advice ? advice : "");
}

static int too_large(const struct incise_infile *file, struct incise_error *err)
{
	const uint64_t max = file->kind->size_max;
	const bool large = max >= 1 << 30;

	return incise_error_set(err, EFBIG,
				"%.200s: larger than %llu %s, the limit of %s",
				file->path,
				(unsigned long long)(max >> (large ? 30 : 20)),
				large ? "GiB" : "MiB", file->kind->name);
}

/* Refuse by type, before a device does something because it is opened. */
static int check_type(const struct incise_infile *file, const struct stat *st,
		      struct incise_error *err)
{
	if (S_ISREG(st->st_mode) || (S_ISFIFO(st->st_mode) && !file->kind->regular))
		return 0;
	if (S_ISDIR(st->st_mode))
		return fail_infile(file, err, EISDIR, strerror(EISDIR));
	return fail_infile(file, err, EINVAL,
			   file->kind->regular ? "not a regular file"
					       : "not a regular file or a pipe");
}

/* Read the available bytes into the buffer: 1, 0 at the end, or a negative errno. */
static int read_some(struct incise_infile *file)
{
	ssize_t n = read(file->fd, file->data + file->end, file->capacity - file->end);

	if (n < 0)
		return -errno;
	file->ended = !n;
	file->end += (size_t)n;
	file->size += (size_t)n;
	return n > 0;
}

/* A pipe that was opened without waiting: begin to read it, and let it block from now on. */
static int begin_pipe(struct incise_infile *file, struct incise_error *err)
{
	struct pollfd ready = {.fd = file->fd, .events = POLLIN};
	int rc;

	poll(&ready, 1, WRITER_MS);
	rc = read_some(file);
	if (!rc)
		return fail_infile(file, err, ENODATA, "no program writes to this pipe");
	if (rc < 0 && rc != -EAGAIN)
		return fail_infile(file, err, -rc, strerror(-rc));
	if (fcntl(file->fd, F_SETFL, 0))
		return fail_infile(file, err, errno, strerror(errno));
	return 0;
}

static int open_path(struct incise_infile *file, struct incise_error *err)
{
	struct stat st;
	int rc;

	if (stat(file->path, &st))
		return fail_infile(file, err, errno, strerror(errno));
	rc = check_type(file, &st, err);
	if (rc)
		return rc;
	file->fd = open(file->path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
	if (file->fd < 0 || fstat(file->fd, &st))
		return fail_infile(file, err, errno, strerror(errno));
	rc = check_type(file, &st, err);
	if (!rc && S_ISFIFO(st.st_mode))
		rc = begin_pipe(file, err);
	else if (!rc && file->kind->size_max &&
		 (uint64_t)st.st_size > file->kind->size_max)
		rc = too_large(file, err);
	return rc;
}

struct incise_infile *incise_infile_open(const char *path,
					 const struct incise_infile_kind *kind,
					 struct incise_error *err)
{
	struct incise_infile *file = calloc(1, sizeof(*file));
	char *data = malloc(BUFFER_FIRST + 1);
	int rc = 0;

	if (!file || !data) {
		free(file);
		free(data);
		return INCISE_ERROR_NULL(err, ENOMEM, "%.200s: no memory to read it",
					 path);
	}
	*file = (struct incise_infile){.path = path,
				       .kind = kind,
				       .fd = -1,
				       .data = data,
				       .capacity = BUFFER_FIRST};
	if (!strcmp(path, "-") && !kind->regular) {
		file->path = "standard input";
		file->fd = STDIN_FILENO;
	} else {
		rc = open_path(file, err);
	}
	if (rc) {
		incise_infile_close(file);
		errno = -rc;
		return NULL;
	}
	return file;
}

void incise_infile_close(struct incise_infile *file)
{
	if (!file)
		return;
	if (file->fd > STDIN_FILENO)
		close(file->fd);
	free(file->data);
	free(file);
}

/* Make capacity for more, and read: 1, 0 at the end, or a negative errno. */
static int fill_infile(struct incise_infile *file, struct incise_error *err)
{
	int rc;

	if (file->end == file->capacity && file->at) {
		memmove(file->data, file->data + file->at, file->end - file->at);
		file->end -= file->at;
		file->at = 0;
	}
	if (file->end == file->capacity) {
		char *more = realloc(file->data, 2 * file->capacity + 1);

		if (!more)
			return fail_infile(file, err, ENOMEM, strerror(ENOMEM));
		file->data = more;
		file->capacity *= 2;
	}
	rc = file->ended ? 0 : read_some(file);
	if (rc < 0)
		return fail_infile(file, err, -rc, strerror(-rc));
	if (rc && file->kind->size_max && file->size > file->kind->size_max)
		return too_large(file, err);
	return rc;
}

/* Look at the bytes behind @from for the line's end, and for a NUL byte. */
static int find_end(struct incise_infile *file, size_t from, char **newline,
		    struct incise_error *err)
{
	const size_t n = file->end - file->at - from;
	char *bytes = file->data + file->at + from;

	*newline = memchr(bytes, '\n', n);
	if (memchr(bytes, 0, *newline ? (size_t)(*newline - bytes) : n))
		return incise_error_set(err, EINVAL,
					"%.200s:%d: a NUL byte: this is "
					"not %s",
					file->path, file->line, file->kind->name);
	/* The limit may also lie within the bytes that were read at once. */
	if ((*newline ? (size_t)(*newline - bytes) : n) + from > INCISE_INFILE_LINE_MAX)
		return incise_error_set(err, EFBIG,
					"%.200s:%d: a line longer than %d MiB: this is "
					"not %s",
					file->path, file->line,
					INCISE_INFILE_LINE_MAX >> 20, file->kind->name);
	return 0;
}

int incise_infile_line(struct incise_infile *file, char **line, struct incise_error *err)
{
	char *newline = NULL;
	size_t from = 0;
	int rc;

	file->line++;
	while (!(rc = find_end(file, from, &newline, err)) && !newline) {
		from = file->end - file->at;
		rc = fill_infile(file, err);
		if (rc <= 0)
			break;
	}
	if (rc < 0)
		return rc;
	*line = file->data + file->at;
	if (!newline && file->at == file->end)
		return 0;
	if (!newline)
		newline = file->data + file->end;
	*newline = '\0';
	file->at = (size_t)(newline - file->data) + 1;
	if (file->at > file->end)
		file->at = file->end;
	if (file->line == 1)
		*line += utf8_mark(*line);
	return 1;
}

char *incise_infile_read(const char *path, const struct incise_infile_kind *kind,
			 size_t *size, struct incise_error *err)
{
	struct incise_infile *file = incise_infile_open(path, kind, err);
	char *data = NULL;
	int rc;

	if (!file)
		return NULL;
	while ((rc = fill_infile(file, err)) > 0)
		;
	if (!rc) {
		data = file->data;
		data[file->end] = '\0';
		*size = file->end;
		file->data = NULL;
	}
	incise_infile_close(file);
	errno = -rc;
	return data;
}

double incise_decimal(const char *text, char **end)
{
	const char *digits = text + strspn(text, " \t\n\v\f\r");

	digits += *digits == '-' || *digits == '+';
	if (digits[0] == '0' && (digits[1] == 'x' || digits[1] == 'X')) {
		*end = (char *)text;
		return 0;
	}
	return strtod(text, end);
}
