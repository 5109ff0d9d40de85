// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Feeds v4l2loopback until it is ended:
 *
 *   camera_feed /dev/video8 RATE
 *
 * grey frames of 320 x 240 pixels, YUYV, of which each is a level lighter than the one
 * before. Stopped and continued it goes on from then, as a camera does whose cable is loose.
 */
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>
#include <linux/videodev2.h>

#define WIDTH 320
#define HEIGHT 240

int main(int argc, char **argv)
{
	static uint8_t picture[WIDTH * HEIGHT * 2];
	struct v4l2_format format = {.type = V4L2_BUF_TYPE_VIDEO_OUTPUT};
	struct v4l2_streamparm parm = {.type = V4L2_BUF_TYPE_VIDEO_OUTPUT};
	unsigned int rate = argc == 3 ? (unsigned int)atoi(argv[2]) : 0;
	struct timespec period;
	int fd;

	if (!rate)
		return 2;
	period = (struct timespec){.tv_nsec = 1000000000L / rate - 1};
	fd = open(argv[1], O_RDWR);
	format.fmt.pix.width = WIDTH;
	format.fmt.pix.height = HEIGHT;
	format.fmt.pix.pixelformat = V4L2_PIX_FMT_YUYV;
	format.fmt.pix.field = V4L2_FIELD_NONE;
	format.fmt.pix.sizeimage = sizeof(picture);
	parm.parm.output.timeperframe.numerator = 1;
	parm.parm.output.timeperframe.denominator = rate;
	if (fd < 0 || ioctl(fd, VIDIOC_S_FMT, &format)) {
		perror(argv[1]);
		return 1;
	}
	ioctl(fd, VIDIOC_S_PARM, &parm); /* only what it says of itself */
	for (unsigned int n = 0;; n++) {
		memset(picture, (int)(n % 200 + 20), sizeof(picture));
		if (write(fd, picture, sizeof(picture)) != (ssize_t)sizeof(picture)) {
			perror(argv[1]);
			return 1;
		}
		nanosleep(&period, NULL);
	}
}
