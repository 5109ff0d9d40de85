// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Errors as values; see incise/error.h.
 */
#include <ctype.h>
#include <errno.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <incise/error.h>
#include <incise/version.h>

int incise_error_set(struct incise_error *err, int code, const char *fmt, ...)
{
	va_list args;

	if (err) {
		err->code = code;
		va_start(args, fmt);
		vsnprintf(err->text, sizeof(err->text), fmt, args);
		va_end(args);
		for (char *c = err->text; *c; c++)
			if ((unsigned char)*c < ' ' || *c == 0x7f)
				*c = '?';
	}
	errno = code;
	return -code;
}

/*
 * The Debian package of a shared object: by the rule of Debian Policy 8.1, libX2.so.3 is in
 * libx2-3 and libx.so.3 in libx3, apart from a few. False for a name that is no such object's.
 */
static bool package_of(const char *soname, size_t length, char *package, size_t size)
{
	static const struct {
		const char *soname, *package;
	} exceptions[] = {
		{"libhdf5_serial.so.103", "libhdf5-103-1"},
		{"libhdf5_serial.so.310", "libhdf5-310"},
		{"libcrypto.so.3", "libssl3"},
		{"libjpeg.so.62", "libjpeg62-turbo"},
		{"libgcc_s.so.1", "libgcc-s1"},
		{"libz.so.1", "zlib1g"},
		{"libincise.so.2", "libincise2"},
		{"libincise-learn.so.2", "libincise2"},
		{"libincise-record.so.2", "libincise2"},
		{"libincise-view.so.2", "libincise2"},
	};
	const char *so = memmem(soname, length, ".so.", 4);
	size_t n = 0;

	for (size_t i = 0; i < sizeof(exceptions) / sizeof(*exceptions); i++)
		if (strlen(exceptions[i].soname) == length &&
		    !strncmp(exceptions[i].soname, soname, length)) {
			snprintf(package, size, "%s", exceptions[i].package);
			return true;
		}
	if (!so || so == soname || length >= size - 1 || strncmp(soname, "lib", 3))
		return false;
	for (const char *c = soname; c < so; c++)
		package[n++] = *c == '_' ? '-' : *c >= 'A' && *c <= 'Z' ? *c + 32 : *c;
	if (isdigit((unsigned char)so[-1]))
		package[n++] = '-';
	for (const char *c = so + 4; c < soname + length; c++)
		package[n++] = *c;
	package[n] = '\0';
	return package[strspn(package, "abcdefghijklmnopqrstuvwxyz0123456789+-.")] ==
	       '\0';
}

int incise_error_library(struct incise_error *err, const char *where, const char *said)
{
	const size_t length = strcspn(said, ":");
	char package[80];

	/* "libmnl.so.0: cannot open shared object file: No such file or directory" */
	if (!strncmp(said + length, ": cannot open shared object", 27) &&
	    package_of(said, length, package, sizeof(package)))
		return incise_error_set(err, ENOEXEC,
					"%.200s: %.*s is missing; install it: sudo "
					"apt-get install %s",
					where, (int)length, said, package);
	return incise_error_set(err, ENOEXEC,
				"%.200s: %.250s; install the missing "
				"library",
				where, said);
}

const char *incise_version(void)
{
	return INCISE_VERSION;
}

#define NAME_MAX_LETTERS 48

/* Letters to leave out, add, replace or swap with the next to make @b of @a. */
static size_t edits(const char *a, const char *b)
{
	/* The last three rows of the table of all beginnings of a against all of b. */
	size_t rows[3][NAME_MAX_LETTERS + 1];
	size_t n = strlen(a), m = strlen(b);

	for (size_t j = 0; j <= m; j++)
		rows[0][j] = j;
	for (size_t i = 1; i <= n; i++) {
		const size_t *before = rows[(i + 1) % 3], *last = rows[(i - 1) % 3];
		size_t *row = rows[i % 3];

		row[0] = i;
		for (size_t j = 1; j <= m; j++) {
			size_t cost = last[j - 1] + (a[i - 1] != b[j - 1]);

			if (last[j] + 1 < cost)
				cost = last[j] + 1;
			if (row[j - 1] + 1 < cost)
				cost = row[j - 1] + 1;
			if (i > 1 && j > 1 && a[i - 1] == b[j - 2] &&
			    a[i - 2] == b[j - 1] && before[j - 2] + 1 < cost)
				cost = before[j - 2] + 1;
			row[j] = cost;
		}
	}
	return rows[n % 3][m];
}

const char *incise_nearest_name(const char *name, const char *const *names)
{
	size_t length = strlen(name), least = length < 6 ? 2 : length / 3 + 1;
	const char *nearest = NULL;

	if (length > NAME_MAX_LETTERS)
		return NULL;
	for (; *names; names++) {
		size_t needed =
			strlen(*names) > NAME_MAX_LETTERS ? least : edits(name, *names);

		if (needed < least) {
			least = needed;
			nearest = *names;
		}
	}
	return nearest;
}
