/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * An hrtimer trigger of our own, made through configfs for as long as a channel is open, on
 * kernels that have iio-trig-hrtimer loaded.
 */
#ifndef INCISE_IIO_TRIGGER_H
#define INCISE_IIO_TRIGGER_H

#include <stddef.h>

#define IIO_TRIGGER_FOLDER "/sys/kernel/config/iio/triggers/hrtimer"

/*
 * Makes "incise-PID-N" in @folder and leaves its name. 0; -ENOENT (the kernel has none),
 * -EACCES, -ENOSPC …
 */
int iio_trigger_make(const char *folder, char *name, size_t size);

/* Removes one of ours; @name may be empty. */
void iio_trigger_remove(const char *folder, const char *name);

/* Removes those of processes that have died. */
void iio_trigger_sweep(const char *folder);

#endif
