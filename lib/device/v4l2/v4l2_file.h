/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The file of a V4L2 device, /dev/video0: non-blocking, with requests that signals do not
 * interrupt.
 */
#ifndef INCISE_V4L2_FILE_H
#define INCISE_V4L2_FILE_H

#include <stdint.h>

/* Identity of a device; the text is printable. */
struct v4l2_identity {
	char card[40], driver[24], bus[40];
	uint32_t capabilities; /* of this very file */
	uint32_t version;      /* of the driver */
};

/* A file descriptor, or a negative errno. */
int v4l2_open(const char *path);

/* 0 or a negative errno; -EINTR only where signals never end. */
int v4l2_ask(int fd, unsigned long request, void *argument);

/* 0; -ENOTTY: not a V4L2 device; -ENODEV. */
int v4l2_identify(int fd, struct v4l2_identity *identity);

/* The four letters of a pixel format; @text has 5 bytes. Returns @text. */
char *v4l2_letters(uint32_t fourcc, char *text);

#endif
