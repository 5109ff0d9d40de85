// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/polhemus_dialogue.c: replies as the manual prints them, bytes that are none, and
 * devices that are no trackers. The dialogue with a tracker is in polhemus_setup.c.
 */
#include "../unit.h"
#include "../../../lib/device/polhemus/polhemus_dialogue.h"
#include "../../../lib/device/polhemus/polhemus_model.h"

/* --- reply --- */

/* 3 + 3 + 3 + 1 + 2 + 1 + 2 + 6 + 32 + 2 */
static const char good[] = "23S3FB 17 F35  j.k.lmF18 Simulator05 Saint Louis     \r\n";

static bool reads(const char *text, size_t n, struct polhemus_status *status)
{
	return polhemus_status_read((const unsigned char *)text, n, status);
}

TEST(a_status)
{
	static const struct {
		size_t at;
		char byte;
	} bad[] = {{0, '1'}, {1, '0'}, {1, '5'},   {2, 's'},  {3, 'G'},
		   {5, ' '}, {6, 'x'}, {53, '\n'}, {54, '\r'}};
	struct polhemus_status s;
	char text[sizeof(good)];

	assert_int_equal(strlen(good), POLHEMUS_STATUS_LENGTH);
	assert_true(reads(good, 55, &s));
	assert_int_equal(s.station, 3);
	assert_true(s.binary && s.centimetres && !s.compensated && s.continuous);
	assert_int_equal(s.test_error, 17);
	assert_int_equal(s.sensors, 5);
	assert_string_equal(s.version, "j.k.lm");
	assert_string_equal(s.id, "F18 Simulator05 Saint Louis");
	assert_false(reads(good, 54, &s));
	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++) {
		memcpy(text, good, sizeof(good));
		text[bad[i].at] = bad[i].byte;
		assert_false(reads(text, 55, &s));
	}
	memcpy(text, good, sizeof(good));
	memcpy(text + 6, "   ", 3);
	text[12] = ' ';
	text[30] = '\a';
	assert_true(reads(text, 55, &s));
	assert_int_equal(s.test_error, 0);
	assert_int_equal(s.sensors, -1);
	assert_non_null(strchr(s.id, '?'));
}

TEST(numbers)
{
	static const struct {
		const char *text;
		int n;
		double values[4];
	} cases[] = {
		{"", 0, {0}},
		{"   ", 0, {0}},
		{"  -1.50  0.25+12.00-3", 4, {-1.5, 0.25, 12, -3}},
		{"1,2, 3", 3, {1, 2, 3}},
		{"-.5", 1, {-0.5}},
		{"999999999", 1, {999999999}},
		{"9999999999", -1, {0}},
		{"1e5", -1, {0}},
		{"nan", -1, {0}},
		{"-", -1, {0}},
		{".", -1, {0}},
		{"1 2 3 4 5", -1, {0}},
		{"1.2.3", -1, {0}},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		double values[4] = {0};
		int n = polhemus_reply_numbers(cases[i].text, values, 4);

		if (n != cases[i].n)
			fail_msg("\"%s\": %d", cases[i].text, n);
		for (int k = 0; k < n; k++)
			assert_float_equal(values[k], cases[i].values[k], 1e-12);
	}
}

TEST(fields)
{
	static const struct {
		const char *text;
		int width, n, values[4];
	} cases[] = {
		{" 21116 1", 2, 4, {2, 11, 16, 1}},
		{"1010", 1, 4, {1, 0, 1, 0}},
		{" 2 411", 2, 3, {2, 4, 11}},
		{"", 2, 0, {0}},
		{" 21", 2, -1, {0}},
		{"  ", 2, -1, {0}},
		{"10101", 1, -1, {0}},
		{"1x", 2, -1, {0}},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		int values[4] = {0};
		int n = polhemus_reply_fields(cases[i].text, cases[i].width, values, 4);

		if (n != cases[i].n)
			fail_msg("\"%s\": %d", cases[i].text, n);
		for (int k = 0; k < n; k++)
			assert_int_equal(values[k], cases[i].values[k]);
	}
}

TEST(reply_frames)
{
	unsigned char bytes[] = {'L', 'Y', 2, 'H', 0, 0, 3, 0, 'a', 'b', 'c', 'd'};
	struct polhemus_frame f;

	for (size_t n = 0; n < 11; n++)
		assert_int_equal(polhemus_frame_read(bytes, n, &f), 0);
	assert_int_equal(polhemus_frame_read(bytes, sizeof(bytes), &f), 1);
	assert_true(f.family == POLHEMUS_LIBERTY && f.station == 2 && f.command == 'H');
	assert_true(f.n == 3 && f.length == 11 && f.payload == bytes + 8);
	bytes[7] = 2; /* 515 bytes */
	assert_int_equal(polhemus_frame_read(bytes, sizeof(bytes), &f), -1);
	bytes[7] = 0;
	bytes[0] = 'P';
	assert_int_equal(polhemus_frame_read(bytes, sizeof(bytes), &f), -1);
	bytes[1] = 'A';
	assert_int_equal(polhemus_frame_read(bytes, sizeof(bytes), &f), 1);
	assert_int_equal(f.family, POLHEMUS_PATRIOT);
	bytes[0] = 'x';
	assert_int_equal(polhemus_frame_read(bytes, 1, &f), -1);
}

/* --- polhemus_dialogue --- */

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
TEST(draining_ends)
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

TEST(answers)
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
TEST(long_lines)
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
TEST(frames)
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

/* close() does not wait for a dialogue to end. */
TEST(given_up)
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

TEST(printed)
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
