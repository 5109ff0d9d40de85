// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * How IIO lays a channel into a scan; see iio_format.h.
 */
#include <errno.h>
#include "iio_format.h"

int iio_format_of(struct iio_format *format, const struct iio_data_format *data,
		  unsigned int bits_max)
{
	unsigned int length = data->length;

	if ((length != 8 && length != 16 && length != 32 && length != 64) ||
	    !data->bits || data->bits > bits_max || data->bits > length ||
	    data->shift > length - data->bits || data->repeat > 1)
		return -EINVAL;
	*format = (struct iio_format){
		.bytes = length / 8,
		.bits = data->bits,
		.shift = data->shift,
		.is_signed = data->is_signed,
		.is_be = data->is_be,
	};
	return 0;
}

uint64_t iio_format_raw(const struct iio_format *format, const void *at)
{
	const unsigned char *byte = at;
	uint64_t value = 0;

	for (unsigned int i = 0; i < format->bytes; i++)
		value = value << 8 | byte[format->is_be ? i : format->bytes - 1 - i];
	value >>= format->shift;
	return format->bits < 64 ? value & ((UINT64_C(1) << format->bits) - 1) : value;
}

int32_t iio_format_code(const struct iio_format *format, const void *at)
{
	uint64_t value = iio_format_raw(format, at);

	/* Two's complement with its top bit turned is the number + 2^(bits-1). */
	if (format->is_signed)
		value ^= UINT64_C(1) << (format->bits - 1);
	return (int32_t)value;
}
