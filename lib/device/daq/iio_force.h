/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A force channel on an A/D converter of Linux IIO: samples with the kernel's time stamps.
 *
 *   trigger ─▶ converter ─▶ kernel's buffer (half a second) ─▶ thread, every 5 ms ─▶ feed
 */
#ifndef INCISE_IIO_FORCE_H
#define INCISE_IIO_FORCE_H

#include <incise/backend.h>

/* As struct incise_backend.open and .scan. */
void *iio_force_open(const struct incise_backend_request *request,
		     struct incise_error *err);
int iio_force_scan(const char *arguments, incise_scan_found *found, void *context,
		   struct incise_error *err);

#endif
