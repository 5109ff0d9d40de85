// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * lib/device/polhemus/polhemus_reply.c: replies as the manual prints them, and what are none.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>
#include "../../../lib/device/polhemus/polhemus_model.h"
#include "../../../lib/device/polhemus/polhemus_reply.h"

/* 3 + 3 + 3 + 1 + 2 + 1 + 2 + 6 + 32 + 2 */
static const char good[] = "23S3FB 17 F35  j.k.lmF18 Simulator05 Saint Louis     \r\n";

static bool reads(const char *text, size_t n, struct polhemus_status *status)
{
	return polhemus_status_read((const unsigned char *)text, n, status);
}

static void a_status(void **state)
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

static void numbers(void **state)
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

static void fields(void **state)
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

static void frames(void **state)
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

static void models(void **state)
{
	static const struct {
		uint16_t vendor, product;
		bool known, ready;
	} cases[] = {
		{0x0f44, 0x0001, true, false},	{0x0f44, 0x0002, true, true},
		{0x0f44, 0x0003, true, true},	{0x0f44, 0xff12, true, true},
		{0x0f44, 0xff21, true, false},	{0x0f44, 0xef20, true, true},
		{0x0f44, 0x1234, false, false}, {0x1d6b, 0x0002, false, false},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		const struct polhemus_model *m =
			polhemus_model_find(cases[i].vendor, cases[i].product);

		assert_int_equal(m != NULL, cases[i].known);
		assert_true(!m || m->ready == cases[i].ready);
	}
	/* 120 Hz for all, 240 and 60 for each. */
	assert_true(polhemus_family_hz(POLHEMUS_FASTRAK, 4) == 120);
	assert_true(polhemus_family_hz(POLHEMUS_LIBERTY, 2) == 480);
	assert_true(polhemus_family_hz(POLHEMUS_PATRIOT, 1) == 60);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_status), cmocka_unit_test(numbers),
		cmocka_unit_test(fields),   cmocka_unit_test(frames),
		cmocka_unit_test(models),
	};

	return cmocka_run_group_tests(tests, NULL, NULL);
}
