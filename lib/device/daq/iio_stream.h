/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The buffer of an IIO device with one voltage and its time stamp in it. Read from the
 * kernel itself: libiio's own buffers hand over whole blocks only, lose what came of one
 * before an error, and print to stderr.
 *
 *   a scan:  [ u12 in 16 ][ filling ][ s64 time stamp ]   each element on a multiple of its
 *            0            2          8                16  size, in the order of their index
 */
#ifndef INCISE_IIO_STREAM_H
#define INCISE_IIO_STREAM_H

#include "iio_source.h"

#define IIO_STREAM_BYTES 8192 /* read at once */

struct iio_stream {
	int fd;		  /* of the device's file; the caller's */
	char folder[160]; /* of the device in sysfs; empty: it does not run */
	size_t step;	  /* bytes of a scan */
	size_t voltage_at, stamp_at;
	struct iio_format voltage, stamp;
	_Alignas(8) unsigned char bytes[IIO_STREAM_BYTES];
};

/*
 * Start it: the kernel wakes who waits for @stream->fd with each @block scans, and has room
 * for @room. @folder: "/sys/bus/iio/devices/iio:device0". 0 or -errno.
 */
int iio_stream_start(struct iio_stream *stream, const struct iio_source *source,
		     const char *folder, unsigned int block, unsigned int room);
/* As it was before; endures a device that is gone. */
void iio_stream_stop(struct iio_stream *stream);

/* Scans that have come: how many, or -errno: -EAGAIN (none), -ENODEV. */
int iio_stream_read(struct iio_stream *stream);
/* Of those: the code and the time stamp of number @i. */
int32_t iio_stream_code(const struct iio_stream *stream, int i);
int64_t iio_stream_stamp(const struct iio_stream *stream, int i);

#endif
