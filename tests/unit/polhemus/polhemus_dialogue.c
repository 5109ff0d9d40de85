// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/polhemus_dialogue.c with devices that are none: what they send ends neither
 * soon nor well. The talk with a tracker is in polhemus_setup.c.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <string.h>
#include "../../../lib/device/polhemus/polhemus_dialogue.h"

#define MS INT64_C(1000000)

/* Sends the same bytes every so often, so many times. */
struct source {
	struct polhemus_line line;
	const char *bytes;
	size_t n;
	int64_t every_ms, now_ns;
	long times;
};

static int source_write(struct polhemus_line *line, const void *bytes, size_t n)
{
	return 0;
}

static ssize_t source_read(struct polhemus_line *line, void *bytes, size_t size,
			   int64_t *t_ns, int timeout_ms)
{
	struct source *s = (struct source *)line;
	size_t n = s->n;

	if (!s->times || s->every_ms > timeout_ms) {
		s->now_ns += timeout_ms * MS;
		return 0;
	}
	s->times--;
	s->now_ns += s->every_ms * MS;
	*t_ns = s->now_ns;
	n = n < size ? n : size;
	memcpy(bytes, s->bytes, n);
	return (ssize_t)n;
}

static const struct polhemus_line_ops ops = {.write = source_write, .read = source_read};
static struct source source;
static struct incise_error err;
static struct polhemus_dialogue dialogue;

static void begin(const char *bytes, int64_t every_ms, long times)
{
	err = (struct incise_error){0};
	source = (struct source){
		.line = {.ops = &ops, .name = "/dev/source"},
		.bytes = bytes,
		.n = strlen(bytes),
		.every_ms = every_ms,
		.now_ns = 1000 * MS,
		.times = times,
	};
	dialogue = (struct polhemus_dialogue){
		.line = &source.line, .where = "test", .err = &err};
}

/* Also what comes so rarely that its bytes would never be many has an end. */
static void draining_ends(void **state)
{
	static const int64_t every_ms[] = {1, 20, 119};

	for (size_t i = 0; i < 3; i++) {
		begin("x", every_ms[i], -1);
		assert_int_equal(polhemus_drain(&dialogue), -EBUSY);
		/* By the line's own time, which waits no more than a read and a half second. */
		assert_true(source.now_ns < 2000 * MS);
		begin("x", every_ms[i], -1);
		assert_in_range(polhemus_collect(&dialogue), 1,
				(int)sizeof(dialogue.bytes));
		assert_true(source.now_ns < 2100 * MS);
		begin("x", every_ms[i], 3);
		assert_int_equal(polhemus_drain(&dialogue), 0);
		begin("x", every_ms[i], 3);
		assert_int_equal(polhemus_collect(&dialogue), 3);
	}
	/* Slower than that is quiet. */
	begin("x", 121, -1);
	assert_int_equal(polhemus_drain(&dialogue), 0);
	/* Faster than there is room for. */
	begin("0123456789012345678901234567890123456789", 0, -1);
	assert_int_equal(polhemus_collect(&dialogue), sizeof(dialogue.bytes));
}

static void answers(void **state)
{
	static const struct {
		const char *bytes;
		int rc;
		const char *reply;
	} cases[] = {
		{"21H 1.00 0.00 0.00\r\n", 0, " 1.00 0.00 0.00"},
		{"21H\n", 0, ""},
		{"21O 2\r\n\r\n21H1\r\n", 0, "1"},
		/* What is no line, and no end of one. */
		{"21H", -ETIMEDOUT, NULL},
		{"21O 2\r\n", -ETIMEDOUT, NULL},
		{"H\r\n2\r\n\n", -ETIMEDOUT, NULL},
		{"31H1\r\n", -ETIMEDOUT, NULL},
		{"2 E*ERROR*Hx*ERROR* EC -99\r\n", -EINVAL, NULL},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		char reply[POLHEMUS_REPLY_MAX];

		begin(cases[i].bytes, 1, 1);
		assert_int_equal(polhemus_ask(&dialogue, "H1\r", 'H', reply),
				 cases[i].rc);
		if (!cases[i].rc)
			assert_string_equal(reply, cases[i].reply);
	}
}

/* A line longer than an answer may be is cut, and one that never ends is none. */
static void long_lines(void **state)
{
	char text[400], reply[POLHEMUS_REPLY_MAX];

	memset(text, 'x', sizeof(text));
	memcpy(text, "21H", 3);
	strcpy(text + 380, "\r\n");
	begin(text, 1, 1);
	assert_int_equal(polhemus_ask(&dialogue, "H1\r", 'H', reply), 0);
	assert_int_equal(strlen(reply), POLHEMUS_REPLY_MAX - 1);
	text[380] = '\0';
	begin(text, 1, -1);
	assert_int_equal(polhemus_ask(&dialogue, "H1\r", 'H', reply), -ETIMEDOUT);
	assert_true(source.now_ns < 60000 * MS);
}

/* Behind what looks like one; an error; one that is of another command; never one. */
static void frames(void **state)
{
	static const struct {
		const char *bytes;
		size_t n;
		int rc;
	} cases[] = {
		{"PA\1H\0\0\2\0ab", 10, 0},
		{"\0LPYAPP\1PA\1H\0\0\2\0ab", 18, 0},
		{"LY\1Q\0\0\0\0LY\1H\0\0\2\0ab", 18, 0},
		/* As long as nothing is. */
		{"LY\1H\0\0\377\377LY\1H\0\0\2\0ab", 18, 0},
		{"PA\1Ha\0\0\0", 8, -EINVAL},
		{"PA\1H \0\2\0ab", 10, 0},
		{"PA\1H\0\0\2\0a", 9, -ETIMEDOUT},
		{"PA\1Q\0\0\2\0ab", 10, -ETIMEDOUT},
	};
	struct polhemus_frame frame;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		begin("", 1, 1);
		source.bytes = cases[i].bytes;
		source.n = cases[i].n;
		assert_int_equal(polhemus_ask_frame(&dialogue, "H\r", 'H', &frame),
				 cases[i].rc);
		if (cases[i].rc)
			continue;
		assert_int_equal(frame.n, 2);
		assert_memory_equal(frame.payload, "ab", 2);
	}
	begin("PAAxPLYLPPxyzAAAAAAA", 1, -1);
	assert_int_equal(polhemus_ask_frame(&dialogue, "H\r", 'H', &frame), -ETIMEDOUT);
}

/* Who closes a tracker does not wait until it has answered all, or not. */
static void given_up(void **state)
{
	static const _Atomic bool stop = true;
	char reply[POLHEMUS_REPLY_MAX];
	struct polhemus_frame frame;

	begin("x", 1, -1);
	source.line.stop = &stop;
	assert_int_equal(polhemus_drain(&dialogue), -ECANCELED);
	assert_int_equal(polhemus_collect(&dialogue), -ECANCELED);
	assert_int_equal(polhemus_ask(&dialogue, "S", 'S', reply), -ECANCELED);
	assert_int_equal(polhemus_ask_frame(&dialogue, "H\r", 'H', &frame), -ECANCELED);
	assert_int_equal(source.now_ns, 1000 * MS);
}

static void printed(void **state)
{
	static const struct {
		const char *command, *text;
	} cases[] = {
		{"H1,1.00\r", "H1,1.00"},
		{"\0251,0\r", "^U1,0"},
		{"\rc\rP", "cP"},
		{"", ""},
		{"abcdefghijklmnopqrstuvwxyz", "abcdefg"},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		char text[10];

		polhemus_print(text, sizeof(text), cases[i].command);
		assert_string_equal(text, cases[i].text);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(draining_ends), cmocka_unit_test(answers),
		cmocka_unit_test(long_lines),	 cmocka_unit_test(frames),
		cmocka_unit_test(given_up),	 cmocka_unit_test(printed),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
