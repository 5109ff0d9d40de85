// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The file of a V4L2 device; see v4l2_file.h.
 */
#include <errno.h>
#include <fcntl.h>
#include <sys/ioctl.h>
#include <linux/videodev2.h>
#include "v4l2_file.h"

#define TRIES 1000 /* so that endless signals do not block it */

int v4l2_open(const char *path)
{
	int fd = -1;

	for (int i = 0; i < TRIES && fd < 0; i++) {
		fd = open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
		if (fd < 0 && errno != EINTR)
			break;
	}
	return fd < 0 ? -errno : fd;
}

int v4l2_ask(int fd, unsigned long request, void *argument)
{
	for (int i = 0; i < TRIES; i++) {
		if (ioctl(fd, request, argument) >= 0)
			return 0;
		if (errno != EINTR)
			return -errno;
	}
	return -EINTR;
}

/* Text of a driver may be unterminated or unprintable. */
static void text_of_v4l2_file(char *text, size_t size, const unsigned char *from,
			      size_t length)
{
	size_t i;

	for (i = 0; i < length && i + 1 < size && from[i]; i++)
		text[i] = from[i] >= ' ' && from[i] < 127 ? (char)from[i] : '?';
	text[i] = '\0';
}

int v4l2_identify(int fd, struct v4l2_identity *identity)
{
	struct v4l2_capability reported = {0};
	int rc = v4l2_ask(fd, VIDIOC_QUERYCAP, &reported);

	if (rc)
		return rc == -EINVAL ? -ENOTTY : rc;
	text_of_v4l2_file(identity->card, sizeof(identity->card), reported.card,
			  sizeof(reported.card));
	text_of_v4l2_file(identity->driver, sizeof(identity->driver), reported.driver,
			  sizeof(reported.driver));
	text_of_v4l2_file(identity->bus, sizeof(identity->bus), reported.bus_info,
			  sizeof(reported.bus_info));
	identity->version = reported.version;
	/* A device may have several files with different capabilities. */
	identity->capabilities = reported.capabilities & V4L2_CAP_DEVICE_CAPS
					 ? reported.device_caps
					 : reported.capabilities;
	return 0;
}

char *v4l2_letters(uint32_t fourcc, char *text)
{
	for (int i = 0; i < 4; i++) {
		char letter = (char)(fourcc >> 8 * i & 0x7f);

		text[i] = letter >= ' ' && letter < 127 ? letter : '?';
	}
	text[4] = '\0';
	return text;
}
