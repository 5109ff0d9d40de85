/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * Messages for people: a test asserts the code, and that the text holds path, line, key and value. The wording is
 * in tests/messages/unit alone, which `make golden` writes: where INCISE_MESSAGES names a file, each text is
 * appended to it behind the name of the test.
 */
#ifndef INCISE_TEST_MESSAGE_H
#define INCISE_TEST_MESSAGE_H

#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <incise/error.h>

static inline void message_record(const char *text)
{
	const char *file = getenv("INCISE_MESSAGES");
	const char *test = strstr(__BASE_FILE__, "unit/") + strlen("unit/");
	char line[4096];
	int fd, n;

	if (!file)
		return;
	/* Some tests replace open() and write(). */
	fd = syscall(SYS_openat, AT_FDCWD, file, O_WRONLY | O_CREAT | O_APPEND, 0666);
	for (; *text; text += strcspn(text, "\n"), text += *text == '\n') {
		n = snprintf(line, sizeof(line), "%.*s: %.*s\n", (int)strlen(test) - 2,
			     test, (int)strcspn(text, "\n"), text);
		assert_true(fd >= 0 && syscall(SYS_write, fd, line, n) == n);
	}
	syscall(SYS_close, fd);
}

/* A test that skips something may lack messages. */
#undef skip
#define skip() (message_record("(skipped)"), _skip(__FILE__, __LINE__))

static inline void message_holds(const char *text, const char *const *pieces, size_t n,
				 const char *file, int line)
{
	for (size_t i = 0; i < n; i++)
		if (pieces[i] && !strstr(text, pieces[i])) {
			print_error("no \"%s\" in \"%s\"\n", pieces[i], text);
			_fail(file, line);
		}
	message_record(text);
}

static inline void message_code(intptr_t result, bool is_code, int code,
				const struct incise_error *err, const char *file,
				int line)
{
	if (err->code == code && !strchr(err->text, '\n') &&
	    (is_code ? result == -code : !result && errno == code))
		return;
	print_error("expected %s, got %ld, errno %d, %s: \"%s\"\n", strerrorname_np(code),
		    (long)result, errno, strerrorname_np(err->code), err->text);
	_fail(file, line);
}

/* assert_says(text, piece…): @text, of one line or more, holds the pieces; a piece may be NULL. */
#define assert_says(text, ...)                                                          \
	message_holds(text, (const char *[]){__VA_ARGS__},                              \
		      sizeof((const char *[]){__VA_ARGS__}) / sizeof(char *), __FILE__, \
		      __LINE__)

/*
 * assert_error(call, code, &err, piece…): the call fills in @err, and returns -code, or where it does not return
 * a number, NULL or false with errno.
 */
#define assert_error(call, code, err, ...)                                           \
	do {                                                                         \
		intptr_t message_result;                                             \
                                                                                     \
		*(err) = (struct incise_error){0};                                   \
		errno = 0;                                                           \
		message_result = (intptr_t)(call);                                   \
		message_code(message_result,                                         \
			     _Generic((call), int : 1, long : 1, default : 0), code, \
			     err, __FILE__, __LINE__);                               \
		assert_says((err)->text, __VA_ARGS__);                               \
	} while (0)

#endif
