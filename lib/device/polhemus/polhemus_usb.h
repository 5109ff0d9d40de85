/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The way to a tracker over USB, with libusb.
 *
 *   bulk OUT           commands
 *   bulk IN            replies
 *   interrupt IN       records of a stream (FASTRAK; the others have all on bulk IN)
 *
 * Which endpoints these are the descriptors tell. On each that goes in there are always
 * several transfers of a packet on their way, so that none is missed while another is
 * looked at; a packet is stamped where its transfer completes. When those that nobody reads
 * fill the room there is, no more are asked for: the device waits, and none is thrown away.
 */
#ifndef INCISE_POLHEMUS_USB_H
#define INCISE_POLHEMUS_USB_H

#include <incise/error.h>
#include "polhemus_line.h"

/*
 * @arguments "0f44:0002", "0f44:0002@1-1.2" (bus and ports), "0f44:0002#SERIAL". NULL with errno
 * EINVAL (also where several fit), ENODEV (none, or one that waits for its firmware), EACCES,
 * EBUSY, ENOMEM, EIO.
 */
struct polhemus_line *polhemus_usb_open(const char *arguments, const char *where,
					struct incise_error *err);

#endif
