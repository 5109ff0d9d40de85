/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * How IIO lays a channel into a scan: "le:s12/16>>4" is 12 signed bits of 16, the lower 4
 * unused, the lower byte first; "be:u16/32X2>>0" has two of them.
 *
 *     bit 15              4 3      0
 *        [ s b b … b b b b ][ unused ]      code = (bits as a number) + 2^11
 */
#ifndef INCISE_IIO_FORMAT_H
#define INCISE_IIO_FORMAT_H

#include <iio.h>

struct iio_format {
	unsigned int bytes; /* of storage */
	unsigned int bits, shift;
	bool is_signed, is_be;
};

/*
 * 0; -EINVAL: a format that cannot be, or with more than @bits_max bits, or a vector. It came
 * from the driver.
 */
int iio_format_of(struct iio_format *format, const struct iio_data_format *data,
		  unsigned int bits_max);

/* The bits at @at, shifted down; without regard to sign. */
uint64_t iio_format_raw(const struct iio_format *format, const void *at);

/* The same as a code: 0 … 2^bits - 1, growing with the voltage. For bits up to 31. */
int32_t iio_format_code(const struct iio_format *format, const void *at);

#endif
