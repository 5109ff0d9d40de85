// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of lib/base/igtl.c: bytes next to those of libopenigtlink's C functions, all that is
 * packed is parsed back, and what is wrong is found.
 */
#include "../unit.h"
#include <incise/igtl.h>

#if __has_include(<openigtlink/igtl_header.h>)
#include <openigtlink/igtl_header.h>
#include <openigtlink/igtl_image.h>
#include <openigtlink/igtl_position.h>
#include <openigtlink/igtl_string.h>
#include <openigtlink/igtl_tdata.h>
#include <openigtlink/igtl_transform.h>
#include <openigtlink/igtl_util.h>
#define PEER 1
#endif

static const double pose[3][4] = {
	{0.36, 0.48, -0.8, 12.5}, {-0.8, 0.6, 0, -3.25}, {0.48, 0.64, 0.6, 1e-3}};
static const struct incise_igtl_label label = {
	.version = 1, .name = "TipToTracker", .utc_ns = 1795740000123456789LL};
static const struct incise_igtl_pair pairs[] = {
	{.key = "Lost", .key_n = 4, .value = "0", .value_n = 1},
	{.key = "unit", .key_n = 4, .value = "µN", .value_n = 3},
};
/* Version 2 of the same. */
static const struct incise_igtl_label label2 = {
	.version = 2,
	.name = "TipToTracker",
	.utc_ns = 1795740000123456789LL,
	.id = 0x01020304,
	.metadata = pairs,
	.n_metadata = 2,
};

/* The division of the polynomials, one bit after the other. */
static uint64_t divide(uint64_t crc, const uint8_t *bytes, size_t n)
{
	for (size_t i = 0; i < n; i++)
		for (int bit = 7; bit >= 0; bit--) {
			uint64_t out = (crc >> 63 ^ bytes[i] >> bit) & 1;

			crc = crc << 1 ^ (out ? 0x42f0e1eba9ea3693 : 0);
		}
	return crc;
}

TEST(crc_is_that_of_ecma_182)
{
	uint8_t bytes[300];

	/* CRC-64/ECMA-182 of the catalogue of CRCs */
	assert_true(incise_igtl_crc64(0, "123456789", 9) == 0x6c40df5f0b497347);
	for (size_t i = 0; i < sizeof(bytes); i++)
		bytes[i] = (uint8_t)(i * 167 + 13);
	for (size_t n = 0; n < 40; n++)
		for (size_t from = 0; from < 9; from++)
			assert_true(incise_igtl_crc64(n, bytes + from, n) ==
				    divide(n, bytes + from, n));
	for (size_t n = 0; n <= sizeof(bytes); n++)
		assert_true(incise_igtl_crc64(incise_igtl_crc64(0, bytes, n), bytes + n,
					      sizeof(bytes) - n) ==
			    divide(0, bytes, sizeof(bytes)));
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

#ifdef PEER
/* A header as libopenigtlink packs it, with the time of ours. */
static void peer_header(uint8_t *bytes, const char *type, const char *name, uint64_t size,
			uint64_t crc)
{
	igtl_header header = {0};

	header.version = IGTL_HEADER_VERSION;
	memcpy(header.name, type, strlen(type));
	memcpy(header.device_name, name, strlen(name));
	header.timestamp = incise_igtl_time(label.utc_ns);
	header.body_size = size;
	header.crc = crc;
	igtl_header_convert_byte_order(&header);
	memcpy(bytes, &header, sizeof(header));
}

TEST(transform_equals_libopenigtlink)
{
	igtl_float32 body[12];
	uint8_t ours[200], peers[IGTL_HEADER_SIZE + IGTL_TRANSFORM_SIZE];

	for (int i = 0; i < 12; i++)
		body[i] = (float)pose[i % 3][i / 3];
	igtl_transform_convert_byte_order(body);
	peer_header(peers, "TRANSFORM", "TipToTracker", IGTL_TRANSFORM_SIZE,
		    igtl_transform_get_crc(body));
	memcpy(peers + IGTL_HEADER_SIZE, body, sizeof(body));
	assert_int_equal(incise_igtl_pack_transform(ours, sizeof(ours), &label, pose),
			 sizeof(peers));
	assert_memory_equal(ours, peers, sizeof(peers));
}

TEST(string_equals_libopenigtlink)
{
	static const char text[] = "{\"force_N\":[0,1.5,-2]}";
	igtl_string_header head = {.encoding = 3, .length = sizeof(text) - 1};
	uint8_t ours[200], peers[IGTL_HEADER_SIZE + 4 + sizeof(text) - 1];

	igtl_string_convert_byte_order(&head);
	peer_header(peers, "STRING", "TipToTracker", 4 + sizeof(text) - 1,
		    igtl_string_get_crc(&head, (void *)(uintptr_t)text));
	memcpy(peers + IGTL_HEADER_SIZE, &head, 4);
	memcpy(peers + IGTL_HEADER_SIZE + 4, text, sizeof(text) - 1);
	assert_int_equal(incise_igtl_pack_string(ours, sizeof(ours), &label, text,
						 sizeof(text) - 1),
			 sizeof(peers));
	assert_memory_equal(ours, peers, sizeof(peers));
}

static void check_image(int components)
{
	enum { COLUMNS = 5, ROWS = 3, N_MAX = COLUMNS * ROWS * 3 };
	uint8_t pixel[N_MAX], ours[400],
		peers[IGTL_HEADER_SIZE + IGTL_IMAGE_HEADER_SIZE + N_MAX];
	uint8_t *body = peers + IGTL_HEADER_SIZE;
	size_t n = (size_t)(COLUMNS * ROWS * components), size;
	struct incise_igtl_image image = {
		.components = (uint8_t)components,
		.scalar = INCISE_IGTL_UINT8,
		.little = true,
		.ras = true,
		.size = {COLUMNS, ROWS, 1},
		.axis = {{0.5, 0, 0}, {0, 0.25, 0}, {0, 0, 1}},
		.centre = {1, -2, 3.5},
		.part = {COLUMNS, ROWS, 1},
		.pixel = pixel,
		.n = n,
	};
	igtl_image_header head = {
		.version = IGTL_IMAGE_HEADER_VERSION,
		.num_components = (igtl_uint8)components,
		.scalar_type = IGTL_IMAGE_STYPE_TYPE_UINT8,
		.endian = IGTL_IMAGE_ENDIAN_LITTLE,
		.coord = IGTL_IMAGE_COORD_RAS,
		.size = {COLUMNS, ROWS, 1},
		.subvol_size = {COLUMNS, ROWS, 1},
	};
	float spacing[3] = {0.5f, 0.25f, 1}, origin[3] = {1, -2, 3.5f}, x[3] = {1, 0, 0},
	      y[3] = {0, 1, 0}, z[3] = {0, 0, 1};

	for (size_t i = 0; i < n; i++)
		pixel[i] = (uint8_t)(7 * i);
	igtl_image_set_matrix(spacing, origin, x, y, z, &head);
	igtl_image_convert_byte_order(&head);
	memcpy(body, &head, IGTL_IMAGE_HEADER_SIZE);
	memcpy(body + IGTL_IMAGE_HEADER_SIZE, pixel, n);
	size = IGTL_IMAGE_HEADER_SIZE + n;
	peer_header(peers, "IMAGE", "TipToTracker", size, crc64(body, size, 0));
	/* Its CRC of an image, which of version 1.11 forgets the components. */
	if (components == 1)
		assert_true(igtl_image_get_crc(&head, pixel) == crc64(body, size, 0));
	assert_int_equal(incise_igtl_pack_image(ours, sizeof(ours), &label, &image),
			 IGTL_HEADER_SIZE + size);
	assert_memory_equal(ours, peers, IGTL_HEADER_SIZE + size);
}

TEST(images_equal_libopenigtlink)
{
	check_image(1);
	check_image(3);
}

/* Its header of C functions is not in the package; the functions are. */
#pragma pack(1)
struct peer_status {
	igtl_uint16 code;
	igtl_int64 subcode;
	char error[20];
};
#pragma pack()
void igtl_status_convert_byte_order(struct peer_status *status);
igtl_uint64 igtl_status_get_crc(struct peer_status *status, igtl_uint32 n,
				const char *text);

TEST(status_equals_libopenigtlink)
{
	static const char text[] = "scene neck runs";
	const struct incise_igtl_status status = {
		.code = INCISE_IGTL_OK, .sub_code = -5, .error = "running", .text = text};
	struct peer_status head = {.code = 1, .subcode = -5, .error = "running"};
	uint8_t ours[200], peers[IGTL_HEADER_SIZE + sizeof(head) + sizeof(text)];

	igtl_status_convert_byte_order(&head);
	peer_header(peers, "STATUS", "TipToTracker", sizeof(head) + sizeof(text),
		    igtl_status_get_crc(&head, sizeof(text), text));
	memcpy(peers + IGTL_HEADER_SIZE, &head, sizeof(head));
	memcpy(peers + IGTL_HEADER_SIZE + sizeof(head), text, sizeof(text));
	assert_int_equal(incise_igtl_pack_status(ours, sizeof(ours), &label, &status),
			 sizeof(peers));
	assert_memory_equal(ours, peers, sizeof(peers));
}

TEST(trackers_of_libopenigtlink_are_read)
{
	igtl_tdata_element element[2] = {{.name = "Probe", .type = IGTL_TDATA_TYPE_6D},
					 {.name = "Tip", .type = IGTL_TDATA_TYPE_6D}};
	/* a quarter of a turn about z */
	igtl_position position = {.position = {1, 2, 3},
				  .quaternion = {0, 0, (float)M_SQRT1_2,
						 (float)M_SQRT1_2}};
	static const double turned[3][4] = {{0, -1, 0, 1}, {1, 0, 0, 2}, {0, 0, 1, 3}};
	uint8_t bytes[300];
	struct incise_igtl_message message;
	double matrix[3][4];
	char name[21];

	for (int i = 0; i < 12; i++)
		element[1].transform[i] = (float)pose[i % 3][i / 3];
	igtl_tdata_convert_byte_order(element, 2);
	peer_header(bytes, "TDATA", "Tracker", 140, igtl_tdata_get_crc(element, 2));
	memcpy(bytes + IGTL_HEADER_SIZE, element, 140);
	assert_int_equal(incise_igtl_parse(bytes, sizeof(bytes), &message), 198);
	assert_int_equal(incise_igtl_tdata(&message, 1, name, matrix), 0);
	assert_string_equal(name, "Tip");
	for (int i = 0; i < 12; i++)
		assert_true((float)pose[i / 4][i % 4] == (float)matrix[i / 4][i % 4]);
	assert_int_equal(incise_igtl_tdata(&message, 2, name, matrix), -ENOENT);
	assert_int_equal(incise_igtl_tdata(&message, -1, name, matrix), -ENOENT);

	igtl_position_convert_byte_order(&position);
	peer_header(bytes, "POSITION", "Tip", 28, igtl_position_get_crc(&position));
	memcpy(bytes + IGTL_HEADER_SIZE, &position, 28);
	assert_int_equal(incise_igtl_parse(bytes, sizeof(bytes), &message), 86);
	assert_int_equal(incise_igtl_position(&message, matrix), 0);
	/* the quaternion is one of floats, 24 bits */
	for (int i = 0; i < 12; i++)
		assert_true(fabs(matrix[i / 4][i % 4] - turned[i / 4][i % 4]) < 1e-6);
}

/* It adds 32 halves, each rounded to 1 ns: up to 12 ns off. */
TEST(times_are_near_those_of_libopenigtlink)
{
	for (uint32_t ns = 0; ns < 1000000000; ns += 999983) {
		int64_t exact = (int64_t)incise_igtl_time(ns);

		assert_true(llabs((int64_t)igtl_nanosec_to_frac(ns) - exact) < 13 * 4.3);
		assert_true(llabs((int64_t)igtl_frac_to_nanosec((uint32_t)exact) - ns) <
			    13);
	}
}
#else
TEST(no_peer)
{
	skip(); /* libopenigtlink-dev is not installed */
}
#endif

/* --- packed and parsed ------------------------------------------------------------------ */

/* Messages of all types, in both versions. Returns the size. */
static size_t all_messages(uint8_t *bytes, size_t capacity)
{
	static const uint8_t pixel[12] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
	static const struct incise_igtl_image image = {
		.components = 1,
		.scalar = INCISE_IGTL_UINT16,
		.size = {4, 3, 2},
		.axis = {{1}, {0, 1}, {0, 0, 1}},
		.offset = {1, 1, 1},
		.part = {3, 2, 1},
		.pixel = pixel,
		.n = 12,
	};
	const struct incise_igtl_status status = {.code = INCISE_IGTL_HARDWARE_FAILURE,
						  .error = "twenty characters ok",
						  .text = ""};
	size_t n = 0;

	for (int version = 1; version <= 2; version++) {
		const struct incise_igtl_label *l = version == 1 ? &label : &label2;

		n += (size_t)incise_igtl_pack_transform(bytes + n, capacity - n, l, pose);
		n += (size_t)incise_igtl_pack_string(bytes + n, capacity - n, l, "µ", 2);
		n += (size_t)incise_igtl_pack_status(bytes + n, capacity - n, l, &status);
		n += (size_t)incise_igtl_pack_image(bytes + n, capacity - n, l, &image);
		n += (size_t)incise_igtl_pack(bytes + n, capacity - n, l, "GET_CAPABILI",
					      NULL, 0);
	}
	return n;
}

static void check_message(const struct incise_igtl_message *message, int i)
{
	static const char *const types[] = {"TRANSFORM", "STRING", "STATUS", "IMAGE",
					    "GET_CAPABILI"};
	struct incise_igtl_image image;
	struct incise_igtl_status status;
	struct incise_igtl_pair pair;
	double matrix[3][4];
	const char *text;
	size_t n;
	uint16_t encoding;

	assert_int_equal(message->version, i < 5 ? 1 : 2);
	assert_string_equal(message->type, types[i % 5]);
	assert_string_equal(message->name, "TipToTracker");
	assert_true(message->utc_ns == label.utc_ns);
	assert_int_equal(message->id, i < 5 ? 0 : 0x01020304);
	assert_int_equal(message->n_metadata, i < 5 ? 0 : 2);
	if (i >= 5) {
		assert_int_equal(incise_igtl_metadata(message, 1, &pair), 0);
		assert_int_equal(pair.key_n, 4);
		assert_memory_equal(pair.key, "unit", 4);
		assert_int_equal(pair.value_n, 3);
		assert_memory_equal(pair.value, "µN", 3);
		assert_int_equal(pair.encoding, 106);
		assert_int_equal(incise_igtl_metadata(message, 0, &pair), 0);
		assert_int_equal(pair.encoding, 3);
	}
	assert_int_equal(incise_igtl_metadata(message, message->n_metadata, &pair),
			 -ENOENT);
	assert_int_equal(incise_igtl_transform(message, matrix),
			 i % 5 == 0 ? 0 : -EPROTO);
	for (int k = 0; k < 12 && i % 5 == 0; k++)
		assert_true(matrix[k / 4][k % 4] == (float)pose[k / 4][k % 4]);
	assert_int_equal(incise_igtl_string(message, &text, &n, &encoding),
			 i % 5 == 1 ? 0 : -EPROTO);
	if (i % 5 == 1)
		assert_true(n == 2 && !memcmp(text, "µ", 2) && encoding == 106);
	assert_int_equal(incise_igtl_status(message, &status), i % 5 == 2 ? 0 : -EPROTO);
	if (i % 5 == 2) {
		assert_int_equal(status.code, INCISE_IGTL_HARDWARE_FAILURE);
		assert_string_equal(status.error, "twenty characters ok");
		assert_int_equal(status.n, 0);
	}
	assert_int_equal(incise_igtl_image(message, &image), i % 5 == 3 ? 0 : -EPROTO);
	if (i % 5 == 3)
		assert_true(image.n == 12 && image.pixel[11] == 12 &&
			    image.part[0] == 3 && image.offset[2] == 1 &&
			    image.axis[1][1] == 1);
}

/* As they come: all at once, or in parts of each size. */
TEST(streams_find_all_messages)
{
	static uint8_t bytes[4096];
	size_t size = all_messages(bytes, sizeof(bytes));

	for (size_t part = 1; part <= size; part = part < 200 ? part + 1 : size) {
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
		assert_int_equal(found, 10);
		assert_false(incise_igtl_stream_inside(stream));
		incise_igtl_stream_free(stream);
		if (part == size)
			break;
	}
}

TEST(each_changed_bit_of_a_body_is_found)
{
	uint8_t bytes[300];
	struct incise_igtl_message message;
	ssize_t size = incise_igtl_pack_transform(bytes, sizeof(bytes), &label2, pose);

	for (int bit = 8 * (INCISE_IGTL_HEADER - 8); bit < 8 * size; bit++) {
		bytes[bit / 8] ^= (uint8_t)(1 << bit % 8);
		assert_int_equal(incise_igtl_parse(bytes, (size_t)size, &message),
				 -EBADMSG);
		bytes[bit / 8] ^= (uint8_t)(1 << bit % 8);
	}
	for (size_t n = 0; n < (size_t)size; n++)
		assert_int_equal(incise_igtl_parse(bytes, n, &message), -EAGAIN);
	assert_int_equal(incise_igtl_parse(bytes, (size_t)size, &message), size);
}

/* A stream goes on behind a message that is too large or damaged, and not behind junk. */
TEST(streams_pass_over_what_is_wrong)
{
	static uint8_t bytes[4096];
	struct incise_igtl_stream *stream = incise_igtl_stream_new(100);
	struct incise_igtl_message message;
	size_t large, n = 0;
	const uint8_t *at = bytes;

	large = (size_t)incise_igtl_pack(bytes, sizeof(bytes), &label, "LARGE", bytes,
					 1000);
	n = large + (size_t)incise_igtl_pack_transform(
			    bytes + large, sizeof(bytes) - large, &label, pose);
	bytes[n - 1] ^= 1;
	n += (size_t)incise_igtl_pack_transform(bytes + n, sizeof(bytes) - n, &label,
						pose);
	memset(bytes + n, 'x', 100);
	n += 100;
	assert_int_equal(incise_igtl_stream_next(stream, &at, &n, &message), -EMSGSIZE);
	assert_string_equal(message.type, "LARGE");
	assert_true(incise_igtl_stream_inside(stream));
	assert_int_equal(incise_igtl_stream_next(stream, &at, &n, &message), -EBADMSG);
	assert_int_equal(incise_igtl_stream_next(stream, &at, &n, &message), 1);
	assert_string_equal(message.type, "TRANSFORM");
	assert_int_equal(incise_igtl_stream_next(stream, &at, &n, &message), -EPROTO);
	assert_int_equal(incise_igtl_stream_next(stream, &at, &n, &message), -EPROTO);
	incise_igtl_stream_free(stream);
	incise_igtl_stream_free(NULL);
}

TEST(wrong_arguments_are_refused)
{
	struct incise_igtl_label wrong = label;
	const struct incise_igtl_image image = {.components = 1,
						.scalar = INCISE_IGTL_UINT8,
						.size = {2, 2, 1},
						.part = {2, 2, 1},
						.pixel = (const uint8_t *)"abc",
						.n = 3};
	struct incise_igtl_message message;
	static uint8_t bytes[0x11000];
	double matrix[3][4];

	assert_int_equal(incise_igtl_pack(bytes, 57, &label, "A", NULL, 0), -ENOBUFS);
	assert_int_equal(incise_igtl_pack(bytes, 58, &label, "A", NULL, 0), 58);
	assert_int_equal(incise_igtl_pack(bytes, 58, &label, "A", "", 1), -ENOBUFS);
	assert_int_equal(incise_igtl_pack(bytes, 58, &label, "A", "", SIZE_MAX),
			 -ENOBUFS);
	assert_int_equal(incise_igtl_pack(bytes, 58, &label, "", NULL, 0), -EINVAL);
	assert_int_equal(incise_igtl_pack(bytes, 58, &label, "thirteen bytes", NULL, 0),
			 -EINVAL);
	assert_int_equal(incise_igtl_pack_image(bytes, 4096, &label, &image), -EINVAL);
	assert_int_equal(incise_igtl_pack_string(bytes, sizeof(bytes), &label,
						 (const char *)bytes, 0x10000),
			 -EMSGSIZE);
	assert_int_equal(incise_igtl_pack_string(bytes + 62, sizeof(bytes) - 62, &label,
						 (const char *)bytes, 0xff),
			 58 + 4 + 0xff);
	wrong.version = 3;
	assert_int_equal(incise_igtl_pack(bytes, 4096, &wrong, "A", NULL, 0), -EINVAL);
	wrong.version = 1;
	wrong.name = "twenty-one characters";
	assert_int_equal(incise_igtl_pack(bytes, 4096, &wrong, "A", NULL, 0), -EINVAL);
	wrong = label2;
	wrong.n_metadata = 8192;
	assert_int_equal(incise_igtl_pack(bytes, 4096, &wrong, "A", NULL, 0), -EMSGSIZE);

	/* numbers that are none */
	assert_int_equal(
		incise_igtl_pack_transform(bytes, 4096, &label,
					   (const double[3][4]){{NAN}, {0}, {0}}),
		106);
	assert_int_equal(incise_igtl_parse(bytes, 106, &message), 106);
	assert_int_equal(incise_igtl_transform(&message, matrix), -EDOM);
	assert_int_equal(incise_igtl_pack(bytes, 4096, &label, "POSITION",
					  (const uint8_t[28]){0}, 28),
			 86);
	assert_int_equal(incise_igtl_parse(bytes, 86, &message), 86);
	assert_int_equal(incise_igtl_position(&message, matrix), -EDOM);
	assert_int_equal(incise_igtl_pack(bytes, 4096, &label, "POSITION",
					  (const uint8_t[12]){0}, 12),
			 70);
	assert_int_equal(incise_igtl_parse(bytes, 70, &message), 70);
	assert_int_equal(incise_igtl_position(&message, matrix), 0);
	assert_true(matrix[0][0] == 1 && matrix[1][1] == 1 && matrix[2][1] == 0);
}
