/* SPDX-License-Identifier: GPL-2.0-or-later */
/*
 * A camera's driver that a test makes, by the kernel's documents of V4L2: the linker hands
 * open, ioctl, mmap, poll and the clock to functions here. It has formats, sizes, controls
 * and buffers, and can be set to lie. Frames come when a test shoots them, on a clock
 * that goes when somebody polls. The real drivers are asked in tests/vm.
 */
#ifndef INCISE_TEST_DRIVER_H
#define INCISE_TEST_DRIVER_H

#include <errno.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <poll.h>
#include <sys/mman.h>
#include <linux/videodev2.h>

#define DRIVER_FD 7777
#define DRIVER_BUFFERS 32
#define DRIVER_BYTES 4096 /* of a buffer */
#define DRIVER_CONTROLS 16
#define DRIVER_NONE UINT32_MAX

/* A frame as the driver hands it out. */
struct driver_frame {
	uint32_t index; /* DRIVER_NONE: a buffer that is queued */
	uint32_t sequence, flags, bytesused;
	int64_t t_ns;
};

struct driver_control {
	uint32_t id, flags;
	int32_t min, max, step, value;
	int32_t held; /* with stuck: what it is whatever is set */
	bool stuck;
	int error; /* of setting it */
};

static struct driver {
	pthread_mutex_t lock;
	/* Errors of calls; 0: none. */
	int open_error, querycap_error, g_fmt_error, s_fmt_error, reqbufs_error;
	int querybuf_error, streamon_error, qbuf_error, dqbuf_error, g_ctrl_error;
	int map_error, interrupted; /* calls that a signal interrupts first */
	uint32_t capabilities;
	/* Formats; the sizes and intervals are those of any of them. */
	uint32_t format[4];
	uint32_t size[8][2];
	bool stepwise;
	struct v4l2_fract interval[8];
	bool no_parm;
	struct v4l2_pix_format is,
		lie; /* lie: its fields other than 0 are reported instead */
	struct v4l2_fract parm;
	struct driver_control control[DRIVER_CONTROLS];
	/* Buffers. */
	uint32_t count, length, buffer_flags;
	uint8_t *memory;
	bool queued[DRIVER_BUFFERS];
	struct driver_frame shot[64];
	int shots, taken;
	short events; /* of poll(), beside POLLIN */
	int opened, mapped, streams;
	int64_t now_ns;
	bool stands;		 /* the clock, unless frames are shot */
	uint32_t given;		 /* buffers asked for */
	void (*meanwhile)(void); /* what another thread does in poll(), once */
} driver;

int __real_open(const char *path, int flags, ...);
int __real_close(int fd);
int __real_ioctl(int fd, unsigned long request, void *argument);
void *__real_mmap(void *at, size_t size, int prot, int flags, int fd, off_t offset);
int __real_munmap(void *at, size_t size);
int __real_poll(struct pollfd *fds, nfds_t n, int timeout);
int __real_clock_gettime(clockid_t clock, struct timespec *now);

/* A camera with nothing wrong: YUYV and MJPG, three sizes, two rates. */
static inline void driver_reset(void)
{
	static uint8_t memory[DRIVER_BUFFERS * DRIVER_BYTES]
		__attribute__((aligned(4096)));

	memset(&driver, 0, sizeof(driver));
	memset(memory, 0, sizeof(memory));
	pthread_mutex_init(&driver.lock, NULL);
	driver.memory = memory;
	driver.capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
	driver.format[0] = V4L2_PIX_FMT_YUYV;
	driver.format[1] = V4L2_PIX_FMT_MJPEG;
	driver.size[0][0] = 16, driver.size[0][1] = 8;
	driver.size[1][0] = 32, driver.size[1][1] = 24;
	driver.size[2][0] = 64, driver.size[2][1] = 32;
	driver.interval[0] = (struct v4l2_fract){1, 30};
	driver.interval[1] = (struct v4l2_fract){1, 60};
	driver.parm = driver.interval[0];
	driver.is.width = 16;
	driver.is.height = 8;
	driver.is.field = V4L2_FIELD_NONE;
	driver.length = DRIVER_BYTES;
	driver.buffer_flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
	driver.now_ns = 50000000000;
}

static inline struct driver_control *driver_control(uint32_t id)
{
	for (int i = 0; i < DRIVER_CONTROLS; i++)
		if (driver.control[i].id == id && id)
			return &driver.control[i];
	return NULL;
}

/* Give the camera a control; returns it. */
static inline struct driver_control *driver_add(uint32_t id, int32_t min, int32_t max,
						int32_t value)
{
	struct driver_control *control = driver.control;

	while (control->id)
		control++;
	*control = (struct driver_control){
		.id = id, .min = min, .max = max, .step = 1, .value = value};
	return control;
}

/*
 * A frame that comes next; one period later than the one before. What it returns may be
 * altered where no thread takes frames.
 */
static inline struct driver_frame *driver_shoot_flagged(uint32_t sequence, uint32_t flags)
{
	struct driver_frame *shot;

	pthread_mutex_lock(&driver.lock);
	shot = &driver.shot[driver.shots % 64];
	*shot = (struct driver_frame){
		.index = DRIVER_NONE,
		.sequence = sequence,
		.flags = driver.buffer_flags | flags,
		.bytesused = driver.is.sizeimage,
		.t_ns = driver.now_ns,
	};
	driver.now_ns += 33333333;
	driver.shots++;
	pthread_mutex_unlock(&driver.lock);
	return shot;
}

static inline struct driver_frame *driver_shoot(uint32_t sequence)
{
	return driver_shoot_flagged(sequence, 0);
}

static inline int driver_answer(int code)
{
	errno = code;
	return code ? -1 : 0;
}

int __wrap_open(const char *path, int flags, ...)
{
	if (!strstr(path, "/video"))
		return __real_open(path, flags, 0600);
	if (driver.interrupted-- > 0)
		return driver_answer(EINTR);
	if (driver.open_error)
		return driver_answer(driver.open_error);
	driver.opened++;
	return DRIVER_FD;
}

int __wrap_close(int fd)
{
	if (fd != DRIVER_FD)
		return __real_close(fd);
	driver.opened--;
	return 0;
}

static inline void driver_tell(struct v4l2_pix_format *format)
{
	*format = driver.is;
	if (driver.lie.pixelformat)
		format->pixelformat = driver.lie.pixelformat;
	if (driver.lie.width)
		format->width = driver.lie.width;
	if (driver.lie.height)
		format->height = driver.lie.height;
	if (driver.lie.field)
		format->field = driver.lie.field;
	if (driver.lie.bytesperline)
		format->bytesperline = driver.lie.bytesperline;
	if (driver.lie.sizeimage)
		format->sizeimage = driver.lie.sizeimage;
}

static inline int driver_set_format(struct v4l2_pix_format *format)
{
	uint32_t row = format->width * 2;

	if (format->pixelformat == V4L2_PIX_FMT_GREY)
		row = format->width;
	if (format->pixelformat == V4L2_PIX_FMT_RGB24)
		row = format->width * 3;
	if (format->pixelformat == V4L2_PIX_FMT_MJPEG)
		row = 0;
	driver.is = *format;
	driver.is.bytesperline = row;
	driver.is.sizeimage = row ? row * format->height : DRIVER_BYTES;
	driver_tell(format);
	return 0;
}

static inline int driver_query_control(struct v4l2_queryctrl *reported)
{
	const struct driver_control *control = driver_control(reported->id);

	if (!control)
		return EINVAL;
	reported->minimum = control->min;
	reported->maximum = control->max;
	reported->step = control->step;
	reported->flags = control->flags;
	return 0;
}

static inline int driver_get_control(struct v4l2_control *reported)
{
	const struct driver_control *control = driver_control(reported->id);

	if (!control || driver.g_ctrl_error)
		return control ? driver.g_ctrl_error : EINVAL;
	reported->value = control->stuck ? control->held : control->value;
	return 0;
}

static inline int driver_set_control(const struct v4l2_control *asked)
{
	struct driver_control *control = driver_control(asked->id);

	if (!control || control->error)
		return control ? control->error : EINVAL;
	if (asked->value < control->min || asked->value > control->max)
		return ERANGE;
	control->value = asked->value;
	return 0;
}

static inline int driver_size(struct v4l2_frmsizeenum *reported)
{
	if (driver.stepwise) {
		reported->type = V4L2_FRMSIZE_TYPE_STEPWISE;
		reported->stepwise = (struct v4l2_frmsize_stepwise){16, 64, 8, 8, 32, 8};
		return reported->index ? EINVAL : 0;
	}
	if (reported->index >= 8 || !driver.size[reported->index][0])
		return EINVAL;
	reported->type = V4L2_FRMSIZE_TYPE_DISCRETE;
	reported->discrete.width = driver.size[reported->index][0];
	reported->discrete.height = driver.size[reported->index][1];
	return 0;
}

static inline int driver_interval(struct v4l2_frmivalenum *reported)
{
	if (driver.stepwise) {
		reported->type = V4L2_FRMIVAL_TYPE_CONTINUOUS;
		reported->stepwise =
			(struct v4l2_frmival_stepwise){{1, 100}, {1, 5}, {1, 1000}};
		return reported->index ? EINVAL : 0;
	}
	if (reported->index >= 8 || !driver.interval[reported->index].denominator)
		return EINVAL;
	reported->type = V4L2_FRMIVAL_TYPE_DISCRETE;
	reported->discrete = driver.interval[reported->index];
	return 0;
}

static inline int driver_buffer(struct v4l2_buffer *buffer)
{
	if (driver.querybuf_error || buffer->index >= driver.given)
		return driver.querybuf_error ? driver.querybuf_error : EINVAL;
	buffer->length = driver.length;
	buffer->flags = driver.buffer_flags;
	buffer->m.offset = buffer->index * DRIVER_BYTES;
	return 0;
}

static inline int driver_dequeue(struct v4l2_buffer *buffer)
{
	const struct driver_frame *shot = &driver.shot[driver.taken % 64];
	uint32_t i = 0;

	if (driver.dqbuf_error)
		return driver.dqbuf_error;
	if (driver.taken == driver.shots)
		return EAGAIN;
	while (i < driver.given && !driver.queued[i])
		i++;
	if (i == driver.given)
		return EAGAIN;
	driver.taken++;
	if (shot->index != DRIVER_NONE)
		i = shot->index;
	if (i < DRIVER_BUFFERS)
		driver.queued[i] = false;
	buffer->index = i;
	buffer->sequence = shot->sequence;
	buffer->flags = shot->flags;
	buffer->bytesused = shot->bytesused;
	buffer->timestamp.tv_sec = shot->t_ns / 1000000000;
	buffer->timestamp.tv_usec = shot->t_ns % 1000000000 / 1000;
	/* The frame's number, so that a test sees which one it holds. */
	if (shot->index == DRIVER_NONE && driver.is.pixelformat != V4L2_PIX_FMT_MJPEG)
		memset(driver.memory + (size_t)i * DRIVER_BYTES, (int)shot->sequence,
		       DRIVER_BYTES);
	return 0;
}

static inline int driver_parm(unsigned long request, struct v4l2_streamparm *parm)
{
	if (driver.no_parm)
		return ENOTTY;
	if (request == VIDIOC_S_PARM)
		driver.parm = parm->parm.capture.timeperframe;
	parm->parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
	parm->parm.capture.timeperframe = driver.parm;
	return 0;
}

static inline int driver_call(unsigned long request, void *argument)
{
	struct v4l2_capability *cap = argument;
	struct v4l2_fmtdesc *format = argument;
	struct v4l2_buffer *buffer = argument;
	struct v4l2_requestbuffers *asked = argument;

	switch (request) {
	case VIDIOC_QUERYCAP:
		if (driver.querycap_error)
			return driver.querycap_error;
		/* not ended, and not all printable */
		memset(cap->card, 'C', sizeof(cap->card));
		cap->card[1] = '\n';
		strcpy((char *)cap->driver, "played");
		strcpy((char *)cap->bus_info, "usb-1");
		cap->capabilities = V4L2_CAP_DEVICE_CAPS | 0xff;
		cap->device_caps = driver.capabilities;
		return 0;
	case VIDIOC_ENUM_FMT:
		if (format->index >= 4 || !driver.format[format->index])
			return EINVAL;
		format->pixelformat = driver.format[format->index];
		return 0;
	case VIDIOC_ENUM_FRAMESIZES:
		return driver_size(argument);
	case VIDIOC_ENUM_FRAMEINTERVALS:
		return driver_interval(argument);
	case VIDIOC_G_FMT:
		driver_tell(&((struct v4l2_format *)argument)->fmt.pix);
		return driver.g_fmt_error;
	case VIDIOC_S_FMT:
		return driver.s_fmt_error
			       ? driver.s_fmt_error
			       : driver_set_format(
					 &((struct v4l2_format *)argument)->fmt.pix);
	case VIDIOC_G_PARM:
	case VIDIOC_S_PARM:
		return driver_parm(request, argument);
	case VIDIOC_QUERYCTRL:
		return driver_query_control(argument);
	case VIDIOC_G_CTRL:
		return driver_get_control(argument);
	case VIDIOC_S_CTRL:
		return driver_set_control(argument);
	case VIDIOC_REQBUFS:
		if (driver.reqbufs_error)
			return driver.reqbufs_error;
		driver.given = driver.count ? driver.count : asked->count;
		if (!asked->count)
			driver.given = 0;
		asked->count = driver.given;
		return 0;
	case VIDIOC_QUERYBUF:
		return driver_buffer(argument);
	case VIDIOC_QBUF:
		if (driver.qbuf_error || buffer->index >= driver.given ||
		    driver.queued[buffer->index])
			return driver.qbuf_error ? driver.qbuf_error : EINVAL;
		driver.queued[buffer->index] = true;
		return 0;
	case VIDIOC_DQBUF:
		return driver_dequeue(argument);
	case VIDIOC_STREAMON:
		driver.streams += !driver.streamon_error;
		return driver.streamon_error;
	case VIDIOC_STREAMOFF:
		driver.streams--;
		memset(driver.queued, 0, sizeof(driver.queued));
		return 0;
	default:
		return ENOTTY;
	}
}

int __wrap_ioctl(int fd, unsigned long request, void *argument)
{
	int code;

	if (fd != DRIVER_FD)
		return __real_ioctl(fd, request, argument);
	pthread_mutex_lock(&driver.lock);
	code = driver.interrupted-- > 0 ? EINTR : driver_call(request, argument);
	pthread_mutex_unlock(&driver.lock);
	return driver_answer(code);
}

void *__wrap_mmap(void *at, size_t size, int prot, int flags, int fd, off_t offset)
{
	if (fd != DRIVER_FD)
		return __real_mmap(at, size, prot, flags, fd, offset);
	if (driver.map_error) {
		errno = driver.map_error;
		return MAP_FAILED;
	}
	driver.mapped++;
	return driver.memory + offset;
}

int __wrap_munmap(void *at, size_t size)
{
	if ((uint8_t *)at < driver.memory ||
	    (uint8_t *)at >= driver.memory + DRIVER_BUFFERS * DRIVER_BYTES)
		return __real_munmap(at, size);
	driver.mapped--;
	return 0;
}

/* Waiting lets the clock go on. */
int __wrap_poll(struct pollfd *fds, nfds_t n, int timeout)
{
	void (*meanwhile)(void) = driver.meanwhile;
	bool ready;

	driver.meanwhile = NULL;
	if (meanwhile)
		meanwhile();
	pthread_mutex_lock(&driver.lock);
	ready = n && (driver.taken < driver.shots || driver.events || driver.dqbuf_error);
	if (n)
		fds->revents = ready ? (short)(POLLIN | driver.events) : 0;
	if (!ready && !driver.stands)
		driver.now_ns += timeout * 1000000LL;
	pthread_mutex_unlock(&driver.lock);
	/* A thread that waits for a frame lets the test run. */
	if (!ready && n)
		__real_poll(NULL, 0, 1);
	return ready;
}

int __wrap_clock_gettime(clockid_t clock, struct timespec *now)
{
	if (clock != CLOCK_MONOTONIC)
		return __real_clock_gettime(clock, now);
	pthread_mutex_lock(&driver.lock);
	now->tv_sec = driver.now_ns / 1000000000;
	now->tv_nsec = driver.now_ns % 1000000000;
	pthread_mutex_unlock(&driver.lock);
	return 0;
}

#endif
