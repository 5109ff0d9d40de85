/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A force channel on a DAQ card under comedi: a command that streams into the kernel's
 * buffer until that overflows, and is then started again.
 *
 *   card ─▶ its store ─▶ kernel's buffer (2 s where it may) ─▶ thread, by blocks ─▶ feed
 *
 * There are no time stamps: t_ns is worked out from the arrival of blocks, see
 * comedi_stamps.h. What is lost in an overflow is known by that time only, to a few samples;
 * that there was one is known for certain.
 */
#ifndef INCISE_COMEDI_FORCE_H
#define INCISE_COMEDI_FORCE_H

#include <incise/backend.h>

/* As struct incise_backend.open and .scan. */
void *comedi_force_open(const struct incise_backend_request *request,
			struct incise_error *err);
int comedi_force_scan(const char *arguments, incise_scan_found *found, void *context,
		      struct incise_error *err);

#endif
