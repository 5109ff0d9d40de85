/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The rate of an IIO converter: set where it is made, at the trigger or in the converter,
 * and read back.
 */
#ifndef INCISE_IIO_RATE_H
#define INCISE_IIO_RATE_H

#include "iio_source.h"

/* @trigger: the one that is used, or NULL. Sets source->rate_hz. 0 or -errno. */
int iio_rate_set(struct iio_source *source, const struct iio_device *trigger,
		 struct incise_error *err);

#endif
