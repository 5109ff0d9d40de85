/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Samples that are missing, found by the kernel's time stamps: IIO drops what its buffer has
 * no room for and says nothing.
 *
 *   stamps   |    |    |                   |    |       gap of 4 T: 3 lost
 *   stamps   |    |    |        | |    |    |    |      one interrupt late by 0.9 T: none
 *
 * A stamp later than 1.5 T is held until the one behind it has come: a sample is not later
 * than its successor less T. The period T is the nominal one until the stamps have drifted
 * from it by half a period; then it is the average so far.
 */
#ifndef INCISE_IIO_SPACING_H
#define INCISE_IIO_SPACING_H

#include "daq_feed.h"

struct iio_spacing {
	struct daq_feed *feed;
	int64_t period_ns; /* nominal */
	bool begun, holds;
	int64_t first_ns, last_ns; /* stamps, without lateness */
	uint64_t n;		   /* periods between these two */
	int64_t held_ns;	   /* the sample that is held */
	int32_t held_code;
};

/* @rate_hz > 0. */
void iio_spacing_init(struct iio_spacing *spacing, struct daq_feed *feed, double rate_hz);

/* A sample, on to the feed, with what is missing before it. Any stamp is endured. */
void iio_spacing_put(struct iio_spacing *spacing, int64_t t_ns, int32_t code);

/* No more will come soon: what is held goes on. */
void iio_spacing_flush(struct iio_spacing *spacing);

#endif
