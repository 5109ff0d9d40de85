// SPDX-License-Identifier: GPL-2.0-or-later
/* lib/device/polhemus/polhemus_records.c: records made by hand, byte by byte. */
#include "../unit.h"
#include "../../../lib/device/polhemus/polhemus_records.h"

static const struct polhemus_layout fastrak = {
	.family = POLHEMUS_FASTRAK, .stations = 1, .switch_bytes = 1};

#define LENGTH 34 /* 3 + 28 + 1 + 2 */

/* One whose floats hold what looks like headers and ends. */
static void make(unsigned char bytes[LENGTH], float x)
{
	const float values[7] = {x, -2.5F, 1, 0.6F, 0, 0.8F, 0};

	memcpy(bytes, "01 ", 3);
	memcpy(bytes + 3, values, sizeof(values));
	memcpy(bytes + 31, "0\r\n", 3);
}

static float looks_like(const char bytes[4])
{
	float value;

	memcpy(&value, bytes, 4);
	return value;
}

TEST(lengths)
{
	static const struct {
		struct polhemus_layout layout;
		size_t length;
	} cases[] = {
		{{POLHEMUS_FASTRAK, false, 1, 1}, 34},
		{{POLHEMUS_FASTRAK, false, 1, 2}, 35},
		{{POLHEMUS_FASTRAK, false, 1, 4}, 37},
		{{POLHEMUS_FASTRAK, true, 1, 1}, 55},
		{{POLHEMUS_FASTRAK, true, 1, 2}, 56},
		{{POLHEMUS_FASTRAK, true, 1, 4}, 0},
		{{POLHEMUS_FASTRAK, false, 1, 0}, 0},
		{{POLHEMUS_FASTRAK, false, 1, 3}, 0},
		{{POLHEMUS_LIBERTY, false, 1, 0}, 44},
		{{POLHEMUS_PATRIOT, false, 1, 0}, 44},
		{{POLHEMUS_PATRIOT, true, 1, 0}, 0},
	};

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++)
		assert_int_equal(polhemus_layout_length(&cases[i].layout),
				 cases[i].length);
}

TEST(one_record)
{
	unsigned char bytes[LENGTH];
	struct polhemus_record r;

	make(bytes, 12.25F);
	bytes[2] = 'x';
	bytes[31] = '1';
	assert_true(polhemus_record_read(&fastrak, bytes, &r));
	/* cm become mm; these floats are exact. */
	assert_true(r.position_mm[0] == 122.5 && r.position_mm[1] == -25 &&
		    r.position_mm[2] == 10);
	/* A float's 0.6 is not the double's. */
	assert_true(fabs(r.quaternion[0] - 0.6) < 1e-7 &&
		    fabs(r.quaternion[2] - 0.8) < 1e-7);
	assert_int_equal(r.status, 'x');
	assert_int_equal(r.station, 1);
	assert_true(r.button);
}

TEST(what_is_no_record)
{
	static const struct {
		size_t at;
		unsigned char byte;
	} cases[] = {
		{0, '1'},  {1, '0'},  {1, '2'},	  {1, '5'},   {2, 0},
		{2, 0x7f}, {6, 0x7f}, {6, 0xff},  {18, 0x7f}, {18, 0x40},
		{31, 2},   {31, ' '}, {32, '\n'}, {33, '\r'},
	};
	struct polhemus_record r;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		unsigned char bytes[LENGTH];

		make(bytes, 1);
		assert_true(polhemus_record_read(&fastrak, bytes, &r));
		bytes[cases[i].at] = cases[i].byte;
		if (polhemus_record_read(&fastrak, bytes, &r))
			fail_msg("byte %zu may be %#x", cases[i].at, cases[i].byte);
	}
}

TEST(text)
{
	static const struct polhemus_layout ascii = {POLHEMUS_FASTRAK, true, 2, 1};
	static const char good[] = "02  -12.34   0.05 100.00"
				   " 0.6000 0.0000-0.8000 0.0000"
				   "1\r\n";
	static const struct {
		size_t at;
		const char *bytes;
	} bad[] = {
		{20, "O"},	{17, "       "}, {18, "1-"},
		{18, "1.0.00"}, {41, "9"}, /* no unit quaternion */
	};
	struct polhemus_record r;

	assert_int_equal(strlen(good), polhemus_layout_length(&ascii));
	assert_true(polhemus_record_read(&ascii, (const unsigned char *)good, &r));
	/* Decimals are not exact; an ulp or two of 1000. */
	assert_true(fabs(r.position_mm[0] + 123.4) < 1e-9 &&
		    fabs(r.position_mm[2] - 1000) < 1e-9);
	assert_true(fabs(r.quaternion[2] + 0.8) < 1e-9);
	assert_true(r.button && r.station == 2);
	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++) {
		unsigned char bytes[sizeof(good)];

		memcpy(bytes, good, sizeof(good));
		memcpy(bytes + bad[i].at, bad[i].bytes, strlen(bad[i].bytes));
		if (polhemus_record_read(&ascii, bytes, &r))
			fail_msg("\"%s\" at %zu", bad[i].bytes, bad[i].at);
	}
}

TEST(frames)
{
	static const struct polhemus_layout patriot = {POLHEMUS_PATRIOT, false, 3, 0};
	const float values[7] = {1, 2, 3, 1, 0, 0, 0};
	unsigned char bytes[44] = {'P', 'A', 2, 'C', 'a', 0, 36, 0};
	struct polhemus_record r;

	memcpy(bytes + 8, values, sizeof(values));
	memcpy(bytes + 36, (uint8_t[]){0x78, 0x56, 0x34, 0x12, 1, 0, 0, 0}, 8);
	assert_true(polhemus_record_read(&patriot, bytes, &r));
	assert_true(r.position_mm[2] == 30 && r.frame == 0x12345678 && r.button);
	assert_int_equal(r.status, 'a');
	assert_int_equal(r.station, 2);
	bytes[4] = 0;
	assert_true(polhemus_record_read(&patriot, bytes, &r) && r.status == ' ');
	bytes[4] = 200;
	assert_true(polhemus_record_read(&patriot, bytes, &r) && r.status == '?');
	for (size_t i = 0; i < 8; i++) {
		unsigned char was = bytes[i];

		if (i == 4 || i == 5)
			continue;
		bytes[i] = 0x55;
		assert_false(polhemus_record_read(&patriot, bytes, &r));
		bytes[i] = was;
	}
}

/* Whatever is cut into whatever pieces, each of these records comes, at its last byte. */
TEST(in_any_pieces)
{
	/* Floats whose bytes are headers, and one that is an end. */
	const float xs[] = {looks_like("01 A"), looks_like("1 01"), looks_like("\r\n01"),
			    looks_like("0001")};
	unsigned char stream[4 * LENGTH];

	for (int i = 0; i < 4; i++)
		make(stream + (size_t)i * LENGTH, xs[i]);
	for (size_t piece = 1; piece <= POLHEMUS_RECORD_MAX; piece++) {
		struct polhemus_records records;
		struct polhemus_record r;
		int n = 0;

		polhemus_records_init(&records, &fastrak);
		for (size_t at = 0; at < sizeof(stream); at += piece) {
			size_t some =
				sizeof(stream) - at < piece ? sizeof(stream) - at : piece;

			assert_int_equal(polhemus_records_put(&records, stream + at, some,
							      (int64_t)at),
					 some);
			while (polhemus_records_next(&records, &r)) {
				size_t last = (size_t)(n + 1) * LENGTH - 1;

				assert_true(r.position_mm[0] == (double)xs[n] * 10);
				assert_int_equal(r.skipped, 0);
				assert_int_equal(r.t_ns, last / piece * piece);
				n++;
			}
		}
		assert_int_equal(n, 4);
	}
}

/* Each single byte of a record in the middle damaged, lost or doubled: only that one goes. */
TEST(loses_one)
{
	for (int kind = 0; kind < 3; kind++)
		for (size_t at = LENGTH; at < 2 * LENGTH; at++) {
			unsigned char stream[3 * LENGTH + 1];
			size_t n = 3 * LENGTH;
			struct polhemus_records records;
			struct polhemus_record r;
			int seen = 0;

			for (int i = 0; i < 3; i++)
				make(stream + (size_t)i * LENGTH, (float)(i + 1));
			if (kind == 0)
				stream[at] ^= 0x55;
			else if (kind == 1)
				memmove(stream + at, stream + at + 1, --n - at);
			else
				memmove(stream + at + 1, stream + at, n++ - at);
			polhemus_records_init(&records, &fastrak);
			for (size_t i = 0; i < n; i++) {
				polhemus_records_put(&records, stream + i, 1, 0);
				while (polhemus_records_next(&records, &r))
					seen |= 1 << (int)(r.position_mm[0] / 10 + 0.5);
			}
			/* 1 and 3; what became of 2 is its own. */
			if ((seen & 10) != 10)
				fail_msg("kind %d, byte %zu: %#x", kind, at, seen);
		}
}
