// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/device/igtl/igtl_message.h: bytes by the protocol's description, all that is packed
 * is found again, and what is wrong is found.
 */
#include "../unit.h"
#include <openigtlink/igtl_util.h>
#include "../../../lib/device/igtl/igtl_message.h"

static const char *const pairs[][2] = {{"Lost", "0"}, {"unit", "mN"}};
static const struct incise_igtl_label label = {.version = 1,
					       .type = "TRANSFORM",
					       .name = "TipToTracker",
					       .utc_ns = 1795740000123456789LL};
/* Version 2 of the same, with a type and a name that fill their fields. */
static const struct incise_igtl_label label2 = {
	.version = 2,
	.type = "GET_CAPABILI",
	.name = "twenty characters ok",
	.utc_ns = 1795740000123456789LL,
	.id = 0x01020304,
	.metadata = pairs,
	.n_metadata = 2,
};

static size_t pack(uint8_t *bytes, size_t capacity, const struct incise_igtl_label *label,
		   const void *content, size_t n)
{
	ssize_t size = incise_igtl_pack(bytes, capacity, label, NULL, 0, content, n);

	assert_true(size > 0);
	return (size_t)size;
}

/* What a new stream says of @bytes; the message is gone. */
static int read_once(const uint8_t *bytes, size_t n)
{
	struct incise_igtl_stream *stream = incise_igtl_stream_new(2000);
	struct incise_igtl_message message;
	int found = incise_igtl_stream_next(stream, &bytes, &n, &message);

	incise_igtl_stream_free(stream);
	return found;
}

/* The division of the polynomials, one bit after the other. */
static uint64_t divide(const uint8_t *bytes, size_t n)
{
	uint64_t crc = 0;

	for (size_t i = 0; i < n; i++)
		for (int bit = 7; bit >= 0; bit--) {
			uint64_t out = (crc >> 63 ^ bytes[i] >> bit) & 1;

			crc = crc << 1 ^ (out ? 0x42f0e1eba9ea3693 : 0);
		}
	return crc;
}

/* Byte by byte: libopenigtlink, which orders the header's, is not asked. */
TEST(bytes_are_those_of_the_protocol)
{
	/* seconds, and 0.123456789 · 2³² */
	static const uint8_t time[8] = {0x6b, 0x08, 0xd1, 0x60, 0x1f, 0x9a, 0xdd, 0x37};
	static const uint8_t body2[] = {0,   12,  0,   18,  0,	 0,   0,   11,	1,
					2,   3,	  4,   'a', 'b', 'c', 0,   2,	0,
					4,   0,	  3,   0,   0,	 0,   1,   0,	4,
					0,   3,	  0,   0,   0,	 2,   'L', 'o', 's',
					't', '0', 'u', 'n', 'i', 't', 'm', 'N'};
	uint8_t bytes[200], expected[58] = "\0\1TRANSFORM\0\0\0TipToTracker";

	memcpy(expected + 34, time, 8);
	expected[49] = 3;
	for (int i = 0; i < 8; i++)
		expected[50 + i] =
			(uint8_t)(divide((const uint8_t *)"abc", 3) >> (56 - 8 * i));
	assert_int_equal(pack(bytes, sizeof(bytes), &label, "abc", 3), 61);
	assert_memory_equal(bytes, expected, 58);
	assert_memory_equal(bytes + 58, "abc", 3);
	/* a head of content is in front */
	assert_int_equal(incise_igtl_pack(bytes, sizeof(bytes), &label2, "a", 1, "bc", 2),
			 58 + sizeof(body2));
	assert_memory_equal(bytes, "\0\2GET_CAPABILItwenty characters ok", 34);
	assert_memory_equal(bytes + 58, body2, sizeof(body2));
}

TEST(times_survive)
{
	static const int64_t seconds[] = {0, 1, 1795740000, UINT32_MAX};

	for (size_t i = 0; i < 4; i++)
		for (int64_t ns = i ? 0 : 1; ns < 1000000000;
		     ns += ns < 1000 || ns > 999999000 ? 1 : 99991) {
			int64_t t = seconds[i] * 1000000000 + ns;

			assert_true(incise_igtl_time_ns(incise_igtl_time(t)) == t);
		}
	assert_true(incise_igtl_time(500000000) == 0x80000000);
	assert_true(incise_igtl_time(1000000000) == 1ULL << 32);
	assert_true(incise_igtl_time(-1) == 0);
	assert_true(incise_igtl_time((UINT32_MAX + 1LL) * 1000000000) == 0);
	assert_true(incise_igtl_time_ns(UINT64_MAX) == 4294967296LL * 1000000000);
}

/* libopenigtlink adds 32 halves, each rounded to 1 ns: up to 12 ns off. */
TEST(times_are_near_those_of_libopenigtlink)
{
	for (uint32_t ns = 0; ns < 1000000000; ns += 999983) {
		int64_t exact = (int64_t)incise_igtl_time(ns);

		assert_true(llabs((int64_t)igtl_nanosec_to_frac(ns) - exact) < 13 * 4.3);
		assert_true(llabs((int64_t)igtl_frac_to_nanosec((uint32_t)exact) - ns) <
			    13);
	}
}

/* --- packed and found --------------------------------------------------------------------- */

static void check_message(const struct incise_igtl_message *message, int i)
{
	const struct incise_igtl_label *expected = i ? &label2 : &label;
	struct incise_igtl_pair pair;

	assert_int_equal(message->version, expected->version);
	assert_string_equal(message->type, expected->type);
	assert_string_equal(message->name, expected->name);
	assert_true(message->utc_ns == expected->utc_ns);
	assert_int_equal(message->id, expected->id);
	assert_int_equal(message->n_metadata, expected->n_metadata);
	assert_int_equal(message->n, 5 * i);
	assert_memory_equal(message->content, "12345", 5 * (size_t)i);
	for (int k = 0; k < message->n_metadata; k++) {
		assert_int_equal(incise_igtl_metadata(message, k, &pair), 0);
		assert_int_equal(pair.key_n, 4);
		assert_memory_equal(pair.key, pairs[k][0], 4);
		assert_int_equal(pair.value_n, k + 1);
		assert_memory_equal(pair.value, pairs[k][1], (size_t)k + 1);
	}
	assert_int_equal(incise_igtl_metadata(message, message->n_metadata, &pair),
			 -ENOENT);
	assert_int_equal(incise_igtl_metadata(message, -1, &pair), -ENOENT);
}

/* As they come: all at once, or in parts of each size. */
TEST(streams_find_all_messages)
{
	uint8_t bytes[300];
	size_t size = pack(bytes, sizeof(bytes), &label, NULL, 0);

	size += pack(bytes + size, sizeof(bytes) - size, &label2, "12345", 5);
	for (size_t part = 1; part <= size; part++) {
		struct incise_igtl_stream *stream = incise_igtl_stream_new(2000);
		struct incise_igtl_message message;
		int found = 0;

		assert_false(incise_igtl_stream_inside(stream));
		for (size_t at = 0; at < size; at += part) {
			const uint8_t *next = bytes + at;
			size_t n = part < size - at ? part : size - at;

			while (incise_igtl_stream_next(stream, &next, &n, &message))
				check_message(&message, found++);
			assert_int_equal(n, 0);
		}
		assert_int_equal(found, 2);
		assert_false(incise_igtl_stream_inside(stream));
		incise_igtl_stream_free(stream);
	}
}

TEST(each_changed_bit_of_a_body_is_found)
{
	uint8_t bytes[200];
	size_t size = pack(bytes, sizeof(bytes), &label2, "12345", 5);

	for (size_t bit = 8 * (IGTL_HEADER_SIZE - 8); bit < 8 * size; bit++) {
		bytes[bit / 8] ^= (uint8_t)(1 << bit % 8);
		assert_int_equal(read_once(bytes, size), -EBADMSG);
		bytes[bit / 8] ^= (uint8_t)(1 << bit % 8);
	}
	for (size_t n = 0; n < size; n++)
		assert_int_equal(read_once(bytes, n), 0);
	assert_int_equal(read_once(bytes, size), 1);
}

/* Sizes in a body whose CRC is right: of the extended header, the table, the pairs, and in the table. */
TEST(sizes_that_contradict_each_other_are_no_message)
{
	static const struct {
		size_t at;
		uint8_t value;
		int found;
	} cases[] = {
		{1, 12, 1},	  {1, 11, -EPROTO}, {1, 13, 1},	      {0, 255, -EPROTO},
		{3, 18, 1},	  {3, 0, -EPROTO},  {3, 1, -EPROTO},  {3, 26, -EPROTO},
		{2, 1, -EPROTO},  {7, 10, -EPROTO}, {7, 12, -EPROTO}, {4, 255, -EPROTO},
		{18, 1, -EPROTO}, {20, 5, -EPROTO}, {26, 0, -EPROTO}, {23, 255, -EPROTO},
	};
	uint8_t body[64], bytes[200];
	size_t n = pack(bytes, sizeof(bytes), &label2, "12345", 5) - IGTL_HEADER_SIZE;
	struct incise_igtl_label raw = label;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		uint8_t packed[200];

		memcpy(body, bytes + IGTL_HEADER_SIZE, n);
		body[cases[i].at] = cases[i].value;
		/* As version 1 packs it, with the right CRC. */
		pack(packed, sizeof(packed), &raw, body, n);
		packed[1] = 2;
		assert_int_equal(read_once(packed, IGTL_HEADER_SIZE + n), cases[i].found);
	}
}

/* A stream goes on behind a message that is too large or damaged, and not behind junk. */
TEST(streams_pass_over_what_is_wrong)
{
	static uint8_t bytes[4096], zeros[1000];
	struct incise_igtl_stream *stream = incise_igtl_stream_new(100);
	struct incise_igtl_message message;
	size_t n = pack(bytes, sizeof(bytes), &label2, zeros, sizeof(zeros));
	const uint8_t *at = bytes;

	n += pack(bytes + n, sizeof(bytes) - n, &label, zeros, 48);
	bytes[n - 1] ^= 1;
	n += pack(bytes + n, sizeof(bytes) - n, &label, zeros, 48);
	memset(bytes + n, 'x', 100);
	n += 100;
	assert_int_equal(incise_igtl_stream_next(stream, &at, &n, &message), -EMSGSIZE);
	assert_string_equal(message.type, label2.type);
	assert_true(incise_igtl_stream_inside(stream));
	assert_int_equal(incise_igtl_stream_next(stream, &at, &n, &message), -EBADMSG);
	assert_int_equal(incise_igtl_stream_next(stream, &at, &n, &message), 1);
	assert_string_equal(message.type, "TRANSFORM");
	assert_int_equal(incise_igtl_stream_next(stream, &at, &n, &message), -EPROTO);
	assert_int_equal(incise_igtl_stream_next(stream, &at, &n, &message), -EPROTO);
	incise_igtl_stream_free(stream);
	incise_igtl_stream_free(NULL);
}

TEST(what_does_not_fit_is_refused)
{
	uint8_t bytes[200];

	assert_int_equal(incise_igtl_pack(bytes, 57, &label, NULL, 0, NULL, 0), -ENOBUFS);
	assert_int_equal(incise_igtl_pack(bytes, 58, &label, NULL, 0, NULL, 0), 58);
	assert_int_equal(incise_igtl_pack(bytes, 59, &label, "a", 1, "b", 1), -ENOBUFS);
	assert_int_equal(incise_igtl_pack(bytes, 98, &label2, NULL, 0, NULL, 0),
			 -ENOBUFS);
	assert_int_equal(incise_igtl_pack(bytes, 99, &label2, NULL, 0, NULL, 0), 99);
}

/* A header that is none, or holds what no terminal should get. */
TEST(headers_are_checked)
{
	static const struct {
		size_t at;
		uint8_t value;
		int found;
	} cases[] = {{1, 0, -EPROTO}, {1, 3, -EPROTO}, {0, 1, -EPROTO},
		     {2, 0, -EPROTO}, {5, 7, -EPROTO}, {4, 0xe4, -EPROTO},
		     {2, '_', 1},     {15, 27, 1}};
	uint8_t bytes[100];

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct incise_igtl_stream *stream = incise_igtl_stream_new(100);
		size_t n = pack(bytes, sizeof(bytes), &label, NULL, 0);
		struct incise_igtl_message message;
		const uint8_t *at = bytes;

		bytes[cases[i].at] = cases[i].value;
		assert_int_equal(incise_igtl_stream_next(stream, &at, &n, &message),
				 cases[i].found);
		if (cases[i].at == 15)
			assert_string_equal(message.name, "T?pToTracker");
		incise_igtl_stream_free(stream);
	}
}
