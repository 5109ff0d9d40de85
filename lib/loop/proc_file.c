// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A small file of /proc or /sys; see proc_file.h.
 */
#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>
#include "proc_file.h"

static bool is_blank(char c)
{
	return c == ' ' || c == '\n' || c == '\t';
}

static ssize_t read_all(int fd, char *text, size_t size)
{
	size_t length = 0;
	ssize_t rc = 1;

	while (length < size && rc > 0) {
		rc = read(fd, text + length, size - length);
		if (rc > 0)
			length += (size_t)rc;
		else if (rc < 0 && errno == EINTR)
			rc = 1;
	}
	return rc < 0 ? -errno : (ssize_t)length;
}

int proc_file_read(const char *root, const char *path, char *text, size_t size)
{
	char whole[4096];
	ssize_t length;
	int fd;

	text[0] = 0;
	if (snprintf(whole, sizeof(whole), "%s%s", root, path) >= (int)sizeof(whole))
		return -ENAMETOOLONG;
	/* The file may be a pipe, in a test or by mistake: do not wait for it. */
	fd = open(whole, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
	if (fd < 0)
		return -errno;
	length = read_all(fd, text, size - 1);
	close(fd);
	if (length < 0) {
		text[0] = 0;
		return (int)length;
	}
	while (length && is_blank(text[length - 1]))
		length--;
	text[length] = 0;
	for (ssize_t i = 0; i < length; i++)
		if (!is_blank(text[i]) && (text[i] < ' ' || text[i] > '~'))
			text[i] = '?';
	return (int)length;
}

bool proc_file_integer(const char *text, long long *value)
{
	const char *digits = text + (*text == '-');
	char *end;

	if (!isdigit((unsigned char)*digits))
		return false;
	errno = 0;
	*value = strtoll(text, &end, 10);
	return !errno && !*end;
}

/* A number of at most nine digits; returns the text behind it, or NULL. */
static const char *read_proc_number(const char *text, int *value)
{
	int length = 0;

	*value = 0;
	while (isdigit((unsigned char)text[length]) && length < 9)
		*value = *value * 10 + (text[length++] - '0');
	return length && !isdigit((unsigned char)text[length]) ? text + length : NULL;
}

bool proc_file_lists(const char *list, int cpu)
{
	bool has = false;

	while (list && *list) {
		int first, last;

		list = read_proc_number(list, &first);
		last = first;
		if (list && *list == '-')
			list = read_proc_number(list + 1, &last);
		if (!list || (*list && *list != ','))
			return false;
		has |= cpu >= first && cpu <= last;
		list += *list == ',';
	}
	return has && list;
}
