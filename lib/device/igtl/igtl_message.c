// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Messages of OpenIGTLink; see incise/igtl.h. Lengths in mm, times in ns.
 */
#include <endian.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <incise/igtl.h>

/* --- CRC-64 -------------------------------------------------------------------------- */

/*
 * table[k][b]: what byte b does to the CRC k bytes later. It is linear: the sum of what its bits
 * do, which are the arguments, x^64 · x^(8k + bit) modulo the polynomial. Eight bytes at a time:
 * a frame of a camera is some MB, and a byte at a time takes 3 ms for each.
 */
#define BIT(b, n, term) ((b) >> (n)&1 ? UINT64_C(term) : 0)
#define BYTE(b, t0, t1, t2, t3, t4, t5, t6, t7)                                          \
	(BIT(b, 0, t0) ^ BIT(b, 1, t1) ^ BIT(b, 2, t2) ^ BIT(b, 3, t3) ^ BIT(b, 4, t4) ^ \
	 BIT(b, 5, t5) ^ BIT(b, 6, t6) ^ BIT(b, 7, t7))
#define BYTES4(b, ...)                                                                \
	BYTE(b, __VA_ARGS__), BYTE((b) + 1, __VA_ARGS__), BYTE((b) + 2, __VA_ARGS__), \
		BYTE((b) + 3, __VA_ARGS__)
#define BYTES16(b, ...)                                       \
	BYTES4(b, __VA_ARGS__), BYTES4((b) + 4, __VA_ARGS__), \
		BYTES4((b) + 8, __VA_ARGS__), BYTES4((b) + 12, __VA_ARGS__)
#define BYTES64(b, ...)                                          \
	BYTES16(b, __VA_ARGS__), BYTES16((b) + 16, __VA_ARGS__), \
		BYTES16((b) + 32, __VA_ARGS__), BYTES16((b) + 48, __VA_ARGS__)
#define TABLE(...)                                                           \
	{                                                                    \
		BYTES64(0, __VA_ARGS__), BYTES64(64, __VA_ARGS__),           \
			BYTES64(128, __VA_ARGS__), BYTES64(192, __VA_ARGS__) \
	}

static const uint64_t table[8][256] = {
	TABLE(0x42f0e1eba9ea3693, 0x85e1c3d753d46d26, 0x493366450e42ecdf,
	      0x9266cc8a1c85d9be, 0x663d78ff90e185ef, 0xcc7af1ff21c30bde,
	      0xda050215ea6c212f, 0xf6fae5c07d3274cd),
	TABLE(0xaf052a6b538edf09, 0x1cfab53d0ef78881, 0x39f56a7a1def1102,
	      0x73ead4f43bde2204, 0xe7d5a9e877bc4408, 0x8d5bb23b4692be83,
	      0x5847859d24cf4b95, 0xb08f0b3a499e972a),
	TABLE(0x23eef79f3ad718c7, 0x47ddef3e75ae318e, 0x8fbbde7ceb5c631c,
	      0x5d875d127f52f0ab, 0xbb0eba24fea5e156, 0x34ed95a254a1f43f,
	      0x69db2b44a943e87e, 0xd3b656895287d0fc),
	TABLE(0xe59c4cf90ce5976b, 0x89c87819b0211845, 0x516011d8c9a80619,
	      0xa2c023b193500c32, 0x0770a6888f4a2ef7, 0x0ee14d111e945dee,
	      0x1dc29a223d28bbdc, 0x3b8534447a5177b8),
	TABLE(0x770a6888f4a2ef70, 0xee14d111e945dee0, 0x9ed943c87b618b53,
	      0x7f42667b5f292035, 0xfe84ccf6be52406a, 0xbff97806d54eb647,
	      0x3d0211e603775a1d, 0x7a0423cc06eeb43a),
	TABLE(0xf40847980ddd6874, 0xaae06edbb250e67b, 0x17303c5ccd4bfa65,
	      0x2e6078b99a97f4ca, 0x5cc0f173352fe994, 0xb981e2e66a5fd328,
	      0x31f324277d5590c3, 0x63e6484efaab2186),
	TABLE(0xc7cc909df556430c, 0xcd69c0d04346b08b, 0xd823604b2f675785,
	      0xf2b6217df7249999, 0xa79ca31047a305a1, 0x0dc9a7cb26ac3dd1,
	      0x1b934f964d587ba2, 0x37269f2c9ab0f744),
	TABLE(0x6e4d3e593561ee88, 0xdc9a7cb26ac3dd10, 0xfbc4188f7c6d8cb3,
	      0xb578d0f551312ff5, 0x280140010b886979, 0x500280021710d2f2,
	      0xa00500042e21a5e4, 0x02fae1e3f5a97d5b),
};

uint64_t incise_igtl_crc64(uint64_t crc, const void *bytes, size_t n)
{
	const uint8_t *byte = bytes;
	uint64_t eight;

	for (; n >= 8; n -= 8, byte += 8) {
		memcpy(&eight, byte, 8);
		crc ^= be64toh(eight);
		crc = table[7][crc >> 56] ^ table[6][crc >> 48 & 0xff] ^
		      table[5][crc >> 40 & 0xff] ^ table[4][crc >> 32 & 0xff] ^
		      table[3][crc >> 24 & 0xff] ^ table[2][crc >> 16 & 0xff] ^
		      table[1][crc >> 8 & 0xff] ^ table[0][crc & 0xff];
	}
	for (; n; n--, byte++)
		crc = crc << 8 ^ table[0][crc >> 56 ^ *byte];
	return crc;
}

/* --- numbers ------------------------------------------------------------------------- */

#define SECOND_NS 1000000000ULL

uint64_t incise_igtl_time(int64_t utc_ns)
{
	uint64_t s, ns;

	if (utc_ns < 0 || (uint64_t)utc_ns / SECOND_NS > UINT32_MAX)
		return 0;
	s = (uint64_t)utc_ns / SECOND_NS;
	ns = (uint64_t)utc_ns % SECOND_NS;
	/* 999 999 999 ns round to 2^32 - 4: no carry. */
	return s << 32 | ((ns << 32) + SECOND_NS / 2) / SECOND_NS;
}

int64_t incise_igtl_time_ns(uint64_t time)
{
	uint64_t ns = ((time & UINT32_MAX) * SECOND_NS + (1ULL << 31)) >> 32;

	return (int64_t)((time >> 32) * SECOND_NS + ns);
}

/* Big-endian numbers of any place; each returns what follows. */
static uint8_t *put(uint8_t *to, const void *from, size_t n)
{
	if (n)
		memmove(to, from, n);
	return to + n;
}

static uint8_t *put16(uint8_t *to, uint16_t value)
{
	value = htobe16(value);
	return put(to, &value, 2);
}

static uint8_t *put32(uint8_t *to, uint32_t value)
{
	value = htobe32(value);
	return put(to, &value, 4);
}

static uint8_t *put64(uint8_t *to, uint64_t value)
{
	value = htobe64(value);
	return put(to, &value, 8);
}

static uint8_t *put_float(uint8_t *to, double value)
{
	float rounded = (float)value;
	uint32_t bits;

	memcpy(&bits, &rounded, 4);
	return put32(to, bits);
}

/* A name of @size bytes, filled up with zeros; without a zero at its end if it is that long. */
static uint8_t *put_name(uint8_t *to, const char *name, size_t size)
{
	size_t n = strnlen(name, size);

	memset(put(to, name, n), 0, size - n);
	return to + size;
}

static uint16_t get16(const uint8_t *from)
{
	return (uint16_t)(from[0] << 8 | from[1]);
}

static uint32_t get32(const uint8_t *from)
{
	return (uint32_t)get16(from) << 16 | get16(from + 2);
}

static uint64_t get64(const uint8_t *from)
{
	return (uint64_t)get32(from) << 32 | get32(from + 4);
}

static double get_float(const uint8_t *from)
{
	uint32_t bits = get32(from);
	float value;

	memcpy(&value, &bits, 4);
	return value;
}

/* Up to a zero, printable: it may go to a terminal. */
static void get_name(char *to, const uint8_t *from, size_t size)
{
	size_t n = strnlen((const char *)from, size);

	for (size_t i = 0; i < n; i++)
		to[i] = from[i] < ' ' || from[i] > '~' ? '?' : (char)from[i];
	to[n] = '\0';
}

/* --- packing ------------------------------------------------------------------------- */

#define ASCII 3
#define UTF8 106

static uint16_t encoding_of(const char *text, size_t n)
{
	for (size_t i = 0; i < n; i++)
		if ((unsigned char)text[i] >= 0x80)
			return UTF8;
	return ASCII;
}

/* Sizes of the parts behind the content; -EMSGSIZE. */
static int metadata_size(const struct incise_igtl_label *label, size_t *head,
			 size_t *body)
{
	*head = *body = 0;
	if (label->version == 1)
		return 0;
	/* The size of the table of pairs has 16 bits. */
	if (label->n_metadata < 0 || 2 + (size_t)label->n_metadata * 8 > UINT16_MAX)
		return -EMSGSIZE;
	*head = 2 + (size_t)label->n_metadata * 8;
	for (int i = 0; i < label->n_metadata; i++)
		*body += (size_t)label->metadata[i].key_n + label->metadata[i].value_n;
	return *body > UINT32_MAX ? -EMSGSIZE : 0;
}

static void put_metadata(uint8_t *to, const struct incise_igtl_label *label)
{
	const struct incise_igtl_pair *pair = label->metadata;

	to = put16(to, (uint16_t)label->n_metadata);
	for (int i = 0; i < label->n_metadata; i++) {
		to = put16(to, pair[i].key_n);
		to = put16(to, encoding_of(pair[i].value, pair[i].value_n));
		to = put32(to, pair[i].value_n);
	}
	for (int i = 0; i < label->n_metadata; i++) {
		to = put(to, pair[i].key, pair[i].key_n);
		to = put(to, pair[i].value, pair[i].value_n);
	}
}

/*
 * Write all but the content and the CRC. Returns the size of the message and the place of the
 * content, which has @n bytes.
 */
static ssize_t frame(void *bytes, size_t capacity, const struct incise_igtl_label *label,
		     const char *type, size_t n, uint8_t **content)
{
	size_t table_n, pairs_n, extended, body;
	uint8_t *at = bytes;
	int status;

	if (label->version < 1 || label->version > 2 || !*type ||
	    strlen(type) > INCISE_IGTL_TYPE || strlen(label->name) > INCISE_IGTL_NAME)
		return -EINVAL;
	status = metadata_size(label, &table_n, &pairs_n);
	if (status)
		return status;
	extended = label->version == 1 ? 0 : INCISE_IGTL_EXTENDED;
	if (capacity < INCISE_IGTL_HEADER + extended + table_n + pairs_n ||
	    capacity - INCISE_IGTL_HEADER - extended - table_n - pairs_n < n)
		return -ENOBUFS;
	body = extended + n + table_n + pairs_n;
	at = put16(at, (uint16_t)label->version);
	at = put_name(at, type, INCISE_IGTL_TYPE);
	at = put_name(at, label->name, INCISE_IGTL_NAME);
	at = put64(at, label->utc_ns ? incise_igtl_time(label->utc_ns) : 0);
	at = put64(at, body) + 8;
	if (extended) {
		at = put16(at, INCISE_IGTL_EXTENDED);
		at = put16(at, (uint16_t)table_n);
		at = put32(at, (uint32_t)pairs_n);
		at = put32(at, label->id);
		put_metadata(at + n, label);
	}
	*content = at;
	return (ssize_t)(INCISE_IGTL_HEADER + body);
}

/* Set the CRC, now that the body is complete. */
static ssize_t finish(void *bytes, ssize_t size)
{
	uint8_t *body = (uint8_t *)bytes + INCISE_IGTL_HEADER;

	put64(body - 8, incise_igtl_crc64(0, body, (size_t)size - INCISE_IGTL_HEADER));
	return size;
}

ssize_t incise_igtl_pack(void *bytes, size_t capacity,
			 const struct incise_igtl_label *label, const char *type,
			 const void *content, size_t n)
{
	uint8_t *to;
	ssize_t size = frame(bytes, capacity, label, type, n, &to);

	if (size < 0)
		return size;
	put(to, content, n);
	return finish(bytes, size);
}

#define MATRIX_SIZE 48

/* By columns: three axes, then the translation. */
static uint8_t *put_matrix(uint8_t *to, const double matrix[3][4])
{
	for (int column = 0; column < 4; column++)
		for (int row = 0; row < 3; row++)
			to = put_float(to, matrix[row][column]);
	return to;
}

ssize_t incise_igtl_pack_transform(void *bytes, size_t capacity,
				   const struct incise_igtl_label *label,
				   const double matrix[3][4])
{
	uint8_t *to;
	ssize_t size = frame(bytes, capacity, label, "TRANSFORM", MATRIX_SIZE, &to);

	if (size < 0)
		return size;
	put_matrix(to, matrix);
	return finish(bytes, size);
}

#define STRING_HEAD 4

ssize_t incise_igtl_pack_string(void *bytes, size_t capacity,
				const struct incise_igtl_label *label, const char *text,
				size_t n)
{
	uint8_t *to;
	ssize_t size;

	if (n > INCISE_IGTL_STRING_MAX)
		return -EMSGSIZE;
	size = frame(bytes, capacity, label, "STRING", STRING_HEAD + n, &to);
	if (size < 0)
		return size;
	to = put16(to, encoding_of(text, n));
	to = put16(to, (uint16_t)n);
	put(to, text, n);
	return finish(bytes, size);
}

#define STATUS_ERROR 20
#define STATUS_HEAD (2 + 8 + STATUS_ERROR)

ssize_t incise_igtl_pack_status(void *bytes, size_t capacity,
				const struct incise_igtl_label *label,
				const struct incise_igtl_status *status)
{
	size_t n = strlen(status->text) + 1;
	uint8_t *to;
	ssize_t size = frame(bytes, capacity, label, "STATUS", STATUS_HEAD + n, &to);

	if (size < 0)
		return size;
	to = put16(to, status->code);
	to = put64(to, (uint64_t)status->sub_code);
	to = put_name(to, status->error, STATUS_ERROR);
	put(to, status->text, n);
	return finish(bytes, size);
}

#define IMAGE_HEAD 72
#define IMAGE_BIG 1
#define IMAGE_LITTLE 2
#define IMAGE_RAS 1
#define IMAGE_LPS 2

/* Bytes of a scalar; 0: there is none. */
static size_t scalar_size(uint8_t scalar)
{
	static const uint8_t size[] = {
		[INCISE_IGTL_INT8] = 1,	   [INCISE_IGTL_UINT8] = 1,
		[INCISE_IGTL_INT16] = 2,   [INCISE_IGTL_UINT16] = 2,
		[INCISE_IGTL_INT32] = 4,   [INCISE_IGTL_UINT32] = 4,
		[INCISE_IGTL_FLOAT32] = 4, [INCISE_IGTL_FLOAT64] = 8,
	};

	return scalar < sizeof(size) ? size[scalar] : 0;
}

/* Whether the sizes agree. The product has at most 3 · 16 + 8 + 3 bits. */
static bool image_fits(const struct incise_igtl_image *image)
{
	uint64_t n = (uint64_t)image->components * scalar_size(image->scalar);

	for (int i = 0; i < 3; i++) {
		if (image->offset[i] + image->part[i] > image->size[i])
			return false;
		n *= image->part[i];
	}
	return n && n == image->n;
}

ssize_t incise_igtl_pack_image(void *bytes, size_t capacity,
			       const struct incise_igtl_label *label,
			       const struct incise_igtl_image *image)
{
	uint8_t *to;
	ssize_t size;

	if (!image_fits(image))
		return -EINVAL;
	size = frame(bytes, capacity, label, "IMAGE", IMAGE_HEAD + image->n, &to);
	if (size < 0)
		return size;
	to = put16(to, 1);
	*to++ = image->components;
	*to++ = image->scalar;
	*to++ = image->little ? IMAGE_LITTLE : IMAGE_BIG;
	*to++ = image->ras ? IMAGE_RAS : IMAGE_LPS;
	for (int i = 0; i < 3; i++)
		to = put16(to, image->size[i]);
	for (int i = 0; i < 12; i++)
		to = put_float(to,
			       i < 9 ? image->axis[i / 3][i % 3] : image->centre[i - 9]);
	for (int i = 0; i < 3; i++)
		to = put16(to, image->offset[i]);
	for (int i = 0; i < 3; i++)
		to = put16(to, image->part[i]);
	put(to, image->pixel, image->n);
	return finish(bytes, size);
}

/* --- parsing ------------------------------------------------------------------------- */

/* The header; returns the size of the body. -EPROTO: it is none. */
static int parse_header(const uint8_t *header, struct incise_igtl_message *message,
			uint64_t *body)
{
	memset(message, 0, sizeof(*message));
	message->version = get16(header);
	if (message->version < 1 || message->version > 2)
		return -EPROTO;
	get_name(message->type, header + 2, INCISE_IGTL_TYPE);
	if (!*message->type || strchr(message->type, '?'))
		return -EPROTO;
	get_name(message->name, header + 14, INCISE_IGTL_NAME);
	message->utc_ns = incise_igtl_time_ns(get64(header + 34));
	*body = get64(header + 42);
	return 0;
}

/* Sizes of keys and values fill the metadata exactly. */
static bool metadata_fits(const struct incise_igtl_message *message)
{
	size_t table_n = 2 + (size_t)message->n_metadata * 8;
	uint64_t sum = 0;

	for (int i = 0; i < message->n_metadata; i++)
		sum += get16(message->metadata + 2 + 8 * i) +
		       (uint64_t)get32(message->metadata + 6 + 8 * i);
	return sum == (uint64_t)(message->metadata_end - message->metadata) - table_n;
}

/* Content and metadata of a body whose CRC is right. */
static int parse_body(const uint8_t *body, size_t n, struct incise_igtl_message *message)
{
	size_t extended, table_n, pairs_n;

	message->content = body;
	message->n = n;
	if (message->version == 1)
		return 0;
	if (n < INCISE_IGTL_EXTENDED)
		return -EPROTO;
	/* A longer one may come: its end is skipped. */
	extended = get16(body);
	table_n = get16(body + 2);
	pairs_n = get32(body + 4);
	if (extended < INCISE_IGTL_EXTENDED || extended > n || n - extended < table_n ||
	    n - extended - table_n < pairs_n)
		return -EPROTO;
	message->id = get32(body + 8);
	message->content = body + extended;
	message->n = n - extended - table_n - pairs_n;
	message->metadata = message->content + message->n;
	message->metadata_end = body + n;
	if (!table_n)
		return pairs_n ? -EPROTO : 0;
	if (table_n < 2)
		return -EPROTO;
	message->n_metadata = get16(message->metadata);
	if (table_n != 2 + (size_t)message->n_metadata * 8)
		return -EPROTO;
	return metadata_fits(message) ? 0 : -EPROTO;
}

/* Header and body are there. */
static int parse_whole(const uint8_t *header, size_t body_n,
		       struct incise_igtl_message *message)
{
	const uint8_t *body = header + INCISE_IGTL_HEADER;

	if (get64(header + 50) != incise_igtl_crc64(0, body, body_n))
		return -EBADMSG;
	return parse_body(body, body_n, message);
}

ssize_t incise_igtl_parse(const void *bytes, size_t n,
			  struct incise_igtl_message *message)
{
	uint64_t body;
	int status;

	if (n < INCISE_IGTL_HEADER)
		return -EAGAIN;
	status = parse_header(bytes, message, &body);
	if (status)
		return status;
	if (body > n - INCISE_IGTL_HEADER)
		return -EAGAIN;
	status = parse_whole(bytes, body, message);
	return status ? status : (ssize_t)(INCISE_IGTL_HEADER + body);
}

int incise_igtl_metadata(const struct incise_igtl_message *message, int i,
			 struct incise_igtl_pair *pair)
{
	const uint8_t *row, *at;

	if (i < 0 || i >= message->n_metadata)
		return -ENOENT;
	row = message->metadata + 2;
	at = row + (size_t)message->n_metadata * 8;
	for (int k = 0; k < i; k++, row += 8)
		at += get16(row) + (size_t)get32(row + 4);
	pair->key = (const char *)at;
	pair->key_n = get16(row);
	pair->encoding = get16(row + 2);
	pair->value = pair->key + pair->key_n;
	pair->value_n = get32(row + 4);
	return 0;
}

static bool is(const struct incise_igtl_message *message, const char *type)
{
	return !strcmp(message->type, type);
}

static int get_matrix(const uint8_t *from, double matrix[3][4])
{
	for (int column = 0; column < 4; column++)
		for (int row = 0; row < 3; row++, from += 4) {
			matrix[row][column] = get_float(from);
			if (!isfinite(matrix[row][column]))
				return -EDOM;
		}
	return 0;
}

int incise_igtl_transform(const struct incise_igtl_message *message, double matrix[3][4])
{
	if (!is(message, "TRANSFORM") || message->n != MATRIX_SIZE)
		return -EPROTO;
	return get_matrix(message->content, matrix);
}

/* The rotation of a quaternion (x, y, z, w) of any length but 0. */
static int rotate(const double q[4], double matrix[3][4])
{
	double norm = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];

	/* Squares of floats are in the range of double. */
	if (!isfinite(norm) || !(norm > 0))
		return -EDOM;
	for (int i = 0; i < 3; i++) {
		int j = (i + 1) % 3, k = (i + 2) % 3;

		matrix[i][i] = 1 - 2 * (q[j] * q[j] + q[k] * q[k]) / norm;
		matrix[i][j] = 2 * (q[i] * q[j] - q[k] * q[3]) / norm;
		matrix[i][k] = 2 * (q[i] * q[k] + q[j] * q[3]) / norm;
	}
	return 0;
}

int incise_igtl_position(const struct incise_igtl_message *message, double matrix[3][4])
{
	double q[4] = {0, 0, 0, 1};

	if (!is(message, "POSITION") ||
	    (message->n != 12 && message->n != 24 && message->n != 28))
		return -EPROTO;
	for (int i = 0; i < 3; i++) {
		matrix[i][3] = get_float(message->content + 4 * i);
		if (!isfinite(matrix[i][3]))
			return -EDOM;
	}
	for (int i = 0; i < (int)message->n / 4 - 3; i++)
		q[i] = get_float(message->content + 12 + 4 * i);
	/* Of a quaternion with three numbers, w is what makes it a unit. */
	if (message->n == 24)
		q[3] = sqrt(fmax(0, 1 - q[0] * q[0] - q[1] * q[1] - q[2] * q[2]));
	return rotate(q, matrix);
}

#define TDATA_SIZE 70

int incise_igtl_tdata(const struct incise_igtl_message *message, int i, char name[21],
		      double matrix[3][4])
{
	const uint8_t *element;

	if (!is(message, "TDATA") || message->n % TDATA_SIZE)
		return -EPROTO;
	if (i < 0 || (size_t)i >= message->n / TDATA_SIZE)
		return -ENOENT;
	element = message->content + (size_t)i * TDATA_SIZE;
	get_name(name, element, INCISE_IGTL_NAME);
	return get_matrix(element + INCISE_IGTL_NAME + 2, matrix);
}

int incise_igtl_string(const struct incise_igtl_message *message, const char **text,
		       size_t *n, uint16_t *encoding)
{
	if (!is(message, "STRING") || message->n < STRING_HEAD ||
	    message->n - STRING_HEAD != get16(message->content + 2))
		return -EPROTO;
	*text = (const char *)message->content + STRING_HEAD;
	*n = message->n - STRING_HEAD;
	*encoding = get16(message->content);
	return 0;
}

int incise_igtl_status(const struct incise_igtl_message *message,
		       struct incise_igtl_status *status)
{
	const uint8_t *at = message->content;

	if (!is(message, "STATUS") || message->n < STATUS_HEAD)
		return -EPROTO;
	status->code = get16(at);
	status->sub_code = (int64_t)get64(at + 2);
	get_name(status->error, at + 10, STATUS_ERROR);
	status->text = (const char *)at + STATUS_HEAD;
	/* The end may be there or not. */
	status->n = strnlen(status->text, message->n - STATUS_HEAD);
	return 0;
}

int incise_igtl_image(const struct incise_igtl_message *message,
		      struct incise_igtl_image *image)
{
	const uint8_t *at = message->content;

	if (!is(message, "IMAGE") || message->n < IMAGE_HEAD || get16(at) != 1 ||
	    !at[4] || at[4] > IMAGE_LITTLE || !at[5] || at[5] > IMAGE_LPS)
		return -EPROTO;
	image->components = at[2];
	image->scalar = at[3];
	image->little = at[4] == IMAGE_LITTLE;
	image->ras = at[5] == IMAGE_RAS;
	for (int i = 0; i < 3; i++) {
		image->size[i] = get16(at + 6 + 2 * i);
		image->offset[i] = get16(at + 60 + 2 * i);
		image->part[i] = get16(at + 66 + 2 * i);
	}
	for (int i = 0; i < 12; i++) {
		double value = get_float(at + 12 + 4 * i);

		if (!isfinite(value))
			return -EDOM;
		if (i < 9)
			image->axis[i / 3][i % 3] = value;
		else
			image->centre[i - 9] = value;
	}
	image->pixel = at + IMAGE_HEAD;
	image->n = message->n - IMAGE_HEAD;
	return image_fits(image) ? 0 : -EPROTO;
}

/* --- streams ------------------------------------------------------------------------- */

struct incise_igtl_stream {
	size_t body_max;
	uint8_t *bytes; /* of the message that arrives */
	size_t n, capacity;
	uint64_t skip; /* bytes of a body to pass over */
	bool lost;
};

#define FIRST_CAPACITY 1024

struct incise_igtl_stream *incise_igtl_stream_new(size_t body_max)
{
	struct incise_igtl_stream *stream = calloc(1, sizeof(*stream));

	if (!stream)
		return NULL;
	stream->body_max = body_max < SIZE_MAX / 4 ? body_max : SIZE_MAX / 4;
	stream->bytes = malloc(FIRST_CAPACITY);
	stream->capacity = FIRST_CAPACITY;
	if (!stream->bytes) {
		free(stream);
		errno = ENOMEM;
		return NULL;
	}
	return stream;
}

/* Take bytes until there are @want of the message. 1: they are there; 0: not yet; -ENOMEM. */
static int collect(struct incise_igtl_stream *stream, size_t want, const uint8_t **bytes,
		   size_t *n)
{
	size_t take = want - stream->n < *n ? want - stream->n : *n;

	if (stream->n + take > stream->capacity) {
		size_t capacity = 2 * stream->capacity;
		uint8_t *more;

		/* Twice what is there, whatever is announced. */
		while (capacity < stream->n + take)
			capacity *= 2;
		more = realloc(stream->bytes, capacity);
		if (!more)
			return -ENOMEM;
		stream->bytes = more;
		stream->capacity = capacity;
	}
	put(stream->bytes + stream->n, *bytes, take);
	stream->n += take;
	*bytes += take;
	*n -= take;
	return stream->n == want;
}

/* Pass over what is left of a body of @body bytes. */
static void pass_over(struct incise_igtl_stream *stream, uint64_t body)
{
	stream->skip = body - (stream->n - INCISE_IGTL_HEADER);
	stream->n = 0;
}

int incise_igtl_stream_next(struct incise_igtl_stream *stream, const uint8_t **bytes,
			    size_t *n, struct incise_igtl_message *message)
{
	uint64_t body;
	size_t skip;
	int status;

	if (stream->lost)
		return -EPROTO;
	skip = stream->skip < *n ? (size_t)stream->skip : *n;
	stream->skip -= skip;
	*bytes += skip;
	*n -= skip;
	if (stream->skip)
		return 0;
	if (stream->n < INCISE_IGTL_HEADER) {
		status = collect(stream, INCISE_IGTL_HEADER, bytes, n);
		if (status <= 0)
			return status;
	}
	status = parse_header(stream->bytes, message, &body);
	if (status) {
		stream->lost = true;
		return status;
	}
	status = -EMSGSIZE;
	if (body <= stream->body_max)
		status = collect(stream, INCISE_IGTL_HEADER + (size_t)body, bytes, n);
	if (!status)
		return 0;
	if (status < 0) {
		pass_over(stream, body);
		return status;
	}
	stream->n = 0;
	status = parse_whole(stream->bytes, (size_t)body, message);
	if (status == -EPROTO)
		stream->lost = true;
	return status ? status : 1;
}

bool incise_igtl_stream_inside(const struct incise_igtl_stream *stream)
{
	return stream->n || stream->skip;
}

void incise_igtl_stream_free(struct incise_igtl_stream *stream)
{
	if (!stream)
		return;
	free(stream->bytes);
	free(stream);
}
