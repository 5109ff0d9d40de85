/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * An A/D converter of Linux IIO with its buffer: device and channel, trigger, rate, clock
 * of its timestamps, the meaning of its codes. The buffer is read from the kernel itself:
 * libiio's own buffers return whole blocks only, lose samples ahead of an error, and
 * print to stderr.
 *
 *   a scan:  [ u12 in 16 ][ filling ][ s64 timestamp ]    each element on a multiple of its
 *            0            2          8                16  size, in the order of their index
 *
 *   "le:s12/16>>4" in it is 12 signed bits of 16, the lower 4 unused, the lower byte first;
 *   "be:u16/32X2>>0" has two of them.
 *
 *     bit 15              4 3      0
 *        [ s b b … b b b b ][ unused ]      code = (bits as a number) + 2^11
 */
#ifndef INCISE_IIO_SOURCE_H
#define INCISE_IIO_SOURCE_H

#include <iio.h>
#include <incise/backend.h>

#define IIO_SOURCE_TRIGGERS "/sys/kernel/config/iio/triggers/hrtimer"
#define IIO_SOURCE_BYTES 8192 /* of one read */

struct iio_format {
	unsigned int bytes; /* of storage */
	unsigned int bits, shift;
	bool is_signed, is_be;
};

struct iio_source {
	int fd;		   /* of the device's file; -1 before */
	const char *where; /* starts each message; only during the set-up */
	struct incise_force_setup setup;
	struct iio_context *context;
	struct iio_device *device;
	struct iio_channel *voltage, *timestamp;
	struct iio_format format, timestamp_format;
	double rate_hz, full_scale_V, offset_V;
	bool has_scale; /* of the driver */
	const char
		*trigger_folder; /* where our own trigger is made: IIO_SOURCE_TRIGGERS */
	bool trigger_refused;	 /* for lack of permission */
	char trigger[64];	 /* our own; empty: not made */
	char trigger_used[64];
	char trigger_before[64]; /* restored on close */
	bool trigger_set;
	char folder[160]; /* of the device in sysfs; empty: the buffer does not run */
	size_t step;	  /* bytes of a scan */
	size_t voltage_at, timestamp_at;
	_Alignas(8) unsigned char bytes[IIO_SOURCE_BYTES];
};

/*
 * Set up all but the buffer. 0 or -errno with the message in @err; iio_source_close() is
 * due in either case. @name: of the device, its label, or iio:deviceN.
 */
int iio_source_open(struct iio_source *source, const char *name,
		    struct incise_error *err);

/* Restores the trigger; rate and clock stay. */
void iio_source_close(struct iio_source *source);

/*
 * Start the buffer: the kernel wakes readers of @source->fd every @block scans, and
 * buffers
 * @capacity. @folder: "/sys/bus/iio/devices/iio:device0". 0 or -errno.
 */
int iio_source_start(struct iio_source *source, const char *folder, unsigned int block,
		     unsigned int capacity);
/* The device may be gone. */
void iio_source_stop(struct iio_source *source);

/* Whether the scale is another one than at the set-up, so that codes have another meaning. Reads it. */
bool iio_source_changed(const struct iio_source *source);

/* Number of scans read, or -errno: -EAGAIN (no scan), -ENODEV. */
int iio_source_read(struct iio_source *source);
/* The code and the timestamp of scan @i that was read. */
int32_t iio_source_code(const struct iio_source *source, int i);
int64_t iio_source_timestamp(const struct iio_source *source, int i);

/* 0; -EINVAL: an impossible format, one of more than @bits_max bits, or a vector. */
int iio_format_of(struct iio_format *format, const struct iio_data_format *data,
		  unsigned int bits_max);

/* Whether it is a voltage that a buffer can have. */
bool iio_source_can_sample(const struct iio_channel *channel);
/* "voltage0-voltage1, voltage0": all of these, as force_setup.channel names them. */
void iio_source_list_channels(const struct iio_device *device, char *text, size_t size);

/* The range of its codes; false: the driver does not say. */
bool iio_source_volts(const struct iio_channel *channel, const struct iio_format *format,
		      double *full_scale_V, double *offset_V);

#endif
