// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Records in the bytes that a Polhemus tracker sends; see polhemus_records.h.
 */
#include <math.h>
#include <string.h>
#include "polhemus_records.h"

#define HEADER 3       /* bytes, FASTRAK */
#define FRAME_HEADER 8 /* LIBERTY, PATRIOT */
#define FRAME_PAYLOAD (7 * 4 + 4 + 4)
#define ASCII_WIDTH 7 /* characters of a number */

size_t polhemus_layout_length(const struct polhemus_layout *layout)
{
	if (layout->family != POLHEMUS_FASTRAK)
		return layout->ascii ? 0 : FRAME_HEADER + FRAME_PAYLOAD;
	if (layout->switch_bytes != 1 && layout->switch_bytes != 2 &&
	    (layout->switch_bytes != 4 || layout->ascii))
		return 0;
	return HEADER + 7 * (layout->ascii ? ASCII_WIDTH : 4) + layout->switch_bytes + 2;
}

static bool station_is_on(const struct polhemus_layout *layout, int station)
{
	return station >= 1 && station <= 8 && layout->stations >> (station - 1) & 1;
}

static bool is_printable(unsigned char c)
{
	return c >= ' ' && c <= '~';
}

/* Whether a record may begin here, as far as its first @n bytes show. */
static bool begins(const struct polhemus_layout *layout, const unsigned char *b, size_t n)
{
	if (layout->family == POLHEMUS_FASTRAK)
		return b[0] == '0' && (n < 2 || station_is_on(layout, b[1] - '0')) &&
		       (n < 3 || is_printable(b[2]));
	return b[0] == (layout->family == POLHEMUS_LIBERTY ? 'L' : 'P') &&
	       (n < 2 || b[1] == (layout->family == POLHEMUS_LIBERTY ? 'Y' : 'A')) &&
	       (n < 3 || station_is_on(layout, b[2])) &&
	       (n < 4 || b[3] == 'C' || b[3] == 'P') &&
	       (n < 8 || (b[6] == FRAME_PAYLOAD && !b[7]));
}

uint32_t polhemus_word(const unsigned char *b)
{
	return b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
}

double polhemus_real(const unsigned char *b)
{
	uint32_t bits = polhemus_word(b);
	float value;

	memcpy(&value, &bits, sizeof(value));
	return (double)value;
}

/* A number in just ASCII_WIDTH characters, such as "-012.34", whatever the locale. */
static bool take_polhemus_number(const unsigned char *b, double *value)
{
	double sum = 0, scale = 0;
	int digits = 0;

	for (int i = 0; i < ASCII_WIDTH; i++) {
		if (b[i] >= '0' && b[i] <= '9') {
			sum = sum * 10 + (b[i] - '0');
			scale *= 10;
			digits++;
		} else if (b[i] == '.' && scale == 0) {
			scale = 1;
		} else if (digits || scale != 0 ||
			   (b[i] != ' ' && b[i] != '-' && b[i] != '+') ||
			   (i && b[i - 1] != ' ')) {
			return false;
		}
	}
	*value = (memchr(b, '-', ASCII_WIDTH) ? -sum : sum) / (scale != 0 ? scale : 1);
	return digits;
}

/* A switch is 0 or 1, as a character or as a number. */
static bool read_switch(const unsigned char *b, size_t n, bool *pressed)
{
	uint32_t value = n == 4 ? polhemus_word(b) : b[n - 1];

	if (n == 2 && b[0] != ' ' && b[0] != '0' && b[0])
		return false;
	if (n < 4 && (value == '0' || value == '1'))
		value -= '0';
	if (n == 4 && value == 0x3f800000) /* 1.0f */
		value = 1;
	*pressed = value == 1;
	return value <= 1;
}

static bool is_sane(struct polhemus_record *record)
{
	double *q = record->quaternion, length;

	for (int i = 0; i < 3; i++)
		if (!(fabs(record->position_mm[i]) <= POLHEMUS_ROOM_MM))
			return false;
	length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
	if (!(fabs(length - 1) <= POLHEMUS_UNIT))
		return false;
	for (int i = 0; i < 4; i++)
		q[i] /= length;
	return true;
}

static bool read_fastrak(const struct polhemus_layout *layout, const unsigned char *b,
			 double values[7], struct polhemus_record *record)
{
	const unsigned char *at = b + HEADER;

	record->station = (uint8_t)(b[1] - '0');
	record->status = (char)b[2];
	for (int i = 0; i < 7; i++) {
		if (!layout->ascii)
			values[i] = polhemus_real(at);
		else if (!take_polhemus_number(at, &values[i]))
			return false;
		at += layout->ascii ? ASCII_WIDTH : 4;
	}
	return read_switch(at, layout->switch_bytes, &record->button) &&
	       at[layout->switch_bytes] == '\r' && at[layout->switch_bytes + 1] == '\n';
}

static bool read_frame(const unsigned char *b, double values[7],
		       struct polhemus_record *record)
{
	const unsigned char *at = b + FRAME_HEADER;

	record->station = b[2];
	record->status = b[4] ? (char)(is_printable(b[4]) ? b[4] : '?') : ' ';
	for (int i = 0; i < 7; i++)
		values[i] = polhemus_real(at + (size_t)i * 4);
	record->frame = polhemus_word(at + (size_t)7 * 4);
	return read_switch(at + (size_t)8 * 4, 4, &record->button);
}

bool polhemus_record_read(const struct polhemus_layout *layout,
			  const unsigned char *bytes, struct polhemus_record *record)
{
	double values[7];

	*record = (struct polhemus_record){0};
	if (!begins(layout, bytes, polhemus_layout_length(layout)))
		return false;
	if (layout->family == POLHEMUS_FASTRAK
		    ? !read_fastrak(layout, bytes, values, record)
		    : !read_frame(bytes, values, record))
		return false;
	for (int i = 0; i < 3; i++)
		record->position_mm[i] = values[i] * 10; /* cm */
	memcpy(record->quaternion, values + 3, sizeof(record->quaternion));
	return is_sane(record);
}

void polhemus_records_init(struct polhemus_records *records,
			   const struct polhemus_layout *layout)
{
	records->layout = *layout;
	records->n = records->skipped = 0;
}

size_t polhemus_records_put(struct polhemus_records *records, const unsigned char *bytes,
			    size_t n, int64_t t_ns)
{
	size_t capacity = sizeof(records->bytes) - records->n;

	if (n > capacity)
		n = capacity;
	memcpy(records->bytes + records->n, bytes, n);
	for (size_t i = 0; i < n; i++)
		records->t_ns[records->n + i] = t_ns;
	records->n += (unsigned int)n;
	return n;
}

static void drop(struct polhemus_records *records, unsigned int n)
{
	records->n -= n;
	memmove(records->bytes, records->bytes + n, records->n);
	memmove(records->t_ns, records->t_ns + n, records->n * sizeof(*records->t_ns));
}

bool polhemus_records_next(struct polhemus_records *records,
			   struct polhemus_record *record)
{
	unsigned int length = (unsigned int)polhemus_layout_length(&records->layout);
	unsigned int at = 0;
	bool found = false;

	for (; length && at < records->n; at++) {
		unsigned int left = records->n - at;

		if (!begins(&records->layout, records->bytes + at, left))
			continue;
		if (left < length)
			break;
		found = polhemus_record_read(&records->layout, records->bytes + at,
					     record);
		if (found)
			break;
	}
	/* Years of noise must not overflow to 0. */
	records->skipped = records->skipped + at < records->skipped
				   ? UINT32_MAX
				   : records->skipped + at;
	if (found) {
		record->t_ns = records->t_ns[at + length - 1];
		record->skipped = records->skipped;
		records->skipped = 0;
		at += length;
	}
	drop(records, at);
	return found;
}
