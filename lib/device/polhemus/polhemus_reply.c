// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What a tracker answers to a command; see polhemus_reply.h.
 */
#include <string.h>
#include "../../base/hex.h"
#include "polhemus_model.h"
#include "polhemus_reply.h"

enum { FLAG_BINARY = 1, FLAG_CM = 2, FLAG_COMPENSATED = 4, FLAG_CONTINUOUS = 8 };

static bool is_digit(char c)
{
	return c >= '0' && c <= '9';
}

/* @n characters, blanks at both ends left out, what cannot be printed replaced. */
static void copy_text(char *to, const unsigned char *from, size_t n)
{
	while (n && (*from == ' ' || !*from)) {
		from++;
		n--;
	}
	while (n && (from[n - 1] == ' ' || !from[n - 1]))
		n--;
	for (size_t i = 0; i < n; i++)
		to[i] = from[i] >= ' ' && from[i] <= '~' ? (char)from[i] : '?';
	to[n] = '\0';
}

bool polhemus_status_read(const unsigned char *bytes, size_t n,
			  struct polhemus_status *status)
{
	unsigned int flags = 0;
	double error = 0;
	char digits[4] = {0};

	*status = (struct polhemus_status){0};
	if (n != POLHEMUS_STATUS_LENGTH || bytes[0] != '2' || bytes[1] < '1' ||
	    bytes[1] > '4' || bytes[2] != 'S' || bytes[53] != '\r' || bytes[54] != '\n')
		return false;
	for (int i = 3; i < 6; i++) {
		if (incise_hex_digit(bytes[i]) < 0)
			return false;
		flags = flags * 16 + (unsigned int)incise_hex_digit(bytes[i]);
	}
	memcpy(digits, bytes + 6, 3);
	if (polhemus_reply_numbers(digits, &error, 1) < 0)
		return false;
	status->station = bytes[1] - '0';
	status->binary = flags & FLAG_BINARY;
	status->centimetres = flags & FLAG_CM;
	status->compensated = flags & FLAG_COMPENSATED;
	status->continuous = flags & FLAG_CONTINUOUS;
	status->test_error = (int)error;
	status->sensors = incise_hex_digit(bytes[12]);
	copy_text(status->version, bytes + 15, 6);
	copy_text(status->id, bytes + 21, 32);
	return true;
}

/* Up to 9 digits before the point and as many behind it count; what else is there is cut. */
int polhemus_reply_numbers(const char *text, double *values, int most)
{
	int n = 0;

	for (;;) {
		bool negative = false;
		double value = 0, scale = 1;
		int digits = 0;

		while (*text == ' ')
			text++;
		if (!*text)
			return n;
		if (*text == '-' || *text == '+')
			negative = *text++ == '-';
		for (; is_digit(*text) && digits < 9; text++, digits++)
			value = value * 10 + (*text - '0');
		if (*text == '.')
			for (text++; is_digit(*text); text++) {
				if (digits++ > 15)
					continue;
				scale /= 10;
				value += (*text - '0') * scale;
			}
		if (!digits || n == most)
			return -1;
		values[n++] = negative ? -value : value;
		if (*text && *text != ' ' && *text != '-' && *text != '+' && *text != ',')
			return -1;
		if (*text == ',')
			text++;
	}
}

int polhemus_reply_fields(const char *text, int width, int *values, int most)
{
	size_t length = strlen(text);
	int n = 0;

	if (length % (size_t)width)
		return -1;
	for (; *text; text += width) {
		double value = 0;
		char field[16] = {0};

		memcpy(field, text, (size_t)width);
		if (n == most || polhemus_reply_numbers(field, &value, 1) != 1)
			return -1;
		values[n++] = (int)value;
	}
	return n;
}

int polhemus_frame_read(const unsigned char *b, size_t n, struct polhemus_frame *frame)
{
	size_t length;
	int family;

	if (n && b[0] != 'L' && b[0] != 'P')
		return -1;
	if (n > 1 && !(b[0] == 'L' && b[1] == 'Y') && !(b[0] == 'P' && b[1] == 'A'))
		return -1;
	if (n < 8)
		return 0;
	family = b[0] == 'L' ? POLHEMUS_LIBERTY : POLHEMUS_PATRIOT;
	length = b[6] | (size_t)b[7] << 8;
	if (length + 8 > POLHEMUS_FRAME_MAX)
		return -1;
	if (n < length + 8)
		return 0;
	*frame = (struct polhemus_frame){
		.family = family,
		.station = b[2],
		.command = b[3],
		.error = b[4],
		.payload = b + 8,
		.n = length,
		.length = length + 8,
	};
	return 1;
}
