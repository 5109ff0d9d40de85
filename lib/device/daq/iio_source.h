/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * An A/D converter of Linux IIO, set up for sampling: which device and channel, what starts
 * a conversion, at what rate, on which clock, and what its codes stand for.
 */
#ifndef INCISE_IIO_SOURCE_H
#define INCISE_IIO_SOURCE_H

#include <iio.h>
#include <incise/backend.h>
#include "iio_format.h"

struct iio_source {
	int fd;		   /* of the device's file; -1 before */
	const char *where; /* begins each line; while it is set up */
	struct incise_force_setup setup;
	struct iio_context *context;
	struct iio_device *device;
	struct iio_channel *voltage, *stamp;
	struct iio_format format, stamp_format;
	double rate_hz, full_scale_V, offset_V;
	const char *trigger_folder; /* where ours is made */
	bool trigger_refused;	    /* for want of the right to */
	char trigger[64];	    /* its name; empty: none was made */
	char trigger_used[64];
	char trigger_before[64]; /* what was set before */
	bool trigger_set;
};

/*
 * Everything but the buffer. 0 or -errno with the line in @err; iio_source_close() is due in
 * either case. @name: of the device, its label, or iio:deviceN.
 */
int iio_source_open(struct iio_source *source, const char *name,
		    struct incise_error *err);

/* The trigger is as it was before; rate and clock stay. */
void iio_source_close(struct iio_source *source);

/* "voltage0" of a device; also "voltage0-voltage1", which is channel 0 of a differential one.
 * NULL: none that a buffer can have. */
struct iio_channel *iio_source_voltage(const struct iio_device *device, int channel);

/* What its codes stand for; false: the driver does not say. */
bool iio_source_volts(const struct iio_channel *channel, const struct iio_format *format,
		      double *full_scale_V, double *offset_V);

#endif
